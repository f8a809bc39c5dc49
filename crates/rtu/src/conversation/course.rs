//! The attempts of one call: how long they may take, how many requests, what one leaves to the next, and after which failure
//! there is a next. Here it is counted only; what is sent is decided in `attempt`.

use core::time::Duration;

use super::outcome::{Slip, Unanswered};
use crate::{Agreement, Instant};

/// How many requests went to a unit, and how often the line was opened by then.
pub(super) type Asked = (u32, u32);

/// How many more attempts than questions there may be: those that end with a probe.
const PROBED_IN_VAIN: u32 = 4;

/// Requests that one call may send for each time that it may ask, whatever they are for: the question, and what makes sure of the
/// unit and of the adapter before it. Answers that have to agree are granted more: see [`Course::takes_more`].
pub(super) const REQUESTS: u32 = 8;

/// How a question is put.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// As the caller did.
    Plain,
    /// As a read of so many words, which nothing that the unit owes could pass for.
    Apart(u16),
    /// As the caller did, until the answers agree.
    Repeated,
}

/// A question that is put until the answers agree.
///
/// What this call has left open itself is no rival: whichever of its requests is answered, it is this question that was.
#[derive(Debug, Clone)]
pub(super) struct Hearing {
    pub(super) agreement: Agreement,
    pub(super) asked: u32,
    /// What was asked of the unit when the last answer came or was given up.
    pub(super) known: Option<Asked>,
}

/// What the attempts of one call leave to the next.
#[derive(Debug, Clone)]
pub(super) struct Course {
    /// How long the caller allowed them to take.
    allowed: Duration,
    /// When that is over: from the first look on, and then from the first question on.
    until: Option<Instant>,
    /// For how much longer it may be seen whether what the unit owes comes: that takes none of the time for asking.
    watchable: Duration,
    /// When that began that is under way.
    watching_since: Option<Instant>,
    attempts: u32,
    /// How often it was asked; a question that is repeated to be sure of its answer counts once.
    asked: u32,
    /// How many more questions and time-outs were granted because answers have to agree.
    granted: u32,
    /// What is left of the retries, in halves: a damaged answer, which took no time-out, costs one.
    left: u32,
    /// What was asked of the unit, if the last of it was a read of this call, which it left open; and how that was put.
    left_open: Option<(Asked, Form)>,
    /// What was heard of a question that is repeated until the answers agree.
    pub(super) hearing: Option<Hearing>,
    /// Requests that are left.
    requests: u32,
    /// Whether a write was confirmed by what may have been the confirmation of another one.
    unproven: bool,
}

impl Course {
    /// With `retries` more questions than one, each with a wait of `timeout`.
    ///
    /// The time that the caller allowed, the time-out for each of these times, is allowed once for making sure of the
    /// unit and once, from the first question on, for asking.
    pub(super) fn new(timeout: Duration, retries: u32) -> Self {
        let allowed = timeout.saturating_mul(retries.saturating_add(1));
        let left = retries.saturating_mul(2);
        // One is kept for the look at the adapter after a request that did not wait for it.
        let requests = retries.saturating_add(1).saturating_mul(REQUESTS) - 1;
        Self {
            allowed,
            until: None,
            watchable: allowed,
            watching_since: None,
            attempts: 0,
            asked: 0,
            granted: 0,
            left,
            left_open: None,
            hearing: None,
            requests,
            unproven: false,
        }
    }

    /// The same call goes on with something else: with `retries` more questions than one, and what is left of the requests.
    pub(super) fn go_on_with(&mut self, timeout: Duration, retries: u32) {
        *self = Self { requests: self.requests, ..Self::new(timeout, retries) };
    }

    /// Something is done that sends one request at most. False where none is left: then it must not be.
    pub(super) fn sends(&mut self) -> bool {
        let may = self.requests > 0;
        self.requests = self.requests.saturating_sub(1);
        may
    }

    /// What was sent last was no try: it only prepares the question, and there is an end to such.
    pub(super) fn prepared(&mut self) {
        self.requests = self.requests.saturating_add(1);
    }

    /// Whether there is time left to see whether what the unit owes comes.
    pub(super) fn may_watch(&self) -> bool {
        !self.watchable.is_zero()
    }

