//! What a drive does at one moment: its status words, and how fast its motor turns and shall turn.

use std::fmt;
use std::time::Duration;

use drivebus_drives::Entry;

use crate::look::Look;
use crate::task::{LineError, Mailbox};
use crate::unit::Unit;
use crate::values::NotRead;

/// What a drive does at one moment. Frequencies are in the unit in which the drive tells them, whichever way the motor turns.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Status {
    /// What its status words say.
    pub look: Look,
    /// At the output; `None` where the drive does not tell it.
    pub frequency: Option<f64>,
    /// The setpoint in force; `None` where the drive does not tell it.
    pub setpoint: Option<f64>,
    /// When the first of it was asked for, in Unix time; zero where nothing was.
    pub asked: Duration,
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.look.fmt(f)?;
        match (self.frequency, self.setpoint) {
            (Some(frequency), Some(setpoint)) => write!(f, ", {frequency:.2} of {setpoint:.2}"),
            (Some(frequency), None) => write!(f, ", {frequency:.2}"),
            (None, _) => Ok(()),
        }
    }
}

impl Unit {
    /// What the drive does: its status words, and then the frequencies, each in the fewest reads. What it does not tell, or
    /// what may not be read, is left out.
    ///
    /// # Errors
    ///
    /// [`NotRead`].
    pub async fn status<E: LineError>(&self, line: &Mailbox<E>) -> Result<Status, NotRead<E>> {
        let look = self.look(line).await.map_err(NotRead::Failed)?;
        let of_role = |role| self.profile().role(role).filter(|entry| self.rule().read(entry).is_ok());
        let told = ["frequency", "setpoint"].map(|role| of_role(role).map(Entry::name));
        let names: Vec<_> = told.into_iter().flatten().collect();
        let values = self.read_told(line, &names).await?;
        // The state tells the direction; some families have it in the sign as well.
        let mut came = values.values.iter().map(|value| value.map(|value| value.to_f64().abs()));
        let [frequency, setpoint] = told.map(|name| name.and_then(|_| came.next().flatten()));
        let asked = if self.is_blind() { values.asked } else { look.asked };
        Ok(Status { look, frequency, setpoint, asked })
    }
}

#[cfg(test)]
mod tests;
