//! What a master asks: the PDUs of requests, built and parsed.
//!
//! Source: *Modbus Application Protocol* V1.1b3, §6.1 to §6.6, §6.8, §6.11 to §6.13, §6.16, §6.17, §6.21.

mod huanyang;
mod seldom;

use core::fmt;

use crate::huanyang::Huanyang;
use crate::identification::IdentificationLevel;
use crate::pdu::function::{
    DIAGNOSTICS, ENCAPSULATED, EXCEPTION_BIT, MASK_WRITE, READ_COILS, READ_INPUT, READ_WRITE, REPORT_SERVER_ID,
    WRITE_COIL, WRITE_COILS, WRITE_MULTIPLE, WRITE_SINGLE,
};
use crate::pdu::{
    AROUND_PDU, AnswerLength, MAX_PDU, MAX_READ, MAX_READ_WRITE, MAX_WRITE, MAX_WRITE_BITS, coil_of, coil_word,
    put_words, reads,
};
use crate::{Table, Words};

/// A request. Made only by the checked constructors and by [`parse`](Self::parse), so that none is out of range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Request<'a> {
    /// 01H, 02H, 03H or 04H: read `count` words, or bits, of `table` from `address`.
    #[non_exhaustive]
    Read {
        /// Where.
        table: Table,
        /// The first.
        address: u16,
        /// 1..=125 words, 1..=2000 bits.
        count: u16,
    },
    /// 05H: write one coil.
    #[non_exhaustive]
    WriteCoil {
        /// Coil.
        address: u16,
        /// What to write.
        on: bool,
    },
    /// 06H: write one word.
    #[non_exhaustive]
    WriteSingle {
        /// Register.
        address: u16,
        /// What to write.
        value: u16,
    },
    /// 08H, sub-function 0000: the unit returns `data` as it is.
    #[non_exhaustive]
    Echo {
        /// Any word.
        data: u16,
    },
    /// 10H: write several words from `address` on.
    #[non_exhaustive]
    WriteMultiple {
        /// First register.
        address: u16,
        /// 1..=123 words.
        words: Words<'a>,
    },
    /// 0FH: write several coils from `address` on.
    #[non_exhaustive]
    WriteCoils {
        /// First coil.
        address: u16,
        /// 1..=1968 words of 0 or 1.
        words: Words<'a>,
    },
    /// 11H: the unit tells what it is, and whether it runs, in bytes of its own.
    ReportServerId,
    /// 16H: the register gets its own bits where `and` has ones, and those of `or` elsewhere.
    #[non_exhaustive]
    MaskWrite {
        /// Register.
        address: u16,
        /// Bits that stay.
        and: u16,
        /// Bits that are set where `and` has zeros.
        or: u16,
    },
    /// 17H: write several words, then read several.
    #[non_exhaustive]
    ReadWrite {
        /// First register that is read.
        address: u16,
        /// 1..=125 words are read.
        count: u16,
        /// First register that is written, before the others are read.
        write_address: u16,
        /// 1..=121 words.
        words: Words<'a>,
    },
    /// 2BH/0EH: who made the unit, and what it is.
    #[non_exhaustive]
    ReadIdentification {
        /// How much of it.
        level: IdentificationLevel,
        /// From which object on, or which one.
        object: u8,
    },
    /// What a unit is asked that speaks Huanyang's own protocol, and no Modbus.
    Huanyang(Huanyang),
    /// Any other PDU.
    #[non_exhaustive]
    Custom {
        /// Function code and data.
        pdu: &'a [u8],
        /// How long the answer will be.
        answer: AnswerLength,
    },
}

impl<'a> Request<'a> {
    /// 03H: `count` words (1..=125) from `address`.
    ///
    /// # Errors
    ///
    /// [`RequestError`]: the count is out of range, or the last register would lie beyond 0xFFFF.
    #[inline]
    pub const fn read(address: u16, count: u16) -> Result<Self, RequestError> {
        match check_range(address, count as usize, MAX_READ) {
            Ok(_) => Ok(Self::Read { table: Table::Holding, address, count }),
            Err(error) => Err(error),
        }
    }

