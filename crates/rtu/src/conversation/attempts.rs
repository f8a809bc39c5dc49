//! From the first attempt of a call to its end: whether its unit is asked now, whether there is another attempt, and what the
//! caller is told.

use super::attempt::Attempt;
use super::course::Course;
use super::dead_units::Verdict;
use super::known::Known;
use super::outcome::{Outcome, Slip, Times, Unanswered};
use super::write_back::Write;
use super::{Conversation, State, Urgency};
use crate::{Instant, Request};

impl Conversation<'_> {
    /// A unit that was silent lately waits off the line, while others use it, for as long as it would have been silent: until
    /// then, or the call begins.
    pub(super) fn spare_the_others<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        patience: Option<Instant>,
    ) -> Option<Instant> {
        if let Some(unit) = self.unit() {
            if !known.units.enter(unit) {
                let slip = self.slip(Unanswered::NoRoom { units: U }, None, now);
                self.state = State::Done(Err(slip));
                return None;
            }
            if self.question.urgency != Urgency::Stop {
                match known.units.verdict(unit, now) {
                    Verdict::AskOnce => {
                        self.retries = 0;
                        self.course = Course::new(self.question.timeout, 0);
                    }
                    Verdict::Wait(until) if known.is_open() => {
                        let patience = patience.unwrap_or(now + self.patience());
                        if now < patience {
                            self.state = State::Sparing { patience: Some(patience) };
                            return Some(until.min(patience));
                        }
                        let left = until.saturating_duration_since(now);
                        let slip = self.slip(Unanswered::NotAsked { left }, None, now);
                        self.finish(known, Err(slip));
                        return None;
                    }
                    Verdict::Ask | Verdict::Wait(_) => {}
                }
            }
        }
        self.begin();
        None
    }

    /// The first attempt.
    fn begin(&mut self) {
        let request = &self.question.request;
        let is_asked_again = match request {
            Request::Read { .. } | Request::ReportServerId | Request::ReadIdentification { .. } => true,
            Request::Huanyang(asked) => !asked.is_write(),
            _ => false,
        };
        if !is_asked_again {
            self.write = Write::of(&self.question, self.retries);
            self.course.go_on_with(self.question.timeout, 0);
        }
        self.state = State::Passing;
    }

    /// The same call goes on with something else, asked so often more than once.
    pub(super) fn go_on_with(&mut self, retries: u32) {
        self.course.go_on_with(self.question.timeout, retries);
        self.port_failed = None;
        self.begin_attempt();
    }

    fn begin_attempt(&mut self) {
        self.attempt = Attempt::new(self.question.verify, self.course.asked());
        self.state = State::Passing;
    }

    /// An attempt is over: there is another one, or that is what came of it.
    pub(super) fn end_attempt<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        result: Result<Times, Slip>,
    ) {
        let Err(slip) = result else { return self.settle(now, known, result) };
        let is_port = slip.why.is_of_the_port();
        let to_ask_again = self.asks_again(slip.why);
        if !self.course.goes_on(&slip, self.attempt.asked_before, to_ask_again) || !self.is_wanted {
            let why = match slip.why {
                // It came when it was asked for the last of so many times.
                Unanswered::NoAnswer { timeout, .. } => {
                    Unanswered::NoAnswer { timeout, attempts: self.course.asked().max(1) }
                }
                other => other,
            };
            // How the port was lost tells more than that it is still not there. But where the request went out only the second
            // time, that has to be said.
            let before = self.port_failed.filter(|_| is_port && slip.sent.is_none());
            self.ended_before = before.is_some();
            return self.settle(now, known, Err(before.unwrap_or(Slip { why, ..slip })));
        }
        self.port_failed = is_port.then_some(slip);
        self.counts.retries += u32::from(self.unit().is_some());
        self.begin_attempt();
    }

    /// What was asked came to this: the end, where nothing was written that is read back.
    fn settle<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        result: Result<Times, Slip>,
    ) {
        match self.write.take() {
            Some(write) => self.write_goes_on(now, known, write, result),
            None => self.finish(known, result),
        }
    }

    pub(super) fn finish<const U: usize, const P: usize>(
        &mut self,
        known: &mut Known<U, P>,
        result: Result<Times, Slip>,
    ) {
        if let Some(unit) = self.unit() {
            match &result {
                Ok(times) => known.units.answered(unit, times.ended),
                Err(slip) if slip.why.is_silence() => known.units.silent(unit, slip.ended),
                Err(slip) if slip.sent.is_some() && !self.came.as_slice().is_empty() => {
                    known.units.answered(unit, slip.ended);
                }
                Err(_) => {}
            }
        }
        self.state = State::Done(result);
    }

    pub(super) fn outcome(&self, result: Result<Times, Slip>) -> Outcome<'_> {
        match result {
            Ok(times) => Outcome::Answered { times, answer: self.answer.answer() },
            Err(Slip { why, sent, ended }) => {
                let is_shown = matches!(
                    why,
                    Unanswered::NotTaken { .. } | Unanswered::Limited { .. } | Unanswered::Acknowledged { .. }
                );
                let shows = self.answer.words().filter(|_| is_shown);
                Outcome::Failed { why, sent, ended, raw: self.came.as_slice(), shows, before: self.ended_before }
            }
        }
    }
}
