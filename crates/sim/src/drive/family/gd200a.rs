//! Goodrive10, 20, 100 and 200A, the older class: as Goodrive350, with what their own manuals print otherwise.
//!
//! Printed: 2000H and its codes for all four (GD10, p. 88; GD20-EU, p. 141; GD100, p. 167, which lets it be written only;
//! GD200A, pp. 139 and 146), 2103H, and the word that each of them shows there (GD10, p. 90; GD20, p. 140; GD200A V2.6, p. 147).
//! The whole manual of Goodrive200A is at hand (Operation Manual Goodrive200A): 3002H counts whole volts there, 300FH and 3011H are
//! reserved, P00.03 ends at 400.00 Hz.
//! Bit 0 of 2101H tells whether the bus has its voltage (GD10, p. 88; GD200A, p. 147). 200AH goes up to 1FFH there.
//!
//! - Assumption: of Goodrive100 2103H reads as 010BH, which the manuals of its sisters print. Its own (p. 171) prints 0110H,
//!   above a list of codes that contradicts it.
//! - Assumption: what a Goodrive10 calls reserved, or leaves out between 2003H and 200AH, does not exist.
//! - Assumption: 2100H, 2101H and 200AH of Goodrive20 and 100 are those of Goodrive200A, and a drive that answers has its bus
//!   voltage. Code 2 of 2100H is reverse; GD10 and GD200A misprint it as forward, like 1.
//! - Assumption: a value out of range is refused with 04H, as in the worked example of sister manuals (GD600, p. 138). By the
//!   text of these manuals it may be 07H as well.
//! - Assumption: all else that their manuals at hand do not show is as in Goodrive350. Goodrive20 has no P00.02 (its p. 140
//!   asks for P00.01 alone).

use super::{Bit, Family, Measure, Range, Register, Roles, Shows, gd350};

pub(crate) fn gd200a() -> Family {
    let registers =
        [gd350::CONTROL, gd350::STATE, gd350::MONITOR, CLASS, MOTORS, TO_400_HZ, TORQUE_OR_SPEED, WHOLE_VOLTS].concat();
    Family {
        name: "gd200a".into(),
        identification: 0x0107,
        registers: without(registers, &[0x300F, 0x3011]),
        ..gd350::gd350()
    }
}

pub(crate) fn gd100() -> Family {
    Family {
        name: "gd100".into(),
        identification: 0x010B,
        registers: [gd350::CONTROL, gd350::STATE, gd350::MONITOR, CLASS, MOTORS, SILENT_COMMAND].concat(),
        ..gd350::gd350()
    }
}

pub(crate) fn gd20() -> Family {
    let goodrive350 = gd350::gd350();
    let registers = [gd350::CONTROL, gd350::STATE, gd350::MONITOR, CLASS, MOTORS, TO_600_HZ].concat();
    Family {
        name: "gd20".into(),
        identification: 0x0106,
        registers: without(registers, &[0x3011]),
        roles: Roles { obeys: vec![(0x0001, 2)], ..goodrive350.roles },
        ..goodrive350
    }
}

pub(crate) fn gd10() -> Family {
    let registers = [gd350::CONTROL, gd350::STATE, gd350::MONITOR, CLASS, NO_TORQUE].concat();
    Family { name: "gd10".into(), identification: 0x010D, registers: without(registers, RESERVED), ..gd350::gd350() }
}

fn without(mut registers: Vec<Register>, gone: &[u16]) -> Vec<Register> {
    registers.retain(|register| !gone.iter().any(|&address| register.address == u32::from(address)));
    registers
}

/// GD10, p. 88 (nothing from 2004H to 2009H, no 200CH, no 200EH) and p. 90; 3012H is reserved in that edition alone.
const RESERVED: &[u16] =
    &[0x2004, 0x2005, 0x2006, 0x2007, 0x2008, 0x2009, 0x200C, 0x200E, 0x300E, 0x300F, 0x3010, 0x3011, 0x3013];

/// Nine inputs, and a bus that has its voltage.
const CLASS: &[Register] = &[
    Register::set(0x200A, Range::Words(0, 0x1FF)),
    Register::read(0x2101, Shows::bits(&[Bit::Always(1), Bit::OverloadAlarm(4), Bit::Channel(5)])),
];

/// GD200A, p. 147.
const MOTORS: &[Register] = &[Register::read(
    0x2101,
    Shows::bits(&[Bit::Always(1), Bit::Motor(1, 0x2009), Bit::OverloadAlarm(4), Bit::Channel(5)]),
)];

/// GD200A, p. 35: P00.03 ends at 400.00 Hz.
const TO_400_HZ: &[Register] = &[
    Register::set(0x2001, Range::UpTo(40_000, gd350::MAX_FREQUENCY)),
    Register::set(0x2005, Range::UpTo(40_000, gd350::MAX_FREQUENCY)),
    Register::set(0x2006, Range::UpTo(40_000, gd350::MAX_FREQUENCY)),
];

/// P00.03 ends at 600.00 Hz: GD20-EU, p. 140.
const TO_600_HZ: &[Register] = &[
    Register::set(0x2001, Range::UpTo(60_000, gd350::MAX_FREQUENCY)),
    Register::set(0x2005, Range::UpTo(60_000, gd350::MAX_FREQUENCY)),
    Register::set(0x2006, Range::UpTo(60_000, gd350::MAX_FREQUENCY)),
];

/// GD200A, p. 147: bits 0 to 2 of the special control word, and no others.
const TORQUE_OR_SPEED: &[Register] = &[Register::set(0x2009, Range::Words(0, 7))];

const SILENT_COMMAND: &[Register] = &[Register::write_only(0x2000, Range::Words(1, 8))];

/// Without a torque setpoint there is none in force.
const NO_TORQUE: &[Register] = &[Register::read(0x3015, Shows::Zero)];

/// GD200A, p. 141: 0 to 1200 V without a decimal.
const WHOLE_VOLTS: &[Register] = &[Register::read(0x3002, Shows::Measured(Measure::BusVoltage, 1.0))];
