//! Teco F510: a command word of bits at 2501H, the frequency at 2502H, the state at 2520H; parameters from 0000H on, in groups up to 24.
//!
//! F510 communication addendum (Teco-Westinghouse): command and monitor data, pp. 1-5 to 1-8; functions, p. 1-3; exceptions, p. 1-4;
//! which parameters there are, pp. 1-14 to 1-24; what obeys the bus, p. 1-42. Every other address is refused with 02H.
//!
//! - Assumption: a wrong count of words is 03H, and 04H is for a value, for what can only be read, and for what is not to be written now. The
//!   examples of the addendum have 52H where its table has 02H; this one goes by the table.
//! - Assumption: bit 0 of 2520H is on until the motor stands. Bit 2 is on without a fault, and 14 while 00-02 does not obey the bus; the others above 3
//!   are 0, also 5, zero speed.
//! - Assumption: a word with bit 3 resets a fault and does nothing else, one with bit 2 lets the motor coast and trips nothing; bits 6
//!   to 14 move nothing.
//! - Assumption: 00-02 and 00-05 are 1 from the factory, and 00-12 is 109 %, which is above 50 Hz: it bounds nothing here. 00-14 and 00-15 count tenths
//!   of a second from 0 to 50 Hz, and 2526H tenths of a volt.
//! - Assumption: every other parameter of its tables takes any word, and keeps it in EEPROM, but for the monitors 12-17, 12-42 and 12-45 and for 13-00.
//! - Assumption: an overload trips 5, OL1; a silent bus trips nothing.

use super::{
    Bit, Bounds, Family, Faults, Flag, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed,
    SpeedScale, SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::Refusal;

const COMMAND_SOURCE: u16 = 0x0002;
const FREQUENCY_SOURCE: u16 = 0x0005;
const ACCELERATION: u16 = 0x000E;
const DECELERATION: u16 = 0x000F;

pub(crate) fn f510() -> Family {
    Family {
        name: "f510".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x08, 0x10],
        max_words: 16,
        across_groups: true,
        exception,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x2501),
        commands: Vec::new(),
        control_word: Some(decoded),
        elsewhere: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: parameters(),
        factory: &[],
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 2)],
            speed_source: Some(vec![(COMMAND_SOURCE, 2), (FREQUENCY_SOURCE, 3)]),
            speed: Some(Speed { register: 0x2502, unit: None, usual: SPEED }),
            acceleration: Some(Scaled::tenths(ACCELERATION)),
            deceleration: Some(Scaled::tenths(DECELERATION)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(5), silent_bus: None },
    }
}

/// P. 1-4.
fn exception(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function => 0x01,
        Refusal::Address | Refusal::Unreadable => 0x02,
        Refusal::Structure => 0x03,
        _ => 0x04,
    }
}

/// P. 1-5: bit 0 operation, bit 1 reverse, bit 2 external fault, bit 3 fault reset.
fn decoded(_before: u16, word: u16) -> Command {
    match word & 0b1111 {
        0b1000.. => Command::ResetFault,
        0b0100.. => Command::Coast,
        0b0011 => Command::Run(Direction::Reverse),
        0b0001 => Command::Run(Direction::Forward),
        _ => Command::Stop,
    }
}

/// P. 1-34: 0 to 400.00 Hz.
const SPEED: SpeedScale = SpeedScale { unit: SpeedUnit::Hertz, counts: 100.0, bounds: Bounds::new(0, 40_000) };

const REGISTERS: &[Register] = &[
    Register::set(0x2501, Range::Words(0, u16::MAX)),
    Register::set(0x2502, Range::Speed),
    Register::set(0x2505, Range::Words(0, 1_000)),
    Register::set(0x2506, Range::Words(0, 1_000)),
    Register::set(0x2507, Range::Words(0, 7)),
    Register::read(0x2520, Shows::bits(STATE)),
    Register::read(0x2521, Shows::Fault),
    Register::read(0x2522, Shows::Zero),
    Register::read(0x2523, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x2524, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x2525, Shows::Zero),
    Register::read(0x2526, Shows::Measured(Measure::BusVoltage, 10.0)),
    Register::read(0x2527, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x2528, Shows::Zero),
    Register::read(0x2529, Shows::Zero),
    Register::read(0x252A, Shows::Zero),
    Register::read(0x252B, Shows::Zero),
    Register::read(0x252C, Shows::Zero),
    Register::read(0x252D, Shows::Zero),
    Register::read(0x252F, Shows::Zero),
];

const STATE: &[Bit] = &[
    Bit::Running(0),
    Bit::Reverse(1),
    Bit::Ready(2),
    Bit::Fault(3),
    Bit::Either { flag: Flag::Obeying, low: 14, yes: 0, no: 1 },
];

/// The first and the last index of each run of parameters, by group.
const GROUPS: &[(u16, u16, u16)] = &[
    (0, 0, 56),
    (1, 0, 15),
    (2, 0, 19),
    (2, 33, 34),
    (3, 0, 40),
    (4, 0, 20),
    (5, 0, 48),
    (6, 0, 47),
    (7, 0, 29),
    (8, 0, 39),
    (9, 0, 10),
    (10, 0, 39),
    (11, 0, 65),
    (12, 0, 76),
    (13, 0, 13),
    (14, 0, 47),
    (15, 0, 32),
    (16, 0, 37),
    (17, 0, 13),
    (18, 0, 6),
    (20, 0, 18),
    (20, 33, 35),
    (21, 0, 8),
    (22, 0, 22),
    (23, 0, 58),
    (24, 0, 6),
];

fn parameters() -> Vec<Parameter> {
    let known = [
        Parameter::new(COMMAND_SOURCE, 0, 4, 1).at_standstill(),
        Parameter::new(FREQUENCY_SOURCE, 0, 6, 1).at_standstill(),
        Parameter::new(ACCELERATION, 0, 60_000, 100),
        Parameter::new(DECELERATION, 0, 60_000, 100),
        Parameter::shown(0x0C11),
        Parameter::shown(0x0C2A),
        Parameter::shown(0x0C2D),
        Parameter::shown(0x0D00),
    ];
    let printed = GROUPS.iter().flat_map(|&(group, first, last)| (first..=last).map(move |index| group << 8 | index));
    let others = printed.filter(|&address| known.iter().all(|each| each.address != address));
    others.map(|address| Parameter::new(address, 0, u16::MAX, 0)).chain(known).collect()
}
