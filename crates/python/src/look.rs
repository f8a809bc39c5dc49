//! `Looks` for Python: what a drive is doing.

use std::sync::Arc;

use drivebus_drive::{self as drive, Look};
use drivebus_drives::{Entry, State};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use crate::convert::any_unit;
use crate::profile::Profile;
use crate::shown_look::shown;
use crate::task::{Failed, Task};

/// What is looked at of units of one family, under one trust; see `python/drivebus/_native.pyi`.
#[pyclass(frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Looks {
    looks: Arc<drive::Looks>,
    speeds: Arc<drive::Speeds>,
}

#[pymethods]
impl Looks {
    #[new]
    #[pyo3(signature = (profile, trusted, /))]
    fn new(profile: &Profile, trusted: bool) -> Self {
        let profile = profile.core();
        let speeds = drive::Speeds::new(&profile, trusted);
        Self { looks: Arc::new(drive::Looks::new(&profile, trusted)), speeds: Arc::new(speeds) }
    }

    #[getter]
    fn is_blind(&self) -> bool {
        self.looks.is_blind()
    }

    #[getter]
    fn state(&self) -> Option<&str> {
        self.looks.state_word().map(Entry::name)
    }

    #[getter]
    fn fault(&self) -> Option<&str> {
        self.looks.fault_register().map(Entry::name)
    }

    #[pyo3(signature = (state, fault, /))]
    fn read_off(&self, state: Option<u16>, fault: Option<u16>) -> (&'static str, u16, bool) {
        let profile = self.looks.profile();
        let number = self.looks.fault_number(state, fault);
        let doing = state.map_or(State::Unknown, |raw| profile.state(raw));
        (doing.name(), number.unwrap_or_default(), self.looks.is_in_fault(state, number))
    }

    #[pyo3(signature = (unit, urgent, /))]
    fn look(&self, unit: &Bound<'_, PyAny>, urgent: bool) -> PyResult<Task> {
        let unit = any_unit(unit)?;
        let looks = Arc::clone(&self.looks);
        Ok(Task::of(
            |line| async move { looks.look(&line, unit, urgent).await },
            |py, look: Result<Look, Failed>| shown(look?).into_py_any(py),
        ))
    }
}

impl Looks {
    /// The unit as it was named, under the trust of these.
    pub(crate) fn taken(&self, same: drive::SameUnit) -> drive::Taken {
        drive::Taken::as_named(same, &self.looks, &self.speeds)
    }
}
