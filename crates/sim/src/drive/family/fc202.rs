//! Danfoss VLT AQUA Drive FC 202: the words of an FC 51, a current of two words, and 16-22.
//!
//! Registers 50000, 50010, 50200 and 50210, one less on the wire: MG.20.N5.22 (easymanua.ls danfoss vlt-aqua 225022), p. 203. Status word:
//! p. 214. 3-03 at 3029, two words, thousandths, the high word first: p. 209. 4000H is 100 % of reference and main actual value:
//! manualslib 1224442, p. 216. Control word: VLT HVAC Drive design guide (easymanua.ls danfoss vlt-hvac 232307), p. 141.
//!
//! - Assumption: it obeys the bus as it comes from the factory, with references of 0 to 50.000 Hz (3-03) and a ramp of 10.00 s; the
//!   main actual value and 16-02 are shares of 50 Hz.
//! - Assumption: what else is assumed of an FC 51, and its steps of 16-13 and 16-30. 16-12 counts tenths of a volt, 16-22 reads as 0.
//! - Assumption: it refuses with 01H to 04H, as its sister series FC 300 prints, and not with 00H, 11H and 40H to 43H, as three editions do.

use super::fc51::{CONTROL_WORD, REFERENCE, SHARE, control_word};
use super::{
    Bit, Bounds, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed,
    SpeedScale, SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::map::Access;
use crate::drive::refusal::by_the_specification;

/// The low words of 3-03 and 3-42.
const HIGHEST_REFERENCE: u16 = 3_030;
const RAMP_DOWN: u16 = 3_420;
/// Most words of one request. Assumption.
const MAX_WORDS: u16 = 63;

pub(crate) fn fc202() -> Family {
    Family {
        name: "fc202".into(),
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

const REGISTERS: &[Register] = &[
    Register::set(CONTROL_WORD, Range::Words(0, u16::MAX)),
    Register { address: REFERENCE, access: Access::Always, range: Range::Speed, shows: Shows::Written },
    Register::read(50_199, Shows::bits(STATUS_WORD)),
    Register::read(50_209, Shows::Measured(Measure::SignedFrequency, SHARE * 2.0)),
    // 16-01 in thousandths of a hertz, 16-02 in tenths of a percent.
    Register::read(16_009, Shows::Zero),
    Register::read(16_010, Shows::Measured(Measure::Setpoint, 1_000.0)),
    Register::read(16_019, Shows::Measured(Measure::Setpoint, 20.0)),
    // 16-12 V, 16-13 tenths of a hertz, 16-14 hundredths of an ampere in two words, 16-22 %, 16-30 V.
    Register::read(16_119, Shows::Measured(Measure::Voltage, 10.0)),
    Register::read(16_129, Shows::Measured(Measure::Frequency, 10.0)),
    Register::read(16_139, Shows::Zero),
    Register::read(16_140, Shows::Measured(Measure::Current, 100.0)),
    Register::read(16_219, Shows::Zero),
    Register::read(16_299, Shows::Measured(Measure::BusVoltage, 1.0)),
    // 16-90 and 16-92: alarms and warnings.
    Register::read(16_899, Shows::Zero),
    Register::read(16_900, Shows::Zero),
    Register::read(16_919, Shows::Zero),
    Register::read(16_920, Shows::Zero),
];

/// p. 214. Bits 0 control ready, 9 bus control and 10 within the frequency limits are always on.
const STATUS_WORD: &[Bit] = &[
    Bit::Always(1 << 0 | 1 << 9 | 1 << 10),
    Bit::Ready(1),
    Bit::Ready(2),
    Bit::Fault(3),
    Bit::OverloadAlarm(7),
    Bit::Running(11),
    Bit::OverloadAlarm(15),
];
