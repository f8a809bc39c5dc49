//! `Plan` for Python: what to read for some names, and the way from the words to their values.

use std::sync::Arc;

use drivebus_drives::ReadPlan;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::convert::words_of;
use crate::errors::bad_argument;
use crate::tables::number;

/// Reads and their values, worked out once.
#[pyclass(frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Plan {
    names: Vec<String>,
    core: Arc<ReadPlan>,
}

#[pymethods]
impl Plan {
    #[getter]
    fn names(&self) -> Vec<&str> {
        self.names.iter().map(String::as_str).collect()
    }

    #[getter]
    fn reads(&self) -> Vec<(u32, u16)> {
        self.core.reads().iter().map(|read| (read.place().number(), read.count)).collect()
    }

    #[pyo3(signature = (answers, /))]
    fn values<'py>(&self, answers: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyList>> {
        let py = answers.py();
        let reads = self.core.reads();
        let answers = answers
            .try_iter()?
            .map(|words| words_of(&words?)?.map_err(|word| bad_argument(format!("{word} is not the words of a read"))))
            .collect::<PyResult<Vec<_>>>()?;
        let fits = answers.len() == reads.len()
            && answers.iter().zip(reads).all(|(words, read)| words.len() == usize::from(read.count));
        if !fits {
            let numbers = |counts: Vec<usize>| counts.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
            let came = numbers(answers.iter().map(Vec::len).collect());
            let asked = numbers(reads.iter().map(|read| usize::from(read.count)).collect());
            return Err(bad_argument(format!("answers of {came} words, for reads of {asked} words")));
        }
        let words = answers.concat();
        let values = self.core.told(&words).map(|(quantity, value)| value.map(|value| number(py, quantity, value)));
        PyList::new(py, values.collect::<Vec<_>>())
    }

    fn __repr__(&self) -> String {
        format!("<_native.Plan of {} names in {} reads>", self.names.len(), self.core.reads().len())
    }
}

impl Plan {
    pub(crate) fn new(names: Vec<String>, core: ReadPlan) -> Self {
        Self { names, core: Arc::new(core) }
    }

    pub(crate) fn core(&self) -> Arc<ReadPlan> {
        Arc::clone(&self.core)
    }
}
