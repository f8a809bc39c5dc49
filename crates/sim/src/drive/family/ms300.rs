//! Delta MS300: words at the addresses of INVT drives that mean other things.
//!
//! MS300 manual, pp. 795, 798, 799 and 803, and its appendix in the manual of the MH300, p. 1023; the bits of 2000H from p. 514 of the
//! CP2000 manual, those of 2101H from p. 162 of the GS3 manual, drives of the same maker. Every other address is refused with 02H.
//!
//! - Assumption: bits 3-2 of 2000H are ignored, and bits 5-4 = 0 keep the direction, which is forward here. So 6, by which
//!   a Goodrive coasts, runs it. Jogs (bits 1-0 = 3) and the words with other bits are out of range.
//! - Assumption: 2002H takes 0, which does nothing, and 2, the reset. What its other bits do is set by parameters.
//! - Assumption: 00-21 = 2 obeys the bus; 00-20 = 1 takes the frequency from it, and else it is 50 Hz. Both are 0 from the
//!   factory.
//! - Assumption: there is no address that RAM alone keeps. 2000H to 2002H cannot be read, as their rows say W.
//! - Assumption: 03H for a word out of range, 02H for what can only be read or only be written, 04H for what is not done now.
//! - Assumption: it tells "running" (3) until it stands, and the direction that it was told. In fault it tells "stopped".
//! - Assumption: 2109H to 210BH and 210FH are 0, and 211FH says two decimals.
//! - Ramps have no parameters in the pages at hand; the times are fixed. A silent bus trips nothing.

use std::borrow::Cow;

use super::{
    Bit, Family, Faults, Flag, Kind, MAX_WORDS, Measure, Memory, Parameter, Range, Register, Roles, Shows, Speed,
    USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const FREQUENCY_SOURCE: u16 = 0x0014;
const COMMAND_SOURCE: u16 = 0x0015;

pub(crate) fn ms300() -> Family {
    Family {
        name: "ms300".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x10],
        max_words: MAX_WORDS,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x2000),
        commands: COMMANDS.to_vec(),
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        elsewhere: vec![(0x2002, 0, Command::Nothing), (0x2002, 2, Command::ResetFault)],
        control_word: None,
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 2)],
            speed_source: Some(vec![(COMMAND_SOURCE, 2), (FREQUENCY_SOURCE, 1)]),
            speed: Some(Speed::hertz(0x2001)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(21), silent_bus: None },
    }
}

/// 2000H, by its bits 1-0 and 5-4.
const COMMANDS: &[(u16, Command)] = &[
    (0x00, Command::Nothing),
    (0x01, Command::Stop),
    (0x02, Command::Run(Direction::Forward)),
    (0x04, Command::Nothing),
    (0x05, Command::Stop),
    (0x06, Command::Run(Direction::Forward)),
    (0x08, Command::Nothing),
    (0x11, Command::Stop),
    (0x12, Command::Run(Direction::Forward)),
    (0x21, Command::Stop),
    (0x22, Command::Run(Direction::Reverse)),
];

const REGISTERS: &[Register] = &[
    Register::write_only(0x2000, Range::Words(0, 0x22)),
    Register::write_only(0x2001, Range::Speed),
    Register::write_only(0x2002, Range::Words(0, 2)),
    Register::read(0x2100, Shows::Fault),
    Register::read(
        0x2101,
        Shows::State(
            [0b00_0011, 0b01_1011, 0, 0],
            Cow::Borrowed(&[Bit::Either { flag: Flag::Obeying, low: 10, yes: 1, no: 0 }]),
        ),
    ),
    Register::read(0x2102, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x2103, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x2104, Shows::Measured(Measure::Current, 100.0)),
    Register::read(0x2105, Shows::Measured(Measure::BusVoltage, 10.0)),
    Register::read(0x2106, Shows::Measured(Measure::Voltage, 10.0)),
    Register::read(0x2109, Shows::Zero),
    Register::read(0x210A, Shows::Zero),
    Register::read(0x210B, Shows::Zero),
    Register::read(0x210C, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(0x210F, Shows::Zero),
    Register::read(0x211F, Shows::Bits(Cow::Borrowed(&[Bit::Always(0x0200)]))),
];

const PARAMETERS: &[Parameter] = &[Parameter::new(FREQUENCY_SOURCE, 0, 9, 0), Parameter::new(COMMAND_SOURCE, 0, 5, 0)];
