//! `Values` for Python: what one call writes to a unit by name, and why not, as a kind and what Python words.

use drivebus_drive::{self as drive, Families, FieldInput, Setting};
use drivebus_drives::{Input, Store};
use pyo3::prelude::*;

use crate::errors::refuse;
use crate::given::given;
use crate::not_done::setting;
use crate::not_kept::{not_given, not_kept, not_prepared, not_set_bits, not_stored};
use crate::task::{Task, is_done, or_why};
use crate::unit::{Unit, setpoint_of};

/// The values of a unit, as one call sees it; see `python/drivebus/_native.pyi`.
#[pyclass(name = "Values", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Values(Unit);

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
        Self(unit.again())
    }

    #[pyo3(signature = (wanted, store, /))]
    fn write(&self, wanted: Vec<(String, Bound<'_, PyAny>)>, store: bool) -> PyResult<Task> {
        let profile = self.0.profile();
        let kept = |(name, value): (String, _)| {
            // Whoever writes it says what is no name.
            let value = profile.resolve(&name).map_err(refuse).and_then(|entry| given(&entry, &value))?;
            Ok((name, value))
        };
        let wanted = wanted.into_iter().map(kept).collect::<PyResult<Vec<_>>>()?;
        let told = or_why(not_kept);
        let work = move |unit: drive::Unit, line| async move {
            let wanted: Vec<_> = wanted.iter().map(|(name, given)| (name.as_str(), given.input())).collect();
            unit.write_values(&line, Families::shipped(), &wanted, store_of(store)).await
        };
        Ok(self.0.task(work, told))
    }

    fn store(&self) -> Task {
        self.0.task(async |unit, line| unit.store_all(&line, Families::shipped()).await, or_why(not_stored))
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
        Ok(self.0.task(work, told))
    }

    #[pyo3(signature = (setpoint, value, /))]
    fn give_setpoint(&self, setpoint: &str, value: f64) -> PyResult<Task> {
        let setpoint = setpoint_of(setpoint)?;
        let told = or_why(not_given);
        let work = move |unit: drive::Unit, line| async move {
            unit.give_setpoint(&line, Families::shipped(), setpoint, Input::Float(value)).await
        };
        Ok(self.0.task(work, told))
    }

    #[pyo3(signature = (setpoint, fields, force, /))]
    fn set_bits(&self, setpoint: &str, fields: Vec<(String, Field)>, force: bool) -> PyResult<Task> {
        let setpoint = setpoint_of(setpoint)?;
        let told = or_why(not_set_bits);
        let work = move |unit: drive::Unit, line| async move {
            let fields: Vec<_> = fields.iter().map(|(name, field)| (name.as_str(), field.input())).collect();
            unit.set_bits(&line, Families::shipped(), setpoint, &fields, force).await
        };
        Ok(self.0.task(work, told))
    }
}

const fn store_of(store: bool) -> Store {
    if store { Store::Eeprom } else { Store::Ram }
}
