//! Whose turn it is: one owner of the line at a time. Who waits sleeps until it is called; who is called is decided by
//! [`Order`] at the last moment, so that a stop that comes while the next one wakes up still goes first.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, Thread, ThreadId};
use std::time::Duration;

use drivebus_rtu::UnitAddress;

use crate::clock::monotonic;
use crate::crew::{Crew, Waiter};
use crate::order::{Order, Ticket};

/// How often somebody who waits looks up to see whether it should still wait.
pub(crate) const LOOK_UP: Duration = Duration::from_millis(50);

/// Who goes first among those who wait for the line.
///
/// Stops go in the order they came. Within each other class the units take turns, and the calls for one unit go in the
/// order they came. Who waits while calls of a higher class that came later go first 32 times goes before them then, and
/// of several such the one that came first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Priority {
    /// What makes a motor stop, and the reads that confirm it: before all who wait.
    Stop,
    /// What changes something in a unit.
    Write,
    /// What somebody waits for.
    #[default]
    Read,
    /// What is asked again and again: when nobody else wants the line.
    Poll,
}

/// A queue at the line. The calling thread itself works on the line when its turn comes, so that a lone caller pays
/// for no hand-over.
///
/// Work that is left here waits in the same order, without a thread: one of the [`Crew`] is called when its turn comes.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    pub(crate) state: Mutex<State>,
    /// Where the crew waits to be called.
    pub(crate) called: Condvar,
}

#[derive(Debug, Default)]
pub(crate) struct State {
    pub(crate) owner: Option<(Ticket, Thread)>,
    /// While the line is free and somebody waits, the next one has been called.
    pub(crate) order: Order<Waiter>,
    pub(crate) crew: Crew,
}

/// Why there is no turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NoTurn {
    /// The caller does not want to wait any longer.
    GivenUp,
    /// This thread stands in the queue already.
    OwnThread,
}

/// The right to use the line, until it is dropped.
#[derive(Debug)]
pub(crate) struct Turn<'a> {
    pub(crate) queue: &'a Queue,
    pub(crate) ticket: Ticket,
    /// Whoever drops it comes back at once for the next work.
    pub(crate) of_crew: bool,
}

impl Queue {
    /// Waits for a turn to ask `unit`.
    ///
    /// `unit` is `None` for a broadcast and for what concerns the whole line.
    ///
    /// # Errors
    ///
    /// [`NoTurn`]: `give_up` said so before it came, or this thread would wait for itself.
    pub(crate) fn turn(
        &self,
        priority: Priority,
        unit: Option<UnitAddress>,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Turn<'_>, NoTurn> {
        let thread = thread::current();
        let mut state = self.lock();
        let is_free = state.owner.is_none() && state.order.is_empty();
        if !is_free && state.has(thread.id()) {
            return Err(NoTurn::OwnThread);
        }
        let ticket = state.order.ticket(priority, unit);
        if is_free {
            state.order.begin(ticket);
            state.owner = Some((ticket, thread));
            return Ok(Turn { queue: self, ticket, of_crew: false });
        }
        state.order.wait(ticket, Waiter::Thread(thread));
        drop(state);
        let turn = Turn { queue: self, ticket, of_crew: false };
        if turn.comes(give_up) { Ok(turn) } else { Err(NoTurn::GivenUp) }
    }

    /// Whether this thread stands in the queue already, and would wait for itself: inside a question of [`turn`](Self::turn)
    /// or of the owner's, which may run a signal handler of the caller's.
    pub(crate) fn has_this_thread(&self) -> bool {
        self.lock().has(thread::current().id())
    }

    /// How many wait.
    #[cfg(test)]
    pub(crate) fn waiting(&self) -> usize {
        self.lock().order.waiting().count()
    }

