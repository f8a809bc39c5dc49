//! From what the Python package hands over as a port to a line of the core.

use std::path::PathBuf;
use std::time::Duration;

use drivebus_line::mbap::{DEFAULT_PORT, ModbusTcp};
use drivebus_line::rs485::{MAX_DELAY_MS, RTS_MARGIN_MS, Rs485, Switch};
use drivebus_line::tcp::RtuOverTcp;
use drivebus_line::tty::{Adapter, TtyOptions};
use drivebus_line::{Line, Opener, Places};
use drivebus_rtu::SerialFormat;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString};

use crate::bus::gone;
use crate::errors::{not_allowed, port_error};
use crate::pyserial::PySerialLine;
use crate::sim::Simulator;

/// How long a server may take to accept a connection.
const CONNECT: Duration = Duration::from_secs(3);

/// What opens `port`, and the format its characters have.
pub(crate) fn opener(
    port: &Bound<'_, PyAny>,
    format: SerialFormat,
    rs485: Option<&Bound<'_, PyDict>>,
    low_latency: bool,
) -> PyResult<(Opener, SerialFormat)> {
    let rs485 = rs485.map(rs485_options).transpose()?;
    if let Ok(text) = port.cast::<PyString>() {
        let options = TtyOptions { rs485, low_latency, ..TtyOptions::default() };
        return Ok((named(text.to_str()?, format, options)?, format));
    }
    if rs485.is_some() {
        return Err(no_rs485());
    }
    if let Ok(simulator) = port.cast::<Simulator>() {
        let simulator = simulator.clone().unbind();
        let opener = move || simulator.get().sim_line();
        return Ok((Box::new(opener), format));
    }
    let line = PySerialLine::new(port, &format, false).map_err(|error| port_error(&error))?;
    let (format, name) = (line.format(), line.name());
    let mut line = Some(line);
    let opener = move || match line.take() {
        Some(line) => Ok(Box::new(line) as Box<dyn Line>),
        None => Err(gone(&name)),
    };
    Ok((Box::new(opener), format))
}

fn named(port: &str, format: SerialFormat, options: TtyOptions) -> PyResult<Opener> {
    let port = port.to_owned();
    let (scheme, rest) = port.split_once("://").unwrap_or(("", &port));
    if !scheme.is_empty() && options.rs485.is_some() {
        return Err(no_rs485());
    }
    match scheme {
        "" => {
            let mut adapter = Adapter::new(port, format, options);
            Ok(Box::new(move || Ok(Box::new(adapter.open()?))))
        }
        "socket" => {
            let (host, number) = host_and_port(&port, rest, None)?;
            Ok(Box::new(move || Ok(Box::new(RtuOverTcp::connect(&host, number, &format, CONNECT)?))))
        }
        "tcp" => {
            let (host, number) = host_and_port(&port, rest, Some(DEFAULT_PORT))?;
            Ok(Box::new(move || Ok(Box::new(ModbusTcp::connect(&host, number, CONNECT)?))))
        }
        other => Err(not_allowed(format!("port {port:?}: {other}:// is not socket:// or tcp://"))),
    }
}

/// Nobody would move an RTS there.
fn no_rs485() -> PyErr {
    not_allowed(String::from("rs485 is for a serial port given by its path"))
}

/// `host:port`, `[ipv6]:port`, or only the host where the scheme has a usual port.
fn host_and_port(url: &str, rest: &str, usual: Option<u16>) -> PyResult<(String, u16)> {
    let rest = rest.trim_end_matches('/');
    let (host, number) = match rest.rsplit_once(':') {
        Some((host, number)) if !number.contains(']') => (host, number.parse().ok()),
        _ => (rest, usual),
    };
    let host = host.trim_start_matches('[').trim_end_matches(']');
    match number {
        Some(number) if !host.is_empty() => Ok((host.to_owned(), number)),
        _ => Err(not_allowed(format!("port {url:?} is not scheme://host:port with a port in 0..65535"))),
    }
}

fn rs485_options(given: &Bound<'_, PyDict>) -> PyResult<Rs485> {
    let mut options = Rs485::default();
    // First, because what is not given depends on it.
    if let Some(mode) = given.get_item("mode")? {
        options.switch = match mode.extract::<String>().as_deref() {
            Ok("kernel") => Switch::Driver,
            Ok("rts") => Switch::Program,
            Ok("auto") => Switch::Either,
            _ => {
                let mode = mode.repr()?;
                return Err(not_allowed(format!("rs485: mode {mode} is not \"kernel\", \"rts\" or \"auto\"")));
            }
        };
        if options.switch == Switch::Program {
            options.delay_after_ms = RTS_MARGIN_MS;
        }
    }
    for (key, value) in given {
        let key: String = key.extract().map_err(|_| not_allowed(format!("rs485: {key} is not known")))?;
        let bad = |_| not_allowed(format!("rs485: {key} cannot be {value}"));
        let too_long = || not_allowed(format!("rs485: {key} cannot be {value}; allowed is 0..{MAX_DELAY_MS}"));
        match key.as_str() {
            "mode" => {}
            "enabled" => options.enabled = value.extract().map_err(bad)?,
            "rts_on_send" => options.rts_on_send = value.extract().map_err(bad)?,
            "delay_before_ms" => options.delay_before_ms = delay(&value).ok_or_else(too_long)?,
            "delay_after_ms" => options.delay_after_ms = delay(&value).ok_or_else(too_long)?,
            _ => {
                return Err(not_allowed(format!(
                    "rs485: {key:?} is not known; known are mode, enabled, rts_on_send, delay_before_ms, delay_after_ms"
                )));
            }
        }
    }
    Ok(options)
}

/// Milliseconds that can be kept.
fn delay(given: &Bound<'_, PyAny>) -> Option<u32> {
    // A bool is a number for Python, and was meant for something else.
    if given.is_instance_of::<PyBool>() {
        return None;
    }
    given.extract().ok().filter(|&delay| delay <= MAX_DELAY_MS)
}

/// What the system tells of the port at `path`; `by_id` and `tty_class` are other folders than this machine's, for tests.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "what a function of Python is given, it owns")]
#[pyo3(signature = (path, *, by_id = None, tty_class = None))]
pub(crate) fn port_facts(
    py: Python<'_>,
    path: PathBuf,
    by_id: Option<PathBuf>,
    tty_class: Option<PathBuf>,
) -> PyResult<Bound<'_, PyDict>> {
    let mut places = Places::default();
    places.by_id = by_id.unwrap_or(places.by_id);
    places.tty_class = tty_class.unwrap_or(places.tty_class);
    let facts = py.detach(|| places.facts(&path));
    let all = PyDict::new(py);
    all.set_item("driver", facts.driver)?;
    all.set_item("adapter", facts.adapter)?;
    all.set_item("latency_timer_ms", facts.latency_timer_ms)?;
    all.set_item("latency_rule", facts.latency_rule)?;
    all.set_item("holders", facts.holders)?;
    Ok(all)
}
