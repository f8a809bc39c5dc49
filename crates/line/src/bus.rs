//! The bus as its callers see it: safe from any thread, one exchange at a time, retries by kind.

pub(crate) mod call;
pub(crate) mod errand;
mod listen;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use drivebus_rtu::{Answer, BeginError, Destination, Instant, Request, UnitAddress};

use crate::ask::{Ask, Done};
use crate::bus::call::Call;
use crate::bus::errand::Errand;
use crate::error::{CallError, Failure};
use crate::health::link::{Link, Links};
use crate::health::stats::Stats;
use crate::line::{Line, LineClock};
use crate::options::{BusOptions, CallOptions, UnitOptions};
use crate::owner::Owner;
use crate::owner::opener::Opener;
use crate::owner::resync::FreshWords;
use crate::system::clock::{LOOK_UP, monotonic, sleep_until};
use crate::system::process::Process;
use crate::system::punctual;
use crate::turns::order::Priority;
use crate::turns::queue::{NoTurn, Queue, Stops};

/// One line and its owner.
///
/// The calling thread works on the line itself when its turn comes; others wait in the order of [`Priority`]. `give_up` is
/// asked about every 50 ms while a call waits, and ends it with [`Failure::Interrupted`].
#[derive(Debug)]
pub struct Bus {
    pub(crate) queue: Arc<Queue<Errand>>,
    owner: Mutex<Owner>,
    /// What can be asked for while somebody waits on the line.
    stats: Arc<Mutex<Stats>>,
    links: Arc<Mutex<Links>>,
    words: Arc<FreshWords>,
    notes: Mutex<Vec<String>>,
    /// What the system refused to the threads of the bus's own.
    priority_refused: OnceLock<String>,
    options: BusOptions,
    units: Mutex<BTreeMap<UnitAddress, UnitOptions>>,
    name: String,
    /// Whether frames are told apart by something else than silence; it stays so when the line is opened again.
    gapless: bool,
    closed: AtomicBool,
    opened_by: Process,
    clock: Clock,
}

/// How to tell the line's time without the line, which another thread may be waiting on.
enum Clock {
    /// It runs as the system's does; both stood so at one moment.
    Real { line: Instant, system: Instant },
    /// A simulation's: its time moves only while somebody waits. `None`: only the line knows.
    Virtual(Option<LineClock>),
}

impl std::fmt::Debug for Clock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(if matches!(self, Self::Real { .. }) { "Real" } else { "Virtual" })
    }
}

impl Clock {
    fn of(line: &dyn Line) -> Self {
        if line.is_virtual() {
            return Self::Virtual(line.clock());
        }
        Self::Real { line: line.now(), system: monotonic() }
    }

    /// Now on the line's clock; `None` where only the line knows.
    fn now(&self) -> Option<Instant> {
        match self {
            Self::Real { line, system } => Some(*line + monotonic().saturating_duration_since(*system)),
            Self::Virtual(clock) => clock.as_ref().map(|clock| clock()),
        }
    }
}

impl Bus {
    /// Opens a line with `opener`, which is called again whenever the line was lost.
    ///
    /// `opener` runs in a thread of its own, because it may block in the system for seconds; `give_up` is asked about
    /// every 50 ms meanwhile.
    ///
    /// # Errors
    ///
    /// [`Failure::Port`]: the line cannot be opened. [`Failure::Interrupted`]: `give_up` said so first.
    pub fn open(opener: Opener, options: BusOptions, give_up: &mut dyn FnMut() -> bool) -> Result<Self, Failure> {
        let words = Arc::new(FreshWords::new());
        let mut owner = Owner::open(opener, options.format, options.echo, Arc::clone(&words), give_up)?;
        let (name, clock) =
            owner.line().map_or_else(|| (String::new(), Clock::Virtual(None)), |line| (line.name(), Clock::of(line)));
        let notes = owner.line().map(|line| line.notes()).unwrap_or_default();
        let gapless = owner.line().is_some_and(|line| line.gapless());
        Ok(Self {
            queue: Arc::new(Queue::with_room(options.queue)),
            stats: owner.shared_stats(),
            links: owner.shared_links(),
            words,
            notes: Mutex::new(notes),
            priority_refused: OnceLock::new(),
            owner: Mutex::new(owner),
            options,
            units: Mutex::default(),
            name,
            gapless,
            closed: AtomicBool::new(false),
            opened_by: Process::current(),
            clock,
        })
    }

    /// What was opened, for people.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How the bus behaves.
    pub fn options(&self) -> &BusOptions {
        &self.options
    }

