//! Schneider Altivar 71: led through the states of CiA 402 by the bits of CMD (8501), which ETA (3201) shows.
//!
//! From the maker's manuals (Schneider AAV49428 and 1755863) and its lists of parameters (S383, V6.7, and that of the Altivar 61 and 71):
//! 06H, 07H and then 0FH, or 080FH in reverse; 07H stops, 00H takes the voltage off, 80H resets a fault. ETA and 006FH shows 40H, 21H,
//! 23H and 27H; its bit 4 is the mains, bit 9 is 1 while the bus commands, bit 15 the other way round (AAV49428, pp. 25 to 30). A run is
//! obeyed once the setpoint has been written, and one that comes before waits for it (pp. 26 and 62). With DOTD at 0 the motor coasts
//! when the run is taken back (p. 26). LFt (7121) keeps its number after a reset (p. 112). 08H is there, and a word that can only be read
//! is refused with 04H (1755863, pp. 30 and 39). Words that it has not are 8000H among others of a read, which is refused with 02H where
//! it has none of them (p. 39).
//!
//! - Assumption: DOTD is 1, the ramp, as the list says; by the manual it is 0 from the factory (p. 131).
//! - Assumption: its mains are on, and somebody has set SLL to 0, so that a silent bus does nothing; from the factory it is 1.
//! - Assumption: bit 9 of ETA is always 1. 06H coasts a motor that runs.
//! - Assumption: 80H resets a fault, whatever the word before it. A fault and its reset lead back to the beginning.
//! - Assumption: bits of CMI other than 1 do nothing. What is stored is there at once, in any state of the motor.
//! - Assumption: CMD takes these words only, and 02H (quick stop) and the halt (bit 8) are none of them. Other words are out of range.
//! - Assumption: a command at 8601, or at 12761, which passes it on to CMD, is obeyed without the words before it.
//! - Assumption: a setpoint is LFr (8502), LFrd (8602) or 12762, which passes it on to LFrd. LFrd moves nothing.
//! - Assumption: it obeys the bus while Fr1 is 164 and CHCF is 1 or 3, and is at AI1 from the factory: the setpoint is then that of the
//!   keypad.
//! - With CHCF = 3, the I/O profile, bit 0 of CMD is the forward command while it is 1 (AAV49428, p. 19; tCC = 2C from the factory).
//!   Assumption: no other bit has a meaning then, and 8601 and 12761 take the same words.
//! - Assumption: 50.0 Hz is the frequency in FrS, HSP and at the keypad, tFr is 60.0 Hz (the latter is printed, p. 85). A value of HSP above tFr
//!   is refused, where a real one cuts it. A negative setpoint turns the other way, though rIn is not looked at.
//! - Assumption: HMIS shows rdY (2) or FLt (23) and nothing else. ACC and dEC are 3.0 s.

use super::{
    Absent, Bit, Bounds, Family, Faults, Flag, Handshake, Kind, Measure, Memory, OnSilence, OtherWords, Parameter,
    Range, Register, Roles, Scaled, Shows, Silence, Speed, SpeedScale, SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::{Refusal, by_the_specification};

const COMMAND: u32 = 8501;
const SETPOINT: u32 = 8502;
/// CMI: bit 1 stores all that was set in EEPROM, and goes back to 0.
const EXTENDED_COMMAND: u32 = 8504;
const SPEED_COMMAND: u32 = 8601;
const SPEED_SETPOINT: u32 = 8602;
/// nC1, which nCA1 leads to CMD from the factory, and nC2, which nCA2 leads to LFrd.
const SCANNER: u32 = 12761;
const SCANNER_2: u32 = 12762;
const MAX_FREQUENCY: u16 = 3103;
const HIGH_SPEED: u16 = 3104;
const CONTROL_MODE: u16 = 8401;
const SETPOINT_SOURCE: u16 = 8413;
const DISABLE_STOP: u16 = 8652;
const TIMEOUT: u16 = 6005;
const ON_SILENCE: u16 = 7010;
const ACCELERATION: u16 = 9001;
const DECELERATION: u16 = 9002;
/// dP0: the fault that LFt shows, too.
const LAST_FAULT: u16 = 7200;
/// In Fr1.
const MODBUS: u16 = 164;

pub(crate) fn atv71() -> Family {
    let also = |place| COMMANDS.iter().map(move |&(word, command)| (place, word, command));
    Family {
        name: "atv71".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x08, 0x10],
        max_words: 63,
        across_groups: true,
        exception: refusals,
        memory: Memory::RamUntil(EXTENDED_COMMAND, 0x0002),
        identification: 0,
        command: Some(COMMAND),
        commands: COMMANDS.to_vec(),
        control_word: None,
        elsewhere: also(SPEED_COMMAND).chain(also(SCANNER)).collect(),
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        capped: &[],
        roles: Roles {
            absent: Some(Absent { word: 0x8000, alone: false }),
            max_written: Some(61),
            obeys: vec![(CONTROL_MODE, 1), (SETPOINT_SOURCE, MODBUS)],
            other_words: Some(OtherWords { set_by: (CONTROL_MODE, 3), decode: by_inputs }),
            speed: Some(Speed { register: SETPOINT, unit: None, usual: SPEED }),
            max_frequency: Some(Scaled::tenths(MAX_FREQUENCY)),
            upper_frequency: Some(Scaled::tenths(HIGH_SPEED)),
            acceleration: Some(Scaled::tenths(ACCELERATION)),
            deceleration: Some(Scaled::tenths(DECELERATION)),
            coasts_to_stop: Some((DISABLE_STOP, 0)),
            bus_timeout: Some(Scaled::tenths(TIMEOUT)),
            on_silence: Some(Silence {
                parameter: ON_SILENCE,
                words: vec![(1, OnSilence::Trip), (6, OnSilence::Stop)],
            }),
            fault_history: (LAST_FAULT..LAST_FAULT + 9).collect(),
            handshake: Some(Handshake { idle: 0x0250, words: vec![(0x06, 0x0231), (0x07, 0x0233)] }),
            runs_after: &[SETPOINT, SPEED_SETPOINT, SCANNER_2],
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(17), silent_bus: Some(5) },
    }
}

