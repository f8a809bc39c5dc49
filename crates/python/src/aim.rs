//! Why nothing may be written to a unit, for Python.

use drivebus_drive::{NotTaken, SetOtherwise};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use crate::family::names;
use crate::identify::not_told;
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

/// The parameter that gives words another meaning: its code, what it holds and must hold, what that is called, what the words mean
/// as it is, and a note.
pub(crate) fn set_otherwise(found: SetOtherwise) -> (String, u16, u16, String, String, String) {
    let means = found.means().to_owned();
    let SetOtherwise { wanted, raw, .. } = found;
    (wanted.code, raw, wanted.raw, wanted.label, means, wanted.note)
}
