//! Whether what came damaged in the place of an answer was that answer, so that nothing more is to come of it.
//!
//! A unit answers at most once. What is left of its answer is told by where it came, how long it is, and how it begins: unit,
//! function and number of bytes are known beforehand. It is no other's, as nothing else is open that could look so. But a
//! line may bring an answer twice, the first time damaged, and the second long after. So each stays open for [`AGAIN`],
//! until [`ALONE`] were damaged and none came whole by then. Nor is anything believed that is no longer than the rest of
//! something that broke off before, and may go on: it looks like the end of an answer.

use core::time::Duration;

use crate::answer::Answer;
use crate::crc::{crc16, update};
use crate::doubt::OVERTAKING;
use crate::expected::Expected;
use crate::frame::{Frame, MAX_ADU};
use crate::framer::lost_its_head;
use crate::{Instant, UnitAddress};

use super::remnant::may_be_left_of;

/// How long after it came damaged an answer may come whole, at the most.
const AGAIN: Duration = Duration::from_secs(1);

/// The same, in time-outs of the request, where that is less.
const AGAIN_TIMEOUTS: u32 = 2;

/// So many damaged answers in a row that did not come again say that the next will not either.
const ALONE: usize = 3;

/// An answer of which no more bytes are missing is told from the beginning of another: so many, and of each so many one more.
const LOST: usize = 2;
const LOST_OF_EACH: usize = 16;

/// Unit, function and number of bytes, or what stands in its place.
pub(crate) const HEAD: usize = 3;

/// What is known of damaged answers to reads.
#[derive(Debug, Clone)]
pub(super) struct Torn {
    /// The latest in a row that did not come again.
    latest: [Option<(UnitAddress, Expected)>; ALONE],
    /// When there were [`ALONE`] of them.
    enough: Option<Instant>,
    /// Until when the rest may come of what was given up and may have been the beginning of an answer, and how long that is.
    rest: Option<(Instant, usize)>,
}

/// How long an answer that came damaged may still come.
pub(super) enum Open {
    /// Nothing more comes.
    No,
    /// So long at least.
    For(Duration),
    /// As long as one of which nothing came.
    Long,
}

impl Torn {
    pub(super) const NONE: Self = Self { latest: [None; ALONE], enough: None, rest: None };

    /// Nothing is known any more of answers that come again.
    pub(super) const fn forget(&mut self) {
        *self = Self { rest: self.rest, ..Self::NONE };
    }

    /// Something came by `now` in the place of an answer, or before it, that cannot be told: `rest` bytes of it may follow.
    pub(super) fn broke_off(&mut self, now: Instant, rest: usize) {
        let before = self.rest.filter(|&(until, _)| now < until).map_or(0, |(_, rest)| rest);
        self.rest = Some((now + OVERTAKING, rest.max(before)));
    }

    /// `len` bytes of the answer of `unit` to `expected` came damaged at `now`. It was waited for for `timeout`.
    pub(super) fn came(
        &mut self,
        now: Instant,
        (unit, expected): (UnitAddress, Expected),
        len: usize,
        timeout: Duration,
    ) -> Open {
        if self.rest.is_some_and(|(until, rest)| now < until && len <= rest) {
            return Open::Long;
        }
        self.latest.rotate_left(1);
        self.latest[ALONE - 1] = Some((unit, expected));
        if self.latest[0].is_some() {
            self.enough.get_or_insert(now);
        }
        if self.none_comes_again(now, timeout) { Open::No } else { Open::For(again(timeout)) }
    }

    /// Whether the line has shown by `now` that what came damaged does not come again.
    pub(super) fn none_comes_again(&self, now: Instant, timeout: Duration) -> bool {
        self.enough.is_some_and(|enough| now >= enough + again(timeout))
    }

    /// A whole frame came that answers nothing in flight.
    pub(super) fn see(&mut self, frame: &Frame<'_>) {
        let is_again = |&(unit, expected): &(UnitAddress, Expected)| {
            matches!(expected.judge_frame(unit, frame), Ok(Answer::Read { .. }))
        };
        if self.latest.iter().flatten().any(is_again) {
            self.forget();
        }
    }
}

/// How long an answer that was waited for for `timeout` may come again after it came damaged.
fn again(timeout: Duration) -> Duration {
    AGAIN.min(timeout.saturating_mul(AGAIN_TIMEOUTS))
}

/// An answer that is still to come, as it can be told when it comes damaged.
#[derive(Debug, Clone, Copy)]
struct Sketch {
    head: [u8; HEAD],
    len: usize,
}

impl Sketch {
    fn of(unit: UnitAddress, expected: Expected) -> Option<Self> {
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
    fn has_its_crc(self, bytes: &[u8]) -> bool {
        let body = self.len.checked_sub(HEAD).and_then(|len| bytes.len().checked_sub(len));
        let Some((_, [words @ .., low, high])) = body.filter(|&lost| lost <= HEAD).map(|at| bytes.split_at(at)) else {
            return false;
        };
        update(crc16(&self.head), words) == u16::from_le_bytes([*low, *high])
    }

    /// Whether no more than one character of the head is damaged in `bytes`, and few are missing.
    fn is_told_in(self, bytes: &[u8]) -> bool {
        self.damaged_in(bytes) <= 1 && self.lost_in(bytes).is_some_and(|lost| lost <= self.may_lose())
    }

    /// How many may be lost, so that what is left is not taken for a beginning.
    const fn may_lose(self) -> usize {
        LOST + self.len / LOST_OF_EACH
    }
}

/// Whether `bytes`, which came in the place of the answer of `unit` to `request`, are what is left of it: no more than one
/// character of its head is damaged, and few are missing.
pub(super) fn is_left_of_answer(unit: UnitAddress, expected: Expected, request: &[u8], bytes: &[u8]) -> bool {
    let Some(sketch) = Sketch::of(unit, expected) else { return false };
    // The adapter may have sent the request back, and lost something of it.
    let is_own = expected.is_read()
        && bytes.len() <= request.len()
        && (request.starts_with(&sketch.head) || may_be_left_of(bytes, request));
    (sketch.is_told_in(bytes) && !is_own)
        || sketch.has_its_crc(bytes)
        || lost_its_head(bytes, unit, expected.function(), sketch.len)
}

/// How many bytes more the answer of `unit` to `expected` has than the `bytes` that came, and how badly these begin it.
/// Of an answer of unknown length nobody knows.
pub(crate) fn rest_of(unit: UnitAddress, expected: Expected, bytes: &[u8]) -> (usize, usize) {
    let Some(sketch) = Sketch::of(unit, expected) else { return (0, MAX_ADU) };
    let longer = sketch.lost_in(bytes).unwrap_or(sketch.len);
    (sketch.damaged_in(bytes), longer)
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
        || (sketch.damaged_in(bytes) <= most && sketch.lost_in(bytes).is_some_and(|lost| lost <= 2 * sketch.may_lose()))
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
