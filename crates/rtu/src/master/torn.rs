//! Whether what came damaged in the place of an answer was that answer, so that nothing more is to come of it.
//!
//! A unit answers at most once. What is left of its answer is told by what is known of the answer beforehand: unit,
//! function, number of bytes and length, and the CRC where one of these was lost. But a line may bring an answer twice, the
//! first time damaged, and the second long after. So each stays open for [`AGAIN`], until [`ALONE`] were damaged and none
//! came whole by then. Nor is anything believed while the rest of something may still come that broke off: behind the
//! beginning of an answer it looks like the end of it.

use core::time::Duration;

use crate::answer::Answer;
use crate::doubt::OVERTAKING;
use crate::expected::Expected;
use crate::frame::Frame;
use crate::framer::lost_its_head;
use crate::{Instant, UnitAddress};

/// How long after it came damaged an answer may come whole.
const AGAIN: Duration = Duration::from_secs(1);

/// So many damaged answers in a row that did not come again say that the next will not either.
const ALONE: usize = 3;

/// An answer of which no more than so many bytes are missing is told from the beginning of another.
const LOST: usize = 2;

/// What is known of damaged answers to reads.
#[derive(Debug, Clone)]
pub(super) struct Torn {
    /// The latest in a row that did not come again.
    latest: [Option<(UnitAddress, Expected)>; ALONE],
    /// When there were [`ALONE`] of them.
    enough: Option<Instant>,
    /// When something was given up that may have been the beginning of an answer.
    broke_off: Option<Instant>,
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
    pub(super) const NONE: Self = Self { latest: [None; ALONE], enough: None, broke_off: None };

    /// Nothing is known any more of answers that come again.
    pub(super) const fn forget(&mut self) {
        *self = Self { broke_off: self.broke_off, ..Self::NONE };
    }

    /// Something came by `now` in the place of an answer, or before it, that cannot be told.
    pub(super) const fn broke_off(&mut self, now: Instant) {
        self.broke_off = Some(now);
    }

    /// The answer of `unit` to `expected` came damaged at `now`.
    pub(super) fn came(&mut self, now: Instant, unit: UnitAddress, expected: Expected) -> Open {
        if self.broke_off.is_some_and(|then| now < then + OVERTAKING) {
            return Open::Long;
        }
        self.latest.rotate_left(1);
        self.latest[ALONE - 1] = Some((unit, expected));
        if self.latest[0].is_some() && now >= *self.enough.get_or_insert(now) + AGAIN {
            Open::No
        } else {
            Open::For(AGAIN)
        }
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

/// Whether `bytes` can be nothing but the answer of `unit` to `request`, with bytes lost or changed.
pub(super) fn is_left_of_answer(unit: UnitAddress, expected: Expected, request: &[u8], bytes: &[u8]) -> bool {
    let (Some(len), Some(third)) = (expected.adu_len(), expected.third()) else { return false };
    let head = [unit.get(), expected.function(), third];
    if bytes.starts_with(&head) {
        // A request for the registers from 0200H on begins as the answer to a read of one word does: the adapter may have
        // sent it back.
        let is_own = expected.is_read() && request.starts_with(&head);
        return !is_own && (len.saturating_sub(LOST)..=len).contains(&bytes.len());
    }
    lost_its_head(bytes, unit, expected.function(), len)
}
