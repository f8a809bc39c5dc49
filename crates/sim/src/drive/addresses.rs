//! The addresses at which this drive behaves. All others only store what they are given.
//!
//! Source: GD350 operation manual, section 9.4.5; parameters P*gg.ii* stand at *gg* × 100H + *ii*.

/// Bit 15 of a parameter's address: RAM only, and write only.
pub(crate) const RAM_BIT: u16 = 0x8000;

pub(crate) const CONTROL_COMMAND: u16 = 0x2000;
pub(crate) const SET_FREQUENCY: u16 = 0x2001;
pub(crate) const PID_REFERENCE: u16 = 0x2002;
pub(crate) const PID_FEEDBACK: u16 = 0x2003;
pub(crate) const TORQUE_SETTING: u16 = 0x2004;
pub(crate) const FORWARD_CEILING: u16 = 0x2005;
pub(crate) const REVERSE_CEILING: u16 = 0x2006;
pub(crate) const SPECIAL_CONTROL: u16 = 0x2009;
pub(crate) const VIRTUAL_INPUT: u16 = 0x200A;
pub(crate) const VIRTUAL_OUTPUT: u16 = 0x200B;
/// The last of the words that the bus may write.
pub(crate) const CONTROL_BLOCK_END: u16 = 0x200E;

pub(crate) const STATUS_WORD_1: u16 = 0x2100;
pub(crate) const STATUS_WORD_2: u16 = 0x2101;
pub(crate) const FAULT_CODE: u16 = 0x2102;
pub(crate) const IDENTIFICATION: u16 = 0x2103;
pub(crate) const MONITOR: u16 = 0x3000;
pub(crate) const FAULT_CODE_COMPAT: u16 = 0x5000;

pub(crate) const RUN_CHANNEL: u16 = 0x0001;
pub(crate) const RUN_BUS: u16 = 0x0002;
pub(crate) const MAX_FREQUENCY: u16 = 0x0003;
pub(crate) const UPPER_FREQUENCY: u16 = 0x0004;
pub(crate) const FREQUENCY_SOURCE: u16 = 0x0006;
pub(crate) const KEYPAD_FREQUENCY: u16 = 0x000A;
pub(crate) const ACCELERATION_TIME: u16 = 0x000B;
pub(crate) const DECELERATION_TIME: u16 = 0x000C;
pub(crate) const CARRIER_FREQUENCY: u16 = 0x000E;
pub(crate) const STOP_MODE: u16 = 0x0108;
pub(crate) const MOTOR_POWER: u16 = 0x0201;
pub(crate) const AI1_UPPER: u16 = 0x051A;
pub(crate) const PASSWORD: u16 = 0x0700;
/// P07.27 to P07.32: the latest fault first.
pub(crate) const FAULT_HISTORY: [u16; 6] = [0x071B, 0x071C, 0x071D, 0x071E, 0x071F, 0x0720];
pub(crate) const JOG_FREQUENCY: u16 = 0x0806;
pub(crate) const JOG_ACCELERATION: u16 = 0x0807;
pub(crate) const JOG_DECELERATION: u16 = 0x0808;
pub(crate) const PID_SOURCE: u16 = 0x0900;
pub(crate) const PID_PRESET: u16 = 0x0901;
pub(crate) const PID_FEEDBACK_SOURCE: u16 = 0x0902;
pub(crate) const UNIT_ADDRESS: u16 = 0x0E00;
pub(crate) const RESPONSE_DELAY: u16 = 0x0E03;
pub(crate) const BUS_TIMEOUT: u16 = 0x0E04;
pub(crate) const BUS_TIMEOUT_ACTION: u16 = 0x0E05;
