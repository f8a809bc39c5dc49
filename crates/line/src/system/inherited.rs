//! Descriptors that a forked child gives up: the lock of a port, its door, the connections behind it.
//!
//! A fork copies every descriptor, and what hangs on one lives until its last copy is closed: the lock of a port whose owner
//! was killed, a connection at whose other end somebody waits for an answer. `close-on-exec` helps who runs another program,
//! and not who goes on in a copy of this one. So each is listed while it is open, and the child puts `/dev/null` in its place
//! (`at_fork`).

use std::ops::{Deref, DerefMut};

#[cfg(unix)]
use crate::system::{at_fork, listed::Listed};

/// What has a descriptor that a forked child gives up.
#[derive(Debug)]
pub(crate) struct Kept<T> {
    /// Before what it lists, so that nobody gives up a number that is somebody else's by then.
    #[cfg(unix)]
    _listed: Listed,
    kept: T,
}

#[cfg(unix)]
impl<T: std::os::fd::AsFd> Kept<T> {
    pub(crate) fn new(kept: T) -> Self {
        at_fork::give_up_in_children();
        Self { _listed: Listed::new(&kept), kept }
    }

    /// What `open` opens, which no child has: one that was forked before it was listed would keep the lock that it is to get.
    #[cfg(any(feature = "serial", feature = "tcp", feature = "share"))]
    pub(crate) fn opened(mut open: impl FnMut() -> std::io::Result<T>) -> std::io::Result<Self> {
        loop {
            let forks = at_fork::Forks::now();
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

    #[cfg(any(feature = "serial", feature = "tcp", feature = "share"))]
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

#[cfg(all(test, unix))]
mod tests {
    use std::fs::File;
    use std::os::fd::{AsRawFd, RawFd};

    use super::*;
    use crate::system::listed::each;

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
