//! Whose turn it is: one owner of the line at a time, in the order they came; a stop overtakes those who wait.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};
use std::time::Duration;

use crate::clock::monotonic;

/// How often somebody who waits looks up to see whether it should still wait.
pub(crate) const LOOK_UP: Duration = Duration::from_millis(50);

/// A queue at the line. The calling thread itself works on the line when its turn comes, so that a lone caller pays
/// for no hand-over.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    waiting: Mutex<Waiting>,
    moved: Condvar,
}

#[derive(Debug, Default)]
struct Waiting {
    next: u64,
    /// The first is the one whose turn it is.
    order: VecDeque<Ticket>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Ticket {
    number: u64,
    urgent: bool,
    thread: ThreadId,
}

/// The right to use the line, until it is dropped.
#[derive(Debug)]
pub(crate) struct Turn<'a> {
    queue: &'a Queue,
    ticket: Ticket,
}

impl Queue {
    /// Waits for a turn; `None` when `give_up` says so before it comes.
    ///
    /// Who is `urgent` comes before all who wait and are not, but not before the one whose turn it is.
    pub(crate) fn turn(&self, urgent: bool, give_up: &mut dyn FnMut() -> bool) -> Option<Turn<'_>> {
        let mut waiting = self.lock();
        let ticket = Ticket { number: waiting.next, urgent, thread: thread::current().id() };
        waiting.next += 1;
        let place = match waiting.order.iter().skip(1).position(|other| urgent && !other.urgent) {
            Some(behind_the_owner) => 1 + behind_the_owner,
            None => waiting.order.len(),
        };
        waiting.order.insert(place, ticket);
        let turn = Turn { queue: self, ticket };
        // Turns that pass wake everybody, so that time alone says when to look up.
        let mut look_up = monotonic() + LOOK_UP;
        while waiting.order.front() != Some(&ticket) {
            let left = look_up.saturating_duration_since(monotonic());
            waiting = self.moved.wait_timeout(waiting, left).unwrap_or_else(PoisonError::into_inner).0;
            if monotonic() >= look_up {
                look_up = monotonic() + LOOK_UP;
                // The caller may need locks of its own to answer.
                drop(waiting);
                if give_up() {
                    return None;
                }
                waiting = self.lock();
            }
        }
        Some(turn)
    }

    /// Whether this thread stands in the queue already, and would wait for itself: inside a question of [`turn`](Self::turn)
    /// or of the owner's, which may run a signal handler of the caller's.
    pub(crate) fn has_this_thread(&self) -> bool {
        let this = thread::current().id();
        self.lock().order.iter().any(|ticket| ticket.thread == this)
    }

    /// A thread that panicked cannot have left the order inconsistent: every change is one call.
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        let mut waiting = self.queue.lock();
        waiting.order.retain(|&ticket| ticket != self.ticket);
        let others = !waiting.order.is_empty();
        drop(waiting);
        if others {
            self.queue.moved.notify_all();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    #[test]
    fn turns_come_in_the_order_of_arrival_but_for_the_urgent() {
        let queue = Queue::default();
        let (done, order) = mpsc::channel();
        let first = queue.turn(false, &mut || false).unwrap();
        thread::scope(|scope| {
            for (number, urgent) in [false, false, true, false, true].into_iter().enumerate() {
                let (queue, done) = (&queue, done.clone());
                scope.spawn(move || {
                    let _turn = queue.turn(urgent, &mut || false);
                    done.send(number).unwrap();
                });
                // The next one comes only when this one stands in the queue.
                while queue.lock().order.len() < number + 2 {
                    thread::yield_now();
                }
            }
            drop(first);
        });
        assert_eq!(order.try_iter().collect::<Vec<_>>(), [2, 4, 0, 1, 3]);
    }

    #[test]
    fn who_waits_looks_up_though_turns_pass_all_the_time() {
        let queue = Queue::default();
        let first = queue.turn(false, &mut || false).unwrap();
        let (gave_up, passing) = mpsc::channel();
        thread::scope(|scope| {
            let queue = &queue;
            scope.spawn(move || {
                assert!(queue.turn(false, &mut || true).is_none());
                gave_up.send(()).unwrap();
            });
            // Ends only when the one who waits has given up.
            while passing.try_recv() == Err(mpsc::TryRecvError::Empty) {
                queue.moved.notify_all();
                thread::yield_now();
            }
        });
        drop(first);
    }

    #[test]
    fn who_gives_up_leaves_no_gap() {
        let queue = Queue::default();
        let first = queue.turn(false, &mut || false).unwrap();
        assert!(queue.turn(false, &mut || true).is_none());
        drop(first);
        assert!(queue.turn(false, &mut || true).is_some());
    }
}
