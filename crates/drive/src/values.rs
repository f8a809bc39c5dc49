//! Values of registers and parameters, read by name in the fewest requests, with everything settled that decides their meaning.

use std::sync::Arc;
use std::time::Duration;

use drivebus_drives::{NameError, Profile, Value};
use thiserror::Error;

use crate::planned::read_planned;
use crate::settled::NotSettled;
use crate::task::{LineError, Mailbox};
use crate::unit::Unit;

/// Values that were read, and when.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Values<V = Value> {
    /// The values, in the order of their names.
    pub values: Vec<V>,
    /// What the words mean, as the drive is set: units and choices are in it.
    pub profile: Arc<Profile>,
    /// When the first was asked for, in Unix time; zero where nothing was.
    pub asked: Duration,
    /// When the last answer was complete.
    pub answered: Duration,
}

/// Why values were not read. The unit was only asked. `E` is the error of whoever drives.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NotRead<E> {
    /// Nothing has that name.
    #[error("{0}")]
    Unknown(NameError),
    /// It may not be read; with the reason.
    #[error("{name} may not be read: {why}")]
    MayNot {
        /// What it was called.
        name: String,
        /// And why not.
        why: String,
    },
    /// Nobody knows what it means.
    #[error("{0}")]
    NotSettled(NotSettled<E>),
    /// The drive has nothing there, and says so by a word.
    #[error("{}; leave {} out", .0, .0.name)]
    Absent(NotThere),
    /// The line failed, or the unit refused.
    #[error("{0}")]
    Failed(E),
}

/// Something that a drive says that it has not.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("the drive has no {name}: it answered {word:04X}H, which says so")]
#[non_exhaustive]
pub struct NotThere {
    /// What it was called.
    pub name: String,
    /// The word by which it says so.
    pub word: u16,
}

impl Unit {
    /// The values of `names`, in their order and in the fewest reads.
    ///
    /// # Errors
    ///
    /// [`NotRead`].
    pub async fn read_values<E: LineError>(&self, line: &Mailbox<E>, names: &[&str]) -> Result<Values, NotRead<E>> {
        let told = self.read_told(line, names).await?;
        let word = told.profile.requests().absent.unwrap_or_default();
        let absent = |name: &str| NotRead::Absent(NotThere { name: name.to_owned(), word });
        let values = names.iter().zip(told.values).map(|(name, value)| value.ok_or_else(|| absent(name)));
        let (profile, asked, answered) = (told.profile, told.asked, told.answered);
        Ok(Values { values: values.collect::<Result<_, _>>()?, profile, asked, answered })
    }

    /// As [`read_values`](Self::read_values), and none of what the drive says that it has not.
    ///
    /// # Errors
    ///
    /// [`NotRead`], but for [`Absent`](NotRead::Absent).
    pub(crate) async fn read_told<E: LineError>(
        &self,
        line: &Mailbox<E>,
        names: &[&str],
    ) -> Result<Values<Option<Value>>, NotRead<E>> {
        for name in names {
            let entry = self.profile().resolve(name).map_err(NotRead::Unknown)?;
            let may_not = |why: String| NotRead::MayNot { name: (*name).to_owned(), why };
            self.rule().read(&entry).map_err(|why| may_not(why.to_string()))?;
        }
        let unit = self.settled(line, names).await.map_err(NotRead::NotSettled)?;
        let profile = unit.profile();
        // They have names, and what may be read can be.
        let entries: Vec<_> = names.iter().filter_map(|name| profile.resolve(name).ok()).collect();
        let plan = profile.compile(&entries.iter().map(AsRef::as_ref).collect::<Vec<_>>()).ok();
        let line = line.taken_for(self.address(), self.family());
        let came = read_planned(plan.as_ref(), &line, self.address(), false).await.map_err(NotRead::Failed)?;
        let values = plan.iter().flat_map(|plan| plan.told(&came.words)).map(|(_, value)| value).collect();
        Ok(Values { values, profile: Arc::clone(profile), asked: came.asked, answered: came.answered })
    }
}

#[cfg(test)]
mod tests;
