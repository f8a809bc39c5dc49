//! ENC EDS300: commands at 2000H with other codes than INVT's, and exceptions that are one off from those of Modbus.
//!
//! EDS300 manual (manualshive 2405767), pp. 44 to 46 and 52. Every other address is refused with 03H.
//!
//! - Assumption: it obeys the bus always, and takes its frequency from 2001H; which parameters decide that is not at hand.
//! - Assumption: 1 and 5 jog and run forward; 10 holds the shaft at once.
//! - Assumption: one word in a read, more are refused with 06H; what can only be read or only be written with 05H.
//! - Assumption: the current is at 1002H and the voltage at 1003H, as p. 44 says; p. 52 has another order.
//! - Assumption: 1007H and 1008H are 0, and so is 100CH.
//! - Ramps have no parameters in the pages at hand; the times are fixed. An overload is alarm 9. A silent bus trips nothing.

use super::{Family, Faults, Kind, Measure, Memory, Range, Register, Roles, Shows, Speed, USUAL_DELAY, USUAL_MAX_HZ};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::Refusal;

pub(crate) fn eds300() -> Family {
    Family {
        name: "eds300".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06],
        max_words: 1,
        across_groups: true,
        exception,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x2000),
        commands: COMMANDS.to_vec(),
        registers: REGISTERS.to_vec(),
        parameters: Vec::new(),
        factory: &[],
        elsewhere: Vec::new(),
        control_word: None,
        capped: &[],
        roles: Roles { speed: Some(Speed::hertz(0x2001)), ..Roles::NONE },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(9), silent_bus: None },
    }
}

/// p. 45. 01H, for a wrong CRC, is never sent: the request may have been for another unit.
fn exception(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function => 0x02,
        Refusal::Address => 0x03,
        Refusal::Value => 0x04,
        Refusal::ReadOnly | Refusal::Unreadable | Refusal::Password | Refusal::Running | Refusal::Locked => 0x05,
        Refusal::Structure => 0x06,
    }
}

/// 2000H, p. 44.
const COMMANDS: &[(u16, Command)] = &[
    (1, Command::Jog(Direction::Forward)),
    (2, Command::JogStop),
    (3, Command::Jog(Direction::Forward)),
    (4, Command::Jog(Direction::Reverse)),
    (5, Command::Run(Direction::Forward)),
    (6, Command::Stop),
    (7, Command::Run(Direction::Forward)),
    (8, Command::Run(Direction::Reverse)),
    (9, Command::ResetFault),
    (10, Command::StopAtOnce),
];

const REGISTERS: &[Register] = &[
    Register::read(0x1000, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x1001, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x1002, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x1003, Shows::Measured(Measure::Voltage, 1.0)),
    Register::read(0x1004, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(0x1005, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(0x1006, Shows::Zero),
    Register::read(0x1007, Shows::Zero),
    Register::read(0x1008, Shows::Zero),
    Register::read(0x1009, Shows::Inputs(None)),
    Register::read(0x100A, Shows::Zero),
    Register::read(0x100C, Shows::Zero),
    Register::write_only(0x2000, Range::Words(1, 10)),
    Register::set(0x2001, Range::Speed),
    Register::write_only(0x2002, Range::Words(0, u16::MAX)),
    Register::read(0x2100, Shows::state([1, 2, 3, 4])),
    Register::read(0x2180, Shows::Fault),
];
