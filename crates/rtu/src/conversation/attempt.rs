//! One attempt of a call: what has to come before the question, the question, and how often it takes to be sure of the
//! answer.

use super::course::{Form, Hearing};
use super::exchange::Purpose;
use super::first_contact::Put;
use super::known::{Ask, Known, Next};
use super::outcome::{Slip, Unanswered};
use super::probes::{Probe, Tried};
use super::two_parts::Begun;
use super::{Conversation, State, Urgency};
use crate::huanyang::Huanyang;
use crate::{Agreement, Attribution, Instant, Request, Table};

/// What one attempt has to remember.
#[derive(Debug, Clone)]
pub(super) struct Attempt {
    pub(super) tried: Tried,
    /// Whether the question may be put in another length.
    pub(super) apart: bool,
    /// Whether the next question counts: one that is repeated until the answers agree counts once.
    asks: bool,
    /// How often it was asked before.
    pub(super) asked_before: u32,
    /// The first part of the question, where that has come alone.
    pub(super) begun: Option<Begun>,
    /// How often its two parts did not fit.
    pub(super) changes: u8,
}

impl Attempt {
    /// One of a question that was asked so often before.
    pub(super) fn new(verify: bool, asked_before: u32) -> Self {
        // Whatever else is repeated would be done twice, and what is verified is asked as it is.
        Self { tried: Tried::default(), apart: !verify, asks: true, asked_before, begun: None, changes: 0 }
    }
}

impl<'r> Conversation<'r> {
    /// Others have gone first, where they were more urgent.
    pub(super) fn passed<const U: usize, const P: usize>(&mut self, now: Instant, known: &mut Known<U, P>) {
        if self.connection.is_some_and(|connection| connection != known.connection()) {
            let slip = self.slip(Unanswered::Reopened, None, now);
            return self.end_attempt(now, known, Err(slip));
        }
        let overhears = core::mem::take(&mut self.has_paused) || known.others;
        self.state = if overhears { State::Overhearing } else { State::Deciding };
    }

    /// Chooses the next request, and begins it, or leaves the line to others.
    ///
    /// A read that only this call left open is asked again as it is: whichever of the two is answered, it is this
    /// question that was answered, since this call began. The unit stays in quarantine for whatever is asked next.
    pub(super) fn decide<const U: usize, const P: usize>(&mut self, now: Instant, known: &mut Known<U, P>) {
        let ask = self.ask();
        self.course.has_watched(now);
        let in_time = self.course.is_in_time(now);
        let is_stop = self.question.urgency == Urgency::Stop;
        let waits = !is_stop && in_time && self.course.may_watch();
        if !self.course.sends() {
            let result = match &self.course.hearing {
                Some(Hearing { asked, agreement, .. })
                    if self.attempt.tried.failure.is_none() && agreement.was_contradicted() =>
                {
                    let why = Unanswered::Disagreeing { asked: *asked };
                    Err(self.slip(why, None, now))
                }
                _ => Err(self.none_settled(now)),
            };
            self.end_attempt(now, known, result);
            return;
        }
        if let Some(unit) = self.unit()
            && let Some(form) = self.course.owes_only_this(known.asked(unit))
            && (is_stop || !known.master.may_come_whole(now, unit, &ask.request))
        {
            let watches = known.watches_before_asking_again(now, unit, &ask).filter(|_| waits);
            if let (Form::Plain | Form::Repeated, Some(until)) = (form, watches) {
                self.course.is_still_owed(known.asked(unit), form);
                return self.watch(now, until);
            }
            match form {
                Form::Plain => self.put(now, known, Ask { in_doubt: true, ..ask }, Purpose::Same),
                Form::Apart(count) => self.ask_apart(now, known, ask, count, true),
                // What was heard goes on.
                Form::Repeated => self.ask_sure(now, known, ask, Attribution::Certain, true),
            }
            return;
        }
        if is_stop
            && !self.question.verify
            && let Some(put) = known.at_first_contact(now, &ask)
        {
            self.ask_at_first_contact(now, known, ask, put);
            return;
        }
        if let Some(begun) = self.attempt.begun.take()
            && self.asks_last_part(now, known, &ask, begun)
        {
            return;
        }
        let can_look_up = self.write.as_ref().is_some_and(|write| !write.is_reading());
        match known.next(now, &ask, self.words, &self.attempt.tried, (in_time, waits), self.attempt.apart) {
            Next::Ask(attribution) => self.ask_sure(now, known, ask, attribution, false),
            Next::AskApart(count) => self.ask_apart(now, known, ask, count, false),
            Next::AskInTwo(first, last) => self.ask_first_part(now, known, ask, (first, last)),
            Next::OthersAsk => {
                let slip = self.slip(Unanswered::OthersAsk, None, now);
                self.end_attempt(now, known, Err(slip));
            }
            Next::LookForEcho => match known.look(now, &ask, is_stop) {
                Some(request) => {
                    self.attempt.tried.looks += 1;
                    self.send(now, known, Ask { request, in_doubt: true, ..ask }, Purpose::Look);
                }
                None => self.state = State::Passing,
            },
            Next::Probe(probe) => self.probe(now, known, ask, probe),
            // Where the words can be read, what they are is known sooner than who was confirmed.
            Next::Overtaken(_) | Next::AskUntold if can_look_up => {
                self.course.is_unproven();
                self.put(now, known, ask, Purpose::Unproven);
            }
            Next::AskUntold => self.put(now, known, ask, Purpose::Untold),
            Next::Overtaken(until) => {
                self.attempt.tried = Tried::default(); // others will have asked the unit meanwhile
                self.state = State::Pausing(until);
            }
            Next::Watch(until) => self.watch(now, until),
            Next::Wait(until) => self.state = State::Pausing(until),
            Next::GiveUp => {
                let slip = self.none_settled(now);
                self.end_attempt(now, known, Err(slip));
            }
        }
    }

