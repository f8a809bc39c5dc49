//! Requests of functions that few units know: 0FH, 11H, 16H, 17H and 2BH/0EH.
//!
//! Source: *Modbus Application Protocol* V1.1b3, §6.11, §6.13, §6.16, §6.17, §6.21.

use super::{Request, check_range};
use crate::identification::IdentificationLevel;
use crate::pdu::function::{ENCAPSULATED, IDENTIFICATION, MASK_WRITE, READ_WRITE, REPORT_SERVER_ID, WRITE_COILS};
use crate::pdu::{MAX_PDU, MAX_READ, MAX_READ_WRITE, MAX_WRITE_BITS, put_words};
use crate::{Table, Words};

impl<'a> Request<'a> {
    /// The request of a function that few units know.
    #[cold]
    pub(super) fn seldom(pdu: &'a [u8]) -> Option<Self> {
        match *pdu {
            [WRITE_COILS, a1, a0, c1, c0, bytes, ref data @ ..] if usize::from(bytes) == data.len() => {
                let (address, count) = (u16::from_be_bytes([a1, a0]), u16::from_be_bytes([c1, c0]));
                let whole = Table::Coil.bytes(count.into()) == data.len();
                let words = Words::from_bits(data, count);
                check_range(address, count.into(), MAX_WRITE_BITS).ok().filter(|_| whole)?;
                // What fills the last byte up is told by no coil.
                let fills = data.last().is_some_and(|last| count % 8 > 0 && last >> (count % 8) > 0);
                if fills {
                    return None;
                }
                Some(Self::WriteCoils { address, words })
            }
            [REPORT_SERVER_ID] => Some(Self::ReportServerId),
            [MASK_WRITE, a1, a0, n1, n0, o1, o0] => Some(Self::mask_write(
                u16::from_be_bytes([a1, a0]),
                u16::from_be_bytes([n1, n0]),
                u16::from_be_bytes([o1, o0]),
            )),
            [READ_WRITE, a1, a0, c1, c0, w1, w0, n1, n0, bytes, ref data @ ..] if usize::from(bytes) == data.len() => {
                let (address, count) = (u16::from_be_bytes([a1, a0]), u16::from_be_bytes([c1, c0]));
                let (write_address, written) = (u16::from_be_bytes([w1, w0]), u16::from_be_bytes([n1, n0]));
                let words = Words::from_wire(data).filter(|words| words.len() == usize::from(written))?;
                check_range(address, count.into(), MAX_READ).ok()?;
                check_range(write_address, words.len(), MAX_READ_WRITE).ok()?;
                Some(Self::ReadWrite { address, count, write_address, words })
            }
            [ENCAPSULATED, IDENTIFICATION, level, object] => {
                Some(Self::read_identification(IdentificationLevel::of_code(level)?, object))
            }
            _ => None,
        }
    }

    /// Writes the PDU of a function that few units know into `target`, and returns its length.
    #[cold]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "at most 1968 coils, or 121 words: checked by the constructors"
    )]
    pub(super) fn put_seldom(&self, target: &mut [u8; MAX_PDU]) -> usize {
        match *self {
            Self::WriteCoils { address, words } => {
                let bytes = Table::Coil.bytes(words.len());
                put_words(target, WRITE_COILS, [address, words.len() as u16]);
                target[5] = bytes as u8;
                words.put_bits(&mut target[6..6 + bytes]);
                6 + bytes
            }
            Self::MaskWrite { address, and, or } => {
                put_words(target, MASK_WRITE, [address, and]);
                target[5..7].copy_from_slice(&or.to_be_bytes());
                7
            }
            Self::ReadWrite { address, count, write_address, words } => {
                put_words(target, READ_WRITE, [address, count]);
                target[5..7].copy_from_slice(&write_address.to_be_bytes());
                target[7..9].copy_from_slice(&(words.len() as u16).to_be_bytes());
                target[9] = 2 * words.len() as u8;
                let end = 10 + 2 * words.len();
                words.put(&mut target[10..end]);
                end
            }
            Self::ReadIdentification { level, object } => {
                target[..4].copy_from_slice(&[ENCAPSULATED, IDENTIFICATION, level.code(), object]);
                4
            }
            _ => {
                target[0] = self.function();
                1
            }
        }
    }
}
