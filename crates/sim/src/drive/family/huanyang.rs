//! Huanyang HY: its maker's own protocol, which is no Modbus. Registers here are a function of it and a number, as its master has
//! them: 0100H and up are parameters, 0300H the control, 0400H and up what it measures, 0500H the frequency.
//!
//! LinuxCNC, src/hal/user_comps/huanyang-vfd/hy_vfd.c and hy_comm.c; FluidNC, Spindles/VFD/HuanyangProtocol.cpp; Dema D5M manual,
//! pp. 68 to 72 (bits of the control and of its answer, numbers of what it measures).
//!
//! - Assumption: of the control 01H and 03H run forward, 11H, 05H and 13H in reverse, and bit 3 stops, whatever else is set. Of the jogs
//!   each bit is one, and the stop ends it. A word without bits does nothing.
//! - Assumption: PD001 = 2 obeys the bus, and PD002 = 2 takes the frequency from it, else it is PD003. Both are 0 from the factory. PD005
//!   is the highest frequency, 50 Hz from the factory, PD011 the lowest; PD014 and PD015 are the ramps from and to PD005.
//! - Assumption: PD023 = 0 forbids nothing here; a simulated drive turns both ways.
//! - Assumption: a parameter whose highest value fits a byte is answered by one, any other by two.
//! - Assumption: every write of a parameter is kept in EEPROM. An overload trips, and nothing of the protocol shows it; a silent bus
//!   trips nothing. It answers after 5 ms.

use drivebus_rtu::huanyang::Protocol;

use super::{
    Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed, USUAL_DELAY,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const CONTROL: u32 = 0x0300;
const FREQUENCY: u32 = 0x0500;
const COMMAND_SOURCE: u16 = 0x0101;
const FREQUENCY_SOURCE: u16 = 0x0102;
const KEYPAD_FREQUENCY: u16 = 0x0103;
const MAX_FREQUENCY: u16 = 0x0105;
const ACCELERATION: u16 = 0x010E;
const DECELERATION: u16 = 0x010F;
const UNIT_ADDRESS: u16 = 0x01A3;
/// Its number of the overload, which nobody is told.
const OVERLOAD: u16 = 1;

pub(crate) fn huanyang() -> Family {
    Family {
        name: "huanyang-hy".into(),
        kind: Kind::Inverter,
        functions: vec![0x01, 0x02, 0x03, 0x04, 0x05],
        max_words: 1,
        across_groups: false,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(CONTROL),
        commands: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        elsewhere: Vec::new(),
        control_word: Some(decoded),
        capped: &[],
        roles: Roles {
            protocol: Protocol::Huanyang,
            obeys: vec![(COMMAND_SOURCE, 2)],
            speed_source: Some(vec![(COMMAND_SOURCE, 2), (FREQUENCY_SOURCE, 2)]),
            speed: Some(Speed::hertz(FREQUENCY)),
            keypad_frequency: Some(Scaled::hundredths(KEYPAD_FREQUENCY)),
            max_frequency: Some(Scaled::hundredths(MAX_FREQUENCY)),
            acceleration: Some(Scaled::tenths(ACCELERATION)),
            deceleration: Some(Scaled::tenths(DECELERATION)),
            unit_address: Some(UNIT_ADDRESS),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: 400.0,
        faults: Faults { overload: Some(OVERLOAD), silent_bus: None },
    }
}

/// Function 03, D5M manual, p. 71.
fn decoded(_before: u16, word: u16) -> Command {
    let is = |bit: u32| word & (1 << bit) != 0;
    let direction = if is(4) || is(2) { Direction::Reverse } else { Direction::Forward };
    match () {
        () if is(3) => Command::Stop,
        () if is(0) => Command::Run(direction),
        () if is(7) => Command::Jog(Direction::Reverse),
        () if is(6) || is(5) => Command::Jog(Direction::Forward),
        () => Command::Nothing,
    }
}

const REGISTERS: &[Register] = &[
    Register::write_only(CONTROL, Range::Words(0, 0xFF)),
    Register::read(0x0400, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x0401, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x0402, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x0403, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(0x0404, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(0x0405, Shows::Measured(Measure::Voltage, 1.0)),
    Register::read(0x0406, Shows::Zero),
    Register::read(0x0407, Shows::Zero),
    Register::write_only(FREQUENCY, Range::Speed),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(0x0100, 0, 1, 0),
    Parameter::new(COMMAND_SOURCE, 0, 2, 0),
    Parameter::new(FREQUENCY_SOURCE, 0, 2, 0),
    Parameter::new(KEYPAD_FREQUENCY, 0, 40_000, 0),
    Parameter::new(0x0104, 0, 40_000, 5_000),
    Parameter::new(MAX_FREQUENCY, 5_000, 40_000, 5_000),
    Parameter::new(0x010B, 0, 40_000, 0),
    Parameter::new(ACCELERATION, 1, 65_000, 100),
    Parameter::new(DECELERATION, 1, 65_000, 100),
    Parameter::new(0x0117, 0, 1, 1),
    Parameter::new(0x018D, 1, 5_000, 2_200),
    Parameter::new(0x018E, 1, 5_000, 70),
    Parameter::new(0x018F, 2, 10, 4),
    Parameter::new(0x0190, 0, 9_999, 1_440),
    Parameter::new(UNIT_ADDRESS, 0, 250, 1),
    Parameter::new(0x01A4, 0, 3, 1),
    Parameter::new(0x01A5, 0, 5, 3),
];
