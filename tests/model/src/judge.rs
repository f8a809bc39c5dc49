//! What the program makes of the end of a request, and whether it is true.

use drivebus_rtu::{AnswerError, Event, Instant};

use crate::frames::{Coming, Content, Kind};
use crate::program::{Call, Knowledge, Standing};
use crate::scenario::{Adapter, PATIENCE, Scenario, Sight};
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

/// How a request ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ended {
    /// With an answer.
    Answered {
        /// Whether the unit refused.
        refused: bool,
        /// Whether it came often enough.
        agreed: bool,
    },
    /// Without one.
    Unanswered {
        /// Whether no byte came.
        silent: bool,
        /// Whether a refusal came that may be meant for another.
        refused: bool,
    },
}

/// A step under way, and what was seen in it.
#[derive(Debug)]
pub struct Step<'a> {
    /// On which line.
    pub scenario: &'a Scenario,
    /// What was seen.
    pub sights: Vec<Sight>,
}

impl State {
    /// `bytes` arrive from `source`; none, where only time has passed.
    pub(crate) fn receive(&mut self, step: &mut Step<'_>, bytes: &[u8], source: Source) {
        let doubted = self.program.call().is_some_and(|call| self.is_doubted(call.unit));
        self.master.receive(self.now, bytes);
        let ended = match self.master.poll(self.now) {
            None => return self.note(step),
            Some(Event::Answer(answer)) => {
                let refused = matches!(answer, drivebus_rtu::Answer::Exception { .. });
                Ended::Answered { refused, agreed: self.program.hears(&answer) }
            }
            Some(Event::NoAnswer { bytes }) => Ended::Unanswered { silent: bytes.is_empty(), refused: false },
            Some(Event::Transmit(_)) => {
                self.wrong = Some(Wrong::SentTwice);
                return;
            }
            Some(Event::Wrong { error: AnswerError::Refusal { .. }, .. }) => {
                Ended::Unanswered { silent: false, refused: true }
            }
            Some(_) => Ended::Unanswered { silent: false, refused: false },
        };
        if let Standing::InFlight(call) = std::mem::replace(&mut self.program.standing, Standing::Free) {
            self.ended(call.latest);
            self.learn(step, &call, ended);
            self.conclude(step, call, ended, source, doubted);
        }
    }

    /// Counts what was seen while nothing ended.
    fn note(&mut self, step: &mut Step<'_>) {
        // What the adapter sent back is asked for when the request ends.
        if step.scenario.adapter == Adapter::Known && self.master.take_tally().late > 0 {
            step.sights.push(Sight::Late);
            self.told.outcome = Some("known to be late");
        }
    }

    /// What `call` has shown of the adapter (`Owner::learn` in `crates/line/src/owner/echo.rs`).
    fn learn(&mut self, step: &mut Step<'_>, call: &Call, ended: Ended) {
        let tally = self.master.take_tally();
        if tally.late > 0 {
            step.sights.push(Sight::Late);
        }
        if step.scenario.adapter == Adapter::Known {
            return;
        }
        if tally.own_echo > 0 {
            self.program.knowledge = Knowledge::Present;
            self.master.strip_echo(true);
            step.sights.push(Sight::AdapterFound);
            return;
        }
        let request = call.kind.request();
        if self.program.knowledge == Knowledge::Absent || request.expected().may_repeat_request() {
            return;
        }
        let few = usize::try_from(tally.noise).is_ok_and(|noise| 4 * noise <= request.adu_len());
        let clean = few && !matches!(ended, Ended::Unanswered { silent: false, .. });
        match self.program.knowledge {
            Knowledge::Auto if clean => self.program.knowledge = Knowledge::Absent,
            Knowledge::Present if clean && matches!(ended, Ended::Answered { refused: false, .. }) => {
                self.program.knowledge = Knowledge::Auto;
                self.master.strip_echo(false);
            }
            _ => {}
        }
    }

    fn conclude(&mut self, step: &mut Step<'_>, call: Call, ended: Ended, source: Source, doubted: bool) {
        let Ended::Answered { refused, agreed } = ended else {
            let is_refusal = matches!(ended, Ended::Unanswered { refused: true, .. });
            self.told.outcome = Some(if is_refusal { "it may refuse another: left open" } else { "left open" });
            self.left_open(call.unit, call.kind);
            if let Some(truth) = call.stop_before {
                self.confirm_stop(step, &call, truth);
            } else if call.kind.is_read() && call.is_immediate && !(is_refusal && call.apart) {
                self.program.standing = Standing::LeftOpen(call);
            }
            return;
        };
        let came = match source {
            Source::Unit(came) => Some(came),
            Source::Adapter | Source::Nowhere => None,
        };
        // If it was an earlier one's, its own is owed from now on.
        let unit = &mut self.units[call.unit];
        unit.touched = unit.touched.map(|_| self.now);
        match call.kind {
            Kind::Read(_) => self.read_was_answered(step, call, came, refused, agreed, doubted),
            Kind::Run => {
                self.told.outcome = Some("taken for the answer");
                if came.is_none_or(|came| !came.is_since(call.first)) {
                    self.wrong = Some(Wrong::NotDone);
                }
                step.sights.push(if refused { Sight::Refused } else { Sight::Commanded });
            }
            Kind::Stop => {
                // The answer may be that to a stop before, but of the same kind, and not to something else.
                let own = if refused { Content::Refused(Kind::Stop) } else { Content::Done(Kind::Stop) };
                let own = came.is_some_and(|came| came.content == own);
                let truth = if own { Ok(()) } else { Err(Wrong::NotDone) };
                self.told.outcome = Some("taken for the answer");
                if self.program.knowledge == Knowledge::Auto && !refused {
                    self.told.outcome = Some("taken for the answer, unless the adapter sent it");
                    self.program.standing = Standing::MustLook(call, truth);
                } else {
                    self.wrong = truth.err();
                    step.sights.push(if refused { Sight::Refused } else { Sight::Stopped });
                }
            }
            Kind::Echo(word) => self.echo_was_answered(step, &call, word, came, refused, doubted),
            Kind::Look => {
                self.told.outcome = Some("it tells of the adapter");
                if let Some(truth) = call.stop_before {
                    self.confirm_stop(step, &call, truth);
                }
            }
        }
    }

