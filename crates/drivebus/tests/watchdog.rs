//! The drive's own time-out: what is set, what is given back, and when the drive is left to act.
//!
//! In virtual time, and with time-outs so long that the thread, which keeps real time, never wakes up; but where it is what the
//! test is about. P14.04 and P14.05 of a GD350: GD300 manual, p. 122.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "shared/plant.rs"]
mod plant;
#[path = "shared/tapped.rs"]
mod tapped;

use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex};
use std::task::{Context, Wake, Waker};
use std::time::Duration;

use drivebus::drives::Command;
use drivebus::sim::{Asked, Refusals};
use drivebus::{Drive, Error, ErrorKind, OnSilence, State};

use plant::Plant;

const TIMEOUT: u16 = 0x0E04;
const ACTION: u16 = 0x0E05;
const RAM: u16 = 0x8000;

/// Fault 18 of a GD350: CE, communication.
const CE: u16 = 18;

const LONG: Duration = Duration::from_secs(40);

/// A GD350 that trips for 2 of P14.05, and has no time-out.
fn gd350() -> Plant {
    let plant = Plant::of("gd350");
    plant.simulated().set_parameter(ACTION, 2).unwrap();
    plant.simulated().take_writes();
    plant
}

/// What the drive has as its time-out, and its action.
fn has(plant: &Plant) -> (u16, u16) {
    let drive = plant.simulated();
    (drive.register(TIMEOUT).unwrap(), drive.register(ACTION).unwrap())
}

#[test]
fn it_is_set_in_ram_action_first_and_given_back_time_out_first() {
    let plant = gd350();
    let watchdog = plant.drive.watchdog(Duration::from_secs(30), OnSilence::Stop).unwrap();
    assert_eq!((has(&plant), watchdog.armed(), watchdog.error()), ((300, 3), true, None));
    assert_eq!((watchdog.timeout(), watchdog.action()), (Duration::from_secs(30), OnSilence::Stop));
    watchdog.close().unwrap();
    let writes = plant.simulated().take_writes();
    let taken: Vec<_> = writes.iter().map(|write| (write.address, write.value)).collect();
    assert_eq!(taken, [(RAM | ACTION, 3), (RAM | TIMEOUT, 300), (RAM | TIMEOUT, 0), (RAM | ACTION, 2)]);
    assert_eq!(plant.simulated().eeprom_writes(), 0);
}

#[test]
fn a_guard_that_is_dropped_gives_back_what_the_drive_had() {
    fn early(drive: &Drive) -> Result<(), Error> {
        let watchdog = drive.watchdog(LONG, OnSilence::Coast)?;
        drive.set_frequency(1e9)?;
        watchdog.close()
    }
    let plant = gd350();
    let watchdog = plant.drive.watchdog(LONG, OnSilence::Coast).unwrap();
    assert_eq!(has(&plant), (400, 0));
    drop(watchdog);
    assert_eq!(has(&plant), (0, 2));
    assert_eq!(early(&plant.drive).unwrap_err().kind(), ErrorKind::NotAllowed);
    assert_eq!(has(&plant), (0, 2));
    let panicked = catch_unwind(AssertUnwindSafe(|| {
        let _watchdog = plant.drive.watchdog(LONG, OnSilence::Coast).unwrap();
        panic!("as a program may");
    }));
    assert!(panicked.is_err());
    assert_eq!(has(&plant), (0, 2));
}

#[test]
fn one_inside_another_gives_back_what_the_other_set() {
    let plant = gd350();
    let outer = plant.drive.watchdog(LONG, OnSilence::Coast).unwrap();
    let inner = plant.drive.watchdog(Duration::from_secs(30), OnSilence::Stop).unwrap();
    assert_eq!(has(&plant), (300, 3));
    inner.close().unwrap();
    assert_eq!(has(&plant), (400, 0));
    outer.close().unwrap();
    assert_eq!(has(&plant), (0, 2));
}

#[test]
fn a_motor_that_slows_down_is_waited_for() {
    let plant = gd350();
    plant.drive.write("P00.12", 100.0).unwrap(); // seconds from 50 Hz
    let watchdog = plant.drive.watchdog(LONG, OnSilence::Coast).unwrap();
    let running = plant.drive.running(10.0).unwrap();
    assert!(plant.bus.now().as_nanos() > 0);
    plant.bus.sleep(Duration::from_secs(30)); // it runs up
    running.stop().unwrap();
    assert_eq!(plant.drive.status().unwrap().state, State::Forward, "it proved that it slows down");
    watchdog.close().unwrap();
    assert_eq!((plant.simulated().state(), has(&plant)), ("stopped", (0, 2)));
    assert!(plant.stands());
    assert_eq!(plant.simulated().fault(), 0);
}

