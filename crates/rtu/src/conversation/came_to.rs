//! What follows from what a request came to, by what it was for.

use super::course::{Form, Hearing};
use super::echo::LOOKS;
use super::exchange::{Flight, Purpose};
use super::first_contact::Put;
use super::known::{Ask, Known};
use super::outcome::{Slip, Times, Unanswered};
use super::probes::Probe;
use super::{Conversation, OwnEcho, State, Urgency};
use crate::{Answer, Instant, Request};

impl<'r> Conversation<'r> {
    /// `flight` has come to `result`, and that was told: learns from it, and goes on.
    pub(super) fn conclude<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        flight: Flight<'r>,
        result: Result<Times, Slip>,
    ) {
        self.learn(known, &flight, &result);
        match flight.purpose {
            Purpose::Same => {
                self.leaves_open(known, Form::Plain, &flight, &result);
                self.end_attempt(now, known, result);
            }
            Purpose::Plain => {
                self.leaves_open(known, Form::Plain, &flight, &result);
                self.unless_echoed(now, known, result);
            }
            Purpose::Unproven => {
                self.leaves_open(known, Form::Plain, &flight, &result);
                self.answer.clear();
                self.unless_echoed(now, known, result);
            }
            Purpose::Untold => {
                self.leaves_open(known, Form::Plain, &flight, &result);
                let result = match result {
                    Ok(times) => Err(self.slip(Unanswered::OthersAsk, Some(times.sent), times.ended)),
                    err => err,
                };
                self.end_attempt(now, known, result);
            }
            Purpose::Apart { count, is_unproven } => {
                self.leaves_open(known, Form::Apart(count), &flight, &result);
                match result {
                    Ok(times) if is_unproven => self.prove(now, known, flight.ask, count, times),
                    result => self.apart_came_to(now, known, &flight.ask, count, result),
                }
            }
            Purpose::First { last } => self.first_part_came_to(now, known, &flight.ask, last, result),
            Purpose::Last { sent } => self.last_part_came_to(now, known, &flight.ask, sent, result),
            Purpose::Proof { of, count, times } => {
                self.proof_came_to(now, known, &flight.ask, (of, count, times), result);
            }
            Purpose::FirstContact { put, is_behind_all } => {
                self.first_contact_came_to(now, known, &flight.ask, (put, is_behind_all), result);
            }
            Purpose::Hear { again } => self.heard_once(now, known, again, result),
            Purpose::Probe(probe) => self.probe_came_to(now, known, probe, result),
            Purpose::Look => self.look_came_to(now, known, result),
            Purpose::LookAfter { times } => self.looked_after(now, known, times),
        }
    }

    fn leaves_open<const U: usize, const P: usize>(
        &mut self,
        known: &Known<U, P>,
        form: Form,
        flight: &Flight<'r>,
        result: &Result<Times, Slip>,
    ) {
        let unit = flight.ask.destination.unit().filter(|_| matches!(flight.ask.request, Request::Read { .. }));
        self.course.leaves_open(form, result.err().map(|slip| slip.why), unit.map(|unit| known.asked(unit)));
    }

    /// A request that did not wait until it was known whether the adapter echoes came to `result`: if it does, it may have been
    /// its echo that came. Only the confirmation waits for that, not the stop.
    fn unless_echoed<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        result: Result<Times, Slip>,
    ) {
        let ask = self.ask();
        match result {
            Ok(times)
                if known.echo == OwnEcho::Unknown
                    && ask.destination.unit().is_some()
                    && ask.request.expected().may_repeat_request() =>
            {
                match known.look(now, &ask, false) {
                    Some(request) => {
                        // As what it stands behind did, it goes out in doubt, or to a unit that is in none.
                        self.send(now, known, Ask { request, ..ask }, Purpose::LookAfter { times });
                    }
                    None => self.looked_after(now, known, times),
                }
            }
            result => self.end_attempt(now, known, result),
        }
    }

    /// Whatever became of the look: what counts is whether the line has shown by then that it does not echo.
    ///
    /// If it has not, the request went out, and it is not known whether the unit took it.
    fn looked_after<const U: usize, const P: usize>(&mut self, now: Instant, known: &mut Known<U, P>, times: Times) {
        let ask = self.ask();
        let (OwnEcho::Unknown | OwnEcho::Present, Some(unit)) = (known.echo, ask.destination.unit()) else {
            return self.end_attempt(now, known, Ok(times));
        };
        known.master.still_owed(times.ended, unit, &ask.request, ask.timeout);
        self.answer.clear();
        let why = Unanswered::NoAnswer { timeout: ask.timeout, attempts: 1 };
        let slip = self.slip(why, Some(times.sent), times.ended);
        self.end_attempt(now, known, Err(slip));
    }

    /// The adapter was looked at before the question.
    fn look_came_to<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        result: Result<Times, Slip>,
    ) {
        let is_last = self.attempt.tried.looks >= LOOKS;
        if known.echo != OwnEcho::Unknown {
            self.state = State::Passing;
            return;
        }
        let ended = match result {
            Err(slip) if !slip.why.is_line_trouble() || is_last && !slip.why.is_refused() => {
                Err(Slip { sent: None, ..slip })
            }
            _ if is_last => Err(self.slip(Unanswered::Doubtful, None, now)),
            // Where no more is sent, this is what is told.
            Err(slip) => {
                self.attempt.tried.failure = Some((Slip { sent: None, ..slip }, self.came));
                Ok(())
            }
            Ok(_) => Ok(()),
        };
        match ended {
            Ok(()) => self.state = State::Passing,
            Err(slip) => self.end_attempt(now, known, Err(slip)),
        }
    }

    /// What it brought, the line and this attempt know. Where the port was lost, no other probe is worth trying.
    fn probe_came_to<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        probe: Probe,
        result: Result<Times, Slip>,
    ) {
        if let Err(slip) = result {
            let slip = Slip { sent: None, ..slip };
            if !slip.why.is_line_trouble() {
                return self.end_attempt(now, known, Err(slip));
            }
            if let Some(unit) = self.unit() {
                let record = known.units.of(unit);
                if slip.why.is_refused() {
                    record.met.answered();
                }
                if probe == Probe::Echo && slip.why.is_silence() {
                    record.probing.silent_on_echo();
                }
            }
            self.attempt.tried.failure = Some((slip, self.came));
        } else if let (Some(unit), Some(hearing)) = (self.unit(), &mut self.course.hearing) {
            // What only the probe came between goes on being heard: its answer is there, and is no rival.
            let (asked, openings) = known.asked(unit);
            if hearing.known == Some((asked.wrapping_sub(1), openings)) {
                hearing.known = Some((asked, openings));
            }
        }
        // Who polls comes again: the others wait for one time-out at a time.
        let is_poll = self.question.urgency == Urgency::Poll;
        match self.attempt.tried.failure.take_if(|(slip, _)| is_poll && slip.why.is_silence()) {
            Some((slip, came)) => {
                self.came = came;
                self.end_attempt(now, known, Err(slip));
            }
            None => self.state = State::Passing,
        }
    }

    /// `ask`, a read of `count` words, was answered at `times`, where another master may ask the same: asks for another number
    /// of words.
    fn prove<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: Ask<'r>,
        count: u16,
        times: Times,
    ) {
        let (Some(unit), Request::Read { table, address, .. }) = (ask.destination.unit(), ask.request) else {
            return self.apart_came_to(now, known, &ask, count, Ok(times));
        };
        let other = known.other_length(now, unit, &ask.request);
        match other.and_then(|words| Request::read_of(table, address, words).ok()) {
            // What cannot be proven any more may be another's.
            Some(_) if !self.course.sends() => {
                let slip = self.slip(Unanswered::OthersAsk, Some(times.sent), times.ended);
                self.end_attempt(now, known, Err(slip));
            }
            Some(request) => {
                self.counts.resyncs += 1;
                let purpose = Purpose::Proof { of: ask.request, count, times };
                self.send(now, known, Ask { request, ..ask }, purpose);
            }
            None => self.state = State::Proving { ask, count, times },
        }
    }

    /// The other read came to `result`.
    fn proof_came_to<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        proof: &Ask<'r>,
        (of, count, times): (Request<'r>, u16, Times),
        result: Result<Times, Slip>,
    ) {
        match result {
            Err(slip) if !slip.why.is_refused() => return self.apart_ended(now, known, proof, Err(slip)),
            Err(_) => {
                if let (Request::Read { table, address, count: words, .. }, Some(unit)) =
                    (proof.request, proof.destination.unit())
                {
                    let refused = if words > count { words } else { u16::MAX };
                    known.longer.refused(unit, (table, address), refused);
                }
            }
            Ok(_) => {}
        }
        self.state = State::Proving { ask: Ask { request: of, ..*proof }, count, times };
    }

    /// What came in behind the proof was taken down: tells whether `ask` was answered by its own answer.
    pub(super) fn proved<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: Ask<'r>,
        count: u16,
        times: Times,
    ) {
        let is_ours = ask.destination.unit().is_none_or(|unit| known.proves(now, unit, &ask.request));
        let result =
            if is_ours { Ok(times) } else { Err(self.slip(Unanswered::OthersAsk, Some(times.sent), times.ended)) };
        self.apart_came_to(now, known, &ask, count, result);
    }

    /// `ask`, which is the question as a read of `count` words, came to `result`.
    fn apart_came_to<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: &Ask<'r>,
        count: u16,
        result: Result<Times, Slip>,
    ) {
        if let (Request::Read { table, address, count: asked, .. }, Some(unit)) =
            (self.ask().request, ask.destination.unit())
            && count > asked
        {
            let place = (table, address);
            match result.as_ref().map_err(|slip| slip.why) {
                Ok(_) => known.longer.given(unit, place),
                Err(why) if why.refuses_words(&self.question.meanings) => known.longer.refused(unit, place, count),
                Err(why) if why.is_silence() => known.longer.silent(unit, place, count),
                Err(_) => {}
            }
        }
        self.apart_ended(now, known, ask, result);
    }

    /// The question as `ask` puts it, or what proves its answer, ended so.
    pub(super) fn apart_ended<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: &Ask<'r>,
        result: Result<Times, Slip>,
    ) {
        let Err(Slip { why, .. }) = result else { return self.end_attempt(now, known, result) };
        let is_as_asked = why.is_refused() && ask.request == self.ask().request;
        if is_as_asked && known.others {
            // It was asked as the caller did, and is the own one as far as that can be told.
        } else if why == Unanswered::OthersAsk {
            // Another master has the same length: the next has one that it was not heard to have.
            self.course.asks_otherwise();
            self.state = State::Passing;
            return;
        } else if self.says_no(why, ask) || why.is_refusal() && known.others {
            // It may be meant for something else that was asked, or for the words that nobody asked for:
            // by whatever code, where the name is wrong in which it is read.
            self.attempt.apart = false;
            self.course.asks_otherwise();
            self.state = State::Passing;
            return;
        }
        self.end_attempt(now, known, result);
    }

    /// Whether the unit refuses `ask`, as which the question was put, for good: also where it only asks for more.
    fn says_no(&self, why: Unanswered, ask: &Ask<'r>) -> bool {
        if words_of(&ask.request) > words_of(&self.ask().request) {
            why.refuses_words(&self.question.meanings)
        } else {
            why.is_refusal() && !self.asks_again(why)
        }
    }

    /// The question was put as `put` says: gives what can only be the answer, or has it asked once more.
    fn first_contact_came_to<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: &Ask<'r>,
        (put, is_behind_all): (Put, bool),
        result: Result<Times, Slip>,
    ) {
        let (Request::Read { table, address, count, .. }, Some(unit)) = (self.ask().request, ask.destination.unit())
        else {
            return self.end_attempt(now, known, result);
        };
        let refused = result.is_err_and(|slip| self.says_no(slip.why, ask));
        let proves = match put {
            Put::Plain => return self.end_attempt(now, known, result),
            Put::Apart(_) => result.is_ok(),
            Put::First(_) => false,
            Put::BehindInput => is_behind_all && (result.is_ok() || refused),
        };
        if proves {
            known.is_sure(now, unit);
        } else if result.is_ok() || refused {
            known.leaves_unproven(now, unit, ask);
        }
        match (put, result) {
            (Put::Apart(_), Ok(_)) => return self.end_attempt(now, known, result),
            (Put::Apart(words) | Put::First(words), Err(_)) if refused => {
                // Where none is given, no more are.
                known.longer.refused(unit, (table, address), words.max(count + 1));
            }
            (Put::Apart(words) | Put::First(words), Err(slip)) => {
                if words > count && slip.why.is_silence() {
                    known.longer.silent(unit, (table, address), words);
                }
                return self.end_attempt(now, known, result);
            }
            (Put::BehindInput, Err(slip)) if !slip.why.is_line_trouble() => {
                return self.end_attempt(now, known, result);
            }
            _ => {}
        }
        self.course.prepared();
        self.state = State::Passing;
    }

    /// The question was put once more: tells whether the answers agree.
    fn heard_once<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        again: bool,
        result: Result<Times, Slip>,
    ) {
        let is_put_off = result.is_err_and(|slip| self.asks_again(slip.why));
        let (Some(unit), Some(hearing)) = (self.unit(), self.course.hearing.as_mut()) else {
            return self.end_attempt(now, known, result);
        };
        let Hearing { agreement, asked, known: then } = hearing;
        *then = Some(known.asked(unit));
        let asked = *asked;
        let (sent, ended) = match result {
            Ok(times) => {
                if self.answer.answer().is_some_and(|answer| agreement.hear(unit, &answer)) {
                    return self.end_attempt(now, known, result);
                }
                if !agreement.is_in_vain() {
                    // What this call left open before may still come; it is an answer like this one.
                    self.course.repeats(again, known.asked(unit));
                    self.state = State::Passing;
                    return;
                }
                (Some(times.sent), times.ended)
            }
            Err(slip) => {
                let Unanswered::Refused { function, code } = slip.why else {
                    let is_read = matches!(self.ask().request, Request::Read { .. });
                    let known_by = is_read.then(|| known.asked(unit));
                    self.course.leaves_open(Form::Repeated, Some(slip.why), known_by);
                    return self.end_attempt(now, known, result);
                };
                if is_put_off || agreement.hear(unit, &Answer::exception(function, code)) {
                    return self.end_attempt(now, known, result);
                }
                if !agreement.is_in_vain() {
                    self.state = State::Passing;
                    return;
                }
                (slip.sent, slip.ended)
            }
        };
        self.course.hearing = None;
        if known.master.attribution(now, unit, &self.ask().request).may_be_mistaken() {
            self.attempt.tried.disagreed = true;
            self.state = State::Passing;
            return;
        }
        let slip = self.slip(Unanswered::Disagreeing { asked }, sent, ended);
        self.end_attempt(now, known, Err(slip));
    }
}

/// How many words a read asks for; 0 of anything else.
const fn words_of(request: &Request<'_>) -> u16 {
    match request {
        Request::Read { count, .. } => *count,
        _ => 0,
    }
}
