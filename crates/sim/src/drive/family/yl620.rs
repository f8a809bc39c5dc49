//! Yalang YL620: the bits of a Delta drive at 2000H, and tenths of a hertz at 2001H, where that one counts hundredths.
//!
//! YL620-A manual, pp. 26 to 28; YL600 manual (manualshive 3074792), p. 27; the maker's Modbus table in Chinese. The bits of 2009H
//! and the parameters from MillenniumMachines/ArborCTL, macro/private/yalang-yl620a. Every other address is refused with 02H.
//!
//! - Assumption: it refuses what its table does not have, 2100H and up among it.
//! - Assumption: bits 3-2 of 2000H are ignored, and bits 5-4 = 0 or 3 run forward. So 6, by which a Goodrive coasts, runs it, and 5
//!   stops it. A word that resets does nothing else; it resets all faults.
//! - Assumption: P00.01 = 3 obeys the bus; P07.08 = 5 takes the frequency from it, and else it is P00.00. Both are 0 from the factory.
//!   P00.04 is the highest frequency, 400.0 Hz.
//! - Assumption: frequencies at 200AH and 200BH count tenths of a hertz, as programs read them; current and voltages whole units.
//! - Assumption: nine words in a read. 2000H to 2003H cannot be read, and 2002H and 2003H do nothing: the ramps are fixed.
//! - Assumption: 03H for a word out of range, 02H for what can only be read or only be written, 04H for what is not done now.
//! - Assumption: 2009H is 2 forward, 4 in reverse and 0 at rest and in fault. An overload trips Er. 2, overcurrent. A silent bus trips
//!   nothing.

use super::{
    Bounds, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed, SpeedScale,
    SpeedUnit, USUAL_DELAY,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const KEYPAD_FREQUENCY: u16 = 0x0000;
const COMMAND_SOURCE: u16 = 0x0001;
const MAX_FREQUENCY: u16 = 0x0004;
const FREQUENCY_SOURCE: u16 = 0x0708;
const MAX_HERTZ: f64 = 400.0;

pub(crate) fn yl620() -> Family {
    let tenths = SpeedScale { unit: SpeedUnit::Hertz, counts: 10.0, bounds: Bounds::NONE };
    Family {
        name: "yl620".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06],
        max_words: 9,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x2000),
        commands: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        elsewhere: Vec::new(),
        control_word: Some(decoded),
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 3)],
            speed_source: Some(vec![(COMMAND_SOURCE, 3), (FREQUENCY_SOURCE, 5)]),
            speed: Some(Speed { register: 0x2001, unit: None, usual: tenths }),
            keypad_frequency: Some(Scaled::tenths(KEYPAD_FREQUENCY)),
            max_frequency: Some(Scaled::tenths(MAX_FREQUENCY)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: MAX_HERTZ,
        faults: Faults { overload: Some(1 << 2), silent_bus: None },
    }
}

/// 2000H, p. 27.
fn decoded(_before: u16, word: u16) -> Command {
    let direction = if (word >> 4) & 0b11 == 0b10 { Direction::Reverse } else { Direction::Forward };
    match ((word >> 6) & 0b11, word & 0b11) {
        (0b01 | 0b10, _) => Command::ResetFault,
        (_, 0b01) => Command::Stop,
        (_, 0b10) => Command::Run(direction),
        (_, 0b11) => Command::Jog(direction),
        _ => Command::Nothing,
    }
}

const REGISTERS: &[Register] = &[
    Register::write_only(0x2000, Range::Words(0, 0xFF)),
    Register::write_only(0x2001, Range::Speed),
    Register::write_only(0x2002, Range::Words(0, u16::MAX)),
    Register::write_only(0x2003, Range::Words(0, u16::MAX)),
    Register::read(0x2008, Shows::Fault),
    Register::read(0x2009, Shows::state([2, 4, 0, 0])),
    Register::read(0x200A, Shows::Measured(Measure::Setpoint, 10.0)),
    Register::read(0x200B, Shows::Measured(Measure::Frequency, 10.0)),
    Register::read(0x200C, Shows::Measured(Measure::Current, 1.0)),
    Register::read(0x200D, Shows::Measured(Measure::Voltage, 1.0)),
    Register::read(0x200E, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(0x200F, Shows::Zero),
    Register::read(0x2010, Shows::Zero),
    Register::read(0x2011, Shows::Zero),
    Register::read(0x2012, Shows::Zero),
    Register::read(0x2013, Shows::Zero),
    Register::read(0x2014, Shows::Zero),
    Register::read(0x2015, Shows::Inputs(None)),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(KEYPAD_FREQUENCY, 0, 4_000, 500),
    Parameter::new(COMMAND_SOURCE, 0, 9, 0),
    Parameter::new(MAX_FREQUENCY, 0, 6_000, 4_000),
    Parameter::new(FREQUENCY_SOURCE, 0, 9, 0),
];
