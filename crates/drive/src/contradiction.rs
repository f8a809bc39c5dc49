//! Whether what a unit says of itself speaks against the family that it was named as.
//!
//! What speaks against one is only what documents or other programs say of another family: a code that is listed for that,
//! its signature, or a word that units of the named one always have, refused as an address that there is none. An unknown
//! code tells nothing, for firmwares differ; nor does a locked drive, nor a silent one.

use std::fmt;
use std::sync::Arc;

use drivebus_drives::{Evidence, Identification, Place, Table};
use drivebus_rtu::ExceptionCode;

use crate::answer::{Answer, Said};
use crate::codes;
use crate::family::Family;

/// What speaks against a family.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Contradiction {
    /// The unit gave a code of other families.
    Code {
        /// Where it was asked.
        place: Place,
        /// The code.
        word: u16,
        /// What is listed of it; never empty.
        rows: Vec<Identification>,
    },
    /// The unit says that it has no such address, and each unit of the family has.
    NoAddress {
        /// Where it was asked.
        place: Place,
        /// How it refused.
        code: ExceptionCode,
    },
    /// The unit says that it does not know the function that reads there, and each unit of the family does.
    NoFunction {
        /// Where it was asked.
        place: Place,
        /// How it refused.
        code: ExceptionCode,
    },
    /// The unit answers and refuses what those of these families do; never empty.
    Signature(Vec<Arc<Family>>),
}

impl fmt::Display for Contradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Code { place, word, rows } => {
                write!(f, "the unit reports {word:04X}H at {place}, a code of ")?;
                each(f, rows.iter().map(|row| row.title.as_str()))
            }
            Self::NoAddress { place, code } => {
                write!(f, "the unit refuses {place} (exception {:02X}H: there is no such address)", code.0)
            }
            Self::NoFunction { place, code } => {
                write!(f, "the unit refuses {place} (exception {:02X}H: there is no such function)", code.0)
            }
            Self::Signature(families) => {
                f.write_str("the unit answers and refuses what one of these does: ")?;
                each(f, families.iter().map(|family| family.profile().title()))
            }
        }
    }
}

fn each<'a>(f: &mut fmt::Formatter<'_>, names: impl Iterator<Item = &'a str>) -> fmt::Result {
    for (nth, name) in names.enumerate() {
        write!(f, "{}{name}", if nth == 0 { "" } else { ", " })?;
    }
    Ok(())
}

impl Family {
    /// What among `answers` speaks against this family; `None` if nothing does.
    ///
    /// A code says most: what the unit is, and not only what it is not.
    pub fn contradiction(&self, answers: &[Answer]) -> Option<Contradiction> {
        if !self.is_known_by_something() {
            return None;
        }
        let by_code = answers.iter().find_map(|&answer| self.by_code(answer));
        by_code.or_else(|| answers.iter().find_map(|&answer| self.by_refusal(answer)))
    }

    /// Whether one of its units would hardly give these `answers`, so that it is worth asking what else it may be.
    ///
    /// It is not what speaks against the family: firmwares differ, and so do editions of manuals.
    pub fn is_suspicious(&self, answers: &[Answer]) -> bool {
        self.is_known_by_something() && answers.iter().any(|&answer| self.is_surprised_by(answer))
    }

    /// What speaks against this family where a unit has the signature of each of `shown`.
    pub(crate) fn other_signature<'f>(
        &self,
        shown: impl IntoIterator<Item = &'f Arc<Family>>,
    ) -> Option<Contradiction> {
        let shown: Vec<_> = shown.into_iter().cloned().collect();
        let is_own = |family: &Arc<Family>| self.profile().reports_as().iter().any(|name| name == family.name());
        (!shown.is_empty() && !shown.iter().any(is_own)).then_some(Contradiction::Signature(shown))
    }

    /// Not so of somebody's own that says nothing of how its units are known: they may be anything.
    pub(crate) fn is_known_by_something(&self) -> bool {
        self.profile().role("identification").is_some() || self.signature().is_some() || self.is_shipped()
    }

    fn by_code(&self, answer: Answer) -> Option<Contradiction> {
        let (place, word) = (answer.place, answer.word()?);
        let rows: Vec<_> = self.rows(place, word).collect();
        let is_none = rows.is_empty();
        let is_own = rows.iter().any(|row| codes::is_own(self.profile(), row));
        let rows = || rows.into_iter().cloned().collect();
        (!is_none && !is_own).then(|| Contradiction::Code { place, word, rows: rows() })
    }

    fn by_refusal(&self, answer: Answer) -> Option<Contradiction> {
        let (place, code) = (answer.place, answer.exception()?);
        if !self.must_have(place) {
            return None;
        }
        if place.table != Table::Holding && code == ExceptionCode::ILLEGAL_FUNCTION {
            return Some(Contradiction::NoFunction { place, code });
        }
        self.lacks_address(code).then_some(Contradiction::NoAddress { place, code })
    }

    /// Whether each of its units answers at `place`, by its signature or because its code stands there.
    fn must_have(&self, place: Place) -> bool {
        let is_signed = self.signature().is_some_and(|signature| signature.answers.contains(&place));
        // A row that was only taken over from a sister proves nothing, unless a code is listed that would stand there.
        let is_printed = || {
            let register = self.profile().role("identification");
            register.is_some_and(|entry| entry.evidence() == Evidence::Verified)
        };
        is_signed || self.code_place() == Some(place) && (self.is_listed() || is_printed())
    }

    /// Whether `answer` is not what one of its units says there; what its signature says it refuses, it has not.
    fn is_surprised_by(&self, answer: Answer) -> bool {
        let place = answer.place;
        match answer.said {
            // It has nothing there, as is right, and says so in the words of another family.
            Said::Refused(code) if !self.has(place) => !self.lacks_place(place, code),
            Said::Refused(_) => !self.refuses(place),
            Said::Word(_) if self.refuses(place) => true,
            // A word that no list has for it: another maker keeps his speed there.
            Said::Word(word) if self.codes().places().contains(&place) => !self.is_own(place, word),
            Said::Word(word) => self.state_place() == Some(place) && !self.knows_state(word),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scripted::shipped;

    /// A V20 knows 03H, 06H and 10H, and says 01H to all others: its manual, p. 111. An H100 answers 04H.
    #[test]
    fn that_a_unit_has_no_such_table_is_said_in_two_ways() {
        let (v20, h100) = (shipped("v20"), shipped("h100"));
        let input = Place::new(Table::Input, 0);
        for code in [0x01, 0x02] {
            let refusal = Answer::refusal_of(input, code);
            assert!(!v20.is_suspicious(&[refusal]), "{code}");
            assert!(h100.contradiction(&[refusal]).is_some(), "{code}");
        }
        assert!(v20.is_suspicious(&[Answer::refusal_of(input, 0x04)]));
        assert!(v20.is_suspicious(&[Answer::word_at(input, 0)]));
        assert!(v20.contradiction(&[Answer::word_at(input, 0)]).is_none());
    }
}
