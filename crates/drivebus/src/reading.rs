//! Values by name: planned once into the fewest reads, and worked out of the words that come.

use std::sync::Arc;

use drivebus_drives::{Evidence, Place, Profile, ReadPlan, Value};
use drivebus_line::ErrorKind;

use crate::error::Error;

/// Registers and parameters of one family that are read together, planned once.
///
/// Clones share the plan.
#[derive(Debug, Clone)]
pub struct Reading(Arc<Planned>);

#[derive(Debug)]
struct Planned {
    plan: ReadPlan,
    names: Vec<Names>,
}

/// What one value is called.
#[derive(Debug)]
struct Names {
    name: String,
    /// As the program asked for it.
    asked: String,
    unit: String,
}

impl Reading {
    /// Plans to read `names` of `profile`: names of registers, codes of parameters (`P00.03`), or addresses (`0x3004`).
    ///
    /// # Errors
    ///
    /// [`NotAllowed`](ErrorKind::NotAllowed): a name is unknown (the closest is named), cannot be read, or no
    /// document of the family proves it: then [`unverified`](Self::unverified) reads it all the same.
    pub fn new<'a>(profile: &Profile, names: impl IntoIterator<Item = &'a str>) -> Result<Self, Error> {
        Self::plan(profile, names, false)
    }

    /// As [`new`](Self::new), also for what no document of the family proves.
    ///
    /// # Errors
    ///
    /// Those of [`new`](Self::new), but for the proof.
    pub fn unverified<'a>(profile: &Profile, names: impl IntoIterator<Item = &'a str>) -> Result<Self, Error> {
        Self::plan(profile, names, true)
    }

    fn plan<'a>(profile: &Profile, names: impl IntoIterator<Item = &'a str>, unverified: bool) -> Result<Self, Error> {
        let (mut entries, mut all) = (Vec::new(), Vec::new());
        for asked in names {
            let entry = profile.resolve(asked)?;
            if entry.evidence() == Evidence::Assumed && !unverified {
                let (name, label, note) = (entry.name(), entry.label(), entry.note());
                let message = format!("reading {name} ({label}) is not verified: {note}; nothing was sent");
                return Err(Error::not_allowed(message));
            }
            all.push(Names {
                name: entry.name().to_owned(),
                asked: asked.to_owned(),
                unit: entry.quantity().unit().to_owned(),
            });
            entries.push(entry);
        }
        if entries.is_empty() {
            return Err(Error::not_allowed("there is nothing to read: give at least one name"));
        }
        Ok(Self(Arc::new(Planned {
            plan: profile.compile(&entries.iter().map(AsRef::as_ref).collect::<Vec<_>>())?,
            names: all,
        })))
    }

    /// What is read, in this order: address and number of words.
    pub fn reads(&self) -> impl Iterator<Item = (u16, u16)> {
        self.spans().map(|(place, count)| (place.address, count))
    }

    /// The same with the table of each.
    pub(crate) fn spans(&self) -> impl Iterator<Item = (Place, u16)> {
        self.0.plan.reads().iter().map(|read| (read.place(), read.count))
    }

    /// How many words all reads bring.
    pub fn words(&self) -> usize {
        self.0.plan.words()
    }

    /// The values in `words`, which holds those of all reads, one read after the other. A value whose word is missing is
    /// missing too, and one of which the drive says that it has it not.
    pub fn values(&self, words: &[u16]) -> Values {
        let values = self.0.plan.told(words).map(|(_, value)| value).collect();
        Values { planned: Arc::clone(&self.0), values }
    }
}

/// Values that were read together.
#[derive(Debug, Clone)]
pub struct Values {
    planned: Arc<Planned>,
    values: Vec<Option<Value>>,
}

impl Values {
    /// The value with this name, as it was asked for or as the profile calls it.
    pub fn get(&self, name: &str) -> Option<Value> {
        let called = |names: &Names| names.name == name || names.asked == name;
        let place = self.planned.names.iter().position(called)?;
        self.values.get(place).copied().flatten()
    }

    /// The only one.
    pub(crate) fn only(&self) -> Result<Value, Error> {
        let missing = || Error::of(ErrorKind::BadAnswer, "the drive says that it has nothing there");
        self.values.first().copied().flatten().ok_or_else(missing)
    }

    /// Each value with its name in the profile and its unit (empty for plain numbers), in the order that was asked for.
    pub fn iter(&self) -> impl Iterator<Item = (&str, Value, &str)> {
        let named = self.planned.names.iter().zip(&self.values);
        named.filter_map(|(names, value)| Some((names.name.as_str(), (*value)?, names.unit.as_str())))
    }
}
