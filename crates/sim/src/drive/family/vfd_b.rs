//! Delta VFD-B: commands and setpoint of an MS300, one decimal in the current, and words at 2108H and 2109H where a VFD-E has its voltages.
//!
//! VFD-B manual of October 2005, pp. 76, 154 and 162 (5-16, 5-94 and 5-102); the bits of 2000H from LinuxCNC's vfdb_vfd.c, which also
//! sends 11H and 21H, and p. 514 of the CP2000 manual; those of 2101H from pp. 440 and 441 of the VFD-ED manual; 02-00 and 02-01 from
//! issue 328 of buildbotics/bbctrl-firmware. Every other address is refused with 02H.
//!
//! - Assumption: bits 3-2 of 2000H are ignored, and bits 5-4 = 0 keep the direction, which is forward here. So 6, by which
//!   a Goodrive coasts, runs it. Jogs (bits 1-0 = 3) and the words with other bits are out of range.
//! - Assumption: 2002H takes 0, which does nothing, and 2, the reset.
//! - Assumption: 02-01 = 3 or 4 obeys the bus, and 3 alone here; 02-00 = 5 takes the frequency from it, and else it is 50 Hz.
//!   Both are 0 from the factory.
//! - Assumption: frequencies count hundredths of a hertz, and voltages tenths of a volt. Words that are not on p. 162 are refused.
//! - Assumption: 20 words in any request; a read of two parameters is refused with 03H; 03H and 06H are its functions.
//! - Assumption: there is no address that RAM alone keeps. 2000H to 2002H cannot be read.
//! - Assumption: 03H for a word out of range, 02H for what can only be read or only be written, 04H for what is not done now.
//! - Assumption: it tells "running" (3) until it stands, and the direction that it was told. In fault it tells "stopped".
//! - Assumption: an overload trips 7, for the list of faults is not at hand. 09-02 and 09-03 are kept and do nothing: a silent bus
//!   trips nothing. Ramps have no parameters in the pages at hand; the times are fixed.

use std::borrow::Cow;

use super::{
    Bit, Family, Faults, Flag, Kind, Measure, Memory, Parameter, Range, Register, Roles, Shows, Speed, USUAL_DELAY,
    USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const FREQUENCY_SOURCE: u16 = 0x0200;
const COMMAND_SOURCE: u16 = 0x0201;
const BUS_FORMAT: u16 = 0x0904;

pub(crate) fn vfd_b() -> Family {
    Family {
        name: "vfd-b".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06],
        max_words: 20,
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
            obeys: vec![(COMMAND_SOURCE, 3)],
            speed_source: Some(vec![(COMMAND_SOURCE, 3), (FREQUENCY_SOURCE, 5)]),
            speed: Some(Speed::hertz(0x2001)),
            reads_single_parameters: true,
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(7), silent_bus: None },
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

/// p. 162.
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
    Register::read(0x2104, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x2105, Shows::Measured(Measure::BusVoltage, 10.0)),
    Register::read(0x2106, Shows::Measured(Measure::Voltage, 10.0)),
    Register::read(0x2107, Shows::Zero),
    Register::read(0x2108, Shows::Zero),
    Register::read(0x2109, Shows::Zero),
    Register::read(0x210A, Shows::Zero),
    Register::read(0x210B, Shows::Zero),
    Register::read(0x210C, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(0x210F, Shows::Zero),
    Register::read(0x2200, Shows::Zero),
    Register::read(0x2203, Shows::Zero),
    Register::read(0x2204, Shows::Zero),
    Register::read(0x2205, Shows::Zero),
    Register::read(0x2206, Shows::Zero),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(FREQUENCY_SOURCE, 0, 9, 0),
    Parameter::new(COMMAND_SOURCE, 0, 9, 0),
    // It is RTU 8N2 already, or it would not be on the line.
    Parameter::new(BUS_FORMAT, 0, 5, 3),
];
