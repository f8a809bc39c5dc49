//! Yaskawa J1000: commands by single bits at 0001H, as an A1000; parameters in RAM until an Enter command.
//!
//! J1000 User Manual SIEP C710606 33A, pp. 197, 198 and 206, and Technical Manual 31B, p. 231. Every other address is refused with 02H,
//! as 0900H is when it is read.
//!
//! - Assumption: bit 1 of 0001H runs in reverse, bit 3 resets a fault, 0 stops, as on a V1000 (its manual, p. 367). Other words are out
//!   of range.
//! - Assumption: 0020H has bit 0 while it runs, 1 in reverse, 2 ready, 3 with a fault. Bits 5 and 6 of the example (0065H) are outputs
//!   and not here. 0021H and 0022H are 0.
//! - Assumption: 0024H, 0026H and 0031H are output frequency, hundredths of an ampere and volts.
//! - Assumption: it was set up at its keypad: b1-01 and b1-02 are 2 (0180H and 0181H), o1-03 is 0 (0502H), which counts hundredths of
//!   a hertz: its example has 0258H for 60.0 Hz.
//! - Assumption: only 0 is an Enter command; other words at 0900H are out of range.
//! - Ramps have no parameters in the pages at hand; the times are fixed. An overload trips fault 11, which no word shows by
//!   number. A silent bus trips nothing.

use super::{
    Bit, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Shows, Speed, USUAL_DELAY,
    USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::Refusal;

const ENTER: u32 = 0x0900;
const FREQUENCY_SOURCE: u16 = 0x0180;
const COMMAND_SOURCE: u16 = 0x0181;
const SPEED_UNIT: u16 = 0x0502;

pub(crate) fn j1000() -> Family {
    Family {
        name: "j1000".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x08, 0x10],
        max_words: 16,
        across_groups: true,
        exception,
        memory: Memory::RamUntil(ENTER, 0),
        identification: 0,
        command: Some(0x0001),
        commands: COMMANDS.to_vec(),
        control_word: None,
        elsewhere: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
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

/// P. 206; that a password is refused with 22H is assumed.
fn exception(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function => 0x01,
        Refusal::Address | Refusal::Unreadable => 0x02,
        Refusal::Structure => 0x03,
        Refusal::Value => 0x21,
        Refusal::ReadOnly | Refusal::Running | Refusal::Password | Refusal::Locked => 0x22,
    }
}

const COMMANDS: &[(u16, Command)] = &[
    (0, Command::Stop),
    (1, Command::Run(Direction::Forward)),
    (2, Command::Run(Direction::Reverse)),
    (8, Command::ResetFault),
];

const REGISTERS: &[Register] = &[
    Register::set(0x0001, Range::Words(0, 8)),
    Register::set(0x0002, Range::Speed),
    Register::read(0x0020, Shows::bits(STATUS)),
    Register::read(0x0021, Shows::Zero),
    Register::read(0x0022, Shows::Zero),
    Register::read(0x0023, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x0024, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x0026, Shows::Measured(Measure::Current, 100.0)),
    Register::read(0x0031, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::write_only(ENTER, Range::Words(0, 0)),
];

const STATUS: &[Bit] = &[Bit::Running(0), Bit::Reverse(1), Bit::Ready(2), Bit::Fault(3)];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(FREQUENCY_SOURCE, 0, 3, 2).at_standstill(),
    Parameter::new(COMMAND_SOURCE, 0, 3, 2).at_standstill(),
    Parameter::shown(0x0425),
    Parameter::shown(0x0426),
    Parameter::shown(0x0427),
    Parameter::shown(0x0428),
    Parameter::shown(0x0429),
    Parameter::shown(0x042A),
    Parameter::shown(0x042B),
    Parameter::shown(SPEED_UNIT),
];
