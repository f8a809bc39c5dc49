//! Who made a unit, by its own words: what to ask for it, and what came.

use std::sync::{Mutex, PoisonError};

use drivebus_line as line;
use drivebus_rtu::{Adu, Destination, ExceptionCode, Frame, IdentificationPage};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

/// The objects of one answer to 2BH/0EH, by their numbers; None of any other PDU.
#[pyfunction]
#[pyo3(signature = (pdu, /))]
pub(crate) fn device_objects<'py>(py: Python<'py>, pdu: &[u8]) -> Option<Vec<(u8, Bound<'py, PyBytes>)>> {
    let page = IdentificationPage::parse(pdu).ok()?;
    Some(page.objects().map(|(object, value)| (object, PyBytes::new(py, value))).collect())
}

/// Conformity, whether that is all, the first seven objects as text, and all as bytes.
type Told<'py> = (u8, bool, Vec<Option<String>>, Bound<'py, PyDict>);

/// What to ask a unit next for its identification.
#[pyclass(frozen, module = "drivebus._native")]
pub(crate) struct DeviceQuestion(Mutex<line::DeviceQuestion>);

#[pymethods]
impl DeviceQuestion {
    #[new]
    fn new() -> Self {
        Self(Mutex::default())
    }

    /// The PDU to ask with now; None once it is known.
    fn pdu<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        let request = self.with(|question| question.request())?;
        let frame = Adu::request(Destination::Broadcast, &request);
        Frame::parse(frame.as_bytes()).ok().map(|frame| PyBytes::new(py, frame.pdu()))
    }

    #[pyo3(signature = (pdu, /))]
    fn heard(&self, pdu: &[u8]) {
        self.with(|question| question.heard(pdu));
    }

    #[pyo3(signature = (code, /))]
    fn refused(&self, code: u8) -> bool {
        self.with(|question| question.refused(ExceptionCode(code)))
    }

    /// What came.
    fn told<'py>(&self, py: Python<'py>) -> PyResult<Told<'py>> {
        let told = self.with(|question| question.clone().told());
        let objects = PyDict::new(py);
        for (object, value) in told.objects() {
            objects.set_item(object, PyBytes::new(py, value))?;
        }
        let texts = vec![
            told.vendor(),
            told.product_code(),
            told.revision(),
            told.vendor_url(),
            told.product_name(),
            told.model_name(),
            told.application_name(),
        ];
        Ok((told.conformity(), told.is_complete(), texts, objects))
    }
}

impl DeviceQuestion {
    fn with<R>(&self, use_it: impl FnOnce(&mut line::DeviceQuestion) -> R) -> R {
        use_it(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
