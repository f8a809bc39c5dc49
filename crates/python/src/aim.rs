//! Whether a word may be sent to a unit, for Python: as what it is taken, before anything is sent.

use drivebus_drive::{self as drive, Families, NotTaken};
use pyo3::prelude::*;

use crate::family::{names, what_of};
use crate::identify::not_told;
use crate::same_unit::SameUnit;
use crate::task::{Failed, unknown};

/// Whether nothing is asked before `what` is sent; see `python/drivebus/_native.pyi`.
#[pyfunction]
#[pyo3(signature = (unit, what, connection, /))]
pub(crate) fn goes_out_at_once(unit: &SameUnit, what: &Bound<'_, PyAny>, connection: u64) -> PyResult<bool> {
    Ok(drive::goes_out_at_once(&unit.core(), Families::shipped(), what_of(what)?, connection))
}

/// Why nothing may be written to a unit: of which kind that is, and what is told of it.
pub(crate) fn not_taken(py: Python<'_>, error: NotTaken<Failed>) -> PyResult<Py<PyAny>> {
    match error {
        NotTaken::NotTold(error) => not_told(py, error),
        NotTaken::MayBe(families) => Ok(("may_be", names(&families)).into_pyobject(py)?.into_any().unbind()),
        error => Err(unknown(&error)),
    }
}
