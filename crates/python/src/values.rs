//! `Values` for Python: what one call writes to a unit and reads from it by name, and why not, as a kind and what Python words.

use drivebus_drive::task::Mailbox;
use drivebus_drive::{self as drive, Families, FieldInput, Setting};
use drivebus_drives::{Input, Profile, Store};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyString};

use crate::convert::shown;
use crate::errors::bad_argument;
use crate::not_kept::{not_given, not_kept, not_prepared, not_read, not_set_bits};
use crate::tables::number;
use crate::task::{Failed, Task};
use crate::unit::{Unit, is_done, setpoint_of, setting};

/// The values of a unit, as one call sees it; see `python/drivebus/_native.pyi`.
#[pyclass(name = "Values", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Values(drive::Unit);

/// A value, as Python gives it.
enum Given {
    Integer(i64),
    Float(f64),
    Text(String),
    /// Decimal, numpy's floats, integers of any size: what they print is what they are.
    Decimal(String),
}

impl Given {
    fn of(profile: &Profile, name: &str, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        let is_switch = |name| {
            let entry = profile.resolve(name).ok()?;
            Some(entry.quantity().high().is_some_and(|high| high.to_string() == "1"))
        };
        // A switch is on or off. Anything else that is told True was meant for another name.
        if value.is_instance_of::<PyBool>() && is_switch(name) == Some(false) {
            return Err(bad_argument(format!("{name} = {}: not a number", shown(value))));
        }
        Ok(if let Ok(float) = value.cast::<PyFloat>() {
            Self::Float(float.extract()?)
        } else if let Ok(integer) = value.extract() {
            Self::Integer(integer)
        } else if value.is_instance_of::<PyString>() {
            Self::Text(value.extract()?)
        } else {
            Self::Decimal(value.str().map_or_else(|_| shown(value), |digits| digits.to_string()))
        })
    }

    fn input(&self) -> Input<'_> {
        match self {
            Self::Integer(integer) => Input::Integer(*integer),
            Self::Float(float) => Input::Float(*float),
            Self::Text(text) => Input::Text(text),
            Self::Decimal(digits) => Input::Decimal(digits),
        }
    }
}

/// What a field of a word is to be, as Python gives it.
#[derive(FromPyObject)]
enum Field {
    Switch(bool),
    Number(i64),
    Label(String),
}

impl Field {
    fn input(&self) -> FieldInput<'_> {
        match self {
            Self::Switch(is_on) => FieldInput::Switch(*is_on),
            Self::Number(number) => FieldInput::Number(*number),
            Self::Label(label) => FieldInput::Label(label),
        }
    }
}

#[pymethods]
impl Values {
    #[new]
    #[pyo3(signature = (unit, /))]
    fn new(unit: &Unit) -> Self {
        Self(unit.0.clone())
    }

    #[pyo3(signature = (wanted, store, /))]
    fn write(&self, wanted: Vec<(String, Bound<'_, PyAny>)>, store: bool) -> PyResult<Task> {
        let given = |(name, value): (String, _)| {
            let given = Given::of(self.0.profile(), &name, &value)?;
            Ok((name, given))
        };
        let wanted = wanted.into_iter().map(given).collect::<PyResult<Vec<_>>>()?;
        let told = |py: Python<'_>, done: Result<(), _>| match done {
            Ok(()) => is_done(py, ()),
            Err(why) => not_kept(py, why),
        };
        let work = move |unit: drive::Unit, line| async move {
            let wanted: Vec<_> = wanted.iter().map(|(name, given)| (name.as_str(), given.input())).collect();
            unit.write_values(&line, Families::shipped(), &wanted, store_of(store)).await
        };
        Ok(self.task(work, told))
    }

    #[pyo3(signature = (setpoint, store, /))]
    fn prepare(&self, setpoint: &str, store: bool) -> PyResult<Task> {
        let setpoint = setpoint_of(setpoint)?;
        let told = |py: Python<'_>, done: Result<Vec<Setting>, _>| match done {
            Ok(settings) => is_done(py, settings.into_iter().map(setting).collect::<Vec<_>>()),
            Err(why) => not_prepared(py, why),
        };
        let work = move |unit: drive::Unit, line| async move {
            unit.prepare(&line, Families::shipped(), setpoint, store_of(store)).await
        };
        Ok(self.task(work, told))
    }

    #[pyo3(signature = (setpoint, value, /))]
    fn give_setpoint(&self, setpoint: &str, value: f64) -> PyResult<Task> {
        let setpoint = setpoint_of(setpoint)?;
        let told = |py: Python<'_>, done: Result<(), _>| match done {
            Ok(()) => is_done(py, ()),
            Err(why) => not_given(py, why),
        };
        let work = move |unit: drive::Unit, line| async move {
            unit.give_setpoint(&line, Families::shipped(), setpoint, Input::Float(value)).await
        };
        Ok(self.task(work, told))
    }

    #[pyo3(signature = (setpoint, fields, force, /))]
    fn set_bits(&self, setpoint: &str, fields: Vec<(String, Field)>, force: bool) -> PyResult<Task> {
        let setpoint = setpoint_of(setpoint)?;
        let told = |py: Python<'_>, done: Result<(), _>| match done {
            Ok(()) => is_done(py, ()),
            Err(why) => not_set_bits(py, why),
        };
        let work = move |unit: drive::Unit, line| async move {
            let fields: Vec<_> = fields.iter().map(|(name, field)| (name.as_str(), field.input())).collect();
            unit.set_bits(&line, Families::shipped(), setpoint, &fields, force).await
        };
        Ok(self.task(work, told))
    }

    #[pyo3(signature = (names, /))]
    fn read(&self, names: Vec<String>) -> Task {
        let asked = names.clone();
        let told = move |py: Python<'_>, done: Result<drive::Values, _>| match done {
            Ok(came) => {
                let known = asked.iter().filter_map(|name| came.profile.resolve(name).ok());
                let values = known.zip(came.values).map(|(entry, value)| number(py, entry.quantity(), value).unbind());
                let values: Vec<_> = values.collect();
                let (started, ended) = (came.asked.as_secs_f64(), came.answered.as_secs_f64());
                is_done(py, (values, came.profile.chosen().clone(), started, ended))
            }
            Err(why) => not_read(py, why),
        };
        let work = |unit: drive::Unit, line| async move {
            unit.read_values(&line, &names.iter().map(String::as_str).collect::<Vec<_>>()).await
        };
        self.task(work, told)
    }
}

impl Values {
    fn task<T, F>(
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

const fn store_of(store: bool) -> Store {
    if store { Store::Eeprom } else { Store::Ram }
}
