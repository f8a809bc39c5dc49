//! `Unit` for Python: one call to a unit, what it commands and writes, and why not, as a kind and what Python words.

use drivebus_drive::task::{Mailbox, Payload};
use drivebus_drive::{self as drive, Families, Setting, Start, Words};
use drivebus_drives::{Place, Profile, Setpoint};
use pyo3::prelude::*;

use crate::clock::duration;
use crate::convert::place_of;
use crate::errors::bad_argument;
use crate::look::Looks;
use crate::not_done::{not_commanded, not_set, not_settled, not_written, setting};
use crate::record::Record;
use crate::same_unit::SameUnit;
use crate::task::{Failed, Task, is_done, or_why};
use crate::waits::{rests, status, time_limit, waited};

/// One call to a unit; see `python/drivebus/_native.pyi`.
#[pyclass(name = "Unit", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Unit(drive::Unit);

/// A word, or several.
#[derive(FromPyObject)]
enum Value {
    One(u16),
    Many(Vec<u16>),
}

#[pymethods]
impl Unit {
    #[new]
    #[pyo3(signature = (unit, looks, record, /))]
    fn new(unit: &SameUnit, looks: &Looks, record: &Record) -> Self {
        Self(drive::Unit::new(looks.taken(drive::SameUnit::clone(&unit.core())), &record.0))
    }

    #[getter]
    fn parts(&self) -> u64 {
        self.0.parts()
    }

    #[pyo3(signature = (jogs, reverse, hz, confirm, force, /))]
    fn start(&self, jogs: bool, reverse: bool, hz: Option<f64>, confirm: f64, force: bool) -> Task {
        let mut start = if jogs { Start::jog(reverse) } else { Start::run(reverse, hz) };
        (start.confirm, start.is_forced) = (duration(confirm), force);
        let told = or_why(not_commanded);
        self.task(|unit, line| async move { unit.start(&line, Families::shipped(), &start).await }, told)
    }

    #[pyo3(signature = (confirm, /))]
    fn reset_fault(&self, confirm: f64) -> Task {
        let confirm = duration(confirm);
        let told = or_why(not_commanded);
        self.task(|unit, line| async move { unit.reset_fault(&line, Families::shipped(), confirm).await }, told)
    }

    #[pyo3(signature = (place, value, read_back, absolute, force, /))]
    fn write(
        &self,
        place: &Bound<'_, PyAny>,
        value: Value,
        read_back: Option<u32>,
        absolute: bool,
        force: bool,
    ) -> PyResult<Task> {
        let payload = match value {
            Value::One(word) => Payload::Word(word),
            Value::Many(words) => Payload::Words(words),
        };
        let mut words = Words::once(place_of(place)?, payload);
        words.read_back = read_back.and_then(Place::of_number).map(|place| place.address);
        (words.is_absolute, words.is_forced) = (absolute, force);
        let told = or_why(not_written);
        Ok(self.task(|unit, line| async move { unit.write(&line, Families::shipped(), &words).await }, told))
    }

    #[pyo3(signature = (word, /))]
    fn write_frequency(&self, word: u16) -> Task {
        let told = or_why(not_written);
        self.task(move |unit, line| async move { unit.write_frequency(&line, Families::shipped(), word).await }, told)
    }

    #[pyo3(signature = (hz, /))]
    fn set_frequency(&self, hz: f64) -> Task {
        let told = or_why(not_set);
        self.task(move |unit, line| async move { unit.set_frequency(&line, Families::shipped(), hz).await }, told)
    }

    #[pyo3(signature = (hz, /))]
    fn frequency_word(&self, hz: f64) -> Task {
        let told = or_why(not_set);
        self.task(move |unit, line| async move { unit.frequency_word(&line, hz).await }, told)
    }

    #[pyo3(signature = (names, /))]
    fn settled(&self, names: Vec<String>) -> Task {
        let told = |py: Python<'_>, done: Result<drive::Unit, _>| match done {
            Ok(unit) => is_done(py, unit.profile().chosen().clone()),
            Err(why) => not_settled(py, why),
        };
        let work = |unit: drive::Unit, line| async move {
            let names: Vec<_> = names.iter().map(String::as_str).collect();
            unit.settled(&line, &names).await
        };
        self.task(work, told)
    }

    fn status(&self) -> Task {
        self.task(|unit, line| async move { unit.status(&line).await }, status)
    }

    #[pyo3(signature = (hz, tolerance, timeout, /))]
    fn wait_for_speed(&self, hz: Option<f64>, tolerance: f64, timeout: f64) -> Task {
        let within = time_limit(timeout);
        self.task(move |unit, line| async move { unit.wait_for_speed(&line, hz, tolerance, within).await }, waited)
    }

    #[pyo3(signature = (timeout, /))]
    fn wait_until_stopped(&self, timeout: f64) -> Task {
        let within = time_limit(timeout);
        self.task(move |unit, line| async move { unit.wait_until_stopped(&line, within).await }, waited)
    }

    fn comes_to_rest(&self) -> Task {
        self.task(|unit, line| async move { unit.comes_to_rest(&line).await }, rests)
    }

    #[pyo3(signature = (setpoint, /))]
    fn control(&self, setpoint: &str) -> PyResult<Task> {
        let setpoint = setpoint_of(setpoint)?;
        Ok(self.task(move |unit, line| async move { unit.control(&line, setpoint).await }, settings))
    }
}

impl Unit {
    /// The same call, for more of what may be asked of it.
    pub(crate) fn again(&self) -> Self {
        Self(self.0.clone())
    }

    pub(crate) fn profile(&self) -> &Profile {
        self.0.profile()
    }

    /// What `work` asks of the unit, and how it is `told`.
    pub(crate) fn task<T, F>(
        &self,
        work: impl FnOnce(drive::Unit, Mailbox<Failed>) -> F,
        told: impl FnOnce(Python<'_>, T) -> PyResult<Py<PyAny>> + Send + 'static,
    ) -> Task
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
    {
        let unit = self.0.clone();
        Task::of(|line| work(unit, line), told)
    }
}

pub(crate) fn setpoint_of(name: &str) -> PyResult<Setpoint> {
    let known = Setpoint::ALL.into_iter().find(|setpoint| setpoint.name() == name);
    known.ok_or_else(|| bad_argument(format!("setpoint {name:?} is none")))
}

fn settings(py: Python<'_>, done: Result<Vec<Setting>, Failed>) -> PyResult<Py<PyAny>> {
    is_done(py, done?.into_iter().map(setting).collect::<Vec<_>>())
}
