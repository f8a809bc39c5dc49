//! Eaton PowerXL DC1: a command of bits at ID 1, a setpoint in tenths of a hertz at ID 2, a status and fault word at ID 6. An ID is one less on
//! the wire: manual MN04020003Z-EN 10/12 (manualshive dc1-12011-series 525259), pp. 157 and 158.
//!
//! The command: MN04020003Z-EN 12/13 (easymanua.ls powerxl-dc1-series), p. 149; IDs 6 to 28: p. 150; the bits of the state: p. 151; the type: p. 152.
//! IDs 1 to 4, and 129 to 175 for parameters: 10/12 (easymanua.ls dc1-124d1fn-a20n), p. 151. Functions, and eleven words in a read: 10/12
//! (manualshive powerxl-dc1 3846842), p. 149.
//!
//! - Assumption: it obeys the bus while P-12 (ID 140) is 3, which is 0 from the factory. P-01 is 500.0 Hz, and what is above it is refused. What
//!   the inputs and ID 4 do is not simulated.
//! - Assumption: P-03 and P-04 (IDs 131 and 132) are the ramps, in hundredths of a second from 0 to P-01, and 100 s from the factory. A stop goes
//!   along the second.
//! - Assumption: bit 3 goes before bit 0. A reset is the rise of bit 2 where bit 3 is 0, and does nothing else. Bits 5 to 7 change nothing.
//! - Assumption: the frequency at ID 7 has no sign. "Run" is on until it stands. Bits 4 to 6 of the status word are 0, as is its fault word without one.
//! - Assumption: IDs that no page lists are refused with 02H, as is a write to what can only be read; what is out of range with 03H.
//! - Assumption: an overload and a silent bus trip nothing.

use super::{
    Bit, Bounds, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed,
    SpeedScale, SpeedUnit, USUAL_DELAY,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::map::Access;
use crate::drive::refusal::by_the_specification;

const COMMAND: u32 = 0;
const SETPOINT: u32 = 1;
/// P-03, P-04, P-12 and P-36: IDs 131, 132, 140 and 164.
const ACCELERATION: u16 = 130;
const DECELERATION: u16 = 131;
const COMMAND_SOURCE: u16 = 139;
const UNIT_ADDRESS: u16 = 163;

pub(crate) fn dc1() -> Family {
    Family {
        name: "dc1".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06],
        max_words: 11,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(COMMAND),
        commands: Vec::new(),
        control_word: Some(command),
        elsewhere: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 3)],
            speed: Some(Speed {
                register: SETPOINT,
                unit: None,
                usual: SpeedScale { unit: SpeedUnit::Hertz, counts: 10.0, bounds: Bounds::new(0, 5_000) },
            }),
            acceleration: Some(Scaled::hundredths(ACCELERATION)),
            deceleration: Some(Scaled::hundredths(DECELERATION)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: 500.0,
        faults: Faults { overload: None, silent_bus: None },
    }
}

/// Bit 0 runs, 1 is the direction, 2 resets as it rises, 3 coasts.
fn command(before: u16, word: u16) -> Command {
    let is_set = |bit: u16| word & 1 << bit != 0;
    match () {
        () if is_set(3) => Command::Coast,
        () if is_set(2) && before & 1 << 2 == 0 => Command::ResetFault,
        () if is_set(0) && is_set(1) => Command::Run(Direction::Reverse),
        () if is_set(0) => Command::Run(Direction::Forward),
        () => Command::Stop,
    }
}

const REGISTERS: &[Register] = &[
    Register::set(COMMAND, Range::Words(0, u16::MAX)),
    Register { address: SETPOINT, access: Access::Always, range: Range::Speed, shows: Shows::Written },
    Register::set(3, Range::Words(0, u16::MAX)),
    Register::read(5, Shows::bits(STATUS_WORD)),
    Register::read(6, Shows::Measured(Measure::Frequency, 10.0)),
    Register::read(7, Shows::Measured(Measure::Current, 10.0)),
    Register::read(10, Shows::Zero),
    // FS2, one decimal, a DC1, kW: 4.0 kW at 400 V.
    Register::read(11, Shows::bits(&[Bit::Always(0x2140)])),
    Register::read(12, Shows::bits(&[Bit::Always(40)])),
    Register::read(13, Shows::bits(&[Bit::Always(400)])),
    Register::read(14, Shows::Zero),
    Register::read(15, Shows::Zero),
    Register::read(16, Shows::Zero),
    Register::read(19, Shows::Zero),
    Register::read(20, Shows::Zero),
    Register::read(21, Shows::Zero),
    Register::read(22, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(23, Shows::Zero),
    Register::read(24, Shows::Zero),
    Register::read(25, Shows::Zero),
    Register::read(26, Shows::Zero),
    Register::read(27, Shows::Zero),
];

const STATUS_WORD: &[Bit] = &[Bit::Ready(0), Bit::Running(1), Bit::Reverse(2), Bit::Fault(3), Bit::FaultNumber(8)];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(ACCELERATION, 0, 60_000, 10_000),
    Parameter::new(DECELERATION, 0, 60_000, 10_000),
    Parameter::new(COMMAND_SOURCE, 0, 9, 0).at_standstill(),
    Parameter::new(UNIT_ADDRESS, 1, 63, 1),
];
