//! Python's numbers and bytes as the core's, or `NotAllowed` that names what was given and what is allowed.

use std::time::Duration;

use drivebus_drives::Place;
use drivebus_rtu::{Destination, Table, UnitAddress};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyMemoryView, PyString};

use crate::errors::bad_argument;

/// A word: 0..=0xFFFF. A bool is none, although Python counts it as a number: it was meant for something else.
pub(crate) fn one_word(what: &str, given: &Bound<'_, PyAny>) -> PyResult<u16> {
    let word = if given.is_instance_of::<PyBool>() { None } else { given.extract().ok() };
    word.ok_or_else(|| bad_argument(format!("{what} {} is not a number from 0 to 65535", shown(given))))
}

/// A place: an address, and above it what tells another table than that of the holding registers.
pub(crate) fn place_of(given: &Bound<'_, PyAny>) -> PyResult<Place> {
    let number = if given.is_instance_of::<PyBool>() { None } else { given.extract().ok() };
    let place = number.and_then(Place::of_number);
    place.ok_or_else(|| bad_argument(format!("address {} is not a number from 0 to 65535", shown(given))))
}

/// A table by its name.
pub(crate) fn table_of(given: &str) -> PyResult<Table> {
    Table::named(given).ok_or_else(|| {
        let names = Table::ALL.map(Table::name).join(", ");
        bad_argument(format!("table {given:?} is unknown; allowed is {names}"))
    })
}

/// A unit that has its address by the specification.
pub(crate) fn unit_address(given: &Bound<'_, PyAny>) -> PyResult<UnitAddress> {
    let raw = given.extract::<u8>().ok().and_then(|raw| UnitAddress::new(raw).ok());
    raw.ok_or_else(|| bad_argument(format!("unit {} is not a number from 1 to 247", shown(given))))
}

/// A unit of a line, also a reserved one: which lines have those, `drivebus.line.addresses` has checked.
pub(crate) fn any_unit(given: &Bound<'_, PyAny>) -> PyResult<UnitAddress> {
    let raw = given.extract::<u8>().ok().map(UnitAddress::by_name);
    raw.ok_or_else(|| bad_argument(format!("unit {} is not a number from 0 to 255", shown(given))))
}

/// A unit, or 0 for all of them.
pub(crate) fn destination(given: &Bound<'_, PyAny>) -> PyResult<Destination> {
    let raw = given.extract::<u8>().ok().and_then(|raw| Destination::from_wire(raw).ok());
    raw.ok_or_else(|| bad_argument(format!("unit {} is not a number from 1 to 247, or 0 for broadcast", shown(given))))
}

/// A number of seconds, as the simulation waits for.
pub(crate) fn duration(seconds: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(seconds).map_err(|_| bad_argument(format!("{seconds} s is not a time to wait")))
}

/// A sequence of words, or else one word.
pub(crate) fn words_of(given: &Bound<'_, PyAny>) -> PyResult<Result<Vec<u16>, u16>> {
    if given.is_instance_of::<PyString>() || given.is_instance_of::<PyBytes>() {
        return Err(bad_argument(format!("value {} is neither a word nor a sequence of words", shown(given))));
    }
    match given.try_iter() {
        Err(_) => one_word("value", given).map(Err),
        Ok(items) => items.map(|item| one_word("value", &item?)).collect::<PyResult<_>>().map(Ok),
    }
}

/// Any bytes-like object: what is no `bytes` is copied into one, because Python 3.10 keeps its buffers to itself.
pub(crate) fn bytes_of<'py>(given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyBytes>> {
    if let Ok(bytes) = given.cast::<PyBytes>() {
        return Ok(bytes.clone());
    }
    PyMemoryView::from(given)
        .and_then(|view| Ok(view.call_method0("tobytes")?.cast_into::<PyBytes>()?))
        .map_err(|_| bad_argument(format!("{} is not bytes", shown(given))))
}

/// A value as Python shows it, a text in double quotes.
pub(crate) fn shown(given: &Bound<'_, PyAny>) -> String {
    if let Ok(text) = given.extract::<&str>() {
        return format!("{text:?}");
    }
    given.repr().map_or_else(|_| String::from("?"), |text| text.to_string())
}
