//! What the arguments of Python's bus ask of the core: the same for who waits and for an event loop.

use std::time::Duration;

use drivebus_line::{AdapterEcho, BusOptions, CallOptions, Failure, Opener, PortKey, Share};
use drivebus_rtu::{Request, Table};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{one_word, table_of};
use crate::errors::{bad_argument, port_error, refuse};
use crate::format::SerialFormat;
use crate::halter::ByFamily;
use crate::open;

/// What opens the port, and how the bus behaves then.
#[expect(clippy::too_many_arguments, clippy::fn_params_excessive_bools, reason = "the keywords of the Python class")]
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
    share: &str,
    group: Option<u32>,
    realtime: bool,
) -> PyResult<(Opener, Option<PortKey>, BusOptions)> {
    let echo: AdapterEcho = echo.parse().map_err(refuse)?;
    let share: Share = share.parse().map_err(refuse)?;
    let (opener, key, format) = open::opener(port, format.0, rs485, low_latency)?;
    let timeout = duration("timeout", timeout)?;
    let turnaround = duration("turnaround", turnaround)?;
    let options = BusOptions::new(format).timeout(timeout).retries(retries).read_only(read_only).echo(echo);
    Ok((
        opener,
        key,
        options
            .turnaround(turnaround)
            .learn_timeout(learn_timeout)
            .queue(queue)
            .share(share)
            .group(group)
            .realtime(realtime)
            .halter(Some(&ByFamily)),
    ))
}

/// Why a bus could not be opened.
pub(crate) fn open_failed(failure: Failure) -> PyErr {
    match failure {
        Failure::Port(error) => port_error(&error),
        other => refuse(other),
    }
}

pub(crate) fn read_request(
    table: &str,
    address: &Bound<'_, PyAny>,
    count: &Bound<'_, PyAny>,
) -> PyResult<Request<'static>> {
    let (address, count) = (one_word("address", address)?, one_word("count", count)?);
    Request::read_of(table_of(table)?, address, count).map_err(refuse)
}

/// `words`: a sequence of them, or else one; of a coil 0 or 1.
pub(crate) fn write_request<'a>(table: &str, address: u16, words: &'a Result<Vec<u16>, u16>) -> PyResult<Request<'a>> {
    match (table_of(table)?, words) {
        (Table::Holding, Err(word)) => Ok(Request::write(address, *word)),
        (Table::Holding, Ok(words)) => Request::write_many(address, words).map_err(refuse),
        (Table::Coil, Err(word @ (0 | 1))) => Ok(Request::write_coil(address, *word == 1)),
        (Table::Coil, _) => Err(bad_argument("a coil is written as 0 or 1, one at a time".to_owned())),
        (Table::Input | Table::Discrete, _) => {
            Err(bad_argument(format!("table {table:?} can only be read; holding and coil can be written")))
        }
    }
}

pub(crate) fn read_options(timeout: Option<f64>, retries: Option<u32>, verify: bool) -> PyResult<CallOptions> {
    let timeout = timeout.map(|time| duration("timeout", time)).transpose()?;
    Ok(CallOptions::new().timeout(timeout).retries(retries).verify(verify))
}

pub(crate) fn write_options(
    timeout: Option<f64>,
    read_back: Option<&Bound<'_, PyAny>>,
    connection: Option<u64>,
    halts: Option<u64>,
) -> PyResult<CallOptions> {
    let timeout = timeout.map(|time| duration("timeout", time)).transpose()?;
    let read_back = read_back.map(|address| one_word("read_back", address)).transpose()?;
    Ok(CallOptions::new().timeout(timeout).read_back(read_back).connection(connection).halts(halts))
}

/// `options` for `request`, which may be urgent.
pub(crate) fn options_for(request: &Request<'_>, options: CallOptions, urgent: bool) -> CallOptions {
    if urgent { options.urgent(request) } else { options }
}

pub(crate) fn duration(what: &str, given: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(given)
        .map_err(|_| bad_argument(format!("{what} {given} is not a number of seconds, 0 or more")))
}