    /// 01H, 02H, 03H or 04H: `count` words (1..=125) or bits (1..=2000) of `table` from `address`.
    ///
    /// # Errors
    ///
    /// [`RequestError`]: the count is out of range, or the last one would lie beyond 0xFFFF.
    #[inline]
    pub const fn read_of(table: Table, address: u16, count: u16) -> Result<Self, RequestError> {
        match check_range(address, count as usize, table.max_read()) {
            Ok(_) => Ok(Self::Read { table, address, count }),
            Err(error) => Err(error),
        }
    }

    /// 05H: the coil at `address` is to be `on`.
    pub const fn write_coil(address: u16, on: bool) -> Self {
        Self::WriteCoil { address, on }
    }

    /// 06H: `value` to `address`.
    pub const fn write(address: u16, value: u16) -> Self {
        Self::WriteSingle { address, value }
    }

    /// 08H/0000: the unit is asked to return `data`.
    pub const fn echo(data: u16) -> Self {
        Self::Echo { data }
    }

    /// 10H: `words` (1..=123) from `address` on.
    ///
    /// # Errors
    ///
    /// [`RequestError`]: the count is out of range, or the last register would lie beyond 0xFFFF.
    pub const fn write_many(address: u16, words: &'a [u16]) -> Result<Self, RequestError> {
        match check_range(address, words.len(), MAX_WRITE) {
            Ok(_) => Ok(Self::WriteMultiple { address, words: Words::new(words) }),
            Err(error) => Err(error),
        }
    }

    /// 0FH: `words` (1..=1968 of 0, off, or anything else, on) to the coils from `address` on.
    ///
    /// # Errors
    ///
    /// [`RequestError`]: the count is out of range, or the last coil would lie beyond 0xFFFF.
    pub const fn write_coils(address: u16, words: &'a [u16]) -> Result<Self, RequestError> {
        match check_range(address, words.len(), MAX_WRITE_BITS) {
            Ok(_) => Ok(Self::WriteCoils { address, words: Words::new(words) }),
            Err(error) => Err(error),
        }
    }

    /// 11H: what the unit is, in bytes of its own.
    pub const fn report_server_id() -> Self {
        Self::ReportServerId
    }

    /// 16H: the register at `address` keeps its bits where `and` has ones, and gets those of `or` elsewhere.
    pub const fn mask_write(address: u16, and: u16, or: u16) -> Self {
        Self::MaskWrite { address, and, or }
    }

    /// 17H: `words` (1..=121) to `write_address` and on, then `count` words (1..=125) from `address`.
    ///
    /// # Errors
    ///
    /// [`RequestError`]: a count is out of range, or the last register would lie beyond 0xFFFF.
    pub const fn read_write(
        address: u16,
        count: u16,
        write_address: u16,
        words: &'a [u16],
    ) -> Result<Self, RequestError> {
        match (check_range(address, count as usize, MAX_READ), check_range(write_address, words.len(), MAX_READ_WRITE))
        {
            (Ok(_), Ok(_)) => Ok(Self::ReadWrite { address, count, write_address, words: Words::new(words) }),
            (Err(error), _) | (_, Err(error)) => Err(error),
        }
    }

    /// 2BH/0EH: the identification of that `level` from `object` on; of [`One`](IdentificationLevel::One) that object alone.
    pub const fn read_identification(level: IdentificationLevel, object: u8) -> Self {
        Self::ReadIdentification { level, object }
    }

    /// Any `pdu`: function code 1..=127 and 0..=252 bytes of data.
    ///
    /// # Errors
    ///
    /// [`RequestError`]: `pdu` is empty or too long, its function code cannot be asked for, or the length of the
    /// answer is impossible.
    pub const fn custom(pdu: &'a [u8], answer: AnswerLength) -> Result<Self, RequestError> {
        if pdu.is_empty() || pdu.len() > MAX_PDU {
            return Err(RequestError::PduLength { len: pdu.len() });
        }
        if pdu[0] == 0 || pdu[0] & EXCEPTION_BIT != 0 {
            return Err(RequestError::Function { function: pdu[0] });
        }
        match answer {
            AnswerLength::Bytes(len) if len == 0 || len as usize > MAX_PDU => Err(RequestError::AnswerLength { len }),
            _ => Ok(Self::Custom { pdu, answer }),
        }
    }

