//! Huanyang's own protocol, on the same wires and with the same CRC as Modbus, and none: its requests, its answers, and what
//! its frames look like.
//!
//! A frame is the unit, a function (01 to 06), how many bytes of data follow, those, and the CRC.
//!
//! | function | data of a request | of its answer | what |
//! | --- | --- | --- | --- |
//! | 01 | number, two bytes | number, and one byte or two | reads parameter PDnnn |
//! | 02 | number, two bytes | the same, or with one byte | writes it |
//! | 03 | one byte of bits | one byte of other bits: what the drive does | control: 01H runs forward, 11H in reverse, 08H stops |
//! | 04 | number; from some masters also two bytes | number, two bytes | reads a status |
//! | 05 | two bytes | the same | sets the frequency, in 0.01 Hz |
//! | 06 | | | reserved |
//!
//! A refusal has the function with its highest bit set, and one byte of data: the number that was asked for.
//!
//! A unit wants the line silent for [`SILENCE`] before a request and after its answer. What changes nothing in a unit of
//! Modbus and what this protocol reads is told apart by nobody but who knows which of both the unit speaks.
//!
//! Sources: LinuxCNC, `src/hal/user_comps/huanyang-vfd/hy_comm.c` (functions, lengths and data); FluidNC,
//! `Spindles/VFD/HuanyangProtocol.cpp`; Dema D5M manual, pp. 68 to 72, a drive with the same protocol (silence, bits of
//! the control, the status read with one byte); *Huanyang VFD modbus protocol*, notes after the maker's manual (refusals).

use core::fmt;
use core::time::Duration;

use crate::crc::crc16;
use crate::pdu::MAX_PDU;
use crate::pdu::function::EXCEPTION_BIT;

/// For how long the line is silent before a request, at least.
pub const SILENCE: Duration = Duration::from_millis(50);

pub(crate) const READ_PARAMETER: u8 = 0x01;
const WRITE_PARAMETER: u8 = 0x02;
pub(crate) const CONTROL: u8 = 0x03;
pub(crate) const READ_STATUS: u8 = 0x04;
pub(crate) const SET_FREQUENCY: u8 = 0x05;

/// The most words of one read of Modbus.
///
/// Source: *Modbus Application Protocol* V1.1b3, §6.3.
const MOST_WORDS: u16 = 125;

/// What stands around the data of a frame: unit, function, count and CRC.
pub const AROUND: usize = 5;

/// Which protocol a unit speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Protocol {
    /// That of the specification.
    #[default]
    Modbus,
    /// Huanyang's own.
    Huanyang,
}

impl Protocol {
    /// The word for it in profiles and programs.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Modbus => "modbus",
            Self::Huanyang => "huanyang",
        }
    }
}

/// What a unit is asked in this protocol.
///
/// So that programs need no second way to say it, each has a holding register that stands for it: the function above, the
/// number below.
///
/// | register | read | written |
/// | --- | --- | --- |
/// | 0100H to 01FFH | parameter PD000 to PD255 | that parameter |
/// | 0300H | | the control, 0 to FFH |
/// | 0400H to 04FFH | status 0 to 255 | |
/// | 0500H | | the frequency |
///
/// ```
/// use drivebus_rtu::{Adu, Request, UnitAddress, huanyang::Huanyang};
///
/// let stop = Huanyang::of(&Request::write(0x0300, 0x08)).ok_or("not to be said in this protocol")?;
/// assert_eq!(stop, Huanyang::Control { bits: 0x08 });
/// let frame = Adu::request(UnitAddress::MIN.into(), &Request::Huanyang(stop));
/// assert_eq!(frame.as_bytes(), [0x01, 0x03, 0x01, 0x08, 0xF1, 0x8E]);
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Huanyang {
    /// 01: the parameter of that number.
    ReadParameter {
        /// nnn of PDnnn.
        number: u8,
    },
    /// 02: what the parameter of that number is to be.
    WriteParameter {
        /// nnn of PDnnn.
        number: u8,
        /// Counts of it.
        value: u16,
    },
    /// 03: what the motor is to do.
    Control {
        /// 01H run, 02H forward, 04H reverse, 08H stop, 10H turn round, 20H to 80H jogs.
        bits: u8,
    },
    /// 04: the status of that number.
    ReadStatus {
        /// 0 set frequency, 1 output frequency, 2 current, 3 speed, 4 DC voltage, 5 AC voltage, 7 temperature.
        number: u8,
    },
    /// 05: the frequency to run at.
    SetFrequency {
        /// In 0.01 Hz.
        value: u16,
    },
}

impl Huanyang {
    /// The request that `pdu` is, as a unit takes it; `None` where it is none.
    pub fn parse(pdu: &[u8]) -> Option<Self> {
        match *pdu {
            [READ_PARAMETER, 3, number, _, _] | [READ_PARAMETER, 1, number] => Some(Self::ReadParameter { number }),
            [WRITE_PARAMETER, 3, number, high, low] => {
                Some(Self::WriteParameter { number, value: u16::from_be_bytes([high, low]) })
            }
            [WRITE_PARAMETER, 2, number, low] => Some(Self::WriteParameter { number, value: low.into() }),
            [CONTROL, 1, bits] => Some(Self::Control { bits }),
            [READ_STATUS, 3, number, _, _] | [READ_STATUS, 1, number] => Some(Self::ReadStatus { number }),
            [SET_FREQUENCY, 2, high, low] => Some(Self::SetFrequency { value: u16::from_be_bytes([high, low]) }),
            _ => None,
        }
    }

