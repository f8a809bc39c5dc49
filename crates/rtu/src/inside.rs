//! What a frame with a good CRC says by itself: whether a master or a unit may have sent it, and what is wrong inside.
//!
//! A CRC tells that the bytes are those that were sent. Whoever sent them may have counted wrong: that is no damage, and
//! is told as what it is.

use core::fmt;
use core::ops::Range;

use crate::answer::Answer;
use crate::frame::Frame;
use crate::functions::FrameLength;
use crate::pdu::function::{EXCEPTION_BIT, WRITE_COIL, WRITE_COILS, WRITE_MULTIPLE, WRITE_SINGLE};
use crate::pdu::{MAX_WRITE, MAX_WRITE_BITS, coil_of};
use crate::request::Request;
use crate::sniffer::{can_ask, may_be_answer};
use crate::{Table, UnitAddress};

/// What is wrong inside a frame whose CRC is right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum WrongInside {
    /// A write whose counts do not agree.
    #[non_exhaustive]
    Write {
        /// Whether it writes coils.
        bits: bool,
        /// Words or coils that it announces.
        count: u16,
        /// Bytes that it announces.
        announced: u8,
        /// Bytes of data in it.
        data: usize,
    },
    /// A read of none, of more than an answer can carry, or beyond the last address.
    #[non_exhaustive]
    Read {
        /// What is read.
        table: Table,
        /// The first.
        address: u16,
        /// How many.
        count: u16,
    },
    /// Such a read of words, or an answer with three bytes, which are no whole words: both look the same.
    #[non_exhaustive]
    ReadOrAnswer {
        /// What is read.
        table: Table,
        /// The first, if it is a read.
        address: u16,
        /// How many, if it is a read.
        count: u16,
    },
    /// The answer to a read, whose count does not agree with its data.
    #[non_exhaustive]
    Answer {
        /// What was read.
        table: Table,
        /// Bytes that it announces.
        announced: u8,
        /// Bytes of data in it.
        data: usize,
    },
    /// A coil that is neither to be on nor off.
    #[non_exhaustive]
    Coil {
        /// What it is to be: FF00H and 0000H mean something.
        value: u16,
    },
    /// Any other function, whose length is not that of a request or an answer.
    #[non_exhaustive]
    Length {
        /// The function.
        function: u8,
        /// Bytes behind it.
        data: usize,
    },
}

impl WrongInside {
    /// Whether it has the form of a request, or of an answer; `None` where nothing tells.
    #[must_use]
    pub const fn is_request(&self) -> Option<bool> {
        match self {
            Self::Write { .. } | Self::Read { .. } => Some(true),
            Self::Answer { .. } => Some(false),
            Self::ReadOrAnswer { .. } | Self::Coil { .. } | Self::Length { .. } => None,
        }
    }
}

impl fmt::Display for WrongInside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Write { bits, count, announced, data } => {
                let (what, most) = if bits { ("coil", MAX_WRITE_BITS) } else { ("word", MAX_WRITE) };
                write!(f, "write of {}", Counted(count.into(), what))?;
                let needed = if bits { usize::from(count).div_ceil(8) } else { 2 * usize::from(count) };
                if data != usize::from(announced) {
                    announces(f, data, announced)
                } else if data != needed {
                    write!(f, " with {} of data where {needed} {} needed", Counted(data, "byte"), are(needed))
                } else if count == 0 || count > most {
                    write!(f, ", which can be 1 to {most}")
                } else {
                    f.write_str(" that ends beyond FFFFH")
                }
            }
            Self::Read { table, address, count } => {
                let what = if table.is_bits() { "bit" } else { "word" };
                write!(f, "read of {} at {address:04X}H", Counted(count.into(), what))?;
                if count == 0 || count > table.max_read() {
                    write!(f, ", which can be 1 to {}", table.max_read())
                } else {
                    f.write_str(" that ends beyond FFFFH")
                }
            }
            Self::ReadOrAnswer { table, address, count } => {
                Self::Read { table, address, count }.fmt(f)?;
                f.write_str(", or ")?;
                Self::Answer { table, announced: 3, data: 3 }.fmt(f)
            }
            Self::Answer { table, announced, data } => {
                f.write_str("answers with ")?;
                if data != usize::from(announced) {
                    Counted(data, "byte").fmt(f)?;
                    write!(f, " of data where {announced} {} announced", are(announced.into()))
                } else if data == 0 {
                    write!(f, "0 {}", if table.is_bits() { "bits" } else { "words" })
                } else {
                    write!(f, "{} of data, which are no whole words", Counted(data, "byte"))
                }
            }
            Self::Coil { value } => write!(f, "write of a coil with {value:04X}H, which can be FF00H or 0000H"),
            Self::Length { function: function @ (WRITE_COIL | WRITE_SINGLE), data } if data != 4 => {
                let what = if function == WRITE_COIL { "write of a coil" } else { "write" };
                write!(f, "{what} with {} where 4 are needed", Counted(data, "byte"))
            }
            Self::Length { function, data } if function > EXCEPTION_BIT && data != 1 => {
                let refused = function & !EXCEPTION_BIT;
                write!(f, "refusal of function {refused:02X}H with {} where 1 is needed", Counted(data, "byte"))
            }
            Self::Length { function, data } => {
                write!(f, "function {function:02X}H with {} of data, which does not fit it", Counted(data, "byte"))
            }
        }
    }
}