    /// Stands by until then, for what may come; nothing is sent.
    fn watch(&mut self, now: Instant, until: Instant) {
        self.state = State::Pausing(self.course.watches(now, until));
    }

    /// What is said where nothing that was tried made sure of the unit.
    fn none_settled(&mut self, now: Instant) -> Slip {
        match self.attempt.tried.failure.take() {
            Some((slip, came)) => {
                self.came = came;
                // A refusal says that the unit is there, and not what it may owe.
                if slip.why.is_refused() { Slip { why: Unanswered::Doubtful, sent: None, ended: now } } else { slip }
            }
            None => self.slip(Unanswered::Doubtful, None, now),
        }
    }

    /// The question goes out, and that counts.
    pub(super) fn put<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: Ask<'r>,
        purpose: Purpose<'r>,
    ) {
        self.course.asks(now);
        self.send(now, known, ask, purpose);
    }

    /// Asks as the caller did, once or until the answers agree; `again` where only this call left something open.
    fn ask_sure<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: Ask<'r>,
        attribution: Attribution,
        again: bool,
    ) {
        if !self.go_on_hearing(known, &ask, attribution) {
            return self.put(now, known, ask, Purpose::Plain);
        }
        if core::mem::take(&mut self.attempt.asks) {
            self.course.asks(now);
        }
        if let Some(hearing) = &mut self.course.hearing {
            self.counts.verified += u32::from(hearing.asked == 1);
            hearing.asked += 1;
        }
        self.send(now, known, Ask { in_doubt: again, ..ask }, Purpose::Hear { again });
    }

    /// Whether the question has to be repeated until the answers agree. What was heard so far counts, unless somebody else
    /// asked the unit in between: that may be open now.
    fn go_on_hearing<const U: usize, const P: usize>(
        &mut self,
        known: &Known<U, P>,
        ask: &Ask<'r>,
        attribution: Attribution,
    ) -> bool {
        // Whatever else is repeated would be done twice.
        let twice = self.question.verify && matches!(ask.request, Request::Read { .. });
        if self.course.hearing.is_none() && attribution == Attribution::Certain && !twice {
            return false;
        }
        let asked = ask.destination.unit().map(|unit| known.asked(unit));
        if self.course.hearing.as_ref().is_none_or(|hearing| hearing.known != asked) {
            let agreement = Agreement::new(attribution, 1 + u8::from(twice));
            let is_repeated = !agreement.is_immediate();
            if let Attribution::Repeat { words, .. } = attribution {
                self.course.takes_more(u32::from(words) - 1, ask.timeout);
            }
            let before = self.course.hearing.as_ref().map_or(0, |hearing| hearing.asked);
            self.course.hearing = is_repeated.then_some(Hearing { agreement, asked: before, known: None });
        }
        self.course.hearing.is_some()
    }

    /// Asks as a read of `count` words, which tells its answer apart.
    fn ask_apart<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: Ask<'r>,
        count: u16,
        again: bool,
    ) {
        let request = match ask.request {
            Request::Read { table, address, .. } => Request::read_of(table, address, count).ok(),
            _ => None,
        };
        let (Some(request), Some(unit)) = (request, ask.destination.unit()) else {
            return self.put(now, known, ask, Purpose::Plain);
        };
        self.counts.resyncs += u32::from(!again && known.master.in_quarantine(now, unit));
        let is_unproven = known.is_unproven(now, unit, &request);
        let purpose = Purpose::Apart { count, is_unproven };
        self.put(now, known, Ask { request, in_doubt: again, ..ask }, purpose);
    }

    /// Asks as `put` says.
    fn ask_at_first_contact<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: Ask<'r>,
        put: Put,
    ) {
        let read = match (put, ask.request) {
            (Put::Plain, request) => Some(request),
            (Put::Apart(words) | Put::First(words), Request::Read { table, address, .. }) => {
                Request::read_of(table, address, words).ok()
            }
            (Put::BehindInput, Request::Read { address, .. }) => Request::read_of(Table::Input, address, 1).ok(),
            _ => None,
        };
        let (Some(request), Some(unit)) = (read, ask.destination.unit()) else {
            self.course.prepared();
            self.state = State::Passing;
            return;
        };
        // What only prepares the question takes none of the time and of the attempts that it has.
        if matches!(put, Put::Plain | Put::Apart(_)) {
            self.course.asks(now);
        }
        self.counts.resyncs += u32::from(put != Put::Plain);
        let is_behind_all = known.units.of(unit).met.is_behind_all();
        let purpose = Purpose::FirstContact { put, is_behind_all };
        self.send(now, known, Ask { request, in_doubt: true, ..ask }, purpose);
    }

    /// Sends `probe` to the unit that is asked.
    fn probe<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: Ask<'r>,
        probe: Probe,
    ) {
        let request = match probe {
            Probe::Echo => Request::echo(self.words.next()),
            Probe::Status { number } => Request::Huanyang(Huanyang::ReadStatus { number }),
            Probe::OtherRead { address, count } => match Request::read(address, count) {
                Ok(request) => request,
                // The count was checked when the probe was chosen.
                Err(_) => return self.state = State::Passing,
            },
        };
        self.attempt.tried.note(probe);
        self.counts.resyncs += 1;
        self.send(now, known, Ask { request, ..ask }, Purpose::Probe(probe));
    }
}
