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

use crate::answer::{Answer, AnswerError, Head, MOST};
use crate::crc::crc16;
use crate::pdu::function::EXCEPTION_BIT;
use crate::pdu::{ExceptionCode, MAX_PDU};
use crate::request::Request;
use crate::table::Table;

/// For how long the line is silent before a request, at least.
pub const SILENCE: Duration = Duration::from_millis(50);

const READ_PARAMETER: u8 = 0x01;
const WRITE_PARAMETER: u8 = 0x02;
const CONTROL: u8 = 0x03;
const READ_STATUS: u8 = 0x04;
const SET_FREQUENCY: u8 = 0x05;

/// The most words of one read of Modbus.
///
/// Source: *Modbus Application Protocol* V1.1b3, §6.3.
const MOST_WORDS: u16 = 125;

/// What stands around the data of a frame: unit, function, count and CRC.
const AROUND: usize = 5;

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

/// The request that `pdu` is, of Modbus or, where it is none of that, of this protocol.
///
/// For what was written down as bytes, such as what halts a unit: a control and a frequency have no form of Modbus. A read of
/// a parameter, and a write, may have one.
pub fn request_of(pdu: &[u8]) -> Option<Request<'_>> {
    match Request::parse(pdu) {
        Ok(request) => Some(request),
        Err(_) => Huanyang::parse(pdu).map(Request::Huanyang),
    }
}

impl Huanyang {
    /// What says the same as `request`; `None` where nothing of this protocol does.
    pub fn of(request: &Request<'_>) -> Option<Self> {
        match *request {
            Request::Huanyang(asked) => Some(asked),
            Request::Read { table: Table::Holding, address, count: 1 } => match address.to_be_bytes() {
                [READ_PARAMETER, number] => Some(Self::ReadParameter { number }),
                [READ_STATUS, number] => Some(Self::ReadStatus { number }),
                _ => None,
            },
            Request::WriteSingle { address, value } => match address.to_be_bytes() {
                [READ_PARAMETER, number] => Some(Self::WriteParameter { number, value }),
                [CONTROL, 0] => u8::try_from(value).ok().map(|bits| Self::Control { bits }),
                [SET_FREQUENCY, 0] => Some(Self::SetFrequency { value }),
                _ => None,
            },
            _ => None,
        }
    }

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
            Self::ReadParameter { number } => [number, 0, 0],
            Self::WriteParameter { number, value } => {
                let [high, low] = value.to_be_bytes();
                [number, high, low]
            }
            Self::Control { bits } => [bits, 0, 0],
            Self::ReadStatus { number } => [number, 0, 0],
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

