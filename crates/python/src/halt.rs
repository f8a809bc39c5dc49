//! `Halt` for Python: a halt that is sent until the unit takes it, and proved; why not, as a kind and what Python words.

use drivebus_drive::task::Mailbox;
use drivebus_drive::{self as drive, Besides, Families, NotHalted, Order, Taken, Tries, Why};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use crate::clock::{duration, to_seconds};
use crate::errors::refuse;
use crate::family::{against, names};
use crate::look::Looks;
use crate::not_done::{after as after_of, last_look};
use crate::record::Record;
use crate::same_unit::SameUnit;
use crate::set_otherwise::set_otherwise;
use crate::task::{Failed, Task, is_done, or_why, unknown};

/// One unit that is to be halted; see `python/drivebus/_native.pyi`.
#[pyclass(name = "Halt", frozen, module = "drivebus._native")]
#[derive(Debug, Clone)]
pub(crate) struct Halt {
    unit: Taken,
    record: drive::Record,
    order: Order,
}

#[pymethods]
impl Halt {
    #[new]
    #[pyo3(signature = (unit, looks, record, command, coasts, within, confirm, /))]
    fn new(
        unit: &SameUnit,
        looks: &Looks,
        record: &Record,
        command: &str,
        coasts: bool,
        within: f64,
        confirm: f64,
    ) -> PyResult<Self> {
        let command = command.parse().map_err(refuse)?;
        let besides = if coasts { Besides::Coast } else { Besides::Nothing };
        let order = Order { command, besides, within: duration(within), confirm: duration(confirm) };
        let unit = looks.taken(drive::SameUnit::clone(&unit.core()));
        Ok(Self { unit, record: record.0.clone(), order })
    }

    fn carry_out(&self) -> Task {
        let halt = self.clone();
        Task::of(
            |line| async move { halt.begun(&line).carry_out(&line, Families::shipped()).await },
            or_why(|py, error: NotHalted<Failed>| match error {
                NotHalted { why: Why::Failed(error), .. } => Err(error.into()),
                error => not_halted(py, error),
            }),
        )
    }
}

impl Halt {
    fn begun(&self, line: &Mailbox<Failed>) -> drive::Halt<Failed> {
        drive::Halt::new(self.unit.clone(), &self.record, self.order.clone(), Families::shipped(), line.now())
    }
}

/// Halts several units side by side; see `python/drivebus/_native.pyi`.
#[pyfunction]
#[pyo3(signature = (halts, /))]
pub(crate) fn halt_all(halts: Vec<PyRef<'_, Halt>>) -> Task {
    let halts: Vec<Halt> = halts.into_iter().map(|halt| Halt::clone(&halt)).collect();
    let operation = |line| async move {
        let halts = halts.iter().map(|halt| halt.begun(&line)).collect();
        drive::halt_all(&line, Families::shipped(), halts).await
    };
    Task::of(operation, |py, done: Vec<_>| {
        let each = |came: Result<(), _>| came.map_or_else(|error| not_halted(py, error), |()| is_done(py, ()));
        done.into_iter().map(each).collect::<PyResult<Vec<_>>>()?.into_py_any(py)
    })
}

/// As what the unit is taken, what was sent, and of which kind the reason is, with what of it Python words.
fn not_halted(py: Python<'_>, error: NotHalted<Failed>) -> PyResult<Py<PyAny>> {
    let NotHalted { family, command, found, why, .. } = error;
    let (kind, told) = told_of(py, why)?;
    ("not_halted", (family.name(), command.name(), to_seconds(found), kind, told)).into_py_any(py)
}

fn told_of(py: Python<'_>, why: Why<Failed>) -> PyResult<(&'static str, Py<PyAny>)> {
    let raised = |error: Failed| PyErr::from(error).into_value(py);
    Ok(match why {
        Why::MayNot(_) => ("may_not", py.None()),
        Why::Undecided { wanted, families } => ("undecided", (wanted.name(), names(&families)).into_py_any(py)?),
        Why::SetOtherwise { wanted, otherwise } => {
            ("set_otherwise", (wanted.name(), set_otherwise(*otherwise)).into_py_any(py)?)
        }
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
