//! Hitachi WJ200: run and direction are two coils, and its manual numbers coils and registers from 1: on the wire each is one
//! less (WJ200 manual, p. B-15, note 3).
//!
//! Coils 0001h run, 0002h direction (1 reverse), 0004h reset, 000Fh running, 0010h reverse, 0011h ready, 0018h alarm: WJ200
//! manual, p. B-24, with what 0 and 1 mean from the Omron MX2 manual, p. 303. Registers 0001h and 0002h, 0.01 Hz, and 0003h: WJ200
//! manual, p. B-26. Registers from 1001h on: Omron MX2 manual, p. 309.
//!
//! - Assumption: A001 and A002, at 1200H and 1201H (buildbotics/bbctrl-firmware, vfd_spindle.c), are set so that the bus is obeyed, and other
//!   values change nothing. Other parameters are not simulated.
//! - Assumption: exceptions are those of the Modbus specification. Coils that are not here are refused with 02H.
//! - Assumption: coils 0012h to 0017h and 0019h, and register 1019h, are there and 0: LinuxCNC's wj200_vfd reads them.
//! - Assumption: the direction of a motor that runs is changed at once, and a reset is carried out by each 1.

use drivebus_rtu::Table;

use super::{
    Bit, Family, Faults, Kind, MAX_WORDS, Measure, Memory, Parameter, Range, Register, Roles, Shows, Speed, USUAL_DELAY,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::places::spot;
use crate::drive::refusal::by_the_specification;

const RUN: u32 = spot(Table::Coil, 0x0000);
const DIRECTION: u32 = spot(Table::Coil, 0x0001);
const RESET: u32 = spot(Table::Coil, 0x0003);
const FREQUENCY: u32 = 0x0001;

pub(crate) fn wj200() -> Family {
    Family {
        name: "wj200".into(),
        kind: Kind::Inverter,
        functions: vec![0x01, 0x03, 0x05, 0x06, 0x08, 0x10],
        max_words: MAX_WORDS,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(RUN),
        commands: vec![(0, Command::Stop), (1, Command::Run(Direction::Forward))],
        elsewhere: vec![(RESET, 0, Command::Nothing), (RESET, 1, Command::ResetFault)],
        registers: registers(),
        parameters: vec![Parameter::new(0x1200, 0, 10, 3), Parameter::new(0x1201, 1, 4, 3)],
        factory: &[],
        control_word: None,
        capped: &[],
        roles: Roles { speed: Some(Speed::hertz(FREQUENCY)), direction: Some((DIRECTION, 1)), ..Roles::NONE },
        delay: USUAL_DELAY,
        max_hertz: 400.0,
        faults: Faults { overload: None, silent_bus: None },
    }
}

fn registers() -> Vec<Register> {
    let coil = |address, bits| Register::read(spot(Table::Coil, address), Shows::Bits(bits));
    let measured = |address, measure, counts| Register::read(address, Shows::Measured(measure, counts));
    let unknown =
        (0x0011..=0x0016).chain([0x0018]).map(|address| Register::read(spot(Table::Coil, address), Shows::Zero));
    let known = vec![
        Register::set(RUN, Range::Words(0, 1)),
        Register::set(DIRECTION, Range::Words(0, 1)),
        Register::set(RESET, Range::Words(0, 1)),
        coil(0x000E, vec![Bit::Running(0)].into()),
        coil(0x000F, vec![Bit::Reverse(0)].into()),
        coil(0x0010, vec![Bit::Ready(0)].into()),
        coil(0x0017, vec![Bit::Fault(0)].into()),
        Register::set(0x0000, Range::Words(0, 0)),
        Register::set(FREQUENCY, Range::Words(0, 40_000)),
        Register::read(0x0002, Shows::State([3, 3, 2, 8], Vec::new().into())),
        Register::read(0x0011, Shows::Zero),
        Register::read(0x0012, Shows::Zero),
        Register::read(0x0013, Shows::Zero),
        Register::read(0x0014, Shows::Zero),
        Register::read(0x0015, Shows::Zero),
        Register::read(0x0016, Shows::Zero),
        Register::read(0x1000, Shows::Zero),
        measured(0x1001, Measure::Frequency, 100.0),
        measured(0x1002, Measure::Current, 100.0),
        Register::read(0x1003, Shows::State([1, 2, 0, 0], Vec::new().into())),
        measured(0x1010, Measure::Voltage, 10.0),
        Register::read(0x1018, Shows::Zero),
        measured(0x1025, Measure::BusVoltage, 10.0),
    ];
    known.into_iter().chain(unknown).collect()
}
