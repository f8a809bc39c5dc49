//! Why values that were to be written are not known to be kept.

use std::fmt;

use drivebus_drives::{AccessError, Entry, NameError, State, Value, ValueError};
use drivebus_rtu::UnitAddress;
use thiserror::Error;

use crate::settled::NotSettled;
use crate::task::{Cause, LineError};
use crate::writing::NotWritten;

/// Values that a unit is not known to have taken, not all of them. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[error("unit {}: {why}{}", .unit.get(), before(.done))]
#[non_exhaustive]
pub struct NotKept<E> {
    /// Which unit.
    pub unit: UnitAddress,
    /// What was written before it, by the names that were given, in their order; what the drive had already is among them.
    pub done: Vec<String>,
    /// How many writes of this call the unit took.
    pub parts: u64,
    /// And why.
    pub why: Box<WhyNotKept<E>>,
}

fn before(done: &[String]) -> String {
    if done.is_empty() { String::new() } else { format!("; written before it: {}", done.join(", ")) }
}

/// Why values are not known to be kept. `E` is the error of whoever drives.
///
/// But for [`Failed`](Self::Failed), [`NotWritten`](Self::NotWritten) and [`NotStored`](Self::NotStored), nothing was written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WhyNotKept<E> {
    /// The profile does not allow one of them.
    #[error("nothing was written: {0}")]
    NotPlanned(NotPlanned),
    /// One of them decides what another one means: it has to be written by itself, and first.
    #[error("nothing was written: {name} decides what {other} means")]
    Decides {
        /// What decides.
        name: String,
        /// What depends on it.
        other: String,
    },
    /// One of them would make the drive another one than it was said to be.
    #[error("nothing was written: {name} would change its {variant}, which was said to be {choice}")]
    Unsays {
        /// What would change it.
        name: String,
        /// What was said of the drive.
        variant: String,
        /// And how that was said to be.
        choice: String,
    },
    /// Nobody knows what one of them means, or what bounds it.
    #[error("nothing was written: {0}")]
    NotSettled(NotSettled<E>),
    /// Some can be written only while the motor stands, and it turns.
    #[error("nothing was written: {} can be written only while it is stopped, and it runs ({})", .names.join(", "), .state.name())]
    Running {
        /// Which ones.
        names: Vec<String>,
        /// What the motor does.
        state: State,
    },
    /// One is beyond another parameter of the drive.
    #[error("nothing was written: {0}")]
    Beyond(Box<Beyond>),
    /// What the drive has could not be read. Of what it was read for, nothing was written.
    #[error("it was not written: {0}")]
    Failed(E),
    /// The unit is not known to have taken one, or several that shared a request.
    #[error("{}: {why}{}", .names.join(", "), shared(.in_force.as_ref()))]
    NotWritten {
        /// What that request was to write.
        names: Vec<String>,
        /// And what came of it.
        why: NotWritten<E>,
        /// What the drive has now, where several shared a request that it refused: it may have taken some of them.
        in_force: Option<InForce<E>>,
    },
    /// The unit has all values, in RAM, and is not known to have stored them.
    #[error("all values are set in RAM, and are not known to be stored by {register}: {why}")]
    NotStored {
        /// What stores them.
        register: String,
        /// And why that came to nothing.
        why: WhyNotStored<E>,
    },
}

/// Why a unit is not known to have stored what was set in RAM. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WhyNotStored<E> {
    /// How the family stores may not be used; with the reason. It was not told to store.
    #[error("it was not told to: {0}")]
    MayNot(String),
    /// What stands in the register could not be read. It was not told to store.
    #[error("it was not told to, for the register could not be read: {0}")]
    Unread(E),
    /// Something else stands in the register, which the word would undo. It was not told to store.
    #[error("it was not told to, for {found:04X}H stands there and not {idle:04X}H")]
    NotIdle {
        /// What stands there.
        found: u16,
        /// What should.
        idle: u16,
    },
    /// It is not known to have taken the word.
    #[error("{0}")]
    NotWritten(NotWritten<E>),
    /// It took the word; whether it is through could not be read.
    #[error("it took the word, and whether it is through could not be read: {0}")]
    Unseen(E),
    /// It took the word, and does not show that it is through: this still stands there.
    #[error("it took the word, and {0:04X}H still stands there")]
    Late(u16),
}

impl<E: LineError> WhyNotStored<E> {
    /// What went wrong.
    pub fn cause(&self) -> Cause {
        match self {
            Self::Unread(error) | Self::Unseen(error) => error.cause(),
            Self::NotWritten(why) => why.cause(),
            Self::MayNot(_) | Self::NotIdle { .. } | Self::Late(_) => Cause::Other,
        }
    }

