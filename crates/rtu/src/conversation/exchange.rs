//! One request on the wire: what became of it, and what that teaches about the line.

use core::time::Duration;

use super::first_contact::Put;
use super::known::{Ask, Known};
use super::outcome::{Exchange, Slip, Times, Unanswered};
use super::probes::Probe;
use super::{Conversation, Polled, State};
use crate::{Adu, Answer, AnswerError, Event, ExceptionCode, Instant, Master, Meaning, Request, Tally};

/// What a request is for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Purpose<'r> {
    /// The question, as it was put before: all that the unit owes is the answer to it.
    Same,
    /// The question as it is.
    Plain,
    /// The same, although it may be another one that is confirmed: whether it was taken is looked up afterwards.
    Unproven,
    /// The same, and nothing can be looked up.
    Untold,
    /// The question as a read of so many words.
    Apart { count: u16, is_unproven: bool },
    /// The first words of the question, of which the last `last` follow.
    First { last: u16 },
    /// The last words of the question, the first of which were asked for then.
    Last { sent: Instant },
    /// Behind the answer to `of`, the question as a read of `count` words, which came at these times: a read of another length.
    Proof { of: Request<'r>, count: u16, times: Times },
    /// The question at first contact.
    FirstContact { put: Put, is_behind_all: bool },
    /// The question once more, until the answers agree.
    Hear { again: bool },
    /// What makes sure of the unit.
    Probe(Probe),
    /// What shows whether the adapter echoes, before the question.
    Look,
    /// The same, behind the confirmation of a question that did not wait for it.
    LookAfter { times: Times },
}

impl Purpose<'_> {
    /// Whether what comes is, or may become, the answer that the caller gets. What only prepares a question at first contact gives
    /// way to what comes behind it.
    fn keeps_the_answer(self) -> bool {
        !matches!(self, Self::Proof { .. } | Self::Probe(_) | Self::Look | Self::LookAfter { .. })
    }
}

/// A request on the wire.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flight<'r> {
    pub(super) ask: Ask<'r>,
    pub(super) purpose: Purpose<'r>,
    /// How long it is waited for, as the unit's answers have taught.
    pub(super) timeout: Duration,
    /// When it was handed out.
    pub(super) sent: Option<Instant>,
    /// Whether what came before it was taken in: that is no answer.
    pub(super) listened: bool,
    /// Whether it was said that it is on its way.
    pub(super) is_out: bool,
    /// Which request on its line it is.
    number: u32,
    /// Whether its unit may still answer another program.
    is_met: bool,
    /// How many bytes came of an answer that began, and did not end.
    begun: usize,
    /// What was seen beside its answer.
    tally: Tally,
}

impl Flight<'_> {
    /// Whether nothing was begun on its line since.
    pub(super) fn is_begun_last<const U: usize, const P: usize>(&self, known: &Known<U, P>) -> bool {
        self.number == known.begun
    }

    /// It is waited for no longer.
    pub(super) fn give_up<const U: usize, const P: usize>(&self, now: Instant, known: &mut Known<U, P>) {
        if self.is_begun_last(known) {
            known.master.abort(now);
        }
    }
}

impl<'r> Conversation<'r> {
    /// `ask` goes on the wire.
    pub(super) fn send<const U: usize, const P: usize>(
        &mut self,
        now: Instant,
        known: &mut Known<U, P>,
        ask: Ask<'r>,
        purpose: Purpose<'r>,
    ) {
        let unit = ask.destination.unit();
        let is_met = ask.in_doubt && unit.is_some_and(|unit| known.master.first_contact_ends(now, unit).is_some());
        if let (true, Some(unit)) = (is_met, unit) {
            known.units.of(unit).met.asked(&ask.request);
        }
        let timeout = match (unit, ask.request, self.learned) {
            (Some(_), Request::Read { .. }, Some(learned)) => {
                ask.timeout.min(learned.saturating_add(known.answer_time(&ask.request)))
            }
            _ => ask.timeout,
        };
        let flight = Flight {
            ask,
            purpose,
            timeout,
            sent: None,
            listened: false,
            is_out: false,
            number: known.begun.wrapping_add(1),
            is_met,
            begun: 0,
            tally: Tally::default(),
        };
        known.master.keep_gap(self.question.gap);
        let begin = if ask.in_doubt { Master::begin_in_doubt } else { Master::begin };
        match begin(&mut known.master, now, ask.destination, &ask.request, timeout) {
            Ok(()) => {
                known.begun = flight.number;
                self.state = State::InFlight(flight);
            }
            Err(error) => {
                let slip = self.slip(Unanswered::NotBegun(error), None, now);
                self.over(known, flight, Err(slip));
            }
        }
    }

