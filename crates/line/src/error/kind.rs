//! Errors by whose fault they are: the names that every language has for them, and whether the unit may have acted.

use drivebus_rtu::{FrameError, Meaning};

use crate::error::{CallError, Failure};

/// Whose fault an error is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The port: not found, busy, not permitted, lost or closed. It is opened again by itself at the next call.
    Port,
    /// The unit stayed silent.
    NoAnswer,
    /// Bytes came, but no valid answer to what was asked.
    BadAnswer,
    /// The bytes that came do not match their own CRC: a [`BadAnswer`](Self::BadAnswer) too.
    Crc,
    /// The unit answered by an exception. What it was doing before, it still does, unless that is an acknowledgement
    /// ([`Meaning::Taken`]).
    Refused,
    /// What was asked was sent, and its effect is not known.
    Unconfirmed,
    /// Nothing was sent: out of range, read-only, an unknown name, no room in the queue, a unit that is being stopped or was told to.
    NotAllowed,
}

impl Failure {
    /// Whose fault it is, where no bytes came.
    pub fn kind(&self) -> ErrorKind {
        self.kind_of(false)
    }

    /// Whether settings of the port that are not the units' bring it about.
    pub(crate) fn may_be_the_ports(&self) -> bool {
        matches!(self, Self::NoAnswer { .. } | Self::Corrupt(_) | Self::Wrong(_))
    }

    fn kind_of(&self, came: bool) -> ErrorKind {
        match self {
            Self::Port(_) | Self::Reopened | Self::Forked | Self::Closed => ErrorKind::Port,
            Self::NotBegun(_)
            | Self::ReadOnly { .. }
            | Self::NotARead { .. }
            | Self::NotSpoken { .. }
            | Self::QueueFull { .. }
            | Self::BeingStopped { .. }
            | Self::Halted { .. } => ErrorKind::NotAllowed,
            Self::Doubtful | Self::NotAsked { .. } | Self::Unreached => ErrorKind::NoAnswer,
            Self::NotTaken { .. } | Self::Limited { .. } | Self::Acknowledged { .. } => ErrorKind::Unconfirmed,
            Self::NoAnswer { .. } if !came => ErrorKind::NoAnswer,
            Self::Corrupt(FrameError::Crc { .. }) => ErrorKind::Crc,
            Self::Refused { .. } => ErrorKind::Refused,
            Self::Elsewhere { kind, .. } => *kind,
            // A line that is never silent is full of bytes that are no answer.
            _ => ErrorKind::BadAnswer,
        }
    }
}

impl CallError {
    /// Whose fault it is.
    pub fn kind(&self) -> ErrorKind {
        self.failure.kind_of(!self.raw.is_empty())
    }

    /// Whether the unit may have done what was asked: the request went out, and the unit did not refuse it. One that
    /// acknowledges by an exception (05H by the specification) may have.
    pub fn may_have_acted(&self) -> bool {
        let refused = match self.failure {
            Failure::Refused { code, .. } => code.meaning() != Meaning::Taken,
            Failure::Unheard { .. } => true,
            _ => false,
        };
        self.sent.is_some() && !refused
    }
}
