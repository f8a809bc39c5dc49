//! Hitachi SJ200 (L200): run and direction are two coils, at the numbers that its manual prints. 1 at the second one is forward, and 0 reverse.
//!
//! Coils 0001h run, 0002h direction, 0004h reset, 000Eh running, 000Fh reverse, 0010h ready: SJ200 manual (manualslib 68018), p. 233;
//! 0014h alarm and those behind it: (manualsdir 88658), p. 234. Register 0001h, 0.1 Hz, and 0002h: L200 manual (manualsonline l200), p. 237.
//! 000Ah to 0019h: SJ200 manual (azmanual 88658), p. 236. 003Ah, A020: (manualsdump 112379), p. 227. That the numbers are the addresses: the
//! frames of manualsonline sj200_series, p. 226, and of that page. Exceptions: L200 manual (manualsonline l200), p. 233 (B-17).
//! 0019h to 001Bh: SJ200 manual (easymanua.ls sj200-series), p. 225 (B-11).
//!
//! - Assumption: A001 and A002 are set so that the bus is obeyed. They are not simulated, nor are other parameters than A020.
//! - Assumption: 0003h = 1 lets the motor coast and trips nothing; no trip is kept at 0019h.
//! - Assumption: 100 % of the current are 10 A, and of the voltage 400 V. Coils 0007h to 000Ch do nothing, and are not here.
//! - Assumption: the direction of a motor that runs is changed at once, and a reset is carried out by each 1.

use drivebus_rtu::Table;

use super::{
    Bit, Bounds, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed,
    SpeedScale, SpeedUnit, USUAL_DELAY,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::map::Access;
use crate::drive::places::spot;
use crate::drive::refusal::Refusal;

const RUN: u32 = spot(Table::Coil, 0x0001);
const DIRECTION: u32 = spot(Table::Coil, 0x0002);
const EXTERNAL_TRIP: u32 = spot(Table::Coil, 0x0003);
const RESET: u32 = spot(Table::Coil, 0x0004);
const FREQUENCY: u32 = 0x0001;
const MULTI_SPEED: u16 = 0x003A;

pub(crate) fn sj200() -> Family {
    let tenths = SpeedScale { unit: SpeedUnit::Hertz, counts: 10.0, bounds: Bounds::new(0, 4_000) };
    Family {
        name: "sj200".into(),
        kind: Kind::Inverter,
        functions: vec![0x01, 0x03, 0x05, 0x06, 0x08, 0x10],
        max_words: 4,
        across_groups: true,
        exception,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(RUN),
        commands: vec![(0, Command::Stop), (1, Command::Run(Direction::Forward))],
        elsewhere: vec![
            (EXTERNAL_TRIP, 0, Command::Nothing),
            (EXTERNAL_TRIP, 1, Command::Coast),
            (RESET, 0, Command::Nothing),
            (RESET, 1, Command::ResetFault),
        ],
        registers: registers(),
        parameters: vec![Parameter::new(MULTI_SPEED, 0, 4_000, 0)],
        factory: &[],
        control_word: None,
        capped: &[],
        roles: Roles {
            speed: Some(Speed { register: FREQUENCY, unit: None, usual: tenths }),
            direction: Some((DIRECTION, 0)),
            keypad_frequency: Some(Scaled::tenths(MULTI_SPEED)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: 400.0,
        faults: Faults { overload: None, silent_bus: None },
    }
}

/// L200 manual, p. B-17.
fn exception(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function => 0x01,
        Refusal::Address | Refusal::Unreadable => 0x02,
        Refusal::Structure => 0x03,
        Refusal::Value => 0x21,
        Refusal::ReadOnly | Refusal::Running | Refusal::Password | Refusal::Locked => 0x22,
    }
}

fn registers() -> Vec<Register> {
    let coil = |address, bits| Register::read(spot(Table::Coil, address), Shows::Bits(bits));
    let measured = |address, measure, counts| Register::read(address, Shows::Measured(measure, counts));
    let zero = |address| Register::read(address, Shows::Zero);
    let no_trip = |address| Register::read(address, Shows::state([255; 4]));
    vec![
        Register::set(RUN, Range::Words(0, 1)),
        Register::set(DIRECTION, Range::Words(0, 1)),
        Register::set(EXTERNAL_TRIP, Range::Words(0, 1)),
        Register::set(RESET, Range::Words(0, 1)),
        coil(0x000E, vec![Bit::Running(0)].into()),
        coil(0x000F, vec![Bit::Reverse(0)].into()),
        coil(0x0010, vec![Bit::Ready(0)].into()),
        coil(0x0014, vec![Bit::Fault(0)].into()),
        coil(0x0016, vec![Bit::OverloadAlarm(0)].into()),
        coil(0x001A, Vec::new().into()),
        Register { address: FREQUENCY, access: Access::Always, range: Range::Speed, shows: Shows::Written },
        // 02 stop mode, 03 run mode.
        Register::read(0x0002, Shows::state([3, 3, 2, 2])),
        measured(0x000A, Measure::Frequency, 10.0),
        // Tenths of a percent of 10 A.
        measured(0x000B, Measure::Current, 100.0),
        Register::read(0x000C, Shows::state([1, 2, 0, 0])),
        zero(0x000F),
        zero(0x0010),
        // Hundredths of a percent of 400 V.
        measured(0x0013, Measure::Voltage, 25.0),
        zero(0x0018),
        // No trip.
        no_trip(0x0019),
        no_trip(0x001A),
        no_trip(0x001B),
    ]
}
