//! Reads in two parts: where no read that is longer is told apart, two shorter ones are, which have a word in common.
//!
//! The unit is asked for the first words, and then for the last ones, each in a length that nothing open has. The word that both
//! have must be the same: then each two neighbours come from one answer, as they do from one read, and a value of two words is
//! never put together of two. Three words and more may be of two moments, a few characters apart.

use super::exchange::Purpose;
use super::known::{Ask, Known};
use super::longer_reads::{first_part, last_part};
use super::outcome::{Slip, Times};
use super::{Conversation, State};
use crate::Instant;

/// So often the word in common may have changed in between before the question is put as it is.
const CHANGES: u8 = 3;

/// The first part of a question has come; `last` words of it are to follow.
#[derive(Debug, Clone, Copy)]
pub(super) struct Begun {
    pub(super) last: u16,
    pub(super) sent: Instant,
}

impl<'r> Conversation<'r> {
    /// Asks for the first `first` words of `ask`.
    pub(super) fn ask_first_part<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: Ask<'r>,
        (first, last): (u16, u16),
    ) {
        match first_part(&ask.request, first) {
            Some(request) => {
                self.counts.resyncs += 1;
                // Each of its answers may be damaged.
                self.course.takes_more(1, ask.timeout);
                self.put(now, known, Ask { request, ..ask }, Purpose::First { last });
            }
            None => self.put(now, known, ask, Purpose::Plain),
        }
    }

    /// Asks for the rest of what has `begun`, where nothing came between that could pass for it. False: it is asked anew.
    pub(super) fn asks_last_part<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: &Ask<'r>,
        begun: Begun,
    ) -> bool {
        let request = last_part(&ask.request, begun.last);
        match (request, ask.destination.unit()) {
            (Some(request), Some(unit)) if known.longer.is_apart(&known.master, now, unit, &request) => {
                self.send(now, known, Ask { request, ..*ask }, Purpose::Last { sent: begun.sent });
                true
            }
            _ => false,
        }
    }

    /// `ask`, the first words of the question, came to `result`.
    pub(super) fn first_part_came_to<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: &Ask<'r>,
        last: u16,
        result: Result<Times, Slip>,
    ) {
        match result {
            Ok(times) => {
                self.attempt.begun = Some(Begun { last, sent: times.sent });
                self.state = State::Passing;
            }
            Err(_) => self.part_failed(now, known, ask, result),
        }
    }

    /// `ask`, the last words of the question, the first of which were asked for at `sent`, came to `result`.
    pub(super) fn last_part_came_to<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: &Ask<'r>,
        sent: Instant,
        result: Result<Times, Slip>,
    ) {
        match result {
            Ok(times) if self.answer.answer().is_some() => self.end_attempt(now, known, Ok(Times { sent, ..times })),
            // The word that both have has changed: what came is of two moments.
            Ok(_) => {
                self.attempt.changes += 1;
                self.attempt.apart = self.attempt.changes < CHANGES;
                self.state = State::Passing;
            }
            Err(_) => self.part_failed(now, known, ask, result),
        }
    }

    fn part_failed<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: &Ask<'r>,
        result: Result<Times, Slip>,
    ) {
        self.answer.clear();
        self.apart_ended(now, known, ask, result);
    }
}
