//! Schneider Altivar 600, the Altivar 630 among them: led through the states of CiA 402 by the bits of CMD (8501), which ETA (3201) shows.
//!
//! From the maker's list (Schneider EAV64332, V3.7): bits 0 to 3 and 7 of CMD are those of CiA 402, and none is the direction. Bit 4 of ETA
//! is the mains, bit 9 is 1 while the bus commands. ACC and dEC are 10.0 s from the factory. LFt (7121) has numbers of its own, dP0 (7200)
//! and those behind it are the last faults.
//!
//! - Assumption: 06H, 07H and then 0FH, as an Altivar 312 takes them. 06H coasts a motor that runs.
//! - Assumption: it stands at Stt = rMP with its mains on, and somebody has set SLL to 0, so that a silent bus does nothing.
//! - Assumption: bit 9 of ETA is always 1.
//! - Assumption: 80H resets a fault, whatever the word before it. A fault and its reset lead back to the beginning. LFt keeps its number.
//! - Assumption: bits of CMI other than 1 do nothing. What is stored is there at once, in any state of the motor.
//! - Assumption: CMD takes these words only; other words are out of range.
//! - Assumption: a command at 8601, or at 12761, which passes it on to CMD, is obeyed without the words before it.
//! - Assumption: it obeys the bus while Fr1 is 164 and CHCF is 1 or 3, and is at AI1 from the factory: the setpoint is then that of the
//!   keypad.
//! - With CHCF = 3, the I/O profile, bit 0 of CMD is the forward command while it is 1 (sheet Registers: CMD, 2-wire, tCC = 2C from the
//!   factory). Assumption: no other bit has a meaning then, ETA shows what it shows else, and 8601 and 12761 take the same words.
//! - Assumption: 50.0 Hz is the frequency in FrS, HSP and at the keypad, tFr is 60.0 Hz. LFrd (8602) moves nothing. A negative setpoint
//!   turns the other way, though rIn is not looked at.
//! - Assumption: it refuses what is not in the list with 02H. HMIS shows rdY (2) or FLt (23) and nothing else. The current counts tenths.

use super::{
    Bit, Bounds, Family, Faults, Flag, Handshake, Kind, Measure, Memory, OnSilence, OtherWords, Parameter, Range,
    Register, Roles, Scaled, Shows, Silence, Speed, SpeedScale, SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const COMMAND: u32 = 8501;
/// CMI: bit 1 stores all that was set in EEPROM, and goes back to 0.
const EXTENDED_COMMAND: u32 = 8504;
const SPEED_COMMAND: u32 = 8601;
/// nC1, which nCA1 leads to CMD from the factory.
const SCANNER: u32 = 12761;
const MAX_FREQUENCY: u16 = 3103;
const HIGH_SPEED: u16 = 3104;
const CONTROL_MODE: u16 = 8401;
const SETPOINT_SOURCE: u16 = 8413;
const TIMEOUT: u16 = 6005;
const ON_SILENCE: u16 = 7010;
const ACCELERATION: u16 = 9001;
const DECELERATION: u16 = 9002;
/// dP0: the fault that LFt shows, too.
const LAST_FAULT: u16 = 7200;
/// In Fr1.
const MODBUS: u16 = 164;

pub(crate) fn atv600() -> Family {
    let also = |place| COMMANDS.iter().map(move |&(word, command)| (place, word, command));
    Family {
        name: "atv600".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x10],
        max_words: 63,
        across_groups: true,
        exception: by_the_specification,
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
            obeys: vec![(CONTROL_MODE, 1), (SETPOINT_SOURCE, MODBUS)],
            other_words: Some(OtherWords { set_by: (CONTROL_MODE, 3), decode: by_inputs }),
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
            fault_history: (LAST_FAULT..LAST_FAULT + 9).collect(),
            handshake: Some(Handshake { idle: 0x0250, words: vec![(0x06, 0x0231), (0x07, 0x0233)] }),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(17), silent_bus: Some(5) },
    }
}

/// The I/O profile: bit 0 is the run forward.
fn by_inputs(_: u16, word: u16) -> Command {
    if word & 0x0001 == 0 { Command::Stop } else { Command::Run(Direction::Forward) }
}

/// In tenths of a hertz; a negative one turns the other way (assumed).
const SPEED: SpeedScale =
    SpeedScale { unit: SpeedUnit::Hertz, counts: 10.0, bounds: Bounds { signed: true, ..Bounds::new(-5_000, 5_000) } };

const COMMANDS: &[(u16, Command)] = &[
    (0x0000, Command::Coast),
    (0x0006, Command::Coast),
    (0x0007, Command::Stop),
    (0x000F, Command::Run(Direction::Forward)),
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
    Register::set(8501, ANYTHING),
    Register::set(8502, Range::Speed),
    Register::set(EXTENDED_COMMAND, ANYTHING),
    Register::set(SPEED_COMMAND, ANYTHING),
    Register::set(8602, ANYTHING),
    Register::read(8604, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(8606, Shows::Zero),
    Register::read(9630, Shows::Zero),
    Register::set(SCANNER, ANYTHING),
    Register::set(12762, ANYTHING),
    Register::set(12763, ANYTHING),
    Register::set(12764, ANYTHING),
    Register::set(12765, ANYTHING),
    Register::set(12766, ANYTHING),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(TIMEOUT, 1, 300, 100).at_standstill(),
    Parameter::new(ON_SILENCE, 0, 8, 0).at_standstill(),
    Parameter::new(MAX_FREQUENCY, 100, 5_000, 600).at_standstill(),
    Parameter::new(HIGH_SPEED, 0, 5_000, 500).not_above(MAX_FREQUENCY),
    Parameter::new(CONTROL_MODE, 1, 3, 1).at_standstill(),
    Parameter::new(SETPOINT_SOURCE, 0, 510, 1).at_standstill(),
    Parameter::new(ACCELERATION, 0, 9_999, 100),
    Parameter::new(DECELERATION, 0, 9_999, 100),
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