fn announces(f: &mut fmt::Formatter<'_>, data: usize, announced: u8) -> fmt::Result {
    write!(f, " with {} of data where {announced} {} announced", Counted(data, "byte"), are(announced.into()))
}

fn are(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

/// So many of something.
struct Counted(usize, &'static str);

impl fmt::Display for Counted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}{}", self.0, self.1, if self.0 == 1 { "" } else { "s" })
    }
}

impl Frame<'_> {
    /// Whether a master may have sent it.
    #[must_use]
    pub fn may_ask(&self) -> bool {
        can_ask(self.as_bytes())
    }

    /// Whether a unit may have sent it.
    #[must_use]
    pub fn may_answer(&self) -> bool {
        may_be_answer(self.as_bytes()) && Answer::parse(self.pdu()).is_ok()
    }

    /// What is wrong inside; `None` of what a master or a unit may have sent, and of a function that nobody knows.
    ///
    /// ```
    /// use drivebus_rtu::Frame;
    ///
    /// let frame = Frame::parse(&[0x0A, 0x10, 0, 1, 0, 3, 6, 0x0A, 0x0B, 0x0C, 0xEE, 0x98])?;
    /// let wrong = frame.wrong_inside().map(|wrong| wrong.to_string());
    /// assert_eq!(wrong.as_deref(), Some("write of 3 words with 3 bytes of data where 6 are announced"));
    /// # Ok::<(), drivebus_rtu::FrameError>(())
    /// ```
    #[must_use]
    pub fn wrong_inside(&self) -> Option<WrongInside> {
        // Nobody answers what all are told; what answers all the same is not wrong inside for that.
        let answers_all = self.address() == 0 && Answer::parse(self.pdu()).is_ok();
        if self.may_ask() || self.may_answer() || answers_all {
            return None;
        }
        let (function, data) = self.pdu().split_first()?;
        let (function, data) = (*function, data);
        let table = Table::of_function(function);
        Some(match (table, data) {
            (None, &[_, _, c1, c0, announced, ref data @ ..]) if matches!(function, WRITE_COILS | WRITE_MULTIPLE) => {
                let count = u16::from_be_bytes([c1, c0]);
                WrongInside::Write { bits: function == WRITE_COILS, count, announced, data: data.len() }
            }
            (Some(table), &[a1, a0, c1, c0]) => {
                let (address, count) = (u16::from_be_bytes([a1, a0]), u16::from_be_bytes([c1, c0]));
                if a1 == 3 {
                    WrongInside::ReadOrAnswer { table, address, count }
                } else {
                    WrongInside::Read { table, address, count }
                }
            }
            (Some(table), &[announced, ref data @ ..]) => WrongInside::Answer { table, announced, data: data.len() },
            (None, &[_, _, v1, v0]) if function == WRITE_COIL && coil_of(u16::from_be_bytes([v1, v0])).is_none() => {
                WrongInside::Coil { value: u16::from_be_bytes([v1, v0]) }
            }
            (_, data) => WrongInside::Length { function, data: data.len() },
        })
    }

    /// How it misses what `asked` asks for; `None` where it answers that, or something else: from another unit, by
    /// another function, or of the same with other words in it.
    #[must_use]
    pub fn misses(&self, asked: &Frame<'_>) -> Option<Misses> {
        let ([function, rest @ ..], [came, data @ ..]) = (asked.pdu(), self.pdu()) else { return None };
        if self.address() != asked.address() || came & !EXCEPTION_BIT != *function {
            return None;
        }
        let request = Request::parse(asked.pdu()).ok()?;
        if request.judge(self.pdu()).is_ok() {
            return None;
        }
        match (Table::of_function(*came), rest, data) {
            (Some(table), &[_, _, c1, c0], &[announced, ref data @ ..])
                if usize::from(announced) == data.len() && (table.is_bits() || data.len() % 2 == 0) =>
            {
                let count = usize::from(u16::from_be_bytes([c1, c0]));
                Some(if table.is_bits() {
                    Misses::Count { came: data.len(), asked: count.div_ceil(8), bits: true }
                } else {
                    Misses::Count { came: data.len() / 2, asked: count, bits: false }
                })
            }
            (Some(table), _, &[announced, ref data @ ..]) => {
                Some(Misses::Inside(WrongInside::Answer { table, announced, data: data.len() }))
            }
            _ => self.wrong_inside().map(Misses::Inside),
        }
    }
}

