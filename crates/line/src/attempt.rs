//! One attempt of a call: what has to come before the question, the question, and how often it takes to be sure of the
//! answer.

use std::sync::MutexGuard;

use drivebus_rtu::{Agreement, Answer, AnswerError, Attribution, Request, UnitAddress};

use crate::call::{Call, is_silence};
use crate::course::{Course, Form};
use crate::error::{CallError, Failure};
use crate::exchange::{Ask, Done};
use crate::owner::{Asked, Next, Owner};
use crate::queue::{Priority, Turn};
use crate::resync::Tried;

/// How the question may be put.
enum Question {
    /// As it was put before: all that the unit owes is the answer to it.
    Same(Form),
    /// As a read of so many words, which nothing that the unit owes could pass for.
    Apart(u16),
    /// As it is, with what its answer will be worth.
    New(Attribution),
    /// As it is, although it may be another one that is confirmed: whether it was taken is looked up afterwards.
    Unproven,
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
        // Whatever else is repeated would be done twice, and what is verified is asked as it is.
        let mut apart = !self.verify;
        loop {
            let (mut owner, question) = self.until_sure(turn, course, &mut tried, apart, give_up)?;
            let attribution = match question {
                Question::Same(Form::Plain) => {
                    let ask = Ask { in_doubt: true, ..self.ask };
                    return course.ask(&mut owner, &ask, Form::Plain, give_up, take);
                }
                Question::Same(Form::Apart(count)) | Question::Apart(count) => {
                    let again = matches!(question, Question::Same(_));
                    match self.ask_apart(course, &mut owner, count, again, give_up, take) {
                        Err(error) if is_refusal(&error.failure) => {
                            // It may be meant for something else that was asked, or for the words that nobody asked for.
                            apart = false;
                            course.asks_otherwise();
                            continue;
                        }
                        result => return result,
                    }
                }
                Question::Unproven => {
                    course.is_unproven();
                    let ask = Ask { in_doubt: true, ..self.ask };
                    let result = course.ask(&mut owner, &ask, Form::Plain, give_up, &mut |_| ());
                    return owner.unless_echoed(&self.ask, result, give_up);
                }
                Question::New(attribution) => attribution,
            };
            let hearing = self.hearing(&mut hearing, &owner, attribution);
            let Some(unit) = self.unit.filter(|_| !hearing.agreement.is_immediate()) else {
                let result = course.ask(&mut owner, &self.ask, Form::Plain, give_up, take);
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
        apart: bool,
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
            if !course.sends() {
                return Err(self.none_settled(tried, &owner));
            }
            if let Some(form) = self.unit.and_then(|unit| course.owes_only_this(&owner, unit)) {
                return Ok((owner, Question::Same(form)));
            }
            match owner.next(&self.ask, tried, in_time, apart) {
                Next::Ask(attribution) => return Ok((owner, Question::New(attribution))),
                Next::AskApart(count) => return Ok((owner, Question::Apart(count))),
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
                // Where the words can be read, what they are is known sooner than who was confirmed.
                Next::Overtaken(_) if self.read_back.is_some() => return Ok((owner, Question::Unproven)),
                Next::Wait(until) | Next::Overtaken(until) => {
                    drop(owner);
                    self.stand_by(turn, until, give_up)?;
                }
                Next::GiveUp => return Err(self.none_settled(tried, &owner)),
            }
        }
    }

    /// What is said where nothing that was tried made sure of the unit.
    fn none_settled(&self, tried: &mut Tried, owner: &Owner) -> Box<CallError> {
        match tried.failure.take() {
            Some(error) if !matches!(error.failure, Failure::Refused { .. }) => error,
            _ => self.ask.failed(Failure::Doubtful, None, self.bus.now_of(owner), &[]),
        }
    }

    /// Asks as a read of `count` words, which tells its answer apart, and gives those that were asked for to `take`.
    fn ask_apart(
        &self,
        course: &mut Course,
        owner: &mut Owner,
        count: u16,
        again: bool,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        let (&Request::ReadHolding { address, count: asked, .. }, Some(unit)) = (self.ask.request, self.unit) else {
            return course.ask(owner, &self.ask, Form::Plain, give_up, take);
        };
        let Ok(request) = Request::read(address, count) else {
            return course.ask(owner, &self.ask, Form::Plain, give_up, take);
        };
        if !again && owner.master.in_quarantine(owner.now(), unit) {
            owner.stats().count(Some(unit), |counters| counters.resyncs += 1);
        }
        let ask = Ask { request: &request, in_doubt: again, ..self.ask };
        let result = course.ask(owner, &ask, Form::Apart(count), give_up, &mut |answer| take(answer.shortened(asked)));
        if count > asked {
            match &result {
                Ok(_) => owner.longer.given(unit, address),
                Err(error) if is_refusal(&error.failure) => owner.longer.refused(unit, address, count),
                Err(error) if is_silence(&error.failure) => owner.longer.silent(unit, address, count),
                Err(_) => {}
            }
        }
        result
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

/// Whether a refusal came, whatever it was meant for.
fn is_refusal(failure: &Failure) -> bool {
    matches!(failure, Failure::Refused { .. } | Failure::Wrong(AnswerError::Refusal { .. }))
}
