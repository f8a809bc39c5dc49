//! A drive is started, halted and reset on a simulated line: what its motor does, what goes out, and what every error says.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "shared/plant.rs"]
mod plant;
#[path = "shared/tapped.rs"]
mod tapped;

use std::time::Duration;

use drivebus::drives::Command;
use drivebus::sim::FaultKind;
use drivebus::{CallOptions, Error, ErrorKind, Profile, Start, State};

use plant::Plant;

/// Families of seven makers. The last three are started by several words.
const FAMILIES: [&str; 8] = ["gd350", "vfd500", "ms300", "a1000", "wj200", "acs355", "atv312", "v20"];

/// Nothing was sent that moves the motor, and the caller is told so.
#[track_caller]
fn is_not_sent(plant: &Plant, done: Result<(), Error>, says: &str) {
    let error = done.unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::NotAllowed, false), "{error}");
    assert!(error.to_string().contains(says), "{error}");
    assert_eq!(plant.simulated().take_writes(), []);
}

#[test]
fn a_motor_runs_as_it_is_told_and_stops() {
    for family in FAMILIES {
        let plant = Plant::of(family);
        let drive = &plant.drive;
        drive.run(10.0).unwrap_or_else(|error| panic!("{family}: {error}"));
        assert!(plant.turns("forward", 10.0), "{family}: {:?}", plant.simulated());
        drive.run(20.0).unwrap();
        assert!(plant.turns("forward", 20.0), "{family}");
        drive.set_frequency(15.0).unwrap();
        assert!(plant.turns("forward", 15.0), "{family}");
        assert_eq!(drive.status().unwrap().state, State::Forward, "{family}");
        drive.stop().unwrap_or_else(|error| panic!("{family}: {error}"));
        assert!(plant.stands(), "{family}");
    }
}

#[test]
fn a_motor_turns_the_other_way_and_round() {
    for family in FAMILIES {
        let plant = Plant::of(family);
        if plant.profile.command(Command::RunReverse).is_none() {
            is_not_sent(&plant, plant.drive.run_reverse(10.0), "no such command of this family is known");
            continue;
        }
        plant.drive.run_reverse(10.0).unwrap_or_else(|error| panic!("{family}: {error}"));
        assert!(plant.turns("reverse", 10.0), "{family}");
        plant.drive.run(None).unwrap_or_else(|error| panic!("{family}: {error}"));
        assert!(plant.turns("forward", 10.0), "{family}");
        plant.drive.stop().unwrap();
    }
}

/// The jog frequency of a GD350 is P08.06, 5.00 Hz as it comes (manual V1.4, P08.06).
#[test]
fn a_jog_turns_at_the_drives_own_frequency() {
    let plant = Plant::of("gd350");
    plant.drive.jog().unwrap();
    assert!(plant.turns("forward", 5.0));
    is_not_sent_of_a_jog(&plant);
    plant.drive.halt(&drivebus::Halting::jog_stop()).unwrap();
    assert!(plant.stands());
}

fn is_not_sent_of_a_jog(plant: &Plant) {
    plant.simulated().take_writes();
    is_not_sent(plant, plant.drive.jog(), "it turns already");
}

#[test]
fn a_fault_has_a_name_keeps_the_motor_from_starting_and_is_reset() {
    for family in ["gd350", "vfd500", "ms300", "atv312"] {
        let plant = Plant::of(family);
        let drive = &plant.drive;
        assert_eq!(drive.fault().unwrap(), None, "{family}");
        plant.simulated().hold_fault(3).unwrap();
        let fault = drive.fault().unwrap().unwrap();
        assert_eq!((fault.code, fault), (3, plant.profile.fault(3).into_owned()), "{family}");
        assert!(drive.status().unwrap().is_in_fault, "{family}");
        is_not_sent(&plant, drive.run(10.0), "it is in fault");

        let error = drive.reset_fault().unwrap_err();
        assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Unconfirmed, true), "{family}: {error}");
        assert_eq!(plant.simulated().fault(), 3);
        plant.simulated().release_fault();
        drive.reset_fault().unwrap_or_else(|error| panic!("{family}: {error}"));
        assert_eq!(plant.simulated().fault(), 0);
        plant.simulated().take_writes();
        drive.reset_fault().unwrap();
        assert_eq!(plant.simulated().take_writes(), [], "{family}: there is nothing to reset");
        drive.run(10.0).unwrap();
        assert!(plant.turns("forward", 10.0), "{family}");
    }
}

#[test]
fn a_family_that_tells_no_fault_says_so() {
    let plant = Plant::of("a1000");
    let error = plant.drive.fault().unwrap_err();
    assert_eq!(error.kind(), ErrorKind::NotAllowed);
    assert_eq!(
        error.to_string(),
        "present fault of unit 1: it may not be read: no fault register of this family is known"
    );
}

