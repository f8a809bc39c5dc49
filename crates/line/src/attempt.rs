//! One attempt of a call: what has to come before the question, the question, and how often it takes to be sure of the
//! answer.

use std::sync::MutexGuard;

use drivebus_rtu::{Agreement, Answer, Attribution, Request, UnitAddress};

use crate::call::{Call, is_silence};
use crate::course::Course;
use crate::error::{CallError, Failure};
use crate::exchange::{Ask, Done};
use crate::owner::{Asked, Next, Owner};
use crate::queue::{Priority, Turn};
use crate::resync::Tried;

/// How the question may be put.
enum Question {
    /// As it was put before: all that the unit owes is the answer to it.
    Same,
    /// Anew, with what its answer will be worth.
    New(Attribution),
}

/// A question that is put until the answers agree.
struct Hearing {
    agreement: Agreement,
    asked: u32,
    /// What was asked of the unit when the last answer came.
    known: Option<Asked>,
}

impl<'b> Call<'b, '_> {
    /// Asks once, beyond doubt: with what has to come before, and as often as it takes to be sure.
    ///
    /// A read that only this call left open is asked again as it is: whichever of the two is answered, it is this
    /// question that was answered, since this call began. The unit stays in quarantine for whatever is asked next.
    pub(crate) fn attempt(
        &self,
        turn: &mut Turn<'b>,
        course: &mut Course,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        let mut tried = Tried::default();
        let mut hearing = None;
        loop {
            let (mut owner, question) = self.until_sure(turn, course, &mut tried, give_up)?;
            let Question::New(attribution) = question else {
                return course.ask(&mut owner, &Ask { in_doubt: true, ..self.ask }, give_up, take);
            };
            let hearing = self.hearing(&mut hearing, &owner, attribution);
            let Some(unit) = self.unit.filter(|_| !hearing.agreement.is_immediate()) else {
                let result = course.ask(&mut owner, &self.ask, give_up, take);
                return owner.unless_echoed(&self.ask, result, give_up);
            };
            if hearing.asked == 0 {
                course.asks(owner.now());
            }
            if let Some(done) = self.hear(hearing, &mut owner, unit, give_up, take)? {
                return Ok(done);
            }
        }
    }

    /// Does what has to come before the question, and comes back with the line when it may be put.
    fn until_sure(
        &self,
        turn: &mut Turn<'b>,
        course: &mut Course,
        tried: &mut Tried,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(MutexGuard<'b, Owner>, Question), Box<CallError>> {
        loop {
            if !turn.let_pass(give_up) || !self.is_wanted() {
                return Err(self.failed(self.bus.given_up()));
            }
            let mut owner = self.bus.lock();
            if self.bus.is_shut() {
                owner.close();
                return Err(self.ask.failed(Failure::Closed, None, self.bus.now_of(&owner), &[]));
            }
            if let Err(failure) = owner.prepare(give_up) {
                return Err(self.ask.failed(failure, None, self.bus.now_of(&owner), &[]));
            }
            if self.connection.is_some_and(|known| known != owner.stats().reconnects) {
                return Err(self.ask.failed(Failure::Reopened, None, self.bus.now_of(&owner), &[]));
            }
            let in_time = course.is_in_time(self.bus.now_of(&owner));
            if self.unit.is_some_and(|unit| course.owes_only_this(&owner, unit)) {
                return Ok((owner, Question::Same));
            }
            match owner.next(&self.ask, tried, in_time) {
                Next::Ask(attribution) => return Ok((owner, Question::New(attribution))),
                Next::LookForEcho => owner.look_for_echo(&self.ask, tried, give_up)?,
                Next::Probe(unit, probe) => {
                    owner.probe(unit, probe, &self.ask, tried, give_up)?;
                    // Who polls comes again: the others wait for one time-out at a time.
                    if self.priority == Priority::Poll
                        && let Some(error) = tried.failure.take_if(|error| is_silence(&error.failure))
                    {
                        return Err(error);
                    }
                }
                Next::Wait(until) => {
                    drop(owner);
                    self.stand_by(turn, until, give_up)?;
                }
                Next::GiveUp => {
                    let now = self.bus.now_of(&owner);
                    return Err(match tried.failure.take() {
                        Some(error) if !matches!(error.failure, Failure::Refused { .. }) => error,
                        _ => self.ask.failed(Failure::Doubtful, None, now, &[]),
                    });
                }
            }
        }
    }

    /// What was heard so far, unless somebody else asked the unit in between: that may be open now.
    fn hearing<'h>(&self, heard: &'h mut Option<Hearing>, owner: &Owner, attribution: Attribution) -> &'h mut Hearing {
        // Whatever else is repeated would be done twice.
        let twice = self.verify && matches!(self.ask.request, Request::ReadHolding { .. });
        let fresh = || Agreement::new(attribution, 1 + u8::from(twice));
        if let Some(hearing) = heard
            && self.unit.map(|unit| owner.asked(unit)) != hearing.known
        {
            hearing.agreement = fresh();
        }
        heard.get_or_insert_with(|| Hearing { agreement: fresh(), asked: 0, known: None })
    }

    /// Asks `unit` once more; `None` while the answers do not agree.
    fn hear(
        &self,
        hearing: &mut Hearing,
        owner: &mut Owner,
        unit: UnitAddress,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Option<Done>, Box<CallError>> {
        let Hearing { agreement, asked, known } = hearing;
        if *asked == 1 {
            owner.stats().count(Some(unit), |counters| counters.verified += 1);
        }
        *asked += 1;
        let mut agreed = false;
        let result = owner.exchange(&self.ask, give_up, &mut |answer| {
            agreed = agreement.hear(unit, &answer);
            if agreed {
                take(answer);
            }
        });
        *known = Some(owner.asked(unit));
        let is_last = *asked >= u32::from(agreement.longest());
        match result {
            Ok(done) if agreed => Ok(Some(done)),
            Ok(done) if is_last => {
                Err(self.ask.failed(Failure::Disagreeing { asked: *asked }, Some(done.sent), done.ended, &[]))
            }
            Ok(_) => Ok(None),
            Err(error) => match error.failure {
                Failure::Refused { function, code } => {
                    let enough = agreement.hear(unit, &Answer::exception(function, code));
                    if enough || is_last { Err(error) } else { Ok(None) }
                }
                _ => Err(error),
            },
        }
    }
}
