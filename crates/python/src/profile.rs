//! `Profile` for Python: dictionaries, ints and floats where Rust has types.

use std::path::PathBuf;
use std::sync::Arc;

use drivebus_drives::{self as drives, Command, Entry, Fault, Input, Kind, Quantity, Store, Value};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyInt, PyString};

use crate::convert::{one_word, shown};
use crate::errors::{not_allowed, refuse};
use crate::plan::Plan;

/// What one family of drives means by its registers.
#[pyclass(name = "Profile", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Profile(Arc<drives::Profile>);

#[pymethods]
impl Profile {
    #[staticmethod]
    #[pyo3(signature = (name, /))]
    fn builtin(name: &Bound<'_, PyAny>) -> PyResult<Self> {
        drives::Profile::builtin(&text("profile", name)?).map(Self).map_err(refuse)
    }

    #[staticmethod]
    fn builtin_names() -> Vec<&'static str> {
        drives::Profile::builtin_names().collect()
    }

    #[staticmethod]
    #[pyo3(signature = (folder, /))]
    fn load(py: Python<'_>, folder: &Bound<'_, PyAny>) -> PyResult<Self> {
        let path: PathBuf =
            folder.extract().map_err(|_| not_allowed(format!("folder {} is no path", shown(folder))))?;
        py.detach(|| drives::Profile::load(&path)).map(|profile| Self(Arc::new(profile))).map_err(refuse)
    }

    #[getter]
    fn name(&self) -> &str {
        self.0.name()
    }

    #[getter]
    fn title(&self) -> &str {
        self.0.title()
    }

    #[getter]
    fn max_words(&self) -> u16 {
        self.0.max_words()
    }

    #[getter]
    fn identification_address(&self) -> u16 {
        self.0.identification_address()
    }

    #[pyo3(signature = (code, /))]
    fn identify(&self, code: &Bound<'_, PyAny>) -> PyResult<Option<&str>> {
        Ok(self.0.identify(one_word("code", code)?).map(|identification| identification.family.as_str()))
    }

    fn names(&self) -> Vec<&str> {
        self.0.entries().map(Entry::name).collect()
    }

    fn monitor_names(&self) -> Vec<&str> {
        self.0.monitor().map(Entry::name).collect()
    }

    fn fault_history(&self) -> Vec<&str> {
        self.0.fault_history().map(Entry::name).collect()
    }

    #[pyo3(signature = (name, /))]
    fn describe<'py>(&self, name: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        let py = name.py();
        let entry = self.find(name)?;
        let quantity = entry.quantity();
        let value = |value: Option<Value>| value.map(|value| number(py, quantity, value));
        let dict = PyDict::new(py);
        dict.set_item("name", entry.name())?;
        dict.set_item("code", entry.code())?;
        dict.set_item("label", entry.label())?;
        dict.set_item(
            "kind",
            match entry.kind() {
                Kind::Register => "register",
                Kind::Parameter => "parameter",
            },
        )?;
        dict.set_item("address", entry.address())?;
        dict.set_item("unit", quantity.unit())?;
        // Where the scale is not known the unit is "raw", and there is one count to it.
        dict.set_item("scale", quantity.scale().unwrap_or(1))?;
        dict.set_item("signed", quantity.is_signed())?;
        dict.set_item("low", value(quantity.low()))?;
        dict.set_item("high", value(quantity.high()))?;
        dict.set_item("low_from", quantity.low_from())?;
        dict.set_item("high_from", quantity.high_from())?;
        dict.set_item("default", value(entry.default_raw().map(|raw| entry.decode(raw))))?;
        dict.set_item("access", entry.access().name())?;
        dict.set_item("choices", quantity.choices())?;
        dict.set_item("bits", bits(py, entry)?)?;
        dict.set_item("source", entry.source())?;
        dict.set_item("verified", entry.verified())?;
        dict.set_item("note", entry.note())?;
        Ok(dict)
    }

    #[pyo3(signature = (name, /, *, store = None))]
    fn address(&self, name: &Bound<'_, PyAny>, store: Option<bool>) -> PyResult<u16> {
        let entry = self.find(name)?;
        match store {
            None => Ok(entry.address()),
            Some(false) => self.0.write_address(entry, Store::Ram).map_err(refuse),
            Some(true) => self.0.write_address(entry, Store::Eeprom).map_err(refuse),
        }
    }

    #[pyo3(signature = (name, /))]
    fn read_back(&self, name: &Bound<'_, PyAny>) -> PyResult<Option<u16>> {
        Ok(self.0.read_back(self.find(name)?))
    }

    #[pyo3(signature = (name, raw, /))]
    fn decode<'py>(&self, name: &Bound<'py, PyAny>, raw: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let entry = self.find(name)?;
        Ok(number(name.py(), entry.quantity(), entry.decode(one_word("raw", raw)?)))
    }

    #[pyo3(signature = (name, value, /))]
    fn encode(&self, name: &Bound<'_, PyAny>, value: &Bound<'_, PyAny>) -> PyResult<u16> {
        let entry = self.find(name)?;
        let word = if let Ok(float) = value.cast::<PyFloat>() {
            entry.encode(float.extract::<f64>()?)
        } else if let Ok(integer) = value.extract::<i64>() {
            entry.encode(integer)
        } else if value.is_instance_of::<PyString>() {
            entry.encode(Input::Text(&text("value", value)?))
        } else {
            // Decimal, numpy's floats, integers of any size: what they print is what they are.
            let digits = value.str().map_or_else(|_| shown(value), |digits| digits.to_string());
            entry.encode(Input::Decimal(&digits))
        };
        word.map_err(refuse)
    }

    #[pyo3(signature = (name, raw, /))]
    fn fields<'py>(&self, name: &Bound<'py, PyAny>, raw: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        let entry = self.find(name)?;
        let raw = one_word("raw", raw)?;
        let dict = PyDict::new(name.py());
        for field in entry.bits() {
            dict.set_item(field.name(), field.meaning(raw))?;
        }
        Ok(dict)
    }

    #[pyo3(signature = (names, /))]
    fn plan(&self, names: &Bound<'_, PyAny>) -> PyResult<Vec<(u16, u16)>> {
        let entries = names.try_iter()?.map(|name| self.find(&name?)).collect::<PyResult<Vec<_>>>()?;
        let spans = self.0.plan(entries).map_err(refuse)?;
        Ok(spans.into_iter().map(|span| (span.address, span.count)).collect())
    }

    #[pyo3(signature = (names, /))]
    fn compile(&self, names: &Bound<'_, PyAny>) -> PyResult<Plan> {
        let names = names.try_iter()?.map(|name| text("name", &name?)).collect::<PyResult<Vec<_>>>()?;
        let entries = names.iter().map(|name| self.0.find(name).map_err(refuse)).collect::<PyResult<Vec<_>>>()?;
        let plan = self.0.compile(&entries).map_err(refuse)?;
        Ok(Plan::new(names, plan))
    }

    #[pyo3(signature = (name, /))]
    fn command(&self, name: &Bound<'_, PyAny>) -> PyResult<(u16, u16)> {
        let command: Command = text("command", name)?.parse().map_err(refuse)?;
        let missing = || not_allowed(format!("{} has no command {}", self.0.name(), command.name()));
        self.0.command(command).ok_or_else(missing)
    }

    #[pyo3(signature = (address, /))]
    fn is_command(&self, address: &Bound<'_, PyAny>) -> PyResult<bool> {
        Ok(self.0.is_command(one_word("address", address)?))
    }

    #[pyo3(signature = (raw, /))]
    fn state(&self, raw: &Bound<'_, PyAny>) -> PyResult<&'static str> {
        Ok(self.0.state(one_word("raw", raw)?).name())
    }

    fn control<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let rows = self.0.control().iter().map(|row| {
            let entry = self.0.find(&row.code).map_err(refuse)?;
            let dict = PyDict::new(py);
            dict.set_item("code", &row.code)?;
            dict.set_item("value", number(py, entry.quantity(), entry.decode(row.raw)))?;
            dict.set_item("label", &row.label)?;
            dict.set_item("verified", row.verified)?;
            dict.set_item("note", &row.note)?;
            Ok(dict)
        });
        rows.collect()
    }

    fn watchdog<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(watchdog) = self.0.watchdog() else {
            return Ok(None);
        };
        let actions = PyDict::new(py);
        for (name, word) in [("coast", watchdog.coast), ("stop", watchdog.stop)] {
            if let Some(word) = word {
                actions.set_item(name, word)?;
            }
        }
        let dict = PyDict::new(py);
        dict.set_item("timeout", &watchdog.timeout)?;
        dict.set_item("action", &watchdog.action)?;
        dict.set_item("actions", actions)?;
        dict.set_item("verified", watchdog.verified)?;
        dict.set_item("source", &watchdog.source)?;
        Ok(Some(dict))
    }

    #[pyo3(signature = (code, /))]
    fn fault<'py>(&self, code: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        fault(code.py(), &self.0.fault(one_word("code", code)?))
    }

    fn faults<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        self.0.faults().map(|row| fault(py, row)).collect()
    }

    #[pyo3(signature = (code, /))]
    fn exception(&self, code: &Bound<'_, PyAny>) -> PyResult<(String, String)> {
        let code = code.extract().map_err(|_| not_allowed(format!("code {} is not in 0..255", shown(code))))?;
        let exception = self.0.exception(code).into_owned();
        Ok((exception.name, exception.meaning))
    }
}

