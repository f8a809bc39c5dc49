//! AutomationDirect GS4: the commands of a Delta drive at 2000H to 2002H, and a register each for run and jog at 091BH and 091FH.
//!
//! DURApulse GS4 user manual of 2017: pp. 502 (2000H to 2002H), 119 and 279 (P9.26 to P9.31), 312 and 313 (2100H to 2118H), 104 (P4.00),
//! 118 (the line), 134 (the ramps) and 320 (12 words). A run stays in force until the stop. Every other address is refused with 02H.
//!
//! - Assumption: bits 5-4 = 0 of 2000H keep the direction, which is forward here, and bits 3-2 are ignored. Jogs (bits 1-0 = 3) and the
//!   words with other bits are out of range.
//! - Assumption: 2002H takes 0, which does nothing, and 2, the reset. 2000H to 2002H cannot be read.
//! - Assumption: P9.27 runs it forward, and P9.28 keeps its word and turns nothing. P9.29 lets the motor coast and trips nothing. P9.31
//!   jogs a motor at rest; to one that runs it does nothing, and is not refused. All of them are kept in RAM.
//! - Assumption: P3.00 = 3 obeys the bus, and 3 alone here; P4.00 = 1 takes the frequency from it, and else it is 50 Hz. Both are 0 from
//!   the factory (P4.00 is printed).
//! - Assumption: P1.15 is 0 and is not looked at, so that P1.01 and P1.02 count hundredths, 10.00 s from the factory. They are the times
//!   from 0 to 50 Hz, for P0.04 is on no page at hand.
//! - Assumption: 2102H and 2103H count hundredths, as the example on p. 320.
//! - Assumption: 03H for a word out of range, 02H for what can only be read or only be written, 04H for what is not done now.
//! - Assumption: it tells "running" (3) until it stands, and the direction that it was told. In fault it tells "stopped".
//! - Assumption: an overload trips 21. P9.03 to P9.05 are kept and do nothing: a silent bus trips nothing.

use std::borrow::Cow;

use super::{
    Bit, Bounds, Family, Faults, Flag, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed,
    SpeedScale, SpeedUnit, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::map::Access;
use crate::drive::refusal::by_the_specification;

const RUN: u32 = 0x091B;
const DIRECTION: u32 = 0x091C;
const EXTERNAL_FAULT: u32 = 0x091D;
const RESET: u32 = 0x091E;
const JOG: u32 = 0x091F;
const ACCELERATION: u16 = 0x0101;
const DECELERATION: u16 = 0x0102;
const COMMAND_SOURCE: u16 = 0x0300;
const FREQUENCY_SOURCE: u16 = 0x0400;

pub(crate) fn gs4() -> Family {
    Family {
        name: "gs4".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x10],
        max_words: 12,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x2000),
        commands: COMMANDS.to_vec(),
        control_word: None,
        elsewhere: vec![
            (0x2002, 0, Command::Nothing),
            (0x2002, 2, Command::ResetFault),
            (RUN, 0, Command::Stop),
            (RUN, 1, Command::Run(Direction::Forward)),
            (EXTERNAL_FAULT, 0, Command::Nothing),
            (EXTERNAL_FAULT, 1, Command::Coast),
            (RESET, 0, Command::Nothing),
            (RESET, 1, Command::ResetFault),
            (JOG, 0, Command::JogStop),
            (JOG, 1, Command::Jog(Direction::Forward)),
        ],
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 3)],
            speed_source: Some(vec![(COMMAND_SOURCE, 3), (FREQUENCY_SOURCE, 1)]),
            speed: Some(Speed { register: 0x2001, unit: None, usual: SPEED }),
            acceleration: Some(Scaled::hundredths(ACCELERATION)),
            deceleration: Some(Scaled::hundredths(DECELERATION)),
            ..Roles::NONE
        },
        // P9.35, 2.0 ms.
        delay: 2,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(21), silent_bus: None },
    }
}

/// Hundredths of a hertz, up to 600.00.
const SPEED: SpeedScale = SpeedScale { unit: SpeedUnit::Hertz, counts: 100.0, bounds: Bounds::new(0, 60_000) };

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

/// Bits 1-0 and 4-3 of 2101H, bit 12 (it runs) and bit 10 (the bus commands).
const REGISTERS: &[Register] = &[
    Register::read(0x091A, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::set(RUN, Range::Words(0, 1)),
    Register::set(DIRECTION, Range::Words(0, 1)),
    Register::set(EXTERNAL_FAULT, Range::Words(0, 1)),
    Register::set(RESET, Range::Words(0, 1)),
    Register::set(JOG, Range::Words(0, 1)),
    Register::write_only(0x2000, Range::Words(0, 0x22)),
    Register::write_only(0x2001, Range::Speed),
    Register::write_only(0x2002, Range::Words(0, 2)),
    Register::read(0x2100, Shows::Fault),
    Register::read(
        0x2101,
        Shows::State(
            [0x1003, 0x101B, 0, 0],
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
    Register::read(0x2118, Shows::Fault),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(ACCELERATION, 0, 60_000, 1_000),
    Parameter::new(DECELERATION, 0, 60_000, 1_000),
    Parameter::new(COMMAND_SOURCE, 0, 5, 0),
    Parameter::new(FREQUENCY_SOURCE, 0, 4, 0),
    Parameter { address: 0x0921, access: Access::ReadOnly, bounds: Bounds::NONE, factory: 970 },
];
