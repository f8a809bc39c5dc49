//! The simulated wire for Python: what it saw, and what it is told to spoil.

use drivebus_sim::{self as sim, FaultKind, Side, SimError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};

use crate::clock::seconds;
use crate::convert::{bytes_of, duration, shown};
use crate::errors::{bad_argument, refuse, sim_error};
use crate::format::SerialFormat;

/// The wire: what it saw, and what it is told to spoil.
#[pyclass(frozen, module = "drivebus._native")]
pub(crate) struct SimulatedLine(sim::SimulatedLine);

impl SimulatedLine {
    pub(crate) fn new(line: sim::SimulatedLine) -> Self {
        Self(line)
    }
}

#[pymethods]
impl SimulatedLine {
    #[getter]
    fn format(&self) -> SerialFormat {
        SerialFormat(self.0.format())
    }

    #[setter]
    fn set_format(&self, format: SerialFormat) {
        self.0.set_format(format.0);
    }

    #[getter]
    fn requests(&self) -> u64 {
        self.0.requests()
    }

    #[getter]
    fn silence_violations(&self) -> u64 {
        self.0.silence_violations()
    }

    #[pyo3(signature = (data, /))]
    fn answer_with(&self, data: &Bound<'_, PyAny>) -> PyResult<()> {
        self.0.answer_with(bytes_of(data)?.as_bytes());
        Ok(())
    }

    #[pyo3(signature = (count = None, /), text_signature = "($self, count=1, /)")]
    fn drop_answers(&self, count: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        self.0.drop_answers(answers(count)?);
        Ok(())
    }

    #[pyo3(signature = (seconds, count = None, /), text_signature = "($self, seconds, count=1, /)")]
    fn delay_answers(&self, seconds: f64, count: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        self.0.delay_answers(duration(seconds)?, answers(count)?);
        Ok(())
    }

    #[pyo3(signature = (data, count = None, /), text_signature = "($self, data, count=1, /)")]
    fn noise_before(&self, data: &Bound<'_, PyAny>, count: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        self.0.noise_before(bytes_of(data)?.as_bytes(), answers(count)?);
        Ok(())
    }

    #[pyo3(signature = (data, count = None, /), text_signature = "($self, data, count=1, /)")]
    fn noise_after(&self, data: &Bound<'_, PyAny>, count: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        self.0.noise_after(bytes_of(data)?.as_bytes(), answers(count)?);
        Ok(())
    }

    fn clear(&self) {
        self.0.clear();
    }

    #[pyo3(signature = (**rates), text_signature = "($self, **rates)")]
    fn set_faults(&self, rates: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
        let rates = rates_of(rates)?;
        for kind in FaultKind::ALL {
            let named = rates.iter().rev().find(|(named, _)| named.is_some_and(|named| named == kind));
            let general = rates.iter().find(|(named, _)| named.is_none() && kind != FaultKind::Unplug);
            self.0.set_rate(kind, named.or(general).map_or(0.0, |&(_, rate)| rate)).map_err(refuse)?;
        }
        Ok(())
    }

