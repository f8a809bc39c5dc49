//! What a right answer must look like: answers judged against what was asked.

mod shape;

use crate::answer::{Answer, AnswerError, Head, MOST};
use crate::frame::Frame;
use crate::huanyang::Huanyang;
use crate::identification::{IdentificationLevel, IdentificationPage};
use crate::pdu::function::{
    DIAGNOSTICS, ENCAPSULATED, EXCEPTION_BIT, IDENTIFICATION, MASK_WRITE, READ_COILS, READ_INPUT, READ_WRITE,
    REPORT_SERVER_ID, WRITE_COIL, WRITE_COILS, WRITE_MULTIPLE, WRITE_SINGLE,
};
use crate::pdu::{AROUND_PDU, AnswerLength, MAX_PDU, coil_word};
use crate::request::Request;
use crate::{Table, UnitAddress};
use shape::Shape;

/// What a right answer must look like: all of a request that its answer has to repeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Expected(Kind);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Read { table: Table, count: u16 },
    WriteCoil { address: u16, on: bool },
    WriteSingle { address: u16, value: u16 },
    Echo { data: u16 },
    WriteMultiple { address: u16, count: u16 },
    WriteCoils { address: u16, count: u16 },
    ServerId,
    MaskWrite { address: u16, and: u16, or: u16 },
    ReadWrite { count: u16 },
    Identification { level: IdentificationLevel, object: u8 },
    Huanyang(Huanyang),
    Custom { function: u8, answer: AnswerLength },
}

impl Expected {
    /// The echo of some word.
    pub(crate) const ECHO: Self = Self(Kind::Echo { data: 0 });

    pub(crate) fn of(request: &Request<'_>) -> Self {
        Self(match *request {
            Request::Read { table, count, .. } => Kind::Read { table, count },
            Request::WriteCoil { address, on } => Kind::WriteCoil { address, on },
            Request::WriteSingle { address, value } => Kind::WriteSingle { address, value },
            Request::Echo { data } => Kind::Echo { data },
            #[expect(clippy::cast_possible_truncation, reason = "at most 123 words")]
            Request::WriteMultiple { address, words } => Kind::WriteMultiple { address, count: words.len() as u16 },
            #[expect(clippy::cast_possible_truncation, reason = "at most 1968 coils")]
            Request::WriteCoils { address, words } => Kind::WriteCoils { address, count: words.len() as u16 },
            Request::ReportServerId => Kind::ServerId,
            Request::MaskWrite { address, and, or } => Kind::MaskWrite { address, and, or },
            Request::ReadWrite { count, .. } => Kind::ReadWrite { count },
            Request::ReadIdentification { level, object } => Kind::Identification { level, object },
            Request::Huanyang(asked) => Kind::Huanyang(asked),
            Request::Custom { answer, .. } => Kind::Custom { function: request.function(), answer },
        })
    }

    /// The function code of the answer, unless the unit refuses.
    pub const fn function(&self) -> u8 {
        match self.0 {
            Kind::Read { table, .. } => table.function(),
            Kind::WriteCoil { .. } => WRITE_COIL,
            Kind::WriteSingle { .. } => WRITE_SINGLE,
            Kind::Echo { .. } => DIAGNOSTICS,
            Kind::WriteMultiple { .. } => WRITE_MULTIPLE,
            Kind::WriteCoils { .. } => WRITE_COILS,
            Kind::ServerId => REPORT_SERVER_ID,
            Kind::MaskWrite { .. } => MASK_WRITE,
            Kind::ReadWrite { .. } => READ_WRITE,
            Kind::Identification { .. } => ENCAPSULATED,
            Kind::Huanyang(asked) => asked.function(),
            Kind::Custom { function, .. } => function,
        }
    }

    /// How long the answer's PDU is, unless the unit refuses with two bytes.
    #[expect(clippy::cast_possible_truncation, reason = "at most 253 bytes")]
    pub const fn length(&self) -> AnswerLength {
        match self.pdu_len() {
            Some(pdu) => AnswerLength::Bytes(pdu as u8),
            None => AnswerLength::BySilence,
        }
    }

    /// How many bytes the answer has on the wire, unless the unit refuses; `None` where only silence tells.
    pub const fn adu_len(&self) -> Option<usize> {
        match self.pdu_len() {
            Some(pdu) => Some(AROUND_PDU + pdu),
            None => None,
        }
    }

    pub(crate) const fn pdu_len(self) -> Option<usize> {
        match self.0 {
            Kind::Read { table, count } => Some(2 + table.bytes(count as usize)),
            Kind::WriteCoil { .. }
            | Kind::WriteSingle { .. }
            | Kind::Echo { .. }
            | Kind::WriteMultiple { .. }
            | Kind::WriteCoils { .. } => Some(5),
            Kind::MaskWrite { .. } => Some(7),
            Kind::ReadWrite { count } => Some(2 + 2 * count as usize),
            Kind::Custom { answer: AnswerLength::Bytes(pdu), .. } => Some(pdu as usize),
            Kind::ServerId
            | Kind::Identification { .. }
            | Kind::Huanyang(_)
            | Kind::Custom { answer: AnswerLength::BySilence, .. } => None,
        }
    }

