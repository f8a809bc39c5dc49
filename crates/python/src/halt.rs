//! `Halt` for Python: a halt that is sent until the unit takes it, and proved; why not, as a kind and what Python words.

use std::sync::{Arc, Mutex, PoisonError};

use drivebus_drive::task::Mailbox;
use drivebus_drive::{self as drive, Families, NotHalted, Order, Tries, Why};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::clock::{duration, moment, to_seconds};
use crate::errors::refuse;
use crate::family::{against, names};
use crate::look::Looks;
use crate::not_done::{after as after_of, last_look};
use crate::record::Record;
use crate::same_unit::SameUnit;
use crate::task::{Failed, Task, unknown};

type Core = drive::Halt<Failed>;

/// One unit that is to be halted; see `python/drivebus/_native.pyi`.
#[pyclass(name = "Halt", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Halt(Arc<Mutex<Option<Core>>>);

#[pymethods]
impl Halt {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "one call from one place, with names there")]
    #[pyo3(signature = (unit, looks, record, command, coasts, within, confirm, now, /))]
    fn new(
        unit: &SameUnit,
        looks: &Looks,
        record: &Record,
        command: &str,
        coasts: bool,
        within: f64,
        confirm: f64,
        now: f64,
    ) -> PyResult<Self> {
        let command = command.parse().map_err(refuse)?;
        let order = Order { command, coasts, within: duration(within), confirm: duration(confirm) };
        let unit = looks.taken(drive::SameUnit::clone(&unit.core()));
        let halt = Core::new(unit, &record.0, order, Families::shipped(), moment(now));
        Ok(Self(Arc::new(Mutex::new(Some(halt)))))
    }

    fn carry_out(&self) -> Task {
        self.task(|mut halt, line| async move {
            let done = halt.carry_out(&line, Families::shipped()).await;
            (halt, done.map(|()| true))
        })
    }

    fn advance(&self) -> Task {
        self.task(|mut halt, line| async move {
            let done = halt.advance(&line, Families::shipped()).await;
            (halt, done)
        })
    }

    #[pyo3(signature = (now, /))]
    fn pause(&self, now: f64) -> PyResult<f64> {
        self.with(|halt| halt.pause(moment(now)).as_secs_f64())
    }

    #[pyo3(signature = (seconds, /))]
    fn wait(&self, seconds: f64) -> PyResult<()> {
        self.with(|halt| halt.wait(duration(seconds)))
    }
}

impl Halt {
    /// A step, for which the halt is taken out of here, and put back where it comes to its end.
    fn task<F>(&self, step: impl FnOnce(Core, Mailbox<Failed>) -> F + Send + 'static) -> Task
    where
        F: Future<Output = (Core, Result<bool, NotHalted<Failed>>)> + Send + 'static,
    {
        let place = Arc::clone(&self.0);
        let operation = |line| async move {
            let halt = place.lock().unwrap_or_else(PoisonError::into_inner).take().ok_or_else(under_way)?;
            let (halt, done) = step(halt, line).await;
            *place.lock().unwrap_or_else(PoisonError::into_inner) = Some(halt);
            Ok(done)
        };
        Task::of(operation, |py, done: PyResult<_>| match done? {
            Ok(is_done) => ("done", is_done).into_py_any(py),
            Err(error) => not_halted(py, error),
        })
    }

    fn with<T>(&self, f: impl FnOnce(&mut Core) -> T) -> PyResult<T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).as_mut().map(f).ok_or_else(under_way)
    }
}

fn under_way() -> PyErr {
    PyRuntimeError::new_err("a step of this halt is under way, or was given up")
}

/// As what the unit is taken, what was sent, and of which kind the reason is, with what of it Python words.
fn not_halted(py: Python<'_>, error: NotHalted<Failed>) -> PyResult<Py<PyAny>> {
    let NotHalted { family, command, found, why, .. } = error;
    let (kind, told) = match why {
        Why::Failed(error) => return Err(error.into()),
        why => told_of(py, why)?,
    };
    ("not_halted", (family.name(), command.name(), to_seconds(found), kind, told)).into_py_any(py)
}

fn told_of(py: Python<'_>, why: Why<Failed>) -> PyResult<(&'static str, Py<PyAny>)> {
    let raised = |error: Failed| PyErr::from(error).into_value(py);
    Ok(match why {
        Why::MayNot(_) => ("may_not", py.None()),
        Why::Undecided { wanted, families } => ("undecided", (wanted.name(), names(&families)).into_py_any(py)?),
        Why::Unsaid => ("unsaid", py.None()),
        Why::NotSent(error) => ("not_sent", raised(error).into_py_any(py)?),
        Why::Refused { last, tries, after } => {
            ("refused", (raised(last), sent(tries), after_of(py, after)?).into_py_any(py)?)
        }
        Why::Unanswered { last, tries, after } => {
            ("unanswered", (raised(last), sent(tries), after_of(py, after)?).into_py_any(py)?)
        }
        Why::Unasked(error) => ("unasked", raised(error).into_py_any(py)?),
        Why::Another { against: found, then } => {
            let found = found.map(|found| against(py, *found)).transpose()?;
            ("another", (found, told_of(py, *then)?).into_py_any(py)?)
        }
        Why::PortLost(error) => ("port_lost", raised(error).into_py_any(py)?),
        Why::Unshown(last) => last_look(py, last)?,
        Why::Failed(error) => ("failed", raised(error).into_py_any(py)?),
        why => return Err(unknown(&why)),
    })
}

/// The commands that were sent, in how many seconds, and how many seconds ago the unit was heard.
fn sent(tries: Tries) -> (Vec<&'static str>, f64, Option<f64>) {
    let Tries { told, took, heard } = tries;
    let told = told.into_iter().map(drivebus_drives::Command::name).collect();
    (told, took.as_secs_f64(), heard.map(|ago| ago.as_secs_f64()))
}
