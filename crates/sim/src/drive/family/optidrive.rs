//! Invertek Optidrive E3: a control word of bits at register 1, a setpoint in tenths of a hertz at register 2, a status word at register 6.
//! Its guides number registers from 1; on the wire each is one less, as the E2's guide says (manualslib 2719256, p. 25).
//!
//! Registers 1 to 24 and parameters at 128 + number: ODE-3 user guide 1.00 (manualslib 2398257), p. 33. What the control word does, and that a
//! setpoint above P-01 is refused: ODE-3 fieldbus guide 1.00 (manualslib 2162510), p. 35; registers 2001 to 2016: p. 37. The status word: E3
//! advanced technical manual, issue 05 (manualshive 2085088), p. 35. Functions: ODE-3 user guide 1.00 (easymanua.ls ode-3-220105-1f42), p. 32;
//! 10H, for registers 1 to 4, is not simulated.
//!
//! - Assumption: it obeys the bus while P-12 is 3, which is 0 from the factory; with 4, the time at register 4 is not simulated. P-31 is 1, and
//!   changes nothing here. P-01 is 500.0 Hz. The enable input is closed.
//! - Assumption: P-04 (register 132) is both ramps, in hundredths of a second from 0 to P-01, and 100 s from the factory.
//! - Assumption: bit 1 stops along the same ramp as bit 0 does. A reset is the rise of bit 2 where bit 3 is 0, and does nothing else.
//! - Assumption: the control word takes any word. Bit 15 of register 2001 does not toggle. The high byte of the status word is 0 without a trip.
//! - Assumption: registers that no page lists are refused with 02H, as are 2100H and up; what is out of range with 03H. Sixteen words in a read.
//! - An overload is fault 4 (OPT-2-ETHEG-IN guide, manualshive 2085104, p. 13). A silent bus is not watched.

use super::{
    Bit, Bounds, Family, Faults, Kind, MAX_WORDS, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows,
    Speed, SpeedScale, SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::map::Access;
use crate::drive::refusal::by_the_specification;

const CONTROL_WORD: u32 = 0x0000;
const SETPOINT: u32 = 0x0001;
/// P-04, P-12, P-31 and P-36: 128 + number, less one.
const RAMPS: u16 = 131;
const COMMAND_SOURCE: u16 = 139;
const START_MODE: u16 = 158;
const SERIAL: u16 = 163;
/// P1-01, P1-03, P1-04 and P1-12 of a P2: registers 101, 103, 104 and 112.
const P2_MAXIMUM: u16 = 100;
const P2_ACCELERATION: u16 = 102;
const P2_DECELERATION: u16 = 103;
const P2_COMMAND_SOURCE: u16 = 111;

pub(crate) fn e3() -> Family {
    Family {
        name: "optidrive-e3".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06],
        max_words: MAX_WORDS,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(CONTROL_WORD),
        commands: Vec::new(),
        control_word: Some(control_word),
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
            acceleration: Some(Scaled::hundredths(RAMPS)),
            deceleration: Some(Scaled::hundredths(RAMPS)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: 500.0,
        faults: Faults { overload: Some(4), silent_bus: None },
    }
}

/// Optidrive P2: the same words, and parameters at 100 times the group and the number: P2 user guide 3.07 (manualshive 1390699), p. 66, and 3.00
/// (manualslib 1494676), p. 62; P1-12 = 4: easy start up manual (manualslib 1697910), p. 46.
///
/// - Assumption: as an E3 in all that those pages leave open. P1-03 and P1-04 (registers 103 and 104) are the ramps, in tenths of a second from 0 to
///   50 Hz, and 10 s from the factory; P1-01 is 50.0 Hz. No fieldbus module is in it.
pub(crate) fn p2() -> Family {
    let e3 = e3();
    Family {
        name: "optidrive-p2".into(),
        registers: REGISTERS_P2.to_vec(),
        parameters: PARAMETERS_P2.to_vec(),
        roles: Roles {
            obeys: vec![(P2_COMMAND_SOURCE, 4)],
            acceleration: Some(Scaled::tenths(P2_ACCELERATION)),
            deceleration: Some(Scaled::tenths(P2_DECELERATION)),
            ..e3.roles
        },
        max_hertz: USUAL_MAX_HZ,
        ..e3
    }
}

/// Bit 3 before bit 1 before bit 0.
fn control_word(before: u16, word: u16) -> Command {
    let is_set = |bit: u16| word & 1 << bit != 0;
    match () {
        () if is_set(3) => Command::Coast,
        () if is_set(2) && before & 1 << 2 == 0 => Command::ResetFault,
        () if is_set(1) => Command::Stop,
        () if is_set(0) => Command::Run(Direction::Forward),
        () => Command::Stop,
    }
}

const REGISTERS: &[Register] = &[
    Register::set(CONTROL_WORD, Range::Words(0, u16::MAX)),
    Register { address: SETPOINT, access: Access::Always, range: Range::Speed, shows: Shows::Written },
    Register::set(3, Range::Words(0, 60_000)),
    Register::read(5, Shows::bits(STATUS_WORD)),
    Register::read(6, Shows::Measured(Measure::SignedFrequency, 10.0)),
    Register::read(7, Shows::Measured(Measure::Current, 10.0)),
    Register::read(10, Shows::Zero),
    Register::read(19, Shows::Zero),
    Register::read(20, Shows::Zero),
    Register::read(21, Shows::Measured(Measure::Setpoint, 10.0)),
    Register::read(22, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(23, Shows::Zero),
    Register::read(2_000, Shows::bits(STATUS_WORD_2)),
    Register::read(2_015, Shows::Fault),
];

const STATUS_WORD: &[Bit] = &[Bit::Running(0), Bit::Fault(1), Bit::Ready(6), Bit::FaultNumber(8)];
const STATUS_WORD_2: &[Bit] = &[Bit::Ready(0), Bit::Running(1), Bit::Fault(2), Bit::OverloadAlarm(8), Bit::Reverse(13)];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(RAMPS, 0, 60_000, 10_000),
    Parameter::new(COMMAND_SOURCE, 0, 9, 0).at_standstill(),
    Parameter::new(START_MODE, 0, 7, 1),
    Parameter::new(SERIAL, 0, u16::MAX, 0),
];

const REGISTERS_P2: &[Register] = &[
    Register::set(CONTROL_WORD, Range::Words(0, u16::MAX)),
    Register { address: SETPOINT, access: Access::Always, range: Range::Speed, shows: Shows::Written },
    Register::set(2, Range::Words(0, 2_000)),
    Register::set(3, Range::Words(0, 60_000)),
    Register::read(5, Shows::bits(STATUS_WORD)),
    Register::read(6, Shows::Measured(Measure::SignedFrequency, 10.0)),
    Register::read(7, Shows::Measured(Measure::Current, 10.0)),
    Register::read(8, Shows::Zero),
    Register::read(9, Shows::Zero),
    Register::read(10, Shows::Zero),
    Register::read(19, Shows::Zero),
    Register::read(20, Shows::Zero),
    Register::read(21, Shows::Measured(Measure::Setpoint, 10.0)),
    Register::read(22, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(23, Shows::Zero),
];

const PARAMETERS_P2: &[Parameter] = &[
    Parameter::new(P2_MAXIMUM, 0, 5_000, 500),
    Parameter::new(P2_ACCELERATION, 0, 6_000, 100),
    Parameter::new(P2_DECELERATION, 0, 6_000, 100),
    Parameter::new(P2_COMMAND_SOURCE, 0, 6, 0).at_standstill(),
];
