//! A program waits until a motor has its speed, or stands: what it is told then, and that nothing is done to the drive.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "shared/plant.rs"]
mod plant;
#[path = "shared/tapped.rs"]
mod tapped;

use std::sync::Arc;
use std::time::Duration;

use drivebus::drives::Command;
use drivebus::{Bus, Error, ErrorKind, Profile, State};

use plant::Plant;

/// Families of eight makers, some of which tell no setpoint.
const FAMILIES: [&str; 8] = ["gd350", "vfd500", "ms300", "a1000", "wj200", "acs355", "atv312", "v20"];

const LONG: Duration = Duration::from_secs(60);

/// It was only looked at.
#[track_caller]
fn came_to<T: std::fmt::Debug>(waited: Result<T, Error>, kind: ErrorKind, says: &str) {
    let error = waited.unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (kind, false), "{error}");
    assert!(error.to_string().contains(says), "{error}");
}

#[test]
fn a_motor_is_waited_for_until_it_has_its_speed_and_until_it_stands() {
    for family in FAMILIES {
        let plant = Plant::of(family);
        let drive = &plant.drive;
        drive.run(10.0).unwrap_or_else(|error| panic!("{family}: {error}"));
        came_to(
            drive.wait_until_stopped(Duration::ZERO),
            ErrorKind::Unconfirmed,
            "the time is over, and it is forward",
        );
        let status = drive.wait_for_speed(10.0, 0.1, LONG).unwrap_or_else(|error| panic!("{family}: {error}"));
        assert_eq!(status.state, State::Forward, "{family}");
        assert!(status.hz.is_some_and(|hz| (hz - 10.0).abs() < 0.11), "{family}: {status}");
        assert!((plant.simulated().frequency() - 10.0).abs() < 0.2, "{family}");

        drive.stop().unwrap();
        plant.simulated().take_writes();
        let status = drive.wait_until_stopped(LONG).unwrap_or_else(|error| panic!("{family}: {error}"));
        assert!(status.state.is_at_rest(), "{family}: {status}");
        assert!(plant.simulated().frequency() <= 0.05, "{family}");
        assert_eq!(plant.simulated().take_writes(), [], "{family}");
    }
}

#[test]
fn the_setpoint_in_force_is_waited_for_where_the_family_tells_it() {
    for family in FAMILIES {
        let plant = Plant::of(family);
        plant.drive.run_reverse(None).or_else(|_| plant.drive.run(None)).unwrap();
        plant.drive.set_frequency(20.0).unwrap();
        let waited = plant.drive.wait_for_speed(None, 0.1, LONG);
        if plant.profile.role("setpoint").is_none() {
            came_to(waited, ErrorKind::NotAllowed, "its setpoint must be seen: no such register is known");
            continue;
        }
        let status = waited.unwrap_or_else(|error| panic!("{family}: {error}"));
        assert_eq!(status.setpoint, Some(20.0), "{family}");
        assert!((plant.simulated().frequency().abs() - 20.0).abs() < 0.2, "{family}");
    }
}

#[test]
fn a_motor_that_is_slower_than_its_time_goes_on() {
    let plant = Plant::of("gd350");
    plant.drive.run(10.0).unwrap();
    let began = plant.bus.now();
    let second = Duration::from_secs(1);
    let says = "speed of unit 1: the time is over, and it is forward, ";
    came_to(plant.drive.wait_for_speed(50.0, 0.5, second), ErrorKind::Unconfirmed, says);
    let took = plant.bus.now().saturating_duration_since(began);
    assert!(second <= took && took < second + Duration::from_millis(100), "{took:?}");
    came_to(plant.drive.wait_until_stopped(second), ErrorKind::Unconfirmed, "standstill of unit 1: the time is over");
    assert!(plant.turns("forward", 10.0));
    plant.drive.coast().unwrap();
    assert!(plant.stands());
}

#[test]
fn a_drive_that_trips_ends_the_wait() {
    for family in ["gd350", "vfd500", "ms300"] {
        let plant = Plant::of(family);
        plant.drive.run(10.0).unwrap();
        let (simulator, mut looks) = (plant.simulator.clone(), 0);
        plant.tap(move |_| {
            looks += 1;
            if looks == 10 {
                simulator.drive(1).unwrap().trip(3).unwrap();
            }
        });
        let waited = plant.drive.wait_for_speed(50.0, 0.1, LONG);
        came_to(waited, ErrorKind::Unconfirmed, "speed of unit 1: it tripped while waiting: ");
        let waited = plant.drive.wait_until_stopped(LONG);
        came_to(waited, ErrorKind::Unconfirmed, "standstill of unit 1: it tripped before the wait: ");
    }
}