#[test]
fn a_drive_that_is_set_to_something_else_is_not_started() {
    let plant = Plant::as_it_comes("gd350");
    let wrong = plant.drive.control().unwrap();
    let told: Vec<_> = wrong.iter().filter(|one| one.is_wrong()).map(ToString::to_string).collect();
    assert_eq!(told[0], "P00.01 is 0, and must be 2 (run commands come from communication)");
    is_not_sent(&plant, plant.drive.run(None), "keypad");
    plant.simulated().set_parameter(0x0001, 2).unwrap();
    is_not_sent(&plant, plant.drive.run(10.0), "it would not take its speed from the bus: P00.06 is 0");
    plant.drive.run(None).unwrap(); // whose speed it takes is none of its business
}

#[test]
fn a_frequency_that_cannot_be_is_not_sent() {
    let plant = Plant::of("gd350");
    is_not_sent(&plant, plant.drive.run(50.5), "it is above the drive's own maximum, P00.03 = 50.00 Hz");
    for hz in [-1.0, f64::NAN, f64::INFINITY, 1e9] {
        is_not_sent(&plant, plant.drive.run(hz), "");
        is_not_sent(&plant, plant.drive.set_frequency(hz), "");
    }
    is_not_sent(&plant, plant.drive.set_frequency(50.5), "frequency of unit 1: it is above the drive's own maximum");
    let mut start = Start::run(false, None);
    start.confirm = Duration::from_secs(3601);
    is_not_sent(&plant, plant.drive.run_with(&start), "confirm 3601 is out of range");
}

#[test]
fn a_link_that_may_lose_the_stop_starts_no_motor() {
    let plant = Plant::of("gd350");
    plant.simulator.wire().set_rate(FaultKind::Silence, 0.5).unwrap();
    for _ in 0..10 {
        let _lost = plant.bus.read_with(1, 0x2100, 1, CallOptions::new().retries(0));
    }
    is_not_sent(&plant, plant.drive.run(10.0), "the link is bad: ");
    // What was lost long ago is no reason.
    plant.simulator.wire().clear();
    plant.simulator.wire().set_rate(FaultKind::Silence, 0.0).unwrap();
    plant.drive.run(10.0).unwrap();
    assert!(plant.turns("forward", 10.0));
}

/// EDS300 manual, p. 46: 5 runs one, and stops a GD350.
#[test]
fn a_drive_of_another_family_is_not_started() {
    for family in ["vfd500", "eds300", "a1000"] {
        let plant = Plant::of(family);
        let named = plant.bus.drive(1, &Profile::builtin("gd350").unwrap()).unwrap();
        assert!(named.contradiction().unwrap().is_some(), "{family}");
        assert!(plant.drive.contradiction().unwrap().is_none(), "{family}");
        assert_eq!(named.identify().unwrap(), plant.bus.identify(1).unwrap());
        let error = named.run(10.0).unwrap_err();
        assert!(!error.may_have_acted(), "{family}: {error}");
        assert_eq!(plant.simulated().take_writes(), [], "{family}: {error}");
        assert!(plant.stands(), "{family}");
        plant.drive.run(10.0).unwrap_or_else(|error| panic!("{family}: {error}"));
        named.stop().unwrap();
        assert!(plant.stands(), "{family}");
    }
}

#[test]
fn a_start_that_is_not_confirmed_is_sent_once() {
    let plant = Plant::of("gd350");
    let (wire, place) = (plant.simulator.wire(), plant.profile.command(Command::RunForward).unwrap().0);
    // The frequency lies behind the command, and goes with it.
    plant.tap(move |frame| {
        if frame[1] == 0x10 && frame[2..4] == place.address.to_be_bytes() {
            wire.drop_answers(1);
        }
    });
    let error = plant.drive.run(10.0).unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Unconfirmed, true), "{error}");
    assert!(error.to_string().starts_with("run_forward of unit 1: it was sent and not confirmed"), "{error}");
    assert_eq!(plant.sent(Command::RunForward), 1);
    assert!(plant.turns("forward", 10.0), "and it turns");
    plant.drive.stop().unwrap();
}

#[test]
fn what_the_drive_refuses_it_has_not_done() {
    use drivebus::sim::{Asked, Refusals};
    let plant = Plant::of("gd350");
    plant.simulated().refuse(Refusals::new(0x04).of(Asked::Writes)).unwrap();
    let error = plant.drive.run(10.0).unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Refused, false), "{error}");
    assert_eq!(error.code(), Some(0x04));
    assert_eq!(plant.sent(Command::RunForward), 1, "it is not repeated");
    let error = plant.drive.set_frequency(10.0).unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Refused, false), "{error}");
    assert!(plant.stands());
}

