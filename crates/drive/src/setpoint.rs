//! The frequency that a drive is to run at: counted as the drive counts it, no more than its own maximum, and written.

use drivebus_drives::{Entry, Setpoint, Value, ValueError};
use thiserror::Error;

use crate::families::Families;
use crate::settled::NotSettled;
use crate::task::{LineError, Mailbox, Payload};
use crate::unit::Unit;
use crate::values::NotRead;
use crate::writing::{NotWritten, Words};

/// Why a frequency was not given. `E` is the error of whoever drives. But for [`NotSet::NotWritten`], nothing was written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NotSet<E> {
    /// No register of the family is known that takes it.
    #[error("no frequency setpoint of this family is known")]
    NoRegister,
    /// Nobody knows in which unit the drive takes it.
    #[error("{0}")]
    NotSettled(NotSettled<E>),
    /// The drive takes it in another unit, which may be empty.
    #[error("the drive takes it in {}, not in Hz", unit_of(.0))]
    NotInHz(String),
    /// It may not be written; with the reason.
    #[error("{0}")]
    MayNot(String),
    /// The drive does not count such a value.
    #[error("{0}")]
    Unfit(ValueError),
    /// It is above the maximum that the drive has.
    #[error("it is above the drive's own maximum, {limit} = {highest} Hz")]
    Above {
        /// The parameter that has the maximum.
        limit: String,
        /// What that is.
        highest: Value,
    },
    /// The maximum of the drive could not be read.
    #[error("{0}")]
    Failed(E),
    /// The unit is not known to have taken it.
    #[error("{0}")]
    NotWritten(NotWritten<E>),
}

fn unit_of(unit: &str) -> &str {
    if unit.is_empty() { "a unit that is not known" } else { unit }
}

impl Unit {
    /// Gives the frequency `hz`, from 0 Hz to the drive's own maximum. A motor that runs follows it at once.
    ///
    /// Whether the drive takes the frequency over the bus is not looked at: a start depends on that, and looks at it.
    ///
    /// # Errors
    ///
    /// [`NotSet`].
    pub async fn set_frequency<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        hz: f64,
    ) -> Result<(), NotSet<E>> {
        let unit = self.counting_frequency(line).await?;
        let word = unit.frequency_word(line, hz).await?;
        unit.write_frequency(line, families, word).await.map_err(NotSet::NotWritten)
    }

    /// The same call, with everything fixed on which the unit of its frequency depends.
    ///
    /// # Errors
    ///
    /// [`NotSet::NoRegister`], [`NotSet::NotSettled`].
    pub async fn counting_frequency<E: LineError>(&self, line: &Mailbox<E>) -> Result<Self, NotSet<E>> {
        let register = self.frequency_register().ok_or(NotSet::NoRegister)?;
        self.settled(line, &[register.name()]).await.map_err(NotSet::NotSettled)
    }

    /// `hz` as the drive counts it, if that is no more than its own maximum.
    ///
    /// # Errors
    ///
    /// [`NotSet`]; the drive was only asked.
    pub async fn frequency_word<E: LineError>(&self, line: &Mailbox<E>, hz: f64) -> Result<u16, NotSet<E>> {
        let register = self.frequency_register().ok_or(NotSet::NoRegister)?;
        let quantity = register.quantity();
        if quantity.unit() != "Hz" {
            return Err(NotSet::NotInHz(quantity.unit().to_owned()));
        }
        self.rule().write(register).map_err(|why| NotSet::MayNot(why.to_string()))?;
        let word = register.encode(hz).map_err(NotSet::Unfit)?;
        let Some(limit) = quantity.high_from() else { return Ok(word) };
        let came = match self.read_values(line, &[limit]).await {
            Ok(came) => came.values,
            Err(NotRead::Unknown(_) | NotRead::MayNot { .. } | NotRead::Absent(_)) => return Ok(word),
            Err(NotRead::NotSettled(why)) => return Err(NotSet::NotSettled(why)),
            Err(NotRead::Failed(error)) => return Err(NotSet::Failed(error)),
        };
        match came.first().copied() {
            Some(highest) if hz > highest.to_f64() => Err(NotSet::Above { limit: limit.to_owned(), highest }),
            _ => Ok(word),
        }
    }

    /// Writes the frequency, as the drive counts it.
    ///
    /// # Errors
    ///
    /// [`NotWritten`].
    pub async fn write_frequency<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        word: u16,
    ) -> Result<(), NotWritten<E>> {
        // Who has counted it has a register of it.
        let Some((register, place)) = self.frequency_register().and_then(|entry| Some((entry, entry.place()?))) else {
            return Ok(());
        };
        let read_back = self.profile().read_back(register).map(|shown| shown.address);
        self.write(line, families, &Words::value(place, Payload::Word(word), read_back)).await
    }

    /// The register that takes the frequency.
    pub(crate) fn frequency_register(&self) -> Option<&Entry> {
        self.register_of(Setpoint::Frequency)
    }
}
