//! `Rule` for Python: may this be asked of a drive, and why not, as a kind and what the profile says of it.

use std::sync::Arc;

use drivebus_drive::{Rule as Core, WhyNot};
use drivebus_drives::{self as drives, Store};
use pyo3::prelude::*;

use crate::errors::bad_argument;
use crate::profile::{Profile, entry_of};

/// What may be asked of units of one family, under one trust.
#[pyclass(name = "Rule", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Rule {
    profile: Arc<drives::Profile>,
    trusts_all: bool,
}

/// A kind, and what the profile says of it, which may be empty; `None`: it may be asked.
type Told = Option<(&'static str, String)>;

impl Rule {
    pub(crate) fn core(&self) -> Core<'_> {
        Core::of(&self.profile, self.trusts_all)
    }
}

#[pymethods]
impl Rule {
    #[new]
    #[pyo3(signature = (profile, trusts_all, /))]
    fn new(profile: &Profile, trusts_all: bool) -> Self {
        Self { profile: profile.core(), trusts_all }
    }

    #[pyo3(signature = (name, /))]
    fn read(&self, name: &Bound<'_, PyAny>) -> PyResult<Told> {
        Ok(told(self.core().read(&*entry_of(&self.profile, name)?)))
    }

    #[pyo3(signature = (name, /))]
    fn write(&self, name: &Bound<'_, PyAny>) -> PyResult<Told> {
        Ok(told(self.core().write(&*entry_of(&self.profile, name)?)))
    }

    #[pyo3(signature = (name, word, /))]
    fn word(&self, name: &Bound<'_, PyAny>, word: u32) -> PyResult<Told> {
        Ok(told(self.core().word(&*entry_of(&self.profile, name)?, word)))
    }

    #[pyo3(signature = (name, field, /))]
    fn bits(&self, name: &Bound<'_, PyAny>, field: &str) -> PyResult<Told> {
        let entry = entry_of(&self.profile, name)?;
        let known = entry.bits().iter().find(|known| known.name() == field);
        let known = known.ok_or_else(|| bad_argument(format!("{} has no bits {field}", entry.name())))?;
        Ok(told(self.core().bits(&entry, known)))
    }

    #[pyo3(signature = (name, store, /))]
    fn kept(&self, name: &Bound<'_, PyAny>, store: bool) -> PyResult<Told> {
        let store = if store { Store::Eeprom } else { Store::Ram };
        Ok(told(self.core().kept(&*entry_of(&self.profile, name)?, store)))
    }

    #[pyo3(signature = (name, /))]
    fn variant(&self, name: &str) -> PyResult<Told> {
        let known = self.profile.variants().get(name);
        let known = known.ok_or_else(|| bad_argument(format!("{} has no variant {name}", self.profile.name())))?;
        Ok(told(self.core().variant(known)))
    }

    /// A name that is no command of any family is one that this family does not have.
    #[pyo3(signature = (name, /))]
    fn command(&self, name: &str) -> Told {
        told(name.parse().map_or(Err(WhyNot::NoCommand), |command| self.core().command(command)))
    }

    fn state(&self) -> Told {
        told(self.core().state())
    }

    fn fault(&self) -> Told {
        told(self.core().fault())
    }
}

fn told(may: Result<(), WhyNot<'_>>) -> Told {
    let (kind, reason) = match may.err()? {
        WhyNot::NoAddress(note) => ("no_address", note),
        WhyNot::OnlyWritten => ("only_written", ""),
        WhyNot::NotPrinted(reason) => ("not_printed", reason),
        WhyNot::NoRange => ("no_range", ""),
        WhyNot::NoCommand => ("no_command", ""),
        WhyNot::NoState => ("no_state", ""),
        WhyNot::NoFault => ("no_fault", ""),
        // What a later core knows besides.
        _ => ("not_printed", ""),
    };
    Some((kind, reason.to_owned()))
}
