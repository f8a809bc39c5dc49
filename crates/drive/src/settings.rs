//! Whether a drive is set to obey the bus, and to heed what the bus tells it.

use std::fmt;

use drivebus_drives::{Control, Entry, Setpoint, Value};

use crate::task::{LineError, Mailbox};
use crate::unit::Unit;
use crate::wanted::{needs_of, wanted_for, wanted_of_commands};

/// A parameter that must have a certain value, and what it has.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Setting {
    /// What it must be.
    pub wanted: Control,
    /// What it is; `None` where it may not be read.
    pub actual: Option<Value>,
}

impl Setting {
    /// Whether it is as it must be.
    pub fn is_right(&self) -> bool {
        self.actual.is_some_and(|value| value.count() == i64::from(self.wanted.raw))
    }

    /// Whether it is known to be otherwise.
    pub fn is_wrong(&self) -> bool {
        self.actual.is_some() && !self.is_right()
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { wanted: Control { code, raw, label, .. }, actual } = self;
        match actual {
            Some(value) => write!(f, "{code} is {value}, and must be {raw} ({label})"),
            None => write!(f, "{code} must be {raw} ({label}), and may not be read"),
        }
    }
}

impl Unit {
    /// Whether the drive is set to obey the bus, and to take `setpoint` from it: each setting in the order in which to set it.
    /// What may not be read has no actual value.
    ///
    /// # Errors
    ///
    /// Those of the line; the drive was only asked.
    pub async fn control<E: LineError>(&self, line: &Mailbox<E>, setpoint: Setpoint) -> Result<Vec<Setting>, E> {
        let wanted = wanted_for(self.profile(), setpoint).into_iter().cloned().collect();
        self.settings(line, wanted).await
    }

    /// Whether the drive heeds `setpoint`: what must be set for that alone.
    ///
    /// # Errors
    ///
    /// Those of [`control`](Self::control).
    pub async fn heeds<E: LineError>(&self, line: &Mailbox<E>, setpoint: Setpoint) -> Result<Vec<Setting>, E> {
        self.settings(line, needs_of(self.profile(), setpoint).to_vec()).await
    }

    /// All that `setpoint` needs, where not each of it is known to be as it must be: then the drive would ignore it.
    pub(crate) async fn unheeded<E: LineError>(
        &self,
        line: &Mailbox<E>,
        setpoint: Setpoint,
    ) -> Result<Option<Vec<Setting>>, E> {
        let settings = self.heeds(line, setpoint).await?;
        Ok((!settings.iter().all(Setting::is_right)).then_some(settings))
    }

    /// Which settings keep the drive from taking commands from the bus; none where none is known to, or none tells.
    pub(crate) async fn ignores_commands<E: LineError>(&self, line: &Mailbox<E>) -> Result<Vec<Setting>, E> {
        let wanted = self.sure(wanted_of_commands(self.profile()));
        match self.settings(line, wanted).await {
            Ok(settings) => Ok(settings.into_iter().filter(Setting::is_wrong).collect()),
            Err(error) if error.cause().is_of_the_line() || error.cause().is_refusal() => Ok(Vec::new()),
            Err(error) => Err(error),
        }
    }

    /// Those of `wanted` that are surely not as they must be. What no document proves, or may not be read, keeps nobody from
    /// starting a motor.
    pub(crate) async fn wrong<E: LineError>(&self, line: &Mailbox<E>, wanted: Vec<Control>) -> Result<Vec<Setting>, E> {
        let mut settings = self.settings(line, self.sure(wanted)).await?;
        settings.retain(Setting::is_wrong);
        Ok(settings)
    }

    fn sure(&self, mut wanted: Vec<Control>) -> Vec<Control> {
        wanted.retain(|row| self.is_sure(row));
        wanted
    }

    /// Whether a start depends on it.
    pub(crate) fn is_sure(&self, row: &Control) -> bool {
        row.verified || self.rule().trusts_all()
    }

    /// What each of `wanted` is.
    async fn settings<E: LineError>(&self, line: &Mailbox<E>, wanted: Vec<Control>) -> Result<Vec<Setting>, E> {
        let rule = self.rule();
        let entry_of = |row: &Control| self.profile().find(&row.code).ok().filter(|entry| rule.read(entry).is_ok());
        let entries: Vec<Option<&Entry>> = wanted.iter().map(entry_of).collect();
        let readable: Vec<_> = entries.iter().copied().flatten().collect();
        let mut values = if readable.is_empty() { Vec::new() } else { self.values(line, &readable).await? }.into_iter();
        let pairs = wanted.into_iter().zip(entries);
        let actual = |row: &Control, entry: &Entry, value: Value| match row.bits {
            None => value,
            // A word of bits has all of them.
            Some(_) => entry.decode(row.found(value.word())),
        };
        let setting = |(wanted, entry): (Control, Option<&Entry>)| Setting {
            actual: entry.and_then(|entry| values.next().map(|value| actual(&wanted, entry, value))),
            wanted,
        };
        Ok(pairs.map(setting).collect())
    }
}