    #[getter]
    fn faults<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let rates = PyDict::new(py);
        for (kind, rate) in self.0.rates() {
            rates.set_item(kind.name(), rate)?;
        }
        Ok(rates)
    }

    #[pyo3(signature = (faults, /))]
    fn script(&self, faults: &Bound<'_, PyAny>) -> PyResult<()> {
        let mistake =
            || bad_argument(format!("script {} is not a list of (answer number from 1, kind or bytes)", shown(faults)));
        let (mut kinds, mut instead) = (Vec::new(), Vec::new());
        for item in faults.try_iter().map_err(|_| mistake())? {
            let (answer, what): (u64, Bound<'_, PyAny>) = item?.extract().map_err(|_| mistake())?;
            if answer == 0 {
                return Err(mistake());
            }
            match what.extract::<String>() {
                Ok(kind) => kinds.push((answer, kind_of(&kind)?)),
                Err(_) => instead.push((answer, what.extract::<Vec<u8>>().map_err(|_| mistake())?)),
            }
        }
        let instead: Vec<(u64, &[u8])> = instead.iter().map(|(answer, bytes)| (*answer, bytes.as_slice())).collect();
        self.0.script_with(&kinds, &instead);
        Ok(())
    }

    fn fault_counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counts = PyDict::new(py);
        for kind in FaultKind::ALL {
            counts.set_item(kind.name(), self.0.counts(kind))?;
        }
        Ok(counts)
    }

    #[pyo3(signature = (*, delay = None, late = None, overtaken = None, replug = None))]
    fn set_times(
        &self,
        delay: Option<f64>,
        late: Option<f64>,
        overtaken: Option<(f64, f64)>,
        replug: Option<f64>,
    ) -> PyResult<()> {
        let [delay, late, replug] = [delay, late, replug].map(|given| given.map(duration).transpose());
        if let Some(delay) = delay? {
            self.0.set_delay(delay);
        }
        if let Some(late) = late? {
            self.0.set_late(late);
        }
        if let Some((least, most)) = overtaken {
            let (least, most) = (duration(least)?, duration(most)?);
            if least > most {
                return Err(bad_argument(format!("overtaken {least:?} to {most:?}: give the least first")));
            }
            self.0.set_overtaken(least, most);
        }
        if let Some(replug) = replug? {
            self.0.set_replug(replug);
        }
        Ok(())
    }

    #[getter]
    fn echo(&self) -> bool {
        self.0.echo()
    }

    #[setter]
    fn set_echo(&self, echo: bool) {
        self.0.set_echo(echo);
    }

    fn unplug(&self, py: Python<'_>) {
        // Ending a server waits for its thread.
        py.detach(|| self.0.unplug());
    }

    fn replug(&self, py: Python<'_>) -> PyResult<()> {
        py.detach(|| self.0.replug()).map_err(|error| sim_error("simulator", error))
    }

    #[getter]
    fn plugged(&self) -> bool {
        self.0.is_plugged()
    }

    fn trace<'py>(&self, py: Python<'py>) -> Vec<(f64, &'static str, Bound<'py, PyBytes>)> {
        let sent = self.0.trace();
        let side = |side| if side == Side::Master { "master" } else { "unit" };
        sent.iter().map(|sent| (seconds(sent.begin), side(sent.side), PyBytes::new(py, &sent.bytes))).collect()
    }
}

/// Keyword arguments as rates; `None` is `all`.
fn rates_of(rates: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<(Option<FaultKind>, f64)>> {
    let rates = rates.into_iter().flatten();
    rates
        .map(|(name, rate)| {
            let name: String = name.extract()?;
            let kind = if name == "all" { None } else { Some(kind_of(&name)?) };
            let rate = rate.extract().ok().filter(|rate| (0.0..=1.0).contains(rate));
            let mistake = || bad_argument(format!("a rate of {name} is not a number from 0.0 to 1.0"));
            Ok((kind, rate.ok_or_else(mistake)?))
        })
        .collect()
}

/// The names of all kinds of faults.
#[pyfunction]
pub(crate) fn fault_kinds(py: Python<'_>) -> PyResult<Bound<'_, PyTuple>> {
    PyTuple::new(py, FaultKind::ALL.map(FaultKind::name))
}

fn kind_of(name: &str) -> PyResult<FaultKind> {
    name.parse().map_err(|error: SimError| refuse(error))
}

/// How many answers a fault is for: one, unless it is said.
fn answers(count: Option<&Bound<'_, PyAny>>) -> PyResult<u32> {
    count.map_or(Ok(1), |count| {
        count
            .extract()
            .map_err(|_| bad_argument(format!("count {} is not a number from 0 to {}", shown(count), u32::MAX)))
    })
}
