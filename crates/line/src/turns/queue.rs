//! Whose turn it is: one owner of the line at a time. Who waits sleeps until it is called; who is called is decided by
//! [`Order`] at the last moment, so that a stop that comes while the next one wakes up still goes first.

#[cfg(all(any(unix, windows), feature = "share"))]
mod watching;
mod work;

use std::collections::HashSet;
use std::fmt;

use crate::system::clock::{LOOK_UP, monotonic};
use crate::system::sync::atomic::{AtomicU64, Ordering};
use crate::system::sync::thread::{self, Thread, ThreadId};
use crate::system::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use crate::turns::crew::Crew;
use crate::turns::order::{Claim, Order, Priority, Ticket};

/// More than any program means to have under way, and some tens of megabytes.
pub(crate) const DEFAULT_QUEUE: usize = 65_536;

/// Who waits for the line.
#[derive(Debug)]
pub(crate) enum Waiter<W> {
    /// A thread that will use it.
    Thread(Thread),
    /// What one of the crew is to do with it.
    Work(W),
}

impl<W> Waiter<W> {
    fn into_work(self) -> Option<W> {
        match self {
            Self::Work(work) => Some(work),
            Self::Thread(_) => None,
        }
    }
}

/// What tells whether a stop waits for the line.
pub(crate) trait Stops: fmt::Debug + Send + Sync {
    /// Whether one waits.
    fn has_stop(&self) -> bool;
}

/// A queue at the line. The calling thread itself works on the line when its turn comes, so that a lone caller pays
/// for no hand-over.
///
/// Work (`W`) that is left here waits in the same order, without a thread: one of the [`Crew`] is called when its turn
/// comes.
#[derive(Debug)]
pub(crate) struct Queue<W> {
    /// How many may wait, stops aside.
    pub(crate) room: usize,
    pub(crate) state: Mutex<State<W>>,
    /// Where the crew waits to be called.
    pub(crate) called: Condvar,
    /// When who has the line said last that it goes on; nanoseconds of the system's clock.
    goes_on: AtomicU64,
}

#[derive(Debug)]
pub(crate) struct State<W> {
    pub(crate) owner: Option<(Ticket, Thread)>,
    /// While the line is free and somebody waits, the next one has been called.
    pub(crate) order: Order<Waiter<W>>,
    /// The threads that wait in it.
    threads: HashSet<ThreadId>,
    pub(crate) crew: Crew,
}

/// Why there is no turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NoTurn {
    /// The caller does not want to wait any longer.
    GivenUp,
    /// This thread stands in the queue already.
    OwnThread,
    /// As many wait as may.
    Full,
}

/// The right to use the line, until it is dropped.
#[derive(Debug)]
pub(crate) struct Turn<'a, W> {
    pub(crate) queue: &'a Queue<W>,
    pub(crate) ticket: Ticket,
}

impl<W> Default for Queue<W> {
    fn default() -> Self {
        Self::with_room(DEFAULT_QUEUE)
    }
}

impl<W> Queue<W> {
    /// A queue in which `room` may wait, stops aside.
    pub(crate) fn with_room(room: usize) -> Self {
        Self { room, state: Mutex::default(), called: Condvar::new(), goes_on: AtomicU64::new(0) }
    }

    /// Waits for a turn.
    ///
    /// # Errors
    ///
    /// [`NoTurn`]: `give_up` said so before it came, this thread would wait for itself, or too many wait.
    pub(crate) fn turn(
        &self,
        claim: impl Into<Claim>,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Turn<'_, W>, NoTurn> {
        self.enter(claim.into(), self.room, give_up)
    }

    /// As [`turn`](Self::turn), for who had one and gave way: there is always room.
    pub(crate) fn turn_again(
        &self,
        claim: impl Into<Claim>,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Turn<'_, W>, NoTurn> {
        self.enter(claim.into(), usize::MAX, give_up)
    }

    fn enter(&self, claim: Claim, room: usize, give_up: &mut dyn FnMut() -> bool) -> Result<Turn<'_, W>, NoTurn> {
        let thread = thread::current();
        let mut state = self.lock();
        let is_free = state.owner.is_none() && state.order.is_empty();
        if !is_free && state.has(thread.id()) {
            return Err(NoTurn::OwnThread);
        }
        if !is_free && state.is_full_for(claim.priority, room) {
            return Err(NoTurn::Full);
        }
        let ticket = state.order.ticket(claim);
        if is_free {
            state.order.begin(ticket);
            state.owner = Some((ticket, thread));
            return Ok(Turn { queue: self, ticket });
        }
        state.wait(ticket, Waiter::Thread(thread));
        drop(state);
        let turn = Turn { queue: self, ticket };
        if turn.comes(give_up) { Ok(turn) } else { Err(NoTurn::GivenUp) }
    }

    /// Whether this thread stands in the queue already, and would wait for itself: inside a question of [`turn`](Self::turn)
    /// or of the owner's, which may run a signal handler of the caller's.
    pub(crate) fn has_this_thread(&self) -> bool {
        self.lock().has(thread::current().id())
    }

    /// Who has the line says that it goes on: to be called every 50 ms where it may wait for long.
    pub(crate) fn goes_on(&self) {
        // Who has stepped aside meanwhile says nothing for who has the line now.
        let this = thread::current().id();
        if self.lock().owner.as_ref().is_some_and(|(_, thread)| thread.id() == this) {
            self.goes_on.store(monotonic().as_nanos(), Ordering::Relaxed);
        }
    }

    /// How many wait.
    #[cfg(test)]
    pub(crate) fn waiting(&self) -> usize {
        self.lock().order.len()
    }

    /// Wakes who is next, if the line is free. It looks for itself whether it still is.
    ///
    /// Nobody counts on a thread that has had its turn and comes back: first it tells what came of it, and who is told may
    /// take long.
    fn call_next(&self, state: MutexGuard<'_, State<W>>) {
        if state.owner.is_some() {
            return;
        }
        match state.order.next() {
            Some(Waiter::Thread(thread)) => thread.unpark(),
            Some(Waiter::Work(_)) => self.call_crew(state),
            None => {}
        }
    }

    /// A thread that panicked cannot have left the order inconsistent: nothing is done under the lock that can.
    pub(crate) fn lock(&self) -> MutexGuard<'_, State<W>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<W: fmt::Debug + Send> Stops for Queue<W> {
    fn has_stop(&self) -> bool {
        self.lock().order.has_stop()
    }
}

