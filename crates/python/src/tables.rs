//! What a profile knows, as Python's dictionaries: one function for each kind of table.

use drivebus_drives::{
    BitField, Control, Counts, Entry, Fault, Identification, Kind, Memory, Profile, Quantity, Requests, SerialDefaults,
    Value, Watchdog,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyInt, PyTuple};

use crate::errors::refuse;

type Table<'py> = PyResult<Bound<'py, PyDict>>;

/// What people call an entry: its name where it has one, else its code.
pub(crate) fn known_as(entry: &Entry) -> &str {
    entry.alias().unwrap_or_else(|| entry.name())
}

/// `value` as a float where the drive measures, as an int where it counts or names: then a count is the value.
pub(crate) fn number<'py>(py: Python<'py>, quantity: &Quantity, value: Value) -> Bound<'py, PyAny> {
    if quantity.measures() {
        PyFloat::new(py, value.to_f64()).into_any()
    } else {
        PyInt::new(py, value.count()).into_any()
    }
}

pub(crate) fn description<'py>(py: Python<'py>, entry: &Entry) -> Table<'py> {
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
    dict.set_item("table", entry.table().name())?;
    dict.set_item("unit", quantity.unit())?;
    // Where the scale is not known the unit is "raw", and there is one count to it.
    match quantity.ratio().unwrap_or((1, 1)) {
        (counts, 1) => dict.set_item("scale", counts)?,
        (counts, units) => dict.set_item("scale", f64::from(counts) / f64::from(units))?,
    }
    dict.set_item("signed", quantity.is_signed())?;
    dict.set_item("low", value(quantity.low()))?;
    dict.set_item("high", value(quantity.high()))?;
    dict.set_item("low_from", quantity.low_from())?;
    dict.set_item("high_from", quantity.high_from())?;
    dict.set_item("default", value(entry.default_raw().map(|raw| entry.decode(raw))))?;
    dict.set_item("access", entry.access().name())?;
    dict.set_item("choices", quantity.choices())?;
    dict.set_item("bits", bits(py, entry)?)?;
    let unverified = entry.bits().iter().filter(|field| !field.verified());
    dict.set_item("unverified_bits", PyTuple::new(py, unverified.map(BitField::name).collect::<Vec<_>>())?)?;
    dict.set_item("source", entry.source())?;
    dict.set_item("verified", entry.verified())?;
    dict.set_item("evidence", entry.evidence().name())?;
    dict.set_item("note", entry.note())?;
    dict.set_item("words", entry.words())?;
    dict.set_item("high_first", quantity.is_high_first())?;
    dict.set_item("listed", entry.is_listed())?;
    dict.set_item("variant", quantity.variant())?;
    Ok(dict)
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

pub(crate) fn requests<'py>(py: Python<'py>, requests: &Requests) -> Table<'py> {
    let dict = PyDict::new(py);
    dict.set_item("protocol", requests.protocol.name())?;
    dict.set_item("max_written", requests.max_written)?;
    dict.set_item("joined", &requests.joined)?;
    dict.set_item("across_groups", requests.across_groups)?;
    dict.set_item("single_parameters", requests.single_parameters)?;
    dict.set_item("zeros", PyTuple::new(py, &requests.zeros)?)?;
    dict.set_item("absent", requests.absent)?;
    dict.set_item("verified", requests.verified)?;
    dict.set_item("note", &requests.note)?;
    dict.set_item("source", &requests.source)?;
    Ok(dict)
}

pub(crate) fn serial<'py>(py: Python<'py>, serial: &SerialDefaults) -> Table<'py> {
    let dict = PyDict::new(py);
    dict.set_item("baud_rate", serial.baud_rate)?;
    dict.set_item("format", format!("{}{}{}", serial.data_bits, serial.parity, serial.stop_bits))?;
    dict.set_item("unit", serial.unit)?;
    dict.set_item("response_delay", serial.response_delay.as_secs_f64())?;
    dict.set_item("verified", serial.verified)?;
    dict.set_item("source", &serial.source)?;
    Ok(dict)
}

pub(crate) fn memory<'py>(py: Python<'py>, memory: &Memory) -> Table<'py> {
    let dict = PyDict::new(py);
    let means = if memory.keeps(true) { "eeprom" } else { "ram" };
    let store = memory.store_word();
    dict.set_item("bit", store.is_none().then(|| memory.mask().trailing_zeros()))?;
    dict.set_item("means", if store.is_some() { "store" } else { means })?;
    dict.set_item("store_register", store.map(|store| &store.register))?;
    dict.set_item("store_word", store.map(|store| store.word))?;
    dict.set_item("reason", (!memory.verified).then_some(&memory.note))?;
    dict.set_item("source", &memory.source)?;
    Ok(dict)
}

