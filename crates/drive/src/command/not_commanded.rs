//! Why a command is not known to be carried out.

use std::fmt;

use drivebus_drives::Command;
use drivebus_rtu::{Instant, UnitAddress};
use thiserror::Error;

use crate::halt::{After, LastLook};
use crate::look::Look;
use crate::ready::NotReady;
use crate::setpoint::NotSet;
use crate::settings::Setting;
use crate::task::{Cause, LineError};
use crate::writing::NotWritten;

/// A unit that is not known to have carried out what moves its motor. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[error("{} of unit {}: {why}", called(*.command), .unit.get())]
#[non_exhaustive]
pub struct NotCommanded<E> {
    /// Which unit.
    pub unit: UnitAddress,
    /// What was sent, or was to be; `None`: a word that can move the motor.
    pub command: Option<Command>,
    /// How many writes of this call the unit took: others than the command itself as well.
    pub parts: u64,
    /// The line's clock when that was found.
    pub found: Instant,
    /// And why.
    pub why: WhyNotCommanded<E>,
}

fn called(command: Option<Command>) -> &'static str {
    command.map_or("a word that can move the motor", Command::name)
}

/// Why a command is not known to be carried out. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WhyNotCommanded<E> {
    /// The drive may not be started.
    #[error("nothing that moves it was sent: {0}")]
    NotReady(NotReady<E>),
    /// The frequency was not given. The command was not sent.
    #[error("its frequency was not given, and it was not sent: {0}")]
    NotSet(NotSet<E>),
    /// One of the words that the family wants before it came to nothing. The command was not sent.
    #[error("it was not sent: {0}")]
    NotLedUp(NotLedUp<E>),
    /// It was not sent: the unit was told to halt meanwhile, or the port changed hands.
    #[error("it was not sent: the unit was told to stop meanwhile, or the port went to another program")]
    Halted(E),
    /// The word that comes before it was sent, and then the unit was told to halt. The rest was not sent.
    #[error("the unit was told to stop when the word before it was sent; the rest of it was not sent")]
    HaltedBetween(Option<E>),
    /// The unit runs and took the word that says which way. The rest was not sent, or it refused that.
    #[error("the motor runs, and the word that says which way was taken; the rest was not: {0}")]
    HalfWritten(NotWritten<E>),
    /// It was not sent, or the unit refused it.
    #[error("{0}")]
    NotWritten(NotWritten<E>),
    /// It was sent, and not confirmed. It was not repeated.
    #[error("it was sent and not confirmed ({last}); {after}. It was not repeated")]
    Unanswered {
        /// What came of it.
        last: E,
        /// What the unit does.
        after: After<E>,
    },
    /// It was refused, and yet the motor turns. It was not repeated.
    #[error("it was refused ({last}), and yet it turns: {look}. It was not repeated")]
    RefusedAndTurns {
        /// The refusal.
        last: E,
        /// What the unit does.
        look: Look,
    },
    /// It was taken, and the port was lost before the state showed it. It was not repeated.
    #[error("it was taken, and the port was lost before the state showed it ({0}). It was not repeated")]
    PortLost(E),
    /// It was taken, and the state does not show it. It was not repeated.
    #[error("it was taken, and the state does not show it: {0}. It was not repeated")]
    Unshown(LastLook<E>),
    /// It was taken and not shown, for the drive does not take commands from the bus.
    #[error("{unshown}; the drive does not take commands from the bus: {}", told(.wrong))]
    Ignored {
        /// Which settings keep it from that.
        wrong: Vec<Setting>,
        /// How it is not shown.
        unshown: Box<Self>,
    },
    /// It was sent, and what it came to could not be looked at, for a reason that says nothing of the unit.
    #[error("it was sent, and could not be looked at: {0}")]
    Unseen(E),
    /// Something was not done, for a reason that says nothing of the unit; or a read failed before anything was sent.
    #[error("{0}")]
    Failed(E),
}

fn told(settings: &[Setting]) -> String {
    settings.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

/// A word that the family wants before a start, which came to nothing. Others before it were taken.
#[derive(Debug)]
pub struct NotLedUp<E> {
    /// Which of the words, counted from 0.
    pub number: usize,
    /// And why.
    pub why: WhyNotLedUp<E>,
}

/// Why a word before a start came to nothing.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WhyNotLedUp<E> {
    /// The unit was told to halt before it was sent.
    #[error("the unit was told to stop before it was sent")]
    HaltedBefore(NotWritten<E>),
    /// The line failed.
    #[error("{0}")]
    NotWritten(NotWritten<E>),
    /// The unit was told to halt when it was sent.
    #[error("the unit was told to stop when it had been sent")]
    Halted,
    /// The drive is in fault since.
    #[error("it is in fault since: {0}")]
    Tripped(Look),
    /// The port was lost.
    #[error("the port was lost when it had been sent ({0})")]
    PortLost(E),
    /// The state does not show it.
    #[error("the state does not show it: {0}")]
    Unshown(LastLook<E>),
}

impl<E: fmt::Display> fmt::Display for NotLedUp<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "of the words before it, number {}: {}", self.number + 1, self.why)
    }
}

impl<E: LineError> WhyNotCommanded<E> {
    /// Whether what moves the motor went out, and the unit did not refuse it: the motor may turn then.
    pub fn may_have_acted(&self) -> bool {
        match self {
            Self::HaltedBetween(_)
            | Self::HalfWritten(_)
            | Self::Unanswered { .. }
            | Self::RefusedAndTurns { .. }
            | Self::PortLost(_)
            | Self::Unshown(_)
            | Self::Ignored { .. }
            | Self::Unseen(_) => true,
            Self::NotLedUp(NotLedUp { number, why }) => *number > 0 || !matches!(why, WhyNotLedUp::HaltedBefore(_)),
            Self::NotWritten(why) => why.was_sent() && !why.cause().is_refusal(),
            Self::NotReady(_) | Self::NotSet(_) | Self::Halted(_) | Self::Failed(_) => false,
        }
    }

    /// As `Unseen`, where what failed is no look that the unit did not answer.
    pub(super) fn unless_of_the_unit(error: E) -> Result<E, Self> {
        match error.cause() {
            Cause::Other | Cause::Halted => Err(Self::Unseen(error)),
            _ => Ok(error),
        }
    }
}
