//! Descriptors that a forked child gives up: the lock of a port, its door, the connections behind it.
//!
//! A fork copies every descriptor, and what hangs on one lives until its last copy is closed: the lock of a port whose owner
//! was killed, a connection at whose other end somebody waits for an answer. `close-on-exec` helps who runs another program,
//! and not who goes on in a copy of this one. So each is listed while it is open, and the child puts `/dev/null` in its place
//! (`at_fork`).
//!
//! The list is read after a fork, when nobody lets go of a lock that another thread held: it has none.

use std::ops::{Deref, DerefMut};

#[cfg(unix)]
pub(super) use list::each;

/// What has a descriptor that a forked child gives up.
#[derive(Debug)]
pub(crate) struct Kept<T> {
    /// Before what it lists, so that nobody gives up a number that is somebody else's by then.
    #[cfg(unix)]
    _listed: list::Listed,
    kept: T,
}

#[cfg(unix)]
impl<T: std::os::fd::AsFd> Kept<T> {
    pub(crate) fn new(kept: T) -> Self {
        Self { _listed: list::Listed::new(&kept), kept }
    }

    /// What `open` opens, which no child has: one that was forked before it was listed would keep the lock that it is to get.
    #[cfg(any(feature = "serial", feature = "share"))]
    pub(crate) fn opened(mut open: impl FnMut() -> std::io::Result<T>) -> std::io::Result<Self> {
        loop {
            let forks = crate::system::at_fork::Forks::now();
            let kept = Self::new(open()?);
            if !forks.has_one_begun() {
                return Ok(kept);
            }
        }
    }
}

#[cfg(not(unix))]
impl<T> Kept<T> {
    pub(crate) fn new(kept: T) -> Self {
        Self { kept }
    }

    #[cfg(any(feature = "serial", feature = "share"))]
    pub(crate) fn opened(mut open: impl FnMut() -> std::io::Result<T>) -> std::io::Result<Self> {
        open().map(Self::new)
    }
}

impl<T> Deref for Kept<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.kept
    }
}

impl<T> DerefMut for Kept<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.kept
    }
}

#[cfg(unix)]
mod list {
    use std::fs::{File, OpenOptions};
    use std::os::fd::{AsFd, AsRawFd, RawFd};
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicI32, Ordering};

    use crate::system::at_fork::give_up_in_children;

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
            give_up_in_children();
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
    pub(in crate::system) fn each(mut give_up: impl FnMut(RawFd, RawFd)) {
        let Some(Some(nothing)) = NOTHING.get() else { return };
        let blocks = std::iter::successors(Some(&FIRST), |block| block.next.get().map(|next| &**next));
        let numbers = blocks.flat_map(|block| &block.places).map(|place| place.load(Ordering::Acquire));
        numbers.filter(|number| *number != FREE).for_each(|number| give_up(nothing.as_raw_fd(), number));
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs::File;
    use std::os::fd::{AsRawFd, RawFd};

    use super::*;

    fn listed() -> Vec<RawFd> {
        let mut numbers = Vec::new();
        each(|_, number| numbers.push(number));
        numbers
    }

    #[test]
    fn what_is_open_is_listed_for_as_long_as_it_is_however_much_it_is() {
        let files: Vec<_> = (0..200).map(|_| File::open("/dev/null").unwrap()).collect();
        let numbers: Vec<_> = files.iter().map(AsRawFd::as_raw_fd).collect();
        let held: Vec<_> = files.iter().map(Kept::new).collect();
        let now = listed();
        assert!(numbers.iter().all(|number| now.contains(number)));
        drop(held);
        let now = listed();
        assert!(!numbers.iter().any(|number| now.contains(number)));
    }
}
