//! Goodrive600: inverter and rectifier units on one line, each with an address of its own.
//!
//! Of the inverter's registers only 2000H, 2001H, 2002H and 2100H are in the manual's pages at hand (131 to 140).
//!
//! - Assumption: the present fault and the running and the set frequency stand at 2102H, 3000H and 3001H, as in
//!   Goodrive350. Nothing else of its registers is here: 2101H and 2103H, above all, are refused with 02H.
//! - Assumption: the codes of state word 1 are those of Goodrive350. An example prints 0003H, of a stopped drive.
//! - Assumption: exceptions 07H to 09H, which the pages print for PROFINET only, are sent here too.
//! - Assumption: no address has bit 15. No page tells of a way to RAM, and over PROFINET every write goes to EEPROM.
//! - Assumption: the ranges of P00.03, P00.04 and P00.10, and that P00.04 and P00.05 are the limits they are in sister
//!   series. An example writes two words to 0004H.
//! - Ramps, jog and answers have no parameters in the pages at hand; the times are fixed.
//! - Assumption: the motor overload has the number it has in Goodrive350; fault 1 is the only one printed.

use super::{
    Family, Faults, Kind, MAX_WORDS, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed,
    USUAL_DELAY, USUAL_MAX_HZ, gd350,
};
use crate::drive::machine::{Command, Direction};

const RUN_CHANNEL: u16 = 0x0001;
pub(super) const MAX_FREQUENCY: u16 = 0x0003;
pub(super) const UPPER_FREQUENCY: u16 = 0x0004;
pub(super) const LOWER_FREQUENCY: u16 = 0x0005;
pub(super) const SPEED_SOURCE: u16 = 0x0006;
const KEYPAD_FREQUENCY: u16 = 0x000A;
pub(super) const PASSWORD: u16 = 0x0700;

pub(crate) fn gd600() -> Family {
    Family {
        name: "gd600".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x08, 0x10],
        max_words: MAX_WORDS,
        across_groups: true,
        exception: gd350::exception,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x2000),
        commands: gd350::COMMANDS.to_vec(),
        registers: [
            [
                Register::set(0x2000, Range::Words(1, 8)),
                Register::set(0x2001, Range::UpTo(63_000, MAX_FREQUENCY)),
                Register::set(0x2002, Range::Words(0, 1_000)),
            ]
            .as_slice(),
            STATE,
        ]
        .concat(),
        parameters: vec![
            Parameter::new(RUN_CHANNEL, 0, 2, 0),
            Parameter::new(MAX_FREQUENCY, 1_000, 63_000, 5_000).not_below(UPPER_FREQUENCY).at_standstill(),
            Parameter::new(UPPER_FREQUENCY, 0, 63_000, 5_000).not_above(MAX_FREQUENCY),
            Parameter::new(LOWER_FREQUENCY, 0, 63_000, 0).not_above(UPPER_FREQUENCY),
            Parameter::new(SPEED_SOURCE, 0, 15, 0),
            Parameter::new(KEYPAD_FREQUENCY, 0, 63_000, 5_000).not_above(MAX_FREQUENCY),
            // P01.20, P10.00, P10.01.
            Parameter::new(0x0114, 0, 36_000, 0),
            Parameter::new(PASSWORD, 0, u16::MAX, 0),
            Parameter::new(0x0A00, 0, 2, 0),
            Parameter::new(0x0A01, 0, 1, 0),
        ],
        factory: &[],
        control_word: None,
        elsewhere: Vec::new(),
        capped: &[],
        roles: Roles {
            obeys: vec![(RUN_CHANNEL, 2)],
            speed_source: Some(vec![(SPEED_SOURCE, 8)]),
            speed: Some(Speed::hertz(0x2001)),
            keypad_frequency: Some(Scaled::hundredths(KEYPAD_FREQUENCY)),
            max_frequency: Some(Scaled::hundredths(MAX_FREQUENCY)),
            upper_frequency: Some(Scaled::hundredths(UPPER_FREQUENCY)),
            password: Some(PASSWORD),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(11), silent_bus: Some(18) },
    }
}

/// State, fault and frequencies.
pub(super) const STATE: &[Register] = &[
    Register::read(0x2100, Shows::state([1, 2, 3, 4])),
    Register::read(0x2102, Shows::Fault),
    Register::read(0x3000, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x3001, Shows::Measured(Measure::Setpoint, 100.0)),
];

/// Assumption: all of it. No page about this unit is at hand; it is taken to have the run byte that Goodrive3000's
/// rectifier has over PROFIBUS, at the inverter's addresses, and no parameters.
pub(crate) fn rectifier() -> Family {
    Family {
        name: "gd600-rectifier".into(),
        kind: Kind::Rectifier,
        command: Some(0x2000),
        commands: RECTIFIER_COMMANDS.to_vec(),
        registers: RECTIFIER_REGISTERS.to_vec(),
        parameters: Vec::new(),
        roles: Roles::NONE,
        ..gd600()
    }
}

/// Fed and stopped like a motor, at no frequency. Pre-charging takes no time and nothing waits for it.
pub(super) const RECTIFIER_COMMANDS: &[(u16, Command)] =
    &[(1, Command::Run(Direction::Forward)), (5, Command::Stop), (7, Command::ResetFault), (9, Command::Nothing)];

/// Assumption: a rectifier's state has the codes of the inverters' for running, stopped and fault.
pub(super) const RECTIFIER_REGISTERS: &[Register] =
    &[Register::set(0x2000, Range::Words(1, 9)), Register::read(0x2100, Shows::state([1, 1, 3, 4]))];
