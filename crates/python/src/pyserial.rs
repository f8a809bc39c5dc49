//! A line over a Python object that reads and writes like pyserial's `serial.Serial`.
//!
//! So a port the user has opened, and everything pyserial has a URL for (`rfc2217://`, `spy://`, `loop://`), carries the
//! bus too. Each call goes through the interpreter and takes some tens of microseconds; a path is faster. While a wait
//! lasts, the object itself lets go of the GIL, as pyserial does.

use std::borrow::Cow;

use drivebus_line::clock::{monotonic, sleep_until};
use drivebus_line::{Line, PortError, PortErrorKind};
use drivebus_rtu::{DataBits, Duration, Instant, Parity, SerialFormat, StopBits};
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// Longest wait in one go, so that a signal handler of Python runs soon.
const SLICE: Duration = Duration::from_millis(50);
/// The time-out of an object that has no descriptor to wait on: how fine its waits are.
const STEP: Duration = Duration::from_millis(1);

/// A port that lives in Python.
#[derive(Debug)]
pub(crate) struct PySerialLine {
    port: Py<PyAny>,
    name: String,
    format: SerialFormat,
    /// When the last character handed over will have left the wire.
    wire_free: Instant,
    wait: Wait,
    owned: bool,
    notes: Vec<String>,
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
    pub(crate) fn new(port: &Bound<'_, PyAny>, asked: &SerialFormat, owned: bool) -> Result<Self, PortError> {
        let name = name_of(port);
        for attribute in ["read", "write", "in_waiting", "timeout"] {
            // `in_waiting` of a closed port exists and raises, which is not what is looked for here.
            if !port.get_type().hasattr(attribute).unwrap_or(false) && !port.hasattr(attribute).unwrap_or(true) {
                let message = format!(
                    "it has no `{attribute}`, so it is no port; give a path, a URL or an object like serial.Serial"
                );
                return Err(PortError::new(PortErrorKind::Unsupported, name, message));
            }
        }
        if port.getattr("is_open").and_then(|open| open.is_truthy()).is_ok_and(|open| !open) {
            let message = "it is not open; call its open() first";
            return Err(PortError::new(PortErrorKind::Closed, name, message));
        }
        let wait = Wait::of(port).map_err(|error| lost(&name, &error))?;
        let format = own_format(port, asked).unwrap_or(*asked);
        let notes = if format == *asked {
            Vec::new()
        } else {
            vec![format!("timed as {format}, as {name} was opened, not as {asked}")]
        };
        let port = port.clone().unbind();
        Ok(Self { port, name, format, wire_free: Instant::ZERO, wait, owned, notes })
    }

    /// How the characters of this line look: the object's own settings, where it tells.
    pub(crate) fn format(&self) -> SerialFormat {
        self.format
    }

    /// Runs `work` in the interpreter, and sorts what it raises.
    ///
    /// `Ok(None)` means that a signal handler of the program raised, as Ctrl-C does: see [`hand_back`].
    fn attached<T>(&self, work: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>) -> Result<Option<T>, PortError> {
        let done = Python::try_attach(|py| match work(self.port.bind(py)) {
            Ok(value) => Ok(Some(value)),
            Err(error) if error.is_instance_of::<PyException>(py) => Err(lost(&self.name, &error)),
            Err(_) => {
                hand_back(py);
                Ok(None)
            }
        });
        done.unwrap_or_else(|| Err(PortError::new(PortErrorKind::Closed, &self.name, "Python is shutting down")))
    }
}

impl Line for PySerialLine {
    fn now(&self) -> Instant {
        monotonic()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        // After an interruption nobody knows how much was written. The bytes count as sent: the unit ignores half a
        // frame, and the caller is about to raise what interrupted.
        self.attached(|port| write_all(port, bytes))?;
        let starts = self.wire_free.max(monotonic());
        self.wire_free = starts + self.format.chars(u32::try_from(bytes.len()).unwrap_or(u32::MAX));
        Ok(self.wire_free)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        if buffer.is_empty() {
            sleep_until(until);
            return Ok(0);
        }
        let count = self.attached(|port| read_some(port, &self.wait, buffer, until))?;
        Ok(count.unwrap_or_else(|| {
            sleep_until(until); // 0 means that `until` was reached, so it has to be
            0
        }))
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

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }
}

