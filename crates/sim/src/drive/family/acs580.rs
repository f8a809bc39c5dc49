//! ABB ACS580: the ABB drives profile over the embedded fieldbus. Control word at register 400001, REF1 at 400002, status word at 400004, ACT1
//! at 400005 (ACH580 E-Clipse manual, p. 152; ACS380 firmware manual, p. 386), each one less on the wire.
//!
//! Bits: ACS580 firmware manual (manualarchiveguide 4817086), p. 437, and (manualshive 2311), p. 439. The state machine: ACS180 manual, p. 366:
//! x1xx xxxx x110 makes it ready to switch on, x111 1111 operates, bit 0 is OFF1, bit 1 OFF2, bit 7 resets. 20000 counts are 46.02
//! (ACS580 firmware manual 4817085, p. 399). Parameters: 100 × group + index for 16 bits, 20000 + 200 × group + 2 × index for 32, less one.
//!
//! - Assumption: a run is obeyed only behind 0476H; any other word takes it back. While it runs, 0476H inhibits operation: it coasts.
//! - Assumption: other words are out of range. 58.25 acts at once, and takes values between 0 and 5 that mean nothing.
//! - With 58.25 = 5, the DCU profile, bit 0 stops and bit 1 starts (ACS580 firmware manual 4817086, p. 413). Assumption: bit 0 wins, with
//!   bit 9 it coasts, bit 4 resets when it rises (ACS355 manual 4817904, p. 320), and the status word stays what it is.
//! - Assumption: it obeys the bus while 20.01 is 14, and takes REF1 from it while 28.11 is 8. 46.02 counts tenths of a hertz, 50.0 from
//!   the factory, which is the highest frequency too. A negative reference reverses.
//! - Assumption: the status word shows operation enabled until the motor stands. It tells no direction; ACT1 does.
//! - Assumption: measured values have no sign, and half of one may be read alone.
//! - Assumption: 400100, where a read of the error codes ends, is refused, as is what is not here, with 02H; what is out of range with 03H. The
//!   loop-back (08H) is printed for the ACQ580 (p. 388). An overload is fault 9; no register at hand shows its number. A silent bus is not
//!   watched.

use super::{
    Deciding, Family, Faults, Handshake, Kind, MAX_WORDS, Measure, Memory, OtherWords, Parameter, Range, Register,
    Roles, Shows, Speed, SpeedScale, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

/// 20.01, 28.11, 46.02, 58.01, 58.25 and 58.26.
const COMMAND_SOURCE: u16 = 2_000;
const FREQUENCY_SOURCE: u16 = 2_810;
const FREQUENCY_SCALING: u16 = 4_601;
const PROTOCOL: u16 = 5_800;
const CONTROL_PROFILE: u16 = 5_824;
const REFERENCE_TYPE: u16 = 5_825;

pub(crate) fn acs580() -> Family {
    Family {
        name: "acs580".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x08, 0x10],
        max_words: MAX_WORDS,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0),
        commands: COMMANDS.to_vec(),
        control_word: None,
        elsewhere: Vec::new(),
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 14)],
            other_words: Some(OtherWords { set_by: (CONTROL_PROFILE, 5), decode: by_dcu }),
            speed_source: Some(vec![(COMMAND_SOURCE, 14), (FREQUENCY_SOURCE, 8)]),
            speed: Some(Speed {
                register: 1,
                unit: Some(Deciding::Words(FREQUENCY_SCALING, vec![(600, SpeedScale::share(20_000.0, 60.0))])),
                usual: SpeedScale::share(20_000.0, 50.0),
            }),
            handshake: Some(Handshake { idle: 0x0270, words: vec![(0x0476, 0x0231)] }),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(9), silent_bus: None },
    }
}

/// The DCU profile.
fn by_dcu(before: u16, word: u16) -> Command {
    let is_set = |bit: u16| word & 1 << bit != 0;
    match (is_set(0), is_set(1)) {
        (true, _) if is_set(9) => Command::Coast,
        (true, _) => Command::Stop,
        (false, true) => Command::Run(Direction::Forward),
        (false, false) if is_set(4) && before & 1 << 4 == 0 => Command::ResetFault,
        (false, false) => Command::Nothing,
    }
}

const COMMANDS: &[(u16, Command)] = &[
    (0x0476, Command::Coast),
    (0x047C, Command::Coast),
    (0x047D, Command::Coast),
    (0x047E, Command::Stop),
    (0x047F, Command::Run(Direction::Forward)),
    (0x04F6, Command::ResetFault),
];

const REGISTERS: &[Register] = &[
    Register::set(0, Range::Words(0, u16::MAX)),
    Register::set(1, Range::Speed),
    Register::set(2, Range::Words(0, u16::MAX)),
    Register::read(3, Shows::State([0x0237, 0x0237, 0x0270, 0x0238], std::borrow::Cow::Borrowed(&[]))),
    Register::read(4, Shows::Measured(Measure::SignedFrequency, 400.0)),
    Register::read(5, Shows::Zero),
    // 01.01, 01.03 and 01.06 by 16 bits; what they count there is not at hand.
    Register::read(100, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(102, Shows::Zero),
    Register::read(105, Shows::Measured(Measure::Frequency, 400.0)),
    // 01.01, 01.06, 01.07, 01.10, 01.11, 01.13 and 01.14 by 32, the low word first.
    Register::read(20_201, Shows::Measured(Measure::Speed, 100.0)),
    Register::read(20_202, Shows::Zero),
    Register::read(20_211, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(20_212, Shows::Zero),
    Register::read(20_213, Shows::Measured(Measure::Current, 100.0)),
    Register::read(20_214, Shows::Zero),
    Register::read(20_219, Shows::Zero),
    Register::read(20_220, Shows::Zero),
    Register::read(20_221, Shows::Measured(Measure::BusVoltage, 100.0)),
    Register::read(20_222, Shows::Zero),
    Register::read(20_225, Shows::Measured(Measure::Voltage, 100.0)),
    Register::read(20_226, Shows::Zero),
    Register::read(20_227, Shows::Zero),
    Register::read(20_228, Shows::Zero),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(COMMAND_SOURCE, 0, 22, 2).at_standstill(),
    Parameter::new(FREQUENCY_SOURCE, 0, 20, 1).at_standstill(),
    Parameter::new(FREQUENCY_SCALING, 1, 10_000, 500),
    Parameter::new(PROTOCOL, 0, 1, 1),
    Parameter::new(CONTROL_PROFILE, 0, 5, 0),
    Parameter::new(REFERENCE_TYPE, 0, 5, 0),
];
