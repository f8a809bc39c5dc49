//! `Identity` and `SameUnit` for Python: what a unit said of itself, and whether it still is the one it was.

use std::sync::Arc;

use drivebus_drive::{self as drive, Contradiction, Families, NotSame};
use pyo3::prelude::*;

use crate::clock::moment;
use crate::convert::any_unit;
use crate::family::{Family, against};
use crate::task::{Failed, Task, unknown};

/// What a unit said of itself, asked in the words of one family.
#[pyclass(name = "Identity", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Identity(pub(crate) drive::Identity);

#[pymethods]
impl Identity {
    #[pyo3(signature = (connection, now, /))]
    fn settle(&self, connection: u64, now: f64) {
        self.0.settle(connection, moment(now));
    }
}

/// A unit that was named as one of a family.
#[pyclass(name = "SameUnit", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct SameUnit(Arc<drive::SameUnit>);

impl SameUnit {
    pub(crate) fn core(&self) -> Arc<drive::SameUnit> {
        Arc::clone(&self.0)
    }
}

#[pymethods]
impl SameUnit {
    #[new]
    #[pyo3(signature = (unit, family, identity, trusted, /))]
    fn new(unit: &Bound<'_, PyAny>, family: &Family, identity: &Identity, trusted: bool) -> PyResult<Self> {
        let same = drive::SameUnit::new(any_unit(unit)?, family.core(), &identity.0, trusted);
        Ok(Self(Arc::new(same)))
    }

    #[pyo3(signature = (code, now, /))]
    fn gave(&self, code: u16, now: f64) {
        self.0.gave(code, moment(now));
    }

    #[pyo3(signature = (judged, urgent, /))]
    fn check(&self, judged: bool, urgent: bool) -> Task {
        let same = self.core();
        Task::of(|line| async move { same.check(&line, Families::shipped(), judged, urgent).await }, checked)
    }

    fn contradiction(&self) -> Task {
        let same = self.core();
        let told = |py: Python<'_>, found: Result<Option<Contradiction>, Failed>| {
            let found = found?.map(|found| against(py, found)).transpose()?;
            Ok(found.into_pyobject(py)?.unbind())
        };
        Task::of(|line| async move { same.contradiction(&line, Families::shipped(), false).await }, told)
    }
}

pub(crate) fn checked(py: Python<'_>, done: Result<u64, NotSame<Failed>>) -> PyResult<Py<PyAny>> {
    let told = match done {
        Ok(connection) => ("same", connection).into_pyobject(py)?,
        Err(NotSame::Failed(error)) => return Err(error.into()),
        Err(NotSame::Contradicts(found)) => ("contradicts", against(py, found)?).into_pyobject(py)?,
        Err(NotSame::Unsaid(error)) => ("unsaid", PyErr::from(error).into_value(py)).into_pyobject(py)?,
        Err(NotSame::PutOff(told)) => ("put_off", told.to_string()).into_pyobject(py)?,
        Err(NotSame::Another { before, now }) => {
            ("another", (before.to_string(), now.to_string())).into_pyobject(py)?
        }
        Err(error) => return Err(unknown(&error)),
    };
    Ok(told.into_any().unbind())
}
