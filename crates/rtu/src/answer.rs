//! What a unit answers: the PDUs of answers, built, parsed, and judged against what was asked.

mod error;
mod shape;

use crate::frame::{AROUND_PDU, Frame};
use crate::request::function::{DIAGNOSTICS, EXCEPTION_BIT, READ_HOLDING, WRITE_MULTIPLE, WRITE_SINGLE};
use crate::request::{AnswerLength, MAX_PDU, MAX_READ, Request, RequestError, put_words};
use crate::{UnitAddress, Words};

pub use error::AnswerError;
pub use shape::Head;
use shape::Shape;

/// The code in an exception: why a unit refused. What a code means beyond 04H differs from family to family.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ExceptionCode(pub u8);

impl ExceptionCode {
    /// 01H: the unit does not know the function.
    pub const ILLEGAL_FUNCTION: Self = Self(0x01);
    /// 02H: there is no such register.
    pub const ILLEGAL_ADDRESS: Self = Self(0x02);
    /// 03H: the request is not well formed.
    pub const ILLEGAL_VALUE: Self = Self(0x03);
    /// 04H: the unit could not do it.
    pub const DEVICE_FAILURE: Self = Self(0x04);
    /// 0BH: a gateway passed the request on, and heard no answer of the unit.
    pub const GATEWAY_TARGET_SILENT: Self = Self(0x0B);

    /// What the specification calls the code; a family of drives may mean something else by it.
    ///
    /// Source: *Modbus Application Protocol* V1.1b3, §7.
    pub const fn standard_name(self) -> &'static str {
        match self.0 {
            0x01 => "illegal_function",
            0x02 => "illegal_data_address",
            0x03 => "illegal_data_value",
            0x04 => "server_device_failure",
            0x05 => "acknowledge",
            0x06 => "server_device_busy",
            0x08 => "memory_parity_error",
            0x0A => "gateway_path_unavailable",
            0x0B => "gateway_target_failed_to_respond",
            _ => "not_in_the_specification",
        }
    }
}

/// An answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer<'a> {
    /// The words read.
    #[non_exhaustive]
    Read {
        /// 1..=125 words.
        words: Words<'a>,
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
    /// The answer to a read.
    ///
    /// # Errors
    ///
    /// [`RequestError::Count`]: `words` are none or more than 125.
    pub const fn read(words: &'a [u16]) -> Result<Self, RequestError> {
        if words.is_empty() || words.len() > MAX_READ as usize {
            return Err(RequestError::Count { count: words.len(), max: MAX_READ });
        }
        Ok(Self::Read { words: Words::new(words) })
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
            Self::Read { words } => Self::Read { words: words.first(count.into()) },
            other => other,
        }
    }

    /// The answer that confirms `request`; `None` for a read and a custom request, whose answers carry data.
    pub fn confirming(request: &Request<'_>) -> Option<Self> {
        match *request {
            Request::WriteSingle { address, value } => Some(Self::WriteSingle { address, value }),
            Request::Echo { data } => Some(Self::Echo { data }),
            Request::WriteMultiple { address, words } => {
                let count = u16::try_from(words.len()).ok()?;
                Some(Self::WriteMultiple { address, count })
            }
            Request::ReadHolding { .. } | Request::Custom { .. } => None,
        }
    }

    /// The answer that `pdu` is, by itself: whether it answers a request, [`Expected::judge`] tells.
    ///
    /// # Errors
    ///
    /// [`AnswerError::Length`]: the length does not fit the function.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, AnswerError> {
        match *pdu {
            [function, code] if function & EXCEPTION_BIT != 0 => Ok(Self::exception(function, ExceptionCode(code))),
            [READ_HOLDING, bytes, ref data @ ..] => match Words::from_wire(data) {
                // No frame is long enough for 126 words, but a byte count is.
                Some(words) if usize::from(bytes) == data.len() && (1..=MAX_READ.into()).contains(&words.len()) => {
                    Ok(Self::Read { words })
                }
                _ => Err(AnswerError::Length { len: pdu.len() }),
            },
            [WRITE_SINGLE, a1, a0, v1, v0] => {
                Ok(Self::WriteSingle { address: u16::from_be_bytes([a1, a0]), value: u16::from_be_bytes([v1, v0]) })
            }
            [DIAGNOSTICS, 0, 0, d1, d0] => Ok(Self::Echo { data: u16::from_be_bytes([d1, d0]) }),
            [WRITE_MULTIPLE, a1, a0, c1, c0] => {
                Ok(Self::WriteMultiple { address: u16::from_be_bytes([a1, a0]), count: u16::from_be_bytes([c1, c0]) })
            }
            [] | [READ_HOLDING | WRITE_SINGLE | WRITE_MULTIPLE, ..] | [DIAGNOSTICS, 0, 0, ..] => {
                Err(AnswerError::Length { len: pdu.len() })
            }
            [function, ..] if function & EXCEPTION_BIT != 0 => Err(AnswerError::Length { len: pdu.len() }),
            _ if pdu.len() > MAX_PDU => Err(AnswerError::Length { len: pdu.len() }),
            _ => Ok(Self::Custom { pdu }),
        }
    }

    /// Writes the PDU into `target` and returns its length.
    pub(crate) fn put(&self, target: &mut [u8; MAX_PDU]) -> usize {
        match *self {
            Self::Read { words } => {
                // At most 125 words, checked by the constructors: the byte count fits.
                let bytes = 2 * words.len();
                target[0] = READ_HOLDING;
                #[expect(clippy::cast_possible_truncation, reason = "at most 250")]
                {
                    target[1] = bytes as u8;
                }
                words.put(&mut target[2..2 + bytes]);
                2 + bytes
            }
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
        }
    }
}

