//! `Fall` for Python: whether what is seen of a motor proves that it obeys its stop, in seconds of the line's clock.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use drivebus_drive::{self as drive, Glimpse};
use drivebus_rtu::Instant;
use pyo3::prelude::*;

use crate::clock::to_seconds;

/// What was seen since a stop was sent.
#[pyclass(name = "Fall", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Fall(Mutex<drive::Fall>);

impl Fall {
    fn with<T>(&self, f: impl FnOnce(&mut drive::Fall) -> T) -> T {
        f(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[pymethods]
impl Fall {
    #[classattr]
    const PATIENCE: f64 = drive::Fall::PATIENCE.as_secs_f64();

    #[new]
    #[pyo3(signature = (sent, confirmed, within, /))]
    fn new(sent: f64, confirmed: f64, within: f64) -> Self {
        Self(Mutex::new(drive::Fall::new(moment(sent), moment(confirmed), duration(within))))
    }

    #[getter]
    fn until(&self) -> f64 {
        to_seconds(self.with(|fall| fall.until()))
    }

    #[getter]
    fn frequency(&self) -> Option<f64> {
        self.with(|fall| fall.frequency())
    }

    #[getter]
    fn seen_at(&self) -> f64 {
        to_seconds(self.with(|fall| fall.seen_at()))
    }

    #[pyo3(signature = (seconds, /))]
    fn wait(&self, seconds: f64) {
        self.with(|fall| fall.wait(duration(seconds)));
    }

    fn goes_on(&self) {
        self.with(drive::Fall::goes_on);
    }

    #[pyo3(signature = (now, /))]
    fn rests(&self, now: f64) -> bool {
        self.with(|fall| fall.rests(moment(now)))
    }

    #[pyo3(signature = (hz, setpoint, asked, answered, /))]
    fn see(&self, hz: f64, setpoint: f64, asked: f64, answered: f64) {
        let (asked, answered) = (moment(asked), moment(answered));
        self.with(|fall| fall.see(Glimpse { asked, answered, hz, setpoint }));
    }

    fn is_worth_asking(&self) -> bool {
        self.with(|fall| fall.is_worth_asking())
    }

    #[pyo3(signature = (slope, /))]
    fn goes_along(&self, slope: f64) -> bool {
        self.with(|fall| fall.goes_along(slope))
    }
}

/// A moment of the line's clock; what is none is its begin or its end.
fn moment(seconds: f64) -> Instant {
    Instant::ZERO + duration(seconds)
}

/// So many seconds; what is no time is none, and what is too long is the longest.
fn duration(seconds: f64) -> Duration {
    let nearest = if seconds > 0.0 { Duration::MAX } else { Duration::ZERO };
    Duration::try_from_secs_f64(seconds).unwrap_or(nearest)
}
