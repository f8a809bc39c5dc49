//! Sunfar E300: commands at 1001H, the state at 2000H, measurements at D000H; frequencies in tenths of a hertz.
//!
//! E300 manual (easymanua.ls sunfar e300-2s0022-b), pp. 64 to 66. Every other address is refused with 02H.
//!
//! - Assumption: it obeys the bus always, and takes its frequency from 1002H; which parameters decide that is not at hand.
//! - Assumption: it tells 1 and 2 for a motor that runs or jogs, whether its speed changes or not.
//! - Assumption: six words in a read, as the manual of the E500 has it (p. 96).
//! - Assumption: 1001H and 1002H cannot be read. Exceptions are 01H to 03H as Modbus has them, 02H for what can only be read or
//!   only be written, and 04H for what is not done now.
//! - Ramps have no parameters in the pages at hand; the times are fixed. An overload does not trip, for its number is not at
//!   hand, nor does a silent bus.

use super::{
    Bounds, Family, Faults, Kind, Measure, Memory, Range, Register, Roles, Shows, Speed, SpeedScale, SpeedUnit,
    USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

pub(crate) fn e300() -> Family {
    Family {
        name: "sunfar-e300".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x10],
        max_words: 6,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x1001),
        commands: COMMANDS.to_vec(),
        registers: REGISTERS.to_vec(),
        parameters: Vec::new(),
        factory: &[],
        elsewhere: Vec::new(),
        control_word: None,
        capped: &[],
        roles: Roles { speed: Some(speed()), ..Roles::NONE },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: None, silent_bus: None },
    }
}

/// 50.0 Hz is 01F4H (p. 66).
fn speed() -> Speed {
    let usual = SpeedScale { unit: SpeedUnit::Hertz, counts: 10.0, bounds: Bounds::NONE };
    Speed { register: 0x1002, unit: None, usual }
}

/// 1001H, p. 64.
const COMMANDS: &[(u16, Command)] = &[
    (0x00, Command::Nothing),
    (0x01, Command::Run(Direction::Forward)),
    (0x02, Command::Run(Direction::Reverse)),
    (0x03, Command::Stop),
    (0x04, Command::Jog(Direction::Forward)),
    (0x05, Command::Jog(Direction::Reverse)),
    (0x06, Command::JogStop),
    (0x20, Command::ResetFault),
];

const REGISTERS: &[Register] = &[
    Register::write_only(0x1001, Range::Words(0, 0x20)),
    Register::write_only(0x1002, Range::Speed),
    Register::read(0x2000, Shows::state([0x01, 0x02, 0x03, 0x20])),
    Register::read(0x2001, Shows::Fault),
    Register::read(0xD000, Shows::Measured(Measure::Frequency, 10.0)),
    Register::read(0xD001, Shows::Measured(Measure::Current, 10.0)),
];
