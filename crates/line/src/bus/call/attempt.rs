//! One attempt of a call: what has to come before the question, the question, and how often it takes to be sure of the
//! answer.

use std::sync::MutexGuard;

use drivebus_rtu::{Adu, Agreement, Answer, AnswerError, Attribution, Frame, Request, Table};

use crate::ask::{Ask, Done};
use crate::bus::call::course::{Course, Form, Hearing};
use crate::bus::call::{Call, is_silence};
use crate::bus::errand::Errand;
use crate::error::{CallError, Failure};
use crate::owner::first_contact::Put;
use crate::owner::resync::Tried;
use crate::owner::{Next, Owner, is_line_trouble};
use crate::turns::order::Priority;
use crate::turns::queue::Turn;

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
    /// The same, and nothing can be looked up.
    Untold,
    /// On a line that was just opened, to a unit that returns no echo.
    AtFirstContact(Put),
}

impl<'b> Call<'b, '_> {
    /// Asks once, beyond doubt: with what has to come before, and as often as it takes to be sure.
    ///
    /// A read that only this call left open is asked again as it is: whichever of the two is answered, it is this
    /// question that was answered, since this call began. The unit stays in quarantine for whatever is asked next.
    pub(crate) fn attempt(
        &self,
        turn: &mut Turn<'b, Errand>,
        course: &mut Course,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        let mut tried = Tried::default();
        // Whatever else is repeated would be done twice, and what is verified is asked as it is.
        let mut apart = !self.verify;
        // A question that is repeated until the answers agree counts as asked once an attempt.
        let mut asks = true;
        loop {
            let (mut owner, question) = self.until_sure(turn, course, &mut tried, apart, give_up)?;
            let attribution = match question {
                Question::Same(Form::Plain) => {
                    let ask = Ask { in_doubt: true, ..self.ask };
                    return put(course, &mut owner, &ask, Form::Plain, give_up, take);
                }
                Question::Same(Form::Apart(count)) | Question::Apart(count) => {
                    let again = matches!(question, Question::Same(_));
                    match self.ask_apart(course, &mut owner, count, again, give_up, take) {
                        // It was asked as the caller did, and is the own one as far as that can be told.
                        Err(error) if self.is_asked_by(&error) && owner.may_have_others() => return Err(error),
                        // Another master has the same length: the next has one that it was not heard to have.
                        Err(error) if error.failure == Failure::OthersAsk => {
                            course.asks_otherwise();
                            continue;
                        }
                        Err(error)
                            if is_refusal(&error.failure)
                                && (!self.is_to_ask_again(&error) || owner.may_have_others()) =>
                        {
                            // It may be meant for something else that was asked, or for the words that nobody asked for:
                            // by whatever code, where the name is wrong in which it is read.
                            apart = false;
                            course.asks_otherwise();
                            continue;
                        }
                        result => return result,
                    }
                }
                Question::Unproven => {
                    course.is_unproven();
                    let result = put(course, &mut owner, &self.ask, Form::Plain, give_up, &mut |_| ());
                    return owner.unless_echoed(&self.ask, result, give_up);
                }
                Question::Untold => {
                    let done = put(course, &mut owner, &self.ask, Form::Plain, give_up, &mut |_| ())?;
                    return Err(self.ask.failed(Failure::OthersAsk, Some(done.sent), done.ended, &[]));
                }
                Question::AtFirstContact(put) => {
                    if let Some(done) = self.ask_at_first_contact(course, &mut owner, put, give_up, take)? {
                        return Ok(done);
                    }
                    course.prepared();
                    continue;
                }
                // What was heard goes on.
                Question::Same(Form::Repeated) => Attribution::Certain,
                Question::New(attribution) => attribution,
            };
            let again = matches!(question, Question::Same(_));
            if !self.go_on_hearing(course, &owner, attribution) {
                let result = put(course, &mut owner, &self.ask, Form::Plain, give_up, take);
                return owner.unless_echoed(&self.ask, result, give_up);
            }
            if std::mem::take(&mut asks) {
                course.asks(owner.now());
            }
            if let Some(done) = self.hear(course, &mut owner, again, give_up, take)? {
                return Ok(done);
            }
        }
    }

    /// Does what has to come before the question, and comes back with the line when it may be put.
    fn until_sure(
        &self,
        turn: &mut Turn<'b, Errand>,
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
            if self.priority != Priority::Stop
                && let Some(failure) = self.bus.wills.keeps_from(self.unit)
            {
                drop(owner);
                self.wait_for_the_halt(turn, failure, give_up)?;
                continue;
            }
            if self.connection.is_some_and(|known| known != owner.stats().reconnects) {
                return Err(self.ask.failed(Failure::Reopened, None, self.bus.now_of(&owner), &[]));
            }
            if owner.may_have_others()
                && let Err(failure) = owner.overhear()
            {
                return Err(self.ask.failed(failure, None, self.bus.now_of(&owner), &[]));
            }
            let in_time = course.is_in_time(self.bus.now_of(&owner));
            if !course.sends() {
                return Err(match &course.hearing {
                    Some(Hearing { asked, .. }) if tried.failure.is_none() => {
                        self.ask.failed(Failure::Disagreeing { asked: *asked }, None, self.bus.now_of(&owner), &[])
                    }
                    _ => self.none_settled(tried, &owner),
                });
            }
            if let Some(form) = self.unit.and_then(|unit| course.owes_only_this(|| owner.asked(unit))) {
                return Ok((owner, Question::Same(form)));
            }
            if self.priority == Priority::Stop
                && !self.verify
                && let Some(put) = owner.at_first_contact(&self.ask)
            {
                return Ok((owner, Question::AtFirstContact(put)));
            }
            match owner.next(&self.ask, tried, in_time, apart) {
                Next::Ask(attribution) => return Ok((owner, Question::New(attribution))),
                Next::AskApart(count) => return Ok((owner, Question::Apart(count))),
                Next::OthersAsk => {
                    return Err(self.ask.failed(Failure::OthersAsk, None, self.bus.now_of(&owner), &[]));
                }
                Next::LookForEcho => {
                    owner.look_for_echo(&self.ask, tried, self.priority == Priority::Stop, give_up)?;
                }
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
                Next::Overtaken(_) | Next::AskUntold if self.read_back.is_some() => {
                    return Ok((owner, Question::Unproven));
                }
                Next::AskUntold => return Ok((owner, Question::Untold)),
                Next::Overtaken(until) => {
                    drop(owner);
                    self.stand_by(turn, until, give_up)?;
                    *tried = Tried::default(); // others have asked the unit meanwhile
                }
                Next::Wait(until) => {
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

    /// Whether `error` is the refusal of what was asked, and that had the caller's own length.
    fn is_asked_by(&self, error: &CallError) -> bool {
        matches!(error.failure, Failure::Refused { .. }) && error.request == self.ask.frame()
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
        let (&Request::Read { table, address, count: asked, .. }, Some(unit)) = (self.ask.request, self.unit) else {
            return put(course, owner, &self.ask, Form::Plain, give_up, take);
        };
        let Ok(request) = Request::read_of(table, address, count) else {
            return put(course, owner, &self.ask, Form::Plain, give_up, take);
        };
        if !again && owner.master.in_quarantine(owner.now(), unit) {
            owner.stats().count(Some(unit), |counters| counters.resyncs += 1);
        }
        let ask = Ask { request: &request, in_doubt: again, ..self.ask };
        let is_unproven = owner.is_unproven(unit, &request);
        let mut held = Adu::new();
        let mut result = put(course, owner, &ask, Form::Apart(count), give_up, &mut |answer| {
            if is_unproven {
                held.set_answer(unit, &answer);
            } else {
                take(answer.shortened(asked));
            }
        });
        if let (true, Ok(done)) = (is_unproven, &result) {
            if owner.prove(unit, &ask, give_up)? {
                let answer = Frame::parse(held.as_bytes()).ok();
                if let Some(Ok(answer)) = answer.map(|frame| request.expected().judge(frame.pdu())) {
                    take(answer.shortened(asked));
                }
            } else {
                result = Err(ask.failed(Failure::OthersAsk, Some(done.sent), done.ended, held.as_bytes()));
            }
        }
        if count > asked {
            match &result {
                Ok(_) => owner.longer.given(unit, (table, address)),
                Err(error) if self.is_to_ask_again(error) => {}
                Err(error) if is_refusal(&error.failure) => owner.longer.refused(unit, (table, address), count),
                Err(error) if is_silence(&error.failure) => owner.longer.silent(unit, (table, address), count),
                Err(_) => {}
            }
        }
        result
    }

    /// Asks as `form` says, and gives to `take` what can only be the answer; `None` where it has to be asked once more.
    fn ask_at_first_contact(
        &self,
        course: &mut Course,
        owner: &mut Owner,
        form: Put,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Option<Done>, Box<CallError>> {
        let (&Request::Read { table, address, count, .. }, Some(unit)) = (self.ask.request, self.unit) else {
            return Ok(None);
        };
        let read = match form {
            Put::Plain => Ok(*self.ask.request),
            Put::Apart(words) | Put::First(words) => Request::read_of(table, address, words),
            Put::BehindInput => Request::read_of(Table::Input, address, 1),
        };
        let Ok(request) = read else { return Ok(None) };
        let is_the_answer = matches!(form, Put::Plain | Put::Apart(_));
        // What only prepares the question takes none of the time and of the attempts that it has.
        if is_the_answer {
            course.asks(owner.now());
        }
        if form != Put::Plain {
            owner.stats().count(Some(unit), |counters| counters.resyncs += 1);
        }
        let is_behind_all = owner.met.is_behind_all(unit);
        let ask = Ask { request: &request, in_doubt: true, ..self.ask };
        let result = owner.exchange(&ask, give_up, &mut |answer| {
            if is_the_answer {
                take(answer.shortened(count));
            }
        });
        let refused = result.as_ref().is_err_and(|error| is_refusal(&error.failure) && !self.is_to_ask_again(error));
        let proves = match form {
            Put::Plain => return result.map(Some),
            Put::Apart(_) => result.is_ok(),
            Put::First(_) => false,
            Put::BehindInput => is_behind_all && (result.is_ok() || refused),
        };
        let now = owner.now();
        if proves {
            owner.is_sure(now, unit);
        } else if result.is_ok() || refused {
            owner.leaves_unproven(now, unit, &ask);
        }
        match (form, result) {
            (Put::Apart(_), Ok(done)) => Ok(Some(done)),
            (Put::Apart(words) | Put::First(words), Err(_)) if refused => {
                // Where none is given, no more are.
                owner.longer.refused(unit, (table, address), words.max(count + 1));
                Ok(None)
            }
            (Put::Apart(words) | Put::First(words), Err(error)) => {
                if words > count && is_silence(&error.failure) {
                    owner.longer.silent(unit, (table, address), words);
                }
                Err(error)
            }
            (Put::BehindInput, Err(error)) if !is_line_trouble(&error.failure) => Err(error),
            _ => Ok(None),
        }
    }

    /// Whether the question has to be repeated until the answers agree. What was heard so far counts, unless somebody else
    /// asked the unit in between: that may be open now.
    fn go_on_hearing(&self, course: &mut Course, owner: &Owner, attribution: Attribution) -> bool {
        // Whatever else is repeated would be done twice.
        let twice = self.verify && matches!(self.ask.request, Request::Read { .. });
        if course.hearing.is_none() && attribution == Attribution::Certain && !twice {
            return false;
        }
        let asked = self.unit.map(|unit| owner.asked(unit));
        if course.hearing.as_ref().is_none_or(|hearing| hearing.known != asked) {
            let agreement = Agreement::new(attribution, 1 + u8::from(twice));
            let is_repeated = self.unit.is_some() && !agreement.is_immediate();
            if let Attribution::Repeat { words, .. } = attribution {
                course.takes_more(u32::from(words) - 1, self.ask.timeout);
            }
            let before = course.hearing.as_ref().map_or(0, |hearing| hearing.asked);
            course.hearing = is_repeated.then_some(Hearing { agreement, asked: before, known: None });
        }
        course.hearing.is_some()
    }

    /// Asks once more, `again` where only this call left something open; `None` while the answers do not agree.
    fn hear(
        &self,
        course: &mut Course,
        owner: &mut Owner,
        again: bool,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Option<Done>, Box<CallError>> {
        let (Some(hearing), Some(unit)) = (course.hearing.as_mut(), self.unit) else { return Ok(None) };
        let Hearing { agreement, asked, known } = hearing;
        if *asked == 1 {
            owner.stats().count(Some(unit), |counters| counters.verified += 1);
        }
        *asked += 1;
        let mut agreed = false;
        let ask = Ask { in_doubt: again, ..self.ask };
        let result = owner.exchange(&ask, give_up, &mut |answer| {
            agreed = agreement.hear(unit, &answer);
            if agreed {
                take(answer);
            }
        });
        *known = Some(owner.asked(unit));
        let is_last = *asked >= u32::from(agreement.longest());
        let (sent, ended) = match result {
            Ok(done) if agreed => return Ok(Some(done)),
            Ok(done) if is_last => (Some(done.sent), Some(done.ended)),
            Ok(_) => {
                // What this call left open before may still come; it is an answer like this one.
                course.repeats(again, || owner.asked(unit));
                return Ok(None);
            }
            Err(error) => {
                let Failure::Refused { function, code } = error.failure else {
                    let result = Err(error);
                    course.leaves_open(&self.ask, Form::Repeated, &result, |unit| owner.asked(unit));
                    return result.map(|_: Done| None);
                };
                if self.is_to_ask_again(&error) {
                    return Err(error);
                }
                if agreement.hear(unit, &Answer::exception(function, code)) {
                    return Err(error);
                }
                if !is_last {
                    return Ok(None);
                }
                (error.sent, error.ended)
            }
        };
        let failure = Failure::Disagreeing { asked: *asked };
        course.hearing = None;
        Err(self.ask.failed(failure, sent, ended, &[]))
    }
}

/// Asks in this form, and has `course` remember whether the same may be asked again.
fn put(
    course: &mut Course,
    owner: &mut Owner,
    ask: &Ask<'_>,
    form: Form,
    give_up: &mut dyn FnMut() -> bool,
    take: &mut dyn FnMut(Answer<'_>),
) -> Result<Done, Box<CallError>> {
    course.asks(owner.now());
    let result = owner.exchange(ask, give_up, take);
    course.leaves_open(ask, form, &result, |unit| owner.asked(unit));
    result
}

/// Whether a refusal came, whatever it was meant for.
fn is_refusal(failure: &Failure) -> bool {
    matches!(failure, Failure::Refused { .. } | Failure::Wrong(AnswerError::Refusal { .. }))
}

#[cfg(test)]
#[allow(clippy::panic, reason = "a test may panic")]
mod tests;