    /// Whether the word went out: the unit may have stored all then, unless it refused.
    pub fn was_sent(&self) -> bool {
        match self {
            Self::MayNot(_) | Self::Unread(_) | Self::NotIdle { .. } => false,
            Self::NotWritten(why) => why.was_sent(),
            Self::Unseen(_) | Self::Late(_) => true,
        }
    }
}

fn shared<E: fmt::Display>(in_force: Option<&InForce<E>>) -> String {
    in_force.map_or_else(String::new, |told| format!("; {told}"))
}

impl<E: LineError> WhyNotKept<E> {
    /// What went wrong.
    pub fn cause(&self) -> Cause {
        match self {
            Self::NotSettled(NotSettled::Failed(error)) | Self::Failed(error) => error.cause(),
            Self::NotWritten { why, .. } => why.cause(),
            Self::NotStored { why, .. } => why.cause(),
            _ => Cause::Other,
        }
    }

    /// Whether the write that failed went out: the unit may have taken it then, unless it was refused.
    pub fn was_sent(&self) -> bool {
        match self {
            Self::NotWritten { why, .. } => why.was_sent(),
            Self::NotStored { why, .. } => why.was_sent(),
            _ => false,
        }
    }
}

/// What several parameters are, of which a drive refused the request that they shared. `E` is the error of whoever drives.
#[derive(Debug)]
#[non_exhaustive]
pub enum InForce<E> {
    /// These values, in their order.
    Shown(Vec<Held>),
    /// That could not be read.
    Unread(E),
}

impl<E: fmt::Display> fmt::Display for InForce<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shown(held) => {
                write!(f, "in force now: {}", held.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "))
            }
            Self::Unread(error) => write!(f, "what is in force now could not be read: {error}"),
        }
    }
}

/// A register or parameter, and a value of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Held {
    /// Its name, as it was given; or its code.
    pub name: String,
    /// The value.
    pub value: Value,
    /// In which unit that is; may be empty.
    pub unit: String,
}

impl Held {
    /// The `value` of `entry`, by this name.
    pub(crate) fn of(name: &str, entry: &Entry, value: Value) -> Self {
        Self { name: name.to_owned(), value, unit: entry.quantity().unit().to_owned() }
    }
}

impl fmt::Display for Held {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let space = if self.unit.is_empty() { "" } else { " " };
        write!(f, "{} = {}{space}{}", self.name, self.value, self.unit)
    }
}

/// A value that another parameter of the drive forbids.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{wanted} is {} {limit}", if *.is_below { "below" } else { "above" })]
#[non_exhaustive]
pub struct Beyond {
    /// What was to be written.
    pub wanted: Held,
    /// What forbids it, as the drive has it, or would have it by what comes before in the same call.
    pub limit: Held,
    /// Whether it is below that; else it is above.
    pub is_below: bool,
}

/// A write that the profile does not allow. Nothing was sent.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{name}: {why}")]
#[non_exhaustive]
pub struct NotPlanned {
    /// What was to be written, as it was called.
    pub name: String,
    /// And why it may not be.
    pub why: Box<WhyNotPlanned>,
}

impl NotPlanned {
    pub(super) fn of(name: &str, why: WhyNotPlanned) -> Self {
        Self { name: name.to_owned(), why: Box::new(why) }
    }
}

/// Why the profile does not allow a write.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum WhyNotPlanned {
    /// Nothing has that name.
    #[error("{0}")]
    Unknown(NameError),
    /// It can only be read.
    #[error("it can only be read")]
    ReadOnly,
    /// It can move the motor, and is no value.
    #[error("it can move the motor, and is written as a command alone")]
    Moves,
    /// It stores all that was set, and is no value.
    #[error("it stores all that was set, and is written behind what is to be stored")]
    Stores,
    /// It may not be written; with the reason.
    #[error("it may not be written: {0}")]
    MayNot(String),
    /// No way to write it to RAM alone is known, and every other may wear EEPROM.
    #[error("no way to write it to RAM alone is known, and every other may wear EEPROM")]
    OnlyStored,
    /// The drive does not count such a value.
    #[error("{0}")]
    Unfit(ValueError),
    /// Nothing that is printed tells whether it takes this word.
    #[error("whether it takes {0} is not printed")]
    NoRange(u32),
    /// It cannot be written to where it was to be kept.
    #[error("{0}")]
    NoPlace(AccessError),
    /// How the family keeps parameters there may not be used; with the reason.
    #[error("how it is kept there may not be used: {0}")]
    MayNotKeep(String),
}