/// What a right answer must look like: all of a request that its answer has to repeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Expected(Kind);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Read { count: u16 },
    WriteSingle { address: u16, value: u16 },
    Echo { data: u16 },
    WriteMultiple { address: u16, count: u16 },
    Custom { function: u8, answer: AnswerLength },
}

impl Expected {
    /// The echo of some word.
    pub(crate) const ECHO: Self = Self(Kind::Echo { data: 0 });

    pub(crate) fn of(request: &Request<'_>) -> Self {
        Self(match *request {
            Request::ReadHolding { count, .. } => Kind::Read { count },
            Request::WriteSingle { address, value } => Kind::WriteSingle { address, value },
            Request::Echo { data } => Kind::Echo { data },
            #[expect(clippy::cast_possible_truncation, reason = "at most 123 words")]
            Request::WriteMultiple { address, words } => Kind::WriteMultiple { address, count: words.len() as u16 },
            Request::Custom { answer, .. } => Kind::Custom { function: request.function(), answer },
        })
    }

    /// The function code of the answer, unless the unit refuses.
    pub const fn function(&self) -> u8 {
        match self.0 {
            Kind::Read { .. } => READ_HOLDING,
            Kind::WriteSingle { .. } => WRITE_SINGLE,
            Kind::Echo { .. } => DIAGNOSTICS,
            Kind::WriteMultiple { .. } => WRITE_MULTIPLE,
            Kind::Custom { function, .. } => function,
        }
    }

    /// How long the answer's PDU is, unless the unit refuses with two bytes.
    pub const fn length(&self) -> AnswerLength {
        match self.0 {
            #[expect(clippy::cast_possible_truncation, reason = "at most 125 words")]
            Kind::Read { count } => AnswerLength::Bytes(2 + 2 * count as u8),
            Kind::WriteSingle { .. } | Kind::Echo { .. } | Kind::WriteMultiple { .. } => AnswerLength::Bytes(5),
            Kind::Custom { answer, .. } => answer,
        }
    }

    /// How many bytes the answer has on the wire, unless the unit refuses; `None` where only silence tells.
    pub const fn adu_len(&self) -> Option<usize> {
        match self.length() {
            AnswerLength::Bytes(pdu) => Some(AROUND_PDU + pdu as usize),
            AnswerLength::BySilence => None,
        }
    }

    /// What stands behind the function code in the answer, where that is known.
    pub(crate) const fn third(self) -> Option<u8> {
        match self.0 {
            #[expect(clippy::cast_possible_truncation, reason = "at most 125 words")]
            Kind::Read { count } => Some(2 * count as u8),
            Kind::WriteSingle { address, .. } | Kind::WriteMultiple { address, .. } => Some(address.to_be_bytes()[0]),
            Kind::Echo { .. } => Some(0),
            Kind::Custom { .. } => None,
        }
    }

    /// Whether the specification says more of the answer to `asked`, the PDU of the request: checks `pdu` against that.
    ///
    /// # Errors
    ///
    /// [`AnswerError`]: it is not as the specification says.
    pub(crate) fn check_custom(self, asked: &[u8], pdu: &[u8]) -> Result<(), AnswerError> {
        match self.0 {
            // Who says how long the answer is knows a unit that the specification may not know.
            Kind::Custom { answer: AnswerLength::BySilence, .. } => Shape::of_answer_to(asked).check(pdu),
            _ => Ok(()),
        }
    }

    /// Whether the answer returns a word of the request's own choosing: proof that it is the answer to this request.
    pub(crate) const fn is_echo(self) -> bool {
        matches!(self.0, Kind::Echo { .. })
    }

