//! AutomationDirect GS2: a register each for run, direction, frequency and reset, at 091AH to 091EH.
//!
//! LinuxCNC, gs2_vfd.c: these registers, 2100H to 210CH and which parameters there are; DURApulse GS3 manual, p. 162: 2101H to 2105H,
//! P3.00 and P4.00. Every other address is refused with 02H.
//!
//! - Assumption: P3.00 = 3 obeys the bus, and 3 alone here; P4.00 = 5 takes the frequency from it, and else it is 50 Hz. Both are 0
//!   from the factory.
//! - Assumption: 091AH to 091EH are kept in RAM and can be read. 091DH = 1 lets the motor coast and trips nothing.
//! - Assumption: 091CH = 1 reverses a motor that runs. P1.00 = 1 makes a stop a coast.
//! - Assumption: P1.01 and P1.02 are the times from 0 to 50 Hz, 10.0 s from the factory.
//! - Assumption: 03H and 06H alone, 20 words; 03H for a value, 02H for what can only be read, 04H for what is not done now.
//! - Assumption: it tells "running" (3) until it stands, and the direction that it was told. In fault it tells "stopped".
//! - Assumption: 2108H is the output frequency again, and 2109H to 210CH are 0. An overload trips 4; a silent bus trips nothing.
//! - Assumption: P9.41 is 2.
//! - Assumption: it takes the commands of a Delta drive at 2000H, as a GS4 does (its manual, p. 502), which is the worst for who takes it
//!   for another family. It has no setpoint at 2001H.

use std::borrow::Cow;

use super::{
    Bounds, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed, SpeedScale,
    SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::map::Access;
use crate::drive::refusal::by_the_specification;

const RUN: u32 = 0x091B;
const DIRECTION: u32 = 0x091C;
const EXTERNAL_FAULT: u32 = 0x091D;
const RESET: u32 = 0x091E;
const DELTA: u32 = 0x2000;
const STOP_METHOD: u16 = 0x0100;
const ACCELERATION: u16 = 0x0101;
const DECELERATION: u16 = 0x0102;
const COMMAND_SOURCE: u16 = 0x0300;
const FREQUENCY_SOURCE: u16 = 0x0400;

pub(crate) fn gs2() -> Family {
    Family {
        name: "gs2".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06],
        max_words: 20,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(RUN),
        commands: vec![(0, Command::Stop), (1, Command::Run(Direction::Forward))],
        control_word: None,
        elsewhere: vec![
            (EXTERNAL_FAULT, 0, Command::Nothing),
            (EXTERNAL_FAULT, 1, Command::Coast),
            (RESET, 0, Command::Nothing),
            (RESET, 1, Command::ResetFault),
            (DELTA, 0x01, Command::Stop),
            (DELTA, 0x05, Command::Stop),
            (DELTA, 0x02, Command::Run(Direction::Forward)),
            (DELTA, 0x06, Command::Run(Direction::Forward)),
            (DELTA, 0x12, Command::Run(Direction::Forward)),
            (DELTA, 0x22, Command::Run(Direction::Reverse)),
        ],
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 3)],
            speed_source: Some(vec![(COMMAND_SOURCE, 3), (FREQUENCY_SOURCE, 5)]),
            speed: Some(Speed { register: 0x091A, unit: None, usual: SPEED }),
            direction: Some((DIRECTION, 1)),
            coasts_to_stop: Some((STOP_METHOD, 1)),
            acceleration: Some(Scaled::tenths(ACCELERATION)),
            deceleration: Some(Scaled::tenths(DECELERATION)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(4), silent_bus: None },
    }
}

/// Tenths of a hertz, up to 400.0.
const SPEED: SpeedScale = SpeedScale { unit: SpeedUnit::Hertz, counts: 10.0, bounds: Bounds::new(0, 4_000) };

const REGISTERS: &[Register] = &[
    Register::set(0x091A, Range::Speed),
    Register::set(RUN, Range::Words(0, 1)),
    Register::set(DIRECTION, Range::Words(0, 1)),
    Register::set(EXTERNAL_FAULT, Range::Words(0, 1)),
    Register::set(RESET, Range::Words(0, 1)),
    Register::write_only(DELTA, Range::Words(0, 0x22)),
    Register::read(0x2100, Shows::Fault),
    Register::read(0x2101, Shows::State([0b00_0011, 0b01_1011, 0, 0], Cow::Borrowed(&[]))),
    Register::read(0x2102, Shows::Measured(Measure::Setpoint, 10.0)),
    Register::read(0x2103, Shows::Measured(Measure::Frequency, 10.0)),
    Register::read(0x2104, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x2105, Shows::Measured(Measure::BusVoltage, 10.0)),
    Register::read(0x2106, Shows::Measured(Measure::Voltage, 10.0)),
    Register::read(0x2107, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(0x2108, Shows::Measured(Measure::Frequency, 10.0)),
    Register::read(0x2109, Shows::Zero),
    Register::read(0x210A, Shows::Zero),
    Register::read(0x210B, Shows::Zero),
    Register::read(0x210C, Shows::Zero),
];

/// The table of gs2_vfd.c, and what P. 162 names.
const PARAMETERS: &[Parameter] = &[
    Parameter::new(STOP_METHOD, 0, 1, 0),
    Parameter::new(ACCELERATION, 0, 6_000, 100),
    Parameter::new(DECELERATION, 0, 6_000, 100),
    Parameter::new(0x0103, 0, u16::MAX, 0),
    Parameter::new(0x0104, 0, u16::MAX, 0),
    Parameter::new(0x0205, 0, u16::MAX, 0),
    Parameter::new(0x0206, 0, u16::MAX, 0),
    Parameter::new(0x0207, 0, u16::MAX, 0),
    Parameter::new(COMMAND_SOURCE, 0, 4, 0),
    Parameter::new(FREQUENCY_SOURCE, 0, 6, 0),
    Parameter::shown(0x0927),
    Parameter { address: 0x0929, access: Access::ReadOnly, bounds: Bounds::NONE, factory: 2 },
    Parameter::shown(0x092A),
];
