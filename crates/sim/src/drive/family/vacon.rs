//! Vacon 10: a control word of bits at ID 2001, a setpoint in hundredths of a percent at ID 2003, process data from ID 2101 on. An ID is one less
//! on the wire.
//!
//! Process data: Vacon 10 user's manual (easymanua.ls vacon 10), p. 95. Bits of both words, monitors and parameters: wirenboard/wb-mqtt-serial,
//! templates/config-vacon10.json; the bits also in the M-Max manual MN04020003E (easymanua.ls eaton mmx34aa3d3f0-0), pp. 153 and 155, P2.1, P3.3
//! and the silent bus in the same (m-max-series), p. 148. Functions and 11 addresses, and that 03H and 04H read the same: Vacon 20 complete user's manual (manualarchiveguide 4636979), p. 144.
//!
//! - Assumption: P2.1 and P3.3 are 1 and 3 from the factory, as in an M-Max. P3.1 is 0, and changes nothing here; P3.2 is 50.00 Hz.
//! - Assumption: P4.2 and P4.3 are the times from 0 to P3.2, 3.0 s from the factory. A stop goes along the ramp.
//! - Assumption: any control word is taken, and its other bits change nothing. Bit 3 coasts before all others. A reset is the rise of bit 2, and
//!   goes before a run.
//! - Assumption: "run" is on until it stands, and bit 2 of the status word says which way it turns. Bits 5 and 6 are 0.
//! - Assumption: 2004 and up, and IDs that the program does not read, are refused with 02H, as is what can only be read; what is out of range with
//!   03H. An overload trips nothing.

use drivebus_rtu::Table;

use super::{
    Bit, Bounds, Deciding, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows,
    Speed, SpeedScale, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::places::spot;
use crate::drive::refusal::by_the_specification;

const CONTROL_WORD: u32 = 2_000;
const GENERAL_CONTROL_WORD: u32 = 2_001;
const SETPOINT: u32 = 2_002;
const CONTROL_PLACE: u16 = 124;
const FREQUENCY_SOURCE: u16 = 116;
const SILENCE: u16 = 813;
const LOWEST: u16 = 100;
const HIGHEST: u16 = 101;
const ACCELERATION: u16 = 102;
const DECELERATION: u16 = 103;
/// Counts of 100 %.
const COUNTS: f64 = 10_000.0;

pub(crate) fn vacon10() -> Family {
    Family {
        name: "vacon10".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x04, 0x06, 0x10],
        max_words: 11,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(CONTROL_WORD),
        commands: Vec::new(),
        control_word: Some(control_word),
        elsewhere: Vec::new(),
        registers: registers(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        capped: &[],
        roles: Roles {
            obeys: vec![(CONTROL_PLACE, 3)],
            speed_source: Some(vec![(CONTROL_PLACE, 3), (FREQUENCY_SOURCE, 2)]),
            bus_timeout: Some(Scaled { address: SILENCE, counts: 1.0 }),
            speed: Some(Speed {
                register: SETPOINT,
                unit: Some(Deciding::Share(Scaled::hundredths(HIGHEST), COUNTS)),
                usual: SpeedScale { bounds: Bounds::new(0, 10_000), ..SpeedScale::share(COUNTS, 50.0) },
            }),
            max_frequency: Some(Scaled::hundredths(HIGHEST)),
            acceleration: Some(Scaled::tenths(ACCELERATION)),
            deceleration: Some(Scaled::tenths(DECELERATION)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: None, silent_bus: Some(53) },
    }
}

/// Bit 0 runs, 1 is the direction, 2 resets as it rises, 3 coasts.
fn control_word(before: u16, word: u16) -> Command {
    let is_set = |bit: u16| word & 1 << bit != 0;
    match () {
        () if is_set(3) => Command::Coast,
        () if is_set(2) && before & 1 << 2 == 0 => Command::ResetFault,
        () if is_set(0) && is_set(1) => Command::Run(Direction::Reverse),
        () if is_set(0) => Command::Run(Direction::Forward),
        () => Command::Stop,
    }
}

fn registers() -> Vec<Register> {
    let mut all = vec![
        Register::set(CONTROL_WORD, Range::Words(0, u16::MAX)),
        Register::set(GENERAL_CONTROL_WORD, Range::Words(0, u16::MAX)),
        Register::set(SETPOINT, Range::Speed),
    ];
    for (address, shows) in SHOWN {
        all.push(Register::read(u32::from(*address), shows.clone()));
        all.push(Register::read(spot(Table::Input, *address), shows.clone()));
    }
    all
}

/// Each by 03H and by 04H.
const SHOWN: &[(u16, Shows)] = &[
    // V1.1 and V1.3 to V1.10: IDs 1 to 9; V1.2: ID 25.
    (0, Shows::Measured(Measure::Frequency, 100.0)),
    (1, Shows::Measured(Measure::Speed, 1.0)),
    (2, Shows::Measured(Measure::Current, 100.0)),
    (3, Shows::Measured(Measure::Torque, 1_000.0)),
    (4, Shows::Measured(Measure::Power, 1_000.0)),
    (5, Shows::Measured(Measure::Voltage, 10.0)),
    (6, Shows::Measured(Measure::BusVoltage, 1.0)),
    (7, Shows::Zero),
    (8, Shows::Zero),
    (24, Shows::Measured(Measure::Setpoint, 100.0)),
    // IDs 2101 to 2111.
    (2_100, Shows::bits(STATUS_WORD)),
    (2_101, Shows::Zero),
    (2_102, Shows::Measured(Measure::Frequency, 200.0)),
    (2_103, Shows::Measured(Measure::SignedFrequency, 100.0)),
    (2_104, Shows::Measured(Measure::Speed, 1.0)),
    (2_105, Shows::Measured(Measure::Current, 100.0)),
    (2_106, Shows::Measured(Measure::Torque, 1_000.0)),
    (2_107, Shows::Measured(Measure::Power, 1_000.0)),
    (2_108, Shows::Measured(Measure::Voltage, 10.0)),
    (2_109, Shows::Measured(Measure::BusVoltage, 1.0)),
    (2_110, Shows::Fault),
];

const STATUS_WORD: &[Bit] = &[Bit::Ready(0), Bit::Running(1), Bit::Reverse(2), Bit::Fault(3), Bit::OverloadAlarm(4)];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(LOWEST, 0, 32_000, 0),
    Parameter::new(HIGHEST, 0, 32_000, 5_000),
    Parameter::new(ACCELERATION, 1, 30_000, 30),
    Parameter::new(DECELERATION, 1, 30_000, 30),
    Parameter::new(106, 0, u16::MAX, 0),
    Parameter::new(109, 0, u16::MAX, 400),
    Parameter::new(110, 0, 32_000, 5_000),
    Parameter::new(111, 0, 20_000, 1_440),
    Parameter::new(112, 0, u16::MAX, 0),
    Parameter::new(FREQUENCY_SOURCE, 0, 4, 3),
    Parameter::new(119, 0, 100, 85),
    Parameter::new(CONTROL_PLACE, 1, 3, 1),
    Parameter::new(SILENCE, 0, 255, 0),
];
