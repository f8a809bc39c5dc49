//! The list of the descriptors that a forked child gives up.
//!
//! It is read after a fork, when nobody lets go of a lock that another thread held: it has none.

use std::fs::{File, OpenOptions};
use std::os::fd::{AsFd, AsRawFd, RawFd};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicI32, Ordering};

/// No descriptor has this number.
const FREE: i32 = -1;

/// Some places of the list, and those that were needed beyond.
struct Block {
    places: [AtomicI32; 64],
    next: OnceLock<Box<Self>>,
}

impl Block {
    const fn new() -> Self {
        Self { places: [const { AtomicI32::new(FREE) }; 64], next: OnceLock::new() }
    }
}

static FIRST: Block = Block::new();
static NOTHING: OnceLock<Option<File>> = OnceLock::new();

/// A place in the list, until this is dropped.
#[derive(Debug)]
pub(super) struct Listed(&'static AtomicI32);

impl Listed {
    pub(super) fn new(descriptor: &impl AsFd) -> Self {
        // Before it is needed: a child may find no descriptor free.
        NOTHING.get_or_init(|| OpenOptions::new().read(true).write(true).open("/dev/null").ok());
        let number = descriptor.as_fd().as_raw_fd();
        let takes =
            |place: &&AtomicI32| place.compare_exchange(FREE, number, Ordering::AcqRel, Ordering::Relaxed).is_ok();
        let mut block = &FIRST;
        loop {
            if let Some(place) = block.places.iter().find(takes) {
                return Self(place);
            }
            block = block.next.get_or_init(|| Box::new(Block::new()));
        }
    }
}

impl Drop for Listed {
    fn drop(&mut self) {
        self.0.store(FREE, Ordering::Release);
    }
}

/// Gives each descriptor that is listed to `give_up`, with an open `/dev/null`. It allocates nothing and waits for nobody.
pub(super) fn each(mut give_up: impl FnMut(RawFd, RawFd)) {
    let Some(Some(nothing)) = NOTHING.get() else { return };
    let blocks = std::iter::successors(Some(&FIRST), |block| block.next.get().map(|next| &**next));
    let numbers = blocks.flat_map(|block| &block.places).map(|place| place.load(Ordering::Acquire));
    numbers.filter(|number| *number != FREE).for_each(|number| give_up(nothing.as_raw_fd(), number));
}