/// Why a frame of the unit and the function that were asked is not the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Misses {
    /// It carries another number of words, or of bytes with bits.
    #[non_exhaustive]
    Count {
        /// What came.
        came: usize,
        /// What was asked for.
        asked: usize,
        /// Whether they are bytes with bits.
        bits: bool,
    },
    /// It is wrong inside.
    Inside(WrongInside),
}

impl fmt::Display for Misses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count { came, asked, bits } => {
                let what = if *bits { "byte" } else { "word" };
                let were = if *asked == 1 { "was" } else { "were" };
                write!(f, "answers with {}, {asked} {were} asked for", Counted(*came, what))
            }
            Self::Inside(wrong @ WrongInside::Answer { .. }) => wrong.fmt(f),
            Self::Inside(wrong) => write!(f, "says what no unit does: {wrong}"),
        }
    }
}

/// Where the whole frames in `bytes` stand, whatever stands between them: those with a length that their function gives,
/// a good CRC, and nothing wrong inside.
///
/// For bytes that somebody wrote down. On a line, where time tells more, it is [`Sniffer`](crate::Sniffer) that hears.
///
/// ```
/// let noted = [0x55, 0x01, 0x03, 0x21, 0x00, 0x00, 0x01, 0x8E, 0x36, 0xAA];
/// assert_eq!(drivebus_rtu::frames_in(&noted).next(), Some(1..9));
/// ```
pub fn frames_in(bytes: &[u8]) -> impl Iterator<Item = Range<usize>> {
    let mut at = 0;
    core::iter::from_fn(move || {
        while at < bytes.len() {
            let start = at;
            if let Some(len) = frame_at(&bytes[start..]) {
                at += len;
                return Some(start..at);
            }
            at += 1;
        }
        None
    })
}

/// How long the frame is with which `here` begins.
fn frame_at(here: &[u8]) -> Option<usize> {
    if here.first().is_some_and(|unit| *unit > UnitAddress::MAX.get()) {
        return None;
    }
    let is_whole = |len: &usize| {
        let frame = here.get(..*len).and_then(|bytes| Frame::parse(bytes).ok());
        frame.is_some_and(|frame| frame.wrong_inside().is_none())
    };
    [FrameLength::of_request(here), FrameLength::of_answer(here)]
        .into_iter()
        .filter_map(FrameLength::bytes)
        .filter(is_whole)
        .max()
}

#[cfg(test)]
mod tests {
    use std::string::{String, ToString};
    use std::vec::Vec;

    use super::*;
    use crate::crc16;

    fn whole(body: &[u8]) -> Vec<u8> {
        let mut frame = body.to_vec();
        frame.extend(crc16(body).to_le_bytes());
        frame
    }

    fn said(body: &[u8]) -> Option<String> {
        Frame::parse(&whole(body)).unwrap().wrong_inside().map(|wrong| wrong.to_string())
    }

