//! A line over a Python object that reads and writes like pyserial's `serial.Serial`.
//!
//! So a port the user has opened, and everything pyserial has a URL for (`rfc2217://`, `spy://`, `loop://`), carries the
//! bus too. Each call goes through the interpreter, in a thread of its own, and takes some tens of microseconds; a path is
//! faster. While a wait lasts, the object itself lets go of the GIL, as pyserial does.

use std::borrow::Cow;
use std::sync::Arc;

use drivebus_line::clock::{monotonic, sleep_until};
use drivebus_line::{Line, PortError, PortErrorKind, SetAgain};
use drivebus_rtu::{DataBits, Duration, Instant, Parity, SerialFormat, StopBits};
use pyo3::exceptions::PyValueError;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::attendant::{Attendant, Unattended};
use crate::ending::{detached, is_over};

/// The time-out of an object that has no descriptor to wait on: how fine its waits are.
const STEP: Duration = Duration::from_millis(1);
/// How long the object is waited for without a break: the end of the program waits for that.
const BREAK: Duration = Duration::from_millis(50);
/// How long the object is given beyond what it is asked to wait. A program may keep the interpreter to itself for seconds.
const PATIENCE: Duration = Duration::from_secs(10);

/// A port that lives in Python.
#[derive(Debug)]
pub(crate) struct PySerialLine {
    object: Arc<Object>,
    attendant: Attendant,
    name: String,
    format: SerialFormat,
    /// When the last character handed over will have left the wire.
    wire_free: Instant,
    owned: bool,
    notes: Vec<String>,
    set_again: SetAgain,
}

/// The object, and how to wait for it.
#[derive(Debug)]
struct Object {
    port: Py<PyAny>,
    wait: Wait,
    settings: Option<Settings>,
}

/// What a terminal behind the object was set to when it was taken, and what the object said of that.
#[derive(Debug)]
struct Settings {
    found: Py<PyAny>,
    own: Py<PyAny>,
}

impl Settings {
    /// Those of `port`; `None` where it is no terminal, or nobody tells.
    fn of(port: &Bound<'_, PyAny>) -> Option<Self> {
        let terminal = terminal(port.py()).ok()?;
        let found = terminal.call_method1(intern!(port.py(), "settings"), (port,)).ok()?;
        let own = terminal.call_method1(intern!(port.py(), "own"), (port,)).ok()?;
        (!found.is_none()).then(|| Self { found: found.unbind(), own: own.unbind() })
    }

    /// What was otherwise at `port`, and what is still so; nothing where its owner set it otherwise, who may.
    fn set_again(&self, port: &Bound<'_, PyAny>) -> PyResult<(Vec<String>, Vec<String>)> {
        let py = port.py();
        let terminal = terminal(py)?;
        if !terminal.call_method1(intern!(py, "own"), (port,))?.eq(self.own.bind(py))? {
            return Ok((Vec::new(), Vec::new()));
        }
        terminal.call_method1(intern!(py, "set_again"), (port, &self.found))?.extract()
    }
}

