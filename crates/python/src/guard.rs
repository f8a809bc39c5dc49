//! What a write by address would command, for Python: whether it may be sent, and else why not.

use std::collections::BTreeMap;
use std::sync::Arc;

use drivebus_drive::{self as drive, Families, Forbidden};
use drivebus_drives::Place;
use pyo3::prelude::*;

use crate::convert::{place_of, words_of};
use crate::errors::bad_argument;
use crate::family::Family;

/// Why not: its kind, what people call the family, the place, and what belongs to the kind.
#[derive(Debug, IntoPyObject)]
pub(crate) enum Told {
    /// The word, and the codes of the family.
    Undefined(&'static str, String, u32, u16, BTreeMap<u16, String>),
    /// Where the family takes its commands, and what people call the families that take theirs here.
    Foreign(&'static str, String, u32, Option<u32>, Vec<String>),
}

/// Why words may not be written to a unit that may be one of `families`; `None` where they may.
#[pyfunction]
#[pyo3(signature = (families, place, words, /))]
pub(crate) fn forbidden(
    families: Vec<Bound<'_, Family>>,
    place: &Bound<'_, PyAny>,
    words: &Bound<'_, PyAny>,
) -> PyResult<Option<Told>> {
    let unit: Vec<_> = families.into_iter().map(|family| Arc::clone(family.get().core())).collect();
    let words = words_of(words)?;
    let words = words.as_ref().map_or_else(std::slice::from_ref, Vec::as_slice);
    let Err(why) = Families::shipped().check(&unit, place_of(place)?, words) else {
        return Ok(None);
    };
    Ok(Some(match why {
        Forbidden::Undefined { family, place, word, codes } => {
            Told::Undefined("undefined", title(family), place.number(), word, codes.clone())
        }
        Forbidden::Foreign { family, place, others } => {
            let own = family.profile().command_address().map(Place::number);
            Told::Foreign("foreign", title(family), place.number(), own, titles(others))
        }
        // What a later core forbids besides, is not sent either.
        other => return Err(bad_argument(other.to_string())),
    }))
}

/// What people call the shipped families that take commands at a place.
#[pyfunction]
#[pyo3(signature = (place, /))]
pub(crate) fn commanded_at(place: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    Ok(titles(Families::shipped().commanded_at(place_of(place)?)))
}

fn title(family: &drive::Family) -> String {
    family.profile().title().to_owned()
}

fn titles(families: &[Arc<drive::Family>]) -> Vec<String> {
    families.iter().map(|family| title(family)).collect()
}
