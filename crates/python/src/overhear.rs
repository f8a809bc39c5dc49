//! All that goes over a line, given to a function of Python's until it has had enough.

use std::cell::{Cell, RefCell};
use std::time::Duration;

use drivebus_line::{Bus, Direction, Failure, Overheard, PortError, PortErrorKind};
use drivebus_rtu::Instant;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::ending::Inside;
use crate::errors::port_error;
use crate::signals::with_signals;

/// Longer than any line is heard.
const FOR_EVER: Duration = Duration::from_secs(100 * 365 * 86_400);

/// Calls `function` with the moment, whether it was sent, and the bytes of each piece, until it returns something true.
///
/// # Errors
///
/// What `function` raised; the line is lost or closed.
pub(crate) fn overhear(py: Python<'_>, core: &Bus, function: &Py<PyAny>) -> PyResult<()> {
    let (end, is_over, raised) = with_signals(py, |give_up| {
        let (is_over, raised) = (Cell::new(false), RefCell::new(None));
        let mut hear = |piece: Overheard| {
            // At the end of the program nobody is told anything any more.
            let Some(_inside) = Inside::enter() else { return is_over.set(true) };
            match Python::try_attach(|py| tell(py, function, &piece)) {
                Some(Ok(has_enough)) => is_over.set(has_enough || is_over.get()),
                Some(Err(error)) => {
                    is_over.set(true);
                    raised.replace(Some(error));
                }
                None => is_over.set(true),
            }
        };
        let end = core.overhear(FOR_EVER, &mut || is_over.get() || give_up(), &mut hear);
        (end, is_over.get(), raised.into_inner())
    })?;
    match (raised, end) {
        (Some(error), _) => Err(error),
        (None, Err(Failure::Port(error))) => Err(port_error(&error)),
        (None, Err(other)) if !is_over => {
            Err(port_error(&PortError::new(PortErrorKind::Closed, core.name(), other.to_string())))
        }
        _ => Ok(()),
    }
}

fn tell(py: Python<'_>, function: &Py<PyAny>, piece: &Overheard) -> PyResult<bool> {
    let at = piece.at.saturating_duration_since(Instant::ZERO).as_secs_f64();
    let sent = piece.direction == Direction::Sent;
    function.bind(py).call1((at, sent, PyBytes::new(py, &piece.bytes)))?.is_truthy()
}