    /// It is seen from `now` to `until` whether what the unit owes comes, as far as there is time left for that: until then.
    pub(super) fn watches(&mut self, now: Instant, until: Instant) -> Instant {
        let time = until.saturating_duration_since(now).min(self.watchable);
        self.prepared();
        self.watchable -= time;
        self.watching_since = Some(now);
        now + time
    }

    /// At `now` there is no more to be seen, and the line is its own again: what others used of it meanwhile is none of its time.
    pub(super) fn has_watched(&mut self, now: Instant) {
        if let Some(since) = self.watching_since.take() {
            let time = now.saturating_duration_since(since);
            self.until = self.until.map(|until| until + time);
        }
    }

    /// What confirmed the write may have been meant for another one.
    pub(super) fn is_unproven(&mut self) {
        self.unproven = true;
    }

    /// Whether the write was [not proven](Self::is_unproven). Says so once.
    pub(super) fn take_unproven(&mut self) -> bool {
        core::mem::take(&mut self.unproven)
    }

    /// Whether there is time left at `now`.
    pub(super) fn is_in_time(&mut self, now: Instant) -> bool {
        now < *self.until.get_or_insert(now + self.allowed)
    }

    /// It is asked at `now`.
    pub(super) fn asks(&mut self, now: Instant) {
        if self.asked == 0 {
            self.until = Some(now + self.allowed);
        }
        self.asked += 1;
    }

    /// How often it was asked.
    pub(super) fn asked(&self) -> u32 {
        self.asked
    }

    /// Remembers whether a read, put in this form, lets the same be asked again, as it came to nothing. `asked` is what its unit
    /// was asked by now.
    pub(super) fn leaves_open(&mut self, form: Form, failure: Option<Unanswered>, asked: Option<Asked>) {
        self.left_open = asked.filter(|_| failure.is_some_and(Unanswered::is_unanswered)).map(|asked| (asked, form));
    }

    /// The question has to be put `more` times than once to be believed: that may take as many time-outs of `timeout` more,
    /// twice as many failures, and as many requests as it all takes.
    pub(super) fn takes_more(&mut self, more: u32, timeout: Duration) {
        let granted = more.saturating_sub(self.granted);
        self.granted += granted;
        self.left = self.left.saturating_add(granted.saturating_mul(4));
        self.requests = self.requests.saturating_add(granted.saturating_mul(3));
        let longer = timeout.saturating_mul(granted);
        self.allowed = self.allowed.saturating_add(longer);
        self.until = self.until.map(|until| until + longer);
    }

    /// The question is repeated, `again` where all that its unit owes is the answer to it. `asked` is what the unit was asked.
    pub(super) fn repeats(&mut self, again: bool, asked: Asked) {
        self.left_open = again.then_some((asked, Form::Repeated));
    }

    /// How the question was put, if all that its unit owes is the answer to this very one, so that it may be asked again as
    /// it was. `asked` is what the unit was asked. Says so once.
    pub(super) fn owes_only_this(&mut self, asked: Asked) -> Option<Form> {
        self.left_open.take().filter(|(then, _)| *then == asked).map(|(_, form)| form)
    }

    /// It was not asked again yet, and may be: see [`owes_only_this`](Self::owes_only_this).
    pub(super) fn is_still_owed(&mut self, asked: Asked, form: Form) {
        self.left_open = Some((asked, form));
    }

    /// The question is put in another way the next time.
    pub(super) fn asks_otherwise(&mut self) {
        self.left_open = None;
    }

    /// Whether there is another attempt after one that ended with `slip`, before which it had been `asked` so often.
    /// `to_ask_again`: it is a refusal by which the unit decided nothing.
    pub(super) fn goes_on(&mut self, slip: &Slip, asked: u32, to_ask_again: bool) -> bool {
        self.attempts += 1;
        let cost = match self.asked > asked {
            true if to_ask_again || slip.why.is_damaged() => 1,
            true => 2,
            false => 0,
        };
        let is_over = (cost > 0 && self.left == 0) || self.attempts > self.asked.saturating_add(PROBED_IN_VAIN);
        self.left = self.left.saturating_sub(cost);
        let in_time = self.is_in_time(slip.ended);
        // In another length it may be told apart.
        let is_passing = slip.why.is_passing() || (slip.why == Unanswered::OthersAsk && slip.sent.is_some());
        !is_over && self.requests > 0 && (to_ask_again || is_passing) && in_time
    }
}

#[cfg(test)]
mod tests;
