//! The search: what can happen next in each state, and what must hold in all of them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Instant as Clock;

use drivebus_rtu::{Event, Instant};
use stateright::{Checker, HasDiscoveries, Model, Property};

use crate::ends;
use crate::frames::{Coming, Content, Kind};
use crate::judge::{Source, Step};
use crate::program::Question;
use crate::scenario::{Budget, Damage, Scenario, Sight};
use crate::trace;
use crate::world::{State, TICK, Told, Wrong, address};

/// What becomes of a request on its way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Heard {
    /// The unit takes it and answers it, if it answers such a thing.
    Answered,
    /// The unit refuses it.
    Refused,
    /// The unit does not hear it.
    Lost,
    /// The unit takes it, and the port is lost while it goes out.
    Broken,
    /// As `Answered`; the adapter sends it back damaged.
    BackDamaged,
}

/// How an answer arrives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum How {
    /// As it was sent.
    Whole,
    /// Twice, at once.
    Twice,
    /// With a wrong bit.
    Damaged,
    /// Without its end.
    Cut,
}

/// What happens next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// The program asks something.
    Ask(usize, Kind, Heard),
    /// It asks the same once more.
    Repeat(Heard),
    /// Of what comes from a unit, the answer at this place arrives.
    Arrive(usize, usize, How),
    /// The time-out is over.
    TimeOut,
    /// Half of it is.
    Linger,
    /// The program gives up what it asked.
    Abort,
    /// Nothing is asked until this moment.
    Wait(Instant),
    /// The port is opened again, after another program asked for these answers.
    Open(&'static [Content]),
    /// A unit forgets what it was asked.
    Restart(usize),
    /// The registers change.
    Change,
}

/// The model of one line.
#[derive(Debug, Clone)]
pub struct Search {
    scenario: Scenario,
    budget: Budget,
    seen: Arc<AtomicU32>,
    /// Whether something was found wrong: what is found after it, in the same go, is no shorter.
    found: Arc<AtomicBool>,
}

/// What a search has shown.
#[derive(Debug)]
pub struct Finding {
    /// Distinct states.
    pub states: usize,
    /// Steps, those to known states included.
    pub steps: usize,
    /// Steps of the longest run.
    pub depth: usize,
    /// How long it took.
    pub seconds: f64,
    /// What does not hold, and the shortest run that shows it.
    pub refuted: Option<(&'static str, String)>,
    /// What should have been seen.
    pub unseen: Vec<Sight>,
}

/// In which order the search goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// What is found first is shortest.
    Shortest,
    /// Needs less memory.
    Deepest,
}

const ATTRIBUTED: &str = "no answer is attributed to a request it was not sent for";
const DONE: &str = "no write is reported that did not happen";
const ONCE: &str = "nothing that moves is sent twice";
const ENDED: &str = "each doubt ends within its stated time";

impl Search {
    /// A search of `scenario` as far as `budget` goes.
    pub fn new(scenario: &Scenario, budget: Budget) -> Self {
        Self { scenario: scenario.clone(), budget, seen: Arc::default(), found: Arc::default() }
    }

    /// Goes through every state.
    pub fn run(self, order: Order, threads: usize) -> Finding {
        let (model, seen, began) = (self.clone(), Arc::clone(&self.seen), Clock::now());
        let checker = self.checker().threads(threads).finish_when(HasDiscoveries::AnyFailures);
        match order {
            Order::Shortest => finding(&model, &seen, began, &checker.spawn_bfs().join()),
            Order::Deepest => finding(&model, &seen, began, &checker.spawn_dfs().join()),
        }
    }

    /// Sends `kind`, which `sure` or its call permits.
    fn send(
        &self,
        step: &mut Step<'_>,
        state: &mut State,
        unit: usize,
        kind: Kind,
        in_doubt: bool,
        heard: Heard,
    ) -> Option<()> {
        let (now, to, timeout) = (state.now, address(unit), self.scenario.timeout);
        let request = kind.request();
        let begun = if in_doubt {
            state.master.begin_in_doubt(now, to.into(), &request, timeout)
        } else {
            state.master.begin(now, to.into(), &request, timeout)
        };
        begun.ok()?;
        let frame = match state.master.poll(now) {
            Some(Event::Transmit(frame)) => frame.to_vec(),
            _ => return None,
        };
        state.told.sent = Some(state.requests);
        if heard != Heard::Lost {
            state.hear(unit, kind, heard == Heard::Refused);
        }
        if heard == Heard::Broken {
            state.master.abort(now);
            state.give_up_what_is_asked(&self.scenario);
            if State::is_sent_back(&self.scenario) {
                state.receive(step, &frame, Source::Adapter);
            }
            return Some(());
        }
        state.master.sent(now);
        if State::is_sent_back(&self.scenario) {
            let frame = if heard == Heard::BackDamaged { damaged(&frame) } else { frame };
            state.receive(step, &frame, Source::Adapter);
        } else {
            state.receive(step, &[], Source::Nowhere);
        }
        Some(())
    }

