//! The other side: a unit that listens for its requests.
//!
//! The simulator is made of it, and so can a device be. It finds requests and says whom they are for; what they do,
//! and when the answer goes out, is the device's.

use crate::frame::Frame;
use crate::framer::{Framer, Step};
use crate::huanyang::{Huanyang, Protocol};
use crate::pdu::function::EXCEPTION_BIT;
use crate::request::{Request, RequestError};
use crate::{Destination, FrameError, Instant, SerialFormat, UnitAddress};

/// The unit's side of the line: finds the requests to it, and says what it must not answer.
///
/// A unit that answers after [`SlaveEvent::Request`] must still leave the silence of 3.5 characters before its
/// answer, and must not feed its own answer back into [`receive`](Self::receive).
///
/// ```
/// use drivebus_rtu::{Adu, Answer, Instant, Request, SerialFormat, Slave, SlaveEvent, UnitAddress};
///
/// let unit = UnitAddress::new(1)?;
/// let mut slave = Slave::new(unit, &SerialFormat::DEFAULT);
/// let now = Instant::from_nanos(0);
/// slave.receive(now, &[0x01, 0x03, 0x21, 0x00, 0x00, 0x01, 0x8E, 0x36]);
/// let Some(SlaveEvent::Request { request: Request::Read { address, count, .. }, broadcast: false }) = slave.poll(now)
/// else {
///     panic!("a read")
/// };
/// assert_eq!((address, count), (0x2100, 1));
/// let answer = Adu::answer(unit, &Answer::read(&[3])?);
/// assert_eq!(answer.as_bytes(), [0x01, 0x03, 0x02, 0x00, 0x03, 0xF8, 0x45]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Slave {
    unit: UnitAddress,
    framer: Framer,
    protocol: Protocol,
}

/// What a unit hears.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SlaveEvent<'a> {
    /// A request for this unit, or for all.
    Request {
        /// What is asked. A function without a name comes as [`Request::Custom`].
        request: Request<'a>,
        /// Whether it is for all: act, and do not answer.
        broadcast: bool,
    },
    /// A request whose CRC is good and whose shape is not: exception 03H answers it, unless it is a broadcast.
    Malformed {
        /// The function asked for.
        function: u8,
        /// What is wrong with it.
        error: RequestError,
        /// Whether it is for all: do not answer.
        broadcast: bool,
    },
    /// A frame of other units' traffic.
    Foreign(Frame<'a>),
    /// Bytes that are no frame: a unit keeps silent.
    Bad {
        /// Why.
        error: FrameError,
        /// The bytes.
        bytes: &'a [u8],
    },
}

impl Slave {
    /// The ear of `unit` on a line of `format`.
    pub const fn new(unit: UnitAddress, format: &SerialFormat) -> Self {
        Self { unit, framer: Framer::new(format.t35()), protocol: Protocol::Modbus }
    }

    /// The same for a unit that speaks `protocol`. In Huanyang's own each frame ends with a silence.
    #[must_use]
    pub const fn speaking(self, protocol: Protocol) -> Self {
        Self { protocol, ..self }
    }

    /// Who listens.
    pub const fn unit(&self) -> UnitAddress {
        self.unit
    }

    /// Takes bytes that arrived at `now`, as many as there is room for, and returns how many.
    ///
    /// After polling until `None` there is room for at least one byte.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) -> usize {
        self.framer.receive(now, bytes)
    }

    /// When to call [`poll`](Self::poll) next although no byte came.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        self.framer.deadline()
    }

    /// What was heard by `now`; `None` when there is nothing to say.
    pub fn poll(&mut self, now: Instant) -> Option<SlaveEvent<'_>> {
        let frame = match self.framer.step(now)? {
            Step::Frame(range) => self.framer.frame(range),
            Step::Skipped { range, error, .. } => {
                return Some(SlaveEvent::Bad { error, bytes: self.framer.held(range) });
            }
        };
        let broadcast = match Destination::from_wire(frame.address()) {
            Ok(Destination::Broadcast) => true,
            Ok(Destination::Unit(unit)) if unit == self.unit => false,
            _ => return Some(SlaveEvent::Foreign(frame)),
        };
        if self.protocol == Protocol::Huanyang {
            // What it does not know it is silent on, as on a frame of Modbus.
            return Some(match Huanyang::parse(frame.pdu()) {
                Some(asked) => SlaveEvent::Request { request: Request::Huanyang(asked), broadcast },
                None => SlaveEvent::Foreign(frame),
            });
        }
        Some(match (Request::parse(frame.pdu()), frame.pdu()) {
            (Ok(request), _) => SlaveEvent::Request { request, broadcast },
            (Err(error), [function @ 1..EXCEPTION_BIT, ..]) => {
                SlaveEvent::Malformed { function: *function, error, broadcast }
            }
            _ => SlaveEvent::Foreign(frame),
        })
    }
}