    /// `pdu`, of this function or its refusal, as the answer.
    ///
    /// A refusal has no code: 02H is told of one to a read, 03H of one to a write.
    pub(crate) fn judge(self, pdu: &[u8]) -> Result<Answer<'_>, AnswerError> {
        if pdu.first().is_some_and(|function| function & EXCEPTION_BIT != 0) {
            let code = if self.is_write() { ExceptionCode::ILLEGAL_VALUE } else { ExceptionCode::ILLEGAL_ADDRESS };
            return match pdu {
                [_, _] | [_, 1, _] => Ok(Answer::exception(self.function(), code)),
                _ => Err(AnswerError::Length { len: pdu.len() }),
            };
        }
        let is_right = match (self, pdu) {
            (Self::ReadParameter { number }, [_, 2, came, _] | [_, 3, came, _, _])
            | (Self::ReadStatus { number }, [_, 3, came, _, _]) => *came == number,
            (Self::WriteParameter { number, value }, [_, 3, came, high, low]) => {
                *came == number && value == u16::from_be_bytes([*high, *low])
            }
            (Self::WriteParameter { number, value }, [_, 2, came, low]) => *came == number && value == u16::from(*low),
            (Self::Control { .. }, [_, 1, _]) => true,
            (Self::SetFrequency { value }, [_, 2, high, low]) => value == u16::from_be_bytes([*high, *low]),
            _ => return Err(AnswerError::Length { len: pdu.len() }),
        };
        if is_right {
            return Ok(Answer::Custom { pdu });
        }
        let mut asked = [0; MAX_PDU];
        let len = self.put(&mut asked);
        Err(AnswerError::Repeat { asked: Head::of(&asked[1..len], MOST), came: Head::of(&pdu[1..], MOST) })
    }

    /// What was asked by `request` is answered by `answer` to this: the same as a unit of Modbus would have said it. The word
    /// that was read goes to `word`.
    pub fn as_answered<'a>(self, answer: Answer<'a>, request: &Request<'a>, word: &'a mut [u16; 1]) -> Answer<'a> {
        let Answer::Custom { pdu } = answer else { return answer };
        match *pdu {
            [_, 2, _, low] if !self.is_write() => word[0] = low.into(),
            [_, 3, _, high, low] if !self.is_write() => word[0] = u16::from_be_bytes([high, low]),
            _ => return Answer::confirming(request).unwrap_or(answer),
        }
        Answer::read(word).unwrap_or(answer)
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::frame::{Adu, Frame};
    use crate::framer::Framer;
    use crate::slave::{Slave, SlaveEvent};
    use crate::{Instant, SerialFormat, UnitAddress};

    extern crate std;
    use std::vec::Vec;

    /// `bytes` with their CRC behind them.
    fn framed(bytes: &[u8]) -> Vec<u8> {
        [bytes, &crc16(bytes).to_le_bytes()].concat()
    }

    /// hy_modbus.c: functions, lengths and data. Modbus: a read of one register, its answer, a single write.
    #[test]
    fn a_frame_that_modbus_has_is_not_surely_of_this_protocol() {
        for (bytes, form, sure) in [
            (&[1, 3, 1, 0x08][..], true, true),
            (&[1, 4, 3, 0, 0, 0], true, true),
            (&[1, 4, 3, 0, 0, 1], true, false),
            (&[1, 4, 3, 0, 0, 125], true, false),
            (&[1, 4, 3, 0, 0, 126], true, true),
            (&[1, 4, 1, 0], true, true),
            (&[1, 5, 2, 0x13, 0x88], true, true),
            (&[1, 6, 2, 0, 0], true, true),
            (&[1, 6, 3, 0, 0, 0], true, false),
            (&[1, 1, 3, 0, 0, 0], true, false),
            (&[1, 2, 2, 0, 0], true, false),
            (&[1, 3, 2, 0, 0], false, false),
            (&[1, 7, 2, 0, 0], false, false),
            (&[1, 3, 0, 0, 0, 1], false, false),
        ] {
            let mut frame = framed(bytes);
            assert_eq!((has_form(&frame), is_sure(&frame)), (form, sure), "{bytes:02X?}");
            frame[0] ^= 1;
            assert!(!has_form(&frame), "{bytes:02X?}");
        }
        assert!(!has_form(&[]) && !is_sure(&[1, 3, 1]));
    }

    /// Frames as others print them: unit 4 of a Huanyang HY01D523B (unininu.tistory.com, 01. Function Read); FluidNC,
    /// HuanyangProtocol.cpp (start, stop, 25 Hz); Dema D5M manual, p. 72 (set frequency, 30 Hz).
    const PRINTED: [(u8, Huanyang, &[u8], &[u8], Option<u16>); 7] = [
        (
            4,
            Huanyang::ReadParameter { number: 1 },
            &[0x04, 0x01, 0x03, 0x01, 0x00, 0x00, 0x6D, 0xDB],
            &[0x04, 0x01, 0x02, 0x01, 0x02, 0xF5, 0xAD],
            Some(2),
        ),
        (
            4,
            Huanyang::ReadParameter { number: 2 },
            &[0x04, 0x01, 0x03, 0x02, 0x00, 0x00, 0x9D, 0xDB],
            &[0x04, 0x01, 0x02, 0x02, 0x02, 0xF5, 0x5D],
            Some(2),
        ),
        (
            1,
            Huanyang::Control { bits: 0x01 },
            &[0x01, 0x03, 0x01, 0x01, 0x31, 0x88],
            &[0x01, 0x03, 0x01, 0x09, 0x30, 0x4E],
            None,
        ),
        (
            1,
            Huanyang::Control { bits: 0x11 },
            &[0x01, 0x03, 0x01, 0x11, 0x30, 0x44],
            &[0x01, 0x03, 0x01, 0x09, 0x30, 0x4E],
            None,
        ),
        (
            1,
            Huanyang::Control { bits: 0x08 },
            &[0x01, 0x03, 0x01, 0x08, 0xF1, 0x8E],
            &[0x01, 0x03, 0x01, 0x09, 0x30, 0x4E],
            None,
        ),
        (
            1,
            Huanyang::SetFrequency { value: 2500 },
            &[0x01, 0x05, 0x02, 0x09, 0xC4, 0xBF, 0x0F],
            &[0x01, 0x05, 0x02, 0x09, 0xC4, 0xBF, 0x0F],
            None,
        ),
        (
            1,
            Huanyang::ReadStatus { number: 0 },
            &[0x01, 0x04, 0x01, 0x00, 0x41, 0x89],
            &[0x01, 0x04, 0x03, 0x00, 0x0B, 0xB8, 0xF7, 0x0C],
            Some(3000),
        ),
    ];

    #[test]
    fn frames_are_as_they_are_printed() {
        for (unit, asked, request, answer, word) in PRINTED {
            let address = UnitAddress::new(unit).unwrap();
            let request_of = Request::Huanyang(asked);
            assert_eq!(Adu::request(address.into(), &request_of).as_bytes(), request, "{asked:?}");
            assert_eq!(request_of.adu_len(), request.len());
            assert_eq!(Huanyang::parse(Frame::parse(request).unwrap().pdu()), Some(asked));

            let mut framer = Framer::new(SerialFormat::DEFAULT.t35());
            framer.expect(address, request_of.expected());
            for (at, byte) in answer.iter().enumerate() {
                assert!(framer.poll(Instant::ZERO).is_none(), "{asked:?}: {at}");
                framer.receive(Instant::ZERO, &[*byte]);
            }
            let frame = framer.poll(Instant::ZERO).unwrap().unwrap();
            assert_eq!(frame.as_bytes(), answer, "at its last byte");
            let told = request_of.judge(frame.pdu()).unwrap();
            let mut room = [0];
            let write = Request::write(0x0300, 8);
            match asked.as_answered(told, &write, &mut room) {
                Answer::Read { words, .. } => assert_eq!(words.get(0), word),
                other => assert_eq!((Some(other), word), (Answer::confirming(&write), None)),
            }
            // The same of another unit, and with another number, is none.
            assert!(request_of.expected().judge_frame(UnitAddress::new(9).unwrap(), &frame).is_err());
        }
    }

    #[test]
    fn an_answer_to_something_else_is_none() {
        for (asked, pdu) in [
            (Huanyang::ReadParameter { number: 5 }, &[1, 3, 6, 0x9C, 0x40][..]),
            (Huanyang::ReadParameter { number: 5 }, &[1, 4, 5, 0, 0, 0]),
            (Huanyang::ReadStatus { number: 1 }, &[4, 3, 0, 0x9C, 0x40]),
            (Huanyang::ReadStatus { number: 1 }, &[4, 2, 1, 0]),
            (Huanyang::WriteParameter { number: 5, value: 40_000 }, &[2, 3, 5, 0x9C, 0x41]),
            (Huanyang::SetFrequency { value: 2500 }, &[5, 2, 9, 0xC5]),
            (Huanyang::Control { bits: 8 }, &[3, 2, 0, 8]),
            (Huanyang::Control { bits: 8 }, &[0x83, 2, 0, 8]),
        ] {
            assert!(Request::Huanyang(asked).judge(pdu).is_err(), "{asked:?}");
        }
        // A refusal as the maker has it, and as one of Modbus has it.
        for pdu in [&[0x81, 1, 5][..], &[0x81, 2]] {
            let told = Request::Huanyang(Huanyang::ReadParameter { number: 5 }).judge(pdu);
            assert_eq!(told, Ok(Answer::exception(1, ExceptionCode::ILLEGAL_ADDRESS)));
        }
        let told = Request::Huanyang(Huanyang::WriteParameter { number: 5, value: 0 }).judge(&[0x82, 1, 5]);
        assert_eq!(told, Ok(Answer::exception(2, ExceptionCode::ILLEGAL_VALUE)));
    }

    #[test]
    fn each_register_stands_for_one_thing_and_nothing_else_is_said() {
        let read = |address| Huanyang::of(&Request::read(address, 1).unwrap());
        let write = |address, value| Huanyang::of(&Request::write(address, value));
        assert_eq!(read(0x0105), Some(Huanyang::ReadParameter { number: 5 }));
        assert_eq!(read(0x0401), Some(Huanyang::ReadStatus { number: 1 }));
        assert_eq!(write(0x0105, 7), Some(Huanyang::WriteParameter { number: 5, value: 7 }));
        assert_eq!(write(0x0300, 0x11), Some(Huanyang::Control { bits: 0x11 }));
        assert_eq!(write(0x0500, 2500), Some(Huanyang::SetFrequency { value: 2500 }));
        for address in [0x0000, 0x0200, 0x0300, 0x0500, 0x2000, 0x8105] {
            assert_eq!(read(address), None, "{address:04X}");
        }
        for (address, value) in [(0x0300, 0x100), (0x0301, 1), (0x0401, 1), (0x0501, 1), (0x2000, 5)] {
            assert_eq!(write(address, value), None, "{address:04X}");
        }
        assert_eq!(Huanyang::of(&Request::read(0x0105, 2).unwrap()), None);
        assert_eq!(Huanyang::of(&Request::read_of(Table::Input, 0x0401, 1).unwrap()), None);
        assert_eq!(Huanyang::of(&Request::echo(7)), None);
        assert_eq!(Huanyang::of(&Request::write_many(0x0500, &[2500]).unwrap()), None);
    }

    /// Each request of a master is what a unit hears, and each answer of a unit what the master takes.
    #[test]
    fn a_master_and_a_unit_understand_each_other() {
        let unit = UnitAddress::MIN;
        for word in [0_u16, 1, 0x0A, 0xFF, 0x100, 0x9C40, 0xFFFF] {
            let [low, _] = word.to_le_bytes();
            for asked in [
                Huanyang::ReadParameter { number: low },
                Huanyang::WriteParameter { number: low, value: word },
                Huanyang::Control { bits: low },
                Huanyang::ReadStatus { number: low },
                Huanyang::SetFrequency { value: word },
            ] {
                let request = Request::Huanyang(asked);
                let mut slave = Slave::new(unit, &SerialFormat::DEFAULT).speaking(Protocol::Huanyang);
                slave.receive(Instant::ZERO, Adu::request(unit.into(), &request).as_bytes());
                let silent = slave.deadline().unwrap_or(Instant::ZERO);
                assert_eq!(slave.poll(silent), Some(SlaveEvent::Request { request, broadcast: false }));
                let mut pdu = [0; MAX_PDU];
                let len = asked.answer(word, word <= 0xFF, 0x09, &mut pdu);
                assert_eq!(request.judge(&pdu[..len]), Ok(Answer::Custom { pdu: &pdu[..len] }));
                assert!(matches!(request.judge(&asked.refusal()), Ok(Answer::Exception { .. })));
            }
        }
        // A read of Modbus is nothing to such a unit.
        let mut slave = Slave::new(unit, &SerialFormat::DEFAULT).speaking(Protocol::Huanyang);
        slave.receive(Instant::ZERO, &[0x01, 0x03, 0x21, 0x00, 0x00, 0x01, 0x8E, 0x36]);
        assert!(matches!(slave.poll(Instant::ZERO), Some(SlaveEvent::Foreign(_))));
    }
}
