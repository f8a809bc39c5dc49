//! How long a frame is, as its own bytes tell: of a request and of an answer, for every function of the specification.
//!
//! | function | request | answer |
//! | --- | --- | --- |
//! | 01H to 04H | 8 | 5 and its byte count |
//! | 05H, 06H, 08H | 8 | 8 |
//! | 07H | 4 | 5 |
//! | 0BH | 4 | 8 |
//! | 0CH, 11H | 4 | 5 and its byte count |
//! | 0FH, 10H | 9 and its byte count | 8 |
//! | 14H, 15H | 5 and its byte count | 5 and its byte count |
//! | 16H | 10 | 10 |
//! | 17H | 13 and its byte count | 5 and its byte count |
//! | 18H | 6 | 6 and its byte count, which has two bytes |
//! | 2BH | 7 (0EH) | only silence tells |
//! | 80H and above | | 5 |
//!
//! Source: *Modbus Application Protocol* V1.1b3, §6.1 to §6.21, §7; address and CRC are counted.

use crate::frame::{Frame, MAX_ADU};
use crate::pdu::function::EXCEPTION_BIT;

/// How long the frame is that begins so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Length {
    /// So many bytes.
    Is(usize),
    /// More bytes have to be seen first.
    Later,
    /// None does.
    Never,
    /// Its own bytes do not tell.
    Unknown,
}

impl Length {
    /// So many bytes, where that is told.
    pub(super) const fn bytes(self) -> Option<usize> {
        match self {
            Self::Is(bytes) => Some(bytes),
            Self::Later | Self::Never | Self::Unknown => None,
        }
    }
}

/// The length of the request that begins with `here`, address first.
pub(super) fn of_request(here: &[u8]) -> Length {
    let [_, function, ..] = *here else { return Length::Later };
    match function {
        0x01..=0x06 | 0x08 => Length::Is(8),
        0x07 | 0x0B | 0x0C | 0x11 => Length::Is(4),
        0x0F | 0x10 => counted(here, 6, 9),
        0x14 | 0x15 => counted(here, 2, 5),
        0x16 => Length::Is(10),
        0x17 => counted(here, 10, 13),
        0x18 => Length::Is(6),
        0x2B => Length::Is(7),
        0 | EXCEPTION_BIT.. => Length::Never,
        _ => Length::Unknown,
    }
}

/// The length of the answer that begins with `here`, address first.
pub(super) fn of_answer(here: &[u8]) -> Length {
    let [unit, function, ..] = *here else { return Length::Later };
    match function {
        // Nobody answers what all are told.
        _ if unit == 0 => Length::Never,
        0x01..=0x04 | 0x0C | 0x11 | 0x14 | 0x15 | 0x17 => counted(here, 2, 5),
        0x05 | 0x06 | 0x08 | 0x0B | 0x0F | 0x10 => Length::Is(8),
        0x07 => Length::Is(5),
        0x16 => Length::Is(10),
        0x18 => match *here {
            [_, _, 0, bytes, ..] => Length::Is(6 + usize::from(bytes)),
            [_, _] | [_, _, 0] => Length::Later,
            _ => Length::Never,
        },
        0 | EXCEPTION_BIT => Length::Never,
        EXCEPTION_BIT.. => Length::Is(5),
        _ => Length::Unknown,
    }
}

/// How many bytes at the front of `here` are a whole frame of a function that tells its length, as a request or as an
/// answer, and match their CRC; `None` where none is.
///
/// For bytes whose moments tell nothing, such as those of a capture: a [`Sniffer`](super::Sniffer) hears a line.
///
/// ```
/// let bytes = [0x01, 0x03, 0x02, 0x00, 0x03, 0xF8, 0x45, 0x01, 0x03];
/// assert_eq!(drivebus_rtu::frame_len(&bytes), Some(7));
/// assert_eq!(drivebus_rtu::frame_len(&bytes[1..]), None);
/// ```
pub fn frame_len(here: &[u8]) -> Option<usize> {
    [of_request(here), of_answer(here)].into_iter().find_map(|length| match length {
        Length::Is(len) => here.get(..len).and_then(|frame| Frame::parse(frame).ok()).map(|_| len),
        _ => None,
    })
}

/// `around` bytes and as many as the byte at `index` says.
fn counted(here: &[u8], index: usize, around: usize) -> Length {
    match here.get(index) {
        None => Length::Later,
        Some(0) => Length::Never,
        Some(bytes) if around + usize::from(*bytes) > MAX_ADU => Length::Never,
        Some(bytes) => Length::Is(around + usize::from(*bytes)),
    }
}
