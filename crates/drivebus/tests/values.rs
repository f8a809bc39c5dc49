//! A drive is set to obey the bus, and values, setpoints and bits are written to it by name: what goes out, what the drive
//! keeps, and what every error says.

#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "shared/plant.rs"]
mod plant;
#[path = "shared/tapped.rs"]
mod tapped;

use drivebus::drives::Command;
use drivebus::sim::{Asked, Refusals};
use drivebus::{Error, ErrorKind, Input, Setpoint, Setting, Store};

use plant::Plant;

/// Families of four makers. How the first two are written to RAM alone is printed.
const FAMILIES: [&str; 4] = ["gd350", "vfd500", "ms300", "acs355"];

impl Plant {
    /// What the drive took since this was asked for last: addresses as they were on the wire, and words.
    fn written(&self) -> Vec<(u16, u16)> {
        self.simulated().take_writes().into_iter().map(|write| (write.address, write.value)).collect()
    }

    /// Where the drive keeps best what is only for now.
    fn store(&self) -> Store {
        if self.profile.memory().is_some() { Store::Ram } else { Store::Eeprom }
    }

    /// Refuses each write to `address` with this code, from the first on.
    fn refuse(&self, address: u16, code: u8) {
        let simulated = self.simulated();
        self.tap(move |frame| {
            if [0x06, 0x10].contains(&frame[1]) && frame[2..4] == address.to_be_bytes() {
                simulated.refuse(Refusals::new(code).of(Asked::Writes)).unwrap();
            }
        });
    }

    /// Nothing was sent that changes something, and the caller is told so.
    #[track_caller]
    fn is_not_sent<T: std::fmt::Debug>(&self, done: Result<T, Error>, says: &str) {
        let error = done.unwrap_err();
        assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::NotAllowed, false), "{error}");
        assert!(error.to_string().contains(says), "{error}");
        assert_eq!(self.written(), []);
    }
}

#[test]
fn a_drive_as_it_comes_is_prepared_and_runs() {
    for family in FAMILIES {
        let plant = Plant::as_it_comes(family);
        let drive = &plant.drive;
        let prepared = drive.prepare_for(Setpoint::Frequency, plant.store());
        let settings = prepared.unwrap_or_else(|error| panic!("{family}: {error}"));
        assert!(settings.iter().all(Setting::is_right), "{family}: {settings:?}");
        assert!(!plant.written().is_empty(), "{family}: it came set to something else");
        drive.run(10.0).unwrap_or_else(|error| panic!("{family}: {error}"));
        assert!(plant.turns("forward", 10.0), "{family}");
        drive.stop().unwrap();
        plant.written();
        assert_eq!(drive.prepare_for(Setpoint::Frequency, plant.store()).unwrap(), settings);
        assert_eq!(plant.written(), [], "{family}: nothing is left to be set");
    }
}

/// GD350 manual, section 9.4.5: 2 of P00.01 is communication. Section 9.4.8: 8 of P00.06 is Modbus.
#[test]
fn what_is_prepared_in_ram_is_forgotten_unless_it_is_kept() {
    let plant = Plant::as_it_comes("gd350");
    plant.drive.prepare().unwrap();
    assert_eq!(plant.written(), [(0x8001, 2), (0x8006, 8)]);
    plant.simulated().power_cycle();
    assert!(plant.drive.control().unwrap().iter().any(Setting::is_wrong));

    plant.drive.prepare().unwrap();
    plant.written();
    plant.drive.prepare_for(Setpoint::Frequency, Store::Eeprom).unwrap();
    assert_eq!(plant.written(), [(0x0001, 2), (0x0006, 8)], "what RAM has alone is kept");
    plant.simulated().power_cycle();
    assert!(!plant.drive.control().unwrap().iter().any(Setting::is_wrong));
}

#[test]
fn a_family_without_a_way_to_ram_is_not_prepared_there() {
    let plant = Plant::as_it_comes("ms300");
    plant.is_not_sent(plant.drive.prepare(), "no way to write it to RAM alone is known");
    let printed = plant.bus.drive(1, &plant.profile).unwrap();
    plant.is_not_sent(printed.prepare_for(Setpoint::Frequency, Store::Eeprom), "which may not be set so");
    plant.is_not_sent(printed.prepare_for(Setpoint::Torque, Store::Eeprom), "settings of unit 1: no such setpoint");
}

