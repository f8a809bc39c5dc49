//! What a drive does, and why a motor is not known to be as it was waited for, for Python.

use std::time::Duration;

use drivebus_drive::{NotGivenBack, NotReached, NotRead, Status};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use crate::not_done::{Told, not_settled};
use crate::shown_look::{Shown, shown};
use crate::task::{Failed, is_done, unknown};

/// A look, the frequency at the output, the setpoint, and when the first of it was asked for.
type Moment = (Shown, Option<f64>, Option<f64>, f64);

/// How long is waited: longer than any clock can tell, it is as long as it can.
pub(crate) fn time_limit(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}

pub(crate) fn status(py: Python<'_>, done: Result<Status, NotRead<Failed>>) -> PyResult<Py<PyAny>> {
    done.map_or_else(|why| not_read(py, why), |status| is_done(py, moment(status)))
}

/// Whether the motor rests, or why that is not known.
pub(crate) fn rests(py: Python<'_>, done: Result<bool, NotGivenBack<Failed>>) -> PyResult<Py<PyAny>> {
    match done {
        Ok(rests) => is_done(py, rests),
        Err(NotGivenBack::Unseen(_)) => ("unseen", py.None()).into_py_any(py),
        Err(NotGivenBack::Failed(error)) => Err(error.into()),
        Err(why) => Err(unknown(&why)),
    }
}

pub(crate) fn waited(py: Python<'_>, done: Result<Status, NotReached<Failed>>) -> PyResult<Py<PyAny>> {
    let (kind, told): Told = match done {
        Ok(status) => return is_done(py, moment(status)),
        Err(NotReached::NotRead(why)) => return not_read(py, why),
        Err(NotReached::Unseen(_)) => ("unseen", py.None()),
        Err(NotReached::Untold { role, .. }) => ("untold", role.into_py_any(py)?),
        Err(NotReached::Tripped { status, before }) => ("tripped", (before, moment(status)).into_py_any(py)?),
        Err(NotReached::Late(status)) => ("late", moment(status).into_py_any(py)?),
        Err(why) => return Err(unknown(&why)),
    };
    ("not_reached", (kind, told)).into_py_any(py)
}

/// What the names of roles are read by can be read: only the line, and what decides their meaning, can fail.
fn not_read(py: Python<'_>, why: NotRead<Failed>) -> PyResult<Py<PyAny>> {
    match why {
        NotRead::NotSettled(why) => not_settled(py, why),
        NotRead::Failed(error) => Err(error.into()),
        why => Err(unknown(&why)),
    }
}

fn moment(status: Status) -> Moment {
    let Status { look, frequency, setpoint, asked, .. } = status;
    (shown(look), frequency, setpoint, asked.as_secs_f64())
}
