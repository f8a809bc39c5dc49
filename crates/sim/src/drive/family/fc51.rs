//! Danfoss VLT Micro Drive FC 51: a control word and a status word of bits, a reference in shares of 4000H, and parameters at
//! ten times their number less one.
//!
//! Bits of both words: operating instructions MG.02.A4.02, p. 28 (easymanua.ls danfoss vlt-micro-drive-fc-51-series, p. 29).
//! Parameters at 10 × number - 1, the high word first: p. 33. Functions: design guide MG02K202, p. 80 (manualslib 1599625, p. 81);
//! those of coils, and 0BH and 11H, are not simulated. Control word 49999, reference 50009, status word 50199, measured
//! values: wirenboard/wb-mqtt-serial, templates/config-danfoss-fc51.json.
//!
//! - Assumption: any control word is taken. One without bit 10, "data valid", changes nothing.
//! - Assumption: coasting goes before all other bits, a reset before what moves, the DC brake before the quick stop. The quick
//!   stop takes as long as the ramp, the DC brake holds at once, and a frozen output goes on as it was.
//! - Assumption: a reset is the rise of bit 7, and does nothing else, whatever the other bits are.
//! - Assumption: it obeys the bus as it comes from the factory, with references of 0 to 50.000 Hz (3-03) and a ramp of
//!   10.00 s; the main actual value and 16-01 are shares of 50 Hz.
//! - Assumption: bit 2 of the status word is as bit 1, and bits 8 and 12 to 14 are 0. Which bit of the alarm word a fault has
//!   is in no page at hand: it reads as 0. An overload does not trip.
//! - Assumption: exceptions are those of the Modbus specification, and an address in the ten of a parameter beyond its
//!   words is not there.

use super::{
    Bit, Bounds, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed,
    SpeedScale, SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::map::Access;
use crate::drive::refusal::by_the_specification;

pub(super) const CONTROL_WORD: u32 = 49_999;
pub(super) const REFERENCE: u32 = 50_009;
/// The low words of 3-03 and 3-42.
const HIGHEST_REFERENCE: u16 = 3_030;
const RAMP_DOWN: u16 = 3_420;
/// Counts of 1 % of the reference: 4000H are 100 %.
pub(super) const SHARE: f64 = 163.84;
/// Most words of one request. Assumption.
const MAX_WORDS: u16 = 63;

pub(crate) fn fc51() -> Family {
    Family {
        name: "fc51".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x10],
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
        parameters: vec![
            Parameter::new(29, 0, 1, 0),
            Parameter::shown(HIGHEST_REFERENCE - 1),
            Parameter { factory: 50_000, ..Parameter::shown(HIGHEST_REFERENCE) },
            Parameter { access: Access::Stopped, ..Parameter::shown(RAMP_DOWN - 1) },
            Parameter { factory: 1_000, access: Access::Stopped, ..Parameter::shown(RAMP_DOWN) },
        ],
        factory: &[],
        capped: &[],
        roles: Roles {
            speed: Some(Speed {
                register: REFERENCE,
                unit: None,
                usual: SpeedScale {
                    unit: SpeedUnit::Percent,
                    counts: SHARE,
                    bounds: Bounds { signed: true, ..Bounds::NONE },
                },
            }),
            max_frequency: Some(Scaled { address: HIGHEST_REFERENCE, counts: 1_000.0 }),
            deceleration: Some(Scaled::hundredths(RAMP_DOWN)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: None, silent_bus: None },
    }
}

/// Bits 2 to 5 are 0 for the DC brake, coasting, quick stop and frozen output; 6 starts, 7 resets as it rises, 8 jogs, 10 says
/// that the others count, 15 reverses.
pub(super) fn control_word(before: u16, word: u16) -> Command {
    let bit = |place: u16| word & 1 << place != 0;
    let direction = if bit(15) { Direction::Reverse } else { Direction::Forward };
    match () {
        () if !bit(10) => Command::Nothing,
        () if !bit(3) => Command::Coast,
        () if bit(7) && before & 1 << 7 == 0 => Command::ResetFault,
        () if !bit(2) => Command::StopAtOnce,
        () if !bit(4) => Command::Stop,
        () if bit(8) => Command::Jog(direction),
        () if bit(6) && !bit(5) => Command::Nothing,
        () if bit(6) => Command::Run(direction),
        () => Command::Stop,
    }
}

const REGISTERS: &[Register] = &[
    Register::set(CONTROL_WORD, Range::Words(0, u16::MAX)),
    Register { address: REFERENCE, access: Access::Always, range: Range::Speed, shows: Shows::Written },
    Register::read(50_199, Shows::bits(STATUS_WORD)),
    // Main actual value.
    Register::read(50_209, Shows::Measured(Measure::SignedFrequency, SHARE * 2.0)),
    // 15-00, 15-01, 15-02: hours and energy.
    Register::read(14_999, Shows::Zero),
    Register::read(15_000, Shows::Zero),
    Register::read(15_009, Shows::Zero),
    Register::read(15_010, Shows::Zero),
    Register::read(15_019, Shows::Zero),
    Register::read(15_020, Shows::Zero),
    // 16-00 in thousandths of a hertz, 16-01 in tenths of a percent.
    Register::read(16_009, Shows::Zero),
    Register::read(16_010, Shows::Measured(Measure::Setpoint, 1_000.0)),
    Register::read(16_019, Shows::Measured(Measure::Setpoint, 20.0)),
    // 16-10 power, 16-12 V, 16-13 tenths of a hertz, 16-14 hundredths of an ampere, 16-15 tenths of a percent, 16-18 %.
    Register::read(16_099, Shows::Zero),
    Register::read(16_119, Shows::Measured(Measure::Voltage, 1.0)),
    Register::read(16_129, Shows::Measured(Measure::Frequency, 10.0)),
    Register::read(16_139, Shows::Measured(Measure::Current, 100.0)),
    Register::read(16_149, Shows::Measured(Measure::Frequency, 20.0)),
    Register::read(16_179, Shows::Zero),
    // 16-30 V, 16-34 °C, 16-35 %.
    Register::read(16_299, Shows::Measured(Measure::BusVoltage, 1.0)),
    Register::read(16_339, Shows::Zero),
    Register::read(16_349, Shows::Zero),
    // 16-90, 16-92, 16-94: alarms, warnings, extended status.
    Register::read(16_899, Shows::Zero),
    Register::read(16_900, Shows::Zero),
    Register::read(16_919, Shows::Zero),
    Register::read(16_920, Shows::Zero),
    Register::read(16_939, Shows::Zero),
    Register::read(16_940, Shows::Zero),
];

/// Bits 0 control ready, 9 automatic mode and 10 within the frequency range are always on.
const STATUS_WORD: &[Bit] = &[
    Bit::Always(1 << 0 | 1 << 9 | 1 << 10),
    Bit::Ready(1),
    Bit::Ready(2),
    Bit::Fault(3),
    Bit::OverloadAlarm(7),
    Bit::Running(11),
    Bit::OverloadAlarm(15),
];
