//! What a unit answers: the PDUs of answers, built and parsed. What is right as the answer to what, `expected` tells.

pub(crate) mod error;
mod head;
mod huanyang;
mod seldom;

use crate::identification::IdentificationPage;
use crate::pdu::function::{
    DIAGNOSTICS, EXCEPTION_BIT, READ_COILS, READ_HOLDING, READ_INPUT, WRITE_COIL, WRITE_MULTIPLE, WRITE_SINGLE,
};
use crate::pdu::{ExceptionCode, MAX_PDU, MAX_READ, MAX_READ_BITS, coil_of, coil_word, put_words};
use crate::request::{Request, RequestError};
use crate::{Table, Words};

pub use error::AnswerError;
pub use head::Head;
pub(crate) use head::MOST;

/// An answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Answer<'a> {
    /// The words read, or the bits, each a word of 0 or 1.
    #[non_exhaustive]
    Read {
        /// What was read.
        table: Table,
        /// 1..=125 words, 1..=2000 bits. By itself an answer of bits tells only how many bytes they fill: those that were
        /// asked for are the first.
        words: Words<'a>,
    },
    /// One coil was written.
    #[non_exhaustive]
    WriteCoil {
        /// Coil.
        address: u16,
        /// What it was given.
        on: bool,
    },
    /// One word was written.
    #[non_exhaustive]
    WriteSingle {
        /// Register.
        address: u16,
        /// What it was given.
        value: u16,
    },
    /// The word sent came back.
    #[non_exhaustive]
    Echo {
        /// The word.
        data: u16,
    },
    /// Several words were written.
    #[non_exhaustive]
    WriteMultiple {
        /// First register.
        address: u16,
        /// How many words.
        count: u16,
    },
    /// Several coils were written.
    #[non_exhaustive]
    WriteCoils {
        /// First coil.
        address: u16,
        /// How many.
        count: u16,
    },
    /// What the unit is, in bytes of its own: by the specification its identifier, 00H or FFH for off or on, and what it likes.
    #[non_exhaustive]
    ServerId {
        /// 1..=251 bytes.
        data: &'a [u8],
    },
    /// Bits of a register were changed.
    #[non_exhaustive]
    MaskWrite {
        /// Register.
        address: u16,
        /// Bits that stayed.
        and: u16,
        /// Bits that were set where `and` has zeros.
        or: u16,
    },
    /// The words read, after others were written.
    #[non_exhaustive]
    ReadWrite {
        /// 1..=125 words.
        words: Words<'a>,
    },
    /// Objects of the unit's identification.
    #[non_exhaustive]
    Identification {
        /// Those of this answer.
        page: IdentificationPage<'a>,
    },
    /// The unit refused.
    #[non_exhaustive]
    Exception {
        /// The function it was asked for, 00H..=7FH.
        function: u8,
        /// Why.
        code: ExceptionCode,
    },
    /// The answer to a custom request.
    #[non_exhaustive]
    Custom {
        /// Function code and data, 1..=253 bytes.
        pdu: &'a [u8],
    },
}

impl<'a> Answer<'a> {
    /// The answer to a read of holding registers.
    ///
    /// # Errors
    ///
    /// [`RequestError::Count`]: `words` are none or more than 125.
    pub const fn read(words: &'a [u16]) -> Result<Self, RequestError> {
        Self::read_of(Table::Holding, words)
    }

    /// The answer to a read of `table`: words, or bits of which 0 is off and anything else on.
    ///
    /// # Errors
    ///
    /// [`RequestError::Count`]: `words` are none, or more than one answer can carry.
    pub const fn read_of(table: Table, words: &'a [u16]) -> Result<Self, RequestError> {
        let max = table.max_read();
        if words.is_empty() || words.len() > max as usize {
            return Err(RequestError::Count { count: words.len(), max });
        }
        Ok(Self::Read { table, words: Words::new(words) })
    }

    /// The answer to 17H: the words that were read.
    ///
    /// # Errors
    ///
    /// [`RequestError::Count`]: `words` are none or more than 125.
    pub const fn read_write(words: &'a [u16]) -> Result<Self, RequestError> {
        if words.is_empty() || words.len() > MAX_READ as usize {
            return Err(RequestError::Count { count: words.len(), max: MAX_READ });
        }
        Ok(Self::ReadWrite { words: Words::new(words) })
    }

    /// The answer to 11H: 1..=251 bytes.
    ///
    /// # Errors
    ///
    /// [`RequestError::PduLength`]: `data` is empty or longer than that.
    pub const fn server_id(data: &'a [u8]) -> Result<Self, RequestError> {
        if data.is_empty() || data.len() > MAX_PDU - 2 {
            return Err(RequestError::PduLength { len: 2 + data.len() });
        }
        Ok(Self::ServerId { data })
    }

    /// The refusal of `function` (its low seven bits).
    pub const fn exception(function: u8, code: ExceptionCode) -> Self {
        Self::Exception { function: function & !EXCEPTION_BIT, code }
    }

    /// The answer to a custom request: function code and data.
    ///
    /// # Errors
    ///
    /// [`RequestError::PduLength`]: `pdu` is empty or longer than 253 bytes.
    pub const fn custom(pdu: &'a [u8]) -> Result<Self, RequestError> {
        if pdu.is_empty() || pdu.len() > MAX_PDU {
            return Err(RequestError::PduLength { len: pdu.len() });
        }
        Ok(Self::Custom { pdu })
    }

    /// The same with the first `count` words only, where more were read.
    #[must_use]
    pub fn shortened(self, count: u16) -> Self {
        match self {
            Self::Read { table, words } => Self::Read { table, words: words.first(count.into()) },
            other => other,
        }
    }

