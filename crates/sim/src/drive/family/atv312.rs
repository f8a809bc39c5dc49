//! Schneider Altivar 312: led through the states of CiA 402 by the bits of CMD (8501), which ETA (3201) shows.
//!
//! From the manuals of the maker (Schneider BBV51701, pp. 10 to 39, and BBV52816): 06H, 07H and then 0FH; ETA shows 0240H, 0221H, 0223H
//! and 0227H. 080FH runs in reverse. 06H and 00H take the voltage off a motor that runs, 07H brings it down its ramp. ACC and dEC are
//! 3.0 s from the factory, and count from 0 to FrS.
//!
//! - Assumption: somebody has set LAC to L3 at its keypad, and SLL to 0, so that a silent bus does nothing; from the factory they are
//!   0 (L1) and 1. What L1 and L2 change is not done here.
//! - Assumption: 80H resets a fault, whatever the word before it. A fault and its reset lead back to the beginning.
//! - Assumption: bits of CMI other than 1 do nothing. What is stored is there at once, in any state of the motor.
//! - Assumption: CMD takes these words only, and 02H (quick stop) is none of them. Other words are out of range.
//! - Assumption: a command at 8601 is obeyed without the words before it.
//! - Assumption: it obeys the bus while Fr1 is 164, and is at AI1 from the factory: the setpoint is then that of the keypad.
//! - Assumption: 50.0 Hz is the frequency in FrS, HSP and at the keypad.

use super::{
    Bit, Bounds, Family, Faults, Handshake, Kind, Measure, Memory, OnSilence, Parameter, Range, Register, Roles,
    Scaled, Shows, Silence, Speed, SpeedScale, SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const COMMAND: u32 = 8501;
/// CMI: bit 1 stores all that was set in EEPROM, and goes back to 0 (p. 20).
const EXTENDED_COMMAND: u32 = 8504;
/// CMDD: the same, for a setpoint in rpm (p. 16).
const SPEED_COMMAND: u32 = 8601;
const MAX_FREQUENCY: u16 = 3103;
const HIGH_SPEED: u16 = 3104;
const SETPOINT_SOURCE: u16 = 8413;
const ACCESS_LEVEL: u16 = 3006;
const TIMEOUT: u16 = 6005;
const ON_SILENCE: u16 = 7010;
const ACCELERATION: u16 = 9001;
const DECELERATION: u16 = 9002;
/// In Fr1.
const MODBUS: u16 = 164;

pub(crate) fn atv312() -> Family {
    Family {
        name: "atv312".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x10],
        max_words: 29,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::RamUntil(EXTENDED_COMMAND, 0x0002),
        identification: 0,
        command: Some(COMMAND),
        commands: COMMANDS.to_vec(),
        control_word: None,
        elsewhere: COMMANDS.iter().map(|&(word, command)| (SPEED_COMMAND, word, command)).collect(),
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        capped: &[],
        roles: Roles {
            max_written: Some(27),
            obeys: vec![(ACCESS_LEVEL, 2), (SETPOINT_SOURCE, MODBUS)],
            speed: Some(Speed { register: 8502, unit: None, usual: SPEED }),
            max_frequency: Some(Scaled::tenths(MAX_FREQUENCY)),
            upper_frequency: Some(Scaled::tenths(HIGH_SPEED)),
            acceleration: Some(Scaled::tenths(ACCELERATION)),
            deceleration: Some(Scaled::tenths(DECELERATION)),
            bus_timeout: Some(Scaled::tenths(TIMEOUT)),
            on_silence: Some(Silence {
                parameter: ON_SILENCE,
                words: vec![(1, OnSilence::Trip), (6, OnSilence::Stop)],
            }),
            handshake: Some(Handshake { idle: 0x0240, words: vec![(0x06, 0x0221), (0x07, 0x0223)] }),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(0x1000), silent_bus: Some(0x7510) },
    }
}

/// In tenths of a hertz; a negative one turns the other way (assumed).
const SPEED: SpeedScale =
    SpeedScale { unit: SpeedUnit::Hertz, counts: 10.0, bounds: Bounds { signed: true, ..Bounds::new(-5_000, 5_000) } };

const COMMANDS: &[(u16, Command)] = &[
    (0x0000, Command::Coast),
    (0x0006, Command::Coast),
    (0x0007, Command::Stop),
    (0x000F, Command::Run(Direction::Forward)),
    (0x080F, Command::Run(Direction::Reverse)),
    (0x0080, Command::ResetFault),
];

const REGISTERS: &[Register] = &[
    Register::read(3201, Shows::State([0x0227, 0x8227, 0x0240, 0x0208], std::borrow::Cow::Borrowed(&[]))),
    Register::read(3202, Shows::Measured(Measure::SignedFrequency, 10.0)),
    Register::read(3203, Shows::Measured(Measure::Setpoint, 10.0)),
    Register::read(3204, Shows::Measured(Measure::Current, 10.0)),
    Register::read(3205, Shows::Measured(Measure::Torque, 100.0)),
    Register::read(3206, Shows::bits(&[Bit::Running(4)])),
    Register::read(3207, Shows::Zero),
    Register::read(3209, Shows::Zero),
    Register::read(3211, Shows::Measured(Measure::Power, 100.0)),
    Register::read(3231, Shows::Zero),
    Register::read(7121, Shows::Zero),
    Register::set(8501, Range::Words(0, u16::MAX)),
    Register::set(8502, Range::Speed),
    Register::set(EXTENDED_COMMAND, Range::Words(0, u16::MAX)),
    Register::set(SPEED_COMMAND, Range::Words(0, u16::MAX)),
    Register::read(8606, Shows::Fault),
    Register::read(9630, Shows::Zero),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(ACCESS_LEVEL, 0, 2, 2).at_standstill(),
    Parameter::new(TIMEOUT, 1, 100, 100).at_standstill(),
    Parameter::new(ON_SILENCE, 0, 7, 0).at_standstill(),
    Parameter::new(MAX_FREQUENCY, 100, 5_000, 600).at_standstill(),
    Parameter::new(HIGH_SPEED, 0, 5_000, 500).not_above(MAX_FREQUENCY),
    Parameter::new(SETPOINT_SOURCE, 1, 167, 1).at_standstill(),
    Parameter::new(ACCELERATION, 1, 32_760, 30),
    Parameter::new(DECELERATION, 1, 32_760, 30),
];