pub(crate) fn identification<'py>(py: Python<'py>, row: &Identification) -> Table<'py> {
    let dict = PyDict::new(py);
    dict.set_item("code", row.code)?;
    dict.set_item("family", &row.family)?;
    dict.set_item("title", &row.title)?;
    dict.set_item("shared", &row.shared)?;
    dict.set_item("verified", row.verified)?;
    dict.set_item("note", &row.note)?;
    dict.set_item("source", &row.source)?;
    Ok(dict)
}

/// How much of `profile` is documented, by kind of row.
pub(crate) fn counts<'py>(py: Python<'py>, profile: &Profile) -> Table<'py> {
    let counted = |counts: Counts| -> Table<'py> {
        let dict = PyDict::new(py);
        dict.set_item("total", counts.total)?;
        dict.set_item("sourced", counts.sourced)?;
        dict.set_item("unsourced", counts.total - counts.sourced)?;
        dict.set_item("unverified", counts.unverified)?;
        dict.set_item("assumed", counts.assumed)?;
        Ok(dict)
    };
    let dict = PyDict::new(py);
    dict.set_item("registers", counted(profile.count_entries(Kind::Register))?)?;
    dict.set_item("parameters", counted(profile.count_entries(Kind::Parameter))?)?;
    dict.set_item("faults", counted(profile.count_faults())?)?;
    Ok(dict)
}

/// Parameters that must have certain values.
pub(crate) fn items<'py>(py: Python<'py>, profile: &Profile, rows: &[Control]) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let rows = rows.iter().map(|row| {
        let entry = profile.find(&row.code).map_err(refuse)?;
        let dict = PyDict::new(py);
        dict.set_item("code", &row.code)?;
        dict.set_item("bits", row.bits.map(|[high, low]| (high, low)))?;
        dict.set_item("value", number(py, entry.quantity(), entry.decode(row.raw)))?;
        dict.set_item("label", &row.label)?;
        dict.set_item("always", row.always)?;
        dict.set_item("by_hand", row.by_hand)?;
        dict.set_item("verified", row.verified)?;
        dict.set_item("note", &row.note)?;
        dict.set_item("source", &row.source)?;
        Ok(dict)
    });
    rows.collect()
}

/// The words before a run.
pub(crate) fn start_sequence<'py>(py: Python<'py>, profile: &Profile) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let steps = profile.start_sequence().iter().map(|step| {
        let until = PyDict::new(py);
        for field in &step.until {
            until.set_item(&field.field, field.value >> field.mask.trailing_zeros())?;
        }
        let dict = PyDict::new(py);
        dict.set_item("word", step.word)?;
        dict.set_item("label", &step.label)?;
        dict.set_item("until", until)?;
        dict.set_item("mask", step.until.iter().fold(0, |mask, field| mask | field.mask))?;
        dict.set_item("value", step.until.iter().fold(0, |value, field| value | field.value))?;
        Ok(dict)
    });
    steps.collect()
}

pub(crate) fn variants<'py>(py: Python<'py>, profile: &Profile) -> Table<'py> {
    let all = PyDict::new(py);
    for (name, variant) in profile.variants() {
        let choices = PyDict::new(py);
        for (choice, known) in &variant.choices {
            choices.set_item(choice, known.word)?;
        }
        let dict = PyDict::new(py);
        dict.set_item("parameter", &variant.parameter)?;
        dict.set_item("choices", choices)?;
        dict.set_item("between", profile.share_between(variant))?;
        dict.set_item("reason", (!variant.verified).then_some(&variant.note))?;
        dict.set_item("source", &variant.source)?;
        all.set_item(name, dict)?;
    }
    Ok(all)
}

pub(crate) fn watchdog<'py>(py: Python<'py>, watchdog: &Watchdog) -> Table<'py> {
    let actions = PyDict::new(py);
    for (name, word) in [("coast", watchdog.coast), ("stop", watchdog.stop), ("trip", watchdog.trip)] {
        if let Some(word) = word {
            actions.set_item(name, word)?;
        }
    }
    let dict = PyDict::new(py);
    dict.set_item("timeout", &watchdog.timeout)?;
    dict.set_item("action", &watchdog.action)?;
    dict.set_item("actions", actions)?;
    dict.set_item("fault", watchdog.fault)?;
    dict.set_item("verified", watchdog.verified)?;
    dict.set_item("note", &watchdog.note)?;
    dict.set_item("source", &watchdog.source)?;
    Ok(dict)
}

pub(crate) fn fault<'py>(py: Python<'py>, fault: &Fault) -> Table<'py> {
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
