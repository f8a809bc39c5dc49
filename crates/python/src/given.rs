//! A value that Python gives to a register or a parameter.

use drivebus_drives::{Entry, OwnedInput};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyString};

use crate::convert::shown;
use crate::errors::bad_argument;

/// What `value` gives to `entry`. Of decimals, numpy's floats and integers of any size what they print is what they are.
pub(crate) fn given(entry: &Entry, value: &Bound<'_, PyAny>) -> PyResult<OwnedInput> {
    // A switch is on or off. Anything else that is told True was meant for another name.
    if value.is_instance_of::<PyBool>() && entry.quantity().high().is_none_or(|high| high.to_string() != "1") {
        return Ok(OwnedInput::Decimal(shown(value)));
    }
    Ok(if let Ok(float) = value.cast::<PyFloat>() {
        OwnedInput::Float(float.extract()?)
    } else if let Ok(integer) = value.extract() {
        OwnedInput::Integer(integer)
    } else if value.is_instance_of::<PyString>() {
        OwnedInput::Text(value.extract().map_err(|_| bad_argument(format!("value {} is not a text", shown(value))))?)
    } else {
        OwnedInput::Decimal(value.str().map_or_else(|_| shown(value), |digits| digits.to_string()))
    })
}
