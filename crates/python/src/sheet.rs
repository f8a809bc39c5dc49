//! Tables of text, for Python.

use drivebus_drives::{Sheet, decode, whole_lines};
use pyo3::prelude::*;

use crate::errors::refuse;

/// The titles of a table, and its rows, each with its line.
type Table = (Vec<String>, Vec<(u64, Vec<String>)>);

#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "what Python hands over")]
#[pyo3(signature = (data, texts, /))]
pub(crate) fn read_sheet(py: Python<'_>, data: &[u8], texts: Vec<String>) -> PyResult<Table> {
    py.detach(|| Sheet::read(&decode(whole_lines(data))?, |title| !texts.iter().any(|text| text == title)))
        .map(|sheet| (sheet.titles, sheet.rows))
        .map_err(refuse)
}
