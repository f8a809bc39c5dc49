//! One call from its place in the queue to its end: dead units, attempts, and what may be repeated.
//!
//! | kind | after silence or a damaged answer |
//! | --- | --- |
//! | a read | asked again, as often as the bus is set to; a damaged answer, which took no time-out, counts half, and so does a refusal by which the unit decides nothing (06H: busy) |
//! | a write whose words can be read back | read back; written again only where the unit shows other words |
//! | any other write, an echo, a custom request | never: the caller is told |
//!
//! What it takes to be sure is bounded too: a call sends eight requests at most for each time that it may ask, the questions,
//! the probes, and what is asked again included.

mod attempt;
mod course;
mod value;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use drivebus_rtu::{Answer, Destination, Instant, Meaning, Request, UnitAddress};

use crate::ask::{Ask, Done};
use crate::bus::call::course::Course;
use crate::bus::errand::Errand;
use crate::bus::port::Port;
use crate::error::{CallError, Failure};
use crate::options::CallOptions;
use crate::owner::dead_units::Verdict;
use crate::turns::order::{Claim, Priority, Program};
use crate::turns::queue::{NoTurn, Turn};

/// How often somebody who waits for a unit to be halted looks whether it was.
const HALTED: Duration = Duration::from_millis(10);

/// A call under way.
pub(crate) struct Call<'b, 'r> {
    pub(crate) bus: &'b Port,
    pub(crate) ask: Ask<'r>,
    pub(crate) unit: Option<UnitAddress>,
    pub(crate) priority: Priority,
    program: Program,
    retries: u32,
    pub(crate) verify: bool,
    pub(crate) read_back: Option<u16>,
    pub(crate) connection: Option<u64>,
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
        Self {
            bus,
            unit: match ask.destination {
                Destination::Unit(unit) => Some(unit),
                Destination::Broadcast => None,
            },
            priority: options.priority.unwrap_or(kind),
            program: Program::default(),
            retries: options.retries.unwrap_or(bus.options.retries),
            verify: options.verify,
            read_back: options.read_back.filter(|_| ask.request.is_write()),
            connection: options.connection,
            wanted: None,
            ask,
        }
    }

    /// It is another program's, which uses the line through this one.
    #[cfg(all(unix, feature = "share"))]
    pub(crate) fn of_program(mut self, program: Program) -> Self {
        self.program = program;
        self
    }

    /// Ends as soon as `wanted` is false and nothing of it is on the wire.
    pub(crate) fn while_wanted(mut self, wanted: &'r dyn Wanted) -> Self {
        self.wanted = Some(wanted);
        self
    }

    pub(crate) fn is_wanted(&self) -> bool {
        self.wanted.is_none_or(Wanted::is_wanted)
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
        if let Some(unit) = self.unit
            && self.priority != Priority::Stop
        {
            self.spare_the_others(&mut turn, unit, give_up)?;
        }
        let mut course = Course::new(self.ask.timeout, self.retries);
        // Asked every 50 ms of who has the line, by whoever has it.
        let give_up = &mut || {
            let ends = give_up();
            self.bus.queue.goes_on();
            ends
        };
        let result = match (self.ask.request, self.read_back) {
            (Request::Read { .. }, _) => self.repeat(&mut turn, &mut course, give_up, take),
            (_, Some(address)) => self.write_value(&mut turn, &mut course, address, give_up, take),
            _ => self.once(&mut turn, &mut course, give_up, take),
        };
        if let Some(unit) = self.unit {
            let mut owner = self.bus.lock();
            match &result {
                Ok(done) => owner.dead.answered(unit, done.ended),
                Err(error) => match error.ended {
                    Some(ended) if is_silence(&error.failure) => owner.dead.silent(unit, ended),
                    Some(ended) if error.sent.is_some() && !error.raw.is_empty() => owner.dead.answered(unit, ended),
                    _ => {}
                },
            }
        }
        result.map_err(|mut error| {
            if error.failure == Failure::Interrupted {
                error.failure = self.bus.given_up();
            }
            error.request = self.ask.frame();
            error
        })
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

    /// An error of a request that was not sent.
    pub(crate) fn failed(&self, failure: Failure) -> Box<CallError> {
        self.ask.failed(failure, None, self.bus.now(), &[])
    }

    /// A unit that was silent lately waits off the line, while others use it, for as long as it would have been silent.
    fn spare_the_others(
        &mut self,
        turn: &mut Turn<'b, Errand>,
        unit: UnitAddress,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), Box<CallError>> {
        let mut patience = None;
        loop {
            let mut owner = self.bus.lock();
            let now = self.bus.now_of(&owner);
            let until = match owner.dead.verdict(unit, now) {
                Verdict::AskOnce => {
                    self.retries = 0;
                    return Ok(());
                }
                Verdict::Wait(until) if owner.line().is_some() => until,
                Verdict::Ask | Verdict::Wait(_) => return Ok(()),
            };
            let patience = *patience.get_or_insert(now + self.patience());
            if now >= patience {
                owner.stats().count(Some(unit), |counters| counters.not_asked += 1);
                let left = until.saturating_duration_since(now);
                return Err(self.ask.failed(Failure::NotAsked { left }, None, now, &[]));
            }
            drop(owner);
            self.stand_by(turn, until.min(patience), give_up)?;
        }
    }

    /// How long a unit that was silent may keep its caller waiting: no longer than it would by staying silent again. Who
    /// polls has others to ask meanwhile.
    fn patience(&self) -> Duration {
        if self.priority == Priority::Poll {
            return Duration::ZERO;
        }
        self.ask.timeout.saturating_mul(self.retries.saturating_add(1))
    }

    /// Its unit is being halted for a program that is gone: waits off the line for that, as long as for one that is silent.
    /// `failure` says so.
    pub(crate) fn wait_for_the_halt(
        &self,
        turn: &mut Turn<'b, Errand>,
        failure: Failure,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), Box<CallError>> {
        let end = self.bus.now() + self.patience();
        while self.bus.wills.keeps_from(self.unit).is_some() {
            let now = self.bus.now();
            if now >= end {
                return Err(self.failed(failure));
            }
            self.stand_by(turn, end.min(now + HALTED), give_up)?;
        }
        Ok(())
    }

    /// Leaves the line to others until `until`.
    pub(crate) fn stand_by(
        &self,
        turn: &mut Turn<'b, Errand>,
        until: Instant,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), Box<CallError>> {
        turn.leave();
        let mut ended = false;
        self.bus.sleep(until.saturating_duration_since(self.bus.now()), &mut || {
            ended = give_up() || !self.is_wanted();
            ended
        });
        if ended || self.bus.is_shut() {
            return Err(self.failed(self.bus.given_up()));
        }
        *turn = self.bus.queue.turn_again(self.claim(), give_up).map_err(|why| self.no_turn(why))?;
        Ok(())
    }

    /// Asks what may be asked once only.
    fn once(
        &self,
        turn: &mut Turn<'b, Errand>,
        course: &mut Course,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        course.go_on_with(self.ask.timeout, 0);
        self.repeat(turn, course, give_up, take)
    }

    /// Asks, and asks again as often as `course` says while nothing comes of it.
    fn repeat(
        &self,
        turn: &mut Turn<'b, Errand>,
        course: &mut Course,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        let mut lost = None;
        loop {
            let asked = course.asked();
            let error = match self.attempt(turn, course, give_up, take) {
                Ok(done) => return Ok(done),
                Err(error) => error,
            };
            let is_port = matches!(error.failure, Failure::Port(_));
            if !course.goes_on(&error, asked, self.is_to_ask_again(&error)) || !self.is_wanted() {
                // How the port was lost tells more than that it is still not there. But where the request went out only
                // the second time, that has to be said.
                let lost = lost.filter(|_| is_port && error.sent.is_none());
                return Err(lost.unwrap_or_else(|| attempted(error, course.asked())));
            }
            lost = is_port.then_some(error);
            if let Some(unit) = self.unit {
                self.bus.lock().stats().count(Some(unit), |counters| counters.retries += 1);
            }
        }
    }

    /// Whether the unit could not take the request, as it says itself by `error`, and may the next time.
    fn is_to_ask_again(&self, error: &CallError) -> bool {
        self.unit.is_some_and(|unit| self.bus.meanings.asks_again(unit, self.ask.meanings, &error.failure))
    }

    /// What the unit says by `error`, if that is a refusal.
    fn means(&self, error: &CallError) -> Option<Meaning> {
        self.unit.and_then(|unit| self.bus.meanings.of(unit, self.ask.meanings, &error.failure))
    }
}

/// Whether a time-out was waited for in vain.
pub(crate) fn is_silence(failure: &Failure) -> bool {
    matches!(failure, Failure::NoAnswer { .. })
}

/// `error`, which came when it was asked for the last of so many times.
fn attempted(mut error: Box<CallError>, attempts: u32) -> Box<CallError> {
    if let Failure::NoAnswer { timeout, .. } = error.failure {
        error.failure = Failure::NoAnswer { timeout, attempts: attempts.max(1) };
    }
    error
}
