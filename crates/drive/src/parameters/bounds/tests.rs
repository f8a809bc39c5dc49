use std::collections::BTreeSet;
use std::sync::Arc;

use drivebus_drives::{Input, Place, Store};

use super::*;
use crate::families::Families;
use crate::family::Family;
use crate::parameters::NotKept;
use crate::record::Record;
use crate::scripted::{Fault, Keeper, Script, call, shipped};

type Wanted = [(&'static str, Input<'static>)];

/// What comes of it where the unit has `words`, and what was written.
fn write(family: &Arc<Family>, words: &[(u16, u16)], wanted: &'static Wanted) -> (Result<(), NotKept<Fault>>, Script) {
    let mut script = Script::new();
    let unit = call(family, &Record::default(), false);
    let work = |line| async move { unit.write_values(&line, Families::shipped(), wanted, Store::Ram).await };
    (script.carry_out(Keeper::new(family, words), work), script)
}

/// A GD200A at rest, whose P00.03, P00.04, P00.05 and P00.10 are these.
fn gd200a(frequencies: [u16; 4], wanted: &'static Wanted) -> (Result<(), NotKept<Fault>>, Script) {
    let [max, upper, lower, keypad] = frequencies;
    let words = [(0x2103, 0x0107), (0x2100, 3), (3, max), (4, upper), (5, lower), (0x0A, keypad)];
    write(&shipped("gd200a"), &words, wanted)
}

fn beyond(frequencies: [u16; 4], wanted: &'static Wanted) -> (String, bool) {
    let (written, script) = gd200a(frequencies, wanted);
    assert_eq!(script.sent, []);
    match *written.unwrap_err().why {
        WhyNotKept::Beyond(beyond) => (beyond.to_string(), beyond.is_below),
        why => panic!("{why}"),
    }
}

/// GD200A operation manual, p. 39: P00.05 ≤ P00.04 ≤ P00.03, and P00.10 ≤ P00.03.
#[test]
fn a_range_is_narrowed_by_other_parameters_in_both_directions() {
    let set = [5000, 5000, 1000, 4800];
    for (wanted, told) in [
        (&[("P00.04", Input::Float(50.01))], "P00.04 = 50.01 Hz is above P00.03 = 50.00 Hz"),
        (&[("P00.04", Input::Float(9.99))], "P00.04 = 9.99 Hz is below P00.05 = 10.00 Hz"),
        (&[("P00.05", Input::Float(50.01))], "P00.05 = 50.01 Hz is above P00.04 = 50.00 Hz"),
        (&[("P00.03", Input::Float(49.99))], "P00.03 = 49.99 Hz is below P00.04 = 50.00 Hz"),
        (&[("keypad_frequency", Input::Float(50.01))], "keypad_frequency = 50.01 Hz is above P00.03 = 50.00 Hz"),
    ] as [(&'static Wanted, &str); 5]
    {
        assert_eq!(beyond(set, wanted), (told.to_owned(), told.contains("below")));
    }
    // No row of P00.03 names P00.10: that of P00.10 does.
    let told = beyond([5000, 4000, 1000, 4800], &[("P00.03", Input::Float(47.0))]);
    assert_eq!(told, ("P00.03 = 47.00 Hz is below P00.10 = 48.00 Hz".to_owned(), true));
    // A bound itself is within.
    for wanted in [&[("P00.04", Input::Float(50.0))], &[("P00.04", Input::Float(10.0))]] as [&'static Wanted; 2] {
        gd200a(set, wanted).0.unwrap();
    }
}

#[test]
fn each_of_several_values_sees_those_before() {
    let set = [5000, 5000, 1000, 4800];
    let (written, script) =
        gd200a(set, &[("P00.10", Input::Float(40.0)), ("P00.04", Input::Float(40.0)), ("P00.03", Input::Float(40.0))]);
    written.unwrap();
    assert_eq!(script.written(), [(0x800A, vec![4000]), (0x8004, vec![4000]), (0x8003, vec![4000])]);
    // State, bounds and what they bound, in as few reads as hold them: groups are read apart, and nothing twice.
    let places = script.places();
    assert_eq!(places.len(), places.iter().collect::<BTreeSet<_>>().len());
    let told = beyond(set, &[("P00.03", Input::Float(40.0)), ("P00.04", Input::Float(40.0))]);
    assert_eq!(told, ("P00.03 = 40.00 Hz is below P00.04 = 50.00 Hz".to_owned(), true));
}

/// GD350 operation manual: a setpoint is not above P00.03.
#[test]
fn a_register_is_bounded_by_a_parameter() {
    let words = [(0x2103, 0x01A0), (3, 5000)];
    let (written, script) = write(&shipped("gd350"), &words, &[("set_frequency", Input::Float(50.01))]);
    assert!(matches!(*written.unwrap_err().why, WhyNotKept::Beyond(_)));
    assert_eq!(script.sent, []);
    let (written, script) = write(&shipped("gd350"), &words, &[("set_frequency", Input::Float(50.0))]);
    written.unwrap();
    assert_eq!(script.written(), [(0x2001, vec![5000])]);
}

/// No GD20 manual at hand prints what the words of its state mean, so the drive has to refuse by itself while it runs.
#[test]
fn a_drive_whose_state_is_not_printed_is_not_asked_for_it() {
    let gd20 = shipped("gd20");
    let mut script = Script::new();
    let unit = call(&gd20, &Record::default(), false);
    assert!(!unit.tells_its_state());
    let wanted: &'static Wanted = &[("P00.03", Input::Float(50.0))];
    let asked = script.carry_out(Keeper::new(&gd20, &[(0x2100, 1)]), |line| async move {
        let planned = [unit.plan(wanted[0].0, wanted[0].1, Store::Eeprom).unwrap()];
        unit.check_now(&line, &planned).await
    });
    asked.unwrap();
    assert!(!script.asked.iter().any(|read| read.place == Place::from(0x2100)));
    assert_eq!(script.told, []);
}

/// If one bounds another, the other bounds the one.
#[test]
fn bounds_hold_in_both_directions() {
    let mut bounds = 0;
    for family in Families::shipped().iter() {
        let profile = family.profile();
        let is_bound_by =
            |entry: &Entry, other: &Entry| limits(profile, entry).iter().any(|limit| limit.other == other.name());
        for entry in profile.entries().filter(|entry| entry.kind() == Kind::Parameter) {
            let named = [entry.quantity().low_from(), entry.quantity().high_from()];
            for other in named.into_iter().flatten().map(|name| profile.find(name).unwrap()) {
                bounds += 1;
                assert!(is_bound_by(entry, other) && is_bound_by(other, entry), "{} {}", family.name(), entry.name());
            }
            assert!(!is_bound_by(entry, entry));
        }
    }
    assert!(bounds > 20);
}
