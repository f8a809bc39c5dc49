//! A motor that was started by a guard is stopped however the guard ends, and a halt wins over a start, whenever it is given.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "shared/plant.rs"]
mod plant;
#[path = "shared/tapped.rs"]
mod tapped;

use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Waker};

use drivebus::drives::Command;
use drivebus::sim::{Asked, Refusals};
use drivebus::{Drive, Error, ErrorKind, Start};

use plant::Plant;

/// Families of four makers; the last one is started by several words.
const FAMILIES: [&str; 5] = ["gd350", "vfd500", "ms300", "wj200", "acs355"];

fn poll_once<T>(future: Pin<&mut (impl Future<Output = T> + ?Sized)>) -> Poll<T> {
    future.poll(&mut Context::from_waker(Waker::noop()))
}

#[test]
fn a_guard_that_is_stopped_tells_so() {
    for family in FAMILIES {
        let plant = Plant::of(family);
        let running = plant.drive.running(10.0).unwrap_or_else(|error| panic!("{family}: {error}"));
        assert_eq!(running.unit(), 1);
        assert!(plant.turns("forward", 10.0), "{family}");
        running.stop().unwrap_or_else(|error| panic!("{family}: {error}"));
        assert!(plant.stands(), "{family}");
    }
}

#[test]
fn a_guard_that_is_dropped_stops_the_motor() {
    for family in FAMILIES {
        let plant = Plant::of(family);
        let running = plant.drive.running(10.0).unwrap();
        running.set_frequency(20.0).unwrap();
        assert!(plant.turns("forward", 20.0), "{family}");
        drop(running);
        assert!(plant.stands(), "{family}");
    }
}

#[test]
fn a_panic_and_an_early_return_stop_the_motor() {
    fn early(drive: &Drive) -> Result<(), Error> {
        let running = drive.running(10.0)?;
        running.set_frequency(1e9)?;
        running.stop()
    }
    let plant = Plant::of("gd350");
    assert_eq!(early(&plant.drive).unwrap_err().kind(), ErrorKind::NotAllowed);
    assert!(plant.stands());
    let panicked = catch_unwind(AssertUnwindSafe(|| {
        let _running = plant.drive.running(10.0).unwrap();
        assert!(plant.turns("forward", 10.0));
        panic!("as a program may");
    }));
    assert!(panicked.is_err());
    assert!(plant.stands());
}

/// GD350 manual V1.4, table of commands: 3 jogs, 8 ends a jog, 6 coasts.
#[test]
fn a_jog_is_ended_as_a_jog() {
    let plant = Plant::of("gd350");
    let jogging = plant.drive.running_with(&Start::jog(false)).unwrap();
    assert!(plant.turns("forward", 5.0));
    drop(jogging);
    assert!(plant.stands());
    assert_eq!((plant.sent(Command::JogStop), plant.sent(Command::Stop)), (1, 0));
}

#[test]
fn a_stop_that_is_not_taken_is_a_coast_each_fourth_time() {
    let plant = Plant::of("gd350");
    let running = plant.drive.running(10.0).unwrap();
    assert!(plant.turns("forward", 10.0));
    plant.simulated().refuse(Refusals::new(0x04).of(Asked::Writes).count(3)).unwrap();
    running.stop().unwrap();
    assert_eq!((plant.sent(Command::Stop), plant.sent(Command::Coast)), (3, 1));
    assert!(plant.stands());
}

/// A drive that takes each stop and goes on, as one does that somebody else commands as well: a coast is all that is left.
#[test]
fn a_stop_that_is_taken_and_not_shown_is_a_coast_in_the_end() {
    let plant = Plant::of("gd350");
    let running = plant.drive.running(10.0).unwrap();
    assert!(plant.turns("forward", 10.0));
    let (simulated, (place, _)) = (plant.simulated(), plant.profile.command(Command::Stop).unwrap());
    // P00.01: from now on its keypad commands it, and the bus is acknowledged only.
    simulated.set_parameter(0x0001, 0).unwrap();
    let error = running.stop().unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Unconfirmed, true), "{error}");
    assert_eq!((plant.sent(Command::Stop), plant.sent(Command::Coast)), (3, 1), "{place}");
}

#[test]
fn a_start_of_which_nothing_is_known_is_halted_before_the_error_comes() {
    for family in ["gd350", "vfd500", "ms300"] {
        let plant = Plant::of(family);
        let (wire, profile) = (plant.simulator.wire(), Arc::clone(&plant.profile));
        let (place, word) = profile.command(Command::RunForward).unwrap();
        let run = word.to_be_bytes();
        plant.tap(move |frame| {
            let starts = frame[2..4] == place.address.to_be_bytes() && frame[1] != 0x03;
            if starts && (frame[4..6] == run || frame.get(7..9) == Some(&run)) {
                wire.drop_answers(1);
            }
        });
        let error = plant.drive.running(10.0).unwrap_err();
        assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Unconfirmed, true), "{family}: {error}");
        assert!(error.to_string().ends_with(". It was stopped then"), "{family}: {error}");
        assert_eq!(plant.sent(Command::RunForward), 1, "{family}");
        assert!(plant.stands(), "{family}");
    }
}

