//! Who has a pseudo-terminal open: the system tells each opening and each closing. Linux only.

use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd as _, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rustix::event::{PollFd, PollFlags};
use rustix::fs::inotify::{self, CreateFlags, ReadFlags, WatchFlags};
use rustix::fs::{Mode, OFlags};
use rustix::termios::{QueueSelector, tcflush};

use crate::system::inherited::Kept;

/// The openings of one pseudo-terminal.
#[derive(Debug)]
pub(super) struct Openings {
    path: PathBuf,
    told: Kept<OwnedFd>,
    closed: Mutex<u64>,
}

impl Openings {
    /// Of the pseudo-terminal at `path`.
    pub(super) fn of(path: &Path) -> io::Result<Self> {
        let told = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK)?;
        inotify::add_watch(&told, path, WatchFlags::OPEN | WatchFlags::CLOSE)?;
        Ok(Self { path: path.to_owned(), told: Kept::new(told), closed: Mutex::default() })
    }

    /// Ready when somebody opened or closed it.
    pub(super) fn waiting(&self) -> PollFd<'_> {
        PollFd::from_borrowed_fd(self.told.as_fd(), PollFlags::IN)
    }

    /// A count that rises when somebody closes it.
    pub(super) fn closed(&self) -> u64 {
        // Of several closings that nobody looked at the system may tell one.
        const CLOSED: ReadFlags =
            ReadFlags::CLOSE_WRITE.union(ReadFlags::CLOSE_NOWRITE).union(ReadFlags::QUEUE_OVERFLOW);

        let mut closed = self.closed.lock().unwrap_or_else(PoisonError::into_inner);
        let mut space = [MaybeUninit::uninit(); 1_024];
        let mut events = inotify::Reader::new(&*self.told, &mut space);
        while let Ok(event) = events.next() {
            *closed += u64::from(event.events().intersects(CLOSED));
        }
        *closed
    }

    /// Throws away what programs could still read. It counts as a closing.
    pub(super) fn forget_answers(&self) -> io::Result<()> {
        let how = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        Ok(tcflush(rustix::fs::open(&self.path, how, Mode::empty())?, QueueSelector::IFlush)?)
    }
}