    /// The request that `pdu` is.
    ///
    /// A diagnostic other than the echo, and a function code without a name here, come back as
    /// [`Custom`](Self::Custom). So does a 0FH, 11H, 16H, 17H or 2BH that is not as the specification has it: few units know
    /// those functions, and others may mean something of their own by them.
    ///
    /// # Errors
    ///
    /// [`RequestError`]: the length does not fit the function, or a count is out of range. A unit answers exception
    /// 03H to it.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, RequestError> {
        match *pdu {
            [function @ READ_COILS..=READ_INPUT, a1, a0, c1, c0] => {
                let table = Table::of_function(function).unwrap_or_default();
                Self::read_of(table, u16::from_be_bytes([a1, a0]), u16::from_be_bytes([c1, c0]))
            }
            [WRITE_COIL, a1, a0, v1, v0] => {
                let value = u16::from_be_bytes([v1, v0]);
                match coil_of(value) {
                    Some(on) => Ok(Self::write_coil(u16::from_be_bytes([a1, a0]), on)),
                    None => Err(RequestError::Coil { value }),
                }
            }
            [WRITE_SINGLE, a1, a0, v1, v0] => {
                Ok(Self::write(u16::from_be_bytes([a1, a0]), u16::from_be_bytes([v1, v0])))
            }
            [DIAGNOSTICS, 0, 0, d1, d0] => Ok(Self::echo(u16::from_be_bytes([d1, d0]))),
            [WRITE_MULTIPLE, a1, a0, c1, c0, bytes, ref data @ ..] => {
                let (address, count) = (u16::from_be_bytes([a1, a0]), u16::from_be_bytes([c1, c0]));
                let count = check_range(address, usize::from(count), MAX_WRITE)?;
                match Words::from_wire(data) {
                    Some(words) if words.len() == count && usize::from(bytes) == data.len() => {
                        Ok(Self::WriteMultiple { address, words })
                    }
                    _ => Err(RequestError::ByteCount { count, bytes, came: data.len() }),
                }
            }
            [READ_COILS..=READ_INPUT | WRITE_COIL | WRITE_SINGLE | WRITE_MULTIPLE, ..] | [DIAGNOSTICS, 0, 0, ..] => {
                Err(RequestError::PduLength { len: pdu.len() })
            }
            _ => match Self::seldom(pdu) {
                Some(request) => Ok(request),
                None => Self::custom(pdu, AnswerLength::BySilence),
            },
        }
    }

    /// The function code.
    pub const fn function(&self) -> u8 {
        match self {
            Self::Read { table, .. } => table.function(),
            Self::WriteCoil { .. } => WRITE_COIL,
            Self::WriteSingle { .. } => WRITE_SINGLE,
            Self::Echo { .. } => DIAGNOSTICS,
            Self::WriteMultiple { .. } => WRITE_MULTIPLE,
            Self::WriteCoils { .. } => WRITE_COILS,
            Self::ReportServerId => REPORT_SERVER_ID,
            Self::MaskWrite { .. } => MASK_WRITE,
            Self::ReadWrite { .. } => READ_WRITE,
            Self::ReadIdentification { .. } => ENCAPSULATED,
            Self::Huanyang(asked) => asked.function(),
            Self::Custom { pdu, .. } => pdu[0],
        }
    }

    /// Whether the request may change something in the unit.
    ///
    /// A custom request counts as a write unless its function only reads: 01H, 02H, 04H, 07H, 0BH, 0CH, 11H, 14H,
    /// 18H, 08H with a sub-function that returns a counter, or 2BH with 0EH.
    pub const fn is_write(&self) -> bool {
        match self {
            Self::Read { .. } | Self::Echo { .. } | Self::ReportServerId | Self::ReadIdentification { .. } => false,
            Self::WriteCoil { .. }
            | Self::WriteSingle { .. }
            | Self::WriteMultiple { .. }
            | Self::WriteCoils { .. }
            | Self::MaskWrite { .. }
            | Self::ReadWrite { .. } => true,
            Self::Huanyang(asked) => asked.is_write(),
            Self::Custom { pdu, .. } => !reads(pdu),
        }
    }

    /// How many bytes the request has on the wire, with address and CRC.
    pub const fn adu_len(&self) -> usize {
        let pdu = match self {
            Self::Read { .. } | Self::WriteCoil { .. } | Self::WriteSingle { .. } | Self::Echo { .. } => 5,
            Self::WriteMultiple { words, .. } => 6 + 2 * words.len(),
            Self::WriteCoils { words, .. } => 6 + Table::Coil.bytes(words.len()),
            Self::ReportServerId => 1,
            Self::MaskWrite { .. } => 7,
            Self::ReadWrite { words, .. } => 10 + 2 * words.len(),
            Self::ReadIdentification { .. } => 4,
            Self::Huanyang(asked) => asked.pdu_len(),
            Self::Custom { pdu, .. } => pdu.len(),
        };
        AROUND_PDU + pdu
    }

    /// Writes the PDU into `target` and returns its length.
    pub(crate) fn put(&self, target: &mut [u8; MAX_PDU]) -> usize {
        match *self {
            Self::Read { table, address, count } => put_words(target, table.function(), [address, count]),
            Self::WriteCoil { address, on } => put_words(target, WRITE_COIL, [address, coil_word(on)]),
            Self::WriteSingle { address, value } => put_words(target, WRITE_SINGLE, [address, value]),
            Self::Echo { data } => put_words(target, DIAGNOSTICS, [0, data]),
            Self::WriteMultiple { address, words } => {
                // At most 123 words, checked by the constructors: both numbers fit.
                #[expect(clippy::cast_possible_truncation, reason = "at most 123")]
                let count = words.len() as u8;
                put_words(target, WRITE_MULTIPLE, [address, u16::from(count)]);
                target[5] = 2 * count;
                let end = 6 + 2 * words.len();
                words.put(&mut target[6..end]);
                end
            }
            Self::Custom { pdu, .. } => {
                target[..pdu.len()].copy_from_slice(pdu);
                pdu.len()
            }
            Self::Huanyang(asked) => asked.put(target),
            _ => self.put_seldom(target),
        }
    }
}

