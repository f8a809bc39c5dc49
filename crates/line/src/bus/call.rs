//! One call from its place in the queue to its end: its turn, the line, and the waiting. What is asked, and how often, its
//! [`Conversation`] decides.
//!
//! | kind | after silence or a damaged answer |
//! | --- | --- |
//! | a read | asked again, as often as the bus is set to; a damaged answer, which took no time-out, counts half, and so does a refusal by which the unit decides nothing (06H: busy) |
//! | a write whose words can be read back | read back; written again only where the unit shows other words |
//! | any other write, an echo, a custom request | never: the caller is told |
//!
//! What it takes to be sure is bounded too: a call sends eight requests at most for each time that it may ask, the questions,
//! the probes, and what is asked again included.

use std::time::Duration;

use drivebus_rtu::{Answer, Conversation, Instant, Question, UnitAddress, Urgency};

use crate::ask::{Ask, Done};
use crate::bus::errand::Errand;
use crate::bus::port::Port;
use crate::error::{CallError, Failure};
use crate::options::CallOptions;
use crate::owner::Owner;
use crate::owner::exchange::{Talk, Then};
use crate::system::sync::MutexGuard;
use crate::system::sync::atomic::{AtomicBool, Ordering};
use crate::turns::order::{Claim, Priority, Program};
use crate::turns::queue::{NoTurn, Turn};

/// How often somebody who waits for a unit to be halted looks whether it was.
const HALTED: Duration = Duration::from_millis(10);

/// A call under way.
pub(crate) struct Call<'b, 'r> {
    bus: &'b Port,
    ask: Ask<'r>,
    unit: Option<UnitAddress>,
    priority: Priority,
    program: Program,
    retries: u32,
    verify: bool,
    read_back: Option<u16>,
    connection: Option<u64>,
    /// How often its unit had been told to halt when it was decided on.
    halts: Option<u64>,
    /// Whether somebody still waits for it; asked wherever nothing of it is on the wire.
    wanted: Option<&'r dyn Wanted>,
}

/// What tells whether somebody still waits for a call.
pub(crate) trait Wanted {
    /// Whether somebody does.
    fn is_wanted(&self) -> bool;
}

impl Wanted for AtomicBool {
    fn is_wanted(&self) -> bool {
        self.load(Ordering::Acquire)
    }
}

