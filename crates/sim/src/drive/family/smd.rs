//! Lenze AC Tech SMD: a lock on all that is written, a command register of single bits, one word to a request.
//!
//! Smd series drives, Modbus communications reference guide (RG-SDMOD), by its printed pages: functions, one word to a request and exceptions,
//! p. 5; registers 1, 19, 21, 48 and 50, p. 6; tenths of a hertz, p. 7; the lock, p. 10; the bits of register 1, p. 13; registers 24 to 29,
//! p. 15; the numbers in the low byte of register 26, p. 27.
//!
//! - Assumption: C01 is 10. Which register it is, is not known, nor those of other parameters: there are none here.
//! - Assumption: the direction is forward when the power comes. 64 and 128 at register 1 change it, also while the motor runs.
//! - Assumption: of a word with several bits bit 2 counts, and without that nothing does; the guide of a MCH series drive has exception 04 for
//!   it (manualsdir 566283, p. 17). Bits 0, 8 and 9 do nothing.
//! - Assumption: the setpoint at register 40 can be read, and goes up to 240.0 Hz. Both ramps are 10 s from 0 to that.
//! - Assumption: register 26 shows 6 whenever the output is on, and a load of 42 %. Registers 27 and 29 have 1 for reverse and the number of the
//!   fault; their other bytes are 0, as is register 28.
//! - Assumption: registers that no page names are refused with 02H, as are those that can only be written or only be read.
//! - Six words from register 24, reads by 04H, and the time-out of the bus are not simulated. An overload is fault 1: its numbers are not known.

use std::borrow::Cow;

use super::{
    Bit, Bounds, Family, Faults, Kind, Lock, Measure, Memory, Range, Register, Roles, Shows, Speed, SpeedScale,
    SpeedUnit, USUAL_DELAY,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::places::spot;
use crate::drive::refusal::Refusal;

const DRIVE_CONTROL: u32 = 1;
const SPEED_COMMAND: u32 = 40;
const UNLOCK: u32 = 48;
const START: u16 = 1 << 3;
const STOP: u16 = 1 << 2;
const LOCK: u16 = 1 << 1;
const REVERSE: u16 = 1 << 6;
const FORWARD: u16 = 1 << 7;
/// Where it keeps its direction: none of its functions reaches that.
const DIRECTION: u32 = spot(drivebus_rtu::Table::Coil, 0);

pub(crate) fn smd() -> Family {
    Family {
        name: "smd".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x04, 0x06, 0x10],
        max_words: 1,
        across_groups: true,
        exception,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(DRIVE_CONTROL),
        commands: Vec::new(),
        control_word: Some(decoded),
        elsewhere: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: Vec::new(),
        factory: &[],
        capped: &[],
        roles: Roles {
            direction: Some((DIRECTION, REVERSE)),
            direction_words: Some([FORWARD, REVERSE]),
            lock: Some(Lock { at: UNLOCK, again: LOCK }),
            speed: Some(Speed {
                register: SPEED_COMMAND,
                unit: None,
                usual: SpeedScale { unit: SpeedUnit::Hertz, counts: 10.0, bounds: Bounds::new(0, 2_400) },
            }),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: 240.0,
        faults: Faults { overload: Some(1), silent_bus: None },
    }
}

/// P. 5; that a locked drive has 01 is on p. 10.
fn exception(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function | Refusal::Locked | Refusal::Password | Refusal::Running => 0x01,
        Refusal::Address | Refusal::Unreadable | Refusal::ReadOnly => 0x02,
        Refusal::Value => 0x03,
        Refusal::Structure => 0x04,
    }
}

/// P. 13. The direction is no command of its own here.
fn decoded(_before: u16, word: u16) -> Command {
    match word {
        START => Command::Run(Direction::Forward),
        word if word & STOP != 0 => Command::Coast,
        _ => Command::Nothing,
    }
}

const REGISTERS: &[Register] = &[
    Register::write_only(DRIVE_CONTROL, Range::Words(0, u16::MAX)),
    Register::read(19, Shows::bits(&[Bit::Always(69)])),
    Register::read(21, Shows::Zero),
    Register::read(24, Shows::Measured(Measure::Setpoint, 10.0)),
    Register::read(25, Shows::Measured(Measure::Frequency, 10.0)),
    Register::read(26, Shows::State([6, 6, 3, 1], Cow::Borrowed(&[Bit::Always(42 << 8)]))),
    Register::read(27, Shows::bits(&[Bit::Reverse(8)])),
    Register::read(28, Shows::Zero),
    Register::read(29, Shows::bits(&[Bit::FaultNumber(8)])),
    Register::set(SPEED_COMMAND, Range::Speed),
    Register::write_only(UNLOCK, Range::Words(0, 0)),
    Register::read(50, Shows::bits(&[Bit::Always(507)])),
    Register::write_only(DIRECTION, Range::Words(0, u16::MAX)),
];