    /// What has become of the request in flight by `now`.
    pub(super) fn poll<const U: usize, const P: usize>(&mut self, now: Instant, known: &mut Known<U, P>) -> Polled {
        let question = self.ask().request;
        let asked = match question {
            Request::Read { count, .. } => count,
            _ => u16::MAX,
        };
        let State::InFlight(flight) = &mut self.state else { return Polled::Over };
        if !flight.is_begun_last(known) {
            let slip = Slip { why: Unanswered::Misused, sent: flight.sent, ended: now };
            let flight = *flight;
            self.came.clear();
            self.over(known, flight, Err(slip));
            return Polled::Over;
        }
        // What is queued already is no answer, and the line was not silent while it came. Who waits for the silence finds it at
        // once; where it was silent for long enough, it is looked for without waiting.
        if !flight.listened {
            return Polled::Listen(known.master.deadline().unwrap_or(now));
        }
        let (unit, expected) = (flight.ask.destination.unit(), flight.ask.request.expected());
        let (timeout, sent) = (flight.timeout, flight.sent);
        let why = match known.master.poll(now) {
            Some(Event::Transmit(_)) => {
                flight.sent = Some(now);
                return Polled::Send;
            }
            None => {
                if let Some(until) = known.master.deadline() {
                    return Polled::Listen(until);
                }
                // It was handed out, and nobody said that it is on its way; or somebody else used the line.
                known.master.abort(now);
                self.came.clear();
                Some(Unanswered::Misused)
            }
            Some(Event::Answer(answer @ Answer::Exception { function, code, .. })) => {
                // An exception is known by its two bytes: the frame that came is the one that is made here.
                match unit {
                    Some(unit) => self.came.set(Adu::answer(unit, &answer).as_bytes()),
                    None => self.came.clear(),
                }
                Some(match code {
                    ExceptionCode::GATEWAY_TARGET_SILENT => Unanswered::Unreached,
                    _ => Unanswered::Refused { function, code },
                })
            }
            Some(Event::Answer(answer)) => {
                if let (Purpose::Last { .. }, Answer::Read { words, .. }) = (flight.purpose, &answer) {
                    self.answer.goes_on_with(question.expected(), *words);
                } else if flight.purpose.keeps_the_answer() {
                    self.answer.set(expected, &answer, asked);
                }
                None
            }
            Some(Event::BroadcastDone) => None,
            Some(Event::Wrong { error, frame }) => {
                self.came.set(frame);
                Some(if error == AnswerError::Others { Unanswered::OthersAsk } else { Unanswered::Wrong(error) })
            }
            Some(Event::Corrupt { error, bytes }) => {
                self.came.set(bytes);
                Some(Unanswered::Corrupt(error))
            }
            Some(Event::NoAnswer { bytes }) => {
                flight.begun = bytes.len();
                self.came.set(known.master.instead());
                Some(Unanswered::NoAnswer { timeout, attempts: 1 })
            }
            Some(Event::Busy) => {
                self.came.clear();
                Some(Unanswered::Busy { timeout })
            }
        };
        let flight = *flight;
        let result = match (why, sent) {
            (Some(why), _) => Err(Slip { why, sent, ended: now }),
            (None, Some(sent)) => Ok(Times { sent, ended: now }),
            // The master says neither of a request that it did not hand out.
            (None, None) => Err(Slip { why: Unanswered::Misused, sent, ended: now }),
        };
        self.over(known, flight, result);
        Polled::Over
    }

    /// `flight` has come to `result`.
    pub(super) fn over<const U: usize, const P: usize>(
        &mut self,
        known: &mut Known<U, P>,
        mut flight: Flight<'r>,
        result: Result<Times, Slip>,
    ) {
        flight.tally = known.master.take_tally();
        self.state = State::Over(flight, result);
    }

    /// What the request came to, for who keeps figures.
    pub(super) fn exchange(&self, flight: &Flight<'r>, result: &Result<Times, Slip>) -> Exchange<'r> {
        let (sent, ended, failure, bytes) = match result {
            Ok(times) => (Some(times.sent), times.ended, None, 0),
            Err(slip) => (slip.sent, slip.ended, Some(slip.why), self.came.as_slice().len()),
        };
        let Ask { destination, request, .. } = flight.ask;
        let (timeout, tally) = (flight.timeout, flight.tally);
        Exchange { destination, request, timeout, sent, ended, failure, bytes, tally }
    }

    /// Keeps what `flight` has taught.
    pub(super) fn learn<const U: usize, const P: usize>(
        &self,
        known: &mut Known<U, P>,
        flight: &Flight<'r>,
        result: &Result<Times, Slip>,
    ) {
        let (ask, unit) = (&flight.ask, flight.ask.destination.unit());
        let (failure, ended, sent) = match result {
            Ok(times) => (None, times.ended, true),
            Err(slip) => (Some(slip.why), slip.ended, slip.sent.is_some()),
        };
        known.learn(ask, failure, flight.begun, flight.tally);
        let Some(unit) = unit else { return };
        let refused = failure.is_some_and(Unanswered::is_refused);
        let others = known.others;
        let record = known.units.of(unit);
        if others {
            record.watched.asked(ended, &ask.request, flight.timeout, refused);
        }
        if flight.is_met && (failure.is_none() || refused) {
            record.met.answered();
        }
        match failure.map(|failure| failure.means(&self.question.meanings)) {
            None => record.probing.answered(&ask.request, false),
            Some(Some(Meaning::AskAgain)) => record.probing.was_busy(&ask.request),
            Some(Some(_)) => record.probing.answered(&ask.request, true),
            Some(None) => {}
        }
        record.asked = record.asked.wrapping_add(u32::from(sent));
    }
}
