//! Waiting for many descriptors at once, with a deadline in nanoseconds.
//!
//! On Linux the kernel keeps the list, so that a wait costs the same for one line and for a hundred; elsewhere `poll`
//! is given the list each time.

use std::io;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use rustix::event::Timespec;

/// What to call a descriptor by.
pub(crate) type Key = u64;

/// `None` is for ever, and so is a time that is too long for the system.
fn timespec(timeout: Option<Duration>) -> Option<Timespec> {
    timeout.and_then(|timeout| Timespec::try_from(timeout).ok())
}

#[cfg(target_os = "linux")]
pub(crate) use linux::Watch;
#[cfg(not(target_os = "linux"))]
pub(crate) use other::Watch;

#[cfg(target_os = "linux")]
mod linux {
    use std::os::fd::OwnedFd;

    use rustix::event::{PollFd, PollFlags, epoll, poll};
    use rustix::io::Errno;

    use super::{BorrowedFd, Duration, Key, io, timespec};

    /// How many descriptors one look can find readable; the others are found by the next.
    const AT_ONCE: usize = 64;

    /// The descriptors that are waited for.
    #[derive(Debug)]
    pub(crate) struct Watch(OwnedFd);

    impl Watch {
        pub(crate) fn new() -> io::Result<Self> {
            Ok(Self(epoll::create(epoll::CreateFlags::CLOEXEC)?))
        }

        /// From now on `key` is named when `descriptor` is readable or hung up.
        pub(crate) fn add(&self, descriptor: BorrowedFd<'_>, key: Key) -> io::Result<()> {
            Ok(epoll::add(&self.0, descriptor, epoll::EventData::new_u64(key), epoll::EventFlags::IN)?)
        }

        /// To be called before `descriptor` is closed: a forked child may keep it open, and it would be watched still.
        pub(crate) fn remove(&self, descriptor: BorrowedFd<'_>) {
            // It fails only for what is not watched.
            let _ = epoll::delete(&self.0, descriptor);
        }

        /// Waits, and adds to `ready` what is readable.
        pub(crate) fn wait(&self, timeout: Option<Duration>, ready: &mut Vec<Key>) -> io::Result<()> {
            // `epoll_wait` itself counts in milliseconds.
            if timeout != Some(Duration::ZERO) {
                let mut any = [PollFd::new(&self.0, PollFlags::IN)];
                match poll(&mut any, timespec(timeout).as_ref()) {
                    Ok(0) | Err(Errno::INTR) => return Ok(()),
                    Ok(_) => {}
                    Err(error) => return Err(error.into()),
                }
            }
            let none = epoll::Event { flags: epoll::EventFlags::empty(), data: epoll::EventData::new_u64(0) };
            let mut events = [none; AT_ONCE];
            match epoll::wait(&self.0, &mut events, timespec(Some(Duration::ZERO)).as_ref()) {
                Ok(count) => ready.extend(events[..count].iter().map(|event| event.data.u64())),
                Err(Errno::INTR) => {}
                Err(error) => return Err(error.into()),
            }
            Ok(())
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod other {
    use std::os::fd::{AsFd, AsRawFd, OwnedFd, RawFd};
    use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

    use rustix::event::{PollFd, PollFlags, poll};
    use rustix::io::Errno;

    use super::{BorrowedFd, Duration, Key, io, timespec};

    /// One that is waited for: its number where it came from, and a copy that is ours.
    type Watched = (RawFd, Arc<OwnedFd>, Key);

    /// The descriptors that are waited for.
    #[derive(Debug, Default)]
    pub(crate) struct Watch(Mutex<Vec<Watched>>);

    impl Watch {
        #[expect(clippy::unnecessary_wraps, reason = "on Linux it can fail")]
        pub(crate) fn new() -> io::Result<Self> {
            Ok(Self::default())
        }

        /// From the next wait on `key` is named when `descriptor` is readable or hung up.
        pub(crate) fn add(&self, descriptor: BorrowedFd<'_>, key: Key) -> io::Result<()> {
            let copy = Arc::new(descriptor.try_clone_to_owned()?);
            self.lock().push((descriptor.as_raw_fd(), copy, key));
            Ok(())
        }

        /// To be called before `descriptor` is closed.
        pub(crate) fn remove(&self, descriptor: BorrowedFd<'_>) {
            self.lock().retain(|(number, _, _)| *number != descriptor.as_raw_fd());
        }

        /// Waits, and adds to `ready` what is readable.
        pub(crate) fn wait(&self, timeout: Option<Duration>, ready: &mut Vec<Key>) -> io::Result<()> {
            let watched: Vec<Watched> = self.lock().clone();
            let mut descriptors: Vec<PollFd<'_>> =
                watched.iter().map(|(_, copy, _)| PollFd::from_borrowed_fd(copy.as_fd(), PollFlags::IN)).collect();
            match poll(&mut descriptors, timespec(timeout).as_ref()) {
                Ok(_) | Err(Errno::INTR) => {}
                Err(error) => return Err(error.into()),
            }
            let found = descriptors.iter().zip(&watched).filter(|(found, _)| !found.revents().is_empty());
            ready.extend(found.map(|(_, (_, _, key))| *key));
            Ok(())
        }

        fn lock(&self) -> MutexGuard<'_, Vec<Watched>> {
            self.0.lock().unwrap_or_else(PoisonError::into_inner)
        }
    }
}
