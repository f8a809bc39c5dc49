//! One line as a call of this program finds it: its owner, the queue before it, its clock, the figures, and the settings.
//!
//! Who calls, and from where, is not known here.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use drivebus_rtu::{BeginError, Destination, FreshWords, Instant, Request, UnitAddress, huanyang};

use crate::ask::Ask;
use crate::bus::clock::Clock;
use crate::bus::errand::Errand;
use crate::bus::figures::Figures;
use crate::bus::halts_told::HaltsTold;
#[cfg(any(feature = "tcp", all(any(unix, windows), feature = "share")))]
use crate::bus::programs::Programs;
use crate::bus::spoken::Spoken;
use crate::bus::wills::Wills;
use crate::error::{CallError, Failure};
use crate::options::{BusOptions, CallOptions, UnitOptions};
use crate::owner::Owner;
use crate::owner::meanings::UnitMeanings;
use crate::system::clock::{LOOK_UP, monotonic, sleep_until};
use crate::system::process::Process;
use crate::system::punctual;
use crate::system::sync::atomic::{AtomicBool, Ordering};
use crate::system::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use crate::trace::{Trace, Watch};
use crate::turns::order::Priority;
use crate::turns::queue::{NoTurn, Queue, Stops};

/// What else ends when the port is closed.
pub(super) trait Ends: fmt::Debug + Send + Sync {
    /// The port is closed by now. Ending again does nothing.
    fn end(&self);
}

/// One line, and what all have in common who use it.
#[derive(Debug)]
pub(crate) struct Port {
    pub(super) queue: Arc<Queue<Errand>>,
    owner: Mutex<Owner>,
    pub(super) figures: Figures,
    pub(super) halts: HaltsTold,
    /// What its units say by their exceptions.
    pub(crate) meanings: Arc<UnitMeanings>,
    /// In which protocol they are asked.
    pub(super) spoken: Spoken,
    pub(super) words: FreshWords,
    notes: Mutex<Vec<String>>,
    /// What the system refused to the threads of the bus's own.
    priority_refused: OnceLock<String>,
    pub(super) options: BusOptions,
    units: Mutex<BTreeMap<UnitAddress, UnitOptions>>,
    pub(super) name: String,
    /// Whether frames are told apart by something else than silence; it stays so when the line is opened again.
    pub(super) gapless: bool,
    closed: AtomicBool,
    opened_by: Process,
    clock: Clock,
    pub(super) trace: Trace,
    /// Those who use the line through this program.
    #[cfg(any(feature = "tcp", all(any(unix, windows), feature = "share")))]
    pub(super) programs: Arc<Programs>,
    /// What is left to be done for programs that are gone.
    pub(super) wills: Arc<Wills>,
    ends: OnceLock<Arc<dyn Ends>>,
}

impl Port {
    /// The port that `owner` opened, or found in another program's hands; until it is open it has the name `given`.
    pub(super) fn new(
        mut owner: Owner,
        given: String,
        options: BusOptions,
        figures: Figures,
        words: FreshWords,
        wills: Arc<Wills>,
    ) -> Self {
        let (name, clock) = owner.line().map_or_else(|| (given, Clock::real()), |line| (line.name(), Clock::of(line)));
        Self {
            queue: Arc::new(Queue::with_room(options.queue)),
            figures,
            halts: HaltsTold::new(),
            meanings: Arc::clone(&owner.meanings),
            spoken: Spoken::default(),
            words,
            notes: Mutex::new(owner.line().map(|line| line.notes()).unwrap_or_default()),
            priority_refused: OnceLock::new(),
            gapless: owner.line().is_some_and(|line| line.gapless()),
            owner: Mutex::new(owner),
            options,
            units: Mutex::default(),
            name,
            closed: AtomicBool::new(false),
            opened_by: Process::current(),
            clock,
            trace: Trace::default(),
            #[cfg(any(feature = "tcp", all(any(unix, windows), feature = "share")))]
            programs: Arc::default(),
            wills,
            ends: OnceLock::new(),
        }
    }

    /// When the port is closed, `other` ends too.
    pub(super) fn ends_with(&self, other: Arc<dyn Ends>) {
        // A port belongs to one bus, which says so once.
        let _ = self.ends.set(other);
    }

