//! From what the Python package hands over as a port to a line of the core.

use std::path::PathBuf;

use drivebus_line::rs485::{MAX_DELAY_MS, Rs485};
use drivebus_line::tty::TtyOptions;
use drivebus_line::url::{self, Known, PortOptions, PortUrl, SimulatorUrl};
use drivebus_line::{AdapterEcho, Line, Opener, Places, PortError, PortErrorKind, PortKey, WordError};
use drivebus_rtu::SerialFormat;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString};

use crate::convert::shown;
use crate::errors::{bad_argument, port_error, refuse};
use crate::pyserial::PySerialLine;
use crate::sim::Simulator;

/// What opens `port`, what tells it from others if programs can share it, and the format its characters have.
pub(crate) fn opener(
    port: &Bound<'_, PyAny>,
    format: SerialFormat,
    rs485: Option<&Bound<'_, PyDict>>,
    low_latency: bool,
) -> PyResult<(Opener, Option<PortKey>, SerialFormat)> {
    let rs485 = rs485.map(rs485_options).transpose()?;
    if let Ok(text) = port.cast::<PyString>() {
        let options = TtyOptions::default().rs485(rs485).low_latency(low_latency);
        let (opener, key) = named(text.to_str()?, format, options)?;
        return Ok((opener, key, format));
    }
    url::check_together(None, rs485.is_some(), AdapterEcho::Auto).map_err(refuse)?;
    if let Ok(simulator) = port.cast::<Simulator>() {
        let simulator = simulator.clone().unbind();
        let opener = move || simulator.get().sim_line();
        return Ok((Box::new(opener), None, format));
    }
    let line = PySerialLine::new(port, &format, false).map_err(|error| port_error(&error))?;
    let (format, name) = (line.format(), line.name());
    let mut line = Some(line);
    let opener = move || match line.take() {
        Some(line) => Ok(Box::new(line) as Box<dyn Line>),
        None => Err(gone(&name)),
    };
    Ok((Box::new(opener), None, format))
}

/// What the core opens by its name.
fn named(port: &str, format: SerialFormat, tty: TtyOptions) -> PyResult<(Opener, Option<PortKey>)> {
    url::check_together(Some(port), tty.rs485.is_some(), AdapterEcho::Auto).map_err(refuse)?;
    let parsed = PortUrl::parse(port, &Known::default()).map_err(refuse)?;
    let key = parsed.key();
    let opener = parsed.opener(&PortOptions::new(format).tty(tty));
    let opener = opener.ok_or_else(|| bad_argument(format!("port {port:?} is not opened by its name here")))?;
    Ok((opener, key))
}

/// What `port` is, before anything is opened: its scheme, which a path has not, and for `sim://` the arguments of a
/// simulator.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "what a function of Python is given, it owns")]
#[pyo3(signature = (port, /, *, schemes, families, faults))]
pub(crate) fn port_url<'py>(
    py: Python<'py>,
    port: &str,
    schemes: Vec<String>,
    families: Vec<String>,
    faults: Vec<String>,
) -> PyResult<(String, Bound<'py, PyDict>)> {
    fn texts(names: &[String]) -> Vec<&str> {
        names.iter().map(String::as_str).collect()
    }
    let (schemes, families, faults) = (texts(&schemes), texts(&families), texts(&faults));
    let known = Known::default().schemes(&schemes).families(&families).faults(&faults);
    let (scheme, simulator) = match PortUrl::parse(port, &known).map_err(refuse)? {
        PortUrl::Simulator(simulator) => ("sim".to_owned(), simulator_arguments(py, &simulator)?),
        PortUrl::Foreign { scheme } => (scheme, PyDict::new(py)),
        PortUrl::RtuOverTcp(_) => ("socket".to_owned(), PyDict::new(py)),
        PortUrl::ModbusTcp(_) => ("tcp".to_owned(), PyDict::new(py)),
        _ => (String::new(), PyDict::new(py)),
    };
    Ok((scheme, simulator))
}

fn simulator_arguments<'py>(py: Python<'py>, simulator: &SimulatorUrl) -> PyResult<Bound<'py, PyDict>> {
    let (all, units, faults) = (PyDict::new(py), PyDict::new(py), PyDict::new(py));
    for (unit, family) in &simulator.units {
        units.set_item(unit.get(), family)?;
    }
    for (kind, rate) in &simulator.faults {
        faults.set_item(kind, rate)?;
    }
    all.set_item("units", units)?;
    all.set_item("clock", if simulator.is_virtual { "virtual" } else { "real" })?;
    all.set_item("seed", simulator.seed)?;
    all.set_item("strict_silence", simulator.strict_silence)?;
    all.set_item("echo", simulator.echo)?;
    all.set_item("faults", faults)?;
    Ok(all)
}

/// Refuses what cannot be meant of a port, which may have no name.
#[pyfunction]
#[pyo3(signature = (port, rs485, echo, /))]
pub(crate) fn check_port_options(port: Option<&Bound<'_, PyString>>, rs485: bool, echo: &str) -> PyResult<()> {
    // What is not UTF-8 has no scheme that anybody knows.
    let port = port.map(|port| port.to_string_lossy());
    url::check_together(port.as_deref(), rs485, echo.parse().map_err(refuse)?).map_err(refuse)
}

fn rs485_options(given: &Bound<'_, PyDict>) -> PyResult<Rs485> {
    let mut options = Rs485::default();
    // First, because what is not given depends on it.
    if let Some(mode) = given.get_item("mode")? {
        let known = mode.extract::<String>().ok().and_then(|word| word.parse().ok());
        options = known.ok_or_else(|| refuse(WordError::Switch { word: shown(&mode) }))?;
    }
    for (key, value) in given {
        let key: String = key.extract().map_err(|_| bad_argument(format!("rs485: {key} is not known")))?;
        let bad = |_| bad_argument(format!("rs485: {key} cannot be {value}"));
        let too_long = || bad_argument(format!("rs485: {key} cannot be {value}; allowed is 0 to {MAX_DELAY_MS}"));
        match key.as_str() {
            "mode" => {}
            "enabled" => options.enabled = value.extract().map_err(bad)?,
            "rts_on_send" => options.rts_on_send = value.extract().map_err(bad)?,
            "delay_before_ms" => options.delay_before_ms = delay(&value).ok_or_else(too_long)?,
            "delay_after_ms" => options.delay_after_ms = delay(&value).ok_or_else(too_long)?,
            _ => {
                return Err(bad_argument(format!(
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

/// The folder for the sockets of this user's programs.
#[pyfunction]
pub(crate) fn run_time_folder() -> PyResult<PathBuf> {
    #[cfg(unix)]
    return Ok(drivebus_line::run_time_folder()?);
    #[cfg(not(unix))]
    Err(pyo3::exceptions::PyOSError::new_err("this system has no Unix sockets"))
}

/// A port that was handed over open and is gone cannot be opened again by us.
fn gone(name: &str) -> PortError {
    PortError::new(
        PortErrorKind::Lost,
        name,
        "it was opened by the program and is gone; open it again and make a new Bus",
    )
}