/// Of the CHV100 no document has the state. Of a SAJ 8000M the page of the state is at hand, and not that of the frequency.
#[test]
fn what_a_family_does_not_tell_is_not_waited_for() {
    let plant = Plant::of("gd350");
    let named = |family| plant.bus.drive(1, &Profile::builtin(family).unwrap()).unwrap();
    let frames = plant.simulator.wire().trace().len();
    let chv100 = named("chv100").unverified();
    came_to(chv100.wait_until_stopped(LONG), ErrorKind::NotAllowed, "standstill of unit 1: its state must be seen: ");
    came_to(chv100.wait_for_speed(None, 0.1, LONG), ErrorKind::NotAllowed, "its state must be seen: ");
    let saj8000m = named("saj8000m");
    came_to(
        saj8000m.wait_for_speed(5.0, 0.1, LONG),
        ErrorKind::NotAllowed,
        "speed of unit 1: its frequency must be seen",
    );
    assert_eq!(plant.simulator.wire().trace().len(), frames, "nothing was sent");
}

/// A1000 Technical Manual, p. 559: o1-03 says in which unit its frequencies are.
#[test]
fn a_speed_in_another_unit_is_none_in_hertz() {
    let plant = Plant::of("a1000");
    let in_percent = Arc::new(plant.profile.with_variants([("speed_unit", "%")]).unwrap());
    let drive = plant.bus.drive(1, &in_percent).unwrap().unverified();
    came_to(drive.wait_for_speed(10.0, 0.1, LONG), ErrorKind::NotAllowed, "it tells that in %, and not in Hz");
    let status = drive.wait_until_stopped(LONG).unwrap();
    assert_eq!((status.state, status.hz), (State::Stopped, None));
}

#[test]
fn what_cannot_be_is_not_waited_for() {
    let plant = Plant::of("gd350");
    for hz in [-1.0, f64::NAN, f64::INFINITY] {
        came_to(plant.drive.wait_for_speed(hz, 0.1, LONG), ErrorKind::NotAllowed, "frequency ");
        came_to(plant.drive.wait_for_speed(None, hz, LONG), ErrorKind::NotAllowed, "tolerance ");
    }
    let longer = Duration::from_secs(3601);
    came_to(plant.drive.wait_for_speed(None, 0.1, longer), ErrorKind::NotAllowed, "within 3601 is out of range");
    came_to(plant.drive.wait_until_stopped(longer), ErrorKind::NotAllowed, "within 3601 is out of range");
    plant.bus.close();
    came_to(plant.drive.wait_until_stopped(LONG), ErrorKind::Port, "");
}

#[tokio::test]
async fn waits_are_futures_too() {
    for family in ["gd350", "wj200", "acs355"] {
        let plant = Plant::of(family);
        let drive = plant.drive.aio();
        drive.run(10.0).await.unwrap();
        let late = drive.wait_for_speed(10.0, 0.1, Duration::from_millis(100)).await;
        came_to(late, ErrorKind::Unconfirmed, "the time is over");
        assert!(drive.wait_for_speed(10.0, 0.1, LONG).await.unwrap().hz.is_some_and(|hz| hz > 9.8), "{family}");
        drive.stop().await.unwrap();
        assert!(drive.wait_until_stopped(LONG).await.unwrap().state.is_at_rest(), "{family}");
        plant.simulated().trip(3).unwrap();
        came_to(drive.wait_until_stopped(LONG).await, ErrorKind::Unconfirmed, "it tripped before the wait");
        came_to(drive.wait_until_stopped(Duration::MAX).await, ErrorKind::NotAllowed, "within");
    }
    let bus = Bus::open("sim://gd350?clock=virtual").unwrap().aio();
    let chv100 = bus.drive(1, &Profile::builtin("chv100").unwrap()).unwrap();
    came_to(chv100.wait_until_stopped(LONG).await, ErrorKind::NotAllowed, "its state must be seen");
}

/// A wait is no stop, and a stop is no wait.
#[test]
fn a_wait_sends_no_command() {
    let plant = Plant::of("gd350");
    plant.drive.run(10.0).unwrap();
    plant.drive.wait_for_speed(None, 0.1, LONG).unwrap();
    let _late = plant.drive.wait_until_stopped(Duration::from_secs(1));
    assert_eq!((plant.sent(Command::RunForward), plant.sent(Command::Stop)), (1, 0));
}
