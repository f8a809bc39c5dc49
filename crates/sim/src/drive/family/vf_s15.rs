//! Toshiba VF-S15: a command word of bits at FA00H, the frequency at FA01H, both in RAM; one word in a request.
//!
//! VF-S15 RS485 manual E6581913, pp. 25, 26, 31 and 34; the bits are those of a program for the VF-S11 (LinuxCNC, vfs11_vfd). FFFFH, as
//! every other address, is refused with 02H; more than one word with 03H.
//!
//! - Assumption: it knows 03H and 06H alone, as a VF-S11, and refuses others with 01H.
//! - Assumption: bits 15 and 14 together put commands and frequency on the bus, and words without both are out of range here, as are
//!   the emergency stop and whatever is no word below.
//! - Assumption: bit 10 of FD01H is on until the motor stands; bit 1 and bit 0 are on with a trip. FC91H is 0.
//! - Assumption: FD03H is hundredths of a percent of the rated current, which is 0 at rest; FD05H is 0.
//! - Assumption: it answers FA00H and FA01H with what was written. UL (0012H) is 50.00 Hz.
//! - Ramps have no parameters in the pages at hand; the times are fixed. An overload does not trip, for its number is not at hand, nor
//!   does a silent bus.

use super::{
    Bit, Bounds, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Shows, Speed, USUAL_DELAY,
    USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::map::Access;
use crate::drive::refusal::by_the_specification;

pub(crate) fn vf_s15() -> Family {
    Family {
        name: "vf-s15".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06],
        max_words: 1,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0xFA00),
        commands: COMMANDS.to_vec(),
        control_word: None,
        elsewhere: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: vec![Parameter { address: 0x0012, access: Access::ReadOnly, bounds: Bounds::NONE, factory: 5_000 }],
        factory: &[],
        capped: &[],
        roles: Roles { speed: Some(Speed::hertz(0xFA01)), ..Roles::NONE },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: None, silent_bus: None },
    }
}

const COMMANDS: &[(u16, Command)] = &[
    (0xC000, Command::Stop),
    (0xC400, Command::Run(Direction::Forward)),
    (0xC600, Command::Run(Direction::Reverse)),
    (0xC800, Command::Coast),
    (0xE000, Command::ResetFault),
];

const REGISTERS: &[Register] = &[
    Register::set(0xFA00, Range::Words(0, u16::MAX)),
    Register::set(0xFA01, Range::Speed),
    Register::read(0xFC90, Shows::Fault),
    Register::read(0xFC91, Shows::Zero),
    Register::read(0xFD00, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0xFD01, Shows::bits(STATUS)),
    Register::read(0xFD03, Shows::Measured(Measure::Current, 100.0)),
    Register::read(0xFD05, Shows::Zero),
];

const STATUS: &[Bit] = &[Bit::Fault(0), Bit::Fault(1), Bit::Reverse(9), Bit::Running(10)];
