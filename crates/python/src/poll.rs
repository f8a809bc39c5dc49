//! `Poller` and its batches for Python: samples taken and decoded many at a time, without the GIL while they are waited for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use drivebus_drives::{ReadPlan, Table, Value};
use drivebus_line::{Failure, Poll, PollBatch, PollError, PollSample, PollTarget};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyDict, PyInt, PyList, PyTuple};

use crate::arguments::duration;
use crate::bus::Bus;
use crate::clock::UnixClock;
use crate::convert::{any_unit, one_word, shown};
use crate::errors::{Class, bad_argument, call_error, refuse};
use crate::mailbox::Mailbox;
use crate::plan::Plan;
use crate::requests::{Asked, apart, nothing};
use crate::signals::with_signals;
use crate::tables::number;

/// What the words of a target mean.
#[derive(Debug)]
enum Meaning {
    Values(Arc<ReadPlan>),
    /// So many words, as they are.
    Words(usize),
}

/// A poll of a bus.
#[pyclass(frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Poller {
    core: Arc<Poll>,
    bus: Py<Bus>,
    meanings: Arc<[Meaning]>,
}

#[pymethods]
impl Poller {
    #[new]
    #[pyo3(signature = (bus, targets, interval, size, /))]
    fn new(bus: &Bound<'_, Bus>, targets: &Bound<'_, PyAny>, interval: Option<f64>, size: usize) -> PyResult<Self> {
        let py = bus.py();
        let interval = interval.map(|interval| duration("interval", interval)).transpose()?;
        let (mut asked, mut meanings) = (Vec::new(), Vec::new());
        for target in targets.try_iter()? {
            let (unit, what): (Bound<'_, PyAny>, Bound<'_, PyAny>) = target?.extract()?;
            let unit = any_unit(&unit)?;
            if let Ok(plan) = what.cast::<Plan>() {
                let plan = plan.get().core();
                let reads = plan.reads().iter().map(|read| (table(read.table), read.address, read.count)).collect();
                asked.push(PollTarget::of_tables(unit, reads));
                meanings.push(Meaning::Values(plan));
            } else {
                let reads = what.try_iter()?.map(|read| one_read(&read?)).collect::<PyResult<Vec<_>>>()?;
                meanings.push(Meaning::Words(reads.iter().map(|&(_, count)| usize::from(count)).sum()));
                asked.push(PollTarget::new(unit, reads));
            }
        }
        let core = Arc::clone(&bus.get().core);
        let core = py.detach(|| Poll::start(core, asked, interval, size)).map_err(|error| match error {
            PollError::Bus(failure) => port_error(&failure),
            other => refuse(other),
        })?;
        Ok(Self { core: Arc::new(core), bus: bus.clone().unbind(), meanings: meanings.into() })
    }

    #[getter]
    fn shortest(&self) -> f64 {
        self.core.shortest().as_secs_f64()
    }

    #[getter]
    fn over(&self, py: Python<'_>) -> bool {
        py.detach(|| self.core.is_over())
    }

    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counts = py.detach(|| self.core.counts());
        let all = PyDict::new(py);
        all.set_item("cycles", counts.cycles)?;
        all.set_item("missing", counts.missing)?;
        all.set_item("late", counts.late)?;
        all.set_item("dropped", counts.dropped)?;
        Ok(all)
    }

    #[pyo3(signature = (count, timeout, /))]
    fn wait(&self, py: Python<'_>, count: usize, timeout: Option<f64>) -> PyResult<usize> {
        let timeout = timeout.map(|timeout| duration("timeout", timeout)).transpose()?;
        with_signals(py, |give_up| self.core.wait(count, timeout, give_up))?.map_err(|failure| port_error(&failure))
    }

    #[pyo3(signature = (max, /))]
    fn take(&self, py: Python<'_>, max: usize) -> Batch {
        let core = py.detach(|| self.core.take(max));
        Batch { core, meanings: Arc::clone(&self.meanings), clock: self.bus.get().unix_clock(py) }
    }

    /// As `wait`, for an event loop: it has a letter then.
    #[pyo3(signature = (mailbox, count, timeout, /))]
    fn ask(&self, mailbox: &Mailbox, count: usize, timeout: Option<f64>) -> PyResult<Asked> {
        let timeout = timeout.map(|timeout| duration("timeout", timeout)).transpose()?;
        if self.bus.get().core.is_virtual() {
            let core = Arc::clone(&self.core);
            return apart(&mailbox.inbox, move |wanted| {
                let waited = core.wait(count, timeout, &mut || !wanted.load(Ordering::Acquire));
                move |py: Python<'_>| waited.map_err(|failure| port_error(&failure)).and_then(|_| nothing(py))
            });
        }
        let (number, wanted) = (mailbox.inbox.number(), Arc::new(AtomicBool::new(true)));
        let inbox = Arc::clone(&mailbox.inbox);
        self.core.call_when(count, Arc::clone(&wanted), move || inbox.post(number, nothing));
        Ok(Asked::apart(number, wanted))
    }

    fn stop(&self, py: Python<'_>) {
        py.detach(|| self.core.stop());
    }

    fn close(&self, py: Python<'_>) {
        py.detach(|| self.core.close());
    }

    fn __repr__(&self) -> String {
        format!("<_native.Poller of {} targets>", self.meanings.len())
    }
}

