//! Veikong VFD500: its own command block, states, faults and exceptions, and bit 15 the other way round.
//!
//! Manual pages 96, 97 and 131 to 137. 2000H, 2100H and 3000H are addresses of parameters here (P32.00, P33.00, P48.00)
//! that do not exist, so what is meant for a Goodrive is refused with 02H. A read that leaves its group meets an address
//! that is not there, since no group has 256 parameters.
//!
//! - Assumption: 0 in the command register does nothing; the manual calls it "disable".
//! - Assumption: a jog ends by any of the stops, there being no command of its own for it.
//! - Assumption: P00.02 = 2 obeys the bus, and the speed then comes from 7001H; otherwise it comes from P00.07, taken as
//!   the keypad's frequency. The pages of group 00 are not at hand.
//! - Assumption: P30.14 is 0 for percent, 1 for hertz, 2 for rpm, in the order of the manual's list, and hertz from the
//!   factory. P01.06 is the maximum frequency, 50.00 Hz from the factory, changed at standstill only.
//! - Assumption: running and set frequency stand at r27.00 and r27.01 in hundredths of a hertz, their signs at r27.02, the
//!   bus voltage at r27.03 in tenths of a volt, the status words at r27.18 and r27.19. The words between are not here.
//! - Assumption: r16.00 counts watt-hours and outlives the power; r30.06 to r30.08 begin anew with it.
//! - Assumption: P30.04 is 1 ms from the factory, the lowest value.
//! - Ramps and jog have no parameters in the pages at hand; the times are fixed.
//! - Assumption: as a master (P30.09 = 1) it stays a slave here.

