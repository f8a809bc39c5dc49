//! Why a frame with a good CRC is not the answer.

use core::fmt;

use super::head::Head;
use crate::pdu::ExceptionCode;

/// Why a frame with a good CRC is not the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum AnswerError {
    /// It comes from another unit.
    Unit {
        /// Who was asked.
        asked: u8,
        /// Who answers.
        came: u8,
    },
    /// It answers another function.
    Function {
        /// The function asked for.
        asked: u8,
        /// The function that came.
        came: u8,
    },
    /// It carries another number of words.
    Count {
        /// Words asked for.
        asked: u16,
        /// Words that came.
        came: usize,
    },
    /// It repeats other words than those sent: address and value, address and count, or sub-function and data.
    Echo {
        /// What was sent.
        asked: [u16; 2],
        /// What came.
        came: [u16; 2],
    },
    /// It repeats other bytes than those of a request that was carried as it is.
    Repeat {
        /// What was sent.
        asked: Head,
        /// What came.
        came: Head,
    },
    /// It carries another number of bytes, as its byte count says.
    Bytes {
        /// Bytes that the answer must have.
        asked: u8,
        /// Bytes that it says it has.
        came: u8,
    },
    /// It says of a coil neither that it is on nor that it is off.
    Coil {
        /// What it says: FF00H and 0000H mean something.
        value: u16,
    },
    /// It gives another level of the identification.
    Level {
        /// What was asked for.
        asked: u8,
        /// What came.
        came: u8,
    },
    /// It gives another object of the identification, or one where it cannot stand.
    Object {
        /// What was asked for, or stands before it.
        asked: u8,
        /// What came.
        came: u8,
    },
    /// It says of its identification what the specification does not have.
    Conformity {
        /// What it says: 01H to 03H and 81H to 83H mean something.
        came: u8,
    },
    /// It says of the rest of its identification what cannot be.
    MoreFollows {
        /// Whether more follows: 00H and FFH mean something.
        more: u8,
        /// Where that begins.
        next: u8,
    },
    /// Its length does not fit its function.
    Length {
        /// Bytes of the PDU.
        len: usize,
    },
    /// It is a refusal, and may be that of an earlier request: refusals of one function look alike.
    Refusal {
        /// Why.
        code: ExceptionCode,
    },
    /// It looks like the answer, and like those to another master's questions that were overheard.
    Others,
}

impl fmt::Display for AnswerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unit { asked, came } => write!(f, "unit {asked} was asked, unit {came} answers"),
            Self::Function { asked, came } => write!(f, "function {asked:02X}H was asked, {came:02X}H came"),
            Self::Count { asked, came } => write!(f, "{asked} words were asked for, {came} came"),
            Self::Echo { asked, came } => write!(
                f,
                "{:04X}H {:04X}H was sent, the answer repeats {:04X}H {:04X}H",
                asked[0], asked[1], came[0], came[1]
            ),
            Self::Repeat { asked, came } => write!(f, "{asked} was sent, the answer repeats {came}"),
            Self::Bytes { asked, came } => write!(f, "{asked} bytes of data answer that, {came} came"),
            Self::Coil { value } => write!(f, "a coil is FF00H or 0000H, {value:04X}H came"),
            Self::Level { asked, came } => write!(f, "level {asked:02X}H was asked for, {came:02X}H came"),
            Self::Object { asked, came } => write!(f, "object {came:02X}H came where {asked:02X}H was asked for"),
            Self::Conformity { came } => write!(f, "{came:02X}H is no conformity of an identification"),
            Self::MoreFollows { more, next } => {
                write!(f, "an identification cannot go on with {more:02X}H and object {next:02X}H")
            }
            Self::Length { len } => write!(f, "a PDU of {len} bytes does not fit its function"),
            Self::Refusal { code } => {
                write!(f, "exception {:02X}H came, which may be meant for another request", code.0)
            }
            Self::Others => {
                f.write_str("another master asks the same of this unit, and nothing tells whose answer it is")
            }
        }
    }
}

impl core::error::Error for AnswerError {}
