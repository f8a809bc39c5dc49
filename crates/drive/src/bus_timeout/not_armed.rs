//! Why a drive's own time-out of the bus is not set, not known to be set, or not given back.

use std::fmt;

use drivebus_drives::{Value, ValueError};
use drivebus_rtu::UnitAddress;
use thiserror::Error;

use super::OnSilence;
use crate::parameters::{Held, NotKept};
use crate::task::LineError;
use crate::values::NotRead;

/// A time-out of the bus that a family does not have, or that may not be set. Nothing was sent.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum NotArmable {
    /// No time-out of the family is known.
    #[error("no time-out of the bus of this family is known")]
    NoTimeout,
    /// No way to write this parameter to RAM alone is known, and what is set again and again must not wear EEPROM.
    #[error("no way to write {0} to RAM alone is known, and what is set each time must not wear EEPROM")]
    OnlyStored(String),
    /// Documents of the family do not print it, or not all of it; with why, which may be empty.
    #[error("no document of this family proves its time-out of the bus{}", because(.0))]
    NotPrinted(String),
    /// The drive does not wait for so long, or does not act at all then.
    #[error("a time-out of {seconds} s is out of range; allowed is more than 0{}", to(.high.as_ref()))]
    OutOfRange {
        /// The seconds that were wanted.
        seconds: f64,
        /// The longest time-out, in seconds; `None` where that is not known.
        high: Option<Value>,
    },
    /// The drive does not count such a time.
    #[error("{0}")]
    Unfit(ValueError),
    /// It cannot do that by itself.
    #[error("it cannot {} by itself; it can {}", .action.name(), names(.known))]
    NoAction {
        /// What it was to do.
        action: OnSilence,
        /// What it can do.
        known: Vec<OnSilence>,
    },
}

fn because(why: &str) -> String {
    match why.trim_end() {
        "" => String::new(),
        why => format!(": {why}"),
    }
}

fn to(high: Option<&Value>) -> String {
    high.map_or_else(String::new, |high| format!(" to {high}"))
}

fn names(known: &[OnSilence]) -> String {
    known.iter().map(|action| action.name()).collect::<Vec<_>>().join(", ")
}

/// A time-out of the bus that a unit is not known to have. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[error("unit {}: {why}{back}", .unit.get())]
#[non_exhaustive]
pub struct NotArmed<E> {
    /// Which unit.
    pub unit: UnitAddress,
    /// How many writes of it the unit took.
    pub parts: u64,
    /// Why it is not known.
    pub why: Box<WhyNotArmed<E>>,
    /// What the unit has now.
    pub back: Back<E>,
}

impl<E: LineError> NotArmed<E> {
    /// Whether the unit may have some of it: then it acts when it hears nothing.
    pub fn may_be_set(&self) -> bool {
        matches!(self.back, Back::NotGiven(_)) && (self.parts > 0 || self.why.was_sent())
    }
}

/// Why a time-out of the bus is not known to be set. `E` is the error of whoever drives.
#[derive(Debug)]
#[non_exhaustive]
pub enum WhyNotArmed<E> {
    /// What it has could not be read. Nothing was written.
    Unread(NotRead<E>),
    /// It is not known to have taken it.
    NotKept(NotKept<E>),
    /// It took it, and what it has then could not be read.
    Unshown(NotRead<E>),
    /// It took it, and shows something else.
    Others(Vec<Held>),
}

impl<E: fmt::Display> fmt::Display for WhyNotArmed<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unread(why) => write!(f, "what it has could not be read: {why}"),
            // It names the unit once more.
            Self::NotKept(error) => error.why.fmt(f),
            Self::Unshown(why) => write!(f, "it took its time-out, and what it has then could not be read: {why}"),
            Self::Others(held) => {
                let shown: Vec<_> = held.iter().map(ToString::to_string).collect();
                write!(f, "it took its time-out, and shows {}", shown.join(", "))
            }
        }
    }
}

impl<E: LineError> WhyNotArmed<E> {
    /// Whether what failed went out, or anything before it.
    fn was_sent(&self) -> bool {
        match self {
            Self::Unread(_) => false,
            Self::NotKept(error) => error.parts > 0 || error.why.was_sent(),
            Self::Unshown(_) | Self::Others(_) => true,
        }
    }
}

/// What a unit has after its time-out of the bus was not set. `E` is the error of whoever drives.
#[derive(Debug)]
#[non_exhaustive]
pub enum Back<E> {
    /// What it had: nothing was written.
    Untouched,
    /// What it had, which was given back.
    Given,
    /// That could not be given back: it may have some of what was to be set.
    NotGiven(NotKept<E>),
}

impl<E: fmt::Display> fmt::Display for Back<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Untouched => Ok(()),
            Self::Given => f.write_str("; it has back what it had"),
            Self::NotGiven(error) => write!(f, "; what it had could not be given back: {}", error.why),
        }
    }
}

/// Why a drive was not given back what it had: it keeps its time-out of the bus, or some of it, and acts when it hears nothing.
/// `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NotGivenBack<E> {
    /// Whether its motor turns may not be asked; with the reason.
    #[error("whether its motor turns must be seen: {0}")]
    Unseen(String),
    /// That could not be asked.
    #[error("{0}")]
    Failed(E),
    /// It is not known to have taken what it had.
    #[error("{0}")]
    NotKept(NotKept<E>),
}

/// A question by which a drive was to be kept from acting, and which did not come to an answer. `E` is the error of whoever
/// drives.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct NotAsked<E> {
    /// What went wrong; `None` where nothing of the drive may be read.
    pub why: Option<E>,
    /// Whether asking again makes no sense: the line was closed for good.
    pub is_over: bool,
}

impl<E: fmt::Display> fmt::Display for NotAsked<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.why {
            Some(error) => error.fmt(f),
            None => f.write_str("nothing is known that it answers"),
        }
    }
}

impl<E: fmt::Debug + fmt::Display> std::error::Error for NotAsked<E> {}
