//! Fuji FRENIC: S06 (0706H) takes commands, S05 (0705H) the frequency, M14 (080EH) says what the motor does, M09 (0809H) how fast it turns.
//!
//! M14, S05 and M09: FRENIC-Ace manual (easymanua.ls fuji-electric frenic-ace-series), p. 563. The rule of addresses, 50 words, and the zeros:
//! FRENIC-HVAC/AQUA RS-485 manual 24A7-E-0021 (manualslib 1367373), pp. 45 and 46. S14 and M16: satoshi083046/SHIROI.
//!
//! - Assumption: bit 0 of S06 alone runs forward, bit 1 alone in reverse, anything else stops along the ramp. It takes any word.
//! - Assumption: FWD and REV of M14 stay until the motor stands; then INT is on. NUV and RL are always on, and no other bit but ALM.
//! - Assumption: every number from 0 to 99 of a group of 24A7-E-0082 is answered, with 0 where nothing of it is simulated; other groups and
//!   numbers are refused with 02H, as a write to what is not used. A read across groups is refused here, where the manual has zeros.
//! - Assumption: it obeys the bus, and takes its speed from it, while H30 is 8, which it is from the beginning.
//! - Assumption: 1 at S14 resets an alarm, each time, and 0 does nothing. M16 keeps the number.
//! - Ramps are fixed. An overload does not trip, for its number is not at hand, nor does a silent bus.

use super::{
    Bit, Bounds, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Shows, Speed, SpeedScale,
    SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const COMMAND: u32 = 0x0706;
const RESET: u32 = 0x070E;
const LATEST_ALARM: u16 = 0x0810;
const LINK: u16 = 0x041E;

/// F, E, C, P, H, A, o, S, M, r, J, y, W, X, Z, b and d.
const GROUPS: [u32; 17] =
    [0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x0A, 0x0D, 0x0E, 0x0F, 0x10, 0x11, 0x12, 0x13];

pub(crate) fn frenic() -> Family {
    Family {
        name: "frenic".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x08, 0x10],
        max_words: 50,
        across_groups: false,
        exception: by_the_specification,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(COMMAND),
        commands: Vec::new(),
        control_word: Some(decoded),
        elsewhere: vec![(RESET, 1, Command::ResetFault), (RESET, 0, Command::Nothing)],
        registers: unused().chain(REGISTERS.iter().cloned()).collect(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        capped: &[],
        roles: Roles {
            obeys: vec![(LINK, 8)],
            speed: Some(Speed { register: 0x0705, unit: None, usual: HUNDREDTHS }),
            fault_history: vec![LATEST_ALARM],
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: None, silent_bus: None },
    }
}

/// Below zero it turns the other way.
const HUNDREDTHS: SpeedScale =
    SpeedScale { unit: SpeedUnit::Hertz, counts: 100.0, bounds: Bounds { signed: true, ..Bounds::NONE } };

/// The codes that it answers with 0.
fn unused() -> impl Iterator<Item = Register> {
    let is_parameter = |address: &u32| PARAMETERS.iter().any(|known| u32::from(known.address) == *address);
    let codes = GROUPS.into_iter().flat_map(|group| (0..=99).map(move |number| group << 8 | number));
    codes.filter(move |address| !is_parameter(address)).map(|address| Register::read(address, Shows::Zero))
}

fn decoded(_before: u16, word: u16) -> Command {
    match word & 0b11 {
        0b01 => Command::Run(Direction::Forward),
        0b10 => Command::Run(Direction::Reverse),
        _ => Command::Stop,
    }
}

/// FWD is bit 0, REV 1, INT 3, ALM 11.
const STATUS: [u16; 4] = [1, 1 << 1, 1 << 3, 1 << 11 | 1 << 3];
/// NUV and RL.
const BESIDE: &[Bit] = &[Bit::Always(1 << 5 | 1 << 12)];

const REGISTERS: &[Register] = &[
    Register::set(0x0705, Range::Speed),
    Register::set(COMMAND, Range::Words(0, u16::MAX)),
    Register::set(RESET, Range::Words(0, 1)),
    Register::read(0x0809, Shows::Measured(Measure::SignedFrequency, 100.0)),
    Register::read(0x080E, Shows::State(STATUS, std::borrow::Cow::Borrowed(BESIDE))),
];

/// F00, F01, F02, F08, C01 and H30.
const PARAMETERS: &[Parameter] = &[
    Parameter::new(0x0000, 0, 3, 0),
    Parameter::new(0x0001, 0, 10, 0).at_standstill(),
    Parameter::new(0x0002, 0, 3, 2).at_standstill(),
    Parameter::new(0x0008, 0, u16::MAX, 600),
    Parameter::new(0x0201, 0, u16::MAX, 0),
    Parameter::new(LINK, 0, 8, 8),
    Parameter::shown(LATEST_ALARM),
];
