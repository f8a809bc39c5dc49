//! The sockets of the door, and how it is waited for who knocks there. As in `sync`, a test has others in their place.

use std::io;
use std::os::unix::net::UnixListener;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

pub(crate) use std::net::Shutdown;
pub(crate) use std::os::unix::net::UnixStream;

/// What has come to who stands at a door.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Came {
    /// The other end of what it is woken by is gone.
    End,
    /// Somebody knocks, or the time is over.
    Knock,
}

/// Waits until somebody knocks at one of `listeners`, or the other end of `woken` is gone; as long as `time`, or without an
/// end.
///
/// # Errors
///
/// The system's; [`io::ErrorKind::Interrupted`] where a signal came.
pub(crate) fn wait_for_a_knock<'a>(
    listeners: impl Iterator<Item = &'a UnixListener>,
    woken: &UnixStream,
    time: Option<Duration>,
) -> io::Result<Came> {
    let time = time.and_then(|time| Timespec::try_from(time).ok());
    let doors = listeners.map(|listener| PollFd::new(listener, PollFlags::IN));
    let mut descriptors: Vec<_> = std::iter::once(PollFd::new(woken, PollFlags::IN)).chain(doors).collect();
    poll(&mut descriptors, time.as_ref())?;
    Ok(if descriptors[0].revents().is_empty() { Came::Knock } else { Came::End })
}
