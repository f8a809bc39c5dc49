//! Operations of the core for Python: a task that wishes for what `drivebus.line.tasks` asks of its bus.

use std::fmt::Debug;
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::time::Duration;

use drivebus_drive::task::{
    Cause, LineError, Link, Mailbox, Misuse, Notice, Outcome, Payload, Read, Seen, Stamped, Step, Task as Driven, Wish,
    Write,
};
use drivebus_rtu::{ExceptionCode, Instant, Meaning};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::clock::moment;
use crate::errors::Class;
use crate::set_otherwise::set_otherwise;
use crate::shown_look::shown;

/// The `why` of a bus that did not send what was decided on before a halt.
const HALTED: &str = "halted";

/// An error of a bus: the exception itself, and what operations look at of it.
#[derive(Debug)]
pub(crate) struct Failed {
    error: PyErr,
    cause: Cause,
    raw: Vec<u8>,
    was_sent: bool,
}

impl Failed {
    fn of(error: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = error.py();
        let is = |class: Class| error.is_instance(class.get(py)?);
        let cause = if is(Class::Refused)? {
            let code = ExceptionCode(error.getattr("code")?.extract()?);
            let means: String = error.getattr("means")?.extract()?;
            let meaning = Meaning::ALL.into_iter().find(|meaning| meaning.name() == means);
            Cause::Refused(code, meaning.unwrap_or_else(|| code.meaning()))
        } else if is(Class::Port)? {
            Cause::Port
        } else if is(Class::NoAnswer)? {
            Cause::NoAnswer
        } else if is(Class::BadAnswer)? {
            Cause::BadAnswer
        } else if is(Class::NotReady)? && error.getattr("why")?.extract::<String>()? == HALTED {
            Cause::Halted
        } else {
            Cause::Other
        };
        Ok(Self {
            cause,
            raw: error.getattr("raw")?.extract()?,
            was_sent: !error.getattr("started")?.is_none(),
            error: PyErr::from_value(error.clone()),
        })
    }
}

impl LineError for Failed {
    fn cause(&self) -> Cause {
        self.cause
    }

    fn raw(&self) -> &[u8] {
        &self.raw
    }

    fn was_sent(&self) -> bool {
        self.was_sent
    }
}

impl From<Failed> for PyErr {
    /// The exception as the bus raised it.
    fn from(failed: Failed) -> Self {
        failed.error
    }
}

type Operation = Driven<PyResult<Py<PyAny>>, Failed>;

/// An operation on its way; see `python/drivebus/_native.pyi`.
#[pyclass(frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Task(Mutex<(Operation, Instant)>);

impl Task {
    /// The `operation`, whose result is told to Python as `told` says.
    pub(crate) fn of<T, F>(
        operation: impl FnOnce(Mailbox<Failed>) -> F,
        told: impl FnOnce(Python<'_>, T) -> PyResult<Py<PyAny>> + Send + 'static,
    ) -> Self
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
    {
        let task = Driven::new(|line| {
            let operation = operation(line);
            async move {
                let done = operation.await;
                Python::attach(|py| told(py, done))
            }
        });
        Self(Mutex::new((task, Instant::ZERO)))
    }
}

#[pymethods]
impl Task {
    #[pyo3(signature = (now, connection, closed, outcome=None, /))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        now: f64,
        connection: u64,
        closed: bool,
        outcome: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(&'static str, Bound<'py, PyAny>)> {
        let mut held = self.held()?;
        let (task, latest) = &mut *held;
        let outcome = match (outcome, task.pending()) {
            (None, Some(Wish::Sleep(_))) => Some(Outcome::Slept),
            (None, Some(Wish::Write(_))) => Some(Outcome::Written),
            (None, Some(Wish::Tell(_))) => Some(Outcome::Heard),
            (None, _) => None,
            (Some(given), Some(Wish::Read(read))) => Some(outcome_of(given, read)?),
            (Some(given), Some(Wish::Link(_))) => Some(
                given.extract().map(|(good, asked)| Outcome::Link(Link { good, asked })).or_else(|_| failed(given))?,
            ),
            (Some(given), Some(Wish::Halts(_))) => {
                Some(given.extract().map(|(halts,)| Outcome::Halts(halts)).or_else(|_| failed(given))?)
            }
            (Some(given), _) => Some(failed(given)?),
        };
        // Of a line that has no clock any more the time stands still.
        *latest = (*latest).max(moment(now));
        let seen = Seen { now: *latest, connection, is_closed: closed };
        match task.step(seen, outcome).map_err(|misuse: Misuse| PyRuntimeError::new_err(misuse.to_string()))? {
            Step::Done(done) => Ok(("done", done?.into_bound(py))),
            Step::Wish(Wish::Sleep(time)) => Ok(("sleep", time.as_secs_f64().into_pyobject(py)?.into_any())),
            Step::Wish(Wish::Read(read)) => Ok((if read.is_stamped { "stamped" } else { "read" }, told_of(py, read)?)),
            Step::Wish(Wish::Write(write)) => Ok(("write", written_of(py, write)?)),
            Step::Wish(Wish::Link(unit)) => Ok(("link", unit.get().into_bound_py_any(py)?)),
            Step::Wish(Wish::Halts(unit)) => Ok(("halts", unit.get().into_bound_py_any(py)?)),
            Step::Wish(Wish::Tell(Notice::Shows(state))) => Ok(("shows", state.name().into_bound_py_any(py)?)),
            Step::Wish(Wish::Tell(Notice::Starts(command))) => Ok(("starts", command.name().into_bound_py_any(py)?)),
            Step::Wish(Wish::Tell(Notice::Took(command))) => Ok(("took", command.name().into_bound_py_any(py)?)),
            Step::Wish(Wish::Tell(Notice::TookOther { command, word, otherwise })) => {
                Ok(("took_other", (command.name(), word, set_otherwise(*otherwise)).into_bound_py_any(py)?))
            }
            Step::Wish(Wish::Tell(Notice::Saw(look))) => Ok(("saw", shown(look).into_bound_py_any(py)?)),
            Step::Wish(Wish::Tell(Notice::Stored { name, times })) => {
                Ok(("stored", (name, times).into_bound_py_any(py)?))
            }
            Step::Wish(wish) => Err(unknown(&wish)),
        }
    }

