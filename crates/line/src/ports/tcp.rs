//! RTU over TCP: the frames of a serial line through a serial server, as raw bytes.
//!
//! The server sends what it is given as characters of its own line, so the silences and character times are those of
//! that line. What Modbus TCP adds, a header instead of CRC and silence, is in [`mbap`](crate::mbap).

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};

use drivebus_rtu::{Duration, Instant, SerialFormat};

use crate::line::{Line, PortError, PortErrorKind};
use crate::system::clock::{monotonic, sleep_until};
use crate::system::inherited::Kept;

/// How long the network may take no byte of what it is given before the connection counts as lost.
const STALL: Duration = Duration::from_millis(80);

/// How long what was sent may stay unconfirmed before the connection counts as lost.
///
/// Without it the system keeps on trying for a quarter of an hour, and a server that is reached again then gets every
/// request of that time at once, commands that nobody wants any more among them.
#[cfg(target_os = "linux")]
const UNCONFIRMED: Duration = Duration::from_secs(3);

/// A TCP connection to a serial server that passes bytes through.
#[derive(Debug)]
pub struct RtuOverTcp {
    connection: Connection,
    format: SerialFormat,
    /// When the last character handed over will have left the server's line, its delays not counted.
    wire_free: Instant,
}

impl RtuOverTcp {
    /// Connects to `host` (a name or an address) and `port`, whose serial line runs with `format`.
    ///
    /// Blocks for `timeout` at the longest for each address the name has, and for as long as the system takes to look
    /// the name up.
    ///
    /// # Errors
    ///
    /// [`PortErrorKind::NotFound`]: no such host, nobody listens, or nobody answers in time.
    pub fn connect(host: &str, port: u16, format: &SerialFormat, timeout: Duration) -> Result<Self, PortError> {
        let connection = Connection::open("socket", host, port, timeout)?;
        Ok(Self { connection, format: *format, wire_free: Instant::ZERO })
    }
}

impl Line for RtuOverTcp {
    fn now(&self) -> Instant {
        monotonic()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        self.connection.send(bytes)?;
        let starts = self.wire_free.max(monotonic());
        self.wire_free = starts + self.format.chars(u32::try_from(bytes.len()).unwrap_or(u32::MAX));
        Ok(self.wire_free)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        self.connection.receive(buffer, until)
    }

    fn sleep(&mut self, until: Instant) {
        sleep_until(until);
    }

    fn name(&self) -> String {
        self.connection.name.clone()
    }

    fn connected_to(&self) -> Option<SocketAddr> {
        self.connection.stream.peer_addr().ok()
    }

    /// Some servers copy every byte of their line to all clients.
    fn may_have_others(&self) -> bool {
        true
    }

    /// The server's own transceiver may hear what it sends, as an adapter's may.
    fn may_echo(&self) -> bool {
        true
    }
}

/// What is said of a connection that ends where an answer was the last thing on it.
const BEHIND_ITS_ANSWER: &str = "the other side closed it behind its answer (a server that does so after each answer has to be set \
                                 to keep the connection open: a master makes sure of a unit by more than one request)";

/// What both kinds of TCP line share: bytes through a socket, with deadlines on our clock.
#[derive(Debug)]
pub(crate) struct Connection {
    stream: Kept<TcpStream>,
    /// As the user would write it: `scheme://host:port`.
    pub(crate) name: String,
    /// Whether something came since the latest request.
    answered: bool,
}

impl Connection {
    /// Connects, to the first of the host's addresses that answers within `timeout`.
    pub(crate) fn open(scheme: &str, host: &str, port: u16, timeout: Duration) -> Result<Self, PortError> {
        let name = if host.contains(':') {
            format!("{scheme}://[{host}]:{port}") // an IPv6 address
        } else {
            format!("{scheme}://{host}:{port}")
        };
        let addresses = (host, port).to_socket_addrs().map_err(|error| {
            let message = format!("there is no host {host:?} ({error}); check its name, or use its address");
            PortError::new(PortErrorKind::NotFound, &name, message)
        })?;
        // Zero would be refused as an argument; it means "now or never" here.
        let timeout = timeout.max(Duration::from_millis(1));
        let mut failure = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
        for address in addresses {
            match TcpStream::connect_timeout(&address, timeout).and_then(prepared) {
                Ok(stream) => return Ok(Self { stream: Kept::new(stream), name, answered: false }),
                Err(error) => failure = error,
            }
        }
        Err(connect_error(name, timeout, &failure))
    }

