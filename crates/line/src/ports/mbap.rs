//! Modbus TCP: a gateway or drive that takes PDUs behind an MBAP header instead of RTU frames.
//!
//! To the bus this is one more line: it hands over RTU frames and gets RTU frames, so every check stays where it is.
//! On the network, the CRC is left away and the header put in front:
//!
//! | bytes | what | value |
//! | ----- | ---- | ----- |
//! | 0, 1  | transaction | fresh for each request; the answer brings it back |
//! | 2, 3  | protocol | 0 |
//! | 4, 5  | length of what follows | 2..=254 |
//! | 6     | unit | as in RTU |
//! | 7..   | PDU | |
//!
//! Numbers are big-endian. Source: *Modbus Messaging on TCP/IP Implementation Guide* V1.0b, §3.1.3.

use std::collections::VecDeque;

use drivebus_rtu::{Duration, Instant, crc16};

use crate::error::Hex;
use crate::line::{Line, PortError, PortErrorKind};
use crate::ports::closing::Closing;
use crate::ports::connection::Connection;
use crate::system::clock::{monotonic, sleep_until};

/// The port that the specification reserves for Modbus TCP.
pub const DEFAULT_PORT: u16 = crate::ports::url::MODBUS_TCP_PORT;

/// Transaction, protocol and length: what comes before the unit.
pub(crate) const PREFIX: usize = 6;
/// Fewest and most bytes of unit and PDU.
pub(crate) const MIN_BODY: usize = 2;
pub(crate) const MAX_BODY: usize = 254;
/// Transactions without an answer that are kept.
const MAX_OPEN: usize = 32;
/// Bytes of a CRC.
const CRC: usize = 2;

/// A connection to a Modbus TCP server, which carries RTU frames for the bus.
#[derive(Debug)]
pub struct ModbusTcp {
    connection: Connection,
    /// The transaction of the latest request.
    transaction: u16,
    /// Whether the answer to it is still to come.
    waiting: bool,
    /// Bytes from the network that are not yet a whole answer.
    incoming: Vec<u8>,
    /// What is left of the answer, as an RTU frame, that the bus has not taken yet.
    frame: Vec<u8>,
    /// Answers that came with another transaction than the latest.
    foreign: u64,
    /// The latest transactions that were not answered.
    open: VecDeque<u16>,
    /// Answers to them, as RTU frames, that nobody has taken yet.
    late: VecDeque<Vec<u8>>,
    /// What came under other numbers, as RTU frames, that nobody has taken yet.
    strange: VecDeque<Vec<u8>>,
}

impl ModbusTcp {
    /// Connects to `host` (a name or an address) and `port`, usually [`DEFAULT_PORT`].
    ///
    /// Blocks for `timeout` at the longest for each address the name has, and for as long as the system takes to look
    /// the name up.
    ///
    /// # Errors
    ///
    /// [`PortErrorKind::NotFound`]: no such host, nobody listens, or nobody answers in time.
    pub fn connect(host: &str, port: u16, timeout: Duration) -> Result<Self, PortError> {
        Self::connect_to(host, port, timeout, &Closing::default())
    }

    /// As [`connect`](Self::connect), to a server of which it is known when it closes.
    pub(crate) fn connect_to(host: &str, port: u16, timeout: Duration, closing: &Closing) -> Result<Self, PortError> {
        Ok(Self {
            connection: Connection::open("tcp", host, port, timeout, closing)?,
            transaction: 0,
            waiting: false,
            incoming: Vec::with_capacity(2 * (PREFIX + MAX_BODY)),
            frame: Vec::with_capacity(MAX_BODY + CRC),
            foreign: 0,
            open: VecDeque::new(),
            late: VecDeque::new(),
            strange: VecDeque::new(),
        })
    }