    /// Whether the bus was closed, or was opened by another process: by the parent of this forked child.
    pub fn is_closed(&self) -> bool {
        self.is_shut() || !self.opened_by.is_current()
    }

    /// As [`is_closed`](Self::is_closed), for who is in the process that opened it: asking which that is takes a system
    /// call, and a call asks three times.
    pub(crate) fn is_shut(&self) -> bool {
        self.closed.load(Ordering::Acquire)
    }

    pub(crate) fn is_of_this_process(&self) -> bool {
        self.opened_by.is_current()
    }

    /// Whether the line's clock is a simulation's.
    pub fn is_virtual(&self) -> bool {
        matches!(self.clock, Clock::Virtual(_))
    }

    /// Closes the line, after the exchange that is under way at most 50 ms later. Closing again does nothing.
    ///
    /// From inside a `give_up`, the call that asks it closes the line when it ends.
    pub fn close(&self) {
        self.closed.store(true, Ordering::Release);
        // What a thread of the parent held, nobody here lets go.
        if !self.opened_by.is_current() {
            return;
        }
        self.dismiss();
        if self.queue.has_this_thread() {
            return;
        }
        let _turn = self.queue.turn(Priority::Stop, None, &mut || false);
        self.lock().close();
    }

    /// Asks `request` of `destination` and gives the answer to `take`.
    ///
    /// A read that brings nothing is asked again by policy, and `take` is called for the answer that counts. A write
    /// and an echo are sent once, unless [`CallOptions::read_back`] says where the words can be read. Before anything is
    /// asked of a unit that may still answer something else, that unit is probed, so that its late answer is never taken
    /// for the new one: it is sent a fresh word to return, or else a read of another length.
    ///
    /// # Errors
    ///
    /// [`CallError`]: with [`sent`](CallError::sent) `None` the request never went out, so nothing was done; after any
    /// other failure but [`Failure::Refused`] the unit may have done what was asked. From inside a `give_up` of the same
    /// thread: [`BeginError::OutOfTurn`].
    pub fn call(
        &self,
        destination: Destination,
        request: &Request<'_>,
        options: CallOptions,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        if !self.opened_by.is_current() {
            // What a thread of the parent held when this child was forked, nobody here lets go: nothing is looked up.
            let ask = self.ask_as(UnitOptions::default(), destination, request, &options);
            return Err(ask.failed(Failure::Forked, None, None, &[]));
        }
        let ask = self.ask(destination, request, &options);
        if self.options.read_only && request.is_write() {
            return Err(ask.failed(Failure::ReadOnly { function: request.function() }, None, self.now_if_known(), &[]));
        }
        let mut give_up = || self.is_shut() || give_up();
        let result = Call::new(self, ask, options).run(&mut give_up, take);
        if self.is_shut() {
            self.close();
        }
        result
    }

    /// Sets what `unit` needs otherwise than the bus, for every call from now on.
    ///
    /// In a forked child nothing is set: it makes no calls.
    pub fn configure(&self, unit: UnitAddress, options: UnitOptions) {
        if self.opened_by.is_current() {
            self.units().insert(unit, options);
        }
    }

