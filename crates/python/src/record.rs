//! `Record` for Python: what was sent to a unit, and what it said of itself.

use drivebus_drive as drive;
use drivebus_drives::State;
use pyo3::prelude::*;

use crate::errors::bad_argument;
use crate::same_unit::Identity;

/// What is remembered of one unit; see `python/drivebus/_native.pyi`.
#[pyclass(name = "Record", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Record(pub(crate) drive::Record);

#[pymethods]
impl Record {
    #[new]
    fn new() -> Self {
        Self(drive::Record::default())
    }

    #[pyo3(signature = (family, connection, /))]
    fn identity(&self, family: &str, connection: u64) -> Identity {
        Identity(self.0.identity(family, connection))
    }

    #[pyo3(signature = (code, /))]
    fn is_in_ram(&self, code: &str) -> bool {
        self.0.is_in_ram(code)
    }

    #[pyo3(signature = (code, /))]
    fn put_in_ram(&self, code: &str) {
        self.0.put_in_ram(code);
    }

    #[pyo3(signature = (code, /))]
    fn stored(&self, code: &str) -> u64 {
        self.0.stored(code)
    }

    #[getter]
    fn starts(&self) -> u64 {
        self.0.sent().starts
    }

    #[getter]
    fn halts(&self) -> u64 {
        self.0.sent().halts
    }

    #[getter]
    fn started_as(&self) -> Option<&'static str> {
        self.0.sent().started_as.map(State::name)
    }

    #[setter]
    fn set_started_as(&self, state: &str) -> PyResult<()> {
        let state = State::named(state).ok_or_else(|| bad_argument(format!("state {state:?} is none")))?;
        self.0.note(|sent| sent.started_as = Some(state));
        Ok(())
    }

    #[getter]
    fn started_unverified(&self) -> bool {
        self.0.sent().started_unverified
    }

    #[setter]
    fn set_started_unverified(&self, is_unverified: bool) {
        self.0.note(|sent| sent.started_unverified = is_unverified);
    }
}