    /// Takes whole answers off `incoming` until the one waited for is found and put into `frame`.
    fn unwrap_answers(&mut self) -> Result<(), PortError> {
        while self.frame.is_empty()
            && let [high, low, protocol_high, protocol_low, length_high, length_low, ..] = self.incoming[..]
        {
            let length = usize::from(u16::from_be_bytes([length_high, length_low]));
            if [protocol_high, protocol_low] != [0, 0] || !(MIN_BODY..=MAX_BODY).contains(&length) {
                // Nothing tells where the next header begins, so nothing after this can be trusted.
                return Err(self.connection.lost(format_args!(
                    "{} is not a Modbus TCP header (a server that passes RTU through is opened as socket://)",
                    Hex(&self.incoming[..PREFIX])
                )));
            }
            let end = PREFIX + length;
            if self.incoming.len() < end {
                return Ok(());
            }
            let body = &self.incoming[PREFIX..end];
            if self.waiting && u16::from_be_bytes([high, low]) == self.transaction {
                self.waiting = false;
                self.frame.extend_from_slice(body);
                self.frame.extend_from_slice(&crc16(body).to_le_bytes());
            } else {
                self.foreign += 1;
                let frame = [body, &crc16(body).to_le_bytes()].concat();
                // One that comes twice is late once.
                if let Some(place) = self.open.iter().position(|&open| open.to_be_bytes() == [high, low]) {
                    self.open.remove(place);
                    self.late.push_back(frame);
                } else {
                    if self.strange.len() == MAX_OPEN {
                        self.strange.pop_front();
                    }
                    self.strange.push_back(frame);
                }
            }
            self.incoming.drain(..end);
        }
        Ok(())
    }
}

/// The message that carries `body`, which is a unit and a PDU, in pieces.
pub(crate) fn message(transaction: u16, body: &[&[u8]]) -> Vec<u8> {
    let length: usize = body.iter().map(|piece| piece.len()).sum();
    let mut message = Vec::with_capacity(PREFIX + length);
    message.extend_from_slice(&transaction.to_be_bytes());
    message.extend_from_slice(&[0, 0]);
    message.extend_from_slice(&u16::try_from(length).unwrap_or(u16::MAX).to_be_bytes());
    for piece in body {
        message.extend_from_slice(piece);
    }
    message
}

impl Line for ModbusTcp {
    fn now(&self) -> Instant {
        monotonic()
    }

    /// On a new connection nothing of an old one comes.
    fn make_ready(&mut self) -> Result<(), PortError> {
        if self.connection.make_ready()? {
            self.incoming.clear();
            self.frame.clear();
            self.waiting = false;
            self.open.clear();
        }
        Ok(())
    }

    /// Sends `bytes`, a whole RTU frame, as a new transaction. What is left of an earlier answer is dropped.
    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let body = bytes.len().checked_sub(CRC).filter(|length| (MIN_BODY..=MAX_BODY).contains(length));
        let Some(body) = body.map(|length| &bytes[..length]) else {
            let message = format!(
                "{} bytes are not an RTU frame, which has {} to {}; Modbus TCP carries whole frames only",
                bytes.len(),
                MIN_BODY + CRC,
                MAX_BODY + CRC
            );
            return Err(PortError::new(PortErrorKind::Unsupported, &self.connection.name, message));
        };
        if !self.connection.is_ready {
            self.make_ready()?;
        }
        self.frame.clear();
        if self.waiting {
            if self.open.len() == MAX_OPEN {
                self.open.pop_front();
            }
            self.open.push_back(self.transaction);
        }
        self.transaction = self.transaction.wrapping_add(1);
        self.waiting = true;
        // In one piece: some servers take each segment for a whole message.
        self.connection.send(&message(self.transaction, &[body]))?;
        Ok(monotonic())
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        loop {
            let foreign = self.foreign;
            self.unwrap_answers()?;
            if self.foreign > foreign && self.frame.is_empty() && monotonic() >= until {
                return Ok(0); // a server that talks without end must not keep us
            }
            if !self.frame.is_empty() && !buffer.is_empty() {
                let count = self.frame.len().min(buffer.len());
                buffer[..count].copy_from_slice(&self.frame[..count]);
                self.frame.drain(..count);
                return Ok(count);
            }
            let mut bytes = [0; PREFIX + MAX_BODY];
            match self.connection.receive(&mut bytes, until)? {
                0 => return Ok(0),
                count => self.incoming.extend_from_slice(&bytes[..count]),
            }
        }
    }

    fn sleep(&mut self, until: Instant) {
        sleep_until(until);
    }

    fn name(&self) -> String {
        self.connection.name.clone()
    }

    fn gapless(&self) -> bool {
        true
    }

    fn take_late(&mut self) -> Option<Vec<u8>> {
        self.late.pop_front()
    }

    fn take_strange(&mut self) -> Option<Vec<u8>> {
        self.strange.pop_front()
    }

    fn notes(&self) -> Vec<String> {
        let dropped = match self.foreign {
            0 => None,
            count => Some(format!("answers with another transaction than asked, dropped: {count}")),
        };
        dropped.into_iter().chain(self.connection.notes()).collect()
    }
}
