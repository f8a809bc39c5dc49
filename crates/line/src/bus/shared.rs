//! What all have in common who work on one line: its owner, the queue before it, the figures, and the settings.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use drivebus_rtu::{Answer, BeginError, Destination, Instant, Request, UnitAddress};

use crate::ask::{Ask, Done};
use crate::bus::call::Call;
use crate::bus::clock::Clock;
use crate::bus::errand::Errand;
use crate::bus::openings::Openings;
use crate::bus::sharing::Sharing;
use crate::bus::wills::Wills;
use crate::error::{CallError, Failure};
use crate::health::link::{Link, Links};
use crate::health::stats::Stats;
use crate::line::Opener;
use crate::options::{BusOptions, CallOptions, UnitOptions};
use crate::owner::Owner;
use crate::owner::meanings::UnitMeanings;
use crate::owner::resync::FreshWords;
use crate::ports::key::PortKey;
use crate::system::clock::{LOOK_UP, monotonic, sleep_until};
use crate::system::process::Process;
use crate::system::punctual;
use crate::trace::{Trace, Watch};
use crate::turns::order::Priority;
use crate::turns::queue::{NoTurn, Queue, Stops, Turn};

/// How long the exchange under way may take where the port is to be given up.
const WAITS_TO_STEP_ASIDE: Duration = Duration::from_secs(2);

/// One line, and all that its callers share.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(super) queue: Arc<Queue<Errand>>,
    owner: Mutex<Owner>,
    /// What can be asked for while somebody waits on the line.
    pub(super) stats: Arc<Mutex<Stats>>,
    pub(super) links: Arc<Mutex<Links>>,
    /// What its units say by their exceptions.
    pub(crate) meanings: Arc<UnitMeanings>,
    pub(super) words: Arc<FreshWords>,
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
    /// Where the port is of a kind that programs share, and this one does.
    pub(super) sharing: Option<Arc<Sharing>>,
    /// What is left to be done for programs that are gone.
    pub(super) wills: Arc<Wills>,
}

impl Shared {
    /// With the line that `opener` opens, or through the program that has the port which `key` tells apart.
    pub(super) fn open(
        opener: Opener,
        key: Option<PortKey>,
        options: BusOptions,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Arc<Self>, Failure> {
        let (words, stats) = (Arc::new(FreshWords::new()), Arc::default());
        let given = key.as_ref().map(ToString::to_string).unwrap_or_default();
        let openings = Openings::new(&stats);
        let wills = Arc::new(Wills::new(key.clone(), &options));
        let (sharing, opener) = Sharing::around(key, &options, &stats, &openings, openings.counting(opener));
        let opener = wills.finding(opener);
        let mut owner = Owner::new(opener, options.format, options.echo, Arc::clone(&words), Arc::clone(&stats));
        match owner.open(give_up) {
            Err(failure) if !sharing.as_ref().is_some_and(|sharing| sharing.is_guest()) => return Err(failure),
            _ => {}
        }
        let (name, clock) = owner.line().map_or_else(|| (given, Clock::real()), |line| (line.name(), Clock::of(line)));
        let notes = owner.line().map(|line| line.notes()).unwrap_or_default();
        let gapless = owner.line().is_some_and(|line| line.gapless());
        let shared = Arc::new(Self {
            queue: Arc::new(Queue::with_room(options.queue)),
            stats,
            links: owner.shared_links(),
            meanings: Arc::clone(&owner.meanings),
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
            trace: Trace::default(),
            sharing,
            wills,
        });
        shared.wills.serves(&shared);
        if let Some(sharing) = &shared.sharing {
            sharing.serves(&shared);
        }
        Ok(shared)
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

    /// Lets others have the line while `meanwhile` runs.
    pub(crate) fn step_aside(&self, meanwhile: impl FnOnce()) {
        if !self.opened_by.is_current() || self.is_shut() {
            return meanwhile();
        }
        let end = monotonic() + WAITS_TO_STEP_ASIDE;
        // Kept until the end, so that nobody here opens the port again.
        let turn = self.queue.turn((Priority::Stop, None), &mut || monotonic() >= end);
        if turn.is_ok() && !self.sharing.as_ref().is_some_and(|sharing| sharing.is_guest()) {
            self.lock().close();
            self.wills.hand_over();
            if let Some(sharing) = &self.sharing {
                sharing.serves_no_more();
            }
        }
        meanwhile();
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
        if let Some(sharing) = &self.sharing {
            sharing.end();
        }
    }

    /// `None` where there is nothing to carry out.
    pub(super) fn carry_out_here(
        &self,
        errand: &Errand,
        turn: Turn<'_, Errand>,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Option<Result<Done, Box<CallError>>> {
        let request = errand.request(|| self.words.next())?;
        let ask = self.ask(errand.destination, &request, &errand.options);
        let mut call = Call::new(self, ask, errand.options).while_wanted(&*errand.wanted);
        Some(call.run_in(turn, &mut || self.is_shut(), take))
    }

    pub(super) fn stats_here(&self) -> Stats {
        self.stats.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(super) fn link_here(&self, unit: UnitAddress) -> Link {
        self.links.lock().unwrap_or_else(PoisonError::into_inner).of(unit)
    }

    pub(super) fn reconnects_here(&self) -> u64 {
        self.stats.lock().unwrap_or_else(PoisonError::into_inner).reconnects
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

    /// A thread that panicked cannot have left them half set.
    pub(super) fn units(&self) -> MutexGuard<'_, BTreeMap<UnitAddress, UnitOptions>> {
        self.units.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Now, on the line's clock; its start in a forked child, where only the line of the parent knows.
    pub(crate) fn now(&self) -> Instant {
        let asked = || if self.opened_by.is_current() { self.lock().now() } else { Instant::ZERO };
        self.clock.now().unwrap_or_else(asked)
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
    pub(super) fn notes(&self) -> Vec<String> {
        if !self.is_of_this_process() {
            return Vec::new(); // a thread of the parent's may have held them
        }
        let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
        if let Ok(mut owner) = self.owner.try_lock()
            && let Some(line) = owner.line()
        {
            *notes = line.notes();
        }
        let late = (!self.is_virtual()).then(punctual::note).flatten();
        let shared = self.sharing.iter().flat_map(|sharing| sharing.notes());
        notes.iter().cloned().chain(shared).chain(late).chain(self.priority_refused.get().cloned()).collect()
    }

    /// A thread that works for this line alone comes: it goes before others where it may.
    pub(crate) fn enter_thread(&self) {
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

    pub(crate) fn given_up(&self) -> Failure {
        if self.is_shut() { Failure::Closed } else { Failure::Interrupted }
    }

    /// A thread that panicked has left the master in a state that the next `begin` refuses, not in a wrong one.
    pub(crate) fn lock(&self) -> MutexGuard<'_, Owner> {
        self.owner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
