//! Yaskawa A1000: commands by single bits at 0001H, where 0 is the stop.
//!
//! A1000 Technical Manual SIEP C710616, pp. 559 and 561 of edition 27G and p. 494 of 27C. Every other address is refused
//! with 02H. 06H is refused with 01H: the manual of a PROFIBUS option for V1000 (p. 21) names 03H, 08H and 10H alone.
//!
//! - Assumption: H5-12 is 0: bit 0 runs forward, bit 1 in reverse. Both together, and bit 2 (EF0), are out of range here, as
//!   are the inputs in bits 4 to 11.
//! - Assumption: it was set up at its keypad: b1-01 and b1-02 are 2 (0180H and 0181H), o1-03 is 0 (0502H), which counts
//!   hundredths of a hertz. A write to them needs an Enter command, so they cannot be written here.
//! - Assumption: 0023H, 0024H and 0026H are set frequency, output frequency and tenths of an ampere, though examples of its sisters call
//!   0024H U1-01, the setpoint. 0032H and the other
//!   words between are not here.
//! - Assumption: it refuses as its sisters do: 01H, 02H, 03H, 21H and 22H of a GA500 (SIEPC71061753C, p. 245).
//! - Assumption: 0001H and 0002H read as they were written. No output is ever closed (002DH), and there is no PID (0038H, 0039H).
//! - Ramps have no parameters in the pages at hand; the times are fixed. An overload trips fault 11, which no word shows by
//!   number. A silent bus trips nothing.

use super::{
    Bit, Bounds, Family, Faults, Flag, Kind, MAX_WORDS, Measure, Memory, Parameter, Range, Register, Roles, Shows,
    Speed, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::map::Access;
use crate::drive::refusal::Refusal;

const FREQUENCY_SOURCE: u16 = 0x0180;
const COMMAND_SOURCE: u16 = 0x0181;
const UNIT_ADDRESS: u16 = 0x0425;
const SPEED_UNIT: u16 = 0x0502;

pub(crate) fn a1000() -> Family {
    Family {
        name: "a1000".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x08, 0x10],
        max_words: MAX_WORDS,
        across_groups: true,
        exception,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x0001),
        commands: COMMANDS.to_vec(),
        registers: REGISTERS.to_vec(),
        parameters: vec![
            set_up(FREQUENCY_SOURCE, 2),
            set_up(COMMAND_SOURCE, 2),
            set_up(SPEED_UNIT, 0),
            Parameter::shown(UNIT_ADDRESS),
        ],
        factory: &[],
        elsewhere: Vec::new(),
        control_word: None,
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 2)],
            speed_source: Some(vec![(COMMAND_SOURCE, 2), (FREQUENCY_SOURCE, 2)]),
            speed: Some(Speed::hertz(0x0002)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(11), silent_bus: None },
    }
}

/// That a password, and a motor that runs, are refused with 22H is assumed.
fn exception(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function => 0x01,
        Refusal::Address | Refusal::Unreadable => 0x02,
        Refusal::Structure => 0x03,
        Refusal::Value => 0x21,
        Refusal::ReadOnly | Refusal::Running | Refusal::Password | Refusal::Locked => 0x22,
    }
}

/// A parameter that only the keypad changes.
fn set_up(address: u16, factory: u16) -> Parameter {
    Parameter { address, access: Access::ReadOnly, bounds: Bounds::NONE, factory }
}

/// 0001H, p. 559.
const COMMANDS: &[(u16, Command)] = &[
    (0, Command::Stop),
    (1, Command::Run(Direction::Forward)),
    (2, Command::Run(Direction::Reverse)),
    (8, Command::ResetFault),
];

const REGISTERS: &[Register] = &[
    Register::set(0x0001, Range::Words(0, 8)),
    Register::set(0x0002, Range::Speed),
    Register::set(0x0004, Range::Signed(i16::MIN, i16::MAX)),
    Register::set(0x0006, Range::Signed(i16::MIN, i16::MAX)),
    Register::read(0x0023, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x0024, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x0026, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x002A, Shows::Zero),
    Register::read(0x002B, Shows::Inputs(None)),
    Register::read(0x002C, Shows::bits(STATUS_2)),
    Register::read(0x002D, Shows::Zero),
    Register::read(0x0031, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(0x0034, Shows::bits(&[Bit::Always(0x4130)])),
    Register::read(0x0035, Shows::Zero),
    Register::read(0x0038, Shows::Zero),
    Register::read(0x0039, Shows::Zero),
    Register::read(0x003D, Shows::Zero),
    Register::read(0x003E, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(0x003F, Shows::Measured(Measure::Frequency, 200.0)),
    Register::read(0x004B, Shows::bits(STATUS_1)),
    Register::read(0x007F, Shows::Zero),
    Register::read(0x0080, Shows::Zero),
    Register::read(0x00AC, Shows::Measured(Measure::Speed, 1.0)),
];

/// 002CH, p. 561.
const STATUS_2: &[Bit] = &[Bit::Running(0), Bit::Ready(6), Bit::Fault(14)];

/// 004BH (U1-12), p. 494 of edition 27C.
const STATUS_1: &[Bit] = &[
    Bit::Running(0),
    Bit::Reverse(2),
    Bit::Ready(5),
    Bit::OverloadAlarm(6),
    Bit::Fault(7),
    Bit::Either { flag: Flag::Obeying, low: 15, yes: 1, no: 0 },
];
