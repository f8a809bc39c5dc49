//! Threads that wait for their turn, and the one that has it.

use std::sync::mpsc;
use std::time::Duration;

use drivebus_rtu::UnitAddress;

use super::*;

use Priority::{Poll, Read, Stop, Write};

/// A queue in which no work is left.
type Queue = super::Queue<()>;

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
    let first = queue.turn((Read, unit(1)), &mut || false).unwrap();
    thread::scope(|scope| {
        let callers = [(Poll, 1), (Read, 1), (Read, 1), (Stop, 1), (Read, 2), (Write, 1), (Stop, 3)];
        for (number, (priority, raw)) in callers.into_iter().enumerate() {
            let (queue, done) = (&queue, done.clone());
            scope.spawn(move || {
                let _turn = queue.turn((priority, unit(raw)), &mut || false);
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
fn a_full_queue_takes_nobody_but_a_stop_and_who_had_a_turn() {
    let queue = &Queue::with_room(1);
    let first = queue.turn((Read, unit(1)), &mut || false).unwrap();
    thread::scope(|scope| {
        let waits = |priority| move || drop(queue.turn((priority, unit(2)), &mut || false).unwrap());
        scope.spawn(waits(Read));
        wait_for(queue, 1);
        for priority in [Write, Read, Poll] {
            let refused = scope.spawn(move || queue.turn((priority, unit(2)), &mut || false).map(drop));
            assert_eq!(refused.join().unwrap(), Err(NoTurn::Full));
        }
        scope.spawn(waits(Stop));
        wait_for(queue, 2);
        scope.spawn(|| drop(queue.turn_again((Poll, unit(3)), &mut || false).unwrap()));
        wait_for(queue, 3);
        drop(first);
    });
    assert_eq!(queue.turn((Read, unit(1)), &mut || false).map(drop), Ok(()), "there is room again");
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
                    let mut turn = queue.turn((priority, unit(raw)), &mut || false).unwrap();
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
    let mut first = queue.turn((Poll, unit(1)), &mut || false).unwrap();
    assert!(first.let_pass(&mut || panic!("nobody is there")));
    thread::scope(|scope| {
        for (count, (name, priority)) in [("write", Write), ("stop", Stop)].into_iter().enumerate() {
            let (queue, done) = (&queue, done.clone());
            scope.spawn(move || {
                let mut turn = queue.turn((priority, unit(2)), &mut || false).unwrap();
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
    let mut first = queue.turn((Read, unit(1)), &mut || false).unwrap();
    thread::scope(|scope| {
        let queue = &queue;
        scope.spawn(move || {
            let _turn = queue.turn((Stop, unit(2)), &mut || false);
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
    let first = queue.turn((Read, unit(1)), &mut || false).unwrap();
    thread::scope(|scope| {
        let queue = &queue;
        let waiter = scope.spawn(move || assert!(queue.turn((Read, unit(1)), &mut || true).is_err()));
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
    let first = queue.turn((Read, unit(1)), &mut || false).unwrap();
    thread::scope(|scope| {
        scope.spawn(|| assert_eq!(queue.turn((Stop, unit(1)), &mut || true).unwrap_err(), NoTurn::GivenUp));
    });
    drop(first);
    assert!(queue.turn((Read, unit(1)), &mut || true).is_ok());
}

#[test]
fn who_was_called_and_gives_up_calls_the_next() {
    let queue = Queue::default();
    let first = queue.turn((Read, unit(1)), &mut || false).unwrap();
    let elsewhere = thread::spawn(|| ()).thread().clone();
    let waits = |priority, thread| {
        let mut state = queue.lock();
        let ticket = state.order.ticket((priority, unit(1)).into());
        state.wait(ticket, Waiter::Thread(thread));
        Turn { queue: &queue, ticket }
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
    let first = queue.turn((Read, unit(1)), &mut || false).unwrap();
    let panicked =
        thread::scope(|scope| scope.spawn(|| queue.turn((Read, unit(1)), &mut || panic!("asked")).is_ok()).join());
    assert!(panicked.is_err());
    assert!(queue.lock().order.is_empty());
    drop(first);
}

#[test]
fn a_thread_is_known_while_it_waits_and_while_it_has_the_turn() {
    let queue = Queue::default();
    assert!(!queue.has_this_thread());
    let mut first = queue.turn((Read, unit(1)), &mut || false).unwrap();
    assert!(queue.has_this_thread());
    let again = queue.turn((Read, unit(1)), &mut || panic!("it would wait for itself"));
    assert_eq!(again.unwrap_err(), NoTurn::OwnThread);
    thread::scope(|scope| {
        let queue = &queue;
        scope.spawn(move || {
            assert!(!queue.has_this_thread());
            let mut seen = false;
            let turn = queue.turn((Stop, unit(2)), &mut || {
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