impl Profile {
    /// The register or parameter that `name` means.
    fn find(&self, name: &Bound<'_, PyAny>) -> PyResult<&Entry> {
        self.0.find(&text("name", name)?).map_err(refuse)
    }
}

/// A `str`.
fn text(what: &str, given: &Bound<'_, PyAny>) -> PyResult<String> {
    given.extract().map_err(|_| not_allowed(format!("{what} {} is no text", shown(given))))
}

/// `value` as a float where the drive measures, as an int where it counts or names.
pub(crate) fn number<'py>(py: Python<'py>, quantity: &Quantity, value: Value) -> Bound<'py, PyAny> {
    if quantity.measures() {
        PyFloat::new(py, value.to_f64()).into_any()
    } else {
        PyInt::new(py, value.count()).into_any()
    }
}

/// The bit fields of `entry` and what their values mean; `None` where there are none.
fn bits<'py>(py: Python<'py>, entry: &Entry) -> PyResult<Option<Bound<'py, PyDict>>> {
    if entry.bits().is_empty() {
        return Ok(None);
    }
    let dict = PyDict::new(py);
    for field in entry.bits() {
        dict.set_item(field.name(), field.values())?;
    }
    Ok(Some(dict))
}

fn fault<'py>(py: Python<'py>, fault: &Fault) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("code", fault.code)?;
    dict.set_item("mnemonic", &fault.mnemonic)?;
    dict.set_item("label", &fault.label)?;
    dict.set_item("cause", &fault.cause)?;
    dict.set_item("remedy", &fault.remedy)?;
    dict.set_item("verified", fault.verified)?;
    dict.set_item("source", &fault.source)?;
    Ok(dict)
}
