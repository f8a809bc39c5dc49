//! `Profile` for Python: what it asks of a profile, in Python's words.

use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::Arc;

use drivebus_drive::task::Payload;
use drivebus_drives::{self as drives, Command, Entry, Place, ProfileError, Setpoint, Store};
use drivebus_rtu::{ExceptionCode, Meanings};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{one_word, place_of, shown};
use crate::errors::{bad_argument, refuse};
use crate::given::given;
use crate::plan::Plan;
use crate::tables::{self, known_as, number};

/// What one family of drives means by its registers.
#[pyclass(name = "Profile", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Profile(Arc<drives::Profile>);

impl Profile {
    /// What it is in the core.
    pub(crate) fn core(&self) -> Arc<drives::Profile> {
        Arc::clone(&self.0)
    }

    /// What its exceptions mean to this family.
    pub(crate) fn meanings(&self) -> Meanings {
        drivebus_drive::meanings(&self.0)
    }
}

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

    #[staticmethod]
    fn schema() -> &'static str {
        drives::Profile::schema()
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
        self.0.kind().name()
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
        tables::requests(py, self.0.requests())
    }

    fn serial<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.0.serial().map(|serial| tables::serial(py, serial)).transpose()
    }

    #[getter]
    fn title(&self) -> &str {
        self.0.title()
    }

    #[getter]
    fn maker(&self) -> &str {
        &self.0.called().maker
    }

    #[getter]
    fn models(&self) -> Vec<&str> {
        self.0.called().models.iter().map(String::as_str).collect()
    }

    /// Name, note and source of each.
    fn aliases(&self) -> Vec<(&str, &str, &str)> {
        let aliases = self.0.called().aliases.iter();
        aliases.map(|alias| (alias.name.as_str(), alias.note.as_str(), alias.source.as_str())).collect()
    }

    #[getter]
    fn max_words(&self) -> u16 {
        self.0.max_words()
    }

    fn parameter_groups(&self) -> Vec<u16> {
        // Bytes would become a `bytes` object.
        self.0.parameter_groups().map(u16::from).collect()
    }

    fn unlisted_groups(&self) -> Vec<u16> {
        self.0.unlisted_groups().map(u16::from).collect()
    }

    #[pyo3(signature = (role, /))]
    fn role(&self, role: &Bound<'_, PyAny>) -> PyResult<Option<&str>> {
        Ok(self.0.role(&text("role", role)?).map(known_as))
    }

    fn status_words(&self) -> Vec<&str> {
        self.0.status_words().map(known_as).collect()
    }

    fn reports_as(&self) -> Vec<String> {
        self.0.reports_as().to_vec()
    }

    fn identifications<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        self.0.identifications().iter().map(|row| tables::identification(py, row)).collect()
    }

    /// The addresses that a unit of this family answers, and those that it refuses.
    fn signature(&self) -> Option<(Vec<u32>, Vec<u32>)> {
        let numbers = |places: &[Place]| places.iter().map(|place| place.number()).collect();
        self.0.signature().map(|signature| (numbers(&signature.answers), numbers(&signature.refuses)))
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
        tables::counts(py, &self.0)
    }

    #[pyo3(signature = (name, /))]
    fn describe<'py>(&self, name: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        tables::description(name.py(), &*self.find(name)?)
    }

    #[pyo3(signature = (name, /, *, store = None))]
    fn address(&self, name: &Bound<'_, PyAny>, store: Option<bool>) -> PyResult<u32> {
        let entry = self.find(name)?;
        let place = match store {
            None => self.0.read_address(&entry).map_err(refuse),
            Some(false) => self.0.write_address(&entry, Store::Ram).map_err(refuse),
            Some(true) => self.0.write_address(&entry, Store::Eeprom).map_err(refuse),
        };
        place.map(Place::number)
    }

    #[pyo3(signature = (name, /))]
    fn read_back(&self, name: &Bound<'_, PyAny>) -> PyResult<Option<u32>> {
        Ok(self.0.read_back(&*self.find(name)?).map(Place::number))
    }

    #[pyo3(signature = (name, raw, /))]
    fn decode<'py>(&self, name: &Bound<'py, PyAny>, raw: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let entry = self.find(name)?;
        let quantity = entry.quantity();
        if entry.words() == 1 {
            return Ok(number(name.py(), quantity, entry.decode(one_word("raw", raw)?)));
        }
        let both: u32 = raw
            .extract()
            .map_err(|_| bad_argument(format!("raw {} is not a number from 0 to 4294967295", shown(raw))))?;
        Ok(number(name.py(), quantity, quantity.decode_raw(both)))
    }

    #[pyo3(signature = (name, value, /))]
    fn encode(&self, name: &Bound<'_, PyAny>, value: &Bound<'_, PyAny>) -> PyResult<u32> {
        let entry = self.find(name)?;
        entry.encode_words(given(&entry, value)?.input()).map(|words| entry.quantity().raw(&words)).map_err(refuse)
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
    fn plan(&self, names: &Bound<'_, PyAny>) -> PyResult<Vec<(u32, u16)>> {
        let entries = names.try_iter()?.map(|name| self.find(&name?)).collect::<PyResult<Vec<_>>>()?;
        let spans = self.0.plan(entries.iter().map(AsRef::as_ref)).map_err(refuse)?;
        Ok(spans.into_iter().map(|span| (span.place().number(), span.count)).collect())
    }

    #[pyo3(signature = (names, /))]
    fn compile(&self, names: &Bound<'_, PyAny>) -> PyResult<Plan> {
        let names = names.try_iter()?.map(|name| text("name", &name?)).collect::<PyResult<Vec<_>>>()?;
        let entries = names.iter().map(|name| self.0.resolve(name).map_err(refuse)).collect::<PyResult<Vec<_>>>()?;
        let plan = self.0.compile(&entries.iter().map(AsRef::as_ref).collect::<Vec<_>>()).map_err(refuse)?;
        Ok(Plan::new(names, plan))
    }

    #[pyo3(signature = (name, /))]
    fn command(&self, name: &Bound<'_, PyAny>) -> PyResult<(u32, u16)> {
        let command: Command = text("command", name)?.parse().map_err(refuse)?;
        let missing = || bad_argument(format!("{} has no command {}", self.0.name(), command.name()));
        self.0.command(command).map(|(place, code)| (place.number(), code)).ok_or_else(missing)
    }

    /// What is written before a command, if anything.
    #[pyo3(signature = (name, /))]
    fn command_first(&self, name: &Bound<'_, PyAny>) -> PyResult<Option<(u32, u16)>> {
        let command: Command = text("command", name)?.parse().map_err(refuse)?;
        Ok(self.0.command_first(command).map(|(place, code)| (place.number(), code)))
    }

    /// Why a command is not verified; `None` where it is.
    #[pyo3(signature = (name, /))]
    fn command_reason(&self, name: &Bound<'_, PyAny>) -> PyResult<Option<&str>> {
        let command: Command = text("command", name)?.parse().map_err(refuse)?;
        Ok(self.0.command_reason(command))
    }

    fn commands(&self) -> std::collections::BTreeMap<&'static str, u16> {
        self.0.commands().iter().map(|(command, known)| (command.name(), known.code)).collect()
    }

    fn command_codes(&self) -> std::collections::BTreeMap<u16, &str> {
        self.0.command_codes()
    }

    fn command_registers(&self) -> std::collections::BTreeMap<u32, std::collections::BTreeMap<u16, &str>> {
        self.0.command_registers().into_iter().map(|(place, codes)| (place.number(), codes)).collect()
    }

    fn start_sequence<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        tables::start_sequence(py, &self.0)
    }

    /// Whether a single word is written by 10H.
    #[getter]
    fn is_written_by_many(&self) -> bool {
        matches!(Payload::Word(0).as_written(&self.0), Payload::Words(_))
    }

    #[getter]
    fn command_address(&self) -> Option<u32> {
        self.0.command_address().map(Place::number)
    }

    /// Whether `address` is a parameter's with the bit that says where it is kept: then the plain one.
    #[pyo3(signature = (address, /))]
    fn stored_address(&self, address: &Bound<'_, PyAny>) -> PyResult<Option<u16>> {
        Ok(self.0.stored_address(place_of(address)?))
    }

    fn memory<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.0.memory().map(|memory| tables::memory(py, memory)).transpose()
    }

    #[pyo3(signature = (address, /))]
    fn is_command(&self, address: &Bound<'_, PyAny>) -> PyResult<bool> {
        Ok(self.0.is_command(place_of(address)?))
    }

    #[pyo3(signature = (raw, /))]
    fn state(&self, raw: &Bound<'_, PyAny>) -> PyResult<&'static str> {
        Ok(self.0.state(one_word("raw", raw)?).name())
    }

    /// Whether the state word `raw` says that the drive is in fault, which it may run in.
    #[pyo3(signature = (raw, /))]
    fn is_in_fault(&self, raw: &Bound<'_, PyAny>) -> PyResult<bool> {
        Ok(self.0.is_in_fault(one_word("raw", raw)?))
    }

    /// Whether a motor only rests once its output frequency is zero, too.
    fn rest_by_frequency(&self) -> bool {
        self.0.state_word().is_some_and(|word| word.rest_by_frequency)
    }

    /// Whether the state word can say that the drive is in fault.
    fn state_tells_fault(&self) -> bool {
        self.0.state_tells_fault()
    }

    /// Why the states are not verified; `None` where they are, or where there are none.
    fn state_reason(&self) -> Option<&str> {
        self.0.state_reason()
    }

    fn control<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        tables::items(py, &self.0, self.0.control())
    }

    fn setpoint_names(&self) -> Vec<&'static str> {
        self.0.setpoints().keys().map(|setpoint| setpoint.name()).collect()
    }

    #[pyo3(signature = (setpoint, /))]
    fn needs<'py>(&self, setpoint: &Bound<'py, PyAny>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let name = text("setpoint", setpoint)?;
        let known = Setpoint::ALL.into_iter().find(|setpoint| setpoint.name() == name);
        let role = known.and_then(|setpoint| self.0.setpoints().get(&setpoint));
        let missing = || bad_argument(format!("{} has no setpoint {name}", self.0.name()));
        tables::items(setpoint.py(), &self.0, &role.ok_or_else(missing)?.needs)
    }

    fn variants<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        tables::variants(py, &self.0)
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
        self.0.watchdog().map(|watchdog| tables::watchdog(py, watchdog)).transpose()
    }

    #[pyo3(signature = (code, /))]
    fn fault<'py>(&self, code: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        tables::fault(code.py(), &self.0.fault(one_word("code", code)?))
    }

    #[pyo3(signature = (raw, /))]
    fn fault_number(&self, raw: &Bound<'_, PyAny>) -> PyResult<u16> {
        Ok(self.0.fault_number(one_word("raw", raw)?))
    }

    fn faults<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        self.0.faults().map(|row| tables::fault(py, row)).collect()
    }

    fn exceptions(&self) -> std::collections::BTreeMap<u8, (&str, &str)> {
        self.0.exceptions().map(|row| (row.code, (row.name.as_str(), row.meaning.as_str()))).collect()
    }

    #[pyo3(signature = (code, /))]
    fn exception(&self, code: &Bound<'_, PyAny>) -> PyResult<(String, String)> {
        let code =
            code.extract().map_err(|_| bad_argument(format!("code {} is not a number from 0 to 255", shown(code))))?;
        let exception = self.0.exception(code).into_owned();
        Ok((exception.name, exception.meaning))
    }

    #[pyo3(signature = (code, /))]
    fn exception_means(&self, code: &Bound<'_, PyAny>) -> PyResult<&'static str> {
        let code =
            code.extract().map_err(|_| bad_argument(format!("code {} is not a number from 0 to 255", shown(code))))?;
        Ok(self.meanings().of(ExceptionCode(code)).name())
    }
}

