//! Units whose answers have another number of words than they were asked for: of those a length proves nothing.
//!
//! One such answer is enough, for good. Where it comes in its turn, or beside, nothing is mistaken; the first of them that comes
//! late and in the place of another read's answer is taken for that ([`Assumption::AnswersWhole`](crate::Assumption)).

use core::time::Duration;

use super::{Doubts, Open};
use crate::answer::{Answer, AnswerError};
use crate::expected::Expected;
use crate::frame::Frame;
use crate::{Instant, UnitAddress};

impl Doubts {
    /// `frame` came at `now` in the place of the answer of `unit` to `expected`. Where it has another number of words, and is none
    /// that is open, nor one again that came within `at_once`, the lengths of this unit prove nothing from now on: only what it
    /// sends back does, and time.
    #[cold]
    pub(crate) fn learn_length(
        &mut self,
        now: Instant,
        (unit, expected): (UnitAddress, Expected),
        frame: &Frame<'_>,
        at_once: Duration,
    ) {
        let judged = expected.judge_frame(unit, frame);
        if matches!(judged, Err(AnswerError::Count { .. } | AnswerError::Bytes { .. }))
            && !self.owes(now, unit, frame)
            && self.is_new(now, frame, at_once)
        {
            self.is_of_another_length(now, unit);
        }
    }

    /// `frame` came at `now` from `unit`, and answers nothing in flight. Where reads are open, and it has the length of none, it is
    /// one of those nevertheless: see [`learn_length`](Self::learn_length).
    pub(crate) fn learn_length_beside(
        &mut self,
        now: Instant,
        unit: UnitAddress,
        frame: &Frame<'_>,
        at_once: Duration,
    ) {
        let reads = || self.possible(now, unit).filter(|open| is_read_by(open, frame));
        if reads().next().is_some() && !self.owes(now, unit, frame) && self.is_new(now, frame, at_once) {
            self.is_of_another_length(now, unit);
        }
    }

    fn is_of_another_length(&mut self, now: Instant, unit: UnitAddress) {
        if !self.is_strange(now, unit) && !self.has_forgotten(now, unit) {
            self.any_length.insert(unit);
        }
    }

    /// Whether the answers of `unit` have any number of words.
    pub(crate) fn gives_any_length(&self, unit: UnitAddress) -> bool {
        self.any_length.contains(unit)
    }

    /// Whether the answer to `open` could be taken for that to `expected`.
    pub(super) fn could_pass(&self, open: &Open, expected: Expected) -> bool {
        passes(open, expected, self.gives_any_length(open.unit))
    }
}

/// Whether `frame` is words of the table that `open` reads: not one of which bytes are lost, and which has a right CRC by chance.
pub(super) fn is_read_by(open: &Open, frame: &Frame<'_>) -> bool {
    open.expected.is_read()
        && frame.pdu().first() == Some(&open.expected.function())
        && matches!(Answer::parse(frame.pdu()), Ok(Answer::Read { .. }))
}

/// Whether the answer to `open` could be taken for that to `expected`, by a unit that may give `any_length`.
pub(super) fn passes(open: &Open, expected: Expected, any_length: bool) -> bool {
    if any_length { open.expected.could_pass_at_any_length(expected) } else { open.expected.could_pass_for(expected) }
}
