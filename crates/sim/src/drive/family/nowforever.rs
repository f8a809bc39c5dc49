//! Nowforever D100 and E100: a command word of bits at 0900H, the frequency at 0901H, the state at 0500H.
//!
//! Programs for real ones: bdring/FluidNC (NowForeverProtocol.cpp), havardAasen/nowforever_vfd, babs/cnc-linuxcnc-nowforever_vfd,
//! buildbotics/bbctrl-firmware (vfd_spindle.c), grblHAL/Plugins_spindle (nowforever.c).
//!
//! - Assumption: 03H and 10H are all it knows, with eight words; refusals are those of the Modbus specification.
//! - Assumption: a word with bit 3 resets a fault and does nothing else; one with bit 2 jogs, whatever bit 0 is. 0900H and 0901H cannot be read.
//! - Assumption: bit 0 of 0500H is on until the motor stands; bit 4 is the fault, bit 3 never on, bit 2 on until P0-000 is 2.
//! - Assumption: P0-000 to P0-099 stand at 0000H to 0063H, take any word, and are kept in EEPROM. P0-007 is 400.00 Hz, P0-000 and P0-002 are 0.
//! - Assumption: an overload trips 11; a silent bus trips nothing.

use super::{
    Bit, Bounds, Family, Faults, Flag, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed,
    SpeedScale, SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const COMMAND_SOURCE: u16 = 0;
const FREQUENCY_SOURCE: u16 = 2;
const UPPER_FREQUENCY: u16 = 7;

pub(crate) fn nowforever() -> Family {
    Family {
        name: "nowforever".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x10],
        max_words: 8,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x0900),
        commands: Vec::new(),
        control_word: Some(decoded),
        elsewhere: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: parameters(),
        factory: &[],
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 2)],
            speed_source: Some(vec![(COMMAND_SOURCE, 2), (FREQUENCY_SOURCE, 6)]),
            speed: Some(Speed { register: 0x0901, unit: None, usual: SPEED }),
            upper_frequency: Some(Scaled::hundredths(UPPER_FREQUENCY)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(11), silent_bus: None },
    }
}

/// Bit 0 run, bit 1 reverse, bit 2 jog, bit 3 reset.
fn decoded(_before: u16, word: u16) -> Command {
    let direction = if word & 0b10 == 0 { Direction::Forward } else { Direction::Reverse };
    match word & 0b1101 {
        0b1000.. => Command::ResetFault,
        0b0100.. => Command::Jog(direction),
        0b0001 => Command::Run(direction),
        _ => Command::Stop,
    }
}

const SPEED: SpeedScale = SpeedScale { unit: SpeedUnit::Hertz, counts: 100.0, bounds: Bounds::new(0, 65_000) };

const REGISTERS: &[Register] = &[
    Register::read(0x0300, Shows::Fault),
    Register::read(0x0500, Shows::bits(STATE)),
    Register::read(0x0501, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x0502, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x0503, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x0504, Shows::Measured(Measure::Voltage, 10.0)),
    Register::read(0x0505, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(0x0506, Shows::Zero),
    Register::read(0x0507, Shows::Zero),
    Register::write_only(0x0900, Range::Words(0, 15)),
    Register::write_only(0x0901, Range::Speed),
];

const STATE: &[Bit] =
    &[Bit::Running(0), Bit::Reverse(1), Bit::Either { flag: Flag::Obeying, low: 2, yes: 0, no: 1 }, Bit::Fault(4)];

fn parameters() -> Vec<Parameter> {
    let factory = |index| match index {
        UPPER_FREQUENCY => 40_000,
        0x37 => 1,
        0x38 => 2,
        _ => 0,
    };
    (0..100).map(|index| Parameter::new(index, 0, u16::MAX, factory(index))).collect()
}