#[test]
fn a_guard_whose_start_was_not_sent_leaves_alone_what_runs() {
    let plant = Plant::of("gd350");
    plant.drive.run(10.0).unwrap();
    assert_eq!(plant.drive.running(50.5).unwrap_err().kind(), ErrorKind::NotAllowed);
    assert!(plant.turns("forward", 10.0));
    assert_eq!(plant.sent(Command::Stop), 0);
}

#[test]
fn a_guard_on_a_closed_bus_says_so_and_does_not_panic() {
    let plant = Plant::of("gd350");
    let running = plant.drive.running(10.0).unwrap();
    let other = plant.drive.running(10.0).unwrap();
    plant.bus.close();
    let error = running.stop().unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Port, false), "{error}");
    drop(other);
}

/// Runs the motor, with a stop from another handle before the `nth` frame of that. Returns what came of the start, and
/// whether there were so many frames.
fn stopped_before(family: &str, nth: usize, given: impl Fn(&Drive) -> Given) -> (Result<(), Error>, bool, Plant) {
    let plant = Plant::of(family);
    // A unit that has not said what it is is asked for that before its stop.
    assert!(plant.drive.contradiction().unwrap().is_none());
    let (other, stop) = (plant.bus.drive(1, &plant.profile).unwrap().unverified(), Arc::new(Mutex::new(None)));
    let (given, kept, mut frames) = (given(&other), Arc::clone(&stop), 0);
    let mut given = Some(given);
    plant.tap(move |_| {
        if frames == nth
            && let Some(mut stop) = given.take()
        {
            // It stands in the queue of the line then, before all others.
            assert!(poll_once(stop.as_mut()).is_pending());
            *kept.lock().unwrap() = Some(stop);
        }
        frames += 1;
    });
    let started = plant.drive.run(10.0);
    let stop = stop.lock().unwrap().take();
    let was_given = stop.is_some();
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    if let Some(stop) = stop {
        runtime.block_on(stop).unwrap();
    }
    (started, was_given, plant)
}

type Given = Pin<Box<dyn Future<Output = Result<(), Error>> + Send>>;

#[test]
fn a_halt_wins_over_a_start_whenever_it_is_given() {
    for family in FAMILIES {
        let (mut taken_back, mut stopped) = (0, 0);
        for nth in 0.. {
            let stop = |other: &Drive| -> Given {
                let other = other.aio();
                Box::pin(async move { other.stop().await })
            };
            let (started, was_given, plant) = stopped_before(family, nth, stop);
            if !was_given {
                assert!(plant.turns("forward", 10.0), "{family}");
                break;
            }
            match started {
                Err(ref error) if !error.may_have_acted() => taken_back += 1,
                _ => stopped += 1,
            }
            assert!(plant.stands(), "{family}, before frame {nth}: {started:?}");
        }
        assert!(taken_back > 0 && stopped > 0, "{family}: {taken_back}, {stopped}");
    }
}

#[tokio::test]
async fn a_guard_is_awaited_too() {
    for family in FAMILIES {
        let plant = Plant::of(family);
        let drive = plant.drive.aio();
        let running = drive.running(10.0).await.unwrap();
        running.set_frequency(20.0).await.unwrap();
        assert!(plant.turns("forward", 20.0), "{family}");
        running.stop().await.unwrap();
        assert!(plant.stands(), "{family}");
        let running = drive.running(10.0).await.unwrap();
        assert!(plant.turns("forward", 10.0), "{family}");
        drop(running);
        assert!(plant.stands(), "{family}");
        let refused = drive.running(1e9).await.unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::NotAllowed, "{family}");
    }
}

/// A future of a start, and one of a stop, dropped after each of their steps.
#[test]
fn a_future_that_is_dropped_leaves_no_motor_running() {
    for steps in 1..60 {
        let plant = Plant::of("gd350");
        let drive = plant.drive.aio();
        let mut program = Box::pin(async {
            let running = drive.running(10.0).await?;
            running.stop().await
        });
        let is_over = (0..steps).any(|_| {
            let polled = poll_once(program.as_mut());
            // What it waits for is done by another thread, which a call that waits its turn outlasts.
            plant.bus.read(1, 0x2103, 1).unwrap();
            polled.is_ready()
        });
        drop(program);
        assert!(plant.stands(), "after {steps} steps");
        if is_over {
            return;
        }
    }
}
