//! The search: what can happen next in each state, and what must hold in all of them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Instant as Clock;

use drivebus_rtu::{Cut, Instant};
use stateright::{Checker, HasDiscoveries, Model, Property};

use crate::ends;
use crate::frames::{Coming, Content, Kind};
use crate::judge::{Source, Step};
use crate::program::{Call, Standing};
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
    /// The unit answers a read with so many words, and not as many as were asked for.
    OtherLength(u16),
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
    /// The program calls.
    Ask(usize, Kind),
    /// What its call is about to send goes out.
    Send(Heard),
    /// Of what comes from a unit, the answer at this place arrives.
    Arrive(usize, usize, How),
    /// The time-out is over.
    TimeOut,
    /// Half of it is.
    Linger,
    /// The program gives up what it asked.
    Abort,
    /// The same, between two requests.
    Quit,
    /// Nothing is sent until this moment.
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
    pub(crate) scenario: Scenario,
    pub(crate) budget: Budget,
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

    /// What the call is about to send goes out, and fares as `heard` says.
    fn send(&self, step: &mut Step<'_>, state: &mut State, heard: Heard) -> Option<()> {
        let now = state.now;
        state.spend(heard);
        let frame = state.hand_out()?;
        let (unit, flight) = state.program.call.as_ref().map(|call| call.unit).zip(state.program.in_flight())?;
        if heard == Heard::Refused && matches!(flight.kind, Kind::Echo(_)) {
            return None;
        }
        // What is read and lost is as good as never answered.
        if heard == Heard::Lost && !flight.kind.is_write() {
            return None;
        }
        if let Some(call) = state.program.call.as_mut().filter(|_| flight.kind == Kind::Set) {
            call.truth.hidden = false;
        }
        if heard != Heard::Lost {
            state.hear(&self.scenario, unit, (flight.kind, flight.place), heard == Heard::Refused);
        }
        if let Heard::OtherLength(count) = heard {
            state.has_other_length(unit, count)?;
        }
        state.look_at_registers();
        let State { program, known, .. } = state;
        let call = program.call.as_mut()?;
        if heard == Heard::Broken {
            call.conversation.cut_short(now, known, Cut::Lost);
            if State::is_sent_back(&self.scenario) {
                known.stray(now, &frame);
            }
            state.open(&self.scenario, &[]);
            state.go_on(step, Source::Nowhere);
            return Some(());
        }
        call.conversation.sent(known, now).ok()?;
        if State::is_sent_back(&self.scenario) {
            let frame = if heard == Heard::BackDamaged { damaged(&frame) } else { frame };
            state.take_in(step, &frame, Source::Adapter);
        } else {
            state.go_on(step, Source::Nowhere);
        }
        Some(())
    }

    /// How what is about to be sent may fare.
    fn sends(&self, state: &State, actions: &mut Vec<Action>) {
        let left = state.left;
        if left.requests == 0 {
            return;
        }
        actions.extend([Action::Send(Heard::Answered), Action::Send(Heard::Lost)]);
        if left.refusals > 0 {
            actions.push(Action::Send(Heard::Refused));
        }
        if left.lengths > 0 {
            // As many as the program asks for, or one more.
            actions.extend((1..=3).map(|count| Action::Send(Heard::OtherLength(count))));
        }
        if left.faults > 0 {
            actions.push(Action::Send(Heard::Broken));
            if State::is_sent_back(&self.scenario) {
                actions.push(Action::Send(Heard::BackDamaged));
            }
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

    pub(crate) fn step(&self, step: &mut Step<'_>, state: &mut State, action: Action) -> Option<()> {
        match action {
            Action::Ask(unit, kind) => state.ask(step, unit, kind),
            Action::Send(heard) => self.send(step, state, heard)?,
            Action::Arrive(unit, place, how) => {
                let was_doubted =
                    state.units[unit].echoed && state.is_doubted(unit) && state.program.in_flight().is_none();
                let came = state.arrives(unit, place);
                state.told.came = Some(came);
                let frame = came.content.adu(address(unit)).as_bytes().to_vec();
                state.left.faults -= u8::from(how != How::Whole);
                match how {
                    How::Whole => state.take_in(step, &frame, Source::Unit(came)),
                    How::Twice => state.take_in(step, &frame.repeat(2), Source::Unit(came)),
                    How::Damaged => {
                        state.take_in(step, &damaged(&frame), Source::Nowhere);
                        if self.scenario.damage == Damage::Again {
                            state.units[unit].coming.push(Coming { damaged: Some(state.now), ..came });
                        }
                    }
                    How::Cut => state.take_in(step, &frame[..frame.len() - 2], Source::Nowhere),
                }
                step.sights.extend((was_doubted && !state.is_doubted(unit)).then_some(Sight::EndedBySight));
            }
            Action::TimeOut => {
                let due = state.program.call.as_ref().and_then(listens_until)?;
                state.wait(&self.scenario, due);
                state.take_in(step, &[], Source::Nowhere);
            }
            Action::Linger => {
                state.left.lingers -= 1;
                state.wait(&self.scenario, state.now + TICK);
                state.take_in(step, &[], Source::Nowhere);
            }
            Action::Abort | Action::Quit => {
                let left = if action == Action::Quit { &mut state.left.quits } else { &mut state.left.aborts };
                *left -= 1;
                let State { program, known, now, .. } = &mut *state;
                program.call.as_mut()?.conversation.cut_short(*now, known, Cut::GivenUp);
                state.go_on(step, Source::Nowhere);
            }
            Action::Wait(until) => {
                let doubted: Vec<_> = (0..state.units.len()).map(|unit| state.is_doubted(unit)).collect();
                state.wait(&self.scenario, until);
                let ended = |(unit, before): (usize, bool)| before && !state.is_doubted(unit);
                if doubted.into_iter().enumerate().any(ended) {
                    step.sights.push(Sight::EndedByTime);
                }
                if state.program.call.as_ref().and_then(stands_by_until).is_some_and(|until| state.now >= until) {
                    state.go_on(step, Source::Nowhere);
                }
            }
            Action::Open(strangers) => {
                state.left.openings -= 1;
                state.open(&self.scenario, strangers);
                state.go_on(step, Source::Nowhere);
            }
            Action::Restart(unit) => {
                state.left.restarts -= 1;
                state.units[unit].coming.clear();
                state.units[unit].echoing = self.scenario.replaced_by.unwrap_or(state.units[unit].echoing);
            }
            Action::Change => {
                state.left.changes -= 1;
                state.changed = !state.changed;
                state.look_at_registers();
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
        self.left.lengths -= u8::from(matches!(heard, Heard::OtherLength(_)));
    }
}

impl Model for Search {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        let strangers: &[&[_]] = if self.scenario.strangers.is_empty() { &[&[]] } else { self.scenario.strangers };
        let states = strangers.iter().map(|strangers| State::new(&self.scenario, self.budget, strangers));
        states
            .flat_map(|state| self.scenario.before.iter().filter_map(move |before| self.after(before, state.clone())))
            .collect()
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        if state.wrong.is_some() {
            return;
        }
        let call = state.program.call.as_ref();
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
        // What is about to be sent may as well be decided on afterwards.
        if state.left.openings > 0 && !state.program.is_sending() {
            actions.extend(self.scenario.strangers.iter().map(|strangers| Action::Open(strangers)));
        }
        if state.left.changes > 0 {
            actions.push(Action::Change);
        }
        let may_abort = state.left.aborts > 0;
        let may_quit = state.left.quits > 0 && call.is_some_and(|call| call.first <= state.requests);
        match call.map(|call| call.standing) {
            Some(Standing::Sending) => {
                self.sends(state, actions);
                actions.extend(may_abort.then_some(Action::Abort));
                actions.extend(may_quit.then_some(Action::Quit));
            }
            Some(Standing::Listening(due)) => {
                actions.push(Action::TimeOut);
                if state.left.lingers > 0 && state.now + TICK < due {
                    actions.push(Action::Linger);
                }
                actions.extend(may_abort.then_some(Action::Abort));
            }
            Some(Standing::Aside(until)) => {
                let end = state.next_end(&self.scenario).map_or(until, |end| end.min(until));
                actions.push(Action::Wait(end));
                actions.extend(may_abort.then_some(Action::Abort));
                actions.extend(may_quit.then_some(Action::Quit));
            }
            None if state.left.requests > 0 => {
                for unit in 0..state.units.len() {
                    actions.extend(self.scenario.kinds.iter().map(|&kind| Action::Ask(unit, kind)));
                }
                if let Some(end) = state.next_end(&self.scenario) {
                    actions.push(Action::Wait(end));
                    let tick = u64::try_from(TICK.as_nanos()).unwrap_or_default();
                    let before = Instant::from_nanos(end.as_nanos() - tick);
                    if before > state.now {
                        actions.push(Action::Wait(before));
                    }
                }
            }
            None => {}
        }
    }

    fn next_state(&self, last: &State, action: Action) -> Option<State> {
        let mut state = State { told: Told::default(), ..last.clone() };
        let doubted = state.program.call.as_ref().is_some_and(|call| state.is_doubted(call.unit));
        let mut step = Step { scenario: &self.scenario, sights: Vec::new(), doubted };
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
            Property::always(DONE, |model: &Self, state: &State| {
                model.holds(!matches!(state.wrong, Some(Wrong::NotDone | Wrong::Denied)))
            }),
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

fn listens_until(call: &Call) -> Option<Instant> {
    if let Standing::Listening(until) = call.standing { Some(until) } else { None }
}

fn stands_by_until(call: &Call) -> Option<Instant> {
    if let Standing::Aside(until) = call.standing { Some(until) } else { None }
}

/// `frame` with a wrong bit in what it says.
fn damaged(frame: &[u8]) -> Vec<u8> {
    let mut bytes = frame.to_vec();
    let place = bytes.len() - 3;
    bytes[place] ^= 0x40;
    bytes
}
