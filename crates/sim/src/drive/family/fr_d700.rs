//! Mitsubishi FR-D700: 0008H is the state when it is read and takes commands when it is written; a parameter stands 999 above its number.
//!
//! 0008H by 1, 2 and 4: buildbotics/bbctrl-firmware, vfd_spindle.c, fr_d700_regs; its bits as they are read: FR-F700-NA manual, p. 231,
//! code H79. 000DH, 000EH and the rule of parameters: FR-D700 instruction manual (applied) IB-0600366ENG, pp. 205 to 207, as
//! portdock/PortDock and nobrega8/mbmap-library quote it. 0009H: FR-E700 FL remote manual, p. 63. Every other address is refused with 02H.
//!
//! - Assumption: 0008H acts by its level: bit 1 or 2 alone runs, anything else stops along the ramp. It takes any word.
//! - Assumption: it obeys the bus while Pr.338 is 0 and Pr.340 is 1, at once and not from the next power-up on, and takes its speed from
//!   it while Pr.339 is 0, too; 0009H is 4 then, and else 0. From the factory Pr.340 is 0.
//! - Assumption: 0001H takes 0, 1 and 9696H, and each resets a fault; that the drive restarts is not simulated. 0002H, 0003H, 0005H and
//!   0006H take one word each, and nothing comes of it.
//! - Assumption: ramps are fixed, whatever Pr.7 and Pr.8 are. Pr.1 is 120.00 Hz from the factory, and bounds what turns.
//! - Assumption: the voltages count tenths, the current hundredths. A fault has no number, an overload does not trip, and a silent bus
//!   trips nothing. 03H for a word out of range, 02H for what can only be read or only be written, 04H for what is not done now.

use super::{
    Bit, Bounds, Family, Faults, Flag, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed,
    USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::map::Access;
use crate::drive::refusal::by_the_specification;

const COMMAND: u32 = 0x0008;
const MAX_FREQUENCY: u16 = 0x03E8;
const COMMAND_SOURCE: u16 = 0x0539;
const FREQUENCY_SOURCE: u16 = 0x053A;
const STARTUP_MODE: u16 = 0x053B;

pub(crate) fn fr_d700() -> Family {
    Family {
        name: "fr-d700".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x08, 0x10],
        max_words: 125,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(COMMAND),
        commands: Vec::new(),
        control_word: Some(decoded),
        elsewhere: [0, 1, 0x9696].map(|word| (0x0001, word, Command::ResetFault)).to_vec(),
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 0), (STARTUP_MODE, 1)],
            speed_source: Some(vec![(COMMAND_SOURCE, 0), (FREQUENCY_SOURCE, 0), (STARTUP_MODE, 1)]),
            speed: Some(Speed::hertz(0x000D)),
            upper_frequency: Some(Scaled::hundredths(MAX_FREQUENCY)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: None, silent_bus: None },
    }
}

/// Bits 1 and 2 run forward and in reverse.
fn decoded(_before: u16, word: u16) -> Command {
    match word & 0b111 {
        0b010 => Command::Run(Direction::Forward),
        0b100 => Command::Run(Direction::Reverse),
        _ => Command::Stop,
    }
}

/// As 0008H is read: bit 0 runs, 1 forward, 2 reverse, 15 fault.
const STATUS: [u16; 4] = [0b011, 0b101, 0, 1 << 15];
/// 4 in the network mode.
const MODE: &[Bit] = &[Bit::Either { flag: Flag::Obeying, low: 0, yes: 4, no: 0 }];

const REGISTERS: &[Register] = &[
    Register::write_only(0x0001, Range::Words(0, u16::MAX)),
    Register::write_only(0x0002, Range::Words(0x965A, 0x965A)),
    Register::write_only(0x0003, Range::Words(0x99AA, 0x99AA)),
    Register::write_only(0x0005, Range::Words(0x5A96, 0x5A96)),
    Register::write_only(0x0006, Range::Words(0xAA99, 0xAA99)),
    Register {
        address: COMMAND,
        access: Access::Always,
        range: Range::Words(0, u16::MAX),
        shows: Shows::state(STATUS),
    },
    Register::read(0x0009, Shows::bits(MODE)),
    Register { address: 0x000D, access: Access::Always, range: Range::Speed, shows: Shows::Written },
    Register::read(0x00C8, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x00C9, Shows::Measured(Measure::Current, 100.0)),
    Register::read(0x00CA, Shows::Measured(Measure::Voltage, 10.0)),
    Register::read(0x00CC, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x00CF, Shows::Measured(Measure::BusVoltage, 10.0)),
    Register::read(0x00DF, Shows::Zero),
    Register::read(0x01F4, Shows::Zero),
];

const PARAMETERS: &[Parameter] = &[
    // The setpoint that is kept.
    Parameter::new(0x000E, 0, 40_000, 0),
    Parameter::new(MAX_FREQUENCY, 0, 12_000, 12_000),
    // Pr.79
    Parameter::new(0x0436, 0, 7, 0),
    Parameter::new(COMMAND_SOURCE, 0, 1, 0),
    Parameter::new(FREQUENCY_SOURCE, 0, 2, 0),
    Parameter { bounds: Bounds::new(0, 10), ..Parameter::new(STARTUP_MODE, 0, 10, 0) },
];
