//! Why a unit is not known to be halted.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use drivebus_drives::Command;
use drivebus_rtu::{Instant, UnitAddress};
use thiserror::Error;

use crate::contradiction::Contradiction;
use crate::family::Family;
use crate::look::Look;
use crate::set_otherwise::SetOtherwise;
use crate::task::{Cause, LineError};

/// A unit that is not known to be halted: its motor may still turn. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[error("{} of unit {} as {}: {why}", .command.name(), .unit.get(), .family.profile().title())]
#[non_exhaustive]
pub struct NotHalted<E> {
    /// Which unit.
    pub unit: UnitAddress,
    /// What it is taken for.
    pub family: Arc<Family>,
    /// What was sent last, or was to be sent.
    pub command: Command,
    /// Whether any halt went out that was not refused, so that the drive may have taken it. Where none did, it goes on as it
    /// was.
    pub was_sent: bool,
    /// The line's clock when that was found.
    pub found: Instant,
    /// And why.
    pub why: Why<E>,
}

/// Why a unit is not known to be halted. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Why<E> {
    /// The command may not be given; with the reason. It was not sent.
    #[error("it was not sent: {0}")]
    MayNot(String),
    /// The unit may be one of several families that want different words, or fits none. Nothing was sent.
    #[error("it was not sent, for it may start the motor: by what it answers the unit may be {}", titles(.families))]
    Undecided {
        /// What was to be sent, by its name.
        wanted: Command,
        /// What it may be.
        families: Vec<Arc<Family>>,
    },
    /// The drive is set to take other words, none of which is known to halt it. Nothing was sent.
    #[error("it was not sent, for it may start the motor: {otherwise}")]
    SetOtherwise {
        /// What was to be sent, by its name.
        wanted: Command,
        /// How it is set.
        otherwise: Box<SetOtherwise>,
    },
    /// The unit speaks, and does not say what it is, in all that time. Nothing was sent.
    #[error("it was not sent, for it may start the motor: the unit is busy, and does not say what it is")]
    Unsaid,
    /// No frame of it went out.
    #[error("it could not be sent ({0})")]
    NotSent(E),
    /// The unit refused it, in all that time.
    #[error("{tries}, and it was not taken, at last: {last}; {after}")]
    Refused {
        /// The last refusal.
        last: E,
        /// How often it was sent.
        tries: Tries,
        /// What the unit does.
        after: After<E>,
    },
    /// It went out, and was not confirmed, in all that time.
    #[error("{tries}, and it was not confirmed ({last}); {after}")]
    Unanswered {
        /// What came of one that went out.
        last: E,
        /// How often it was sent.
        tries: Tries,
        /// What the unit does.
        after: After<E>,
    },
    /// It was taken, by a unit that does not say what it is: by another family it may mean something else.
    #[error("it was taken, and what the unit is could not be asked ({0})")]
    Unasked(E),
    /// It was taken, by a unit that is another one than was halted, and could not be halted as that.
    #[error("it was taken, but {}{then}", .against.as_ref().map(|against| format!("{against}, and ")).unwrap_or_default())]
    Another {
        /// What the unit says against its name, where it was asked for that.
        against: Option<Box<Contradiction>>,
        /// Why it was not halted as what it is.
        then: Box<Self>,
    },
    /// It was taken, and the port was lost before the state showed it.
    #[error("it was taken, and the port was lost before the state showed it ({0})")]
    PortLost(E),
    /// It was taken, and the state does not show it.
    #[error("it was taken, and the state does not show it: {0}")]
    Unshown(LastLook<E>),
    /// Something was not done, for a reason that says nothing of the unit.
    #[error("{0}")]
    Failed(E),
}

/// How often a halt was sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tries {
    /// Each command that was sent, in their order.
    pub told: Vec<Command>,
    /// In how much time.
    pub took: Duration,
    /// How long ago the unit was last heard; `None`: not since it was to be halted.
    pub heard: Option<Duration>,
}

/// What a unit does that did not take a halt.
#[derive(Debug)]
pub enum After<E> {
    /// A look at it shows this. Where nothing of it may be read, that is empty.
    Seen(Look),
    /// Nobody knows.
    Unread(E),
}

/// The last look at a unit that does not show its halt.
#[derive(Debug)]
pub enum LastLook<E> {
    /// It showed this.
    Seen {
        /// What its status words say.
        look: Look,
        /// Its output frequency in Hz where that was seen.
        hz: Option<f64>,
    },
    /// It could not be read.
    Unread(E),
}

impl<E: LineError> Why<E> {
    /// Whether it was taken, and is not proved.
    pub(super) fn is_unproved(&self) -> bool {
        matches!(self, Self::PortLost(_) | Self::Unshown(_))
    }

    /// Whether nothing goes out, whatever the line does.
    pub(super) fn is_forbidden(&self) -> bool {
        match self {
            Self::MayNot(_) | Self::Undecided { .. } | Self::SetOtherwise { .. } => true,
            Self::Failed(error) => matches!(error.cause(), Cause::Other | Cause::Halted),
            _ => false,
        }
    }
}

impl fmt::Display for Tries {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.told.len() {
            1 => f.write_str("it was sent once")?,
            times => write!(f, "it was sent {times} times within {:.1} s", self.took.as_secs_f64())?,
        }
        match self.heard {
            None => f.write_str(", nothing came from the unit at all"),
            Some(ago) => write!(f, ", the last that came from the unit came {:.1} s ago", ago.as_secs_f64()),
        }
    }
}

impl<E: fmt::Display> fmt::Display for After<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Seen(look) => write!(f, "afterwards it shows: {look}"),
            Self::Unread(error) => write!(f, "its state could not be read afterwards either ({error})"),
        }
    }
}

impl<E: fmt::Display> fmt::Display for LastLook<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Seen { look, hz: Some(hz) } => write!(f, "{look}, at {hz} Hz"),
            Self::Seen { look, hz: None } => look.fmt(f),
            Self::Unread(error) => write!(f, "its last answer: {error}"),
        }
    }
}

fn titles(families: &[Arc<Family>]) -> String {
    let titles: Vec<_> = families.iter().map(|family| family.profile().title()).collect();
    if titles.is_empty() { "a drive of another family".to_owned() } else { titles.join(", ") }
}
