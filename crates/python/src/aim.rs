//! Why nothing may be written to a unit, for Python.

use drivebus_drive::NotTaken;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use crate::family::names;
use crate::identify::not_told;
use crate::set_otherwise::set_otherwise;
use crate::task::{Failed, unknown};

/// Of which kind the reason is, and what is told of it.
pub(crate) fn not_taken(py: Python<'_>, error: NotTaken<Failed>) -> PyResult<Py<PyAny>> {
    match error {
        NotTaken::NotTold(error) => not_told(py, error),
        NotTaken::MayBe(families) => Ok(("may_be", names(&families)).into_pyobject(py)?.into_any().unbind()),
        NotTaken::SetOtherwise(otherwise) => ("set_otherwise", set_otherwise(*otherwise)).into_py_any(py),
        error => Err(unknown(&error)),
    }
}