    /// Whether the bus was closed, or was opened by another process: by the parent of this forked child.
    pub(crate) fn is_closed(&self) -> bool {
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
    pub(crate) fn is_virtual(&self) -> bool {
        matches!(self.clock, Clock::Virtual(_))
    }

    /// Closes the line, after the exchange that is under way. From inside a `give_up`, whoever asked that does it.
    pub(crate) fn close(&self) {
        self.closed.store(true, Ordering::Release);
        // What a thread of the parent held, nobody here lets go.
        if !self.opened_by.is_current() {
            return;
        }
        self.dismiss();
        if self.queue.has_this_thread() {
            return;
        }
        let turn = self.queue.turn((Priority::Stop, None), &mut || false);
        self.lock().close();
        drop(turn);
        self.wills.let_go();
        if let Some(other) = self.ends.get() {
            other.end();
        }
        punctual::put_back();
    }

    /// Ends the crew; what waits ends with [`Failure::Closed`].
    pub(super) fn dismiss(&self) {
        for errand in self.queue.dismiss() {
            errand.fail(Failure::Closed, self.now_if_known());
        }
    }

    /// What one call asks, with the times that hold for it.
    #[expect(
        clippy::inline_always,
        reason = "it has several callers, and the lone one on the hot path pays for no call"
    )]
    #[inline(always)]
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

    #[expect(
        clippy::inline_always,
        reason = "it has several callers, and the lone one on the hot path pays for no call"
    )]
    #[inline(always)]
    pub(super) fn ask_as<'a>(
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
        let gap = match request {
            Request::Huanyang(_) => gap.max(huanyang::SILENCE),
            _ => gap,
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
            meanings: None,
        }
    }

    /// `request` as `destination` takes it: in the protocol of its unit.
    ///
    /// # Errors
    ///
    /// [`Failure::NotSpoken`]: that has nothing for it. Nothing was sent.
    #[inline]
    pub(super) fn said<'r>(
        &self,
        destination: Destination,
        request: &Request<'r>,
        options: &CallOptions,
    ) -> Result<Request<'r>, Box<CallError>> {
        let said = self.spoken.say(destination, request);
        said.map_err(|failure| self.unsent(destination, request, options, failure))
    }

    /// Why `request` is not sent.
    #[cold]
    pub(super) fn unsent(
        &self,
        destination: Destination,
        request: &Request<'_>,
        options: &CallOptions,
        failure: Failure,
    ) -> Box<CallError> {
        self.ask(destination, request, options).failed(failure, None, self.now_if_known(), &[])
    }

    /// A thread that panicked cannot have left them half set.
    pub(super) fn units(&self) -> MutexGuard<'_, BTreeMap<UnitAddress, UnitOptions>> {
        self.units.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Now, on the line's clock; its start in a forked child, where only the line of the parent knows.
    pub(crate) fn now(&self) -> Instant {
        self.clock.now().unwrap_or_else(|| if self.opened_by.is_current() { self.ask_now() } else { Instant::ZERO })
    }

    /// Now, where only the line knows; the latest moment it told where this thread uses it, and would wait for itself: inside
    /// of a watch or a `give_up`.
    fn ask_now(&self) -> Instant {
        let owner = match self.owner.try_lock() {
            Ok(owner) => owner,
            Err(TryLockError::Poisoned(broken)) => broken.into_inner(),
            Err(TryLockError::WouldBlock) if self.queue.has_this_thread() => return self.trace.latest(),
            Err(TryLockError::WouldBlock) => self.lock(),
        };
        self.now_of(&owner)
    }

    /// As [`now`](Self::now), without waiting for who uses the line: `None` where only the line knows, and it is in use.
    pub(crate) fn now_if_known(&self) -> Option<Instant> {
        self.clock.now().or_else(|| self.owner.try_lock().ok().map(|owner| owner.now()))
    }

    /// From now on `watch` has what goes over the line.
    pub(super) fn watch(&self, watch: Option<Watch>) {
        let shows = watch.is_some();
        self.trace.set(watch);
        if shows {
            self.show();
        }
    }

    /// From now on those who watch have what goes over the line; from inside of it, from the next line on.
    pub(super) fn show(&self) {
        if !self.queue.has_this_thread() {
            self.lock().show_to(&self.trace);
        }
    }

    /// Waits on the line's clock; other callers may use the line meanwhile. Ends early when `give_up` says so.
    pub(crate) fn sleep(&self, time: Duration, give_up: &mut dyn FnMut() -> bool) {
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

    /// What people should know about the line; while somebody waits on it, what it said last.
    pub(super) fn line_notes(&self) -> Vec<String> {
        let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
        if let Ok(mut owner) = self.owner.try_lock()
            && let Some(line) = owner.line()
        {
            *notes = line.notes();
        }
        notes.clone()
    }

    /// What the system refused to those who wait on the line.
    pub(super) fn system_notes(&self) -> impl Iterator<Item = String> {
        let late = (!self.is_virtual()).then(punctual::note).flatten();
        late.into_iter().chain(self.priority_refused.get().cloned())
    }

    /// A thread that works for this line alone comes: it goes before others where it may.
    pub(crate) fn enter_thread(&self) {
        if !self.is_virtual()
            && let Err(refused) = punctual::go_first(self.options.realtime)
        {
            self.priority_refused.get_or_init(|| refused);
        }
    }

    /// As [`now`](Self::now), for who holds the owner; also while no line is open.
    pub(crate) fn now_of(&self, owner: &Owner) -> Instant {
        let of_line = owner.now();
        // Who was told the line's own time must not be told an earlier one.
        if let Some(now) = self.clock.now() {
            return now.max(of_line);
        }
        self.trace.has_come_to(of_line);
        of_line
    }

    pub(crate) fn no_turn(&self, why: NoTurn) -> Failure {
        match why {
            NoTurn::GivenUp => self.given_up(),
            NoTurn::OwnThread => Failure::NotBegun(BeginError::OutOfTurn),
            NoTurn::Full => Failure::QueueFull { room: self.options.queue },
        }
    }

    pub(crate) fn given_up(&self) -> Failure {
        if self.is_shut() { Failure::Closed } else { Failure::Interrupted }
    }

    /// A thread that panicked has left the master in a state that the next `begin` refuses, not in a wrong one.
    pub(crate) fn lock(&self) -> MutexGuard<'_, Owner> {
        self.owner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