    /// The function code.
    pub const fn function(self) -> u8 {
        match self {
            Self::ReadParameter { .. } => READ_PARAMETER,
            Self::WriteParameter { .. } => WRITE_PARAMETER,
            Self::Control { .. } => CONTROL,
            Self::ReadStatus { .. } => READ_STATUS,
            Self::SetFrequency { .. } => SET_FREQUENCY,
        }
    }

    /// Whether it may change something in the unit.
    pub const fn is_write(self) -> bool {
        matches!(self, Self::WriteParameter { .. } | Self::Control { .. } | Self::SetFrequency { .. })
    }

    /// How many bytes its PDU has.
    pub(crate) const fn pdu_len(self) -> usize {
        match self {
            Self::ReadParameter { .. } | Self::WriteParameter { .. } => 5,
            Self::Control { .. } | Self::ReadStatus { .. } => 3,
            Self::SetFrequency { .. } => 4,
        }
    }

    /// Writes the PDU into `target`, and returns its length.
    pub(crate) fn put(self, target: &mut [u8; MAX_PDU]) -> usize {
        let data = match self {
            Self::ReadParameter { number } | Self::ReadStatus { number } => [number, 0, 0],
            Self::WriteParameter { number, value } => {
                let [high, low] = value.to_be_bytes();
                [number, high, low]
            }
            Self::Control { bits } => [bits, 0, 0],
            Self::SetFrequency { value } => {
                let [high, low] = value.to_be_bytes();
                [high, low, 0]
            }
        };
        let len = self.pdu_len();
        #[expect(clippy::cast_possible_truncation, reason = "3 at most")]
        let count = (len - 2) as u8;
        target[..2].copy_from_slice(&[self.function(), count]);
        target[2..5].copy_from_slice(&data);
        len
    }

    /// Whether an answer to this could be taken for one to `other`, refusals aside.
    pub(crate) fn could_pass_for(self, other: Self) -> bool {
        match (self, other) {
            (Self::ReadParameter { number }, Self::ReadParameter { number: other })
            | (Self::ReadStatus { number }, Self::ReadStatus { number: other }) => number == other,
            (Self::Control { .. }, Self::Control { .. }) => true,
            _ => self == other,
        }
    }

    /// Whether the right answer may be the request once more.
    pub(crate) const fn may_repeat_request(self) -> bool {
        !matches!(self, Self::ReadStatus { .. })
    }

    /// The PDU by which a unit answers: a read of a parameter by `word`, in one byte where it `fits_a_byte`, a control by the bits of
    /// `state`. Returns its length.
    pub fn answer(self, word: u16, fits_a_byte: bool, state: u8, target: &mut [u8; MAX_PDU]) -> usize {
        let [high, low] = word.to_be_bytes();
        match self {
            Self::ReadParameter { number } if fits_a_byte => {
                target[..4].copy_from_slice(&[READ_PARAMETER, 2, number, low]);
                4
            }
            Self::ReadParameter { number } | Self::ReadStatus { number } => {
                target[..5].copy_from_slice(&[self.function(), 3, number, high, low]);
                5
            }
            Self::Control { .. } => {
                target[..3].copy_from_slice(&[CONTROL, 1, state]);
                3
            }
            Self::WriteParameter { .. } | Self::SetFrequency { .. } => self.put(target),
        }
    }

    /// The PDU by which a unit refuses it.
    pub const fn refusal(self) -> [u8; 3] {
        let number = match self {
            Self::ReadParameter { number } | Self::WriteParameter { number, .. } | Self::ReadStatus { number } => {
                number
            }
            Self::Control { bits } => bits,
            Self::SetFrequency { .. } => 0,
        };
        [self.function() | EXCEPTION_BIT, 1, number]
    }
}

impl fmt::Display for Huanyang {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::ReadParameter { number } => write!(f, "read PD{number:03}"),
            Self::WriteParameter { number, value } => write!(f, "write {value} ({value:04X}H) to PD{number:03}"),
            Self::Control { bits } => write!(f, "control {bits:02X}H"),
            Self::ReadStatus { number } => write!(f, "read status {number}"),
            Self::SetFrequency { value } => write!(f, "set the frequency to {value} ({value:04X}H)"),
        }
    }
}

/// Whether `data` is a whole frame of this protocol; some of those are frames of Modbus, too.
pub fn has_form(data: &[u8]) -> bool {
    let [_, function, count, ..] = *data else { return false };
    let may_be = match function {
        1 | 2 => matches!(count, 2 | 3),
        3 => count == 1,
        4 => matches!(count, 1 | 3),
        5 => count == 2,
        6 => matches!(count, 1..=3),
        _ => false,
    };
    may_be
        && data.len() == AROUND + usize::from(count)
        && data.split_last_chunk().is_some_and(|(body, crc)| crc16(body) == u16::from_le_bytes(*crc))
}

/// Whether `data` is a frame of this protocol, and none that Modbus has, whoever sent it.
pub fn is_sure(data: &[u8]) -> bool {
    let [_, function, count, _, rest @ ..] = data else { return false };
    has_form(data)
        && match (function, count) {
            // One byte is no word, and no read is as short. A single write has eight bytes.
            (3 | 5, _) | (4, 1) => true,
            // No words have three bytes; as a read it asks for none, or for more than there may be.
            (4, _) => rest.first_chunk().is_some_and(|word| !(1..=MOST_WORDS).contains(&u16::from_be_bytes(*word))),
            // What reads or writes a parameter may be bits of Modbus.
            _ => *function == 6 && *count != 3,
        }
}