impl Drop for PySerialLine {
    fn drop(&mut self) {
        // What the object raises now, it raises because it is gone; an interpreter that ends closes it itself.
        let _ = Python::try_attach(|py| {
            let port = self.port.bind(py);
            match &self.wait {
                _ if self.owned => port.call_method0(intern!(py, "close")).map(drop),
                Wait::Select(_) => Ok(()),
                Wait::Timeout(before) => port.setattr(intern!(py, "timeout"), before),
            }
        });
    }
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

/// What is there, or the first that comes until `until`; 0 when nothing does.
fn read_some(port: &Bound<'_, PyAny>, wait: &Wait, buffer: &mut [u8], until: Instant) -> PyResult<usize> {
    let py = port.py();
    loop {
        let count = read_waiting(port, buffer)?;
        if count > 0 {
            return Ok(count);
        }
        let left = until.saturating_duration_since(monotonic());
        if left.is_zero() {
            return Ok(0);
        }
        match wait {
            Wait::Select(select) => {
                let seconds = left.min(SLICE).as_secs_f64();
                let (ready, ..): (Vec<Py<PyAny>>, Py<PyAny>, Py<PyAny>) =
                    select.call1(py, (vec![port], Vec::<u8>::new(), Vec::<u8>::new(), seconds))?.extract(py)?;
                if !ready.is_empty() {
                    let count = read_waiting(port, buffer)?;
                    // Readable and nothing there is the end of the port; its own read says how.
                    return if count > 0 { Ok(count) } else { read(port, &mut buffer[..1]) };
                }
            }
            Wait::Timeout(_) => {
                // One byte, as pyserial waits for all it is asked for.
                let (first, rest) = buffer.split_at_mut(1);
                if read(port, first)? == 1 {
                    return Ok(1 + read_waiting(port, rest)?);
                }
            }
        }
    }
}

/// What is there already, without waiting.
fn read_waiting(port: &Bound<'_, PyAny>, buffer: &mut [u8]) -> PyResult<usize> {
    let waiting: usize = port.getattr(intern!(port.py(), "in_waiting"))?.extract()?;
    let count = waiting.min(buffer.len());
    if count == 0 { Ok(0) } else { read(port, &mut buffer[..count]) }
}

/// Reads as many bytes as `buffer` holds, or fewer where the object's time-out ends.
fn read(port: &Bound<'_, PyAny>, buffer: &mut [u8]) -> PyResult<usize> {
    let bytes = port.call_method1(intern!(port.py(), "read"), (buffer.len(),))?;
    let bytes: Cow<'_, [u8]> = bytes.extract()?;
    let Some(target) = buffer.get_mut(..bytes.len()) else {
        return Err(PyValueError::new_err(format!("read({}) returned {} bytes", buffer.len(), bytes.len())));
    };
    target.copy_from_slice(&bytes);
    Ok(bytes.len())
}

/// Makes the interpreter raise again what a signal handler raised in the middle of our call.
///
/// A [`Line`] has no way to return it: the port is well, and the bus must not take Ctrl-C for a broken one. The signal is
/// set once more, and the binding meets it where it looks for signals next, as `KeyboardInterrupt`.
fn hand_back(py: Python<'_>) {
    // It can fail only where the module is missing, and then there are no signals either.
    let _ = py.import(intern!(py, "_thread")).and_then(|module| module.call_method0(intern!(py, "interrupt_main")));
}

/// The object failed: most often it was unplugged, or closed by its owner.
fn lost(name: &str, error: &PyErr) -> PortError {
    let message = format!("the port is gone ({error}); open it again, then the bus");
    PortError::new(PortErrorKind::Lost, name, message)
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
