//! CHF100A and CHV100: the block at 3000H, to read, that Goodrive350's manual names as compatible with them.
//!
//! Their own way of taking commands is in no page at hand: the bus cannot move them, and every other address is refused
//! with 02H.
//!
//! - Assumption: they have the identification code at 3016H and the fault number at 5000H too; the code is unknown and
//!   reads as 0.
//! - Assumption: exceptions are those of Goodrive350.

use super::{Family, Faults, Kind, Memory, Roles, gd350};

pub(crate) static CHF100A: Family = FAMILY;
pub(crate) static CHV100: Family = Family { name: "chv100", ..FAMILY };

const FAMILY: Family = Family {
    name: "chf100a",
    kind: Kind::Inverter,
    functions: &[0x03, 0x06, 0x08],
    exception: gd350::exception,
    memory: Memory::EepromOnly,
    identification: 0,
    control: 0x2000,
    command: None,
    commands: |_| None,
    registers: &[gd350::MONITOR],
    parameters: &[],
    factory: &[],
    capped: &[],
    roles: Roles::NONE,
    faults: Faults { overload: 11, silent_bus: 18 },
};