    /// The answer that confirms `request`; `None` where the answer carries data, and for a custom request.
    pub fn confirming(request: &Request<'_>) -> Option<Self> {
        match *request {
            Request::WriteCoil { address, on } => Some(Self::WriteCoil { address, on }),
            Request::WriteSingle { address, value } => Some(Self::WriteSingle { address, value }),
            Request::Echo { data } => Some(Self::Echo { data }),
            Request::WriteMultiple { address, words } => {
                let count = u16::try_from(words.len()).ok()?;
                Some(Self::WriteMultiple { address, count })
            }
            Request::WriteCoils { address, words } => {
                let count = u16::try_from(words.len()).ok()?;
                Some(Self::WriteCoils { address, count })
            }
            Request::MaskWrite { address, and, or } => Some(Self::MaskWrite { address, and, or }),
            Request::Read { .. }
            | Request::ReportServerId
            | Request::ReadWrite { .. }
            | Request::ReadIdentification { .. }
            | Request::Huanyang(_)
            | Request::Custom { .. } => None,
        }
    }

    /// The answer that `pdu` is, by itself: whether it answers a request, [`Expected::judge`](crate::Expected::judge)
    /// tells.
    ///
    /// # Errors
    ///
    /// [`AnswerError::Length`]: the length does not fit the function. [`AnswerError::Coil`]: a coil is neither on nor off.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, AnswerError> {
        match *pdu {
            [function, code] if function & EXCEPTION_BIT != 0 => Ok(Self::exception(function, ExceptionCode(code))),
            [READ_HOLDING, bytes, ref data @ ..] => match Words::from_wire(data) {
                // No frame is long enough for 126 words, but a byte count is.
                Some(words) if usize::from(bytes) == data.len() && (1..=MAX_READ.into()).contains(&words.len()) => {
                    Ok(Self::Read { table: Table::Holding, words })
                }
                _ => Err(AnswerError::Length { len: pdu.len() }),
            },
            [function @ READ_COILS..=READ_INPUT, bytes, ref data @ ..] => {
                let words = words_of(function, data).filter(|_| usize::from(bytes) == data.len());
                words.ok_or(AnswerError::Length { len: pdu.len() })
            }
            [WRITE_COIL, a1, a0, v1, v0] => {
                let value = u16::from_be_bytes([v1, v0]);
                match coil_of(value) {
                    Some(on) => Ok(Self::WriteCoil { address: u16::from_be_bytes([a1, a0]), on }),
                    None => Err(AnswerError::Coil { value }),
                }
            }
            [WRITE_SINGLE, a1, a0, v1, v0] => {
                Ok(Self::WriteSingle { address: u16::from_be_bytes([a1, a0]), value: u16::from_be_bytes([v1, v0]) })
            }
            [DIAGNOSTICS, 0, 0, d1, d0] => Ok(Self::Echo { data: u16::from_be_bytes([d1, d0]) }),
            [WRITE_MULTIPLE, a1, a0, c1, c0] => {
                Ok(Self::WriteMultiple { address: u16::from_be_bytes([a1, a0]), count: u16::from_be_bytes([c1, c0]) })
            }
            []
            | [READ_COILS..=READ_INPUT | WRITE_COIL | WRITE_SINGLE | WRITE_MULTIPLE, ..]
            | [DIAGNOSTICS, 0, 0, ..] => Err(AnswerError::Length { len: pdu.len() }),
            [function, ..] if function & EXCEPTION_BIT != 0 => Err(AnswerError::Length { len: pdu.len() }),
            _ if pdu.len() > MAX_PDU => Err(AnswerError::Length { len: pdu.len() }),
            _ => Ok(Self::seldom(pdu).unwrap_or(Self::Custom { pdu })),
        }
    }

    /// Writes the PDU into `target` and returns its length.
    pub(crate) fn put(&self, target: &mut [u8; MAX_PDU]) -> usize {
        match *self {
            Self::Read { table, words } => {
                // At most 125 words or 2000 bits, checked by the constructors: the byte count fits.
                let bytes = table.bytes(words.len());
                target[0] = table.function();
                #[expect(clippy::cast_possible_truncation, reason = "at most 250")]
                {
                    target[1] = bytes as u8;
                }
                let data = &mut target[2..2 + bytes];
                if table.is_bits() {
                    words.put_bits(data);
                } else {
                    words.put(data);
                }
                2 + bytes
            }
            Self::WriteCoil { address, on } => put_words(target, WRITE_COIL, [address, coil_word(on)]),
            Self::WriteSingle { address, value } => put_words(target, WRITE_SINGLE, [address, value]),
            Self::Echo { data } => put_words(target, DIAGNOSTICS, [0, data]),
            Self::WriteMultiple { address, count } => put_words(target, WRITE_MULTIPLE, [address, count]),
            Self::Exception { function, code } => {
                target[..2].copy_from_slice(&[function | EXCEPTION_BIT, code.0]);
                2
            }
            Self::Custom { pdu } => {
                target[..pdu.len()].copy_from_slice(pdu);
                pdu.len()
            }
            _ => self.put_seldom(target),
        }
    }
}

/// What the answer to 01H, 02H or 04H carries, if it can: whole words, or all bits of its bytes.
#[cold]
fn words_of(function: u8, data: &[u8]) -> Option<Answer<'_>> {
    let table = Table::of_function(function)?;
    let words = if table.is_bits() { Words::from_bits(data, MAX_READ_BITS) } else { Words::from_wire(data)? };
    let carried = data.len() <= table.bytes(table.max_read().into());
    Some(Answer::Read { table, words }).filter(|_| carried && !words.is_empty())
}
