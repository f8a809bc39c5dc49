//! RTU over TCP: the frames of a serial line through a serial server, as raw bytes.
//!
//! The server sends what it is given as characters of its own line, so the silences and character times are those of
//! that line. What Modbus TCP adds, a header instead of CRC and silence, is in [`mbap`](crate::mbap).

use std::net::SocketAddr;

use drivebus_rtu::{Duration, Instant, SerialFormat};

use crate::line::{Line, PortError};
use crate::ports::closing::Closing;
use crate::ports::connection::Connection;
use crate::system::clock::{monotonic, sleep_until};

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
    /// [`NotFound`](crate::PortErrorKind::NotFound): no such host, nobody listens, or nobody answers in time.
    pub fn connect(host: &str, port: u16, format: &SerialFormat, timeout: Duration) -> Result<Self, PortError> {
        Self::connect_to(host, port, format, timeout, &Closing::default())
    }

    /// As [`connect`](Self::connect), to a server of which it is known when it closes.
    pub(crate) fn connect_to(
        host: &str,
        port: u16,
        format: &SerialFormat,
        timeout: Duration,
        closing: &Closing,
    ) -> Result<Self, PortError> {
        let connection = Connection::open("socket", host, port, timeout, closing)?;
        Ok(Self { connection, format: *format, wire_free: Instant::ZERO })
    }
}

impl Line for RtuOverTcp {
    fn now(&self) -> Instant {
        monotonic()
    }

    fn make_ready(&mut self) -> Result<(), PortError> {
        self.connection.make_ready().map(drop)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        if !self.connection.is_ready {
            self.make_ready()?;
        }
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
        Some(self.connection.address)
    }

    /// Some servers copy every byte of their line to all clients.
    fn may_have_others(&self) -> bool {
        true
    }

    /// The server's own transceiver may hear what it sends, as an adapter's may.
    fn may_echo(&self) -> bool {
        true
    }

    fn notes(&self) -> Vec<String> {
        self.connection.notes()
    }
}