#[test]
fn a_motor_that_goes_on_is_left_to_the_drive() {
    for is_closed in [true, false] {
        let plant = gd350();
        let watchdog = plant.drive.watchdog(LONG, OnSilence::Coast).unwrap();
        plant.drive.run(10.0).unwrap();
        plant.bus.sleep(Duration::from_secs(30));
        if is_closed {
            let error = watchdog.close().unwrap_err();
            assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::NotAllowed, false), "{error}");
            let says = "watchdog of unit 1: its motor goes on turning. It keeps its time-out: after 40 s without a request it will coast";
            assert_eq!(error.to_string(), says);
        } else {
            drop(watchdog);
        }
        assert_eq!(has(&plant), (400, 0));
        plant.simulator.advance(Duration::from_secs(39)).unwrap();
        assert_eq!(plant.simulated().state(), "forward");
        plant.simulator.advance(Duration::from_secs(2)).unwrap();
        assert_eq!((plant.simulated().state(), plant.simulated().fault()), ("fault", CE));
    }
}

#[test]
fn what_the_drive_does_not_have_is_refused_before_anything_is_sent() {
    let refused = |plant: &Plant, timeout, action, says: &str| {
        let error = plant.drive.watchdog(timeout, action).unwrap_err();
        assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::NotAllowed, false), "{error}");
        assert!(error.to_string().starts_with("watchdog of unit 1: ") && error.to_string().contains(says), "{error}");
        assert_eq!(plant.simulator.wire().requests(), 0);
    };
    let gd350 = Plant::of("gd350");
    for timeout in [Duration::ZERO, Duration::from_millis(60_100), Duration::MAX] {
        refused(&gd350, timeout, OnSilence::Coast, "allowed is more than 0 to 60.0");
    }
    refused(&gd350, Duration::from_millis(250), OnSilence::Coast, "P14.04");
    refused(&gd350, LONG, OnSilence::Trip, "it cannot trip by itself; it can coast, stop");
    refused(&Plant::of("gd600"), LONG, OnSilence::Coast, "no time-out of the bus of this family is known");
    refused(
        &Plant::as_it_comes("gd3000-rectifier"),
        LONG,
        OnSilence::Coast,
        "no way to write P11.04 to RAM alone is known",
    );
    let printed = gd350.bus.drive(1, &gd350.profile).unwrap();
    let error = printed.watchdog(LONG, OnSilence::Coast).unwrap_err();
    assert!(error.to_string().contains("no document of this family proves its time-out of the bus: "), "{error}");
}

#[test]
fn a_drive_that_does_not_take_it_has_what_it_had() {
    for taken in 0..2 {
        let plant = gd350();
        let (simulated, mut writes) = (plant.simulated(), 0);
        plant.tap(move |frame| {
            if frame[1] == 0x06 {
                if writes == taken {
                    simulated.refuse(Refusals::new(0x04).of(Asked::Writes).count(1)).unwrap();
                }
                writes += 1;
            }
        });
        let error = plant.drive.watchdog(LONG, OnSilence::Coast).unwrap_err();
        assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Refused, false), "{error}");
        assert!(error.to_string().ends_with("; it has back what it had"), "{error}");
        assert_eq!(has(&plant), (0, 2));
    }
}

#[test]
fn a_drive_that_is_gone_half_way_may_act() {
    let plant = gd350();
    let wire = plant.simulator.wire();
    plant.tap(move |frame| {
        if frame[1] == 0x06 && frame[2..4] == (RAM | TIMEOUT).to_be_bytes() {
            wire.drop_answers(1000);
        }
    });
    let error = plant.drive.watchdog(LONG, OnSilence::Coast).unwrap_err();
    assert!(error.may_have_acted(), "{error}");
    assert!(error.to_string().contains("what it had could not be given back"), "{error}");
}

