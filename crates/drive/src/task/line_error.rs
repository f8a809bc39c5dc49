//! What an operation has to know of an error of the line, whoever's error that is.

use drivebus_rtu::{ExceptionCode, Meaning};

/// An error of whoever drives a task, as operations look at it.
pub trait LineError {
    /// What went wrong.
    fn cause(&self) -> Cause;

    /// All that came; empty where nothing did.
    fn raw(&self) -> &[u8];

    /// Whether the request went out: what it was to do may have been done then, unless it was refused.
    fn was_sent(&self) -> bool;
}

/// What went wrong with a wish.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Cause {
    /// The unit stayed silent.
    NoAnswer,
    /// Bytes came, and no valid answer.
    BadAnswer,
    /// The unit refused, by this exception, which means that for it.
    Refused(ExceptionCode, Meaning),
    /// The port was lost, or is closed.
    Port,
    /// The unit was told to halt since this was decided on, or the port changed hands: nothing was sent.
    Halted,
    /// It was not done, for a reason that says nothing of the unit.
    Other,
}

impl Cause {
    /// Whether no answer came that counts, while the port stayed: silence, or bytes that are none.
    pub const fn is_no_answer(self) -> bool {
        matches!(self, Self::NoAnswer | Self::BadAnswer)
    }

    /// Whether the unit refused.
    pub const fn is_refusal(self) -> bool {
        matches!(self, Self::Refused(..))
    }

    /// Whether the line failed: the unit did not say anything that counts.
    pub const fn is_of_the_line(self) -> bool {
        self.is_no_answer() || matches!(self, Self::Port)
    }
}