/// 1755863, p. 39: the codes of the specification, and 04H for a write of ETA.
fn refusals(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::ReadOnly => 0x04,
        other => by_the_specification(other),
    }
}

/// The I/O profile: bit 0 is the run forward.
fn by_inputs(_: u16, word: u16) -> Command {
    if word & 0x0001 == 0 { Command::Stop } else { Command::Run(Direction::Forward) }
}

/// In tenths of a hertz; a negative one turns the other way (assumed).
const SPEED: SpeedScale = SpeedScale {
    unit: SpeedUnit::Hertz,
    counts: 10.0,
    bounds: Bounds { signed: true, ..Bounds::new(-16_000, 16_000) },
};

const COMMANDS: &[(u16, Command)] = &[
    (0x0000, Command::Coast),
    (0x0006, Command::Coast),
    (0x0007, Command::Stop),
    (0x000F, Command::Run(Direction::Forward)),
    (0x080F, Command::Run(Direction::Reverse)),
    (0x0080, Command::ResetFault),
];

const ANYTHING: Range = Range::Words(0, u16::MAX);

const REGISTERS: &[Register] = &[
    Register::read(3201, Shows::State([0x0237, 0x8237, 0x0250, 0x0218], std::borrow::Cow::Borrowed(&[]))),
    Register::read(3202, Shows::Measured(Measure::SignedFrequency, 10.0)),
    Register::read(3203, Shows::Measured(Measure::Setpoint, 10.0)),
    Register::read(3204, Shows::Measured(Measure::Current, 10.0)),
    Register::read(3205, Shows::Measured(Measure::Torque, 1_000.0)),
    Register::read(3206, Shows::bits(&[Bit::Running(4)])),
    Register::read(3207, Shows::Zero),
    Register::read(3208, Shows::Measured(Measure::Voltage, 1.0)),
    Register::read(3209, Shows::Zero),
    Register::read(3211, Shows::Measured(Measure::Power, 100.0)),
    Register::read(3240, Shows::bits(&[Bit::Either { flag: Flag::Ready, low: 0, yes: 2, no: 23 }])),
    Register::read(
        7121,
        Shows::WrittenIf { parameter: LAST_FAULT, is: 0, register: 7121, otherwise: Some(LAST_FAULT) },
    ),
    Register::read(8441, Shows::bits(&[Bit::Either { flag: Flag::Obeying, low: 0, yes: 8, no: 1 }])),
    Register::read(8442, Shows::bits(&[Bit::Either { flag: Flag::Obeying, low: 0, yes: 8, no: 1 }])),
    Register::set(COMMAND, ANYTHING),
    Register::set(SETPOINT, Range::Speed),
    Register::set(EXTENDED_COMMAND, ANYTHING),
    Register::set(SPEED_COMMAND, ANYTHING),
    Register::set(SPEED_SETPOINT, ANYTHING),
    Register::read(8604, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(8606, Shows::Zero),
    Register::read(9630, Shows::Zero),
    Register::set(SCANNER, ANYTHING),
    Register::set(SCANNER_2, ANYTHING),
    Register::set(12763, ANYTHING),
    Register::set(12764, ANYTHING),
    Register::set(12765, ANYTHING),
    Register::set(12766, ANYTHING),
    Register::set(12767, ANYTHING),
    Register::set(12768, ANYTHING),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(TIMEOUT, 1, 300, 100).at_standstill(),
    Parameter::new(ON_SILENCE, 0, 8, 0).at_standstill(),
    Parameter::new(MAX_FREQUENCY, 100, 16_000, 600).at_standstill(),
    Parameter::new(HIGH_SPEED, 0, 16_000, 500).not_above(MAX_FREQUENCY),
    Parameter::new(CONTROL_MODE, 0, 3, 1).at_standstill(),
    Parameter::new(SETPOINT_SOURCE, 0, 510, 1).at_standstill(),
    Parameter::new(DISABLE_STOP, 0, 1, 1).at_standstill(),
    Parameter::new(ACCELERATION, 1, 60_000, 30),
    Parameter::new(DECELERATION, 1, 60_000, 30),
    Parameter::shown(7200),
    Parameter::shown(7201),
    Parameter::shown(7202),
    Parameter::shown(7203),
    Parameter::shown(7204),
    Parameter::shown(7205),
    Parameter::shown(7206),
    Parameter::shown(7207),
    Parameter::shown(7208),
];
