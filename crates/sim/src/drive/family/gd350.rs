//! Goodrive350: the operation manual's chapter 9.4. What other Goodrives share with it stands here too.
//!
//! Parameter P*gg.ii* stands at *gg* × 100H + *ii* (section 9.4.5). Assumption: P14.04 and P14.05, which only manuals of
//! sister series print, do here what they do there.

use drivebus_rtu::huanyang::Protocol;

use super::{
    Bit, Family, Faults, Kind, MAX_WORDS, MEMORY_BIT, Measure, Memory, Range, Register, Roles, Scaled, Shows, Silence,
    Speed, USUAL_DELAY, USUAL_MAX_HZ,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::refusal::Refusal;

pub(super) const MAX_FREQUENCY: u16 = 0x0003;
const UPPER_FREQUENCY: u16 = 0x0004;
const KEYPAD_FREQUENCY: u16 = 0x000A;
const ACCELERATION: u16 = 0x000B;
const DECELERATION: u16 = 0x000C;
const JOG_FREQUENCY: u16 = 0x0806;
const JOG_ACCELERATION: u16 = 0x0807;
const JOG_DECELERATION: u16 = 0x0808;

pub(crate) fn gd350() -> Family {
    Family {
        name: "gd350".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x08, 0x10],
        max_words: MAX_WORDS,
        across_groups: true,
        exception,
        memory: Memory::BitMeansRam(MEMORY_BIT),
        identification: 0x01A0,
        command: Some(0x2000),
        commands: COMMANDS.to_vec(),
        registers: [CONTROL, STATE, MONITOR].concat(),
        parameters: Vec::new(),
        factory: FACTORY,
        // Assumption: no frequency can be set above P00.03, whether or not its row in the manual says so.
        control_word: None,
        elsewhere: Vec::new(),
        capped: &[UPPER_FREQUENCY, KEYPAD_FREQUENCY, JOG_FREQUENCY],
        roles: Roles {
            protocol: Protocol::Modbus,
            // Assumption: 0 in P00.02 is Modbus; the digit is not printed.
            obeys: vec![(0x0001, 2), (0x0002, 0)],
            channel: Some(0x0001),
            direction: None,
            direction_words: None,
            lock: None,
            // Assumption: any source but 8 means the frequency set at the keypad.
            speed_source: Some(vec![(0x0006, 8)]),
            speed: Some(Speed::hertz(0x2001)),
            keypad_frequency: Some(Scaled::hundredths(KEYPAD_FREQUENCY)),
            max_frequency: Some(Scaled::hundredths(MAX_FREQUENCY)),
            upper_frequency: Some(Scaled::hundredths(UPPER_FREQUENCY)),
            acceleration: Some(Scaled::tenths(ACCELERATION)),
            deceleration: Some(Scaled::tenths(DECELERATION)),
            jog_frequency: Some(Scaled::hundredths(JOG_FREQUENCY)),
            jog_acceleration: Some(Scaled::tenths(JOG_ACCELERATION)),
            jog_deceleration: Some(Scaled::tenths(JOG_DECELERATION)),
            // Assumption: 0 in P01.08 ramps down, 1 coasts; the digits are not printed.
            coasts_to_stop: Some((0x0108, 1)),
            password: Some(0x0700),
            fault_history: vec![0x071B, 0x071C, 0x071D, 0x071E, 0x071F, 0x0720],
            unit_address: Some(0x0E00),
            response_delay: Some(0x0E03),
            bus_timeout: Some(Scaled::tenths(0x0E04)),
            on_silence: Some(Silence::at(0x0E05)),
            handshake: None,
            runs_after: &[],
            other_words: None,
            reads_single_parameters: false,
            absent: None,
            max_written: None,
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(11), silent_bus: Some(18) },
    }
}

/// Section 9.4.7. Beyond 03H the meanings are not those of the Modbus specification.
///
/// Assumption: 06H (frame error) is never sent. One line of the manual promises it for a wrong CRC; a unit that answers
/// frames it cannot trust would answer its neighbours' too, so this one stays silent.
pub(super) fn exception(refusal: Refusal) -> u8 {
    match refusal {
        Refusal::Function => 0x01,
        Refusal::Address | Refusal::Unreadable => 0x02,
        Refusal::Structure => 0x03,
        Refusal::Value => 0x04,
        Refusal::Password => 0x05,
        Refusal::ReadOnly => 0x07,
        Refusal::Running => 0x08,
        Refusal::Locked => 0x09,
    }
}

/// 2000H.
pub(super) const COMMANDS: &[(u16, Command)] = &[
    (1, Command::Run(Direction::Forward)),
    (2, Command::Run(Direction::Reverse)),
    (3, Command::Jog(Direction::Forward)),
    (4, Command::Jog(Direction::Reverse)),
    (5, Command::Stop),
    (6, Command::Coast),
    (7, Command::ResetFault),
    (8, Command::JogStop),
];

