//! Whether what came damaged in the place of an answer was that answer, so that nothing more is to come of it.
//!
//! A unit answers at most once. What is left of its answer is told by where it came, how long it is, and how it begins: unit,
//! function and number of bytes are known beforehand. It is no other's, as nothing else is open that could look so. But a
//! line may bring an answer twice, the first time damaged, and the second long after. So each stays open for [`AGAIN`],
//! until [`ALONE`] were damaged and none came whole by then. Nor is anything believed for as long that is no longer than the
//! rest of something that broke off before, and may go on: it looks like the end of an answer.

use core::time::Duration;

use crate::answer::Answer;
use crate::expected::Expected;
use crate::frame::Frame;
use crate::framer::lost_its_head;
use crate::sketch::{Sketch, may_lose};
use crate::{Instant, UnitAddress};

use super::remnant::may_be_left_of;

/// How long after it came damaged an answer may come whole, at the most.
const AGAIN: Duration = Duration::from_secs(1);

/// The same, in time-outs of the request, where that is less.
const AGAIN_TIMEOUTS: u32 = 2;

/// How long behind a damaged answer the right one may come, where nothing of the damaged one is missing: as long as common
/// adapters hold bytes back, and a little.
pub(super) const BEHIND: Duration = Duration::from_millis(20);

/// So many damaged answers in a row that did not come again say that the next will not either.
const ALONE: usize = 3;

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

    /// Something came by `now` in the place of an answer, or before it, that cannot be told: `rest` bytes of it may follow, as long
    /// as it may come again. It was waited for for `timeout`.
    pub(super) fn broke_off(&mut self, now: Instant, rest: usize, timeout: Duration) {
        let before = self.rest.filter(|&(until, _)| now < until);
        let until = before.map_or(now, |(until, _)| until).max(now + again(timeout));
        self.rest = Some((until, before.map_or(rest, |(_, before)| rest.max(before))));
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
        self.notes(now, (unit, expected));
        if self.none_comes_again(now, timeout) { Open::No } else { Open::For(again(timeout)) }
    }

    /// The answer to `damaged` came damaged at `now`, in its place or late.
    pub(super) fn notes(&mut self, now: Instant, damaged: (UnitAddress, Expected)) {
        self.latest.rotate_left(1);
        self.latest[ALONE - 1] = Some(damaged);
        if self.latest[0].is_some() {
            self.enough.get_or_insert(now);
        }
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

/// Whether `len` bytes can be what is left of the answer to `expected`: no more than its head and a few are missing.
pub(super) fn is_long_enough(expected: Expected, len: usize) -> bool {
    expected.adu_len().is_some_and(|whole| len + may_lose(whole) >= whole)
}