    /// Hands over all of `bytes`.
    pub(crate) fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let answered = std::mem::take(&mut self.answered);
        self.stream.write_all(bytes).map_err(|error| match error.kind() {
            io::ErrorKind::BrokenPipe | io::ErrorKind::ConnectionReset if answered => self.lost(BEHIND_ITS_ANSWER),
            io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut => self.lost("it takes no more bytes"),
            _ => self.lost(error),
        })
    }

    /// Waits for bytes until `until`, and returns how many came; 0 when none did.
    pub(crate) fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        if buffer.is_empty() {
            sleep_until(until);
            return Ok(0); // a read of nothing would look like the end of the connection
        }
        loop {
            if !wait(&self.stream, until).map_err(|error| self.lost(error))? {
                return Ok(0);
            }
            match self.stream.read(buffer) {
                Ok(0) if self.answered => return Err(self.lost(BEHIND_ITS_ANSWER)),
                Ok(0) => return Err(self.lost("the other side closed it")),
                Ok(count) => {
                    self.answered = true;
                    return Ok(count);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(self.lost(error)),
            }
        }
    }

    /// The connection is of no more use, for `reason`.
    pub(crate) fn lost(&self, reason: impl std::fmt::Display) -> PortError {
        let message = format!(
            "the connection is gone: {reason}; check the network and whether the server allows one client only; a bus \
             connects again at its next call"
        );
        PortError::new(PortErrorKind::Lost, &self.name, message)
    }
}

/// Each write leaves at once, and none blocks for long. Reads wait on our own clock first.
fn prepared(stream: TcpStream) -> io::Result<TcpStream> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(STALL))?;
    #[cfg(target_os = "linux")]
    rustix::net::sockopt::set_tcp_user_timeout(&stream, u32::try_from(UNCONFIRMED.as_millis()).unwrap_or(u32::MAX))?;
    Ok(stream)
}

/// Whether there is something to read, the end included, before `until`.
#[cfg(unix)]
fn wait(stream: &TcpStream, until: Instant) -> io::Result<bool> {
    use std::os::fd::AsFd;

    let ready = crate::system::clock::wait_for(stream.as_fd(), rustix::event::PollFlags::IN, until)?;
    Ok(ready.is_some())
}

/// Whether there is something to read, the end included, before `until`.
#[cfg(not(unix))]
fn wait(stream: &TcpStream, until: Instant) -> io::Result<bool> {
    loop {
        let left = until.saturating_duration_since(monotonic());
        stream.set_read_timeout(Some(left.max(Duration::from_millis(1))))?;
        match stream.peek(&mut [0]) {
            Ok(_) => return Ok(true),
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                if monotonic() >= until {
                    return Ok(false);
                }
            }
            Err(error) => return Err(error),
        }
    }
}

/// Why nobody could be reached, and what to do about it.
fn connect_error(name: String, timeout: Duration, error: &io::Error) -> PortError {
    let (kind, message) = match error.kind() {
        io::ErrorKind::ConnectionRefused => (
            PortErrorKind::NotFound,
            "the host is there, but nobody listens on this port; check the port number and the server's mode"
                .to_owned(),
        ),
        io::ErrorKind::TimedOut => (
            PortErrorKind::NotFound,
            format!("nobody answers within {timeout:?}; is the server on, and on this network?"),
        ),
        io::ErrorKind::PermissionDenied => {
            (PortErrorKind::Denied, format!("this machine does not allow the connection ({error}); check its firewall"))
        }
        _ => (PortErrorKind::NotFound, format!("it cannot be reached ({error}); check the address and the network")),
    };
    PortError::new(kind, name, message)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::net::TcpListener;

    use super::*;

    #[test]
    fn a_server_that_hangs_up_after_an_answer_is_told_from_one_that_says_nothing() {
        for (answer, said) in [(&b"\x01"[..], true), (b"", false)] {
            let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
            let port = listener.local_addr().unwrap().port();
            let mut connection = Connection::open("socket", "127.0.0.1", port, Duration::from_secs(20)).unwrap();
            let (mut server, _) = listener.accept().unwrap();
            connection.send(b"?").unwrap();
            server.read_exact(&mut [0]).unwrap();
            server.write_all(answer).unwrap();
            drop(server);
            let far = monotonic() + Duration::from_secs(20);
            let mut came = 0;
            let error = loop {
                match connection.receive(&mut [0; 8], far) {
                    Ok(count) => came += count,
                    Err(error) => break error,
                }
            };
            assert_eq!((came, error.message.contains("behind its answer")), (answer.len(), said), "{error}");
        }
    }

    #[test]
    fn what_nobody_confirms_is_not_kept_for_long() {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        let connection = Connection::open("socket", "127.0.0.1", port, Duration::from_secs(20)).unwrap();
        assert_eq!(rustix::net::sockopt::tcp_user_timeout(&*connection.stream).unwrap(), 3_000); // milliseconds
    }
}
