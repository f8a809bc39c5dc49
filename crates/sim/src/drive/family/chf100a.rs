//! CHF100A and CHV100: the block at 3000H, to read, that Goodrive350's manual names as compatible with them. CHF100A also
//! takes commands at 1000H, shows its state at 1001H and takes a setpoint in hundredths of a percent at 2000H (CHF100A
//! manual, p. 107, which names 03H and 06H and no other function).
//!
//! How CHV100 takes commands is in no page at hand: the bus cannot move it. Every other address is refused with 02H.
//!
//! - Assumption: they have the identification code at 3016H and the fault number at 5000H too; the code is unknown and
//!   reads as 0.
//! - Assumption: exceptions are those of Goodrive350, and 1000H reads as the last command.
//! - Assumption: CHF100A obeys the bus always, and its speed comes from elsewhere: which parameters hand either to the
//!   bus is not printed. So what is written to 2000H moves nothing, and it reads as 0.
//! - Assumption: 3006H counts tenths of a percent.

use super::{Family, Faults, Kind, MAX_WORDS, Memory, Range, Register, Roles, Shows, USUAL_DELAY, USUAL_MAX_HZ, gd350};

pub(crate) fn chf100a() -> Family {
    Family {
        name: "chf100a".into(),
        functions: vec![0x03, 0x06],
        command: Some(0x1000),
        commands: gd350::COMMANDS.to_vec(),
        registers: [CONTROL, gd350::MONITOR].concat(),
        roles: Roles { speed_source: Some(vec![NEVER]), ..Roles::NONE },
        ..chv100()
    }
}

pub(crate) fn chv100() -> Family {
    Family {
        name: "chv100".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x08],
        max_words: MAX_WORDS,
        across_groups: true,
        exception: gd350::exception,
        memory: Memory::EepromOnly,
        identification: 0,
        command: None,
        commands: Vec::new(),
        registers: gd350::MONITOR.to_vec(),
        parameters: Vec::new(),
        factory: &[],
        control_word: None,
        elsewhere: Vec::new(),
        capped: &[],
        roles: Roles::NONE,
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(11), silent_bus: Some(18) },
    }
}

/// A parameter that is not there has no value.
const NEVER: (u16, u16) = (u16::MAX, 0);

const CONTROL: &[Register] = &[
    Register::set(0x1000, Range::Words(1, 8)),
    Register::read(0x1001, Shows::state([1, 2, 3, 4])),
    Register::set(0x2000, Range::Signed(-10_000, 10_000)),
];