impl Profile {
    /// The register or parameter that `name` means, listed or not.
    fn find(&self, name: &Bound<'_, PyAny>) -> PyResult<Cow<'_, Entry>> {
        entry_of(&self.0, name)
    }
}

/// The register or parameter of `profile` that `name` means, listed or not.
pub(crate) fn entry_of<'p>(profile: &'p drives::Profile, name: &Bound<'_, PyAny>) -> PyResult<Cow<'p, Entry>> {
    profile.resolve(&text("name", name)?).map_err(refuse)
}

/// What an exception means by the specification.
#[pyfunction]
#[pyo3(signature = (code, /))]
pub(crate) fn exception_means(code: u8) -> &'static str {
    ExceptionCode(code).meaning().name()
}

fn path(given: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
    given.extract().map_err(|_| bad_argument(format!("folder {} is not a path", shown(given))))
}

fn problem(problem: ProfileError) -> (String, Option<u64>, String) {
    match problem {
        ProfileError::Broken { file, line, reason } => (file, Some(line), reason),
        ProfileError::Unreadable { file, reason } => (file, None, reason),
        other => (String::new(), None, other.to_string()),
    }
}

/// A `str`.
fn text(what: &str, given: &Bound<'_, PyAny>) -> PyResult<String> {
    given.extract().map_err(|_| bad_argument(format!("{what} {} is not a text", shown(given))))
}
