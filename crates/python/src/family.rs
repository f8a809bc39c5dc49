//! `Family` for Python: what speaks against one by what a unit answers, and whom a word would harm.

use std::sync::Arc;

use drivebus_drive::{self as drive, Answer, Contradiction, Families, Said, What};
use drivebus_drives::Place;
use drivebus_rtu::ExceptionCode;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use crate::convert::{place_of, shown};
use crate::errors::{bad_argument, refuse};
use crate::profile::Profile;
use crate::tables;
use crate::task::unknown;

/// An answer: in Python a place, and the word that came or the exception by which it was refused.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Heard(Answer);

impl<'py> FromPyObject<'_, 'py> for Heard {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let (place, word, code): (Bound<'py, PyAny>, Option<u16>, Option<u8>) = given.extract()?;
        let said = word.map(Said::Word).or_else(|| code.map(|code| Said::Refused(ExceptionCode(code))));
        let said = said.ok_or_else(|| bad_argument("an answer has a word or an exception".to_owned()))?;
        Ok(Self(Answer { place: place_of(&place)?, said }))
    }
}

/// What speaks against a family: of which kind, and what of it Python words.
type Against<'py> = (&'static str, Bound<'py, PyAny>);

/// One family of drives, by what its units answer and refuse.
#[pyclass(name = "Family", frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Family(Arc<drive::Family>);

impl Family {
    pub(crate) fn core(&self) -> &Arc<drive::Family> {
        &self.0
    }
}

#[pymethods]
impl Family {
    #[new]
    #[pyo3(signature = (profile, /))]
    fn new(profile: &Profile) -> Self {
        Self(Families::shipped().family(&profile.core()))
    }

    #[pyo3(signature = (what, /))]
    fn harmed(&self, what: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
        Ok(names(&Families::shipped().harmed(what_of(what)?, &self.0)))
    }

    #[pyo3(signature = (answers, /))]
    fn contradiction<'py>(&self, py: Python<'py>, answers: Vec<Heard>) -> PyResult<Option<Against<'py>>> {
        self.0.contradiction(&all(answers)).map(|found| against(py, found)).transpose()
    }
}

/// Begins to work the shipped families out, for whoever will ask for them soon. Where no thread can be had, they are
/// worked out when they are asked for.
#[pyfunction]
pub(crate) fn begin_families() {
    let begun = std::thread::Builder::new().name("drivebus-families".to_owned()).spawn(|| {
        Families::shipped();
    });
    drop(begun);
}

/// Where units of the shipped families keep their codes.
#[pyfunction]
pub(crate) fn code_places() -> Vec<u32> {
    Families::shipped().codes().places().iter().map(|place| place.number()).collect()
}

/// Every code that a shipped profile lists.
#[pyfunction]
pub(crate) fn listed_codes() -> Vec<u16> {
    Families::shipped().codes().all().collect()
}

/// What the shipped profiles list of a code; nothing where there is no such place.
#[pyfunction]
#[pyo3(signature = (place, word, /))]
pub(crate) fn code_rows(py: Python<'_>, place: u32, word: u16) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let place = Place::of_number(place);
    let rows = place.map_or(&[][..], |place| Families::shipped().codes().rows(place, word));
    rows.iter().map(|row| tables::identification(py, row)).collect()
}

/// What speaks against a family, for Python.
pub(crate) fn against(py: Python<'_>, found: Contradiction) -> PyResult<Against<'_>> {
    Ok(match found {
        Contradiction::Code { place, word, rows } => {
            let rows = rows.iter().map(|row| tables::identification(py, row)).collect::<PyResult<Vec<_>>>()?;
            ("code", (place.number(), word, rows).into_pyobject(py)?.into_any())
        }
        Contradiction::NoAddress { place, code } => {
            ("no_address", (place.number(), code.0).into_pyobject(py)?.into_any())
        }
        Contradiction::NoFunction { place, code } => {
            ("no_function", (place.number(), code.0).into_pyobject(py)?.into_any())
        }
        Contradiction::Signature(families) => ("signature", names(&families).into_pyobject(py)?.into_any()),
        found => return Err(unknown(&found)),
    })
}

pub(crate) fn names(families: &[Arc<drive::Family>]) -> Vec<String> {
    families.iter().map(|family| family.name().to_owned()).collect()
}

fn all(answers: Vec<Heard>) -> Vec<Answer> {
    answers.into_iter().map(|Heard(answer)| answer).collect()
}

/// A command by its name, or a place.
pub(crate) fn what_of(given: &Bound<'_, PyAny>) -> PyResult<What> {
    if !given.is_instance_of::<PyString>() {
        return place_of(given).map(What::Word);
    }
    let name: String = given.extract().map_err(|_| bad_argument(format!("command {} is not a text", shown(given))))?;
    name.parse().map(What::Command).map_err(refuse)
}
