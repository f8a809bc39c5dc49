//! Teco E510: a command word of bits at 2501H, the frequency at 2502H, the state at 2520H; parameters from 0000H on.
//!
//! E510 communication addendum (Teco-Westinghouse): command and monitor data, pp. 1-5 to 1-7; functions, p. 1-3; exceptions, p. 1-4;
//! which parameters there are, pp. 1-13 to 1-18. Every other address is refused with 02H.
//!
//! - Assumption: a wrong count of words is 03H, a value 04H, and 05H is for what can only be read, or not be written now. The examples
//!   of the addendum have 52H where its table has 02H; this one goes by the table.
//! - Assumption: bit 0 of 2520H is on until the motor stands. Bit 2 is on without a fault, bit 4 never.
//! - Assumption: a word with bit 3 resets a fault and does nothing else, one with bit 2 lets the motor coast and trips nothing; bits 6
//!   to 13 move nothing.
//! - Assumption: 00-02 = 2 obeys the bus and 00-05 = 5 takes the frequency from it; both are 0 from the factory. 00-12 counts hundredths
//!   of a hertz, and 00-14 and 00-15 tenths of a second from 0 to 50 Hz.
//! - Assumption: every parameter of its tables takes any word, and keeps it in EEPROM. 13-00 and 13-01, which a program reads, are 0.
//! - Assumption: 2528H, which the table leaves out, is 0. An overload trips 13; a silent bus trips nothing.

use super::{
    Bit, Bounds, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed,
    SpeedScale, SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::Refusal;

const COMMAND_SOURCE: u16 = 0x0002;
const FREQUENCY_SOURCE: u16 = 0x0005;
const UPPER_FREQUENCY: u16 = 0x000C;
const ACCELERATION: u16 = 0x000E;
const DECELERATION: u16 = 0x000F;

pub(crate) fn e510() -> Family {
    Family {
        name: "e510".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x08, 0x10],
        max_words: 16,
        across_groups: true,
        exception,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x2501),
        commands: Vec::new(),
        control_word: Some(decoded),
        elsewhere: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: parameters(),
        factory: &[],
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 2)],
            speed_source: Some(vec![(COMMAND_SOURCE, 2), (FREQUENCY_SOURCE, 5)]),
            speed: Some(Speed { register: 0x2502, unit: None, usual: SPEED }),
            upper_frequency: Some(Scaled::hundredths(UPPER_FREQUENCY)),
            acceleration: Some(Scaled::tenths(ACCELERATION)),
            deceleration: Some(Scaled::tenths(DECELERATION)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(13), silent_bus: None },
    }
}

/// P. 1-4.
fn exception(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function => 0x01,
        Refusal::Address | Refusal::Unreadable => 0x02,
        Refusal::Structure => 0x03,
        Refusal::Value => 0x04,
        Refusal::ReadOnly | Refusal::Running | Refusal::Password | Refusal::Locked => 0x05,
    }
}

/// P. 1-5: bit 0 operation, bit 1 reverse, bit 2 external fault, bit 3 fault reset.
fn decoded(_before: u16, word: u16) -> Command {
    match word & 0b1111 {
        0b1000.. => Command::ResetFault,
        0b0100.. => Command::Coast,
        0b0011 => Command::Run(Direction::Reverse),
        0b0001 => Command::Run(Direction::Forward),
        _ => Command::Stop,
    }
}

/// 0.00 to 650.00 Hz, as a L510: its manual, p. 118.
const SPEED: SpeedScale = SpeedScale { unit: SpeedUnit::Hertz, counts: 100.0, bounds: Bounds::new(0, 65_000) };

const REGISTERS: &[Register] = &[
    Register::set(0x2501, Range::Words(0, u16::MAX)),
    Register::set(0x2502, Range::Speed),
    Register::read(0x2520, Shows::bits(STATE)),
    Register::read(0x2521, Shows::Fault),
    Register::read(0x2522, Shows::Zero),
    Register::read(0x2523, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x2524, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x2525, Shows::Measured(Measure::Voltage, 10.0)),
    Register::read(0x2526, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(0x2527, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x2528, Shows::Zero),
    Register::read(0x2529, Shows::Zero),
    Register::read(0x252A, Shows::Zero),
    Register::read(0x252B, Shows::Zero),
    Register::read(0x252C, Shows::Zero),
    Register::read(0x252D, Shows::Zero),
];

const STATE: &[Bit] = &[Bit::Running(0), Bit::Reverse(1), Bit::Ready(2), Bit::Fault(3)];

/// The first and the last index of each run of parameters, by group.
const GROUPS: &[(u16, u16, u16)] = &[
    (0, 0, 20),
    (1, 0, 12),
    (2, 0, 7),
    (2, 14, 16),
    (3, 0, 26),
    (4, 0, 15),
    (5, 0, 48),
    (6, 0, 47),
    (7, 0, 14),
    (8, 0, 18),
    (9, 0, 9),
    (10, 0, 22),
    (11, 0, 17),
    (12, 0, 15),
];

fn parameters() -> Vec<Parameter> {
    let known = [
        Parameter::new(COMMAND_SOURCE, 0, 3, 0).at_standstill(),
        Parameter::new(FREQUENCY_SOURCE, 0, 7, 0).at_standstill(),
        Parameter::new(UPPER_FREQUENCY, 0, 65_000, 5_000),
        Parameter::new(ACCELERATION, 1, 36_000, 100),
        Parameter::new(DECELERATION, 1, 36_000, 100),
        Parameter::shown(0x0D00),
        Parameter::shown(0x0D01),
    ];
    let printed = GROUPS.iter().flat_map(|&(group, first, last)| (first..=last).map(move |index| group << 8 | index));
    let others = printed.filter(|&address| known.iter().all(|each| each.address != address));
    others.map(|address| Parameter::new(address, 0, u16::MAX, 0)).chain(known).collect()
}