fn terminal(py: Python<'_>) -> PyResult<Bound<'_, PyModule>> {
    py.import(intern!(py, "drivebus.line.terminal"))
}

/// How to wait for bytes without asking the object for more than it has.
#[derive(Debug)]
enum Wait {
    /// Python's `select.select`, on the object's descriptor.
    Select(Py<PyAny>),
    /// Its own time-out, set once: pyserial sets up the whole port anew each time it is set. The user's is given back.
    Timeout(Py<PyAny>),
}

impl Wait {
    fn of(port: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = port.py();
        if port.call_method0(intern!(py, "fileno")).is_ok() {
            let select = py.import(intern!(py, "select"))?.getattr(intern!(py, "select"))?;
            // Not every descriptor can be selected: on Windows only sockets can.
            if select.call1((vec![port], Vec::<u8>::new(), Vec::<u8>::new(), 0)).is_ok() {
                return Ok(Self::Select(select.unbind()));
            }
        }
        let before = port.getattr(intern!(py, "timeout"))?.unbind();
        port.setattr(intern!(py, "timeout"), STEP.as_secs_f64())?;
        Ok(Self::Timeout(before))
    }
}

impl PySerialLine {
    /// A line over `port`: an object with `read`, `write`, `in_waiting` and `timeout`.
    ///
    /// `owned` says that it was opened for this line, which then closes it; a port of the user's stays open. Timing
    /// follows the object's own `baudrate`, `bytesize`, `parity` and `stopbits`, and `asked` where it has none.
    ///
    /// # Errors
    ///
    /// [`PortErrorKind::Unsupported`]: the object lacks one of these. [`PortErrorKind::Closed`]: it is not open.
    /// [`PortErrorKind::Other`]: there is no thread for it.
    pub(crate) fn new(port: &Bound<'_, PyAny>, asked: &SerialFormat, owned: bool) -> Result<Self, PortError> {
        let attendant = Attendant::new().map_err(|error| {
            let message = format!("the system gives no thread in which it could be used ({error})");
            PortError::new(PortErrorKind::Other, "a Python object", message)
        })?;
        let (object, asked) = (port.clone().unbind(), *asked);
        let (name, wait, format, settings) =
            detached(port.py(), || attendant.run(PATIENCE, move |py| look_at(object.bind(py), &asked)))
                .unwrap_or_else(|why| Err(unattended("a Python object", why)))?;
        let notes = if format == asked {
            Vec::new()
        } else {
            vec![format!("timed as {format}, as {name} was opened, not as {asked}")]
        };
        let object = Arc::new(Object { port: port.clone().unbind(), wait, settings });
        Ok(Self {
            object,
            attendant,
            name,
            format,
            wire_free: Instant::ZERO,
            owned,
            notes,
            set_again: SetAgain::default(),
        })
    }

    /// How the characters of this line look: the object's own settings, where it tells.
    pub(crate) fn format(&self) -> SerialFormat {
        self.format
    }

    /// Does `work` with the object; whatever it raises there, it raises because it is gone.
    fn attended<T: Send + 'static>(
        &self,
        patience: Duration,
        work: impl FnOnce(&Bound<'_, PyAny>, &Wait) -> PyResult<T> + Send + 'static,
    ) -> Result<T, PortError> {
        let object = Arc::clone(&self.object);
        self.attendant
            .run(patience, move |py| work(object.port.bind(py), &object.wait).map_err(|error| error.to_string()))
            .map_err(|why| unattended(&self.name, why))?
            .map_err(|error| lost(&self.name, &error))
    }
}

impl Line for PySerialLine {
    fn now(&self) -> Instant {
        monotonic()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let copy = bytes.to_vec();
        let written = self.attended(PATIENCE, move |port, _| write_all(port, &copy).map(|()| monotonic()))?;
        let starts = self.wire_free.max(written);
        self.wire_free = starts + self.format.chars(u32::try_from(bytes.len()).unwrap_or(u32::MAX));
        Ok(self.wire_free)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        if buffer.is_empty() {
            sleep_until(until);
            return Ok(0);
        }
        let room = buffer.len();
        loop {
            let pause = until.min(monotonic() + BREAK);
            let came = self.attended(BREAK + PATIENCE, move |port, wait| read_some(port, wait, room, pause))?;
            if !came.is_empty() || pause >= until {
                buffer[..came.len()].copy_from_slice(&came);
                return Ok(came.len());
            }
        }
    }

    fn sleep(&mut self, until: Instant) {
        sleep_until(until);
    }

    fn name(&self) -> String {
        self.name.clone()
    }

    fn may_echo(&self) -> bool {
        true
    }

    fn set_again(&mut self) -> Option<String> {
        self.object.settings.as_ref()?;
        let object = Arc::clone(&self.object);
        let look = move |py: Python<'_>| object.settings.as_ref()?.set_again(object.port.bind(py)).ok();
        let (changed, left) = self.attendant.run(PATIENCE, look).ok()??;
        if changed.is_empty() {
            self.set_again.all_is_well();
            return None;
        }
        self.set_again.tried(&changed, &left)
    }

    fn notes(&self) -> Vec<String> {
        self.notes.iter().cloned().chain(self.set_again.note()).collect()
    }
}

impl Drop for PySerialLine {
    fn drop(&mut self) {
        if is_over() {
            // An interpreter that ends closes the object itself.
            return;
        }
        let object = Arc::clone(&self.object);
        let owned = self.owned;
        let let_go = move |py: Python<'_>| {
            let port = object.port.bind(py);
            // What the object raises now, it raises because it is gone.
            let _ = match &object.wait {
                _ if owned => port.call_method0(intern!(py, "close")).map(drop),
                Wait::Select(_) => Ok(()),
                Wait::Timeout(before) => port.setattr(intern!(py, "timeout"), before),
            };
        };
        // Whoever drops it may be attached.
        let _ = Python::try_attach(|py| py.detach(|| self.attendant.run(PATIENCE, let_go)));
    }
}

type LookedAt = (String, Wait, SerialFormat, Option<Settings>);

/// What has to be known of a port object before it is used: what people call it, how to wait for it, its format, and what a
/// terminal behind it is set to.
fn look_at(port: &Bound<'_, PyAny>, asked: &SerialFormat) -> Result<LookedAt, PortError> {
    let name = name_of(port);
    for attribute in ["read", "write", "in_waiting", "timeout"] {
        // `in_waiting` of a closed port exists and raises, which is not what is looked for here.
        if !port.get_type().hasattr(attribute).unwrap_or(false) && !port.hasattr(attribute).unwrap_or(true) {
            let message = format!(
                "it has no `{attribute}`, so it is not a port; give a path, a URL or an object like serial.Serial"
            );
            return Err(PortError::new(PortErrorKind::Unsupported, name, message));
        }
    }
    if port.getattr("is_open").and_then(|open| open.is_truthy()).is_ok_and(|open| !open) {
        let message = "it is not open; call its open() first";
        return Err(PortError::new(PortErrorKind::Closed, name, message));
    }
    let wait = Wait::of(port).map_err(|error| lost(&name, &error.to_string()))?;
    let format = own_format(port, asked).unwrap_or(*asked);
    let settings = Settings::of(port);
    Ok((name, wait, format, settings))
}

