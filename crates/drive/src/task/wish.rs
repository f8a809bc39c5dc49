//! What an operation wants done.

use std::fmt;
use std::time::Duration;

use drivebus_drives::Place;
use drivebus_rtu::UnitAddress;

use super::Outcome;

/// What an operation wants done before it goes on.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Wish {
    /// Words of a unit.
    Read(Read),
    /// Time, on the line's clock.
    Sleep(Duration),
}

impl Wish {
    /// Whether `outcome` may come of it.
    pub(super) fn is_met_by<E>(&self, outcome: &Outcome<E>) -> bool {
        match (self, outcome) {
            (_, Outcome::Failed(_)) | (Self::Sleep(_), Outcome::Slept) => true,
            (Self::Read(read), Outcome::Words(words)) => !read.is_stamped && read.takes(words),
            (Self::Read(read), Outcome::Stamped(stamped)) => read.is_stamped && read.takes(&stamped.words),
            _ => false,
        }
    }
}

impl fmt::Display for Wish {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read(read) => read.fmt(f),
            Self::Sleep(time) => write!(f, "{time:?} of the line's clock"),
        }
    }
}

/// A read of words, or of bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Read {
    /// Who is asked.
    pub unit: UnitAddress,
    /// Where the first of them is.
    pub place: Place,
    /// How many: 1..=125 words, or 1..=2000 bits.
    pub count: u16,
    /// Before all who wait for the line.
    pub is_urgent: bool,
    /// Whether it counts when that was.
    pub is_stamped: bool,
    /// How long this read alone waits for its answer; `None` is what the line has.
    pub timeout: Option<Duration>,
    /// How often this read alone is repeated; `None` is what the line has.
    pub retries: Option<u32>,
}

impl Read {
    /// A read of the word of `unit` at `place`, as the line reads.
    pub const fn word(unit: UnitAddress, place: Place) -> Self {
        Self::words(unit, place, 1)
    }

    /// A read of `count` words of `unit` from `place` on, as the line reads.
    pub const fn words(unit: UnitAddress, place: Place, count: u16) -> Self {
        Self { unit, place, count, is_urgent: false, is_stamped: false, timeout: None, retries: None }
    }

    /// The same before all who wait for the line, where that is so.
    #[must_use]
    pub const fn urgent(self, is_urgent: bool) -> Self {
        Self { is_urgent, ..self }
    }

    /// The same, asked once and given no longer than `timeout`.
    #[must_use]
    pub const fn once_within(self, timeout: Duration) -> Self {
        Self { timeout: Some(timeout), retries: Some(0), ..self }
    }

    /// Whether `words` are as many as it asks for.
    fn takes(&self, words: &[u16]) -> bool {
        words.len() == usize::from(self.count)
    }
}

impl fmt::Display for Read {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { unit, place, count, .. } = self;
        match count {
            1 => write!(f, "a read of {place} of unit {}", unit.get()),
            _ => write!(f, "a read of {count} from {place} of unit {}", unit.get()),
        }
    }
}

/// The words of a read, and when that was, in Unix time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stamped {
    /// The words, as many as were asked for.
    pub words: Vec<u16>,
    /// When the request had left.
    pub asked: Duration,
    /// When the answer was complete.
    pub answered: Duration,
}