    /// Whether something may be changed: neither a read nor an echo.
    pub(crate) const fn is_write(self) -> bool {
        !self.is_read() && !self.is_echo()
    }

    /// Whether words are read.
    pub(crate) const fn is_read(self) -> bool {
        matches!(self.0, Kind::Read { .. })
    }

    /// Whether an answer to this could be taken for one to `other`. Refusals aside: those of one function look alike.
    pub(crate) fn could_pass_for(self, other: Self) -> bool {
        match (self.0, other.0) {
            (Kind::Custom { .. }, _) | (_, Kind::Custom { .. }) => {
                let (ours, theirs) = (self.length(), other.length());
                let fits = ours == theirs
                    || matches!(ours, AnswerLength::BySilence)
                    || matches!(theirs, AnswerLength::BySilence);
                self.function() == other.function() && fits
            }
            _ => self == other,
        }
    }

    /// As [`could_pass_for`](Self::could_pass_for), where an answer may also have fewer words than were asked for, which
    /// some units give.
    pub(crate) fn could_pass_for_cut(self, other: Self) -> bool {
        match (self.0, other.0) {
            (Kind::Read { count: ours }, Kind::Read { count: theirs }) => ours >= theirs,
            _ => self.could_pass_for(other),
        }
    }

    /// Whether the right answer may be the request once more, so that an adapter's own echo cannot be told from it.
    ///
    /// Always so for 06H and 08H; of a custom function nobody knows.
    pub const fn may_repeat_request(&self) -> bool {
        matches!(self.0, Kind::WriteSingle { .. } | Kind::Echo { .. } | Kind::Custom { .. })
    }

    /// `frame` as the answer of `unit` that was expected, or as the refusal of it.
    ///
    /// # Errors
    ///
    /// [`AnswerError`]: it comes from another unit, or answers something else.
    pub fn judge_frame<'a>(&self, unit: UnitAddress, frame: &Frame<'a>) -> Result<Answer<'a>, AnswerError> {
        if frame.address() != unit.get() {
            return Err(AnswerError::Unit { asked: unit.get(), came: frame.address() });
        }
        self.judge(frame.pdu())
    }

    /// `pdu`, which was [judged](Self::judge) to be the answer or the refusal of it.
    ///
    /// # Errors
    ///
    /// [`AnswerError`]: it is neither.
    pub(crate) fn parse(self, pdu: &[u8]) -> Result<Answer<'_>, AnswerError> {
        match (self.0, pdu) {
            (Kind::Custom { .. }, [function, ..]) if function & EXCEPTION_BIT == 0 => Ok(Answer::Custom { pdu }),
            _ => Answer::parse(pdu),
        }
    }

    /// `pdu` as the answer that was expected, or as the refusal of it. Of a custom request more is known than this:
    /// [`Request::judge`].
    ///
    /// # Errors
    ///
    /// [`AnswerError`]: it answers something else.
    pub fn judge<'a>(&self, pdu: &'a [u8]) -> Result<Answer<'a>, AnswerError> {
        let Some(&came) = pdu.first() else {
            return Err(AnswerError::Length { len: 0 });
        };
        if came & !EXCEPTION_BIT != self.function() {
            return Err(AnswerError::Function { asked: self.function(), came });
        }
        if let (Kind::Custom { answer, .. }, false) = (self.0, came & EXCEPTION_BIT != 0) {
            return match answer {
                AnswerLength::Bytes(len) if usize::from(len) != pdu.len() => {
                    Err(AnswerError::Length { len: pdu.len() })
                }
                _ => Ok(Answer::Custom { pdu }),
            };
        }
        let answer = Answer::parse(pdu)?;
        match (self.0, answer) {
            (Kind::Read { count }, Answer::Read { words }) if words.len() != usize::from(count) => {
                Err(AnswerError::Count { asked: count, came: words.len() })
            }
            (_, Answer::Exception { .. }) | (Kind::Read { .. }, Answer::Read { .. }) => Ok(answer),
            (Kind::WriteSingle { address, value }, Answer::WriteSingle { address: at, value: took }) => {
                repeats([address, value], [at, took], answer)
            }
            (Kind::WriteMultiple { address, count }, Answer::WriteMultiple { address: at, count: took }) => {
                repeats([address, count], [at, took], answer)
            }
            (Kind::Echo { data }, Answer::Echo { data: back }) => repeats([0, data], [0, back], answer),
            _ => Err(AnswerError::Function { asked: self.function(), came }),
        }
    }
}

fn repeats(asked: [u16; 2], came: [u16; 2], answer: Answer<'_>) -> Result<Answer<'_>, AnswerError> {
    if asked == came { Ok(answer) } else { Err(AnswerError::Echo { asked, came }) }
}
