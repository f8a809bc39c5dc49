//! Whether what a call makes of what comes is true.

use drivebus_rtu::{Answer, AnswerError, Exchange, Instant, Outcome, Unanswered};

use crate::frames::{Coming, Content, Kind};
use crate::program::{Call, Flight};
use crate::scenario::{PATIENCE, Scenario, Sight};
use crate::world::{State, Wrong, address};

/// Where what arrives comes from.
#[derive(Debug, Clone, Copy)]
pub enum Source {
    /// A unit.
    Unit(Coming),
    /// The adapter sends our own request back.
    Adapter,
    /// Nothing arrives, or nothing whole.
    Nowhere,
}

/// What a call came to, as its caller hears it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Came {
    /// An answer, with so many words.
    Answer(Option<usize>),
    /// It is done, and that was seen otherwise.
    Shown,
    /// The unit refused.
    Refused,
    /// The unit shows something else than what was written.
    NotTaken,
    /// Nothing that says what the unit did; whether anything went out.
    Nothing { went_out: bool },
}

impl From<Outcome<'_>> for Came {
    fn from(outcome: Outcome<'_>) -> Self {
        match outcome {
            Outcome::Answered { answer: Some(Answer::Read { words, .. }), .. } => {
                Self::Answer(Some(words.iter().count()))
            }
            Outcome::Answered { answer: Some(_), .. } => Self::Answer(None),
            Outcome::Answered { .. } => Self::Shown,
            Outcome::Failed { why: Unanswered::Refused { .. }, .. } => Self::Refused,
            Outcome::Failed { why: Unanswered::NotTaken { .. }, .. } => Self::NotTaken,
            Outcome::Failed { sent, .. } => Self::Nothing { went_out: sent.is_some() },
            _ => Self::Nothing { went_out: true },
        }
    }
}

/// A step under way, and what was seen in it.
#[derive(Debug)]
pub struct Step<'a> {
    /// On which line.
    pub scenario: &'a Scenario,
    /// What was seen.
    pub sights: Vec<Sight>,
    /// Whether the unit that is asked was in doubt when it began.
    pub doubted: bool,
}

impl State {
    /// A request of `call` has come to `exchange`, at which the bytes came from `source`.
    pub(crate) fn request_is_over(
        &mut self,
        step: &mut Step<'_>,
        call: &mut Call,
        exchange: &Exchange<'_>,
        source: Source,
    ) {
        if exchange.tally.late > 0 {
            step.sights.push(Sight::Late);
        }
        // One that could not be begun is nobody's.
        let Some(flight) = call.flight.take() else { return };
        self.ended(flight.number);
        let refused = match exchange.failure {
            None => false,
            Some(Unanswered::Refused { .. }) => true,
            Some(why) => {
                if let Unanswered::Wrong(AnswerError::Count { .. }) = why {
                    step.sights.push(Sight::OtherLength);
                }
                let is_refusal = matches!(why, Unanswered::Wrong(AnswerError::Refusal { .. }));
                self.told.outcome = Some(if is_refusal { "it may refuse another: left open" } else { "left open" });
                self.left_open(call.unit, flight.kind);
                return;
            }
        };
        let came = match source {
            Source::Unit(came) => Some(came),
            Source::Adapter | Source::Nowhere => None,
        };
        // If it was an earlier one's, its own is owed from now on.
        let unit = &mut self.units[call.unit];
        unit.touched = unit.touched.map(|_| self.now);
        self.told.outcome = Some("taken for the answer");
        match flight.kind {
            Kind::Echo(word) => self.echo_was_answered(step, call.unit, word, came, refused),
            Kind::Read(_) | Kind::Watch | Kind::Input => {
                self.read_was_answered(step, call, flight, came, refused);
                // At first contact it may have been another program's, and it counts as owed until that is known.
                if call.kind == Kind::Watch && self.opened.is_some() {
                    self.left_open(call.unit, call.kind);
                }
            }
            kind => {
                let content = if refused { Content::Refused(kind) } else { Content::Done(kind) };
                // The answer to a stop may be that to a stop before, but of the same kind, and not to something else.
                let is_own = |came: &Coming| came.is_since(call.first) || kind == Kind::Stop;
                call.truth.confirmed = Some(came.is_some_and(|came| came.content == content && is_own(&came)));
            }
        }
    }

    fn read_was_answered(
        &mut self,
        step: &mut Step<'_>,
        call: &mut Call,
        flight: Flight,
        came: Option<Coming>,
        refused: bool,
    ) {
        let Some(came) = came else {
            self.wrong = Some(Wrong::Misattributed);
            return;
        };
        // Who refuses more words than were asked for has not refused what was asked.
        let is_asked =
            !refused || matches!(came.content, Content::Refused(kind) if kind.request() == call.kind.request());
        let is_own = is_asked && came.is_since(call.first) && came.place == flight.place && !came.is_other_length;
        // The last words of what was asked in two parts: both have to be its own.
        let is_last_part = flight.place != flight.kind.first_place() && !refused;
        call.truth.row = if is_last_part {
            let is_all_own = is_own && call.truth.row.is_some_and(|(.., own)| own);
            step.sights.push(Sight::InTwo);
            Some((came.content, 1, is_all_own))
        } else {
            let before = call.truth.row.filter(|(content, ..)| alike(*content, came.content));
            let (times, was_own) = before.map_or((0, false), |(_, times, own)| (times, own));
            Some((came.content, times + 1, is_own || was_own))
        };
        if flight.ends_doubt && !refused {
            if self.is_doubted(call.unit) {
                self.wrong = Some(Wrong::Unended);
            } else if step.doubted {
                step.sights.push(Sight::EndedByRead);
                let unit = &mut self.units[call.unit];
                // Echoes that may still come are counted on.
                unit.silent_echoes = if unit.echo_open.is_some() { unit.silent_echoes } else { 0 };
            }
        }
    }