#[test]
fn one_that_cannot_be_asked_is_left_to_the_drive() {
    let plant = gd350();
    let watchdog = plant.drive.watchdog(LONG, OnSilence::Coast).unwrap();
    plant.simulator.wire().drop_answers(1000);
    let error = watchdog.close().unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::NoAnswer, false), "{error}");
    assert!(
        error.to_string().ends_with("It keeps its time-out: after 40 s without a request it will coast"),
        "{error}"
    );
    plant.simulator.wire().clear();
    assert_eq!(has(&plant), (400, 0));
}

/// It asks each 25 ms of real time, so that the line says when: nothing here waits for a time.
#[test]
fn its_thread_asks_again_and_again_and_says_what_went_wrong() {
    let plant = gd350();
    let watchdog = plant.drive.watchdog(Duration::from_millis(100), OnSilence::Coast).unwrap();
    let (ask, asked) = channel();
    plant.tap(move |frame| ask.send(frame.to_vec()).unwrap_or_default());
    for _ in 0..5 {
        assert_eq!(asked.recv().unwrap()[..6], [0x01, 0x03, 0x21, 0x00, 0x00, 0x01]);
    }
    assert_eq!(watchdog.error(), None);
    plant.simulator.wire().drop_answers(20);
    while watchdog.error().is_none() {
        asked.recv().unwrap();
    }
    assert_eq!(watchdog.error().unwrap().kind(), ErrorKind::NoAnswer);
    plant.simulator.wire().clear();
    for _ in 0..5 {
        asked.recv().unwrap();
    }
    plant.bus.close();
    let error = watchdog.close().unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Port, false), "{error}");
}

#[tokio::test]
async fn it_is_awaited_too() {
    let plant = gd350();
    let drive = plant.drive.aio();
    let watchdog = drive.watchdog(LONG, OnSilence::Stop).await.unwrap();
    assert_eq!((has(&plant), watchdog.armed(), watchdog.error()), ((400, 3), true, None));
    assert_eq!((watchdog.timeout(), watchdog.action()), (LONG, OnSilence::Stop));
    watchdog.close().await.unwrap();
    assert_eq!(has(&plant), (0, 2));
    drop(drive.watchdog(LONG, OnSilence::Stop).await.unwrap());
    assert_eq!(has(&plant), (0, 2));
    assert_eq!(drive.watchdog(LONG, OnSilence::Trip).await.unwrap_err().kind(), ErrorKind::NotAllowed);
    let watchdog = drive.watchdog(LONG, OnSilence::Coast).await.unwrap();
    drive.run(10.0).await.unwrap();
    plant.bus.sleep(Duration::from_secs(30));
    assert_eq!(watchdog.close().await.unwrap_err().kind(), ErrorKind::NotAllowed);
    assert_eq!(has(&plant), (400, 0));
    assert_eq!(plant.sent(Command::Stop), 0);
}

/// Rings when what was waited for is there.
struct Bell(SyncSender<()>);

impl Wake for Bell {
    fn wake(self: Arc<Self>) {
        // Who does not listen any more has dropped what it waited for.
        let _ = self.0.send(());
    }
}

/// A future of one that is set and closed, dropped after each of its steps: when what it asked for has come, and before.
#[test]
fn a_future_that_is_dropped_leaves_nothing_in_the_drive() {
    let mut was_set = 0;
    for (steps, waits) in (1..).flat_map(|steps| [(steps, true), (steps, false)]) {
        let plant = gd350();
        let drive = plant.drive.aio();
        // What is asked for is not there before the step that asks for it is over: no step is two.
        let gate = Arc::new(Mutex::new(()));
        let passed = Arc::clone(&gate);
        plant.tap(move |_| drop(passed.lock().unwrap()));
        let mut program = Box::pin(async {
            let watchdog = drive.watchdog(LONG, OnSilence::Stop).await?;
            watchdog.close().await
        });
        let (bell, rung) = sync_channel(1);
        let waker = Waker::from(Arc::new(Bell(bell)));
        let is_over = (1..=steps).any(|step| {
            let held = gate.lock().unwrap();
            let polled = program.as_mut().poll(&mut Context::from_waker(&waker));
            drop(held);
            if polled.is_pending() && (waits || step < steps) {
                rung.recv().unwrap();
            }
            polled.is_ready()
        });
        was_set += usize::from(waits && has(&plant) != (0, 2));
        drop(program);
        assert_eq!(has(&plant), (0, 2), "after {steps} steps, {waits}");
        if is_over {
            break;
        }
    }
    assert!(was_set > 2, "{was_set}");
}
