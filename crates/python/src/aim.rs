//! `Aim` for Python, and whether a word may be sent to a unit: as what it is taken, before anything is sent.

use std::sync::Arc;

use drivebus_drive::{self as drive, Families, NotTaken, Target};
use drivebus_drives::Command;
use pyo3::prelude::*;

use crate::clock::{moment, to_seconds};
use crate::errors::refuse;
use crate::family::{names, what_of};
use crate::identify::not_told;
use crate::same_unit::SameUnit;
use crate::task::{Failed, Task, unknown};

/// The look at one unit that comes before a halt.
#[pyclass(name = "Aim", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Aim(Arc<drive::Aim>);

#[pymethods]
impl Aim {
    #[new]
    #[pyo3(signature = (unit, now, /))]
    fn new(unit: &SameUnit, now: f64) -> Self {
        let unit = drive::SameUnit::clone(&unit.core());
        Self(Arc::new(drive::Aim::new(unit, Families::shipped(), moment(now))))
    }

    #[getter]
    fn heard(&self) -> f64 {
        to_seconds(self.0.heard())
    }

    fn doubt(&self) -> bool {
        self.0.doubt(Families::shipped())
    }

    #[pyo3(signature = (command, /))]
    fn take(&self, command: &str) -> PyResult<Task> {
        let command: Command = command.parse().map_err(refuse)?;
        let aim = Arc::clone(&self.0);
        let told = |py: Python<'_>, done: Result<Option<Target>, NotTaken<Failed>>| {
            let told = match done {
                Ok(Some(Target { family, command, .. })) => {
                    ("target", (family.name(), command.name())).into_pyobject(py)?
                }
                Ok(None) => ("unsaid", ()).into_pyobject(py)?,
                Err(error) => return not_taken(py, error),
            };
            Ok(told.into_any().unbind())
        };
        Ok(Task::of(|line| async move { aim.take(&line, Families::shipped(), command).await }, told))
    }
}

/// Whether nothing is asked before `what` is sent; see `python/drivebus/_native.pyi`.
#[pyfunction]
#[pyo3(signature = (unit, what, connection, /))]
pub(crate) fn goes_out_at_once(unit: &SameUnit, what: &Bound<'_, PyAny>, connection: u64) -> PyResult<bool> {
    Ok(drive::goes_out_at_once(&unit.core(), Families::shipped(), what_of(what)?, connection))
}

/// Makes sure that `what` does no harm to the unit; see `python/drivebus/_native.pyi`.
#[pyfunction]
#[pyo3(signature = (unit, what, /))]
pub(crate) fn check_harmless(unit: &SameUnit, what: &Bound<'_, PyAny>) -> PyResult<Task> {
    let (unit, what) = (unit.core(), what_of(what)?);
    let told = |py: Python<'_>, done: Result<(), NotTaken<Failed>>| match done {
        Ok(()) => Ok(("harmless", ()).into_pyobject(py)?.into_any().unbind()),
        Err(error) => not_taken(py, error),
    };
    Ok(Task::of(|line| async move { drive::check_harmless(&line, Families::shipped(), &unit, what).await }, told))
}

fn not_taken(py: Python<'_>, error: NotTaken<Failed>) -> PyResult<Py<PyAny>> {
    match error {
        NotTaken::NotTold(error) => not_told(py, error),
        NotTaken::MayBe(families) => Ok(("may_be", names(&families)).into_pyobject(py)?.into_any().unbind()),
        error => Err(unknown(&error)),
    }
}
