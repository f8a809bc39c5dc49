//! Answers of a unit that is asked what it is, and what the refusals among them tell.

use drivebus_drives::{Means, Place, Profile};
use drivebus_rtu::huanyang::Protocol;
use drivebus_rtu::{ExceptionCode, Meaning, Meanings};

/// What profiles that list their exceptions call the one that says that there is no such address.
const NO_ADDRESS: &str = "illegal_address";

/// How an INVT drive refuses all but the password. Whose unit this is, nobody knows yet.
pub(crate) const LOCKED: ExceptionCode = ExceptionCode(0x09);

/// How a unit answered the question for one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Answer {
    /// Where the word was asked for.
    pub place: Place,
    /// What the unit said.
    pub said: Said,
}

/// What a unit said that was asked for a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Said {
    /// The word, any of 0..=0xFFFF.
    Word(u16),
    /// It refused, with this exception.
    Refused(ExceptionCode),
}

impl Answer {
    /// The unit has `word` at `place`.
    pub fn word_at(place: impl Into<Place>, word: u16) -> Self {
        Self { place: place.into(), said: Said::Word(word) }
    }

    /// The unit refuses `place` with the exception `code`.
    pub fn refusal_of(place: impl Into<Place>, code: u8) -> Self {
        Self { place: place.into(), said: Said::Refused(ExceptionCode(code)) }
    }

    /// The word that came; `None` where it was refused.
    pub const fn word(self) -> Option<u16> {
        match self.said {
            Said::Word(word) => Some(word),
            Said::Refused(_) => None,
        }
    }

    /// The exception by which it was refused; `None` where a word came.
    pub const fn exception(self) -> Option<ExceptionCode> {
        match self.said {
            Said::Word(_) => None,
            Said::Refused(code) => Some(code),
        }
    }

    /// Whether it is a refusal that passes, whatever the unit is: a password locks it, it is busy, or a gateway does not
    /// reach it.
    pub fn passes(self) -> bool {
        self.exception().is_some_and(|code| code == LOCKED || code.meaning() == Meaning::AskAgain)
    }
}

/// Which protocol units of `profile` speak.
pub fn protocol(profile: &Profile) -> Protocol {
    match profile.requests().protocol {
        drivebus_drives::Protocol::Huanyang => Protocol::Huanyang,
        _ => Protocol::Modbus,
    }
}

/// What the exceptions of units of `profile` mean: what the profile says, and of the others what the specification does.
pub fn meanings(profile: &Profile) -> Meanings {
    profile.exceptions().fold(Meanings::STANDARD, |meanings, row| match row.means {
        None => meanings,
        Some(Means::NoSuch) => meanings.with(ExceptionCode(row.code), Meaning::NoSuch),
        Some(Means::NotNow) => meanings.with(ExceptionCode(row.code), Meaning::NotNow),
        Some(Means::AskAgain) => meanings.with(ExceptionCode(row.code), Meaning::AskAgain),
        Some(Means::Taken) => meanings.with(ExceptionCode(row.code), Meaning::Taken),
    })
}

/// Whether a unit of `profile` says by the exception `code` that it has no such address.
pub(crate) fn is_no_such_address(profile: &Profile, code: ExceptionCode) -> bool {
    code == ExceptionCode::ILLEGAL_ADDRESS || profile.exception(code.0).name == NO_ADDRESS
}

#[cfg(test)]
mod tests {
    use super::*;

    /// *Modbus Application Protocol* V1.1b3, §7, and the user password of INVT.
    #[test]
    fn a_refusal_passes_where_it_says_nothing_of_what_the_unit_is() {
        let passing: Vec<u8> = (0..=0xFF).filter(|&code| Answer::refusal_of(0x2100, code).passes()).collect();
        assert_eq!(passing, [0x06, 0x09, 0x0A, 0x0B]);
        assert!(!Answer::word_at(0x2100, 0x0006).passes());
    }
}