impl<W> Turn<'_, W> {
    /// Lets the stops that wait go first, and comes back with the turn; `false` when `give_up` said so before, and the
    /// turn is lost then. Who steps aside stays ahead of all who are no stops.
    ///
    /// Whoever passes uses the line: the caller must hold nothing that is needed for that.
    pub(crate) fn let_pass(&mut self, give_up: &mut dyn FnMut() -> bool) -> bool {
        let mut state = self.queue.lock();
        if self.ticket.is_stop() || !state.order.has_stop() {
            return true;
        }
        if let Some((ticket, thread)) = state.owner.take_if(|(owner, _)| *owner == self.ticket) {
            state.threads.insert(thread.id());
            state.order.step_aside(ticket, Waiter::Thread(thread));
        }
        self.queue.call_next(state);
        let back = self.comes(give_up);
        if !back {
            self.leave();
        }
        back
    }

    /// Waits until the turn has come; `false` when `give_up` says so first.
    fn comes(&self, give_up: &mut dyn FnMut() -> bool) -> bool {
        let mut look_up = monotonic() + LOOK_UP;
        loop {
            if self.queue.lock().take(self.ticket) {
                return true;
            }
            // Being called does not move the moment to look up: turns may pass all the time.
            let left = look_up.saturating_duration_since(monotonic());
            if left.is_zero() {
                look_up = monotonic() + LOOK_UP;
                // Without the lock: the caller may need locks of its own to answer.
                if give_up() {
                    return false;
                }
            } else {
                thread::park_timeout(left);
            }
        }
    }

    /// Gives up the turn, or the place of who waits for it. Doing so again does nothing.
    pub(crate) fn leave(&self) {
        let mut state = self.queue.lock();
        let had_the_line = state.owner.take_if(|(owner, _)| *owner == self.ticket);
        let waited = state.leave(self.ticket);
        if had_the_line.is_some() || waited.is_some() {
            self.queue.call_next(state);
        }
    }
}

impl<W> Drop for Turn<'_, W> {
    fn drop(&mut self) {
        self.leave();
    }
}

impl<W> Default for State<W> {
    fn default() -> Self {
        Self { owner: None, order: Order::default(), threads: HashSet::new(), crew: Crew::default() }
    }
}

impl<W> State<W> {
    /// Whether who comes with `priority` finds no room among the `room` who may wait. A stop always does.
    ///
    /// On a free line the next has been called: it counts no longer, however late its thread comes.
    pub(crate) fn is_full_for(&self, priority: Priority, room: usize) -> bool {
        let called = usize::from(self.owner.is_none());
        priority != Priority::Stop && self.order.len().saturating_sub(called) >= room
    }

    /// Whether `this` thread has the line or waits for it.
    fn has(&self, this: ThreadId) -> bool {
        self.owner.as_ref().is_some_and(|(_, thread)| thread.id() == this) || self.threads.contains(&this)
    }

    /// Whether work waits that one of the crew has to do.
    fn has_work(&self) -> bool {
        self.order.len() > self.threads.len()
    }

    /// `waiter` waits with `ticket`.
    fn wait(&mut self, ticket: Ticket, waiter: Waiter<W>) {
        if let Waiter::Thread(thread) = &waiter {
            self.threads.insert(thread.id());
        }
        self.order.wait(ticket, waiter);
    }

    /// Who waits with `ticket` waits no longer.
    fn leave(&mut self, ticket: Ticket) -> Option<Waiter<W>> {
        let waiter = self.order.leave(ticket);
        self.waits_no_longer(waiter.as_ref());
        waiter
    }

    fn waits_no_longer(&mut self, waiter: Option<&Waiter<W>>) {
        if let Some(Waiter::Thread(thread)) = waiter {
            self.threads.remove(&thread.id());
        }
    }

    /// Takes the line for `ticket` if it is free and `ticket` is next.
    fn take(&mut self, ticket: Ticket) -> bool {
        if self.owner.is_none() {
            let waiter = self.order.take(ticket);
            self.waits_no_longer(waiter.as_ref());
            self.owner = waiter.map(|waiter| match waiter {
                Waiter::Thread(thread) => (ticket, thread),
                Waiter::Work(_) => (ticket, thread::current()),
            });
            return self.owner.is_some();
        }
        false
    }
}

#[cfg(test)]
mod tests;
