#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

mod address;
mod agreement;
mod answer;
mod assumption;
mod bytes;
mod conversation;
pub mod crc;
mod doubt;
mod event;
mod expected;
mod frame;
mod framer;
mod functions;
pub mod huanyang;
mod identification;
mod inside;
mod master;
mod meaning;
mod only_reads;
mod others;
mod pdu;
mod raw;
mod request;
mod serial;
mod sketch;
mod slave;
mod sniffer;
mod table;
mod time;
mod touched;
mod unit_set;
mod words;

pub use core::time::Duration;

pub use address::{AddressError, Destination, UnitAddress};
pub use agreement::Agreement;
pub use answer::{Answer, AnswerError, Head};
pub use assumption::Assumption;
pub use conversation::{
    Conversation, Counts, Cut, Exchange, FreshWords, Known, Opened, OutOfTurn, Outcome, OwnEcho, Question, Step, Times,
    Unanswered, Urgency,
};
pub use crc::crc16;
pub use doubt::{Attribution, FIRST_CONTACT, OVERTAKING, PATIENCE};
pub use event::{BeginError, Event, Tally};
pub use expected::Expected;
pub use frame::{Adu, Frame, FrameError, MAX_ADU, MIN_ADU};
pub use framer::{Framer, Skipped};
pub use functions::{FrameLength, frame_len};
pub use identification::{IdentificationLevel, IdentificationPage};
pub use inside::{Misses, WrongInside, frames_in};
pub use master::{Master, Patience, TURNAROUND};
pub use meaning::{Meaning, Meanings};
pub use others::OTHERS;
pub use pdu::{
    AnswerLength, ExceptionCode, MAX_PDU, MAX_READ, MAX_READ_BITS, MAX_READ_WRITE, MAX_WRITE, MAX_WRITE_BITS, function,
};
pub use request::{Request, RequestError};
pub use serial::{DataBits, Parity, SerialFormat, SerialFormatError, Silence, StopBits};
pub use slave::{Slave, SlaveEvent};
pub use sniffer::{Heard, Role, Sniffer};
pub use table::Table;
pub use time::Instant;
pub use touched::Touched;
pub use words::Words;

#[cfg(test)]
extern crate std;