    /// What one call asks, with the times that hold for it.
    pub(crate) fn ask<'a>(
        &'a self,
        destination: Destination,
        request: &'a Request<'a>,
        options: &CallOptions,
    ) -> Ask<'a> {
        let set = match destination {
            Destination::Broadcast => UnitOptions::default(),
            Destination::Unit(unit) => self.units().get(&unit).copied().unwrap_or_default(),
        };
        self.ask_as(set, destination, request, options)
    }

    fn ask_as<'a>(
        &'a self,
        set: UnitOptions,
        destination: Destination,
        request: &'a Request<'a>,
        options: &CallOptions,
    ) -> Ask<'a> {
        let (timeout, gap) = match destination {
            Destination::Broadcast => (self.options.turnaround, Duration::ZERO),
            Destination::Unit(_) => (set.timeout.unwrap_or(self.options.timeout), set.gap.unwrap_or_default()),
        };
        let learns = self.options.learn_timeout || options.priority == Some(Priority::Poll);
        Ask {
            destination,
            request,
            timeout: options.timeout.unwrap_or(timeout),
            learns: learns && options.timeout.is_none(),
            gap,
            in_doubt: options.in_doubt,
            yields: (options.priority != Some(Priority::Stop)).then_some(&*self.queue as &dyn Stops),
        }
    }

    /// A thread that panicked cannot have left them half set.
    fn units(&self) -> MutexGuard<'_, BTreeMap<UnitAddress, UnitOptions>> {
        self.units.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Of the last ten exchanges with `unit`, how many brought an answer.
    pub fn link(&self, unit: UnitAddress) -> Link {
        if !self.opened_by.is_current() {
            return Link::default(); // a thread of the parent's may have held it
        }
        self.links.lock().unwrap_or_else(PoisonError::into_inner).of(unit)
    }

    /// A word that no echo still under way carries: for [`Request::echo`].
    pub fn fresh_word(&self) -> u16 {
        self.words.next()
    }

    /// Now, on the line's clock; its start in a forked child, where only the line of the parent knows.
    pub fn now(&self) -> Instant {
        let asked = || if self.opened_by.is_current() { self.lock().now() } else { Instant::ZERO };
        self.clock.now().unwrap_or_else(asked)
    }

    /// As [`now`](Self::now), without waiting for who uses the line: `None` where only the line knows, and it is in use.
    pub(crate) fn now_if_known(&self) -> Option<Instant> {
        self.clock.now().or_else(|| self.owner.try_lock().ok().map(|owner| owner.now()))
    }

    /// Waits on the line's clock; other callers may use the line meanwhile. Ends early when `give_up` says so.
    pub fn sleep(&self, time: Duration, give_up: &mut dyn FnMut() -> bool) {
        let end = self.now() + time;
        loop {
            let now = self.now();
            if now >= end || self.is_closed() {
                return;
            }
            let slice = end.saturating_duration_since(now).min(LOOK_UP);
            match self.clock {
                // It would wait for itself, inside a `give_up` of its own.
                Clock::Virtual(_) if self.queue.has_this_thread() => return,
                Clock::Virtual(_) => match self.lock().line() {
                    Some(line) => line.sleep(now + slice),
                    None => return,
                },
                Clock::Real { .. } => sleep_until(monotonic() + slice),
            }
            if give_up() {
                return;
            }
        }
    }

    /// What has happened so far; nothing in a forked child, whose parent's it is.
    pub fn stats(&self) -> Stats {
        if !self.opened_by.is_current() {
            return Stats::default(); // a thread of the parent's may have held it
        }
        self.stats.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// What the user should know about the line, such as a setting that did not reach the wire.
    ///
    /// While somebody waits on the line, what it said last.
    pub fn notes(&self) -> Vec<String> {
        if !self.opened_by.is_current() {
            return Vec::new(); // a thread of the parent's may have held them
        }
        let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
        if let Ok(mut owner) = self.owner.try_lock()
            && let Some(line) = owner.line()
        {
            *notes = line.notes();
        }
        let late = (!self.is_virtual()).then(punctual::note).flatten();
        notes.iter().cloned().chain(late).chain(self.priority_refused.get().cloned()).collect()
    }

    /// To be called by each thread that works for this bus alone: it goes before the programs around it, where the
    /// system allows that; where it does not, [`notes`](Self::notes) says so. In virtual time nothing is asked for.
    pub fn enter_thread(&self) {
        if !self.is_virtual()
            && let Err(refused) = punctual::go_first()
        {
            self.priority_refused.get_or_init(|| refused);
        }
    }

    /// As [`now`](Self::now), for who holds the owner; also while no line is open.
    pub(crate) fn now_of(&self, owner: &Owner) -> Instant {
        self.clock.now().unwrap_or_else(|| owner.now())
    }

    pub(crate) fn no_turn(&self, why: NoTurn) -> Failure {
        match why {
            NoTurn::GivenUp => self.given_up(),
            NoTurn::OwnThread => Failure::NotBegun(BeginError::OutOfTurn),
            NoTurn::Full => Failure::QueueFull { room: self.options.queue },
        }
    }

    /// Whether frames are told apart by something else than silence.
    pub(crate) fn is_gapless(&self) -> bool {
        self.gapless
    }

    /// The least silence before a request to `unit`.
    pub(crate) fn silence_before(&self, unit: UnitAddress) -> Duration {
        let gap = self.units().get(&unit).and_then(|set| set.gap).unwrap_or_default();
        self.options.format.t35().max(gap)
    }

    /// Why a bus that [is closed](Self::is_closed) is.
    pub(crate) fn ended(&self) -> Failure {
        if self.is_shut() { Failure::Closed } else { Failure::Forked }
    }

    pub(crate) fn given_up(&self) -> Failure {
        if self.is_shut() { Failure::Closed } else { Failure::Interrupted }
    }

    /// A thread that panicked has left the master in a state that the next `begin` refuses, not in a wrong one.
    pub(crate) fn lock(&self) -> MutexGuard<'_, Owner> {
        self.owner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Bus {
    /// Whoever still waits for an answer is told that none will come.
    fn drop(&mut self) {
        if self.opened_by.is_current() {
            self.dismiss();
        }
    }
}
