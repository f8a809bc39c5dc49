//! A value that Python gives to a register or a parameter.

use drivebus_drives::{Entry, Input};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyString};

use crate::convert::shown;
use crate::errors::bad_argument;

/// A value, as Python gives it.
pub(crate) enum Given {
    Integer(i64),
    Float(f64),
    Text(String),
    /// Decimal, numpy's floats, integers of any size: what they print is what they are.
    Decimal(String),
}

impl Given {
    /// What `value` gives to `entry`.
    pub(crate) fn of(entry: &Entry, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        // A switch is on or off. Anything else that is told True was meant for another name.
        if value.is_instance_of::<PyBool>() && entry.quantity().high().is_none_or(|high| high.to_string() != "1") {
            return Ok(Self::Decimal(shown(value)));
        }
        Ok(if let Ok(float) = value.cast::<PyFloat>() {
            Self::Float(float.extract()?)
        } else if let Ok(integer) = value.extract() {
            Self::Integer(integer)
        } else if value.is_instance_of::<PyString>() {
            Self::Text(value.extract().map_err(|_| bad_argument(format!("value {} is not a text", shown(value))))?)
        } else {
            Self::Decimal(value.str().map_or_else(|_| shown(value), |digits| digits.to_string()))
        })
    }

    pub(crate) fn input(&self) -> Input<'_> {
        match self {
            Self::Integer(integer) => Input::Integer(*integer),
            Self::Float(float) => Input::Float(*float),
            Self::Text(text) => Input::Text(text),
            Self::Decimal(digits) => Input::Decimal(digits),
        }
    }
}
