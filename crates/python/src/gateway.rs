//! `Gateway` for Python: a server for Modbus TCP before a bus.

use drivebus_line::gateway::Gateway as CoreGateway;
use drivebus_line::{PortError, PortErrorKind};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::duration;
use crate::bus::Bus;
use crate::errors::port_error;

/// A server for Modbus TCP, until it is closed.
#[pyclass(frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Gateway {
    core: CoreGateway,
}

#[pymethods]
impl Gateway {
    #[new]
    #[pyo3(signature = (bus, address, within, /))]
    fn new(bus: &Bound<'_, Bus>, address: &str, within: f64) -> PyResult<Self> {
        let within = duration("answer_within", within)?;
        let core = &bus.get().core;
        let opened = bus.py().detach(|| CoreGateway::open(core, address, within));
        opened.map(|core| Self { core }).map_err(|error| {
            let kind = match error.kind() {
                std::io::ErrorKind::AddrInUse => PortErrorKind::Busy,
                std::io::ErrorKind::PermissionDenied => PortErrorKind::Denied,
                std::io::ErrorKind::AddrNotAvailable => PortErrorKind::NotFound,
                _ => PortErrorKind::Other,
            };
            port_error(&PortError::new(kind, address, format!("nothing can listen there: {error}")))
        })
    }

    #[getter]
    fn address(&self) -> String {
        self.core.address().to_string()
    }

    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let stats = self.core.stats();
        let all = PyDict::new(py);
        all.set_item("clients", stats.clients)?;
        for (name, count) in [
            ("let_in", stats.let_in),
            ("cut_off", stats.cut_off),
            ("gave_way", stats.gave_way),
            ("requests", stats.requests),
            ("answered", stats.answered),
            ("refused", stats.refused),
            ("failed", stats.failed),
            ("late", stats.late),
            ("busy", stats.busy),
            ("together", stats.together),
        ] {
            all.set_item(name, count)?;
        }
        Ok(all)
    }

    fn take_told(&self) -> Vec<String> {
        self.core.take_told()
    }

    fn close(&self, py: Python<'_>) {
        py.detach(|| self.core.close());
    }
}
