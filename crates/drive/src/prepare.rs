//! Setting a drive to obey the bus, and to take a setpoint from it.
//!
//! The profile knows the parameters and the values. A value that no document of the family prints is written only for who
//! says so, and one whose setting does more than that only by its name.

use drivebus_drives::{Input, Setpoint, Store};
use thiserror::Error;

use crate::families::Families;
use crate::parameters::NotKept;
use crate::settings::Setting;
use crate::task::{LineError, Mailbox};
use crate::unit::Unit;

/// Why a drive is not set to obey the bus. `E` is the error of whoever drives.
///
/// But for [`NotKept`](Self::NotKept), [`Unread`](Self::Unread) and [`Unshown`](Self::Unshown), nothing was written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NotPrepared<E> {
    /// The family has no such setpoint that is known.
    #[error("no such setpoint of this family is known")]
    NoSetpoint,
    /// This is set otherwise, and setting it does more than make the drive obey: it is left to who writes it by its name.
    #[error("nothing was written: {0}, which is set by hand: {note}", note = .0.wanted.note)]
    ByHand(Box<Setting>),
    /// This has to be set, and what it is set to may not be used; with the reason, which may be empty.
    #[error("nothing was written: {setting}, which may not be set so: {why}")]
    MayNot {
        /// What has to be set.
        setting: Box<Setting>,
        /// And why that may not be.
        why: String,
    },
    /// What the drive is set to could not be read.
    #[error("{0}")]
    Failed(E),
    /// The unit is not known to have taken it all.
    #[error("{0}")]
    NotKept(NotKept<E>),
    /// It took the values, and what it has then could not be read.
    #[error("it took the values, and what it has now could not be read: {0}")]
    Unread(E),
    /// It took the values, and shows others: all settings as they are then.
    #[error("it took the values, and shows others: {}", told(.0))]
    Unshown(Vec<Setting>),
}

fn told(settings: &[Setting]) -> String {
    let wrong = settings.iter().filter(|setting| !setting.is_right());
    wrong.map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

impl Unit {
    /// Sets the drive to obey the bus, and to take `setpoint` from it, in the order of the profile; to where `store` says, which
    /// for EEPROM is also what was set in RAM before. Only what is set otherwise is written. All settings as they are then.
    ///
    /// # Errors
    ///
    /// [`NotPrepared`].
    pub async fn prepare<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        setpoint: Setpoint,
        store: Store,
    ) -> Result<Vec<Setting>, NotPrepared<E>> {
        // Some families have no frequency setpoint that is known, and can be set to obey commands.
        if setpoint != Setpoint::Frequency && self.register_of(setpoint).is_none() {
            return Err(NotPrepared::NoSetpoint);
        }
        let mut needed = Vec::new();
        for setting in self.control(line, setpoint).await.map_err(NotPrepared::Failed)? {
            if let Some(write) = self.write_of(setting, store)? {
                needed.push(write);
            }
        }
        let unread = if needed.is_empty() { NotPrepared::Failed } else { NotPrepared::Unread };
        if !needed.is_empty() {
            let needed: Vec<_> =
                needed.iter().map(|(code, value)| (code.as_str(), Input::Decimal(value.as_str()))).collect();
            self.write_values(line, families, &needed, store).await.map_err(NotPrepared::NotKept)?;
        }
        let settings = self.control(line, setpoint).await.map_err(unread)?;
        if settings.iter().all(Setting::is_right) { Ok(settings) } else { Err(NotPrepared::Unshown(settings)) }
    }

    /// The write that puts `setting` right, as a code and a value; `None` where it is right, and kept where `store` says.
    fn write_of<E>(&self, setting: Setting, store: Store) -> Result<Option<(String, String)>, NotPrepared<E>> {
        let is_kept = store == Store::Ram || !self.record().is_in_ram(&setting.wanted.code);
        if setting.is_right() && is_kept {
            return Ok(None);
        }
        if setting.actual.is_some() && setting.wanted.by_hand {
            return Err(NotPrepared::ByHand(Box::new(setting)));
        }
        let may_not = |setting, why| Err(NotPrepared::MayNot { setting: Box::new(setting), why });
        let entry = match self.profile().find(&setting.wanted.code) {
            Ok(entry) => entry,
            Err(why) => return may_not(setting, why.to_string()),
        };
        if let Err(why) = self.rule().read(entry) {
            return may_not(setting, why.to_string());
        }
        if setting.actual.is_none() || !(setting.wanted.verified || self.rule().trusts_all()) {
            let why = setting.wanted.note.clone();
            return may_not(setting, why);
        }
        let value = entry.decode(setting.wanted.raw).to_string();
        Ok(Some((setting.wanted.code, value)))
    }
}

#[cfg(test)]
mod tests;
