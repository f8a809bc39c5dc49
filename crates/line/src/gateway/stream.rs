//! What connects a client: bytes in and out, each within its time, and an end that both sides can bring.

use std::fmt::Debug;
use std::io::{self, ErrorKind, Read as _, Write as _};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::time::Duration;

#[cfg(target_os = "linux")]
use crate::system::clock::{monotonic, wait_for};
use crate::system::inherited::Kept;

/// How long a request may take to come whole, and a client to take an answer.
pub(super) const HURRY: Duration = Duration::from_secs(1);
/// How long a connection over the network stays open that asks nothing.
const IDLE: Duration = Duration::from_secs(60);
/// Bytes of answers that the system keeps for a client which does not read: more than those of all its requests on their way.
#[cfg(unix)]
const UNREAD: usize = 16_384;

/// One client's, as long as it is there. It is read by one thread, written by another, and ended by any.
pub(super) trait Stream: Debug + Send + Sync {
    /// Reads what is there, within that time; 0: the client has hung up, or it was ended.
    ///
    /// # Errors
    ///
    /// [`ErrorKind::WouldBlock`] and [`ErrorKind::TimedOut`]: nothing came.
    fn read(&self, bytes: &mut [u8], within: Duration) -> io::Result<usize>;

    /// Writes all of it.
    ///
    /// # Errors
    ///
    /// [`ErrorKind::WouldBlock`] and [`ErrorKind::TimedOut`]: the client did not take it in a [hurry](HURRY).
    fn write(&self, bytes: &[u8]) -> io::Result<()>;

    /// Ends it: who reads or writes is told at once.
    fn end(&self);

    /// Whether the client is gone, though what it sent is not all read.
    fn has_hung_up(&self) -> bool;

    /// How long it stays open where nothing is asked; `None`: it is in nobody's way.
    fn idle(&self) -> Option<Duration>;
}

/// A connection that a forked child does not keep open.
pub(super) fn over_tcp(stream: TcpStream) -> io::Result<Arc<dyn Stream>> {
    // An answer is one small message, and its client waits for it.
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(HURRY))?;
    #[cfg(unix)]
    rustix::net::sockopt::set_socket_send_buffer_size(&stream, UNREAD)?;
    Ok(Arc::new(Kept::new(stream)))
}

impl Stream for Kept<TcpStream> {
    fn read(&self, bytes: &mut [u8], within: Duration) -> io::Result<usize> {
        // The system takes no time-out below its own grain.
        self.set_read_timeout(Some(within.max(Duration::from_millis(1))))?;
        (&**self).read(bytes)
    }

    fn write(&self, bytes: &[u8]) -> io::Result<()> {
        (&**self).write_all(bytes)
    }

    fn end(&self) {
        // One that is gone already is ended as well.
        let _ = self.shutdown(Shutdown::Both);
    }

    #[cfg(target_os = "linux")]
    fn has_hung_up(&self) -> bool {
        use std::os::fd::AsFd as _;

        use rustix::event::PollFlags;

        let ended = PollFlags::RDHUP | PollFlags::HUP | PollFlags::ERR;
        let ready = wait_for(self.as_fd(), ended, monotonic());
        ready.is_ok_and(|ready| ready.is_some_and(|ready| ready.intersects(ended)))
    }

    /// Elsewhere it is seen by who reads what it sends.
    #[cfg(not(target_os = "linux"))]
    fn has_hung_up(&self) -> bool {
        false
    }

    fn idle(&self) -> Option<Duration> {
        Some(IDLE)
    }
}

/// Whether nothing came, or nothing was taken, in the time that there was.
pub(super) fn is_late(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}