    #[test]
    fn what_is_wrong_inside_is_said_as_what_it_is() {
        for (body, text) in [
            (&[10, 0x10, 0, 1, 0, 3, 6, 1, 2, 3][..], "write of 3 words with 3 bytes of data where 6 are announced"),
            (&[10, 0x10, 0, 1, 0, 3, 4, 1, 2, 3, 4], "write of 3 words with 4 bytes of data where 6 are needed"),
            (&[10, 0x10, 0, 1, 0, 0, 0], "write of 0 words, which can be 1 to 123"),
            (&[10, 0x10, 0xFF, 0xFF, 0, 2, 4, 1, 2, 3, 4], "write of 2 words that ends beyond FFFFH"),
            (&[10, 0x0F, 0, 1, 0, 9, 2, 1], "write of 9 coils with 1 byte of data where 2 are announced"),
            (&[10, 3, 0, 1, 0, 0], "read of 0 words at 0001H, which can be 1 to 125"),
            (&[10, 1, 0, 1, 0x10, 0], "read of 4096 bits at 0001H, which can be 1 to 2000"),
            (&[10, 3, 0xFF, 0xFF, 0, 2], "read of 2 words at FFFFH that ends beyond FFFFH"),
            (
                &[10, 3, 3, 0, 1, 2],
                "read of 258 words at 0300H, which can be 1 to 125, or answers with 3 bytes of data, which are no whole words",
            ),
            (&[10, 4, 0], "answers with 0 words"),
            (&[10, 4, 3, 1, 2, 3, 4, 5], "answers with 5 bytes of data where 3 are announced"),
            (&[10, 4, 5, 1, 2, 3, 4, 5], "answers with 5 bytes of data, which are no whole words"),
            (&[10, 5, 0, 1, 0, 1], "write of a coil with 0001H, which can be FF00H or 0000H"),
            (&[10, 6, 0, 1, 1], "write with 3 bytes where 4 are needed"),
            (&[10, 0x83], "refusal of function 03H with 0 bytes where 1 is needed"),
        ] {
            assert_eq!(said(body).as_deref(), Some(text));
        }
    }

    #[test]
    fn what_may_be_said_is_not_wrong() {
        for body in [
            &[10, 3, 0, 1, 0, 2][..],
            &[10, 3, 4, 1, 2, 3, 4],
            &[10, 0x10, 0, 1, 0, 1, 2, 1, 2],
            &[10, 0x10, 0, 1, 0, 1],
            &[10, 6, 0, 1, 0, 1],
            &[10, 0x83, 2],
            &[10, 0x41, 1, 2, 3],
            &[0, 6, 0, 1, 0, 1],
            &[0, 3, 4, 1, 2, 3, 4],
            &[0xFF, 3, 4, 1, 2, 3, 4],
        ] {
            assert_eq!(said(body), None);
        }
    }

    #[test]
    fn an_answer_that_misses_what_was_asked_says_by_what() {
        let asked = whole(&[1, 4, 0, 0, 0, 2]);
        let asked = Frame::parse(&asked).unwrap();
        for (body, text) in [
            (&[1, 4, 0][..], Some("answers with 0 words, 2 were asked for")),
            (&[1, 4, 2, 0, 1], Some("answers with 1 word, 2 were asked for")),
            (&[1, 4, 4, 1, 2, 3], Some("answers with 3 bytes of data where 4 are announced")),
            (&[1, 4, 4, 0, 1, 0, 2], None),
            (&[1, 0x84, 2], None),
            (&[1, 6, 0, 1, 0, 2], None),
            (&[2, 4, 2, 0, 1], None),
            (&[1, 3, 2, 0, 1], None),
        ] {
            let came = whole(body);
            let missed = Frame::parse(&came).unwrap().misses(&asked).map(|why| why.to_string());
            assert_eq!(missed.as_deref(), text);
        }
    }

    #[test]
    fn frames_are_found_whatever_stands_between_them() {
        let (one, two) = (whole(&[3, 3, 0x30, 0, 0, 2]), whole(&[3, 3, 4, 3, 0xE8, 2, 0x58]));
        let bytes = [&[0x20, 0x26][..], &one, &[7], &two, &[1, 3]].concat();
        assert!(frames_in(&bytes).eq([2..10, 11..20]));
        for damaged in 2..10 {
            let mut bytes = bytes.clone();
            bytes[damaged] ^= 0x10;
            assert!(frames_in(&bytes).eq(core::iter::once(11..20)), "{damaged}");
        }
    }
}