    #[getter]
    fn taken_for(&self) -> PyResult<Option<(u8, String)>> {
        Ok(self.held()?.0.taken_for().map(|(unit, family)| (unit.get(), family.name().to_owned())))
    }
}

impl Task {
    fn held(&self) -> PyResult<MutexGuard<'_, (Operation, Instant)>> {
        match self.0.try_lock() {
            Ok(held) => Ok(held),
            Err(TryLockError::Poisoned(held)) => Ok(held.into_inner()),
            Err(TryLockError::WouldBlock) => Err(PyRuntimeError::new_err("another thread makes a step")),
        }
    }
}

/// That a call was carried out, and what it says.
pub(crate) fn is_done<'py>(py: Python<'py>, value: impl IntoPyObject<'py>) -> PyResult<Py<PyAny>> {
    let value = value.into_bound_py_any(py)?;
    ("done", value).into_py_any(py)
}

/// How a call is told: what it says where it was carried out, and else `why` it was not.
pub(crate) fn or_why<T: for<'py> IntoPyObject<'py>, W>(
    why: fn(Python<'_>, W) -> PyResult<Py<PyAny>>,
) -> impl FnOnce(Python<'_>, Result<T, W>) -> PyResult<Py<PyAny>> {
    move |py, done| match done {
        Ok(value) => is_done(py, value),
        Err(error) => why(py, error),
    }
}

/// What a later core says or wants besides.
pub(crate) fn unknown(what: &impl Debug) -> PyErr {
    PyRuntimeError::new_err(format!("nothing here knows of {what:?}"))
}

/// What came of a read: words, with their moments where it is stamped, or an error.
fn outcome_of(given: &Bound<'_, PyAny>, read: &Read) -> PyResult<Outcome<Failed>> {
    let came = if read.is_stamped {
        given.extract().map(|(words, asked, answered)| {
            Outcome::Stamped(Stamped { words, asked: since_1970(asked), answered: since_1970(answered) })
        })
    } else {
        given.extract().map(Outcome::Words)
    };
    came.or_else(|_| failed(given))
}

fn failed(given: &Bound<'_, PyAny>) -> PyResult<Outcome<Failed>> {
    Failed::of(given).map(Outcome::Failed)
}

/// Unix time; a clock before that has none.
fn since_1970(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}

/// A read, in the order of the attributes of `drivebus.line.asking.Read`.
fn told_of(py: Python<'_>, read: Read) -> PyResult<Bound<'_, PyAny>> {
    let Read { unit, place, count, is_urgent, timeout, retries, .. } = read;
    let table = place.table.name();
    let timeout = timeout.map(|time| time.as_secs_f64());
    let told = (unit.get(), place.address, count, table, is_urgent, false, timeout, retries);
    Ok(told.into_pyobject(py)?.into_any())
}

/// A write, in the order of the attributes of `drivebus.line.asking.Write`.
fn written_of(py: Python<'_>, write: Write) -> PyResult<Bound<'_, PyAny>> {
    let Write { unit, place, payload, is_urgent, read_back, connection, halts, is_forced, timeout, .. } = write;
    let value = match payload {
        Payload::Word(word) => word.into_bound_py_any(py)?,
        Payload::Words(words) => words.into_bound_py_any(py)?,
    };
    let timeout = timeout.map(|time| time.as_secs_f64());
    let table = place.table.name();
    (unit.get(), place.address, value, table, is_urgent, read_back, connection, halts, is_forced, timeout)
        .into_bound_py_any(py)
}
