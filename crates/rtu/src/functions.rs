//! The functions of the specification: how long their requests and answers are, as their own bytes tell, and which only read.
//!
//! | function | request | answer | is |
//! | --- | --- | --- | --- |
//! | 01H to 04H | 8 | 5 and its byte count | a read |
//! | 05H, 06H | 8 | 8 | a write |
//! | 07H | 4 | 5 | a read |
//! | 08H | 8 | 8 | a read where it echoes or returns a counter |
//! | 0BH | 4 | 8 | a read |
//! | 0CH, 11H | 4 | 5 and its byte count | a read |
//! | 0FH, 10H | 9 and its byte count | 8 | a write |
//! | 14H, 15H | 5 and its byte count | 5 and its byte count | a read, a write |
//! | 16H | 10 | 10 | a write |
//! | 17H | 13 and its byte count | 5 and its byte count | a write |
//! | 18H | 6 | 6 and its byte count, which has two bytes | a read |
//! | 2BH/0EH | 7 | 10, and two more than its length for each object | a read |
//! | 2BH | only silence tells | only silence tells | a write |
//! | 80H and above | | 5 | |
//!
//! Source: *Modbus Application Protocol* V1.1b3, §6.1 to §6.21, §7; address and CRC are counted. Of a function that is not
//! here nothing is known, and it counts as a write.

use crate::frame::{Frame, MAX_ADU};
use crate::identification;
use crate::pdu::CRC_LEN;
use crate::pdu::function::{
    DIAGNOSTICS, ENCAPSULATED, EXCEPTION_BIT, IDENTIFICATION, MASK_WRITE, READ_WRITE, REPORT_SERVER_ID, WRITE_COILS,
    WRITE_MULTIPLE,
};

/// How long the frame is that begins so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameLength {
    /// So many bytes, address and CRC included.
    Is(usize),
    /// More bytes have to be seen first.
    Later,
    /// None does.
    Never,
    /// More than a frame can have.
    TooLong,
    /// Its own bytes do not tell.
    Unknown,
}

impl FrameLength {
    /// The length of the request that begins with `here`, address first.
    pub fn of_request(here: &[u8]) -> Self {
        let [_, function, ..] = *here else { return Self::Later };
        match function {
            0x01..=0x06 | DIAGNOSTICS => Self::Is(8),
            0x07 | 0x0B | 0x0C | REPORT_SERVER_ID => Self::Is(4),
            WRITE_COILS | WRITE_MULTIPLE => counted(here, 6, 9),
            0x14 | 0x15 => counted(here, 2, 5),
            MASK_WRITE => Self::Is(10),
            READ_WRITE => counted(here, 10, 13),
            0x18 => Self::Is(6),
            ENCAPSULATED => match here.get(2) {
                None => Self::Later,
                Some(&IDENTIFICATION) => Self::Is(7),
                Some(_) => Self::Unknown,
            },
            0 | EXCEPTION_BIT.. => Self::Never,
            _ => Self::Unknown,
        }
    }

    /// The length of the answer that begins with `here`, address first.
    pub fn of_answer(here: &[u8]) -> Self {
        let [unit, function, ..] = *here else { return Self::Later };
        match function {
            // Nobody answers what all are told.
            _ if unit == 0 => Self::Never,
            0x01..=0x04 | 0x0C | REPORT_SERVER_ID | 0x14 | 0x15 | READ_WRITE => counted(here, 2, 5),
            0x05 | 0x06 | DIAGNOSTICS | 0x0B | WRITE_COILS | WRITE_MULTIPLE => Self::Is(8),
            0x07 => Self::Is(5),
            MASK_WRITE => Self::Is(10),
            0x18 => match *here {
                [_, _, 0, bytes, ..] => Self::Is(6 + usize::from(bytes)),
                [_, _] | [_, _, 0] => Self::Later,
                _ => Self::Never,
            },
            ENCAPSULATED => match here.get(2) {
                None => Self::Later,
                Some(&IDENTIFICATION) => match identification::len(&here[1..]) {
                    Some(len) if 1 + len + CRC_LEN > MAX_ADU => Self::TooLong,
                    Some(len) => Self::Is(1 + len + CRC_LEN),
                    None => Self::Later,
                },
                Some(_) => Self::Unknown,
            },
            0 | EXCEPTION_BIT => Self::Never,
            EXCEPTION_BIT.. => Self::Is(5),
            _ => Self::Unknown,
        }
    }

    /// So many bytes, where that is told.
    pub const fn bytes(self) -> Option<usize> {
        match self {
            Self::Is(bytes) => Some(bytes),
            Self::Later | Self::Never | Self::TooLong | Self::Unknown => None,
        }
    }
}

/// How many bytes at the front of `here` are a whole frame of a function that tells its length, as a request or as an
/// answer, and match their CRC; `None` where none is.
///
/// For bytes whose moments tell nothing, such as those of a capture: a [`Sniffer`](crate::Sniffer) hears a line.
///
/// ```
/// let bytes = [0x01, 0x03, 0x02, 0x00, 0x03, 0xF8, 0x45, 0x01, 0x03];
/// assert_eq!(drivebus_rtu::frame_len(&bytes), Some(7));
/// assert_eq!(drivebus_rtu::frame_len(&bytes[1..]), None);
/// ```
pub fn frame_len(here: &[u8]) -> Option<usize> {
    [FrameLength::of_request(here), FrameLength::of_answer(here)].into_iter().find_map(|length| match length {
        FrameLength::Is(len) => here.get(..len).and_then(|frame| Frame::parse(frame).ok()).map(|_| len),
        _ => None,
    })
}

/// `around` bytes and as many as the byte at `index` says.
fn counted(here: &[u8], index: usize, around: usize) -> FrameLength {
    match here.get(index) {
        None => FrameLength::Later,
        Some(0) => FrameLength::Never,
        Some(bytes) if around + usize::from(*bytes) > MAX_ADU => FrameLength::TooLong,
        Some(bytes) => FrameLength::Is(around + usize::from(*bytes)),
    }
}