    fn echo_was_answered(&mut self, step: &mut Step<'_>, unit: usize, word: u16, came: Option<Coming>, refused: bool) {
        let after = self.is_doubted(unit);
        if !refused {
            self.told.outcome = Some("the word came back");
            if came.is_none_or(|came| came.content != Content::Echoed(word)) {
                self.wrong = Some(Wrong::Misattributed);
            } else if after {
                self.wrong = Some(Wrong::Unended);
            }
            let unit = &mut self.units[unit];
            (unit.echoed, unit.silent_echoes, unit.echo_open) = (true, 0, None);
            step.sights.extend(step.doubted.then_some(Sight::EndedByEcho));
        } else if self.opened.is_some() || self.units[unit].echo_open.is_some_and(|at| self.now < at + PATIENCE) {
            // It may be the refusal of the echo before, or of another program's.
            self.told.outcome = Some("refused, which proves nothing");
            self.left_open(unit, Kind::Echo(word));
        } else {
            self.told.outcome = Some("refused, and with it everything before is answered");
            if after {
                self.wrong = Some(Wrong::Unended);
            }
            step.sights.extend(step.doubted.then_some(Sight::EndedByRefusal));
        }
    }

    /// `call` is over, and this is what its caller hears.
    pub(crate) fn call_is_over(&mut self, step: &mut Step<'_>, call: &Call, came: Came) {
        let truth = call.truth;
        let confirmed = truth.confirmed == Some(true);
        let wrong = match (call.kind, came) {
            (Kind::Echo(_), Came::Answer(_) | Came::Refused) => None,
            (kind, Came::Answer(words)) if kind.is_read() => {
                let asked = if let Kind::Read(count) = kind { usize::from(count) } else { 1 };
                let is_own = truth.row.is_some_and(|(.., own)| own) && words == Some(asked);
                step.sights.push(match truth.row {
                    Some((_, times, _)) if times > 1 => Sight::Agreed,
                    _ => Sight::ReadAtOnce,
                });
                (!is_own).then_some(Wrong::Misattributed)
            }
            (kind, Came::Refused) if kind.is_read() => {
                step.sights.push(Sight::Refused);
                (!truth.row.is_some_and(|(.., own)| own)).then_some(Wrong::Misattributed)
            }
            (kind, Came::Answer(_)) => {
                step.sights.push(if kind == Kind::Stop { Sight::Stopped } else { Sight::Commanded });
                (!confirmed).then_some(Wrong::NotDone)
            }
            (_, Came::Refused) => {
                step.sights.push(Sight::Refused);
                (!confirmed).then_some(Wrong::NotDone)
            }
            (_, Came::Shown) => {
                step.sights.push(Sight::ReadBack);
                (!truth.shown).then_some(Wrong::NotDone)
            }
            (_, Came::NotTaken) => (!truth.hidden).then_some(Wrong::NotDone),
            (_, Came::Nothing { went_out }) => {
                // Nobody knows whether the unit confirmed it, or the adapter did: it is owed.
                if truth.confirmed.is_some() && went_out {
                    self.left_open(call.unit, call.kind);
                }
                (truth.went_out && !went_out).then_some(Wrong::Denied)
            }
        };
        self.wrong = self.wrong.or(wrong);
        self.told.call = Some(match came {
            Came::Answer(_) => "the call is answered",
            Came::Shown => "the unit shows what was written: the call is done",
            Came::Refused => "the call is refused",
            Came::NotTaken => "the unit shows something else: the call is not done",
            Came::Nothing { .. } => "the call is given up",
        });
    }

    /// Whether unit `index` is in quarantine.
    pub(crate) fn is_doubted(&self, index: usize) -> bool {
        self.is_doubted_at(self.now, index)
    }

    pub(crate) fn is_doubted_at(&self, at: Instant, index: usize) -> bool {
        self.master().in_quarantine(at, address(index))
    }

    /// Keeps what the registers hold, for who judges what a call says of them.
    pub(crate) fn look_at_registers(&mut self) {
        if let Some(call) = &mut self.program.call {
            call.truth.shown |= self.changed;
            call.truth.hidden |= !self.changed;
        }
    }
}

/// Whether two answers have the same bytes.
fn alike(one: Content, other: Content) -> bool {
    match (one, other) {
        (Content::Refused(one), Content::Refused(other)) => one.request().function() == other.request().function(),
        _ => one == other,
    }
}
