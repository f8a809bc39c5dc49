//! What the specification says of the answers to functions that have no name here: how long they are, and what of the
//! request they repeat.
//!
//! | function | what the answer repeats | what follows |
//! | --- | --- | --- |
//! | 01H, 02H | | byte count: one bit for each asked, rounded up |
//! | 04H | | byte count: two for each word asked |
//! | 05H | address and value | |
//! | 07H | | one byte |
//! | 08H | sub-function; 00H, 01H, 03H, 0AH and 14H also the data | one word |
//! | 0BH | | two words |
//! | 0CH, 11H | | byte count, whatever it is |
//! | 0FH | address and quantity | |
//! | 14H | | byte count: two for each record asked, and its words |
//! | 15H, 16H | all; of 15H, the first six bytes and the length are compared | |
//! | 17H | | byte count: two for each word asked |
//! | 18H | | two byte counts, which must agree |
//! | 2BH | kind of interface; of 0EH also the kind of access | anything |
//!
//! Source: *Modbus Application Protocol* V1.1b3, §6.1 to §6.21. A request that is not as it says has a free answer.

use crate::answer::{AnswerError, Head, MOST};

/// Most bytes of data behind one byte count.
const MAX_DATA: u16 = 251;

/// What an answer must look like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shape {
    repeats: Head,
    rest: Rest,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rest {
    Free,
    /// The whole PDU has so many bytes.
    Length(u8),
    /// A byte count of so many, and those bytes.
    Bytes(u8),
    /// A byte count, and those bytes.
    Counted,
    /// A byte count and a word count, two bytes each, and those words.
    Queue,
}

impl Shape {
    /// Any answer will do.
    const FREE: Self = Self { repeats: Head::NONE, rest: Rest::Free };

    /// What the answer to the request `pdu` must look like.
    pub(super) fn of_answer_to(pdu: &[u8]) -> Self {
        let data = pdu.get(1..).unwrap_or_default();
        let free = Self::FREE;
        match *pdu {
            [0x01 | 0x02, _, _, c1, c0] => free.and_bytes(u16::from_be_bytes([c1, c0]).div_ceil(8)),
            [0x04, _, _, c1, c0] => free.and_bytes(u16::from_be_bytes([c1, c0]).saturating_mul(2)),
            [0x07] => free.and(Rest::Length(2)),
            [0x05, _, _, _, _] | [0x08, 0, 0x00 | 0x01 | 0x03 | 0x0A | 0x14, _, _] => Self::repeating(data, 4, 5),
            [0x08, _, _, _, _] => Self::repeating(data, 2, 5),
            [0x0B] => free.and(Rest::Length(5)),
            [0x0C | 0x11] => free.and(Rest::Counted),
            [0x0F, _, _, _, _, bytes, ref values @ ..] if usize::from(bytes) == values.len() => {
                Self::repeating(data, 4, 5)
            }
            [0x14, bytes, ref records @ ..] if usize::from(bytes) == records.len() => match records.as_chunks::<7>() {
                (records, []) => free.and_bytes(records.iter().fold(0, |sum: u16, &[_, _, _, _, _, l1, l0]| {
                    sum.saturating_add(2).saturating_add(u16::from_be_bytes([l1, l0]).saturating_mul(2))
                })),
                _ => free,
            },
            [0x15, bytes, ref records @ ..] if usize::from(bytes) == records.len() => {
                Self::repeating(data, MOST, pdu.len())
            }
            [0x16, _, _, _, _, _, _] => Self::repeating(data, MOST, 7),
            [0x17, _, _, c1, c0, _, _, _, _, bytes, ref values @ ..] if usize::from(bytes) == values.len() => {
                free.and_bytes(u16::from_be_bytes([c1, c0]).saturating_mul(2))
            }
            [0x18, _, _] => free.and(Rest::Queue),
            [0x2B, 0x0E, _, _] => Self { repeats: Head::of(data, 2), rest: Rest::Free },
            [0x2B, _, ..] => Self { repeats: Head::of(data, 1), rest: Rest::Free },
            _ => free,
        }
    }

    fn repeating(data: &[u8], count: usize, len: usize) -> Self {
        let rest = u8::try_from(len).map_or(Rest::Free, Rest::Length);
        Self { repeats: Head::of(data, count), rest }
    }

    fn and(self, rest: Rest) -> Self {
        Self { rest, ..self }
    }

    /// With a byte count of `bytes`; nothing is said of a request for none or for more than an answer can carry.
    fn and_bytes(self, bytes: u16) -> Self {
        match u8::try_from(bytes) {
            Ok(count) if (1..=MAX_DATA).contains(&bytes) => self.and(Rest::Bytes(count)),
            _ => self,
        }
    }

    /// Whether `pdu`, which has the right function code, can be the answer.
    ///
    /// # Errors
    ///
    /// [`AnswerError::Repeat`], [`AnswerError::Bytes`], [`AnswerError::Length`]: it cannot.
    pub(super) fn check(&self, pdu: &[u8]) -> Result<(), AnswerError> {
        let wrong = Err(AnswerError::Length { len: pdu.len() });
        let data = pdu.get(1..).unwrap_or_default();
        let came = Head::of(data, self.repeats.len());
        if came.len() < self.repeats.len() {
            return wrong;
        }
        if came != self.repeats {
            return Err(AnswerError::Repeat { asked: self.repeats, came });
        }
        match (self.rest, data) {
            (Rest::Free, _) => Ok(()),
            (Rest::Length(len), _) if usize::from(len) == pdu.len() => Ok(()),
            (Rest::Bytes(asked), &[came, ref data @ ..]) if usize::from(came) == data.len() => {
                if asked == came {
                    Ok(())
                } else {
                    Err(AnswerError::Bytes { asked, came })
                }
            }
            (Rest::Counted, &[count, ref data @ ..]) if usize::from(count) == data.len() => Ok(()),
            (Rest::Queue, &[b1, b0, w1, w0, ref words @ ..])
                if usize::from(u16::from_be_bytes([b1, b0])) == 2 + words.len()
                    && 2 * usize::from(u16::from_be_bytes([w1, w0])) == words.len() =>
            {
                Ok(())
            }
            _ => wrong,
        }
    }
}
