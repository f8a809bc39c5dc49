//! What a drive is given over the bus besides its frequency: torque, PID, limits, analog outputs.
//!
//! Each is a register that the profile names. A drive that takes it from elsewhere ignores it, so its source is looked at
//! before.

use drivebus_drives::{Entry, Input, Setpoint, Store};
use thiserror::Error;

use crate::families::Families;
use crate::parameters::WhyNotKept;
use crate::settings::Setting;
use crate::task::{LineError, Mailbox};
use crate::unit::Unit;

/// Why a setpoint was not given. `E` is the error of whoever drives. But for [`NotGiven::NotKept`], nothing was written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NotGiven<E> {
    /// No register of the family is known that takes it.
    #[error("no such setpoint of this family is known")]
    NoRegister,
    /// The drive takes it from elsewhere, or is not known to take it from the bus: all that it needs for that.
    #[error("the drive would ignore it: {}", told(.0))]
    Ignored(Vec<Setting>),
    /// What the drive is set to could not be read.
    #[error("{0}")]
    Failed(E),
    /// It may not be given, or the unit is not known to have taken it.
    #[error("{0}")]
    NotKept(Box<WhyNotKept<E>>),
}

fn told(settings: &[Setting]) -> String {
    settings.iter().filter(|setting| !setting.is_right()).map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

impl Unit {
    /// Gives `setpoint` the `value`, in the unit of its register, if the drive would follow it. A running motor follows it at
    /// once. [`set_frequency`](Self::set_frequency) gives a frequency to a drive that a start looks at.
    ///
    /// # Errors
    ///
    /// [`NotGiven`].
    pub async fn give_setpoint<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        setpoint: Setpoint,
        value: Input<'_>,
    ) -> Result<(), NotGiven<E>> {
        let not_kept = |why| NotGiven::NotKept(Box::new(why));
        let name = self.register_of(setpoint).map(Entry::name).ok_or(NotGiven::NoRegister)?;
        let settled = self.settled(line, &[name]).await;
        let unit = settled.map_err(|why| not_kept(WhyNotKept::NotSettled(why)))?;
        let planned = unit.plan(name, value, Store::Ram);
        let planned = [planned.map_err(|why| not_kept(WhyNotKept::NotPlanned(why)))?];
        if let Some(settings) = unit.unheeded(line, setpoint).await.map_err(NotGiven::Failed)? {
            return Err(NotGiven::Ignored(settings));
        }
        unit.check_now(line, &planned).await.map_err(not_kept)?;
        let mut done = Vec::new();
        unit.keep(line, families, &planned, Store::Ram, &mut done).await.map_err(not_kept)
    }
}

#[cfg(test)]
mod tests;
