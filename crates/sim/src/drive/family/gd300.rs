//! Goodrive35, Goodrive35-H1 and Goodrive300: as Goodrive350, with what their own manuals print otherwise.
//!
//! Assumption: all that their manuals at hand do not show is as in Goodrive350.

use super::{Bit, Family, Range, Register, Shows};
use crate::drive::family::gd350;

pub(crate) fn gd300() -> Family {
    Family {
        name: "gd300".into(),
        identification: 0x010A,
        registers: [gd350::CONTROL, gd350::STATE, gd350::MONITOR, NARROWER, GD300_STATE].concat(),
        ..gd350::gd350()
    }
}

/// Assumption: as GD35 in everything but its code; no manual of its own is at hand.
pub(crate) fn gd35_h1() -> Family {
    Family { name: "gd35-h1".into(), identification: 0x0109, ..gd35() }
}

pub(crate) fn gd35() -> Family {
    Family {
        name: "gd35".into(),
        identification: 0x0108,
        registers: [gd350::CONTROL, gd350::STATE, gd350::MONITOR, NARROWER, GD35_STATE].concat(),
        ..gd350::gd350()
    }
}

/// The GD300 and GD35 manuals let 200AH go up to 1FFH only.
const NARROWER: &[Register] = &[Register::set(0x200A, Range::Words(0, 0x1FF))];

/// Bits 8 to 11 of state word 2 are not printed for GD300 and GD35.
const GD300_STATE: &[Register] = &[Register::read(
    0x2101,
    Shows::bits(&[Bit::Ready(0), Bit::Motor(1, 0x2009), Bit::OverloadAlarm(4), Bit::Channel(5)]),
)];

/// GD35: 0 in bit 0 of state word 2 is ready, the other way round than in GD300 and GD350.
const GD35_STATE: &[Register] = &[Register::read(
    0x2101,
    Shows::bits(&[Bit::NotReady(0), Bit::Motor(1, 0x2009), Bit::OverloadAlarm(4), Bit::Channel(5)]),
)];
