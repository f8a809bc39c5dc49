//! The frames on a line, given to a function of Python's.

use std::cell::RefCell;
use std::sync::Arc;

use drivebus_line::{Direction, Traced, Watch};
use drivebus_rtu::Instant;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::ending::Inside;

thread_local! {
    /// What a signal handler raised while a frame was shown: it ends the call that is under way, not the showing.
    static RAISED: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// What a signal handler of Python raised in this thread while a frame was shown.
pub(crate) fn take_raised() -> Option<PyErr> {
    RAISED.take()
}

/// Gives each frame to `function`: its moment and the time before it in seconds, whether it was sent, its bytes, and
/// whether another program has the port.
pub(crate) fn watch(function: Py<PyAny>) -> Watch {
    Arc::new(move |traced: Traced| {
        // At the end of the program nobody is shown anything any more.
        let Some(_inside) = Inside::enter() else { return };
        let _ = Python::try_attach(|py| {
            let at = traced.at.saturating_duration_since(Instant::ZERO).as_secs_f64();
            let gap = traced.gap.map(|gap| gap.as_secs_f64());
            let bytes = PyBytes::new(py, &traced.bytes);
            let sent = traced.direction == Direction::Sent;
            match function.bind(py).call1((at, gap, sent, bytes, traced.elsewhere)) {
                Ok(_) => {}
                Err(error) if error.is_instance_of::<PyException>(py) => {
                    error.write_unraisable(py, Some(function.bind(py)));
                }
                Err(error) => RAISED.set(Some(error)),
            }
        });
    })
}
