//! H100: a coil each for forward, reverse and stop, the same as bits of a word, and what it measures in input registers.
//!
//! Coils 0049H, 004AH and 004BH, the setpoint at 0201H, input registers 0000H and 0001H: FluidNC (H100Spindle.md, "tested"). 0200H with
//! bits 0 to 7 for the coils 0048H to 004FH, input registers from 0002H on, faults and exceptions: JustKitting/linuxcnc_dmc2,
//! h100_protocol.py, which names pp. 84, 85 and 90 of the manual V1.8. Bits of 0210H and the copies from 0220H on: measured at a Vevor
//! D100 (bartool/linuxcnc-modbus, modbus.md). F169: the D100's manual, section 6.10.
//!
//! - Assumption: 01H, 02H, 08H and 10H are no functions of it, and coils cannot be read.
//! - Assumption: a coil that is written as 0 does nothing, and 0200H knows one bit at a time, and 0 and 5 as bbctrl sends them.
//! - Assumption: bit 0 runs forward, as after power-up; a real drive runs as it ran last. Jogs do nothing here.
//! - Assumption: volts are counted whole. Temperature, counter, PID, hours and power are 0.
//! - Assumption: F005 is 400.0 Hz, F014 and F015 are 10.0 s. A fault is not cleared from the bus. A silent bus is not watched, and nothing
//!   overloads it.

use drivebus_rtu::Table;

use super::{
    Bit, Bounds, Deciding, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows,
    Speed, SpeedScale, SpeedUnit, USUAL_DELAY,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::places::spot;
use crate::drive::refusal::by_the_specification;

const FORWARD: u32 = spot(Table::Coil, 0x0049);
const REVERSE: u32 = spot(Table::Coil, 0x004A);
const STOP: u32 = spot(Table::Coil, 0x004B);
const WORD: u32 = 0x0200;
const COMMAND_SOURCE: u16 = 0x0001;
const FREQUENCY_SOURCE: u16 = 0x0002;
const MAX_FREQUENCY: u16 = 0x0005;
const ACCELERATION: u16 = 0x000E;
const DECELERATION: u16 = 0x000F;
const STOP_MODE: u16 = 0x001A;
const ADDRESS: u16 = 0x00A3;
const DECIMALS: u16 = 0x00A9;

pub(crate) fn h100() -> Family {
    Family {
        name: "h100".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x04, 0x05, 0x06],
        max_words: 20,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(FORWARD),
        commands: vec![(0, Command::Nothing), (1, Command::Run(Direction::Forward))],
        elsewhere: ELSEWHERE.to_vec(),
        registers: registers(),
        parameters: PARAMETERS.to_vec(),
        factory: &[(0x00A4, 2), (0x00A5, 3), (0x008F, 2)],
        control_word: None,
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 2)],
            speed_source: Some(vec![(FREQUENCY_SOURCE, 2)]),
            speed: Some(Speed {
                register: 0x0201,
                unit: Some(Deciding::Words(DECIMALS, vec![(1, hertz(100.0))])),
                usual: hertz(10.0),
            }),
            keypad_frequency: Some(Scaled::tenths(0x0003)),
            max_frequency: Some(Scaled::tenths(MAX_FREQUENCY)),
            acceleration: Some(Scaled::tenths(ACCELERATION)),
            deceleration: Some(Scaled::tenths(DECELERATION)),
            coasts_to_stop: Some((STOP_MODE, 1)),
            unit_address: Some(ADDRESS),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: 400.0,
        faults: Faults { overload: None, silent_bus: None },
    }
}

const fn hertz(counts: f64) -> SpeedScale {
    SpeedScale { unit: SpeedUnit::Hertz, counts, bounds: Bounds::NONE }
}

const ELSEWHERE: &[(u32, u16, Command)] = &[
    (REVERSE, 0, Command::Nothing),
    (REVERSE, 1, Command::Run(Direction::Reverse)),
    (STOP, 0, Command::Nothing),
    (STOP, 1, Command::Stop),
    (WORD, 0, Command::Stop),
    (WORD, 1, Command::Run(Direction::Forward)),
    (WORD, 2, Command::Run(Direction::Forward)),
    (WORD, 4, Command::Run(Direction::Reverse)),
    (WORD, 5, Command::Run(Direction::Reverse)),
    (WORD, 8, Command::Stop),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(0x0000, 0, 1, 0),
    Parameter::new(COMMAND_SOURCE, 0, 2, 0).at_standstill(),
    Parameter::new(FREQUENCY_SOURCE, 0, 7, 0).at_standstill(),
    Parameter::new(MAX_FREQUENCY, 0, 10_000, 4_000),
    Parameter::new(ACCELERATION, 1, 65_000, 100),
    Parameter::new(DECELERATION, 1, 65_000, 100),
    Parameter::new(STOP_MODE, 0, 1, 0),
];

fn registers() -> Vec<Register> {
    let input = |address, shows| Register::read(spot(Table::Input, address), shows);
    let mut known: Vec<Register> =
        (0x0048..=0x004F).map(|coil| Register::write_only(spot(Table::Coil, coil), Range::Words(0, 1))).collect();
    known.extend([
        input(0x0000, Shows::Measured(Measure::Frequency, 10.0)),
        input(0x0001, Shows::Measured(Measure::Setpoint, 10.0)),
        input(0x0002, Shows::Measured(Measure::Current, 10.0)),
        input(0x0003, Shows::Measured(Measure::Speed, 1.0)),
        input(0x0004, Shows::Measured(Measure::BusVoltage, 1.0)),
        input(0x0005, Shows::Measured(Measure::Voltage, 1.0)),
        input(0x0006, Shows::Zero),
        input(0x0007, Shows::Zero),
        input(0x0008, Shows::Zero),
        input(0x0009, Shows::Zero),
        input(0x000A, Shows::Fault),
        input(0x000B, Shows::Zero),
        input(0x000C, Shows::Zero),
        input(0x000D, Shows::Inputs(None)),
        Register::write_only(WORD, Range::Words(0, 0xFF)),
        Register::set(0x0201, Range::Speed),
        Register::read(0x0210, Shows::Bits(vec![Bit::Running(0), Bit::Reverse(2), Bit::Running(3)].into())),
        Register::read(0x0220, Shows::Measured(Measure::Frequency, 10.0)),
        Register::read(0x0221, Shows::Measured(Measure::Setpoint, 10.0)),
        Register::read(0x0222, Shows::Measured(Measure::Current, 10.0)),
        Register::read(0x0223, Shows::Measured(Measure::Speed, 1.0)),
    ]);
    known
}
