//! Which words a unit takes, where a parameter of its drive decides that: those of its profile, or those of another one of the
//! drive's own.
//!
//! In another control profile the word that stops may start. So what decides is read at the first contact, beside what the unit is,
//! before any word that may move the motor, a halt too. A unit that does not say is taken for one with the words of its profile:
//! silence is no evidence.

use std::fmt;

use drivebus_drives::{Command, Control, Entry, Place};
use drivebus_rtu::UnitAddress;

use crate::answer::{Answer, Said};
use crate::asked::answer_once;
use crate::family::Family;
use crate::task::{LineError, Mailbox, Read};

/// A parameter of a drive that gives the words of commands another meaning.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct SetOtherwise {
    /// The parameter, and what it must be.
    pub wanted: Control,
    /// What it holds.
    pub raw: u16,
}

impl SetOtherwise {
    /// The word that does what `command`, which halts, is for; `None` where none is known.
    pub fn halt(&self, command: Command) -> Option<u16> {
        self.wanted.other_words(self.raw).and_then(|words| words.halt(command))
    }

    /// What is known of the words that it takes; empty where that is nothing.
    pub fn means(&self) -> &str {
        self.wanted.other_words(self.raw).map_or("", |words| words.means.as_str())
    }
}

impl fmt::Display for SetOtherwise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { wanted: Control { code, raw, label, .. }, raw: found } = self;
        write!(f, "{code} is {found}")?;
        match self.means() {
            "" => f.write_str(", with which its command words may mean something else")?,
            means => write!(f, " ({means})")?,
        }
        write!(f, ", and must be {raw} ({label})")
    }
}

/// Which words a unit takes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Dialect {
    /// Those of its profile, as far as it tells.
    Own,
    /// Others.
    Other(Box<SetOtherwise>),
    /// It is busy, and does not say yet.
    Untold,
}

impl Family {
    /// The parameters that decide which words its units take.
    pub(crate) fn deciding(&self) -> impl Iterator<Item = (Place, &Control)> {
        let rows = self.profile().control().iter().filter(|row| row.decides_words());
        rows.filter_map(|row| Some((self.profile().find(&row.code).ok().and_then(Entry::place)?, row)))
    }

    /// Whether a parameter decides which words its units take.
    pub(crate) fn has_dialects(&self) -> bool {
        self.deciding().next().is_some()
    }

    /// What the `answer` of one of its units says of the words that it takes; `None` where it says nothing of it.
    pub(crate) fn dialect_by(&self, row: &Control, answer: Answer) -> Option<Dialect> {
        match answer.said {
            Said::Word(raw) if row.keeps_words(raw) => None,
            Said::Word(raw) => Some(Dialect::Other(Box::new(SetOtherwise { wanted: row.clone(), raw }))),
            Said::Refused(_) if self.is_put_off_by(answer) => Some(Dialect::Untold),
            // It has no such parameter, or does not let it be read.
            Said::Refused(_) => None,
        }
    }
}

/// Which words the `unit` takes, taken for one of `family`: each question as `how` makes it.
///
/// # Errors
///
/// What whoever drives made of a question, but for a refusal.
pub(crate) async fn dialect<E: LineError>(
    line: &Mailbox<E>,
    unit: UnitAddress,
    family: &Family,
    how: impl Fn(Read) -> Read,
) -> Result<Dialect, E> {
    for (place, row) in family.deciding() {
        let answer = answer_once(line, how(Read::word(unit, place))).await?;
        if let Some(dialect) = family.dialect_by(row, answer) {
            return Ok(dialect);
        }
    }
    Ok(Dialect::Own)
}
