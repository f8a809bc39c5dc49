//! `Profile` for Python: dictionaries, ints and floats where Rust has types.

use std::path::PathBuf;
use std::sync::Arc;

use drivebus_drives::{
    self as drives, Command, Control, Counts, Entry, Fault, Input, Kind, MemoryBit, ProfileError, Quantity, Setpoint,
    Store, UnitKind, Value,
};
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
        let path = path(folder)?;
        py.detach(|| drives::Profile::load(&path)).map(|profile| Self(Arc::new(profile))).map_err(refuse)
    }

    /// All that is wrong with a folder: file, line and reason of each; a file that cannot be read has no line.
    #[staticmethod]
    #[pyo3(signature = (folder, /))]
    fn check(py: Python<'_>, folder: &Bound<'_, PyAny>) -> PyResult<Vec<(String, Option<u64>, String)>> {
        let path = path(folder)?;
        let problems = py.detach(|| drives::Profile::check(&path));
        Ok(problems.into_iter().map(problem).collect())
    }

    #[getter]
    fn name(&self) -> &str {
        self.0.name()
    }

    #[getter]
    fn family(&self) -> &str {
        self.0.family()
    }

    #[getter]
    fn kind(&self) -> &'static str {
        match self.0.kind() {
            UnitKind::Inverter => "inverter",
            UnitKind::Rectifier => "rectifier",
        }
    }

    #[getter]
    fn version(&self) -> u32 {
        self.0.version()
    }

    #[getter]
    fn source(&self) -> &str {
        self.0.source()
    }

    #[getter]
    fn functions(&self) -> Vec<u16> {
        self.0.functions().iter().map(|&function| function.into()).collect()
    }

    fn requests<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let requests = self.0.requests();
        let dict = PyDict::new(py);
        dict.set_item("across_groups", requests.across_groups)?;
        dict.set_item("verified", requests.verified)?;
        dict.set_item("note", &requests.note)?;
        dict.set_item("source", &requests.source)?;
        Ok(dict)
    }

    fn serial<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(serial) = self.0.serial() else { return Ok(None) };
        let dict = PyDict::new(py);
        dict.set_item("baud_rate", serial.baud_rate)?;
        dict.set_item("format", format!("{}{}{}", serial.data_bits, serial.parity, serial.stop_bits))?;
        dict.set_item("unit", serial.unit)?;
        dict.set_item("response_delay", serial.response_delay.as_secs_f64())?;
        dict.set_item("verified", serial.verified)?;
        dict.set_item("source", &serial.source)?;
        Ok(Some(dict))
    }

    #[getter]
    fn title(&self) -> &str {
        self.0.title()
    }

    #[getter]
    fn max_words(&self) -> u16 {
        self.0.max_words()
    }

    #[pyo3(signature = (role, /))]
    fn role(&self, role: &Bound<'_, PyAny>) -> PyResult<Option<&str>> {
        Ok(self.0.role(&text("role", role)?).map(known_as))
    }

    fn status_words(&self) -> Vec<&str> {
        self.0.status_words().map(known_as).collect()
    }

    fn identifications<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let rows = self.0.identifications().iter().map(|row| {
            let dict = PyDict::new(py);
            dict.set_item("code", row.code)?;
            dict.set_item("family", &row.family)?;
            dict.set_item("title", &row.title)?;
            dict.set_item("shared", &row.shared)?;
            dict.set_item("verified", row.verified)?;
            dict.set_item("note", &row.note)?;
            dict.set_item("source", &row.source)?;
            Ok(dict)
        });
        rows.collect()
    }

    /// The addresses that a unit of this family answers, and those that it refuses.
    fn signature(&self) -> Option<(Vec<u16>, Vec<u16>)> {
        self.0.signature().map(|signature| (signature.answers.clone(), signature.refuses.clone()))
    }

    #[pyo3(signature = (code, /))]
    fn identify(&self, code: &Bound<'_, PyAny>) -> PyResult<Option<&str>> {
        Ok(self.0.identify(one_word("code", code)?).map(|identification| identification.family.as_str()))
    }

    fn names(&self) -> Vec<&str> {
        self.0.entries().map(Entry::name).collect()
    }

    #[pyo3(signature = (text, limit))]
    fn search(&self, text: &Bound<'_, PyAny>, limit: usize) -> PyResult<Vec<&str>> {
        Ok(self.0.search(&self::text("text", text)?, limit).into_iter().map(Entry::name).collect())
    }

    fn monitor_names(&self) -> Vec<&str> {
        self.0.monitor().map(known_as).collect()
    }

    fn fault_history(&self) -> Vec<&str> {
        self.0.fault_history().map(Entry::name).collect()
    }

    fn fault_values(&self) -> Vec<&str> {
        self.0.fault_values().map(Entry::name).collect()
    }

    fn acts(&self) -> Vec<&str> {
        self.0.acting().map(Entry::name).collect()
    }

    fn serial_parameters(&self) -> Vec<&str> {
        self.0.serial_parameters().map(Entry::name).collect()
    }

    fn motor_parameters(&self) -> Vec<&str> {
        self.0.motor_parameters().map(Entry::name).collect()
    }

    fn last_parameters(&self) -> Vec<&str> {
        self.0.last_parameters().map(Entry::name).collect()
    }

    /// Total, sourced, unverified and assumed rows, by what they are.
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, counts) in [
            ("registers", self.0.count_entries(Kind::Register)),
            ("parameters", self.0.count_entries(Kind::Parameter)),
            ("faults", self.0.count_faults()),
        ] {
            dict.set_item(name, counted(py, counts)?)?;
        }
        Ok(dict)
    }

    #[pyo3(signature = (name, /))]
    fn describe<'py>(&self, name: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        let py = name.py();
        let entry = self.find(name)?;
        let quantity = entry.quantity();
        let value = |value: Option<Value>| value.map(|value| number(py, quantity, value));
        let dict = PyDict::new(py);
        dict.set_item("name", known_as(entry))?;
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
        dict.set_item("evidence", entry.evidence().name())?;
        dict.set_item("note", entry.note())?;
        dict.set_item("words", entry.words())?;
        dict.set_item("variant", quantity.variant())?;
        Ok(dict)
    }

    #[pyo3(signature = (name, /, *, store = None))]
    fn address(&self, name: &Bound<'_, PyAny>, store: Option<bool>) -> PyResult<u16> {
        let entry = self.find(name)?;
        match store {
            None => self.0.read_address(entry).map_err(refuse),
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
        let quantity = entry.quantity();
        if entry.words() == 1 {
            return Ok(number(name.py(), quantity, entry.decode(one_word("raw", raw)?)));
        }
        let both: u32 =
            raw.extract().map_err(|_| not_allowed(format!("raw {} is not in 0..4294967295", shown(raw))))?;
        let words = [both & 0xFFFF, both >> 16].map(|word| u16::try_from(word).unwrap_or_default());
        let value = quantity.decode_words(&words);
        value.map(|value| number(name.py(), quantity, value)).ok_or_else(|| not_allowed("no words".to_owned()))
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

    /// Why a command is not verified; `None` where it is.
    #[pyo3(signature = (name, /))]
    fn command_reason(&self, name: &Bound<'_, PyAny>) -> PyResult<Option<&str>> {
        let command: Command = text("command", name)?.parse().map_err(refuse)?;
        Ok(self.0.command_note(command))
    }

    fn commands(&self) -> std::collections::BTreeMap<&'static str, u16> {
        self.0.commands().iter().map(|(command, known)| (command.name(), known.code)).collect()
    }

    fn command_codes(&self) -> std::collections::BTreeMap<u16, &str> {
        self.0.command_codes()
    }

    #[getter]
    fn command_address(&self) -> Option<u16> {
        self.0.command_address()
    }

    /// Whether `address` is a parameter's with the bit that says where it is kept: then the plain one.
    #[pyo3(signature = (address, /))]
    fn stored_address(&self, address: &Bound<'_, PyAny>) -> PyResult<Option<u16>> {
        Ok(self.0.stored_address(one_word("address", address)?))
    }

    fn memory<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(memory) = self.0.memory() else { return Ok(None) };
        let dict = PyDict::new(py);
        dict.set_item("bit", memory.bit)?;
        dict.set_item(
            "means",
            match memory.means {
                MemoryBit::Ram => "ram",
                MemoryBit::Eeprom => "eeprom",
            },
        )?;
        dict.set_item("reason", (!memory.verified).then_some(&memory.note))?;
        dict.set_item("source", &memory.source)?;
        Ok(Some(dict))
    }

    #[pyo3(signature = (address, /))]
    fn is_command(&self, address: &Bound<'_, PyAny>) -> PyResult<bool> {
        Ok(self.0.is_command(one_word("address", address)?))
    }

    #[pyo3(signature = (raw, /))]
    fn state(&self, raw: &Bound<'_, PyAny>) -> PyResult<&'static str> {
        Ok(self.0.state(one_word("raw", raw)?).name())
    }

    /// Why the states are not verified; `None` where they are, or where there are none.
    fn state_reason(&self) -> Option<&str> {
        self.0.state_word().filter(|word| !word.verified).map(|word| word.note.as_str())
    }

    fn control<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        self.items(py, self.0.control())
    }

    fn setpoint_names(&self) -> Vec<&'static str> {
        self.0.setpoints().keys().map(|setpoint| setpoint.name()).collect()
    }

    #[pyo3(signature = (setpoint, /))]
    fn needs<'py>(&self, setpoint: &Bound<'py, PyAny>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let name = text("setpoint", setpoint)?;
        let known = Setpoint::ALL.into_iter().find(|setpoint| setpoint.name() == name);
        let role = known.and_then(|setpoint| self.0.setpoints().get(&setpoint));
        let missing = || not_allowed(format!("{} has no setpoint {name}", self.0.name()));
        self.items(setpoint.py(), &role.ok_or_else(missing)?.needs)
    }

    fn variants<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for (name, variant) in self.0.variants() {
            let dict = PyDict::new(py);
            dict.set_item("parameter", &variant.parameter)?;
            let choices = PyDict::new(py);
            for (choice, known) in &variant.choices {
                choices.set_item(choice, known.word)?;
            }
            dict.set_item("choices", choices)?;
            dict.set_item("reason", (!variant.verified).then_some(&variant.note))?;
            dict.set_item("source", &variant.source)?;
            all.set_item(name, dict)?;
        }
        Ok(all)
    }

    #[getter]
    fn variants_chosen(&self) -> std::collections::BTreeMap<String, String> {
        self.0.chosen().clone()
    }

    #[pyo3(signature = (chosen, /))]
    fn with_variants(&self, chosen: &Bound<'_, PyAny>) -> PyResult<Self> {
        let pairs = chosen
            .call_method0("items")?
            .try_iter()?
            .map(|pair| {
                let (name, choice): (Bound<'_, PyAny>, Bound<'_, PyAny>) = pair?.extract()?;
                Ok((text("variant", &name)?, text("choice", &choice)?))
            })
            .collect::<PyResult<Vec<_>>>()?;
        let pairs = pairs.iter().map(|(name, choice)| (name.as_str(), choice.as_str()));
        self.0.with_variants(pairs).map(|profile| Self(Arc::new(profile))).map_err(refuse)
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
        dict.set_item("note", &watchdog.note)?;
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

    fn exceptions(&self) -> std::collections::BTreeMap<u8, (&str, &str)> {
        self.0.exceptions().map(|row| (row.code, (row.name.as_str(), row.meaning.as_str()))).collect()
    }

    #[pyo3(signature = (code, /))]
    fn exception(&self, code: &Bound<'_, PyAny>) -> PyResult<(String, String)> {
        let code = code.extract().map_err(|_| not_allowed(format!("code {} is not in 0..255", shown(code))))?;
        let exception = self.0.exception(code).into_owned();
        Ok((exception.name, exception.meaning))
    }
}

