//! What a unit is, for Python: what was found out, and in which words it is told stands there.

use drivebus_drive::{self as drive, Answer, Certainty, Families, Identification, NotTold, Reason};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::any_unit;
use crate::task::{Failed, Task, unknown};

/// An answer as Python has it: a place, and the word that came or the exception by which it was refused.
type Told = (u32, Option<u16>, Option<u8>);

/// What `unit` is; see `python/drivebus/_native.pyi`.
#[pyfunction]
#[pyo3(signature = (unit, /))]
pub(crate) fn identify(unit: &Bound<'_, PyAny>) -> PyResult<Task> {
    let unit = any_unit(unit)?;
    let told = |py: Python<'_>, found: Result<Identification, NotTold<Failed>>| match found {
        Ok(found) => Ok(("found", identification(py, found)?).into_pyobject(py)?.into_any().unbind()),
        Err(error) => not_told(py, error),
    };
    Ok(Task::of(|line| async move { drive::identify(&line, Families::shipped(), unit).await }, told))
}

/// The shipped family that a unit surely enough is to command a motor by it; see `python/drivebus/_native.pyi`.
#[pyfunction]
#[pyo3(signature = (certainty, candidates, unverified, /))]
pub(crate) fn usable(
    certainty: &str,
    candidates: &Bound<'_, PyAny>,
    unverified: bool,
) -> PyResult<Option<&'static str>> {
    let candidates: Vec<String> = candidates.extract()?;
    let certainty = Certainty::named(certainty);
    let family = certainty.and_then(|certainty| certainty.usable(&candidates, Families::shipped(), unverified));
    Ok(family.map(|family| family.name()))
}

/// Why a unit did not tell: an error of the bus is raised as it is, and what Python words is told by its kind.
pub(crate) fn not_told(py: Python<'_>, error: NotTold<Failed>) -> PyResult<Py<PyAny>> {
    let told = match error {
        NotTold::Failed(error) => return Err(error.into()),
        NotTold::Busy { place, code, times, last, .. } => {
            let last = PyErr::from(last).into_value(py);
            ("busy", (place.number(), code.0, times, last)).into_pyobject(py)?
        }
        NotTold::Unreached { code, .. } => ("unreached", code.0).into_pyobject(py)?,
        error => return Err(unknown(&error)),
    };
    Ok(told.into_any().unbind())
}

fn identification(py: Python<'_>, found: Identification) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("candidates", &found.candidates)?;
    dict.set_item("family", found.family())?;
    dict.set_item("code", found.code)?;
    dict.set_item("titles", &found.titles)?;
    dict.set_item("certainty", found.certainty.name())?;
    let reason = match found.reason {
        Reason::Code { place, alone, source, against } => {
            let against = against.map(told_of);
            ("code", (place.number(), alone.name(), source, against)).into_pyobject(py)?.into_any()
        }
        Reason::Answers(seen) => {
            let seen: Vec<_> = seen.into_iter().map(|(place, is_answered)| (place.number(), is_answered)).collect();
            ("answers", seen).into_pyobject(py)?.into_any()
        }
        Reason::Nothing(told) => {
            let told: Vec<_> = told.into_iter().map(told_of).collect();
            ("nothing", told).into_pyobject(py)?.into_any()
        }
        reason => return Err(unknown(&reason)),
    };
    dict.set_item("reason", reason)?;
    Ok(dict)
}

fn told_of(answer: Answer) -> Told {
    (answer.place.number(), answer.word(), answer.exception().map(|code| code.0))
}