const fn check_range(address: u16, count: usize, max: u16) -> Result<usize, RequestError> {
    if count == 0 || count > max as usize {
        return Err(RequestError::Count { count, max });
    }
    if address as usize + count > 0x1_0000 {
        return Err(RequestError::Range { address, count });
    }
    Ok(count)
}

/// A request that cannot be: nothing of it goes out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum RequestError {
    /// Too many words or bits, or none.
    Count {
        /// What was asked.
        count: usize,
        /// Most that the function can carry.
        max: u16,
    },
    /// The last register lies beyond 0xFFFF.
    Range {
        /// First register.
        address: u16,
        /// How many.
        count: usize,
    },
    /// Byte count, word count and data of a 10H request do not agree.
    ByteCount {
        /// Words announced.
        count: usize,
        /// Bytes announced.
        bytes: u8,
        /// Bytes that stand there.
        came: usize,
    },
    /// A coil is neither to be on nor off.
    Coil {
        /// What 05H carries: FF00H and 0000H mean something.
        value: u16,
    },
    /// The length does not fit the function.
    PduLength {
        /// Bytes of the PDU.
        len: usize,
    },
    /// The function code is 0 or has the exception bit.
    Function {
        /// What was given.
        function: u8,
    },
    /// No answer can have this length.
    AnswerLength {
        /// Bytes of the answer's PDU.
        len: u8,
    },
}

impl fmt::Display for RequestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count { count, max } => write!(f, "{count} words in one request: 1 to {max} can be carried"),
            Self::Range { address, count } => {
                write!(f, "{count} words from {address:04X}H end beyond the last register FFFFH")
            }
            Self::ByteCount { count, bytes, came } => {
                write!(f, "{count} words and {bytes} bytes announced, {came} bytes of data")
            }
            Self::Coil { value } => write!(f, "a coil is written with FF00H or 0000H, not {value:04X}H"),
            Self::PduLength { len } => write!(f, "a PDU of {len} bytes does not fit its function (1 to {MAX_PDU})"),
            Self::Function { function } => write!(f, "function {function:02X}H cannot be asked for (01H to 7FH can)"),
            Self::AnswerLength { len } => write!(f, "an answer's PDU of {len} bytes cannot be (1 to {MAX_PDU})"),
        }
    }
}

impl core::error::Error for RequestError {}
