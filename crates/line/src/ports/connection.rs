//! What both kinds of TCP line share: bytes through a socket, with deadlines on our clock, and a server that closes it.
//!
//! Servers close for several reasons. Some do so behind each answer: then each request gets a connection of its own, made
//! before the request goes out, and to those above it is one line that goes on. A connection that ended at another time,
//! as after minutes in which nobody asked, is lost: who is behind the next one has to be asked anew. Neither costs a request,
//! as it is looked at before one is sent. A request that was sent when the connection ended may have been carried out.

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream, ToSocketAddrs};

use drivebus_rtu::{Duration, Frame, Instant, MAX_ADU};

use crate::line::{PortError, PortErrorKind};
use crate::ports::closing::Closing;
use crate::system::clock::{monotonic, sleep_until};
use crate::system::inherited::Kept;

mod unconfirmed;

/// How long after its answer a server closes that closes because of it.
const SOON: Duration = Duration::from_secs(1);

/// How long it is waited behind the first answer of a server for the end that may come with it: what is sent into a
/// connection that ends just then, nobody can tell from what was carried out. Once for each bus.
const FIRST_LOOK: Duration = Duration::from_millis(20);

/// How long a server that closed may take to accept the next connection, and how long to listen again at all: some take one
/// client and then set up anew.
const RENEWED: Duration = Duration::from_secs(1);
const LISTENS_AGAIN: Duration = Duration::from_millis(250);
const REFUSED_PAUSE: Duration = Duration::from_millis(10);

/// How long the network may take no byte of what it is given before the connection counts as lost.
const STALL: Duration = Duration::from_millis(80);

/// One connection after the other to one server.
#[derive(Debug)]
pub(crate) struct Connection {
    stream: Kept<TcpStream>,
    /// As the user would write it: `scheme://host:port`.
    pub(crate) name: String,
    /// Where it leads.
    pub(crate) address: SocketAddr,
    timeout: Duration,
    closing: Closing,
    /// Whether the system gives up what stays unconfirmed.
    ends_in_time: bool,
    /// Whether a request went over it; whether it was looked at since the last bytes went or came.
    is_used: bool,
    pub(crate) is_ready: bool,
    /// What came since the latest request, and when the last of it did.
    came: Vec<u8>,
    answered: Option<Instant>,
    /// When the last bytes came before that request.
    answered_before: Option<Instant>,
    /// How often it was made anew.
    renewed: u64,
}