    fn asks(&self, state: &State, actions: &mut Vec<Action>) {
        let ways = |kind: Kind| {
            let (left, sent_back) = (state.left, State::is_sent_back(&self.scenario));
            [
                (Heard::Answered, true),
                (Heard::Refused, left.refusals > 0 && !matches!(kind, Kind::Echo(_) | Kind::Look)),
                // What is read and lost is as good as never answered.
                (Heard::Lost, kind.is_write()),
                (Heard::Broken, left.faults > 0),
                (Heard::BackDamaged, left.faults > 0 && sent_back),
            ]
            .into_iter()
            .filter_map(|(heard, may)| may.then_some(heard))
        };
        for unit in 0..state.units.len() {
            for kind in self.scenario.kinds.iter().copied().chain([Kind::Look]) {
                if state.program.may_ask(state, unit, kind).is_some() {
                    actions.extend(ways(kind).map(|heard| Action::Ask(unit, kind, heard)));
                }
            }
        }
        if let (Some(call), Some(_)) = (state.program.call(), state.program.may_repeat()) {
            actions.extend(ways(call.kind).map(Action::Repeat));
        }
    }

    /// Whether a property that `holds` or not is to be reported as holding: only the first that does not is reported.
    fn holds(&self, holds: bool) -> bool {
        holds || self.found.swap(true, Ordering::Relaxed)
    }

    /// Whether no answer before `place` is the same in all that matters: where answers overtake, either may be the one.
    fn is_first_of_its_kind(&self, state: &State, answers: &[Coming], place: usize) -> bool {
        let alike = |earlier: &Coming| state.signature(earlier) == state.signature(&answers[place]);
        !self.scenario.overtaking || !answers[..place].iter().any(alike)
    }

    fn step(&self, step: &mut Step<'_>, state: &mut State, action: Action) -> Option<()> {
        match action {
            Action::Ask(unit, kind, heard) => {
                let put = state.program.may_ask(state, unit, kind)?;
                let kind = if let Kind::Echo(_) = kind { Kind::Echo(state.fresh_word()) } else { kind };
                state.spend(heard);
                state.program = state.program.asked(state, unit, kind, put, self.scenario.timeout);
                self.send(step, state, unit, kind, put == Question::InDoubt, heard)?;
            }
            Action::Repeat(heard) => {
                let in_doubt = state.program.may_repeat()?;
                let (unit, kind) = state.program.call().map(|call| (call.unit, call.kind))?;
                state.spend(heard);
                state.program = state.program.asked_again(state, self.scenario.timeout);
                self.send(step, state, unit, kind, in_doubt, heard)?;
            }
            Action::Arrive(unit, place, how) => {
                let was_doubted =
                    state.units[unit].echoed && state.is_doubted(unit) && state.program.in_flight().is_none();
                let came = state.arrives(unit, place);
                state.told.came = Some(came);
                let frame = came.content.adu(address(unit)).as_bytes().to_vec();
                state.left.faults -= u8::from(how != How::Whole);
                match how {
                    How::Whole => state.receive(step, &frame, Source::Unit(came)),
                    How::Twice => state.receive(step, &frame.repeat(2), Source::Unit(came)),
                    How::Damaged => {
                        state.receive(step, &damaged(&frame), Source::Nowhere);
                        if self.scenario.damage == Damage::Again {
                            state.units[unit].coming.push(Coming { damaged: Some(state.now), ..came });
                        }
                    }
                    How::Cut => state.receive(step, &frame[..frame.len() - 2], Source::Nowhere),
                }
                step.sights.extend((was_doubted && !state.is_doubted(unit)).then_some(Sight::EndedBySight));
            }
            Action::TimeOut => {
                let due = state.program.call()?.due;
                state.wait(&self.scenario, due);
                state.receive(step, &[], Source::Nowhere);
            }
            Action::Linger => {
                state.left.lingers -= 1;
                state.wait(&self.scenario, state.now + TICK);
                state.receive(step, &[], Source::Nowhere);
            }
            Action::Abort => {
                state.left.aborts -= 1;
                state.master.abort(state.now);
                state.give_up_what_is_asked(&self.scenario);
            }
            Action::Wait(until) => {
                let doubted: Vec<_> = (0..state.units.len()).map(|unit| state.is_doubted(unit)).collect();
                state.program.forget_call();
                state.wait(&self.scenario, until);
                let ended = |(unit, before): (usize, bool)| before && !state.is_doubted(unit);
                if doubted.into_iter().enumerate().any(ended) {
                    step.sights.push(Sight::EndedByTime);
                }
            }
            Action::Open(strangers) => {
                state.left.openings -= 1;
                state.open(&self.scenario, strangers);
            }
            Action::Restart(unit) => {
                state.left.restarts -= 1;
                state.units[unit].coming.clear();
                state.units[unit].echoing = self.scenario.replaced_by.unwrap_or(state.units[unit].echoing);
            }
            Action::Change => {
                state.left.changes -= 1;
                state.changed = !state.changed;
            }
        }
        Some(())
    }
}