    /// What stands behind the function code in the answer, where that is known.
    pub(crate) const fn third(self) -> Option<u8> {
        match self.0 {
            #[expect(clippy::cast_possible_truncation, reason = "at most 250 bytes")]
            Kind::Read { table, count } => Some(table.bytes(count as usize) as u8),
            Kind::WriteCoil { address, .. }
            | Kind::WriteSingle { address, .. }
            | Kind::WriteMultiple { address, .. }
            | Kind::WriteCoils { address, .. }
            | Kind::MaskWrite { address, .. } => Some(address.to_be_bytes()[0]),
            #[expect(clippy::cast_possible_truncation, reason = "at most 250 bytes")]
            Kind::ReadWrite { count } => Some(2 * count as u8),
            Kind::Echo { .. } => Some(0),
            Kind::Identification { .. } => Some(IDENTIFICATION),
            Kind::ServerId | Kind::Huanyang(_) | Kind::Custom { .. } => None,
        }
    }

    /// Whether nobody knows beforehand how long the answer is, and its own bytes tell.
    pub(crate) const fn tells_its_length(self) -> bool {
        matches!(self.0, Kind::ServerId | Kind::Identification { .. })
    }

    /// Whether the byte behind the function says how many follow, in an answer and in a refusal.
    pub(crate) const fn is_counted(self) -> bool {
        matches!(self.0, Kind::Huanyang(_))
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

    /// Whether the answer repeats all that was written: it says what the unit took, whoever asked it.
    pub(crate) const fn repeats_value(self) -> bool {
        matches!(self.0, Kind::WriteCoil { .. } | Kind::WriteSingle { .. })
    }

    /// Address and count, as the answer has to repeat them; `None` where it repeats nothing, or more.
    pub(crate) const fn repeats(self) -> Option<[u8; 4]> {
        match self.0 {
            Kind::WriteMultiple { address, count } | Kind::WriteCoils { address, count } => {
                let ([a, b], [c, d]) = (address.to_be_bytes(), count.to_be_bytes());
                Some([a, b, c, d])
            }
            _ => None,
        }
    }

    /// Whether something may be changed: neither a read nor an echo.
    pub(crate) const fn is_write(self) -> bool {
        !self.is_read() && !self.is_echo()
    }

    /// Whether words or bits are read.
    pub(crate) const fn is_read(self) -> bool {
        match self.0 {
            Kind::Read { .. } => true,
            Kind::Huanyang(asked) => !asked.is_write(),
            _ => false,
        }
    }

    /// Whether an answer to this could be taken for one to `other`. Refusals aside: those of one function look alike.
    pub(crate) fn could_pass_for(self, other: Self) -> bool {
        match (self.0, other.0) {
            (Kind::Huanyang(ours), Kind::Huanyang(theirs)) => ours.could_pass_for(theirs),
            (Kind::Huanyang(_), _) | (_, Kind::Huanyang(_)) => self.function() == other.function(),
            (Kind::Custom { .. }, _) | (_, Kind::Custom { .. }) => {
                let (ours, theirs) = (self.length(), other.length());
                let fits = ours == theirs
                    || matches!(ours, AnswerLength::BySilence)
                    || matches!(theirs, AnswerLength::BySilence);
                self.function() == other.function() && fits
            }
            // Bits are told apart only by how many bytes they fill.
            (Kind::Read { table: ours, .. }, Kind::Read { table: theirs, .. }) => {
                ours == theirs && self.pdu_len() == other.pdu_len()
            }
            // What an answer brings of several objects depends on what the unit has.
            (Kind::Identification { level: ours, object }, Kind::Identification { level: theirs, object: other }) => {
                ours == theirs && (ours != IdentificationLevel::One || object == other)
            }
            _ => self == other,
        }
    }

    /// As [`could_pass_for`](Self::could_pass_for), where an answer may also have fewer words than were asked for, which
    /// some units give.
    pub(crate) fn could_pass_for_cut(self, other: Self) -> bool {
        match (self.0, other.0) {
            (Kind::Read { table: ours, .. }, Kind::Read { table: theirs, .. }) => {
                ours == theirs && self.pdu_len() >= other.pdu_len()
            }
            _ => self.could_pass_for(other),
        }
    }

    /// As [`could_pass_for`](Self::could_pass_for), of a unit that gives other numbers of words than it is asked for.
    pub(crate) fn could_pass_at_any_length(self, other: Self) -> bool {
        let is_read = matches!(self.function(), READ_COILS..=READ_INPUT);
        (is_read && self.function() == other.function()) || self.could_pass_for(other)
    }

    /// Whether the right answer may be the request once more, so that an adapter's own echo cannot be told from it.
    ///
    /// Always so for 05H, 06H, 08H and 16H, and in Huanyang's protocol of all but a status; of a custom function nobody knows.
    pub const fn may_repeat_request(&self) -> bool {
        if let Kind::Huanyang(asked) = self.0 {
            return asked.may_repeat_request();
        }
        matches!(
            self.0,
            Kind::WriteCoil { .. }
                | Kind::WriteSingle { .. }
                | Kind::Echo { .. }
                | Kind::MaskWrite { .. }
                | Kind::Custom { .. }
        )
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
            (Kind::Huanyang(asked), _) => asked.judge(pdu),
            (Kind::Custom { .. }, [function, ..]) if function & EXCEPTION_BIT == 0 => Ok(Answer::Custom { pdu }),
            (Kind::Read { count, table }, _) if table.is_bits() => Ok(Answer::parse(pdu)?.shortened(count)),
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
        if let Kind::Huanyang(asked) = self.0 {
            return asked.judge(pdu);
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
            (Kind::Read { table, count }, Answer::Read { words, .. }) if table.is_bits() => {
                let (asked, came) = (table.bytes(count.into()), table.bytes(words.len()));
                if asked == came {
                    return Ok(answer.shortened(count));
                }
                #[expect(clippy::cast_possible_truncation, reason = "at most 250 bytes")]
                Err(AnswerError::Bytes { asked: asked as u8, came: came as u8 })
            }
            (Kind::Read { count, .. }, Answer::Read { words, .. }) if words.len() != usize::from(count) => {
                Err(AnswerError::Count { asked: count, came: words.len() })
            }
            (_, Answer::Exception { .. }) | (Kind::Read { .. }, Answer::Read { .. }) => Ok(answer),
            (Kind::WriteCoil { address, on }, Answer::WriteCoil { address: at, on: took }) => {
                repeats([address, coil_word(on)], [at, coil_word(took)], answer)
            }
            (Kind::WriteSingle { address, value }, Answer::WriteSingle { address: at, value: took }) => {
                repeats([address, value], [at, took], answer)
            }
            (Kind::WriteMultiple { address, count }, Answer::WriteMultiple { address: at, count: took }) => {
                repeats([address, count], [at, took], answer)
            }
            (Kind::Echo { data }, Answer::Echo { data: back }) => repeats([0, data], [0, back], answer),
            _ => self.judge_seldom(pdu, answer),
        }
    }

    /// The same, of a function that few units know. `answer` is what `pdu` is by itself.
    #[cold]
    fn judge_seldom<'a>(self, pdu: &'a [u8], answer: Answer<'a>) -> Result<Answer<'a>, AnswerError> {
        match (self.0, answer) {
            (Kind::WriteCoils { address, count }, Answer::WriteCoils { address: at, count: took }) => {
                repeats([address, count], [at, took], answer)
            }
            (Kind::MaskWrite { address, and, or }, Answer::MaskWrite { .. }) => {
                let mut asked = [0; MAX_PDU];
                let len = Answer::MaskWrite { address, and, or }.put(&mut asked);
                if asked[..len] == *pdu {
                    return Ok(answer);
                }
                Err(AnswerError::Repeat { asked: Head::of(&asked[1..len], MOST), came: Head::of(&pdu[1..], MOST) })
            }
            (Kind::ReadWrite { count }, Answer::ReadWrite { words }) if words.len() == usize::from(count) => Ok(answer),
            (Kind::ReadWrite { count }, Answer::ReadWrite { words }) => {
                Err(AnswerError::Count { asked: count, came: words.len() })
            }
            (Kind::ServerId, Answer::ServerId { .. }) => Ok(answer),
            (Kind::Identification { level, object }, _) => {
                IdentificationPage::parse(pdu)?.check(level, object, true).map(|()| answer)
            }
            (_, Answer::Custom { .. }) => Err(AnswerError::Length { len: pdu.len() }),
            (_, _) => Err(AnswerError::Function { asked: self.function(), came: pdu[0] }),
        }
    }
}

fn repeats(asked: [u16; 2], came: [u16; 2], answer: Answer<'_>) -> Result<Answer<'_>, AnswerError> {
    if asked == came { Ok(answer) } else { Err(AnswerError::Echo { asked, came }) }
}

impl Request<'_> {
    /// What a right answer must look like, without borrowing from the request.
    pub fn expected(&self) -> Expected {
        Expected::of(self)
    }

    /// `pdu` as the answer to this request, or as the refusal of it. The answer to a custom request whose length is not
    /// given is held to what the specification says of its function.
    ///
    /// # Errors
    ///
    /// [`AnswerError`]: it answers something else.
    pub fn judge<'p>(&self, pdu: &'p [u8]) -> Result<Answer<'p>, AnswerError> {
        let answer = self.expected().judge(pdu)?;
        if let (Self::Custom { pdu: asked, .. }, Answer::Custom { .. }) = (self, answer) {
            self.expected().check_custom(asked, pdu)?;
        }
        Ok(answer)
    }
}