/// GD350 manual, section 9.4.5: bit 15 of the address means RAM. VFD500 manual, p. 134: it means EEPROM.
#[test]
fn the_address_says_where_a_value_is_kept() {
    for (family, name, word, ram, eeprom) in
        [("gd350", "P00.11", 50, 0x800B, 0x000B), ("vfd500", "P07.01", 0, 0x0701, 0x8701)]
    {
        let plant = Plant::of(family);
        // What EEPROM has already is not written.
        plant.simulated().set_parameter(ram & 0x7FFF, 7).unwrap();
        let value = plant.profile.find(name).unwrap().decode(word).to_f64();
        plant.drive.write(name, value).unwrap_or_else(|error| panic!("{family}: {error}"));
        assert_eq!(plant.written(), [(ram, word)], "{family}");
        assert_eq!(plant.simulated().eeprom_writes(), 0, "{family}");
        assert_eq!(plant.drive.read(name).unwrap().to_f64().to_bits(), value.to_bits(), "{family}");
        for _ in 0..2 {
            plant.drive.write_values([(name, value)], Store::Eeprom).unwrap();
        }
        assert_eq!(plant.written(), [(eeprom, word)], "{family}: once is enough");
        assert_eq!(plant.simulated().eeprom_writes(), 1, "{family}");
    }
}

/// GD350 manual, section 9.4.8: successive codes may share a request.
#[test]
fn several_values_go_in_their_order() {
    let plant = Plant::of("gd350");
    let values = [("P00.06", Input::from("modbus")), ("acceleration_time_1", 5.0.into()), ("0x000C", 8.into())];
    plant.drive.write_values(values, Store::Ram).unwrap();
    assert_eq!(plant.written(), [(0x8006, 8), (0x800B, 50), (0x800C, 80)]);
    plant.drive.write_values([("P00.12", 7.5), ("P00.11", 4.0)], Store::Ram).unwrap();
    assert_eq!(plant.written(), [(0x800C, 75), (0x800B, 40)]);
}

#[test]
fn what_is_not_allowed_is_not_sent() {
    let plant = Plant::of("gd350");
    let drive = &plant.drive;
    plant.is_not_sent(drive.write("P00.11", 4000.0), "unit 1: nothing was written: P00.11: ");
    plant.is_not_sent(drive.write("P00.11", 0.05), "P00.11");
    for nonsense in [f64::NAN, f64::INFINITY, -1.0] {
        plant.is_not_sent(drive.write("P00.11", nonsense), "P00.11");
    }
    plant.is_not_sent(drive.write("P00.11", "fast"), "fast");
    plant.is_not_sent(drive.write("P00.1l", 5.0), "gd350 has no \"P00.1l\"");
    plant.is_not_sent(drive.write("output_current", 5.0), "it can only be read");
    for command in ["control_command", "virtual_input", "0x2000"] {
        plant.is_not_sent(drive.write(command, 1), "it can move the motor, and is written as a command alone");
    }
    // One that may not be keeps back the others.
    plant.is_not_sent(drive.write_values([("P00.11", 5.0), ("P00.12", 4000.0)], Store::Ram), "P00.12");
    let printed = plant.bus.drive(1, &plant.profile).unwrap();
    plant.is_not_sent(printed.write("P14.03", 5), "P14.03: it may not be written");
}

/// GD350 manual, section 9.4.8: P00.03 begins at P00.04.
#[test]
fn what_another_parameter_forbids_is_not_sent() {
    let plant = Plant::of("gd350");
    plant.simulated().set_parameter(0x0004, 4000).unwrap();
    plant.is_not_sent(plant.drive.write("P00.03", 30.0), "P00.03 = 30.00 Hz is below P00.04 = 40.00 Hz");
    plant.drive.write("P00.03", 40.0).unwrap();
    assert_eq!(plant.written(), [(0x8003, 4000)]);
}

/// GD350 manual, section 9.4.8: P00.03 is changed while it stands, P00.11 at any time.
#[test]
fn what_is_written_at_rest_alone_is_not_sent_to_a_motor_that_turns() {
    let plant = Plant::of("gd350");
    plant.drive.run(10.0).unwrap();
    plant.written();
    plant.is_not_sent(plant.drive.write("P00.03", 60.0), "P00.03 can be written only while it is stopped");
    plant.drive.write("P00.11", 5.0).unwrap();
    assert!(plant.turns("forward", 10.0));
    plant.drive.stop().unwrap();
    assert!(plant.stands());
    plant.drive.write("P00.03", 60.0).unwrap();
}

#[test]
fn a_confirmation_that_was_lost_is_cleared_up_by_reading() {
    for family in ["gd350", "vfd500"] {
        let plant = Plant::of(family);
        let name = if family == "gd350" { "P00.11" } else { "P07.01" };
        plant.drive.read(name).unwrap();
        let wire = plant.simulator.wire();
        plant.tap(move |frame| {
            if frame[1] == 0x06 {
                wire.drop_answers(1);
            }
        });
        plant.drive.write(name, 0).unwrap_or_else(|error| panic!("{family}: {error}"));
        assert_eq!(plant.written().len(), 1, "{family}: it is not repeated");
    }
}

