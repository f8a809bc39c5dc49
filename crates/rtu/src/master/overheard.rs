//! A line that another master may ask on: when there can be one, what is taken down of it, and what came in the place of an
//! answer that may be the other's.

use core::ops::Range;
use core::time::Duration;

use super::torn::BEHIND;
use super::{Master, State};
use crate::answer::{Answer, AnswerError};
use crate::event::Event;
use crate::expected::Expected;
use crate::frame::Frame;
use crate::{Instant, UnitAddress};

impl Master {
    /// Says whether another master may ask on this line, so that its answers are heard here, too: some serial servers copy
    /// every byte to all who are connected. Not so at first.
    ///
    /// Then what nobody asked for casts doubt on each answer that looks like it ([`Attribution::Others`](crate::Attribution::Others)),
    /// for [`OTHERS`](crate::OTHERS) at least. Before each request hand over what came in, and [`overhear`](Self::overhear).
    pub const fn expect_others(&mut self, may_be: bool) {
        self.others.expect(may_be);
    }

    /// Takes down what others say, while nothing is in flight on a line that may have others: what was held behind the
    /// latest answer, too.
    pub fn overhear(&mut self, now: Instant) {
        if self.others.may_be() && matches!(self.state, State::Idle) {
            self.framer.listen();
            self.count_strays(now);
        }
    }

    /// Until when the rest may come of what is coming in while nothing is in flight; `None` where nothing is.
    pub(crate) fn hears_until(&self) -> Option<Instant> {
        let is_coming = !self.framer.pending().is_empty();
        let pause = self.patience.map_or(Duration::ZERO, |patience| patience.pause.min(BEHIND));
        self.framer.last_byte().filter(|_| is_coming).map(|last| last + self.silence.max(pause))
    }

    /// Takes down what came by `now`, while nothing is in flight, and nothing more has come.
    pub(crate) fn take_down(&mut self, now: Instant) {
        self.overhear(now);
        if matches!(self.state, State::Idle) {
            self.count_strays(now);
            if !self.framer.pending().is_empty() {
                let rest = self.framer.gives_up_rest();
                self.skip_stray(now, rest);
            }
        }
    }

    /// Whether another master was heard that asks `unit`.
    pub fn has_others(&self, now: Instant, unit: UnitAddress) -> bool {
        self.others.are_at(now, unit)
    }

    /// A frame came in the place of the answer that is not it.
    pub(super) fn see_if_others(&mut self, now: Instant, range: Range<usize>) {
        if self.others.may_be() {
            self.see(now, range);
        }
    }

    /// A frame came in the place of the answer that may be theirs.
    pub(super) fn pass(&mut self, now: Instant, range: Range<usize>) {
        self.others.pass(&self.framer.frame(range.clone()));
        self.see(now, range);
        self.tally.add_foreign();
    }
}

/// What is told of `frame` at the end of the wait, which may be another's and came in the place of the answer to `expected`.
/// `doubted`: its unit owes others.
pub(super) fn passed_over(expected: Expected, frame: Frame<'_>, doubted: bool) -> Event<'_> {
    match expected.judge(frame.pdu()) {
        Ok(answer) if expected.is_read() && !doubted => Event::Answer(answer),
        // Had a write been refused, it would not have been done; that is not known.
        Ok(Answer::Exception { code, .. }) => {
            Event::Wrong { error: AnswerError::Refusal { code }, frame: frame.as_bytes() }
        }
        Ok(_) => Event::Wrong { error: AnswerError::Others, frame: frame.as_bytes() },
        Err(error) => Event::Wrong { error, frame: frame.as_bytes() },
    }
}
