//! Hitachi X200: run and direction are two coils, 1 at the second one is forward, and its manual numbers coils and registers from 1: on the wire
//! each is one less, as its frames show (X200 manual, pp. B-12, B-13 and B-16: manualsdir 355636, p. 255; azmanual 355636, pp. 256 and 259).
//!
//! Coils 0001h run, 0002h direction, 0003h external trip, 0004h reset, 000Eh running, 000Fh reverse, 0010h ready: (manualsdir 355636), p. 262.
//! 0014h alarm and 0018h at speed: andrewsuzuki/x200-vfd-hal. Register 0002h, 0.1 Hz: (manualsdump 112419), p. 248. 0012h to 0017h: p. 255.
//! 1002h to 1004h, and A001 and A002 at 1019h and 101Ah: joejond/catatan_si_amoy, with what they count from the SJ200 manual (azmanual 88658),
//! p. 236. F002 at 1014h and 1015h, A020 at 1029h: pp. 259 and 256. Exceptions: L200 manual (manualsonline l200), p. 233 (B-17).
//!
//! - Assumption: A001 and A002 are set so that the bus is obeyed, and other values change nothing; other parameters are not simulated.
//! - Assumption: coils 0005h, 0006h and 0011h to 0013h, which are reserved and read only, are answered, and 0.
//! - Assumption: 0003h = 1 lets the motor coast and trips nothing; no trip is kept at 0012h.
//! - Assumption: 100 % of the current are 10 A. Coils 0007h to 000Bh do nothing, and are not here.
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

const RUN: u32 = spot(Table::Coil, 0x0000);
const DIRECTION: u32 = spot(Table::Coil, 0x0001);
const EXTERNAL_TRIP: u32 = spot(Table::Coil, 0x0002);
const RESET: u32 = spot(Table::Coil, 0x0003);
const FREQUENCY: u32 = 0x0001;
const MULTI_SPEED: u16 = 0x1028;

pub(crate) fn x200() -> Family {
    let tenths = SpeedScale { unit: SpeedUnit::Hertz, counts: 10.0, bounds: Bounds::new(0, 4_000) };
    Family {
        name: "x200".into(),
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
        parameters: vec![
            // F002, the high word first, hundredths of a second: 10 s.
            Parameter::new(0x1013, 0, u16::MAX, 0),
            Parameter::new(0x1014, 0, u16::MAX, 1_000),
            Parameter::new(0x1018, 0, 3, 3),
            Parameter::new(0x1019, 0, 3, 3),
            Parameter::new(MULTI_SPEED, 0, 4_000, 0),
        ],
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
    let reserved = [0x0004, 0x0005, 0x0010, 0x0011, 0x0012].map(|address| zero(spot(Table::Coil, address)));
    let known = vec![
        Register::set(RUN, Range::Words(0, 1)),
        Register::set(DIRECTION, Range::Words(0, 1)),
        Register::set(EXTERNAL_TRIP, Range::Words(0, 1)),
        Register::set(RESET, Range::Words(0, 1)),
        coil(0x000D, vec![Bit::Running(0)].into()),
        coil(0x000E, vec![Bit::Reverse(0)].into()),
        coil(0x000F, vec![Bit::Ready(0)].into()),
        coil(0x0013, vec![Bit::Fault(0)].into()),
        zero(spot(Table::Coil, 0x0017)),
        Register { address: FREQUENCY, access: Access::Always, range: Range::Speed, shows: Shows::Written },
        // The factor, one that is not used, the frequency, one that is not used, the current, the voltage.
        zero(0x0011),
        zero(0x0012),
        zero(0x0013),
        zero(0x0014),
        zero(0x0015),
        zero(0x0016),
        measured(0x1001, Measure::Frequency, 10.0),
        // Tenths of a percent of 10 A.
        measured(0x1002, Measure::Current, 100.0),
        Register::read(0x1003, Shows::state([1, 2, 0, 0])),
    ];
    known.into_iter().chain(reserved).collect()
}
