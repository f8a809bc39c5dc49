//! Signals of Python while a call of the core is under way.

use std::sync::Mutex;

use pyo3::prelude::*;

use crate::ending::{Inside, detached};
use crate::trace;

/// Runs `work` without the GIL, with a question to ask now and then: has a signal handler of Python raised?
///
/// What it raised is what comes back, whatever `work` made of it.
pub(crate) fn with_signals<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&mut dyn FnMut() -> bool) -> T + Send,
) -> PyResult<T> {
    let raised = Mutex::new(None);
    let result = detached(py, || {
        work(&mut || {
            let Ok(mut raised) = raised.lock() else { return true };
            // The first is the one that counts; what comes after it, the interpreter raises when this has ended.
            if raised.is_none() {
                *raised = trace::take_raised();
            }
            if raised.is_none() {
                *raised =
                    Inside::enter().and_then(|_inside| Python::try_attach(|py| py.check_signals().err()).flatten());
            }
            raised.is_some()
        })
    });
    match raised.into_inner().ok().flatten().or_else(trace::take_raised) {
        Some(error) => Err(error),
        None => Ok(result),
    }
}
