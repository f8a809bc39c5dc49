//! A connection of TCP within this machine. It never blocks: Windows has no other way to leave a message out that finds no
//! room.

use std::io::{self, Read as _, Write as _};
use std::net::{Shutdown, TcpStream};
#[cfg(unix)]
use std::os::fd::BorrowedFd;
#[cfg(windows)]
use std::os::windows::io::{AsSocket, BorrowedSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rustix::event::PollFlags;
use rustix::fd::AsFd;

use super::Waits;
use crate::system::clock::{monotonic, wait_for};

/// One end of it.
#[derive(Debug)]
pub(crate) struct Loopback {
    stream: TcpStream,
    patience: Duration,
    /// Whether nothing more is to be heard here.
    is_ended: AtomicBool,
}

impl Loopback {
    /// How often who waits for it looks whether it was ended here. No document of Windows says that its poll ends then.
    pub(super) const LOOKS_UP: Duration = Duration::from_millis(100);

    pub(crate) fn new(stream: TcpStream) -> io::Result<Self> {
        // Each message is one, and somebody waits for it.
        stream.set_nodelay(true)?;
        stream.set_nonblocking(true)?;
        Ok(Self { stream, patience: Duration::ZERO, is_ended: AtomicBool::new(false) })
    }

    /// Two ends of one connection.
    #[cfg(any(test, not(unix)))]
    pub(crate) fn pair() -> io::Result<(Self, Self)> {
        let listener = std::net::TcpListener::bind((std::net::Ipv4Addr::LOCALHOST, 0))?;
        let one = TcpStream::connect(listener.local_addr()?)?;
        loop {
            let (other, from) = listener.accept()?;
            // Anybody may have knocked there.
            if from == one.local_addr()? {
                return Ok((Self::new(one)?, Self::new(other)?));
            }
        }
    }

    pub(super) fn leaves_unread(&mut self, patience: Duration) {
        self.patience = patience;
    }

    pub(super) fn send(&self, bytes: &[u8], waits: Waits) -> io::Result<usize> {
        let end = monotonic() + self.patience;
        loop {
            match (&self.stream).write(bytes) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock && waits == Waits::AWhile => {
                    if wait_for(self.stream.as_fd(), PollFlags::OUT, end)?.is_none() {
                        return Err(error);
                    }
                }
                result => return result,
            }
        }
    }

    pub(super) fn read(&self, bytes: &mut [u8]) -> io::Result<usize> {
        (&self.stream).read(bytes)
    }

    pub(super) fn shutdown(&self, how: Shutdown) -> io::Result<()> {
        if how != Shutdown::Write {
            self.is_ended.store(true, Ordering::Release);
        }
        self.stream.shutdown(how)
    }

    pub(super) fn is_ended(&self) -> bool {
        self.is_ended.load(Ordering::Acquire)
    }
}

#[cfg(unix)]
impl AsFd for Loopback {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.stream.as_fd()
    }
}

#[cfg(windows)]
impl AsSocket for Loopback {
    fn as_socket(&self) -> BorrowedSocket<'_> {
        self.stream.as_socket()
    }
}