    /// A thread that panicked cannot have left the order inconsistent: nothing is done under the lock that can.
    pub(crate) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Turn<'_> {
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
            state.order.step_aside(ticket, Waiter::Thread(thread));
        }
        self.queue.call_next(&mut state);
        drop(state);
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
    pub(crate) fn leave(&mut self) {
        // Who goes on after this does not come back for the next work.
        self.of_crew = false;
        self.end();
    }

    fn end(&self) {
        let mut state = self.queue.lock();
        if self.of_crew {
            // A second thread need not be called for what this one is about to take.
            state.crew.comes_back();
        }
        let had_the_line = state.owner.take_if(|(owner, _)| *owner == self.ticket);
        let waited = state.order.leave(self.ticket);
        if had_the_line.is_some() || waited.is_some() {
            self.queue.call_next(&mut state);
        }
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.end();
    }
}

impl State {
    /// Whether `this` thread has the line or waits for it.
    fn has(&self, this: ThreadId) -> bool {
        self.owner.as_ref().is_some_and(|(_, thread)| thread.id() == this)
            || self.order.waiting().any(|waiter| matches!(waiter, Waiter::Thread(thread) if thread.id() == this))
    }

    /// Takes the line for `ticket` if it is free and `ticket` is next.
    fn take(&mut self, ticket: Ticket) -> bool {
        if self.owner.is_none() {
            self.owner = self.order.take(ticket).map(|waiter| match waiter {
                Waiter::Thread(thread) => (ticket, thread),
                Waiter::Work(_) => (ticket, thread::current()),
            });
            return self.owner.is_some();
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    use Priority::{Poll, Read, Stop, Write};

    fn unit(raw: u8) -> Option<UnitAddress> {
        UnitAddress::new(raw).ok()
    }

    /// Until `count` wait.
    fn wait_for(queue: &Queue, count: usize) {
        while queue.waiting() < count {
            thread::yield_now();
        }
    }

    #[test]
    fn turns_come_in_order_and_a_stop_overtakes() {
        let queue = Queue::default();
        let (done, order) = mpsc::channel();
        let first = queue.turn(Read, unit(1), &mut || false).unwrap();
        thread::scope(|scope| {
            let callers = [(Poll, 1), (Read, 1), (Read, 1), (Stop, 1), (Read, 2), (Write, 1), (Stop, 3)];
            for (number, (priority, raw)) in callers.into_iter().enumerate() {
                let (queue, done) = (&queue, done.clone());
                scope.spawn(move || {
                    let _turn = queue.turn(priority, unit(raw), &mut || false);
                    done.send(number).unwrap();
                });
                // The next one comes only when this one stands in the queue.
                wait_for(queue, number + 1);
            }
            drop(first);
        });
        assert_eq!(order.try_iter().collect::<Vec<_>>(), [3, 6, 5, 4, 1, 2, 0]);
    }

    #[test]
    fn one_at_a_time_has_the_line() {
        let queue = Queue::default();
        let inside = Mutex::new(());
        thread::scope(|scope| {
            for raw in 1..=8 {
                let (queue, inside) = (&queue, &inside);
                scope.spawn(move || {
                    for round in 0..500 {
                        let priority = [Stop, Write, Read, Poll][(round + usize::from(raw)) % 4];
                        let mut turn = queue.turn(priority, unit(raw), &mut || false).unwrap();
                        drop(inside.try_lock().unwrap());
                        assert!(turn.let_pass(&mut || false));
                        drop(inside.try_lock().unwrap());
                    }
                });
            }
        });
        let state = queue.lock();
        assert!(state.owner.is_none() && state.order.is_empty());
    }

    #[test]
    fn who_lets_pass_comes_back_before_all_but_stops() {
        let queue = Queue::default();
        let (done, order) = mpsc::channel();
        let mut first = queue.turn(Poll, unit(1), &mut || false).unwrap();
        assert!(first.let_pass(&mut || panic!("nobody is there")));
        thread::scope(|scope| {
            for (count, (name, priority)) in [("write", Write), ("stop", Stop)].into_iter().enumerate() {
                let (queue, done) = (&queue, done.clone());
                scope.spawn(move || {
                    let mut turn = queue.turn(priority, unit(2), &mut || false).unwrap();
                    done.send(name).unwrap();
                    assert!(turn.let_pass(&mut || false));
                });
                wait_for(queue, count + 1);
            }
            assert!(first.let_pass(&mut || false));
            done.send("first").unwrap();
            drop(first);
        });
        assert_eq!(order.try_iter().collect::<Vec<_>>(), ["stop", "first", "write"]);
    }

    #[test]
    fn who_gives_up_while_others_pass_has_lost_its_turn() {
        let queue = Queue::default();
        let ((passes, it_passes), (leave, stop_may_end)) = (mpsc::channel(), mpsc::channel());
        let mut first = queue.turn(Read, unit(1), &mut || false).unwrap();
        thread::scope(|scope| {
            let queue = &queue;
            scope.spawn(move || {
                let _turn = queue.turn(Stop, unit(2), &mut || false);
                passes.send(()).unwrap();
                stop_may_end.recv().unwrap();
            });
            wait_for(queue, 1);
            let leave = leave; // goes with this, should it fail
            // Given up only when the stop has the line, however late its thread wakes up.
            assert!(!first.let_pass(&mut || it_passes.recv().is_ok()));
            assert!(queue.lock().order.is_empty());
            // The stop still has the line.
            drop(first);
            assert!(queue.lock().owner.is_some());
            leave.send(()).unwrap();
        });
        assert!(queue.lock().owner.is_none());
    }

    #[test]
    fn who_waits_looks_up_though_it_is_called_all_the_time() {
        let queue = Queue::default();
        let first = queue.turn(Read, unit(1), &mut || false).unwrap();
        thread::scope(|scope| {
            let queue = &queue;
            let waiter = scope.spawn(move || assert!(queue.turn(Read, unit(1), &mut || true).is_err()));
            // Ends only when the one who waits has given up.
            while !waiter.is_finished() {
                waiter.thread().unpark();
                thread::yield_now();
            }
        });
        drop(first);
    }

    #[test]
    fn who_gives_up_leaves_no_gap() {
        let queue = Queue::default();
        let first = queue.turn(Read, unit(1), &mut || false).unwrap();
        thread::scope(|scope| {
            scope.spawn(|| assert_eq!(queue.turn(Stop, unit(1), &mut || true).unwrap_err(), NoTurn::GivenUp));
        });
        drop(first);
        assert!(queue.turn(Read, unit(1), &mut || true).is_ok());
    }

    #[test]
    fn who_was_called_and_gives_up_calls_the_next() {
        let queue = Queue::default();
        let first = queue.turn(Read, unit(1), &mut || false).unwrap();
        let elsewhere = thread::spawn(|| ()).thread().clone();
        let waits = |priority, thread| {
            let mut state = queue.lock();
            let ticket = state.order.ticket(priority, unit(1));
            state.order.wait(ticket, Waiter::Thread(thread));
            Turn { queue: &queue, ticket, of_crew: false }
        };
        let (called, next) = (waits(Write, elsewhere), waits(Read, thread::current()));
        drop(first);
        thread::park_timeout(Duration::ZERO);
        drop(called);
        thread::park(); // returns because this thread was called
        assert!(next.comes(&mut || panic!("it is next")));
    }

    #[test]
    fn who_panics_leaves_its_place() {
        let queue = Queue::default();
        let first = queue.turn(Read, unit(1), &mut || false).unwrap();
        let panicked =
            thread::scope(|scope| scope.spawn(|| queue.turn(Read, unit(1), &mut || panic!("asked")).is_ok()).join());
        assert!(panicked.is_err());
        assert!(queue.lock().order.is_empty());
        drop(first);
    }

    #[test]
    fn a_thread_is_known_while_it_waits_and_while_it_has_the_turn() {
        let queue = Queue::default();
        assert!(!queue.has_this_thread());
        let mut first = queue.turn(Read, unit(1), &mut || false).unwrap();
        assert!(queue.has_this_thread());
        let again = queue.turn(Read, unit(1), &mut || panic!("it would wait for itself"));
        assert_eq!(again.unwrap_err(), NoTurn::OwnThread);
        thread::scope(|scope| {
            let queue = &queue;
            scope.spawn(move || {
                assert!(!queue.has_this_thread());
                let mut seen = false;
                let turn = queue.turn(Stop, unit(2), &mut || {
                    seen = queue.has_this_thread();
                    true
                });
                assert!(turn.is_err() && seen);
            });
        });
        assert!(first.let_pass(&mut || false));
        drop(first);
        assert!(!queue.has_this_thread());
    }
}
