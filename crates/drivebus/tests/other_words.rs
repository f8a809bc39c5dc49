//! Drives that are set to another control profile of their own, in which the word that stops may start, by the vectors that pytest
//! reads too: `tests/vectors/other_words.toml`.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::time::Duration;

use drivebus::{Bus, Error, ErrorKind, Profile};
use serde::Deserialize;

#[derive(Deserialize)]
struct Vectors {
    case: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    what: String,
    family: String,
    named: Option<String>,
    set: Vec<(u16, u16)>,
    start: Option<(u16, u16)>,
    order: Order,
    sent: Vec<(u16, u16)>,
    says: String,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Order {
    Stop,
    Coast,
    Reset,
}

fn cases() -> Vec<Case> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors/other_words.toml");
    toml::from_str::<Vectors>(&std::fs::read_to_string(path).unwrap()).unwrap().case
}

/// A line whose unit is set as `case` says, and whose motor turns where it `runs`.
fn plant(case: &Case, runs: bool) -> Bus {
    let bus = Bus::open(&format!("sim://{}?clock=virtual&seed=1", case.family)).unwrap();
    for &(address, word) in &case.set {
        bus.write(1, address, word).unwrap();
    }
    let unit = bus.simulator().unwrap().drive(1).unwrap();
    if runs {
        let (address, word) = case.start.unwrap();
        bus.write(1, address, word).unwrap();
        bus.sleep(Duration::from_secs(60));
        assert!(unit.frequency() > 1.0, "{}", case.what);
    } else if case.order == Order::Reset {
        unit.trip(7).unwrap();
    }
    unit.take_writes();
    bus
}

fn order(bus: &Bus, case: &Case) -> Result<(), Error> {
    let profile = Profile::builtin(case.named.as_deref().unwrap_or(&case.family)).unwrap();
    let drive = bus.drive(1, &profile).unwrap().unverified();
    match case.order {
        Order::Stop => drive.stop(),
        Order::Coast => drive.coast(),
        Order::Reset => drive.reset_fault(),
    }
}

fn check(bus: &Bus, case: &Case) {
    let ended = order(bus, case);
    let unit = bus.simulator().unwrap().drive(1).unwrap();
    let taken: Vec<_> = unit.take_writes().into_iter().map(|write| (write.address, write.value)).collect();
    assert_eq!(taken, case.sent, "{}: {ended:?}", case.what);
    match ended {
        Ok(()) => assert!(!case.sent.is_empty(), "{}", case.what),
        Err(error) => {
            assert!(case.sent.is_empty(), "{}: {error}", case.what);
            assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::NotAllowed, false), "{error}");
            assert!(error.to_string().contains(&case.says), "{error}");
        }
    }
    bus.sleep(Duration::from_secs(60));
    assert!(unit.frequency().abs() < 0.01, "{}", case.what);
}

#[test]
fn no_halt_starts_a_motor_at_rest() {
    for case in cases() {
        check(&plant(&case, false), &case);
    }
}

#[test]
fn a_motor_that_runs_is_halted() {
    for case in cases().iter().filter(|case| case.start.is_some() && case.order != Order::Reset) {
        check(&plant(case, true), case);
    }
}
