//! Calls as futures, for any executor: what is dropped before it was sent was never asked.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "shared/tapped.rs"]
mod tapped;

use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use drivebus::drive::Looks;
use drivebus::drive::task::{Mailbox, Task};
use drivebus::drives::State;
use drivebus::sim::{Options, Simulator};
use drivebus::{Bus, Error, ErrorKind, Profile, Reading, Target, aio};

const ACCELERATION: u16 = 0x800B; // P00.11 in RAM

/// Runs `test` while somebody else has the line; what it returns is seen when the line is free again.
fn while_taken<T>(test: impl FnOnce(&aio::Bus) -> T) -> (T, aio::Bus, Simulator) {
    let simulator = Simulator::new([(1, "gd350")], Options::default()).unwrap();
    let (has_begun, begun) = channel();
    let (let_go, told) = channel();
    let mut first = Some((has_begun, told));
    let bus = tapped::open(&simulator, move |_| {
        if let Some((has_begun, let_go)) = first.take() {
            has_begun.send(()).unwrap();
            let_go.recv().unwrap();
        }
    });
    let other = bus.clone();
    let taken = std::thread::spawn(move || other.read(1, 0x2103, 1).unwrap());
    begun.recv().unwrap();
    let made = test(&bus.aio());
    let_go.send(()).unwrap();
    assert_eq!(taken.join().unwrap(), [0x01A0]);
    (made, bus.aio(), simulator)
}

fn poll_once<T>(future: Pin<&mut (impl Future<Output = T> + ?Sized)>) -> Poll<T> {
    future.poll(&mut Context::from_waker(Waker::noop()))
}

fn writes(simulator: &Simulator) -> Vec<u16> {
    simulator.drive(1).unwrap().writes().iter().map(|write| write.value).collect()
}

#[tokio::test]
async fn what_is_dropped_while_it_waits_is_taken_back() {
    let (kept, bus, simulator) = while_taken(|bus| {
        let mut dropped = Box::pin(bus.write(1, ACCELERATION, 1));
        let mut kept = Box::pin(bus.write(1, ACCELERATION, 2));
        assert!(poll_once(dropped.as_mut()).is_pending());
        assert!(poll_once(kept.as_mut()).is_pending());
        drop(dropped);
        kept
    });
    kept.await.unwrap();
    assert_eq!(bus.read(1, 0x000B, 1).await.unwrap(), [2]);
    assert_eq!(writes(&simulator), [2], "the other one was never sent");
}

#[tokio::test]
async fn nothing_is_asked_before_it_is_awaited() {
    let ((), bus, simulator) = while_taken(|bus| drop(bus.write(1, ACCELERATION, 1)));
    let unasked = bus.write(1, ACCELERATION, 2);
    assert_eq!(bus.read(1, 0x2103, 1).await.unwrap(), [0x01A0]);
    assert_eq!(writes(&simulator), []);
    unasked.await.unwrap();
    assert_eq!(writes(&simulator), [2]);
}

#[tokio::test]
async fn a_time_out_of_the_executor_takes_the_call_back() {
    let ((), bus, simulator) = while_taken(|bus| {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        let bus = bus.clone();
        std::thread::spawn(move || {
            let late = async { tokio::time::timeout(Duration::from_millis(1), bus.write(1, ACCELERATION, 1)).await };
            assert!(runtime.block_on(late).is_err());
        })
        .join()
        .unwrap();
    });
    bus.read(1, 0x2103, 1).await.unwrap();
    assert_eq!(writes(&simulator), []);
}

#[tokio::test]
async fn the_calls_are_those_of_the_blocking_bus() {
    let bus = aio::Bus::open("sim://1=gd350,2=vfd500?clock=virtual&seed=1").await.unwrap();
    let (first, second) = tokio::join!(bus.read(1, 0x2103, 1), bus.echo(2));
    assert_eq!(first.unwrap(), [0x01A0]);
    assert!(!second.unwrap().is_zero());
    bus.write(1, ACCELERATION, [5, 6]).await.unwrap();
    bus.broadcast(ACCELERATION, 7).await.unwrap();
    assert_eq!(bus.transact(1, &[0x03, 0x00, 0x0B, 0x00, 0x02], None).await.unwrap(), [0x03, 0x04, 0, 7, 0, 6]);
    let gd350 = Profile::builtin("gd350").unwrap();
    let reading = Reading::new(&gd350, ["output_current"]).unwrap();
    assert_eq!(bus.values(1, &reading).await.unwrap().get("output_current").unwrap().to_string(), "0.0");
    let poll = bus.poll([Target::values(1, &reading)], Duration::from_secs(1)).unwrap();
    for _ in 0..3 {
        assert!(poll.next().await.unwrap().words().is_ok());
    }
    poll.stop();
    while poll.next().await.is_some() {}
    let refused = bus.read(0, 0, 1).await.unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::NotAllowed);
    bus.close().await.unwrap();
    assert_eq!(bus.read(1, 0, 1).await.unwrap_err().kind(), ErrorKind::Port);
    assert_eq!(aio::Bus::open("sim://gd360").await.unwrap_err().kind(), ErrorKind::NotAllowed);
}

#[tokio::test]
async fn a_poll_in_real_time_wakes_who_waits() {
    let bus = aio::Bus::open("sim://gd350").await.unwrap();
    let poll = bus.poll([Target::words(1, [(0x2100, 1)])], None).unwrap();
    for _ in 0..3 {
        assert_eq!(poll.next().await.unwrap().words().unwrap(), [3]);
    }
}

#[test]
fn a_call_is_a_future_that_may_go_anywhere() {
    fn anywhere<T: Send + 'static>(_: &T) {}
    let bus = Bus::open("sim://gd350?clock=virtual").unwrap().aio();
    anywhere(&bus.read(1, 0x2103, 1));
    anywhere(&bus.write(1, ACCELERATION, vec![1]));
    anywhere(&async move { bus.identify(1).await });
}

#[tokio::test]
async fn operations_are_futures_too() {
    let bus = aio::Bus::open("sim://1=gd350,2=vfd500?clock=virtual&seed=1").await.unwrap();
    let (first, second) = tokio::join!(bus.identify(1), bus.identify(2));
    assert_eq!(first.unwrap(), bus.blocking().identify(1).unwrap());
    assert_eq!(second.unwrap(), bus.blocking().identify(2).unwrap());
    let looks = Arc::new(Looks::new(&Profile::builtin("gd350").unwrap(), false));
    let look = bus.look(1, &looks).await.unwrap();
    assert_eq!(look.state, State::Stopped);
    assert!(!look.asked.is_zero());
    assert_eq!(bus.identify(9).await.unwrap_err().kind(), ErrorKind::NoAnswer);
    assert_eq!(bus.identify(0).await.unwrap_err().kind(), ErrorKind::NotAllowed);
    let slept = bus.carry_out(Task::new(async |line: Mailbox<Error>| {
        let began = line.now();
        line.sleep(Duration::from_secs(2)).await?;
        Ok(line.now().saturating_duration_since(began))
    }));
    assert!(slept.await.unwrap() >= Duration::from_secs(2));
}
