//! What the arguments of Python's bus ask of the core: the same for who waits and for an event loop.

use std::time::Duration;

use drivebus_line::{AdapterEcho, BusOptions, CallOptions, Failure, Opener, Priority};
use drivebus_rtu::{AnswerLength, Request};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::one_word;
use crate::errors::{not_allowed, port_error, refuse};
use crate::format::SerialFormat;
use crate::open;

/// What opens the port, and how the bus behaves then.
#[expect(clippy::too_many_arguments, reason = "the keywords of the Python class")]
pub(crate) fn to_open(
    port: &Bound<'_, PyAny>,
    format: SerialFormat,
    timeout: f64,
    retries: u32,
    read_only: bool,
    rs485: Option<&Bound<'_, PyDict>>,
    echo: &str,
    turnaround: f64,
    learn_timeout: bool,
    low_latency: bool,
    queue: usize,
) -> PyResult<(Opener, BusOptions)> {
    let echo = match echo {
        "auto" => AdapterEcho::Auto,
        "yes" => AdapterEcho::Present,
        "no" => AdapterEcho::Absent,
        other => return Err(not_allowed(format!("echo {other:?} is not \"auto\", \"yes\" or \"no\""))),
    };
    let (opener, format) = open::opener(port, format.0, rs485, low_latency)?;
    let timeout = duration("timeout", timeout)?;
    let turnaround = duration("turnaround", turnaround)?;
    Ok((opener, BusOptions { format, timeout, retries, read_only, echo, turnaround, learn_timeout, queue }))
}

/// Why a bus could not be opened.
pub(crate) fn open_failed(failure: Failure) -> PyErr {
    match failure {
        Failure::Port(error) => port_error(&error),
        other => refuse(other),
    }
}

pub(crate) fn read_request(address: &Bound<'_, PyAny>, count: &Bound<'_, PyAny>) -> PyResult<Request<'static>> {
    Request::read(one_word("address", address)?, one_word("count", count)?).map_err(refuse)
}

pub(crate) fn read_options(
    timeout: Option<f64>,
    retries: Option<u32>,
    urgent: bool,
    verify: bool,
) -> PyResult<CallOptions> {
    let timeout = timeout.map(|time| duration("timeout", time)).transpose()?;
    Ok(CallOptions { timeout, retries, verify, priority: stop_if(urgent), ..CallOptions::default() })
}

pub(crate) fn write_options(
    urgent: bool,
    read_back: Option<&Bound<'_, PyAny>>,
    connection: Option<u64>,
) -> PyResult<CallOptions> {
    let read_back = read_back.map(|address| one_word("read_back", address)).transpose()?;
    let priority = stop_if(urgent);
    Ok(CallOptions { in_doubt: urgent, priority, read_back, connection, ..CallOptions::default() })
}

/// A request that is known by name is checked as one; anything else is carried as it is.
pub(crate) fn any_request(pdu: &[u8], reply_length: Option<u8>) -> PyResult<Request<'_>> {
    let length = reply_length.map_or(AnswerLength::BySilence, AnswerLength::Bytes);
    match Request::parse(pdu) {
        Ok(request) if reply_length.is_none() && !matches!(request, Request::Custom { .. }) => Ok(request),
        _ => Request::custom(pdu, length).map_err(refuse),
    }
}

/// The turn of a stop.
fn stop_if(urgent: bool) -> Option<Priority> {
    urgent.then_some(Priority::Stop)
}

pub(crate) fn duration(what: &str, given: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(given)
        .map_err(|_| not_allowed(format!("{what} {given} is not a number of seconds, 0 or more")))
}