/// Assumption: 2000H reads as the last command.
pub(super) const CONTROL: &[Register] = &[
    Register::set(0x2000, Range::Words(1, 8)),
    Register::set(0x2001, Range::UpTo(63_000, MAX_FREQUENCY)),
    Register::set(0x2002, Range::Words(0, 1_000)),
    Register::set(0x2003, Range::Words(0, 1_000)),
    Register::set(0x2004, Range::Signed(-3_000, 3_000)),
    Register::set(0x2005, Range::UpTo(63_000, MAX_FREQUENCY)),
    Register::set(0x2006, Range::UpTo(63_000, MAX_FREQUENCY)),
    Register::set(0x2007, Range::Words(0, 3_000)),
    Register::set(0x2008, Range::Words(0, 3_000)),
    Register::set(0x2009, Range::Words(0, 0x3F)),
    Register::set(0x200A, Range::Words(0, 0x3FF)),
    Register::set(0x200B, Range::Words(0, 0x0F)),
    Register::set(0x200C, Range::Words(0, 1_000)),
    Register::set(0x200D, Range::Signed(-1_000, 1_000)),
    Register::set(0x200E, Range::Signed(-1_000, 1_000)),
];

/// Code 5 (power off) and 6 (pre-exciting) do not come about.
pub(super) const STATE: &[Register] = &[
    Register::read(0x2100, Shows::state([1, 2, 3, 4])),
    Register::read(0x2101, Shows::bits(STATUS_WORD_2)),
    Register::read(0x2102, Shows::Fault),
    Register::read(0x2103, Shows::Identification),
];

/// Bits 11 and 10 say that the motor model is a V/F one.
const STATUS_WORD_2: &[Bit] =
    &[Bit::Ready(0), Bit::Motor(1, 0x2009), Bit::OverloadAlarm(4), Bit::Channel(5), Bit::Always(0b11 << 10)];

/// The block that CHF100A and CHV100 have too.
///
/// - Assumption: 3005H shows the shaft's speed also while the motor coasts.
/// - Assumption: power and torque are positive while the motor drives and negative while it brakes, whichever way it
///   turns.
/// - Assumption: relay 1 is on while the motor runs; the other outputs show 200BH.
pub(super) const MONITOR: &[Register] = &[
    Register::read(0x3000, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x3001, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x3002, Shows::Measured(Measure::BusVoltage, 10.0)),
    Register::read(0x3003, Shows::Measured(Measure::Voltage, 1.0)),
    Register::read(0x3004, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x3005, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(0x3006, Shows::Measured(Measure::Power, 1_000.0)),
    Register::read(0x3007, Shows::Measured(Measure::Torque, 1_000.0)),
    // P09.00 = 6: the PID setpoint comes from 2002H, otherwise from P09.01.
    Register::read(0x3008, Shows::WrittenIf { parameter: 0x0900, is: 6, register: 0x2002, otherwise: Some(0x0901) }),
    // P09.02 = 4: the PID feedback comes from 2003H.
    Register::read(0x3009, Shows::WrittenIf { parameter: 0x0902, is: 4, register: 0x2003, otherwise: None }),
    Register::read(0x300A, Shows::Inputs(Some(0x200A))),
    Register::read(0x300B, Shows::Outputs(0x200B)),
    Register::read(0x300C, Shows::Analog(0)),
    Register::read(0x300D, Shows::Analog(1)),
    Register::read(0x300E, Shows::Analog(2)),
    Register::read(0x300F, Shows::Analog(3)),
    // Pulse inputs, multi-step speed, length and count.
    Register::read(0x3010, Shows::Zero),
    Register::read(0x3011, Shows::Zero),
    Register::read(0x3012, Shows::Zero),
    Register::read(0x3013, Shows::Zero),
    Register::read(0x3014, Shows::Zero),
    Register::read(0x3015, Shows::WrittenTo(0x2004)),
    Register::read(0x3016, Shows::Identification),
    Register::read(0x5000, Shows::Fault),
];

/// Factory values that no manual at hand prints.
///
/// Assumption: all of them, and the lowest value (mostly 0) for whatever is not named here. P00.01, P00.02 and P00.06
/// are 0, so a drive fresh from the factory obeys its keypad; P00.11 and P00.12 depend on the model.
///
/// | parameter | value |
/// | --- | --- |
/// | P00.03, where it has none; P00.04, P00.10 | 50.00 Hz |
/// | P00.11, P00.12 | 10.0 s |
/// | P00.14 | 4.0 kHz |
/// | P02.01 | 4.0 kW |
/// | P05.26 | 10.00 V |
/// | P08.06 | 500, taken as 5.00 Hz |
/// | P08.07, P08.08 | 100, taken as 10.0 s |
/// | P14.01, P14.02, P14.03, where they have none | 19 200 bit/s, 8E1, 5 ms |
const FACTORY: &[(u16, u16)] = &[
    (MAX_FREQUENCY, 5_000),
    (UPPER_FREQUENCY, 5_000),
    (KEYPAD_FREQUENCY, 5_000),
    (ACCELERATION, 100),
    (DECELERATION, 100),
    (0x000E, 40),
    (0x0201, 40),
    (0x051A, 1_000),
    (JOG_FREQUENCY, 500),
    (JOG_ACCELERATION, 100),
    (JOG_DECELERATION, 100),
    (0x0E01, 4),
    (0x0E02, 1),
    (0x0E03, 5),
];
