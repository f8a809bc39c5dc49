//! Schneider Altivar 320: what `atv71` does, forward only, and without 08H.
//!
//! From a program that runs one over its serial line (AnHeart, drive.py), and another over Modbus TCP
//! (robotsmith/Arduino_ATV320_library): 06H, 07H and then 0FH, 07H stops, 80H resets a fault. From the CANopen
//! file of product 320 and the list beside it (hilch/ac_invlib): the addresses, STFR at 3281, CHCF from 1 to 3, and the numbers of the
//! faults, OLF = 17 and SLF1 = 5. From programs that quote its Modbus manual (NVE41308): 03H, 06H and 10H, 63 words.
//!
//! - Where it has nothing it says 8000H, and refuses no read (AnHeart, scripts/bench_console.py). Unit 248, which it answers too, is not here.
//! - Assumption: all that an Altivar 71 does else, its I/O profile, and that a run waits for the first setpoint.
//! - Assumption: 080FH is none of its words. Exceptions are those of the specification.

use super::{Absent, Family, Parameter, Register, Roles, Shows, atv71};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const SPEED_COMMAND: u32 = 8601;
const SCANNER: u32 = 12761;
const CONTROL_MODE: u16 = 8401;

pub(crate) fn atv320() -> Family {
    let also = |place| COMMANDS.iter().map(move |&(word, command)| (place, word, command));
    let sister = atv71::atv71();
    Family {
        name: "atv320".into(),
        functions: vec![0x03, 0x06, 0x10],
        exception: by_the_specification,
        commands: COMMANDS.to_vec(),
        elsewhere: also(SPEED_COMMAND).chain(also(SCANNER)).collect(),
        registers: [&sister.registers[..], &[Register::read(3281, Shows::Zero)]].concat(),
        parameters: [&sister.parameters[..], &[Parameter::new(CONTROL_MODE, 1, 3, 1).at_standstill()]].concat(),
        roles: Roles { absent: Some(Absent { word: 0x8000, alone: true }), ..sister.roles },
        ..sister
    }
}

const COMMANDS: &[(u16, Command)] = &[
    (0x0000, Command::Coast),
    (0x0006, Command::Coast),
    (0x0007, Command::Stop),
    (0x000F, Command::Run(Direction::Forward)),
    (0x0080, Command::ResetFault),
];
