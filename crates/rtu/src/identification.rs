//! Who made a unit and what it is, by its own words: the objects that 2BH/0EH brings, some of them in each answer.
//!
//! | byte of the answer | holds |
//! | --- | --- |
//! | 2BH, 0EH | function and kind |
//! | level | as it was asked |
//! | conformity | what the unit has: 01H to 03H, and 80H where it also gives single objects |
//! | more follows | 00H, or FFH: the rest has to be asked for |
//! | next object | where the rest begins |
//! | number of objects | of this answer |
//! | each object | its number, its length, its bytes |
//!
//! Source: *Modbus Application Protocol* V1.1b3, §6.21.

use crate::answer::error::AnswerError;
use crate::pdu::MAX_PDU;
use crate::pdu::function::{ENCAPSULATED, IDENTIFICATION};

/// Bytes before the first object.
pub(crate) const HEAD: usize = 7;
/// Number and length of an object.
pub(crate) const OBJECT_HEAD: usize = 2;
pub(crate) const MORE: u8 = 0xFF;
/// The bit of a conformity that says that single objects can be asked for.
pub(crate) const INDIVIDUAL: u8 = 0x80;

/// How much of the identification is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
#[non_exhaustive]
pub enum IdentificationLevel {
    /// Vendor, product code and revision: the objects 00H to 02H.
    Basic = 1,
    /// The objects up to 7FH.
    Regular = 2,
    /// All objects. From 80H on they are the maker's own.
    Extended = 3,
    /// One object alone.
    One = 4,
}

impl IdentificationLevel {
    /// The level of that code; `None` where there is none.
    pub const fn of_code(code: u8) -> Option<Self> {
        match code {
            1 => Some(Self::Basic),
            2 => Some(Self::Regular),
            3 => Some(Self::Extended),
            4 => Some(Self::One),
            _ => None,
        }
    }

    /// As it stands in a request.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The last object that an answer can have.
    pub(crate) const fn last(self) -> u8 {
        match self {
            Self::Basic => 0x02,
            Self::Regular => 0x7F,
            Self::Extended | Self::One => 0xFF,
        }
    }
}

/// One answer to 2BH/0EH: some objects of the identification, whose lengths were checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IdentificationPage<'a> {
    pdu: &'a [u8],
}

impl<'a> IdentificationPage<'a> {
    /// The answer that `pdu` is.
    ///
    /// # Errors
    ///
    /// [`AnswerError`]: the lengths of its objects do not add up, they do not stand in the order of their numbers, or it says
    /// what the specification does not have.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, AnswerError> {
        let wrong = Err(AnswerError::Length { len: pdu.len() });
        let &[ENCAPSULATED, IDENTIFICATION, _, conformity, more, next, _, ..] = pdu else { return wrong };
        if len(pdu) != Some(pdu.len()) || pdu.len() > MAX_PDU {
            return wrong;
        }
        if !matches!(conformity & !INDIVIDUAL, 1..=3) {
            return Err(AnswerError::Conformity { came: conformity });
        }
        let page = Self { pdu };
        let mut last = None;
        for (object, _) in page.objects() {
            if let Some(last) = last.filter(|&last| last >= object) {
                return Err(AnswerError::Object { asked: last, came: object });
            }
            last = Some(object);
        }
        match more {
            0 => Ok(page),
            MORE if last.is_some_and(|last| next > last) => Ok(page),
            _ => Err(AnswerError::MoreFollows { more, next }),
        }
    }

    /// Whether it is an answer to the question for `level` from `object` on.
    ///
    /// A unit that has no such object begins with its first one, unless one alone was asked for: `restarts` takes that too.
    ///
    /// # Errors
    ///
    /// [`AnswerError`]: it answers something else.
    pub fn check(&self, level: IdentificationLevel, object: u8, restarts: bool) -> Result<(), AnswerError> {
        if self.pdu[2] != level.code() {
            return Err(AnswerError::Level { asked: level.code(), came: self.pdu[2] });
        }
        let (first, last) = (self.objects().next(), self.objects().last());
        let wrong = |came| Err(AnswerError::Object { asked: object, came });
        match (level, first, last) {
            (IdentificationLevel::One, Some((came, _)), _) if came != object || self.len() != 1 => wrong(came),
            (IdentificationLevel::One, Some(_), _) if self.next().is_some() => {
                Err(AnswerError::MoreFollows { more: MORE, next: self.pdu[5] })
            }
            (IdentificationLevel::One, None, _) => Err(AnswerError::Length { len: self.pdu.len() }),
            (_, Some((came, _)), _) if object != 0 && came != object && !(restarts && came == 0) => wrong(came),
            (_, _, Some((came, _))) if came > level.last() => wrong(came),
            _ => Ok(()),
        }
    }

    /// What the unit has: 01H basic, 02H regular, 03H extended; 80H more where it also gives single objects.
    pub const fn conformity(&self) -> u8 {
        self.pdu[3]
    }

    /// Where the rest begins; `None` where there is no more.
    pub const fn next(&self) -> Option<u8> {
        if self.pdu[4] == MORE { Some(self.pdu[5]) } else { None }
    }

    /// How many objects it has.
    pub const fn len(&self) -> usize {
        self.pdu[6] as usize
    }

    /// Whether it has none.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Its objects: number and bytes, which are text in the first 7.
    pub fn objects(&self) -> impl Iterator<Item = (u8, &'a [u8])> + Clone + use<'a> {
        let mut rest = self.pdu.get(HEAD..).unwrap_or_default();
        core::iter::from_fn(move || {
            let [object, len, behind @ ..] = rest else { return None };
            let (value, behind) = behind.split_at_checked(usize::from(*len))?;
            rest = behind;
            Some((*object, value))
        })
    }

    /// Function code and data.
    pub const fn pdu(&self) -> &'a [u8] {
        self.pdu
    }
}

/// How many bytes the PDU of the answer has that begins with `pdu`, by the lengths of its objects as far as they are there;
/// `None` where more bytes have to be seen first.
pub(crate) fn len(pdu: &[u8]) -> Option<usize> {
    let mut end = HEAD;
    for _ in 0..*pdu.get(HEAD - 1)? {
        // What is too long already needs no end.
        if end > MAX_PDU {
            break;
        }
        end += OBJECT_HEAD + usize::from(*pdu.get(end + 1)?);
    }
    Some(end)
}