#[test]
fn what_nothing_confirms_may_have_been_taken() {
    let plant = Plant::of("gd350");
    let wire = plant.simulator.wire();
    plant.tap(move |frame| {
        if frame[1] == 0x06 {
            wire.drop_answers(1000);
        }
    });
    let error = plant.drive.write("P00.11", 5.0).unwrap_err();
    assert!(error.may_have_acted(), "{error}");
    assert!(!matches!(error.kind(), ErrorKind::NotAllowed | ErrorKind::Refused), "{error}");
    assert!(error.to_string().starts_with("unit 1: P00.11: "), "{error}");
    assert!(!error.to_string().contains("not written"), "nobody knows that: {error}");
    assert_eq!(plant.written(), [(0x800B, 50)]);
}

#[test]
fn what_the_drive_refuses_it_has_not_taken() {
    let plant = Plant::of("gd350");
    plant.simulated().refuse(Refusals::new(0x04).of(Asked::Writes)).unwrap();
    for done in [
        plant.drive.write("P00.11", 5.0),
        plant.drive.write_values([("P00.11", 5.0)], Store::Eeprom),
        plant.drive.give(Setpoint::Torque, 50.0),
        plant.drive.set_bits(Setpoint::VirtualInputs, [("S1", true)]),
        plant.drive.set_bits(Setpoint::VirtualOutputs, [("Y1", true)]),
    ] {
        let error = done.unwrap_err();
        assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Refused, false), "{error}");
        assert_eq!(error.code(), Some(0x04));
    }
    assert_eq!(plant.written(), []);
}

#[test]
fn what_was_written_before_the_one_that_failed_counts() {
    let plant = Plant::of("gd350");
    plant.refuse(0x800B, 0x04);
    let error = plant.drive.write_values([("P00.12", 7.5), ("P00.11", 4.0)], Store::Ram).unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Refused, true), "{error}");
    assert_eq!(error.code(), Some(0x04));
    assert!(error.to_string().starts_with("unit 1: P00.11: "), "{error}");
    assert!(error.to_string().ends_with("; written before it: P00.12"), "{error}");
    assert_eq!(plant.written(), [(0x800C, 75)]);
}

/// Which of them it took, no page says: what it has then, the message does.
#[test]
fn a_refusal_of_values_that_share_a_request_may_have_taken_some() {
    let plant = Plant::of("gd350");
    plant.refuse(0x800B, 0x04);
    let error = plant.drive.write_values([("P00.11", 4.0), ("P00.12", 7.5)], Store::Ram).unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Refused, true), "{error}");
    assert!(error.to_string().contains("in force now: P00.11 = "), "{error}");
}

#[test]
fn a_drive_that_is_half_prepared_is_told_of() {
    let plant = Plant::as_it_comes("gd350");
    plant.refuse(0x8006, 0x04);
    let error = plant.drive.prepare().unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Refused, true), "{error}");
    assert!(error.to_string().ends_with("; written before it: P00.01"), "{error}");
    assert_eq!(plant.written(), [(0x8001, 2)]);
}

#[test]
fn a_drive_that_falls_silent_when_it_is_prepared_may_be() {
    let plant = Plant::as_it_comes("gd350");
    let (wire, mut is_prepared) = (plant.simulator.wire(), false);
    plant.tap(move |frame| {
        if is_prepared && frame[1] == 0x03 {
            wire.drop_answers(1000);
        }
        is_prepared |= frame[..4] == [1, 0x06, 0x80, 0x06];
    });
    let error = plant.drive.prepare().unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Unconfirmed, true), "{error}");
    assert!(
        error.to_string().starts_with("it took the values, and what it has now could not be read: unit 1, "),
        "{error}"
    );
    // Before anything was written, it is no more than a read that failed.
    let silent = Plant::as_it_comes("gd350");
    silent.simulator.wire().drop_answers(1000);
    let error = silent.drive.prepare().unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::NoAnswer, false), "{error}");
}

