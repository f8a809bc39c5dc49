//! `SerialFormat` for Python: seconds where Rust has `Duration`.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::time::Duration;

use drivebus_rtu::{self as rtu, DataBits, Parity, Silence, StopBits};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyString};

use crate::convert::shown;
use crate::errors::{bad_argument, refuse};

/// How characters look on the wire, and how long they take.
#[pyclass(name = "SerialFormat", frozen, eq, from_py_object, module = "drivebus._native")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SerialFormat(pub(crate) rtu::SerialFormat);

#[pymethods]
impl SerialFormat {
    #[new]
    #[pyo3(
        signature = (baudrate = None, parity = None, stopbits = None, bytesize = None, silence = None),
        text_signature = "(baudrate=19200, parity='E', stopbits=1, bytesize=8, silence='spec')"
    )]
    fn new(
        baudrate: Option<&Bound<'_, PyAny>>,
        parity: Option<&Bound<'_, PyAny>>,
        stopbits: Option<&Bound<'_, PyAny>>,
        bytesize: Option<&Bound<'_, PyAny>>,
        silence: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let baudrate = match baudrate {
            None => rtu::SerialFormat::DEFAULT.baud_rate(),
            Some(given) => no_bool(given).and_then(|given| given.extract().ok()).ok_or_else(|| {
                let (low, high) = (rtu::SerialFormat::MIN_BAUD_RATE, rtu::SerialFormat::MAX_BAUD_RATE);
                bad_argument(format!("baudrate {} is not a number from {low} to {high} bit/s", shown(given)))
            })?,
        };
        let parity = match text(parity, "E").as_str() {
            "N" => Parity::None,
            "E" => Parity::Even,
            "O" => Parity::Odd,
            other => return Err(bad_argument(format!("parity {other} is not \"N\", \"E\" or \"O\""))),
        };
        let stops = match number(stopbits, 1) {
            Some(1) => StopBits::One,
            Some(2) => StopBits::Two,
            _ => return Err(bad_argument(format!("stopbits {} is not 1 or 2", shown_or(stopbits)))),
        };
        let data_bits = match number(bytesize, 8) {
            Some(7) => DataBits::Seven,
            Some(8) => DataBits::Eight,
            _ => return Err(bad_argument(format!("bytesize {} is not 7 or 8", shown_or(bytesize)))),
        };
        let silence = silence.map_or(Ok(Silence::Spec), silence_rule)?;
        rtu::SerialFormat::new(baudrate, data_bits, parity, stops, silence).map(Self).map_err(refuse)
    }

    #[getter]
    fn baudrate(&self) -> u32 {
        self.0.baud_rate()
    }

    #[getter]
    fn parity(&self) -> &'static str {
        match self.0.parity() {
            Parity::None => "N",
            Parity::Even => "E",
            Parity::Odd => "O",
        }
    }

    #[getter]
    fn stopbits(&self) -> u8 {
        match self.0.stop_bits() {
            StopBits::One => 1,
            StopBits::Two => 2,
        }
    }

    #[getter]
    fn bytesize(&self) -> u8 {
        match self.0.data_bits() {
            DataBits::Seven => 7,
            DataBits::Eight => 8,
        }
    }

    #[getter]
    fn silence<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        match self.0.silence() {
            Silence::Spec => PyString::new(py, "spec").into_any(),
            Silence::Characters => PyString::new(py, "characters").into_any(),
            Silence::Fixed(time) => PyFloat::new(py, time.as_secs_f64()).into_any(),
        }
    }

    #[getter]
    fn bits_per_char(&self) -> u32 {
        self.0.bits_per_char()
    }

    #[getter]
    fn char_time(&self) -> f64 {
        self.0.char_time().as_secs_f64()
    }

    #[getter]
    fn t15(&self) -> f64 {
        self.0.t15().as_secs_f64()
    }

    #[getter]
    fn t35(&self) -> f64 {
        self.0.t35().as_secs_f64()
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.0.hash(&mut hasher);
        hasher.finish()
    }

    fn __repr__(&self) -> String {
        format!("<SerialFormat {}>", self.0)
    }
}

fn silence_rule(given: &Bound<'_, PyAny>) -> PyResult<Silence> {
    if let Ok(name) = given.extract::<String>() {
        match name.as_str() {
            "spec" => return Ok(Silence::Spec),
            "characters" => return Ok(Silence::Characters),
            _ => {}
        }
    } else if let Some(seconds) = no_bool(given).and_then(|given| given.extract::<f64>().ok())
        && let Ok(time) = Duration::try_from_secs_f64(seconds)
    {
        return Ok(Silence::Fixed(time));
    }
    let longest = rtu::SerialFormat::MAX_SILENCE.as_secs();
    Err(bad_argument(format!("silence {} is not \"spec\", \"characters\" or 0 to {longest} seconds", shown(given))))
}

/// A text argument in capitals, or its default; what is no text as it shows itself.
fn text(given: Option<&Bound<'_, PyAny>>, default: &str) -> String {
    match given {
        None => default.to_owned(),
        Some(given) => match given.extract::<String>() {
            Ok(text) if text.len() == 1 => text.to_uppercase(),
            _ => shown(given),
        },
    }
}

/// A whole number, or its default; pyserial has `1.0` for one stop bit in places.
fn number(given: Option<&Bound<'_, PyAny>>, default: i64) -> Option<i64> {
    match given {
        None => Some(default),
        Some(given) => {
            let given = no_bool(given)?;
            given.extract::<i64>().ok().or_else(|| (1..=8).find(|&whole| given.eq(whole).unwrap_or(false)))
        }
    }
}

/// What is not a bool: that is a number for Python, and was meant for something else.
fn no_bool<'a, 'py>(given: &'a Bound<'py, PyAny>) -> Option<&'a Bound<'py, PyAny>> {
    (!given.is_instance_of::<PyBool>()).then_some(given)
}

fn shown_or(given: Option<&Bound<'_, PyAny>>) -> String {
    given.map_or_else(String::new, shown)
}
