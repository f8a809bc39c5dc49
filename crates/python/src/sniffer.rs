//! The ear on a line that others use, for Python.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drivebus_rtu::{self as rtu, Heard, Instant, Role};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::convert::bytes_of;
use crate::format::SerialFormat;

/// A piece of what was heard: who said it, its bytes, when it began and ended, the gap before it, how long it was kept
/// back, the turnaround, and why it is not a frame.
type Piece<'py> = (&'static str, Bound<'py, PyBytes>, f64, f64, Option<f64>, f64, Option<f64>, Option<String>);

/// Finds the frames of both directions, and says of each who said it.
#[pyclass(frozen, module = "drivebus._native")]
pub(crate) struct Sniffer(Mutex<Box<rtu::Sniffer>>);

#[pymethods]
impl Sniffer {
    #[new]
    fn new(format: &SerialFormat) -> Self {
        Self(Mutex::new(Box::new(rtu::Sniffer::new(&format.0))))
    }

    fn receive<'py>(&self, py: Python<'py>, at: f64, data: &Bound<'py, PyAny>) -> PyResult<Vec<Piece<'py>>> {
        let (now, data) = (instant(at), bytes_of(data)?);
        let (mut rest, mut pieces) = (data.as_bytes(), Vec::new());
        let mut sniffer = self.lock();
        // What waited for this moment is told as it was before these bytes.
        while let Some(deadline) = sniffer.deadline().filter(|&deadline| deadline < now) {
            tell(py, &mut sniffer, deadline, &mut pieces);
        }
        loop {
            let count = sniffer.receive(now, rest);
            rest = &rest[count..];
            tell(py, &mut sniffer, now, &mut pieces);
            if rest.is_empty() {
                return Ok(pieces);
            }
        }
    }

    fn poll<'py>(&self, py: Python<'py>, at: f64) -> Vec<Piece<'py>> {
        let mut pieces = Vec::new();
        tell(py, &mut self.lock(), instant(at), &mut pieces);
        pieces
    }

    fn finish<'py>(&self, py: Python<'py>) -> Vec<Piece<'py>> {
        let mut pieces = Vec::new();
        let mut sniffer = self.lock();
        while let Some(deadline) = sniffer.deadline() {
            tell(py, &mut sniffer, deadline, &mut pieces);
        }
        pieces
    }
}

impl Sniffer {
    fn lock(&self) -> MutexGuard<'_, Box<rtu::Sniffer>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn tell<'py>(py: Python<'py>, sniffer: &mut rtu::Sniffer, now: Instant, pieces: &mut Vec<Piece<'py>>) {
    while let Some(heard) = sniffer.poll(now) {
        pieces.push(piece(py, &heard));
    }
}

fn piece<'py>(py: Python<'py>, heard: &Heard<'_>) -> Piece<'py> {
    let error = match heard.role {
        Role::Noise(error) => Some(error.to_string()),
        _ => None,
    };
    let seconds = |moment: Instant| moment.saturating_duration_since(Instant::ZERO).as_secs_f64();
    let (gap, turnaround) = (heard.gap.map(|gap| gap.as_secs_f64()), heard.turnaround.map(|time| time.as_secs_f64()));
    let bytes = PyBytes::new(py, heard.bytes);
    (
        heard.role.name(),
        bytes,
        seconds(heard.began),
        seconds(heard.ended),
        gap,
        heard.kept.as_secs_f64(),
        turnaround,
        error,
    )
}

/// A moment in seconds; what is no moment is the start of the clock.
fn instant(seconds: f64) -> Instant {
    Instant::ZERO + Duration::try_from_secs_f64(seconds).unwrap_or_default()
}
