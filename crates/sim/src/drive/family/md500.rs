//! Inovance MD500: an INVT drive's codes at 2000H, of which 5 coasts and 6 stops along the ramp, and a setpoint in shares at 1000H.
//!
//! Commands, state and fault: MD500 manual (easymanua.ls inovance md500), pp. 142 and 143; MD500 user manual (easymanua.ls inovance
//! md500t75g), pp. 225 and 226; MD500-Plus manual, p. 702. 7000H, F00CH and F00EH: bdring/FluidNC, MollomG70.cpp. 1001H to 1005H:
//! LinuxCNC, svd-ps_vfd.c. Every other address is refused with 02H.
//!
//! - Assumption: 1000H to 2FFFH that are written cannot be read, and 00xxH, where a write reaches RAM only, neither.
//! - Assumption: F0-02 = 2 obeys the bus; F0-03 = 9 takes the frequency from it, and else it is F0-08. All are 0 from the factory, but
//!   F0-10, 50.00 Hz, and F0-22, two decimals.
//! - Assumption: F0-17 and F0-18 are the ramps, in tenths of a second from 0 to F0-10. 8, by which sisters end a jog, is out of range.
//! - Assumption: one word in a read. 03H for a word out of range, 02H for what can only be read or only be
//!   written, 04H for what is not done now.
//! - Assumption: in fault 3000H is 3. An overload trips 11, a bus that is silent for longer than FD-04 trips 16.

use super::{
    Bounds, Deciding, Family, Faults, Kind, Measure, Memory, Parameter, Range, Register, Roles, Scaled, Shows, Speed,
    SpeedScale, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::by_the_specification;

const COMMAND_SOURCE: u16 = 0xF002;
const FREQUENCY_SOURCE: u16 = 0xF003;
const KEYPAD_FREQUENCY: u16 = 0xF008;
const MAX_FREQUENCY: u16 = 0xF00A;
const UPPER_FREQUENCY: u16 = 0xF00C;
const LOWER_FREQUENCY: u16 = 0xF00E;
const ACCELERATION: u16 = 0xF011;
const DECELERATION: u16 = 0xF012;
const DECIMALS: u16 = 0xF016;
/// What 1000H is for all of F0-10.
const WHOLE: f64 = 10_000.0;

pub(crate) fn md500() -> Family {
    let shares = Bounds { signed: true, ..Bounds::new(-10_000, 10_000) };
    Family {
        name: "md500".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06],
        max_words: 1,
        across_groups: false,
        exception: by_the_specification,
        memory: Memory::BitsMeanEeprom(0xF000),
        identification: 0,
        command: Some(0x2000),
        commands: COMMANDS.to_vec(),
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        factory: &[],
        elsewhere: Vec::new(),
        control_word: None,
        capped: &[],
        roles: Roles {
            obeys: vec![(COMMAND_SOURCE, 2)],
            speed_source: Some(vec![(COMMAND_SOURCE, 2), (FREQUENCY_SOURCE, 9)]),
            speed: Some(Speed {
                register: 0x1000,
                unit: Some(Deciding::Share(Scaled::hundredths(MAX_FREQUENCY), WHOLE)),
                usual: SpeedScale { bounds: shares, ..SpeedScale::share(WHOLE, USUAL_MAX_HZ) },
            }),
            keypad_frequency: Some(Scaled::hundredths(KEYPAD_FREQUENCY)),
            max_frequency: Some(Scaled::hundredths(MAX_FREQUENCY)),
            upper_frequency: Some(Scaled::hundredths(UPPER_FREQUENCY)),
            acceleration: Some(Scaled::tenths(ACCELERATION)),
            deceleration: Some(Scaled::tenths(DECELERATION)),
            response_delay: Some(0xFD03),
            bus_timeout: Some(Scaled::tenths(0xFD04)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(11), silent_bus: Some(16) },
    }
}

/// 2000H, p. 226.
const COMMANDS: &[(u16, Command)] = &[
    (1, Command::Run(Direction::Forward)),
    (2, Command::Run(Direction::Reverse)),
    (3, Command::Jog(Direction::Forward)),
    (4, Command::Jog(Direction::Reverse)),
    (5, Command::Coast),
    (6, Command::Stop),
    (7, Command::ResetFault),
];

const REGISTERS: &[Register] = &[
    Register::write_only(0x1000, Range::Speed),
    Register::read(0x1001, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x1002, Shows::Measured(Measure::BusVoltage, 10.0)),
    Register::read(0x1003, Shows::Measured(Measure::Voltage, 1.0)),
    Register::read(0x1004, Shows::Measured(Measure::Current, 100.0)),
    Register::read(0x1005, Shows::Measured(Measure::Speed, 1.0)),
    Register::write_only(0x2000, Range::Words(1, 7)),
    Register::write_only(0x2001, Range::Words(0, 0x3FF)),
    Register::read(0x3000, Shows::state([1, 2, 3, 3])),
    Register::read(0x7000, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x7001, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x7002, Shows::Measured(Measure::BusVoltage, 10.0)),
    Register::read(0x7003, Shows::Measured(Measure::Voltage, 1.0)),
    Register::read(0x7004, Shows::Measured(Measure::Current, 100.0)),
    Register::read(0x8000, Shows::Fault),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(COMMAND_SOURCE, 0, 2, 0),
    Parameter::new(FREQUENCY_SOURCE, 0, 9, 0),
    Parameter::new(KEYPAD_FREQUENCY, 0, 50_000, 5_000),
    Parameter::new(MAX_FREQUENCY, 500, 50_000, 5_000).at_standstill(),
    Parameter::new(UPPER_FREQUENCY, 0, 50_000, 5_000).not_above(MAX_FREQUENCY),
    Parameter::new(LOWER_FREQUENCY, 0, 50_000, 0).not_above(UPPER_FREQUENCY),
    Parameter::new(ACCELERATION, 0, 65_000, 100),
    Parameter::new(DECELERATION, 0, 65_000, 100),
    Parameter::new(DECIMALS, 1, 2, 2).at_standstill(),
];
