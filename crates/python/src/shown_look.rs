//! What one look showed, as Python makes its own of it.

use drivebus_drive::{After, LastLook, Look};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use crate::task::Failed;

/// A look: state, its word, the number of the fault, whether it is in it, the fields, and when that was.
pub(crate) type Shown = (&'static str, Option<u16>, Option<u16>, bool, Vec<(String, String)>, f64);

pub(crate) fn shown(look: Look) -> Shown {
    let Look { state, word, fault, is_in_fault, fields, asked, .. } = look;
    (state.name(), word, fault, is_in_fault, fields, asked.as_secs_f64())
}

/// A look after something came to nothing, or the exception instead of one.
pub(crate) fn after(py: Python<'_>, after: After<Failed>) -> PyResult<Py<PyAny>> {
    match after {
        After::Seen(look) => shown(look).into_py_any(py),
        After::Unread(error) => PyErr::from(error).into_value(py).into_py_any(py),
    }
}

/// The last look at a unit: `"unshown"`, what it showed and the frequency, or `"unread"` and the exception.
pub(crate) fn last_look(py: Python<'_>, last: LastLook<Failed>) -> PyResult<(&'static str, Py<PyAny>)> {
    Ok(match last {
        LastLook::Seen { look, hz } => ("unshown", (shown(look), hz).into_py_any(py)?),
        LastLook::Unread(error) => ("unread", PyErr::from(error).into_value(py).into_py_any(py)?),
    })
}