impl Profile {
    /// Parameters that must have certain values.
    fn items<'py>(&self, py: Python<'py>, rows: &[Control]) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let rows = rows.iter().map(|row| {
            let entry = self.0.find(&row.code).map_err(refuse)?;
            let dict = PyDict::new(py);
            dict.set_item("code", &row.code)?;
            dict.set_item("value", number(py, entry.quantity(), entry.decode(row.raw)))?;
            dict.set_item("label", &row.label)?;
            dict.set_item("verified", row.verified)?;
            dict.set_item("note", &row.note)?;
            dict.set_item("source", &row.source)?;
            Ok(dict)
        });
        rows.collect()
    }

    /// The register or parameter that `name` means.
    fn find(&self, name: &Bound<'_, PyAny>) -> PyResult<&Entry> {
        self.0.find(&text("name", name)?).map_err(refuse)
    }
}

/// What people call an entry: its name where it has one, else its code.
fn known_as(entry: &Entry) -> &str {
    entry.alias().unwrap_or_else(|| entry.name())
}

fn path(given: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
    given.extract().map_err(|_| not_allowed(format!("folder {} is no path", shown(given))))
}

fn problem(problem: ProfileError) -> (String, Option<u64>, String) {
    match problem {
        ProfileError::Broken { file, line, reason } => (file, Some(line), reason),
        ProfileError::Unreadable { file, reason } => (file, None, reason),
        other => (String::new(), None, other.to_string()),
    }
}

fn counted(py: Python<'_>, counts: Counts) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("total", counts.total)?;
    dict.set_item("sourced", counts.sourced)?;
    dict.set_item("unsourced", counts.total - counts.sourced)?;
    dict.set_item("unverified", counts.unverified)?;
    dict.set_item("assumed", counts.assumed)?;
    Ok(dict)
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
    dict.set_item("verified", fault.verified())?;
    dict.set_item("evidence", fault.evidence.name())?;
    dict.set_item("note", &fault.note)?;
    dict.set_item("source", &fault.source)?;
    Ok(dict)
}