impl Drop for Poller {
    /// Whoever still waits for it apart does not keep it going.
    fn drop(&mut self) {
        self.core.stop();
    }
}

/// Samples that were taken, the oldest first.
#[pyclass(frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Batch {
    core: PollBatch,
    meanings: Arc<[Meaning]>,
    clock: UnixClock,
}

#[pymethods]
impl Batch {
    fn __len__(&self) -> usize {
        self.core.len()
    }

    fn samples<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let samples = self.core.iter().map(|(sample, words)| {
            let (sent, ended) = self.times(sample);
            let (values, missing) = match &sample.missing {
                None => (Some(self.values(py, sample, words)?), None),
                Some(error) => {
                    let error = call_error(error, self.clock);
                    (None, Some(error.into_value(py)))
                }
            };
            (sample.target, sent, ended, sample.late, values, missing).into_pyobject(py)
        });
        PyList::new(py, samples.collect::<PyResult<Vec<Bound<'py, PyTuple>>>>()?)
    }

    #[pyo3(signature = (target, /))]
    fn rows<'py>(&self, py: Python<'py>, target: usize) -> Bound<'py, PyByteArray> {
        let mut bytes = Vec::new();
        for (sample, words) in self.core.iter().filter(|(sample, _)| sample.target == target) {
            let (sent, ended) = self.times(sample);
            let mut put = |number: f64| bytes.extend_from_slice(&number.to_ne_bytes());
            put(sent);
            put(ended);
            let is_missing = sample.missing.is_some();
            let or_nan = |number: f64| if is_missing { f64::NAN } else { number };
            match self.meanings.get(target) {
                Some(Meaning::Values(plan)) => {
                    plan.told(words).for_each(|(_, value)| put(or_nan(value.map_or(f64::NAN, Value::to_f64))));
                }
                Some(Meaning::Words(count)) => {
                    words.iter().take(*count).for_each(|&word| put(or_nan(f64::from(word))));
                }
                None => {}
            }
        }
        PyByteArray::new(py, &bytes)
    }

    fn __repr__(&self) -> String {
        format!("<_native.Batch of {} samples>", self.core.len())
    }
}

impl Batch {
    /// When it was asked and when it was answered, in Unix seconds.
    fn times(&self, sample: &PollSample) -> (f64, f64) {
        (self.clock.at(sample.sent), self.clock.at(sample.ended))
    }

    fn values<'py>(&self, py: Python<'py>, sample: &PollSample, words: &[u16]) -> PyResult<Bound<'py, PyList>> {
        match self.meanings.get(sample.target) {
            Some(Meaning::Values(plan)) => {
                let values = plan.told(words).map(|(quantity, value)| value.map(|value| number(py, quantity, value)));
                PyList::new(py, values.collect::<Vec<_>>())
            }
            Some(Meaning::Words(count)) => {
                PyList::new(py, words.iter().take(*count).map(|&word| PyInt::new(py, word)).collect::<Vec<_>>())
            }
            None => Ok(PyList::empty(py)),
        }
    }
}

/// A profile's table as the line has it.
fn table(table: Table) -> drivebus_rtu::Table {
    drivebus_rtu::Table::of_function(table.function()).unwrap_or_default()
}

/// Address and number of words.
fn one_read(given: &Bound<'_, PyAny>) -> PyResult<(u16, u16)> {
    let pair: Result<(Bound<'_, PyAny>, Bound<'_, PyAny>), _> = given.extract();
    let (address, count) = pair.map_err(|_| bad_argument(format!("{} is not an (address, count)", shown(given))))?;
    Ok((one_word("address", &address)?, one_word("count", &count)?))
}

fn port_error(failure: &Failure) -> PyErr {
    Class::Port.raise(failure.to_string(), |_| Ok(()))
}
