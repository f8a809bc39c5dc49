//! SAJ 8000M: commands at 1000H and the state at 1001H, with the codes of a CHF100A.
//!
//! 8000m manual, p. 142 (manualshive 3527063) and p. 144 (easymanua.ls). Every other address is refused with 02H, and so is
//! 2000H: the page with the setpoints is not at hand.
//!
//! - Assumption: 3000H to 3005H and 300AH are those of a CHF100A, as 300BH to 3016H are.
//! - Assumption: it obeys the bus always, and turns at the speed of its keypad: what sets another is not at hand.
//! - Assumption: exceptions are 01H to 03H as Modbus has them, 02H for what can only be read, and 04H for what is not done now.
//! - Assumption: 1000H reads as the last command. 300CH and what nothing is connected to reads as 0.
//! - Ramps have no parameters in the pages at hand; the times are fixed. An overload is fault 11, as on a CHF100A.

use super::{
    Family, Faults, Kind, MAX_WORDS, Measure, Memory, Range, Register, Roles, Shows, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

pub(crate) fn saj8000m() -> Family {
    Family {
        name: "saj8000m".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06],
        max_words: MAX_WORDS,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x1000),
        commands: COMMANDS.to_vec(),
        registers: REGISTERS.to_vec(),
        parameters: Vec::new(),
        factory: &[],
        elsewhere: Vec::new(),
        control_word: None,
        capped: &[],
        roles: Roles { speed_source: Some(vec![NEVER]), ..Roles::NONE },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(11), silent_bus: None },
    }
}

/// A parameter that is not there has no value.
const NEVER: (u16, u16) = (u16::MAX, 0);

/// 1000H, p. 142.
const COMMANDS: &[(u16, Command)] = &[
    (1, Command::Run(Direction::Forward)),
    (2, Command::Run(Direction::Reverse)),
    (3, Command::Jog(Direction::Forward)),
    (4, Command::Jog(Direction::Reverse)),
    (5, Command::Stop),
    (6, Command::Coast),
    (7, Command::ResetFault),
    (8, Command::JogStop),
];

const REGISTERS: &[Register] = &[
    Register::set(0x1000, Range::Words(1, 8)),
    Register::read(0x1001, Shows::state([1, 2, 3, 4])),
    Register::read(0x3000, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x3001, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x3002, Shows::Measured(Measure::BusVoltage, 10.0)),
    Register::read(0x3003, Shows::Measured(Measure::Voltage, 1.0)),
    Register::read(0x3004, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x3005, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(0x300A, Shows::Inputs(None)),
    Register::read(0x300B, Shows::Zero),
    Register::read(0x300C, Shows::Zero),
    Register::read(0x3012, Shows::Zero),
    Register::read(0x3014, Shows::Zero),
    Register::read(0x5000, Shows::Fault),
];