/// GD350 manual, section 9.4.5: 2002H is the PID setpoint, 2004H the torque, 1000 of each are 100.0 %.
#[test]
fn other_setpoints_are_given_to_a_drive_that_heeds_them() {
    let plant = Plant::of("gd350");
    let drive = &plant.drive;
    drive.give(Setpoint::Torque, 50.0).unwrap();
    assert_eq!(plant.written(), [(0x2004, 500)]);
    plant.is_not_sent(drive.give(Setpoint::Torque, 1e6), "torque of unit 1: ");
    plant.is_not_sent(drive.give(Setpoint::Pid, 25.0), "pid of unit 1: the drive would ignore it: P09.00 is ");
    drive.prepare_for(Setpoint::Pid, Store::Ram).unwrap();
    plant.written();
    drive.give(Setpoint::Pid, 25.0).unwrap();
    assert_eq!(plant.written(), [(0x2002, 250)]);
    plant.is_not_sent(drive.give(Setpoint::VirtualInputs, 1), "it can move the motor");
    let eds300 = Plant::of("eds300");
    eds300.is_not_sent(eds300.drive.give(Setpoint::Torque, 1), "torque of unit 1: no such setpoint");
}

/// GD350 manual, section 9.4.5: of 200AH bit 0 is S1, of 200BH bit 0 is Y1.
#[test]
fn bits_are_set_by_their_names() {
    let plant = Plant::of("gd350");
    let drive = &plant.drive;
    drive.set_bits(Setpoint::VirtualInputs, [("S1", true), ("S2", true)]).unwrap();
    assert_eq!(plant.written(), [(0x200A, 0b11)]);
    drive.set_bits(Setpoint::VirtualInputs, [("S1", false)]).unwrap();
    assert_eq!(plant.written(), [(0x200A, 0b10)], "what is not named stays");
    drive.set_bits(Setpoint::VirtualOutputs, [("Y1", 1)]).unwrap();
    assert_eq!(plant.written(), [(0x200B, 1)]);
    drive.set_bits(Setpoint::SpecialControl, [("motor", "motor 2")]).unwrap();
    assert_eq!(plant.written(), [(0x2009, 1)]);
    plant.is_not_sent(drive.set_bits(Setpoint::SpecialControl, [("motor", 9)]), "motor cannot be that; allowed is ");
    plant.is_not_sent(
        drive.set_bits(Setpoint::VirtualInputs, [("S99", true)]),
        "virtual_inputs of unit 1: it has no S99",
    );
    plant.is_not_sent(drive.set_bits(Setpoint::VirtualInputs, [("S1", true); 0]), "nothing to set was named");
    plant.is_not_sent(drive.set_bits(Setpoint::Pid, [("S1", true)]), "it has no S1");
    plant.simulated().hold_fault(3).unwrap();
    plant.is_not_sent(drive.set_bits(Setpoint::VirtualInputs, [("S1", true)]), "it is in fault");
}

/// A virtual input may be what starts the motor.
#[test]
fn a_bit_that_can_move_the_motor_is_sent_once() {
    let plant = Plant::of("gd350");
    let wire = plant.simulator.wire();
    plant.tap(move |frame| {
        if [0x06, 0x10].contains(&frame[1]) {
            wire.drop_answers(1);
        }
    });
    let error = plant.drive.set_bits(Setpoint::VirtualInputs, [("S1", true)]).unwrap_err();
    assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::Unconfirmed, true), "{error}");
    assert_eq!(plant.written(), [(0x200A, 1)]);
    assert_eq!(plant.sent(Command::RunForward), 0);
}

#[tokio::test]
async fn the_calls_are_futures_too() {
    let plant = Plant::as_it_comes("gd350");
    let drive = plant.bus.aio().drive(1, &plant.profile).unwrap().unverified();
    assert!(drive.prepare().await.unwrap().iter().all(Setting::is_right));
    assert_eq!(plant.written(), [(0x8001, 2), (0x8006, 8)]);
    drive.prepare_for(Setpoint::Frequency, Store::Eeprom).await.unwrap();
    assert_eq!(plant.written(), [(0x0001, 2), (0x0006, 8)]);
    drive.write("P00.11", 5.0).await.unwrap();
    drive.write_values([("P00.12", 7.5)], Store::Eeprom).await.unwrap();
    assert_eq!(plant.written(), [(0x800B, 50), (0x000C, 75)]);
    drive.give(Setpoint::Torque, 50.0).await.unwrap();
    drive.set_bits(Setpoint::VirtualInputs, [("S1", true)]).await.unwrap();
    assert_eq!(plant.written().last(), Some(&(0x200A, 1)));
    plant.is_not_sent(drive.write("P00.11", 4000.0).await, "P00.11");
    plant.is_not_sent(drive.give(Setpoint::Torque, "much").await, "torque of unit 1");
    plant.is_not_sent(drive.set_bits(Setpoint::VirtualInputs, [("S99", true)]).await, "it has no S99");
}
