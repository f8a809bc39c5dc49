//! Python's numbers and bytes as the core's, or `NotAllowed` that names what was given and what is allowed.

use drivebus_rtu::{Destination, UnitAddress};
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyString};

use crate::errors::not_allowed;

/// A word: 0..=0xFFFF.
pub(crate) fn one_word(what: &str, given: &Bound<'_, PyAny>) -> PyResult<u16> {
    given.extract().map_err(|_| not_allowed(format!("{what} {} is not in 0..65535", shown(given))))
}

/// A unit that can answer.
pub(crate) fn unit_address(given: &Bound<'_, PyAny>) -> PyResult<UnitAddress> {
    let raw = given.extract::<u8>().ok().and_then(|raw| UnitAddress::new(raw).ok());
    raw.ok_or_else(|| not_allowed(format!("unit {} is not in 1..247", shown(given))))
}

/// A unit, or 0 for all of them.
pub(crate) fn destination(given: &Bound<'_, PyAny>) -> PyResult<Destination> {
    let raw = given.extract::<u8>().ok().and_then(|raw| Destination::from_wire(raw).ok());
    raw.ok_or_else(|| not_allowed(format!("unit {} is not in 1..247, or 0 for broadcast", shown(given))))
}

/// A sequence of words, or else one word.
pub(crate) fn words_of(given: &Bound<'_, PyAny>) -> PyResult<Result<Vec<u16>, u16>> {
    if given.is_instance_of::<PyString>() || given.is_instance_of::<PyBytes>() {
        return Err(not_allowed(format!("value {} is neither a word nor a sequence of words", shown(given))));
    }
    match given.try_iter() {
        Err(_) => one_word("value", given).map(Err),
        Ok(items) => items.map(|item| one_word("value", &item?)).collect::<PyResult<_>>().map(Ok),
    }
}

/// Any bytes-like object.
pub(crate) fn bytes_of(given: &Bound<'_, PyAny>) -> PyResult<Vec<u8>> {
    if let Ok(bytes) = given.cast::<PyBytes>() {
        return Ok(bytes.as_bytes().to_vec());
    }
    PyBuffer::<u8>::get(given)
        .and_then(|buffer| buffer.to_vec(given.py()))
        .map_err(|_| not_allowed(format!("{} is not bytes", shown(given))))
}

/// A value as Python shows it.
pub(crate) fn shown(given: &Bound<'_, PyAny>) -> String {
    given.repr().map_or_else(|_| String::from("?"), |text| text.to_string())
}
