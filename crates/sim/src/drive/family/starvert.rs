//! LS (LG, LSIS) Starvert and LSLV: one area from 0001H to 001BH, each word of which is one lower on the wire; 04H reads what 03H reads.
//!
//! The words, their scales, the bits of the command and of the state: ACtionMaster manual (CMC, a drive of LS; manualsonline 65346 as "Cleveland
//! Range inverter"), p. 81. Bits 13 and 14 of the state: SV-iP5A manual (easymanua.ls lsis sv-ip5a), p. 9-9. One less on the wire: LSLV-S100 manual
//! (easymanua.ls lsis s100), p. 141, G100 manual (easymanua.ls lsis g100), p. 236. Functions and exceptions: SV-iG5A manual (easymanua.ls lsis
//! sv-ig5a), p. 11-3. Eight words: H100 manual (easymanua.ls lsis lslv0055h100-4cofn), p. 366. The words of a real M100:
//! The-Intrigued-Engineer/RPi-Modbus-VFD.
//!
//! - Assumption: it obeys the bus, and takes the frequency from it. Which parameters decide that, is on no page at hand: there are none here.
//! - Assumption: bit 0 of a command counts before bit 3, bit 3 before bit 4, and that before the direction; both directions at once do nothing,
//!   nor do other bits. Bit 4 lets the motor coast.
//! - Assumption: while a motor slows down, its direction stays on, and bit 0 is off. In fault bits 0 and 3 are on.
//! - Assumption: the setpoint goes up to 400.00 Hz. Both ramps are 10 s from 0 to 60 Hz, whatever stands at 0007H and 0008H.
//! - Assumption: it is not locked, and 0004H changes nothing. It is the drive of 1.5 kW at 220 V, with version 2.2.
//! - Assumption: what no page lists is refused with 02H, as is 0000H, which no address on the wire reaches; what can only be read, with 14H.
//! - An overload is bit 8 of 000FH, printed for the iP5A. Bits 4 to 8, 11 and 12 of the state, a silent bus and parameters are not simulated.

use std::borrow::Cow;

use drivebus_rtu::Table;

use super::{
    Bit, Bounds, Family, Faults, Kind, Measure, Memory, Range, Register, Roles, Shows, Speed, SpeedScale, SpeedUnit,
    USUAL_DELAY,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::places::spot;
use crate::drive::refusal::Refusal;

const SETPOINT: u32 = 0x0004;
const RUN_COMMAND: u32 = 0x0005;

pub(crate) fn starvert() -> Family {
    Family {
        name: "starvert".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x04, 0x06, 0x10],
        max_words: 8,
        across_groups: true,
        exception,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(RUN_COMMAND),
        commands: Vec::new(),
        control_word: Some(decoded),
        elsewhere: Vec::new(),
        registers: registers(),
        parameters: Vec::new(),
        factory: &[],
        capped: &[],
        roles: Roles {
            speed: Some(Speed {
                register: SETPOINT,
                unit: None,
                usual: SpeedScale { unit: SpeedUnit::Hertz, counts: 100.0, bounds: Bounds::new(0, 40_000) },
            }),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: 60.0,
        faults: Faults { overload: Some(1 << 8), silent_bus: None },
    }
}

fn exception(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function => 0x01,
        Refusal::Address | Refusal::Unreadable => 0x02,
        Refusal::Value | Refusal::Structure => 0x03,
        Refusal::ReadOnly | Refusal::Running | Refusal::Locked | Refusal::Password => 0x14,
    }
}

fn decoded(_before: u16, word: u16) -> Command {
    let is_set = |bit: u16| word & 1 << bit != 0;
    match (is_set(1), is_set(2)) {
        _ if is_set(0) => Command::Stop,
        _ if is_set(3) => Command::ResetFault,
        _ if is_set(4) => Command::Coast,
        (true, false) => Command::Run(Direction::Forward),
        (false, true) => Command::Run(Direction::Reverse),
        _ => Command::Nothing,
    }
}

/// What is read by 03H, and the same by 04H.
fn registers() -> Vec<Register> {
    let by_04h = |register: &Register| {
        let shows = match &register.shows {
            Shows::Written => Shows::WrittenTo(register.address),
            shows => shows.clone(),
        };
        Register::read(spot(Table::Input, 0) | register.address, shows)
    };
    WORDS.iter().cloned().chain(WORDS.iter().map(by_04h)).collect()
}

const WORDS: &[Register] = &[
    Register::read(0x0000, Shows::bits(&[Bit::Always(2)])),
    Register::read(0x0001, Shows::Zero),
    Register::read(0x0002, Shows::bits(&[Bit::Always(0x0022)])),
    Register::set(0x0003, Range::Words(0, 1)),
    Register::set(SETPOINT, Range::Speed),
    Register::set(RUN_COMMAND, Range::Words(0, u16::MAX)),
    Register::set(0x0006, Range::Words(0, 60_000)),
    Register::set(0x0007, Range::Words(0, 60_000)),
    Register::read(0x0008, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x0009, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x000A, Shows::Measured(Measure::Voltage, 1.0)),
    Register::read(0x000B, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(0x000C, Shows::Zero),
    Register::read(0x000D, Shows::State([1 << 1, 1 << 2, 1 << 0, 1 << 3 | 1 << 0], Cow::Borrowed(FROM_THE_BUS))),
    Register::read(0x000E, Shows::Fault),
    Register::read(0x000F, Shows::Zero),
    Register::read(0x0010, Shows::Zero),
    Register::read(0x0014, Shows::Measured(Measure::Speed, 1.0)),
];

/// Commands, and the frequency.
const FROM_THE_BUS: &[Bit] = &[Bit::Always(1 << 13 | 1 << 14)];
