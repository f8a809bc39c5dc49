use std::sync::Arc;

use super::*;
use crate::family::Family;
use crate::parameters::WhyNotPlanned;
use crate::record::Record;
use crate::scripted::{Fault, Keeper, Script, call, shipped};

fn give(
    family: &Arc<Family>,
    words: &[(u16, u16)],
    (setpoint, value): (Setpoint, f64),
) -> (Result<(), NotGiven<Fault>>, Script) {
    let mut script = Script::new();
    let unit = call(family, &Record::default(), true);
    let given =
        |line| async move { unit.give_setpoint(&line, Families::shipped(), setpoint, Input::Float(value)).await };
    (script.carry_out(Keeper::new(family, words), given), script)
}

fn not_planned(given: Result<(), NotGiven<Fault>>) -> WhyNotPlanned {
    let Err(NotGiven::NotKept(why)) = given else { panic!("it was given") };
    let WhyNotKept::NotPlanned(why) = *why else { panic!("{why}") };
    *why.why
}

/// GD350 operation manual, section 9.4.5: the torque is at 2004H, the PID setpoint at 2002H, both in tenths of a percent.
#[test]
fn a_setpoint_is_written_as_its_register_counts_it() {
    let gd350 = shipped("gd350");
    let (given, script) = give(&gd350, &[(0x2103, 0x01A0)], (Setpoint::Torque, -12.5));
    given.unwrap();
    assert_eq!(script.written(), [(0x2004, vec![0xFF83])]);
    assert_eq!(script.sent[0].1.read_back, Some(0x2004));
    let (given, script) = give(&gd350, &[(0x2103, 0x01A0), (0x0900, 6)], (Setpoint::Pid, 50.0));
    given.unwrap();
    assert_eq!(script.written(), [(0x2002, vec![500])]);
}

#[test]
fn a_drive_that_would_ignore_it_gets_nothing() {
    let (given, script) = give(&shipped("gd350"), &[(0x2103, 0x01A0), (0x0900, 1)], (Setpoint::Pid, 50.0));
    let NotGiven::Ignored(settings) = given.unwrap_err() else { panic!("it was given") };
    assert_eq!(settings[0].to_string(), "P09.00 is 1, and must be 6 (the PID setpoint comes from Modbus)");
    assert_eq!(script.sent, []);
}

/// Of settings that may not be read nobody knows whether the drive heeds it.
#[test]
fn a_drive_that_is_not_known_to_heed_it_gets_nothing() {
    for family in Families::shipped().iter() {
        for (&setpoint, role) in family.profile().setpoints() {
            let unit = call(family, &Record::default(), false);
            let is_open = role
                .needs
                .iter()
                .any(|row| family.profile().find(&row.code).is_ok_and(|entry| unit.rule().read(entry).is_err()));
            if !is_open {
                continue;
            }
            let mut script = Script::new();
            let given =
                |line| async move { unit.give_setpoint(&line, Families::shipped(), setpoint, Input::Integer(0)).await };
            script.carry_out(Keeper::new(family, &[]), given).unwrap_err();
            assert_eq!(script.sent, [], "{} {}", family.name(), setpoint.name());
        }
    }
}

#[test]
fn a_setpoint_is_held_to_its_range_and_to_the_drives_own() {
    let gd350 = shipped("gd350");
    let (given, script) = give(&gd350, &[(0x2103, 0x01A0)], (Setpoint::Torque, 300.1));
    assert!(matches!(not_planned(given), WhyNotPlanned::Unfit(_)));
    assert_eq!(script.sent, []);
    // P00.03, which bounds it, is 50 Hz.
    let words = [(0x2103, 0x01A0), (3, 5000)];
    let (given, script) = give(&gd350, &words, (Setpoint::ForwardLimit, 50.01));
    let Err(NotGiven::NotKept(why)) = given else { panic!("it was given") };
    assert!(matches!(*why, WhyNotKept::Beyond(_)));
    assert_eq!(script.sent, []);
    give(&gd350, &words, (Setpoint::ForwardLimit, 50.0)).0.unwrap();
}

#[test]
fn what_can_move_a_motor_is_no_setpoint() {
    for setpoint in [Setpoint::VirtualInputs, Setpoint::SpecialControl] {
        let (given, script) = give(&shipped("gd350"), &[(0x2103, 0x01A0)], (setpoint, 1.0));
        assert_eq!(not_planned(given), WhyNotPlanned::Moves);
        assert_eq!(script.sent, []);
    }
    let (given, script) = give(&shipped("eds300"), &[], (Setpoint::Torque, 1.0));
    assert!(matches!(given, Err(NotGiven::NoRegister)));
    assert_eq!(script.asked, []);
}
