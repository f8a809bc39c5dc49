//! Siemens SINAMICS V20, over its process data: control word at 0063H (40100), setpoint at 0064H, status word at 006DH.
//!
//! The registers up to 001DH are those of its manual's page 112 (easymanua.ls siemens sinamics-v20-series). The bits of both words
//! are FluidNC's (SiemensV20.cpp), and those of the G120C manual (p. 235): bit 11 turns the setpoint round, so 047FH
//! runs forward and 0C7FH in reverse.
//!
//! - Assumption: a run is obeyed only behind 047EH (OFF1), which 047CH (OFF2), 04FEH (a reset) and the power take back.
//! - Assumption: other words are out of range, and so are those at 0003H to 0006H, which set single bits of the control word: they are
//!   taken and do nothing here.
//! - Assumption: it obeys the bus always (P0700 and P1000 are 5). 50.00 Hz are its reference, until P2000 says another one, and its highest
//!   frequency.
//! - Assumption: an overload is fault 11; no register at hand shows its number.
//! - Assumption: it refuses what is not here with 02H, and what is out of range with 03H. A silent bus is not watched.

use super::{
    Deciding, Family, Faults, Handshake, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows,
    Speed, SpeedScale, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const COMMAND: u32 = 0x0063;
const REFERENCE: u16 = 0x000F;
const ACCELERATION: u16 = 0x000A;
const DECELERATION: u16 = 0x000B;

pub(crate) fn v20() -> Family {
    Family {
        name: "v20".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x10],
        max_words: 125,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(COMMAND),
        commands: COMMANDS.to_vec(),
        control_word: None,
        elsewhere: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        capped: &[],
        roles: Roles {
            max_written: Some(123),
            speed: Some(Speed {
                register: 0x0064,
                unit: Some(Deciding::Share(Scaled::hundredths(REFERENCE), COUNTS)),
                usual: SpeedScale::share(COUNTS, 50.0),
            }),
            acceleration: Some(Scaled::hundredths(ACCELERATION)),
            deceleration: Some(Scaled::hundredths(DECELERATION)),
            handshake: Some(Handshake { idle: 0x0240, words: vec![(0x047E, 0x0231)] }),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(11), silent_bus: None },
    }
}

/// 4000H are the reference frequency; below zero it turns the other way.
const COUNTS: f64 = 16_384.0;

const COMMANDS: &[(u16, Command)] = &[
    (0x047C, Command::Coast),
    (0x047E, Command::Stop),
    (0x0C7E, Command::Stop),
    (0x047F, Command::Run(Direction::Forward)),
    (0x0C7F, Command::Run(Direction::Reverse)),
    (0x04FE, Command::ResetFault),
];

const REGISTERS: &[Register] = &[
    Register::set(0x0000, Range::Words(0, u16::MAX)),
    Register::set(0x0001, Range::Words(0, u16::MAX)),
    Register::set(0x0002, Range::Words(0, 10_000)),
    Register::set(0x0003, Range::Words(0, 1)),
    Register::set(0x0004, Range::Words(0, 1)),
    Register::set(0x0005, Range::Words(0, 1)),
    Register::set(0x0006, Range::Words(0, 1)),
    Register::read(0x0017, Shows::Measured(Measure::SignedFrequency, 100.0)),
    Register::read(0x0018, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(0x0019, Shows::Measured(Measure::Current, 100.0)),
    Register::read(0x001A, Shows::Zero),
    Register::read(0x001B, Shows::Zero),
    Register::read(0x001C, Shows::Zero),
    Register::read(0x001D, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::set(0x0063, Range::Words(0, u16::MAX)),
    Register::set(0x0064, Range::Speed),
    Register::read(0x006D, Shows::State([0x4237, 0x0237, 0x0240, 0x0208], std::borrow::Cow::Borrowed(&[]))),
    Register::read(0x006E, Shows::Measured(Measure::SignedFrequency, 16_384.0 / 50.0)),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(ACCELERATION, 0, 65_000, 1_000),
    Parameter::new(DECELERATION, 0, 65_000, 1_000),
    Parameter::new(REFERENCE, 100, 59_900, 5_000),
];