impl Connection {
    /// Connects, to the first of the host's addresses that answers within `timeout`.
    pub(crate) fn open(
        scheme: &str,
        host: &str,
        port: u16,
        timeout: Duration,
        closing: &Closing,
    ) -> Result<Self, PortError> {
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
                Ok((stream, ends_in_time)) => {
                    return Ok(Self {
                        stream: Kept::new(stream),
                        name,
                        address,
                        timeout,
                        closing: closing.clone(),
                        ends_in_time,
                        is_used: false,
                        is_ready: false,
                        came: Vec::new(),
                        answered: None,
                        answered_before: None,
                        renewed: 0,
                    });
                }
                Err(error) => failure = error,
            }
        }
        Err(connect_error(name, timeout, &failure))
    }

    /// Looks whether it will carry a request, and makes it anew where the server closed it behind its answer. Whether it did.
    ///
    /// # Errors
    ///
    /// [`PortErrorKind::Lost`]: it ended otherwise, or could not be made anew.
    pub(crate) fn make_ready(&mut self) -> Result<bool, PortError> {
        if self.is_used && self.closing.is_behind_answers() {
            return self.renew();
        }
        let look =
            self.answered.filter(|_| self.closing.is_unknown()).map_or(Instant::ZERO, |_| monotonic() + FIRST_LOOK);
        let has_ended = match wait(&self.stream, look) {
            Ok(false) => false,
            Ok(true) => !matches!(self.stream.peek(&mut [0]), Ok(1..)),
            Err(_) => true,
        };
        if !has_ended {
            if self.answered.is_some() {
                self.closing.left_open();
            }
            self.is_ready = true;
            return Ok(false);
        }
        if self.answered.is_some_and(is_soon) {
            self.closing.closed();
            return self.renew();
        }
        Err(self.lost("the other side closed it while nothing was asked"))
    }

    /// Another connection to the same server.
    fn renew(&mut self) -> Result<bool, PortError> {
        // Before the next one: some servers take one client.
        let _ = self.stream.shutdown(Shutdown::Both);
        let give_up = monotonic() + LISTENS_AGAIN;
        let stream = loop {
            match TcpStream::connect_timeout(&self.address, self.timeout.min(RENEWED)).and_then(prepared) {
                Err(error) if error.kind() == io::ErrorKind::ConnectionRefused && monotonic() < give_up => {
                    sleep_until(monotonic() + REFUSED_PAUSE);
                }
                made => break made,
            }
        };
        let (stream, ends_in_time) = stream.map_err(|error| {
            self.lost(format_args!("the other side closed it behind its answer, and takes no other one ({error})"))
        })?;
        self.stream = Kept::new(stream);
        self.ends_in_time = ends_in_time;
        (self.is_used, self.is_ready, self.answered) = (false, true, None);
        self.came.clear();
        self.renewed += 1;
        Ok(true)
    }

    /// Hands over all of `bytes`.
    pub(crate) fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        (self.is_used, self.is_ready) = (true, false);
        self.came.clear();
        self.answered_before = self.answered.take();
        let sent = self.stream.write_all(bytes);
        sent.map_err(|error| match error.kind() {
            io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut => self.lost("it takes no more bytes"),
            _ => self.ended(Some(error)),
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
            let error = match self.stream.read(buffer) {
                Ok(count) if count > 0 => {
                    self.came.extend_from_slice(&buffer[..count]);
                    self.forget_what_is_old();
                    (self.is_ready, self.answered) = (false, Some(monotonic()));
                    return Ok(count);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                ended => ended.err(),
            };
            // Behind a whole answer nobody misses anything for now: the next request finds out.
            if let Some(answered) = self.answered
                && (monotonic() >= until || self.has_whole_frame())
            {
                sleep_until(until.min(answered + SOON));
                if until <= answered + SOON {
                    return Ok(0);
                }
            }
            return Err(self.ended(error));
        }
    }

    /// A server that talks without end must not fill the memory.
    fn forget_what_is_old(&mut self) {
        let excess = self.came.len().saturating_sub(MAX_ADU);
        self.came.drain(..excess);
    }

    /// Whether the end of what came is a frame of RTU.
    fn has_whole_frame(&self) -> bool {
        (0..self.came.len()).any(|start| Frame::parse(&self.came[start..]).is_ok())
    }

    /// It ended while an answer was waited for.
    fn ended(&self, error: Option<io::Error>) -> PortError {
        let came = self.came.len();
        if self.has_whole_frame() {
            return self.lost("the other side closed it behind its answer");
        }
        if came > 0 {
            return self
                .lost(format_args!("the other side closed it behind {came} bytes that were not all of the answer"));
        }
        if self.answered_before.is_some_and(is_soon) {
            self.closing.closed();
            return self.lost("the other side closed it behind the answer before, and may not have heard this request");
        }
        match error {
            Some(error) => self.lost(error),
            None => self.lost("the other side closed it"),
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

    /// What people should know about the server, and about this system.
    pub(crate) fn notes(&self) -> Vec<String> {
        let renews = (self.renewed > 0).then(|| {
            format!(
                "{} closes the connection behind each answer, so each request gets one of its own; set the server to keep it \
                 open, which is faster",
                self.name
            )
        });
        let arrives_late = (!self.ends_in_time).then(|| {
            format!(
                "{}: this system cannot be told when to give up what it could not hand over; after a failure of the network, \
                 old requests may arrive late",
                self.name
            )
        });
        renews.into_iter().chain(arrives_late).collect()
    }
}

/// Whether `moment` is not long ago.
fn is_soon(moment: Instant) -> bool {
    monotonic().saturating_duration_since(moment) <= SOON
}

/// Each write leaves at once, and none blocks for long. Reads wait on our own clock first. Whether what stays unconfirmed is
/// given up, too.
fn prepared(stream: TcpStream) -> io::Result<(TcpStream, bool)> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(STALL))?;
    let ends_in_time = unconfirmed::give_up(&stream)?;
    Ok((stream, ends_in_time))
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

#[cfg(test)]
mod tests;