#[test]
fn values_come_by_name() {
    let plant = Plant::of("gd350");
    let drive = &plant.drive;
    assert_eq!(drive.read("P00.03").unwrap().to_string(), "50.00");
    drive.run(10.0).unwrap();
    assert!(plant.turns("forward", 10.0));
    let values = drive.values(["running_frequency", "bus_voltage"]).unwrap();
    assert_eq!(values.get("running_frequency").unwrap().to_string(), "10.00");
    let both = drive.frequencies().unwrap().unwrap();
    assert_eq!((both.output, both.setpoint), (10.0, Some(10.0)));
    assert_eq!(drive.status().unwrap().to_string(), "forward, 10.00 of 10.00 Hz");
    assert_eq!(drive.look().unwrap().to_string(), "forward");
    let unknown = drive.read("running_frequenzy").unwrap_err();
    assert_eq!(unknown.to_string(), "gd350 has no \"running_frequenzy\"; the closest is \"running_frequency\"");
    plant.bus.close();
    assert_eq!(drive.read("P00.03").unwrap_err().kind(), ErrorKind::Port);
    assert_eq!(drive.run(10.0).unwrap_err().kind(), ErrorKind::Port);
}

/// A1000 Technical Manual, p. 559: o1-03 says in which unit its frequencies are.
#[test]
fn what_a_word_means_is_asked_of_the_drive() {
    let plant = Plant::of("a1000");
    plant.drive.run(10.0).unwrap();
    assert!(plant.turns("forward", 10.0));
    assert_eq!(plant.drive.frequencies().unwrap().map(|both| both.output), Some(10.0));
    assert_eq!(plant.drive.read("running_frequency").unwrap().to_string(), "10.00");
    // Which number means which no page prints.
    let printed = plant.bus.drive(1, &plant.profile).unwrap();
    assert_eq!((printed.frequencies().unwrap(), printed.status().unwrap().hz), (None, None));
    assert_eq!(printed.read("running_frequency").unwrap_err().kind(), ErrorKind::NotAllowed);
    plant.drive.stop().unwrap();
}

/// Of the commands of a GD3000 only the one that runs it is printed.
#[test]
fn what_was_started_unverified_is_stopped_by_every_handle() {
    let plant = Plant::of("gd3000");
    let printed = plant.bus.drive(1, &plant.profile).unwrap();
    is_not_sent(&plant, printed.stop(), "");
    is_not_sent(&plant, printed.run(10.0), "");
    plant.drive.run(10.0).unwrap();
    assert!(plant.turns("forward", 10.0));
    printed.stop().unwrap();
    assert!(plant.stands());
}

#[tokio::test]
async fn the_calls_of_a_drive_are_futures_too() {
    let plant = Plant::of("gd350");
    let drive = plant.bus.aio().drive(1, &plant.profile).unwrap().unverified();
    drive.run(10.0).await.unwrap();
    assert!(plant.turns("forward", 10.0));
    assert_eq!(drive.status().await.unwrap(), drive.blocking().status().unwrap());
    assert_eq!(drive.look().await.unwrap().state, State::Forward);
    assert_eq!(drive.frequencies().await.unwrap(), drive.blocking().frequencies().unwrap());
    drive.set_frequency(20.0).await.unwrap();
    assert!(plant.turns("forward", 20.0));
    drive.coast().await.unwrap();
    assert!(plant.stands());
    drive.run_reverse(None).await.unwrap();
    assert!(plant.turns("reverse", 20.0));
    drive.stop().await.unwrap();
    assert!(plant.stands());
    drive.jog().await.unwrap();
    assert!(plant.turns("forward", 5.0));
    drive.halt(&drivebus::Halting::jog_stop()).await.unwrap();
    assert!(plant.stands());
    plant.simulated().trip(3).unwrap();
    assert_eq!(drive.fault().await.unwrap().unwrap().code, 3);
    assert_eq!(drive.run(10.0).await.unwrap_err().kind(), ErrorKind::NotAllowed);
    drive.reset_fault().await.unwrap();
    assert_eq!(drive.read("P00.03").await.unwrap().to_string(), "50.00");
    assert!(drive.values(["P00.03"]).await.unwrap().get("P00.03").is_some());
    assert_eq!(drive.control().await.unwrap(), drive.blocking().control().unwrap());
    assert_eq!(drive.identify().await.unwrap(), drive.blocking().identify().unwrap());
    assert!(drive.contradiction().await.unwrap().is_none());
    assert_eq!((drive.unit(), drive.profile().name()), (1, "gd350"));
}
