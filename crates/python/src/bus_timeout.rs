//! `BusTimeout` for Python: a drive's own time-out of the bus, and why it is not set or given back, as a kind and what
//! Python words.

use drivebus_drive::task::Mailbox;
use drivebus_drive::{self as drive, Back, Families, NotArmable, NotArmed, NotAsked, NotRead, OnSilence, WhyNotArmed};
use drivebus_drives::Value;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::errors::{Class, refuse};
use crate::not_done::{Told, raised, settled_told};
use crate::not_kept::{held, not_kept, not_kept_told};
use crate::rule::Rule;
use crate::task::{Failed, Task, or_why, unknown};
use crate::unit::Unit;

/// A drive's own time-out of the bus; see `python/drivebus/_native.pyi`.
#[pyclass(name = "BusTimeout", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct BusTimeout(drive::BusTimeout);

#[pymethods]
impl BusTimeout {
    #[staticmethod]
    #[pyo3(signature = (rule, timeout, action, /))]
    fn of(
        py: Python<'_>,
        rule: &Rule,
        timeout: &Bound<'_, PyAny>,
        action: &Bound<'_, PyAny>,
    ) -> PyResult<(&'static str, Py<PyAny>)> {
        // What is no number is out of every range.
        let is_number = !timeout.is_instance_of::<PyBool>();
        let seconds = timeout.extract().ok().filter(|_| is_number).unwrap_or(f64::NAN);
        let named = |name: String| OnSilence::ALL.into_iter().find(|action| action.name() == name);
        let made = match action.extract().ok().and_then(named) {
            Some(action) => drive::BusTimeout::new(rule.core(), seconds, action),
            // Of an action that no drive has, all else is looked at first.
            None => drive::BusTimeout::new(rule.core(), seconds, OnSilence::Coast)
                .and_then(|_| Err(NotArmable::NoAction { action: OnSilence::Coast, known: Vec::new() })),
        };
        match made {
            Ok(made) => Ok(("done", Self(made).into_py_any(py)?)),
            Err(why) => not_armable(py, why),
        }
    }

    #[getter]
    fn seconds(&self) -> f64 {
        self.0.seconds()
    }

    #[getter]
    fn action(&self) -> &'static str {
        self.0.action().name()
    }

    #[getter]
    fn is_armed(&self) -> bool {
        self.0.is_armed()
    }

    #[getter]
    fn may_be_set(&self) -> bool {
        self.0.may_be_set()
    }

    #[getter]
    fn interval(&self) -> f64 {
        self.0.interval().as_secs_f64()
    }

    #[pyo3(signature = (unit, /))]
    fn set(&self, unit: &Unit) -> Task {
        let work = async move |timeout: drive::BusTimeout, unit: drive::Unit, line: Mailbox<Failed>| {
            timeout.set(&unit, &line, Families::shipped()).await
        };
        self.task(unit, work, or_why(not_armed))
    }

    #[pyo3(signature = (unit, /))]
    fn put_back(&self, unit: &Unit) -> Task {
        let work = async move |timeout: drive::BusTimeout, unit: drive::Unit, line: Mailbox<Failed>| {
            timeout.put_back(&unit, &line, Families::shipped()).await
        };
        self.task(unit, work, or_why(not_kept))
    }

    #[pyo3(signature = (unit, /))]
    fn ask(&self, unit: &Unit) -> Task {
        let work = async move |timeout: drive::BusTimeout, unit: drive::Unit, line: Mailbox<Failed>| {
            timeout.ask(&unit, &line).await
        };
        self.task(unit, work, or_why(not_asked))
    }
}

impl BusTimeout {
    fn task<T, F>(
        &self,
        unit: &Unit,
        work: impl FnOnce(drive::BusTimeout, drive::Unit, Mailbox<Failed>) -> F,
        told: impl FnOnce(Python<'_>, T) -> PyResult<Py<PyAny>> + Send + 'static,
    ) -> Task
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
    {
        let timeout = self.0.clone();
        unit.task(|unit, line| work(timeout, unit, line), told)
    }
}

fn not_armable(py: Python<'_>, why: NotArmable) -> PyResult<Told> {
    Ok(match why {
        NotArmable::NoTimeout => ("no_timeout", py.None()),
        NotArmable::OnlyStored(_) => ("only_stored", py.None()),
        NotArmable::NotPrinted(_) => ("not_printed", py.None()),
        NotArmable::OutOfRange { high, .. } => ("out_of_range", high.map(Value::to_f64).into_py_any(py)?),
        NotArmable::NoAction { .. } => ("no_action", py.None()),
        NotArmable::Unfit(error) => return Err(refuse(error)),
        why => return Err(unknown(&why)),
    })
}

fn not_armed(py: Python<'_>, error: NotArmed<Failed>) -> PyResult<Py<PyAny>> {
    let NotArmed { parts, why, back, .. } = error;
    let (kind, told): Told = match *why {
        WhyNotArmed::Unread(why) | WhyNotArmed::Unshown(why) => read_told(py, why)?,
        WhyNotArmed::NotKept(error) => ("not_kept", not_kept_told(py, error)?),
        WhyNotArmed::Others(all) => ("others", all.into_iter().map(held).collect::<Vec<_>>().into_py_any(py)?),
        why => return Err(unknown(&why)),
    };
    let (is_left, not_back) = match back {
        Back::Untouched | Back::Given => (false, None),
        Back::NotGiven(error) => (true, Some(not_kept_told(py, error)?)),
        back => return Err(unknown(&back)),
    };
    ("not_armed", (kind, told, is_left && parts > 0, not_back)).into_py_any(py)
}

fn read_told(py: Python<'_>, why: NotRead<Failed>) -> PyResult<Told> {
    Ok(match why {
        NotRead::MayNot { name, .. } => ("may_not", name.into_py_any(py)?),
        NotRead::NotSettled(why) => ("not_settled", settled_told(py, why)?.into_py_any(py)?),
        NotRead::Failed(error) => ("failed", raised(py, error)?),
        NotRead::Absent(why) => {
            ("failed", Class::BadAnswer.raise(why.to_string(), |_| Ok(())).into_value(py).into_any())
        }
        why => return Err(unknown(&why)),
    })
}

fn not_asked(py: Python<'_>, error: NotAsked<Failed>) -> PyResult<Py<PyAny>> {
    let why = error.why.map(|error| raised(py, error)).transpose()?;
    ("not_asked", (why, error.is_over)).into_py_any(py)
}