impl<'b, 'r> Call<'b, 'r> {
    #[expect(
        clippy::inline_always,
        reason = "it has several callers, and the lone one on the hot path pays for no call"
    )]
    #[inline(always)]
    pub(crate) fn new(bus: &'b Port, ask: Ask<'r>, options: CallOptions) -> Self {
        let kind = if ask.request.is_write() { Priority::Write } else { Priority::Read };
        let (unit, priority) = (ask.unit(), options.priority.unwrap_or(kind));
        if priority == Priority::Stop
            && ask.request.is_write()
            && let Some(unit) = unit
        {
            bus.halts.count(unit);
        }
        Self {
            bus,
            unit,
            priority,
            program: Program::default(),
            retries: options.retries.unwrap_or(bus.options.retries),
            verify: options.verify,
            read_back: options.read_back.filter(|_| ask.request.is_write()),
            connection: options.connection,
            // Of what halts, whatever else is told to halt takes nothing back.
            halts: options.halts.filter(|_| priority != Priority::Stop),
            wanted: None,
            ask,
        }
    }

    /// Whose it is, of those who use the line through this program.
    pub(crate) fn of_program(mut self, program: Program) -> Self {
        self.program = program;
        self
    }

    /// Ends as soon as `wanted` is false and nothing of it is on the wire.
    pub(crate) fn while_wanted(mut self, wanted: &'r dyn Wanted) -> Self {
        self.wanted = Some(wanted);
        self
    }

    fn is_wanted(&self) -> bool {
        self.wanted.is_none_or(Wanted::is_wanted) && self.halted().is_none()
    }

    /// Its unit, if that was told to halt since the call was decided on.
    fn halted(&self) -> Option<UnitAddress> {
        self.unit.filter(|&unit| self.halts.is_some_and(|before| self.bus.halts.of(unit) != before))
    }

    /// Asks until it is answered, refused or given up.
    #[expect(
        clippy::inline_always,
        reason = "it has several callers, and the lone one on the hot path pays for no call"
    )]
    #[inline(always)]
    pub(crate) fn run(
        &mut self,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        let turn = self.turn(give_up)?;
        self.run_in(turn, give_up, take)
    }

    /// As [`run`](Self::run), for who has the turn.
    pub(crate) fn run_in(
        &mut self,
        mut turn: Turn<'b, Errand>,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        // Asked every 50 ms of who has the line, by whoever has it.
        let give_up = &mut || {
            let ends = give_up();
            self.bus.queue.goes_on();
            ends
        };
        let is_wanted = || self.is_wanted();
        let mut talk = Talk::new(Conversation::new(self.question(), &self.bus.words), &self.ask, &is_wanted);
        let mut owner = self.bus.lock();
        loop {
            let now = self.bus.now_of(&owner);
            let came_on = match owner.go_on(&mut talk, now, give_up, take) {
                Then::Done(result) => return self.told(&mut owner, result),
                Then::LetPass => {
                    drop(owner);
                    self.pass(&mut turn, &talk, give_up)
                }
                Then::StandBy(until) => {
                    drop(owner);
                    self.stand_by(&mut turn, until, give_up).map(|()| self.bus.lock())
                }
            };
            owner = match came_on {
                Ok(owner) => owner,
                Err(failure) => {
                    let mut owner = self.bus.lock();
                    let now = self.bus.now_of(&owner);
                    talk.cut_short(&mut owner, now, failure);
                    owner
                }
            };
        }
    }

    /// What the call came to, in the words that its caller hears.
    fn told(&self, owner: &mut Owner, result: Result<Done, Box<CallError>>) -> Result<Done, Box<CallError>> {
        result.map_err(|mut error| {
            match error.failure {
                Failure::Interrupted => {
                    error.failure = match (self.bus.given_up(), self.halted()) {
                        (Failure::Interrupted, Some(unit)) if error.sent.is_none() => {
                            Failure::Halted { unit: unit.get() }
                        }
                        (given_up, _) => given_up,
                    };
                }
                Failure::NotAsked { .. } => owner.stats().count(self.unit, |counters| counters.not_asked += 1),
                _ => {}
            }
            error
        })
    }

    fn question(&self) -> Question<'r> {
        let urgency = match self.priority {
            Priority::Stop => Urgency::Stop,
            Priority::Poll => Urgency::Poll,
            _ => Urgency::Call,
        };
        let Ask { destination, request, timeout, gap, in_doubt, meanings, .. } = self.ask;
        Question::new(destination, *request, timeout)
            .gap(gap)
            .retries(self.retries)
            .urgency(urgency)
            .in_doubt(in_doubt)
            .verify(self.verify)
            .read_back(self.read_back)
            .connection(self.connection)
            .meanings(self.bus.meanings.that_hold(self.unit, meanings))
    }

    /// Lets stops go first, and comes back with the line, opened again if it was lost.
    ///
    /// # Errors
    ///
    /// [`Failure`]: the call may not go on, or the port cannot be opened.
    fn pass(
        &self,
        turn: &mut Turn<'b, Errand>,
        talk: &Talk<'_, '_>,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<MutexGuard<'b, Owner>, Failure> {
        loop {
            if !turn.let_pass(give_up) || !self.is_wanted() {
                return Err(self.bus.given_up());
            }
            let mut owner = self.bus.lock();
            if self.bus.is_shut() {
                owner.close();
                return Err(Failure::Closed);
            }
            owner.prepare(give_up)?;
            let Some(failure) = self.bus.wills.keeps_from(self.unit).filter(|_| self.priority != Priority::Stop) else {
                return Ok(owner);
            };
            drop(owner);
            self.wait_for_the_halt(turn, talk.call.patience(), failure, give_up)?;
        }
    }

    fn claim(&self) -> Claim {
        Claim { priority: self.priority, unit: self.unit, program: self.program }
    }

    fn turn(&self, give_up: &mut dyn FnMut() -> bool) -> Result<Turn<'b, Errand>, Box<CallError>> {
        self.bus.queue.turn(self.claim(), give_up).map_err(|why| self.no_turn(why))
    }

    fn no_turn(&self, why: NoTurn) -> Box<CallError> {
        self.ask.failed(self.bus.no_turn(why), None, self.bus.now_if_known(), &[])
    }

    /// Its unit is being halted for a program that is gone: waits off the line for that, as long as for one that is silent.
    /// `failure` says so.
    fn wait_for_the_halt(
        &self,
        turn: &mut Turn<'b, Errand>,
        patience: Duration,
        failure: Failure,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), Failure> {
        let end = self.bus.now() + patience;
        while self.bus.wills.keeps_from(self.unit).is_some() {
            let now = self.bus.now();
            if now >= end {
                return Err(failure);
            }
            self.stand_by(turn, end.min(now + HALTED), give_up)?;
        }
        Ok(())
    }

    /// Leaves the line to others until `until`.
    fn stand_by(
        &self,
        turn: &mut Turn<'b, Errand>,
        until: Instant,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), Failure> {
        turn.leave();
        let mut ended = false;
        self.bus.sleep(until.saturating_duration_since(self.bus.now()), &mut || {
            ended = give_up() || !self.is_wanted();
            ended
        });
        if ended || self.bus.is_shut() {
            return Err(self.bus.given_up());
        }
        *turn = self.bus.queue.turn_again(self.claim(), give_up).map_err(|why| self.bus.no_turn(why))?;
        if self.is_wanted() { Ok(()) } else { Err(self.bus.given_up()) }
    }
}
