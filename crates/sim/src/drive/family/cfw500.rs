//! WEG CFW500: a control word of bits at 02AAH (P0682), and each parameter at its own number.
//!
//! P0680 to P0683, P0048 and P0049, the ramps, the silent bus and the refusals: CFW-11 serial communication manual (WEG 0899.5741), pp. 10 to
//! 16, 24, 25 and 29. The words 7, 3, 2 and 128 of P0682: a program for a real CFW500 (cfw500_modbus.py). P0000 to P0013: CFW300 quick
//! reference 10010917134.
//!
//! - Assumption: bit 8 of P0680 is on until the motor stands, also while it coasts; bit 9 is on without a fault, bit 10 at rest.
//! - Assumption: the quick stop (bit 6) takes as long as the ramp. A reset is the rise of bit 7, and does nothing else. Bits 3 to 5 do nothing.
//! - Assumption: it obeys the bus always. 8192 counts are P0403, which is 50 Hz; below zero they turn it the other way.
//! - Assumption: the ramps are 5.0 s and 10.0 s from 0 to 50 Hz. P0313 = 2 to 4 do nothing.
//! - Assumption: an overload trips fault 72. Every write of a parameter is kept in EEPROM.

use super::{
    Deciding, Family, Faults, Kind, Measure, Memory, OnSilence, Parameter, Range, Register, Roles, Scaled, Shows,
    Silence, Speed, SpeedScale, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::Refusal;

const CONTROL_WORD: u32 = 682;
const REFERENCE: u32 = 683;
const ACCELERATION: u16 = 100;
const DECELERATION: u16 = 101;
const ON_SILENCE: u16 = 313;
const TIMEOUT: u16 = 314;
const RATED_FREQUENCY: u16 = 403;
/// Of the synchronous speed.
const COUNTS: f64 = 8_192.0;

pub(crate) fn cfw500() -> Family {
    Family {
        name: "cfw500".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x10],
        max_words: 27,
        across_groups: true,
        exception,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(CONTROL_WORD),
        commands: Vec::new(),
        control_word: Some(control_word),
        elsewhere: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: vec![
            Parameter::new(0, 0, 9_999, 1),
            Parameter::new(ACCELERATION, 0, 9_990, 50),
            Parameter::new(DECELERATION, 0, 9_990, 100),
            Parameter::shown(102),
            Parameter::shown(103),
            Parameter::new(308, 1, 247, 1).at_standstill(),
            Parameter::new(310, 0, 3, 1).at_standstill(),
            Parameter::new(311, 0, 5, 1).at_standstill(),
            Parameter::new(312, 1, 2, 2).at_standstill(),
            Parameter::new(ON_SILENCE, 0, 5, 0).at_standstill(),
            Parameter::new(TIMEOUT, 0, 9_990, 0).at_standstill(),
            Parameter { factory: 1, ..Parameter::shown(316) },
            Parameter { factory: 50, ..Parameter::shown(RATED_FREQUENCY) },
        ],
        factory: &[],
        capped: &[],
        roles: Roles {
            speed: Some(Speed {
                register: REFERENCE,
                unit: Some(Deciding::Share(Scaled { address: RATED_FREQUENCY, counts: 1.0 }, COUNTS)),
                usual: SpeedScale::share(COUNTS, 50.0),
            }),
            acceleration: Some(Scaled::tenths(ACCELERATION)),
            deceleration: Some(Scaled::tenths(DECELERATION)),
            bus_timeout: Some(Scaled::tenths(TIMEOUT)),
            on_silence: Some(Silence {
                parameter: ON_SILENCE,
                words: vec![(1, OnSilence::Stop), (5, OnSilence::Trip)],
            }),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(72), silent_bus: Some(228) },
    }
}

/// P. 29: a word that can only be read is a wrong value.
fn exception(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function => 0x01,
        Refusal::Address | Refusal::Unreadable => 0x02,
        _ => 0x03,
    }
}

/// Bit 0 runs, 1 enables, 2 turns forward, 6 stops at once, 7 resets as it rises.
fn control_word(before: u16, word: u16) -> Command {
    let bit = |place: u16| word & 1 << place != 0;
    match () {
        () if bit(7) && before & 1 << 7 == 0 => Command::ResetFault,
        () if !bit(1) => Command::Coast,
        () if bit(6) => Command::StopAtOnce,
        () if bit(0) && bit(2) => Command::Run(Direction::Forward),
        () if bit(0) => Command::Run(Direction::Reverse),
        () => Command::Stop,
    }
}

const REGISTERS: &[Register] = &[
    Register::read(1, Shows::Measured(Measure::Setpoint, 10.0)),
    Register::read(2, Shows::Measured(Measure::Frequency, 10.0)),
    Register::read(3, Shows::Measured(Measure::Current, 10.0)),
    Register::read(4, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(5, Shows::Measured(Measure::Frequency, 10.0)),
    Register::read(6, Shows::state([1, 1, 0, 3])),
    Register::read(7, Shows::Measured(Measure::Voltage, 1.0)),
    Register::read(9, Shows::Zero),
    Register::read(11, Shows::Zero),
    Register::read(12, Shows::Inputs(None)),
    Register::read(13, Shows::Zero),
    Register::read(48, Shows::Zero),
    Register::read(49, Shows::Fault),
    Register::read(680, Shows::state([0x0700, 0x0300, 0x0600, 0x8400])),
    Register::read(681, Shows::Measured(Measure::SignedFrequency, COUNTS / 50.0)),
    Register::set(CONTROL_WORD, Range::Words(0, 255)),
    Register::set(REFERENCE, Range::Speed),
];
