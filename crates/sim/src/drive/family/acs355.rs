//! ABB ACS355: the ABB drives profile over the embedded fieldbus. Control word at 0, REF1 at 1, status word at 3 (manual, p. 313), and
//! the state machine of page 319: 0476H makes it ready to switch on, 047FH runs, OFF1 (047EH) stops along the ramp, OFF2 (047DH)
//! coasts, a reset (04F6H) leaves the switching on inhibited.
//!
//! - Assumption: a run is obeyed only behind 0476H; any other word takes it back. While it runs, 0476H inhibits operation: it coasts.
//! - Assumption: other words are out of range.
//! - Assumption: it obeys the bus while 1001 is 10, and takes REF1 from it while 1103 is 8. 20000 counts are parameter 1105, in
//!   tenths of a hertz, 50.0 Hz from the factory, which is the highest frequency too. A negative reference reverses.
//! - Assumption: the status word shows operation enabled until the motor stands. It tells no direction.
//! - Assumption: an overload is fault 9, which 0401 shows from then on.
//! - Assumption: it refuses what is not here with 02H, and what is out of range with 03H. A silent bus is not watched.

use super::{
    Deciding, Family, Faults, Handshake, Kind, MAX_WORDS, Measure, Memory, Parameter, Range, Register, Roles, Shows,
    Speed, SpeedScale, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const COMMAND_SOURCE: u16 = 1000;
const SETPOINT_SOURCE: u16 = 1102;
/// 0401 keeps its number when the fault is reset.
const LAST_FAULT: u16 = 400;
const REFERENCE: u16 = 1104;
/// 1607: 1 stores all that was set, and goes back to 0.
const SAVE: u32 = 1606;
const PROFILE: u16 = 5304;

pub(crate) fn acs355() -> Family {
    Family {
        name: "acs355".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x10],
        max_words: MAX_WORDS,
        across_groups: true,
        exception: by_the_specification,
        memory: Memory::RamUntil(SAVE, 1),
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
            obeys: vec![(COMMAND_SOURCE, 10)],
            speed_source: Some(vec![(COMMAND_SOURCE, 10), (SETPOINT_SOURCE, 8)]),
            speed: Some(Speed {
                register: 1,
                unit: Some(Deciding::Words(REFERENCE, vec![(600, hertz(60.0))])),
                usual: hertz(50.0),
            }),
            fault_history: vec![LAST_FAULT],
            handshake: Some(Handshake { idle: 0x0270, words: vec![(0x0476, 0x0231)] }),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(9), silent_bus: None },
    }
}

/// 20000 counts are the reference.
const fn hertz(reference: f64) -> SpeedScale {
    SpeedScale::share(20_000.0, reference)
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
    Register::read(101, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(102, Shows::Measured(Measure::Frequency, 10.0)),
    Register::read(103, Shows::Measured(Measure::Current, 10.0)),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(COMMAND_SOURCE, 0, 20, 2).at_standstill(),
    Parameter::new(SETPOINT_SOURCE, 0, 20, 1).at_standstill(),
    Parameter::new(1606, 0, 1, 0),
    Parameter::shown(LAST_FAULT),
    Parameter::new(REFERENCE, 0, 5_999, 500),
    Parameter::new(PROFILE, 0, 2, 2),
];