    fn read_was_answered(
        &mut self,
        step: &mut Step<'_>,
        mut call: Call,
        came: Option<Coming>,
        refused: bool,
        agreed: bool,
        doubted: bool,
    ) {
        let Some(came) = came else {
            self.wrong = Some(Wrong::Misattributed);
            return;
        };
        let own = came.is_since(call.first);
        let before = call.row.filter(|(content, _)| alike(*content, came.content)).is_some_and(|(_, own)| own);
        call.row = Some((came.content, own || before));
        if call.ends_doubt && !refused {
            if self.is_doubted(call.unit) {
                self.wrong = Some(Wrong::Unended);
            } else if doubted {
                step.sights.push(Sight::EndedByRead);
                let unit = &mut self.units[call.unit];
                // Echoes that may still come are counted on.
                unit.silent_echoes = if unit.echo_open.is_some() { unit.silent_echoes } else { 0 };
            }
        }
        if refused && call.apart {
            self.told.outcome = Some("a refusal, which is not believed");
        } else if agreed {
            self.told.outcome = Some("taken for the answer");
            if !(own || before) {
                self.wrong = Some(Wrong::Misattributed);
            }
            step.sights.push(match (refused, call.asked) {
                (true, _) => Sight::Refused,
                (false, 1) => Sight::ReadAtOnce,
                (false, _) => Sight::Agreed,
            });
        } else if call.asked < call.agreement.longest() {
            self.told.outcome = Some("heard, and not believed yet");
            self.program.standing = Standing::Hearing(call);
        } else {
            self.told.outcome = Some("heard; the answers do not agree");
        }
    }

    fn echo_was_answered(
        &mut self,
        step: &mut Step<'_>,
        call: &Call,
        word: u16,
        came: Option<Coming>,
        refused: bool,
        doubted: bool,
    ) {
        let after = self.is_doubted(call.unit);
        let in_first_contact = self.opened.is_some();
        if !refused {
            self.told.outcome = Some("the word came back");
            if came.is_none_or(|came| came.content != Content::Echoed(word)) {
                self.wrong = Some(Wrong::Misattributed);
            } else if after {
                self.wrong = Some(Wrong::Unended);
            }
            let unit = &mut self.units[call.unit];
            (unit.echoed, unit.silent_echoes, unit.echo_open) = (true, 0, None);
            step.sights.extend(doubted.then_some(Sight::EndedByEcho));
        } else if in_first_contact || self.units[call.unit].echo_open.is_some_and(|at| self.now < at + PATIENCE) {
            // It may be the refusal of the echo before, or of another program's.
            self.told.outcome = Some("refused, which proves nothing");
            self.left_open(call.unit, call.kind);
        } else {
            self.told.outcome = Some("refused, and with it everything before is answered");
            if after {
                self.wrong = Some(Wrong::Unended);
            }
            step.sights.extend(doubted.then_some(Sight::EndedByRefusal));
        }
    }

    /// The look has shown whether a stop before was confirmed by the adapter (`Owner::unless_echoed`).
    fn confirm_stop(&mut self, step: &mut Step<'_>, look: &Call, truth: Result<(), Wrong>) {
        if self.program.knowledge == Knowledge::Absent {
            self.wrong = truth.err();
            step.sights.push(Sight::Stopped);
        } else {
            self.stop_is_still_owed(step.scenario, look.unit);
        }
    }

    /// Nobody knows whether `unit` confirmed its stop, or the adapter did (`Owner::unless_echoed`).
    pub(crate) fn stop_is_still_owed(&mut self, scenario: &Scenario, unit: usize) {
        self.master.still_owed(self.now, address(unit), &Kind::Stop.request(), scenario.timeout);
        self.left_open(unit, Kind::Stop);
    }

    /// Whether unit `index` is in quarantine.
    pub(crate) fn is_doubted(&self, index: usize) -> bool {
        self.is_doubted_at(self.now, index)
    }

    pub(crate) fn is_doubted_at(&self, at: Instant, index: usize) -> bool {
        self.master.in_quarantine(at, address(index))
    }
}

/// Whether two answers have the same bytes.
fn alike(one: Content, other: Content) -> bool {
    match (one, other) {
        (Content::Refused(one), Content::Refused(other)) => one.request().function() == other.request().function(),
        _ => one == other,
    }
}