impl State {
    /// Counts one more request, which fares as `heard` says.
    fn spend(&mut self, heard: Heard) {
        self.requests += 1;
        self.left.requests -= 1;
        self.left.faults -= u8::from(matches!(heard, Heard::Broken | Heard::BackDamaged));
        self.left.refusals -= u8::from(heard == Heard::Refused);
    }
}

impl Model for Search {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        let strangers: &[&[_]] = if self.scenario.strangers.is_empty() { &[&[]] } else { self.scenario.strangers };
        strangers.iter().map(|strangers| State::new(&self.scenario, self.budget, strangers)).collect()
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        if state.wrong.is_some() {
            return;
        }
        let in_flight = state.program.in_flight().is_some();
        let faulty = state.left.faults > 0;
        for (unit, answers) in state.units.iter().map(|unit| &unit.coming).enumerate() {
            for place in (0..answers.len()).filter(|&place| self.is_first_of_its_kind(state, answers, place)) {
                actions.push(Action::Arrive(unit, place, How::Whole));
                if faulty {
                    actions.push(Action::Arrive(unit, place, How::Twice));
                }
                if faulty && in_flight && answers[place].damaged.is_none() {
                    actions.push(Action::Arrive(unit, place, How::Damaged));
                    actions.push(Action::Arrive(unit, place, How::Cut));
                }
            }
            if state.left.restarts > 0 && (!answers.is_empty() || self.scenario.replaced_by.is_some()) {
                actions.push(Action::Restart(unit));
            }
        }
        if state.left.openings > 0 {
            actions.extend(self.scenario.strangers.iter().map(|strangers| Action::Open(strangers)));
        }
        if state.left.changes > 0 {
            actions.push(Action::Change);
        }
        if let Some(due) = state.program.call().filter(|_| in_flight).map(|call| call.due) {
            actions.push(Action::TimeOut);
            if state.left.lingers > 0 && state.now + TICK < due {
                actions.push(Action::Linger);
            }
            if state.left.aborts > 0 {
                actions.push(Action::Abort);
            }
            return;
        }
        if state.left.requests > 0 {
            self.asks(state, actions);
            // The look after a stop follows at once, in the same turn.
            if let Some(end) = state.next_end(&self.scenario).filter(|_| !state.program.must_look()) {
                actions.push(Action::Wait(end));
                let before = Instant::from_nanos(end.as_nanos() - u64::try_from(TICK.as_nanos()).unwrap_or_default());
                if before > state.now {
                    actions.push(Action::Wait(before));
                }
            }
        }
    }

    fn next_state(&self, last: &State, action: Action) -> Option<State> {
        let mut state = State { told: Told::default(), ..last.clone() };
        let mut step = Step { scenario: &self.scenario, sights: Vec::new() };
        self.step(&mut step, &mut state, action)?;
        let seen = step.sights.iter().fold(0, |bits, sight| bits | 1 << *sight as u8);
        self.seen.fetch_or(seen, Ordering::Relaxed);
        Some(state)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![
            Property::always(ATTRIBUTED, |model: &Self, state: &State| {
                model.holds(state.wrong != Some(Wrong::Misattributed))
            }),
            Property::always(DONE, |model: &Self, state: &State| model.holds(state.wrong != Some(Wrong::NotDone))),
            Property::always(ONCE, |model: &Self, state: &State| model.holds(state.wrong != Some(Wrong::SentTwice))),
            Property::always(ENDED, |model: &Self, state: &State| {
                model.holds(state.wrong != Some(Wrong::Unended) && ends::overdue(state).is_none())
            }),
        ]
    }
}

fn finding(model: &Search, seen: &AtomicU32, began: Clock, checker: &impl Checker<Search>) -> Finding {
    let seconds = began.elapsed().as_secs_f64();
    let seen = seen.load(Ordering::Relaxed);
    let unseen = model.scenario.sights.iter().copied().filter(|&sight| seen >> sight as u8 & 1 == 0).collect();
    let refuted = checker.discoveries().into_iter().min_by_key(|(_, path)| path.clone().into_actions().len());
    Finding {
        states: checker.unique_state_count(),
        steps: checker.state_count(),
        depth: checker.max_depth(),
        seconds,
        refuted: refuted.map(|(name, path)| (name, trace::told(&model.scenario, name, path.into_vec()))),
        unseen,
    }
}

/// `frame` with a wrong bit in what it says.
fn damaged(frame: &[u8]) -> Vec<u8> {
    let mut bytes = frame.to_vec();
    let place = bytes.len() - 3;
    bytes[place] ^= 0x40;
    bytes
}