/// Writes all of `bytes`. `write` returns how many it took, or nothing where it always takes all.
fn write_all(port: &Bound<'_, PyAny>, bytes: &[u8]) -> PyResult<()> {
    let py = port.py();
    let mut rest = bytes;
    while !rest.is_empty() {
        let taken: Option<usize> = port.call_method1(intern!(py, "write"), (PyBytes::new(py, rest),))?.extract()?;
        match taken {
            Some(0) => return Err(PyValueError::new_err("write() took no bytes")),
            Some(taken) => rest = rest.get(taken..).unwrap_or_default(),
            None => return Ok(()),
        }
    }
    Ok(())
}

/// What is there, or the first that comes until `until`, `room` bytes at most; none when nothing does.
fn read_some(port: &Bound<'_, PyAny>, wait: &Wait, room: usize, until: Instant) -> PyResult<Vec<u8>> {
    let py = port.py();
    loop {
        let came = read_waiting(port, room)?;
        if !came.is_empty() {
            return Ok(came);
        }
        let left = until.saturating_duration_since(monotonic());
        if left.is_zero() {
            return Ok(came);
        }
        match wait {
            Wait::Select(select) => {
                let (ready, ..): (Vec<Py<PyAny>>, Py<PyAny>, Py<PyAny>) = select
                    .call1(py, (vec![port], Vec::<u8>::new(), Vec::<u8>::new(), left.as_secs_f64()))?
                    .extract(py)?;
                if !ready.is_empty() {
                    let came = read_waiting(port, room)?;
                    // Readable and nothing there is the end of the port; its own read says how.
                    return if came.is_empty() { read(port, 1) } else { Ok(came) };
                }
            }
            Wait::Timeout(_) => {
                // One byte, as pyserial waits for all it is asked for.
                let mut came = read(port, 1)?;
                if !came.is_empty() {
                    came.extend(read_waiting(port, room - 1)?);
                    return Ok(came);
                }
            }
        }
    }
}

/// What is there already, `room` bytes at most, without waiting.
fn read_waiting(port: &Bound<'_, PyAny>, room: usize) -> PyResult<Vec<u8>> {
    let waiting: usize = port.getattr(intern!(port.py(), "in_waiting"))?.extract()?;
    let count = waiting.min(room);
    if count == 0 { Ok(Vec::new()) } else { read(port, count) }
}

/// Reads `count` bytes, or fewer where the object's time-out ends.
fn read(port: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<u8>> {
    let bytes = port.call_method1(intern!(port.py(), "read"), (count,))?;
    let bytes: Cow<'_, [u8]> = bytes.extract()?;
    if bytes.len() > count {
        return Err(PyValueError::new_err(format!("read({count}) returned {} bytes", bytes.len())));
    }
    Ok(bytes.into_owned())
}

/// The object failed: most often it was unplugged, or closed by its owner.
fn lost(name: &str, error: &str) -> PortError {
    let message = format!("the port is gone ({error}); open it again, then the bus");
    PortError::new(PortErrorKind::Lost, name, message)
}

/// The object could not be asked, or does not come back.
fn unattended(name: &str, why: Unattended) -> PortError {
    match why {
        Unattended::Over => PortError::new(PortErrorKind::Closed, name, "Python is shutting down"),
        Unattended::Late => lost(name, &format!("it does nothing for {} s", PATIENCE.as_secs())),
    }
}

/// What people call the port: pyserial keeps the path or URL it was given in `port` and `name`.
fn name_of(port: &Bound<'_, PyAny>) -> String {
    for attribute in ["port", "name"] {
        if let Ok(name) = port.getattr(attribute).and_then(|name| name.extract::<String>()) {
            return name;
        }
    }
    port.get_type().name().map_or_else(|_| "a Python object".to_owned(), |name| name.to_string())
}

/// The settings of the object; `None` where it has none, or none that a character here can have.
fn own_format(port: &Bound<'_, PyAny>, asked: &SerialFormat) -> Option<SerialFormat> {
    let baud_rate = port.getattr("baudrate").ok()?.extract().ok()?;
    let data_bits = match port.getattr("bytesize").ok()?.extract::<u8>().ok()? {
        7 => DataBits::Seven,
        8 => DataBits::Eight,
        _ => return None,
    };
    let parity = match port.getattr("parity").ok()?.extract::<String>().ok()?.as_str() {
        "N" => Parity::None,
        "E" => Parity::Even,
        "O" => Parity::Odd,
        _ => return None,
    };
    let stop_bits = port.getattr("stopbits").ok()?.extract::<f64>().ok()?;
    let stop_bits = if stop_bits > 1.0 { StopBits::Two } else { StopBits::One };
    SerialFormat::new(baud_rate, data_bits, parity, stop_bits, asked.silence()).ok()
}
