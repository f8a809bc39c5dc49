//! The connections between programs, and how it is waited for who knocks. As in `sync`, a test has others in their place.

mod loopback;

use std::io;
use std::net::TcpListener;
#[cfg(unix)]
use std::os::fd::{AsFd, BorrowedFd};
#[cfg(unix)]
use std::os::unix::net::{UnixListener, UnixStream};
#[cfg(windows)]
use std::os::windows::io::{AsSocket, BorrowedSocket};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
#[cfg(unix)]
use rustix::{io::Errno, net::SendFlags};

pub(crate) use std::net::Shutdown;

pub(crate) use loopback::Loopback;

/// What a write to who is gone is to be: an error, and no signal that ends the program. Apple has this of a socket, not of a
/// write.
#[cfg(all(unix, not(target_vendor = "apple")))]
const QUIETLY: SendFlags = SendFlags::NOSIGNAL;
#[cfg(target_vendor = "apple")]
const QUIETLY: SendFlags = SendFlags::empty();
/// What is asked of a connection to hear that its other side is gone: some systems tell only by its end of it, and Windows
/// takes no question for what it tells anyway.
#[cfg(any(target_os = "linux", target_os = "android"))]
const GONE: PollFlags = PollFlags::RDHUP;
#[cfg(windows)]
const GONE: PollFlags = PollFlags::empty();
#[cfg(not(any(target_os = "linux", target_os = "android", windows)))]
const GONE: PollFlags = PollFlags::HUP;

/// One end of a connection.
#[derive(Debug)]
pub(crate) enum Stream {
    #[cfg(unix)]
    Unix(UnixStream),
    Tcp(Loopback),
}

/// Where programs knock.
#[derive(Debug)]
pub(crate) enum Listener {
    #[cfg(unix)]
    Unix(UnixListener),
    Tcp(TcpListener),
}

/// How long a write waits for room.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Waits {
    /// Not at all.
    No,
    /// As long as was [said](Stream::leaves_unread).
    AWhile,
}

impl Stream {
    /// Two ends of one connection.
    pub(crate) fn pair() -> io::Result<(Self, Self)> {
        #[cfg(unix)]
        return UnixStream::pair().map(|(one, other)| (Self::Unix(one), Self::Unix(other)));
        #[cfg(not(unix))]
        Loopback::pair().map(|(one, other)| (Self::Tcp(one), Self::Tcp(other)))
    }

    /// The other side may leave unread for `patience` what it is told.
    pub(crate) fn leaves_unread(&mut self, patience: Duration) -> io::Result<()> {
        match self {
            #[cfg(unix)]
            Self::Unix(stream) => {
                stream.set_nonblocking(false)?;
                stream.set_write_timeout(Some(patience))?;
                #[cfg(target_vendor = "apple")]
                rustix::net::sockopt::set_socket_nosigpipe(&*stream, true)?;
                Ok(())
            }
            Self::Tcp(stream) => {
                stream.leaves_unread(patience);
                Ok(())
            }
        }
    }

    /// Sends some of `bytes`.
    ///
    /// # Errors
    ///
    /// [`io::ErrorKind::WouldBlock`]: there was no room.
    pub(crate) fn send(&self, bytes: &[u8], waits: Waits) -> io::Result<usize> {
        match self {
            #[cfg(unix)]
            Self::Unix(stream) => {
                let how = if waits == Waits::No { SendFlags::DONTWAIT } else { SendFlags::empty() };
                loop {
                    match rustix::net::send(stream, bytes, how | QUIETLY) {
                        Err(Errno::INTR) => {}
                        result => return Ok(result?),
                    }
                }
            }
            Self::Tcp(stream) => stream.send(bytes, waits),
        }
    }

    /// Reads what has come; 0: nothing comes any more.
    ///
    /// # Errors
    ///
    /// [`io::ErrorKind::WouldBlock`], [`io::ErrorKind::Interrupted`]: nothing has come yet.
    pub(crate) fn read(&self, bytes: &mut [u8]) -> io::Result<usize> {
        match self {
            #[cfg(unix)]
            Self::Unix(stream) => io::Read::read(&mut &*stream, bytes),
            Self::Tcp(stream) => stream.read(bytes),
        }
    }

    /// Whether the other side is still there.
    pub(crate) fn is_there(&self) -> bool {
        let mut descriptors = [PollFd::new(self, GONE)];
        let now = Timespec { tv_sec: 0, tv_nsec: 0 };
        !matches!(poll(&mut descriptors, Some(&now)), Ok(1..))
    }

    /// Ends it, or one of its directions: who waits for it is told at once, or [soon](Self::looks_up).
    pub(crate) fn shutdown(&self, how: Shutdown) -> io::Result<()> {
        match self {
            #[cfg(unix)]
            Self::Unix(stream) => stream.shutdown(how),
            Self::Tcp(stream) => stream.shutdown(how),
        }
    }

    /// How often who waits for it has to look whether it was [ended](Self::is_ended) here; `None`: the system tells.
    pub(crate) fn looks_up(&self) -> Option<Duration> {
        match self {
            #[cfg(unix)]
            Self::Unix(_) => None,
            Self::Tcp(_) => Some(Loopback::LOOKS_UP),
        }
    }

    /// Whether it was ended here, where the system may not tell who waits for it.
    pub(crate) fn is_ended(&self) -> bool {
        match self {
            #[cfg(unix)]
            Self::Unix(_) => false,
            Self::Tcp(stream) => stream.is_ended(),
        }
    }
}

impl Listener {
    /// Lets in one that knocks.
    ///
    /// # Errors
    ///
    /// [`io::ErrorKind::WouldBlock`]: nobody knocks. [`io::ErrorKind::ConnectionAborted`]: who did has gone. Others: the
    /// system has nothing left for it.
    pub(crate) fn accept(&self) -> io::Result<Stream> {
        match self {
            #[cfg(unix)]
            Self::Unix(listener) => listener.accept().map(|(stream, _)| Stream::Unix(stream)),
            Self::Tcp(listener) => {
                let (stream, _) = listener.accept()?;
                // Some systems take no option of a connection that is gone by now.
                let stream = Loopback::new(stream).map_err(|_| io::ErrorKind::ConnectionAborted)?;
                Ok(Stream::Tcp(stream))
            }
        }
    }
}

#[cfg(unix)]
impl AsFd for Stream {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Unix(stream) => stream.as_fd(),
            Self::Tcp(stream) => stream.as_fd(),
        }
    }
}

#[cfg(unix)]
impl AsFd for Listener {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Unix(listener) => listener.as_fd(),
            Self::Tcp(listener) => listener.as_fd(),
        }
    }
}

#[cfg(windows)]
impl AsSocket for Stream {
    fn as_socket(&self) -> BorrowedSocket<'_> {
        let Self::Tcp(stream) = self;
        stream.as_socket()
    }
}

#[cfg(windows)]
impl AsSocket for Listener {
    fn as_socket(&self) -> BorrowedSocket<'_> {
        let Self::Tcp(listener) = self;
        listener.as_socket()
    }
}

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
    listeners: impl Iterator<Item = &'a Listener>,
    woken: &Stream,
    time: Option<Duration>,
) -> io::Result<Came> {
    let time = time.and_then(|time| Timespec::try_from(time).ok());
    let doors = listeners.map(|listener| PollFd::new(listener, PollFlags::IN));
    let mut descriptors: Vec<_> = std::iter::once(PollFd::new(woken, PollFlags::IN)).chain(doors).collect();
    poll(&mut descriptors, time.as_ref())?;
    Ok(if descriptors[0].revents().is_empty() { Came::Knock } else { Came::End })
}
