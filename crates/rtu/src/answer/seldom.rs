//! Answers of functions that few units know: 0FH, 11H, 16H, 17H and 2BH/0EH.
//!
//! Source: *Modbus Application Protocol* V1.1b3, §6.11, §6.13, §6.16, §6.17, §6.21.

use super::Answer;
use crate::Words;
use crate::identification::{HEAD, INDIVIDUAL, IdentificationLevel, IdentificationPage, MORE, OBJECT_HEAD};
use crate::pdu::function::{ENCAPSULATED, IDENTIFICATION, MASK_WRITE, READ_WRITE, REPORT_SERVER_ID, WRITE_COILS};
use crate::pdu::{ExceptionCode, MAX_PDU, MAX_READ, put_words};

impl<'a> Answer<'a> {
    /// The answer of a function that few units know, if it is as the specification has it.
    #[cold]
    pub(super) fn seldom(pdu: &'a [u8]) -> Option<Self> {
        match *pdu {
            [WRITE_COILS, a1, a0, c1, c0] => {
                Some(Self::WriteCoils { address: u16::from_be_bytes([a1, a0]), count: u16::from_be_bytes([c1, c0]) })
            }
            [REPORT_SERVER_ID, bytes, ref data @ ..] if usize::from(bytes) == data.len() => Self::server_id(data).ok(),
            [MASK_WRITE, a1, a0, n1, n0, o1, o0] => Some(Self::MaskWrite {
                address: u16::from_be_bytes([a1, a0]),
                and: u16::from_be_bytes([n1, n0]),
                or: u16::from_be_bytes([o1, o0]),
            }),
            [READ_WRITE, bytes, ref data @ ..] if usize::from(bytes) == data.len() => {
                let words = Words::from_wire(data)?;
                (1..=MAX_READ.into()).contains(&words.len()).then_some(Self::ReadWrite { words })
            }
            [ENCAPSULATED, ..] => IdentificationPage::parse(pdu).ok().map(|page| Self::Identification { page }),
            _ => None,
        }
    }

    /// Writes the PDU of a function that few units know into `target`, and returns its length.
    #[cold]
    #[expect(clippy::cast_possible_truncation, reason = "at most 251 bytes: checked by the constructors")]
    pub(super) fn put_seldom(&self, target: &mut [u8; MAX_PDU]) -> usize {
        match *self {
            Self::WriteCoils { address, count } => put_words(target, WRITE_COILS, [address, count]),
            Self::MaskWrite { address, and, or } => {
                put_words(target, MASK_WRITE, [address, and]);
                target[5..7].copy_from_slice(&or.to_be_bytes());
                7
            }
            Self::ReadWrite { words } => {
                let bytes = 2 * words.len();
                target[..2].copy_from_slice(&[READ_WRITE, bytes as u8]);
                words.put(&mut target[2..2 + bytes]);
                2 + bytes
            }
            Self::ServerId { data } => {
                target[..2].copy_from_slice(&[REPORT_SERVER_ID, data.len() as u8]);
                target[2..2 + data.len()].copy_from_slice(data);
                2 + data.len()
            }
            Self::Identification { page } => {
                let pdu = page.pdu();
                target[..pdu.len()].copy_from_slice(pdu);
                pdu.len()
            }
            _ => 0,
        }
    }
}

impl IdentificationPage<'_> {
    /// What a unit that has `objects`, in the order of their numbers, answers to the question for `level` from `object` on: as
    /// many of them as fit into `buffer`, or the exception 02H where one that it has not is asked for alone. None may have more
    /// than 244 bytes.
    pub fn answer<'b>(
        objects: &[(u8, &[u8])],
        (level, object): (IdentificationLevel, u8),
        buffer: &'b mut [u8; MAX_PDU],
    ) -> Answer<'b> {
        let refused = Answer::exception(ENCAPSULATED, ExceptionCode::ILLEGAL_ADDRESS);
        let has = |number| objects.iter().any(|&(own, _)| own == number);
        if level == IdentificationLevel::One && !has(object) {
            return refused;
        }
        let last = if level == IdentificationLevel::One { object } else { level.last() };
        let first = if has(object) && object <= last { object } else { 0 };
        let conformity = match objects.last() {
            Some((0x80.., _)) => IdentificationLevel::Extended,
            Some((0x03.., _)) => IdentificationLevel::Regular,
            _ => IdentificationLevel::Basic,
        };
        let head = [ENCAPSULATED, IDENTIFICATION, level.code(), conformity.code() | INDIVIDUAL, 0, 0, 0];
        buffer[..HEAD].copy_from_slice(&head);
        let mut end = HEAD;
        for &(number, value) in objects.iter().filter(|(number, _)| (first..=last).contains(number)) {
            let place = buffer.get_mut(end..end + OBJECT_HEAD + value.len());
            let (Some(place), Ok(len)) = (place, u8::try_from(value.len())) else {
                // One that no answer can carry is none that the unit has.
                if end > HEAD {
                    (buffer[4], buffer[5]) = (MORE, number);
                }
                break;
            };
            place[..OBJECT_HEAD].copy_from_slice(&[number, len]);
            place[OBJECT_HEAD..].copy_from_slice(value);
            buffer[6] += 1;
            end += OBJECT_HEAD + value.len();
        }
        match IdentificationPage::parse(&buffer[..end]) {
            Ok(page) => Answer::Identification { page },
            Err(_) => refused,
        }
    }
}