use super::{
    Bit, Bounds, Count, Deciding, Family, Faults, Kind, MAX_WORDS, MEMORY_BIT, Measure, Memory, Parameter, Range,
    Register, Roles, Scaled, Shows, Speed, SpeedScale, SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::Refusal;

const RUN_CHANNEL: u16 = 0x0002;
const KEYPAD_FREQUENCY: u16 = 0x0007;
const MAX_FREQUENCY: u16 = 0x0106;
const UNIT_ADDRESS: u16 = 0x1E01;
const RESPONSE_DELAY: u16 = 0x1E04;
const BUS_TIMEOUT: u16 = 0x1E05;
const SPEED_UNIT: u16 = 0x1E0E;

pub(crate) fn vfd500() -> Family {
    Family {
        name: "vfd500".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x08, 0x10],
        max_words: MAX_WORDS,
        across_groups: true,
        exception,
        memory: Memory::BitMeansEeprom(MEMORY_BIT),
        identification: 0,
        command: Some(0x7000),
        commands: COMMANDS.to_vec(),
        registers: [CONTROL, MONITOR].concat(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        control_word: None,
        elsewhere: Vec::new(),
        capped: &[],
        roles: Roles {
            obeys: vec![(RUN_CHANNEL, 2)],
            channel: Some(RUN_CHANNEL),
            speed: Some(speed()),
            keypad_frequency: Some(Scaled::hundredths(KEYPAD_FREQUENCY)),
            max_frequency: Some(Scaled::hundredths(MAX_FREQUENCY)),
            unit_address: Some(UNIT_ADDRESS),
            response_delay: Some(RESPONSE_DELAY),
            bus_timeout: Some(Scaled::tenths(BUS_TIMEOUT)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(11), silent_bus: Some(34) },
    }
}

/// In hundredths of a hertz, unless P30.14 says hundredths of a percent or rpm.
fn speed() -> Speed {
    let scale = |unit, counts, bounds| SpeedScale { unit, counts, bounds };
    let percent = Bounds { signed: true, ..Bounds::new(-10_000, 10_000) };
    Speed {
        register: 0x7001,
        unit: Some(Deciding::Words(
            SPEED_UNIT,
            vec![(0, scale(SpeedUnit::Percent, 100.0, percent)), (2, scale(SpeedUnit::Rpm, 1.0, Bounds::NONE))],
        )),
        usual: scale(SpeedUnit::Hertz, 100.0, Bounds::new(0, 60_000)),
    }
}

/// 01H to 05H, and no others.
///
/// Assumption: 03H for a number of words that is not allowed, 04H for whatever else is not to be written (at the moment).
fn exception(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function => 0x01,
        Refusal::Address => 0x02,
        Refusal::Structure => 0x03,
        Refusal::Value | Refusal::ReadOnly | Refusal::Running | Refusal::Password | Refusal::Locked => 0x04,
        Refusal::Unreadable => 0x05,
    }
}

/// 7000H.
const COMMANDS: &[(u16, Command)] = &[
    (0, Command::Nothing),
    (1, Command::Run(Direction::Forward)),
    (2, Command::Run(Direction::Reverse)),
    (3, Command::Jog(Direction::Forward)),
    (4, Command::Jog(Direction::Reverse)),
    (5, Command::Coast),
    (6, Command::Stop),
    (7, Command::StopAtOnce),
    (8, Command::ResetFault),
];

/// Assumption: none of it can be read back; the manual's access column is lost.
const CONTROL: &[Register] = &[
    Register::write_only(0x7000, Range::Words(0, 8)),
    Register::write_only(0x7001, Range::Speed),
    Register::write_only(0x7002, Range::Signed(-30_000, 30_000)),
    Register::write_only(0x7003, Range::Speed),
    Register::write_only(0x7004, Range::Speed),
    Register::write_only(0x7005, Range::Words(0, 3_000)),
    Register::write_only(0x7006, Range::Words(0, 3_000)),
    Register::write_only(0x7007, Range::Signed(-10_000, 10_000)),
    Register::write_only(0x7008, Range::Signed(-10_000, 10_000)),
    Register::write_only(0x7009, Range::Words(0, 1_000)),
    Register::write_only(0x700A, Range::Words(0, u16::MAX)),
];

const MONITOR: &[Register] = &[
    Register::read(0x0600, Shows::Inputs(None)),
    Register::read(0x1000, Shows::Energy(0)),
    Register::read(0x1001, Shows::Energy(1)),
    Register::read(0x1900, Shows::Fault),
    Register::read(0x1B00, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x1B01, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x1B02, Shows::bits(&[Bit::Reverse(0), Bit::ReverseSetpoint(1)])),
    Register::read(0x1B03, Shows::Measured(Measure::BusVoltage, 10.0)),
    Register::read(0x1B12, Shows::bits(STATUS_WORD_1)),
    Register::read(0x1B13, Shows::bits(&[Bit::Channel(0)])),
    Register::read(0x1E06, Shows::Count(Count::Received)),
    Register::read(0x1E07, Shows::Count(Count::Sent)),
    Register::read(0x1E08, Shows::Count(Count::Spoilt)),
];

/// A fault coasts (0 in bits 4 and 5). Assumption: the overload pre-alarm is a warning.
const STATUS_WORD_1: &[Bit] = &[
    Bit::Running(0),
    Bit::Reverse(1),
    Bit::Ready(2),
    Bit::Fault(3),
    Bit::Jogging(6),
    Bit::Ramp(10),
    Bit::OverloadAlarm(12),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(RUN_CHANNEL, 0, 2, 0),
    Parameter::new(KEYPAD_FREQUENCY, 0, 60_000, 5_000).not_above(MAX_FREQUENCY),
    Parameter::new(MAX_FREQUENCY, 0, 60_000, 5_000).at_standstill(),
    Parameter::new(UNIT_ADDRESS, 1, 247, 1),
    Parameter::new(0x1E02, 0, 7, 3),
    Parameter::new(0x1E03, 0, 5, 0),
    Parameter::new(RESPONSE_DELAY, 1, 20, 1),
    Parameter::new(BUS_TIMEOUT, 0, 600, 0),
    Parameter::new(0x1E09, 0, 1, 0),
    Parameter::new(0x1E0A, 1, 9, 1),
    Parameter::new(0x1E0B, 0, u16::MAX, 0),
    Parameter::new(0x1E0C, 0, u16::MAX, 0),
    Parameter::new(SPEED_UNIT, 0, 2, 1),
];
