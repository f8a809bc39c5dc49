//! An answer as it can be told when it comes damaged: by its length and its beginning.

use crate::UnitAddress;
use crate::crc::{crc16, update};
use crate::expected::Expected;
use crate::frame::MAX_ADU;
use crate::framer::lost_its_head;

/// An answer of which no more bytes are missing is told from the beginning of another: so many, and of each so many one more.
const LOST: usize = 2;
const LOST_OF_EACH: usize = 16;

/// How many of `len` bytes may be lost, so that what is left is not taken for a beginning.
pub(crate) const fn may_lose(len: usize) -> usize {
    LOST + len / LOST_OF_EACH
}

/// Unit, function and number of bytes, or what stands in its place.
pub(crate) const HEAD: usize = 3;

/// An answer that is still to come, as it can be told when it comes damaged.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sketch {
    pub(crate) head: [u8; HEAD],
    pub(crate) len: usize,
}

impl Sketch {
    pub(crate) fn of(unit: UnitAddress, expected: Expected) -> Option<Self> {
        Some(Self { head: [unit.get(), expected.function(), expected.third()?], len: expected.adu_len()? })
    }

    /// How many characters of the head are damaged in `bytes`, at least: turned over each, or one of them lost.
    fn damaged_in(self, bytes: &[u8]) -> usize {
        let [unit, function, third] = self.head;
        let turned = self.head.iter().zip(bytes).filter(|(own, came)| own != came).count();
        let lost = [[function, third], [unit, third], [unit, function]].iter().any(|left| bytes.starts_with(left));
        if lost { turned.min(1) } else { turned }
    }

    /// How many characters are lost in `bytes`; `None` where they are more than the answer has.
    fn lost_in(self, bytes: &[u8]) -> Option<usize> {
        self.len.checked_sub(bytes.len())
    }

    /// Whether the head is all that is damaged in `bytes`: with the right one the CRC agrees.
    pub(crate) fn has_its_crc(self, bytes: &[u8]) -> bool {
        let body = self.len.checked_sub(HEAD).and_then(|len| bytes.len().checked_sub(len));
        let Some((_, [words @ .., low, high])) = body.filter(|&lost| lost <= HEAD).map(|at| bytes.split_at(at)) else {
            return false;
        };
        update(crc16(&self.head), words) == u16::from_le_bytes([*low, *high])
    }

    /// Whether no more than one character of the head is damaged in `bytes`, and few are missing.
    pub(crate) fn is_told_in(self, bytes: &[u8]) -> bool {
        self.damaged_in(bytes) <= 1 && self.lost_in(bytes).is_some_and(|lost| lost <= may_lose(self.len))
    }
}

/// How many characters of the head of the answer of `unit` to `expected` are damaged in `bytes`; none is known of an answer
/// of unknown length.
pub(crate) fn damaged_head(unit: UnitAddress, expected: Expected, bytes: &[u8]) -> usize {
    Sketch::of(unit, expected).map_or(0, |sketch| sketch.damaged_in(bytes))
}

/// Whether `bytes` could be what is left of the answer of `unit` to `expected`, with `most` characters of its head damaged.
pub(crate) fn could_be_left_of(unit: UnitAddress, expected: Expected, bytes: &[u8], most: usize) -> bool {
    // Of an answer of unknown length anything.
    let Some(sketch) = Sketch::of(unit, expected) else { return true };
    bytes.starts_with(&sketch.head)
        || (sketch.damaged_in(bytes) <= most
            && sketch.lost_in(bytes).is_some_and(|lost| lost <= 2 * may_lose(sketch.len)))
}

/// Whether `bytes`, which came while nothing was in flight, are what is left of the answer of `unit` to `expected`.
pub(crate) fn is_left_of(unit: UnitAddress, expected: Expected, bytes: &[u8]) -> bool {
    Sketch::of(unit, expected).is_some_and(|sketch| sketch.is_told_in(bytes))
        || is_surely_left_of(unit, expected, bytes)
}

/// Whether `bytes` are beyond doubt what is left of the answer of `unit` to `expected`: its head is whole, or the CRC is right
/// with it, and one character is missing at most.
pub(crate) fn is_surely_left_of(unit: UnitAddress, expected: Expected, bytes: &[u8]) -> bool {
    let Some(sketch) = Sketch::of(unit, expected) else { return false };
    let is_whole = sketch.damaged_in(bytes) == 0 && sketch.lost_in(bytes).is_some_and(|lost| lost <= 1);
    is_whole || sketch.has_its_crc(bytes) || lost_its_head(bytes, unit, expected.function(), sketch.len)
}

/// How many bytes more the answer of `unit` to `expected` has than the `bytes` that came, and how badly these begin it: none
/// where it has fewer. Of an answer of unknown length nobody knows.
pub(crate) fn rest_of(unit: UnitAddress, expected: Expected, bytes: &[u8]) -> (usize, usize) {
    let Some(sketch) = Sketch::of(unit, expected) else { return (0, MAX_ADU) };
    let longer = sketch.lost_in(bytes).unwrap_or(0);
    (sketch.damaged_in(bytes), longer)
}
