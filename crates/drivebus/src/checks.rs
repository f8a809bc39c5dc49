//! Arguments are checked here, at the door, so that nothing wrong reaches a line.
//!
//! Every message names what was given and what is allowed.

use std::fmt::Display;
use std::time::Duration;

use drivebus_drives::Place;
use drivebus_line::url::UnitError;
use drivebus_rtu::{MAX_WRITE, Request, Table, UnitAddress};

use crate::error::Error;
use crate::payload::Payload;

/// The longest time that can be asked for.
const LONGEST: Duration = Duration::from_secs(3600);

pub(crate) fn unit(unit: u8) -> Result<UnitAddress, Error> {
    Ok(UnitError::check(unit.into())?)
}

pub(crate) fn read(place: Place, count: u16) -> Result<Request<'static>, Error> {
    let table = table(place.table);
    within("count", count, 1, table.max_read())?;
    Ok(Request::read_of(table, place.address, count)?)
}

/// A profile's table as the line has it.
pub(crate) fn table(table: drivebus_drives::Table) -> Table {
    Table::of_function(table.function()).unwrap_or_default()
}

pub(crate) fn write<'a>(place: Place, payload: &'a Payload<'_>) -> Result<Request<'a>, Error> {
    match (table(place.table), payload) {
        (Table::Holding, Payload::Word(word)) => Ok(Request::write(place.address, *word)),
        (Table::Holding, Payload::Words(words)) => {
            within("number of values", words.len(), 1, usize::from(MAX_WRITE))?;
            Ok(Request::write_many(place.address, words)?)
        }
        (Table::Coil, Payload::Word(word)) => {
            within("value of a coil", *word, 0, 1)?;
            Ok(Request::write_coil(place.address, *word == 1))
        }
        (Table::Coil, Payload::Words(_)) => Err(Error::not_allowed(format!("{place}: one coil is written at a time"))),
        (Table::Input | Table::Discrete, _) => Err(Error::not_allowed(format!("{place} can only be read"))),
    }
}

/// A time-out: more than nothing, an hour at most.
pub(crate) fn timeout(given: Duration) -> Result<(), Error> {
    if given.is_zero() || given > LONGEST {
        return Err(out_of_range("timeout", given.as_secs_f64(), format!("more than 0 to {}", LONGEST.as_secs())));
    }
    Ok(())
}

/// A time that may be nothing, an hour at most.
pub(crate) fn time(what: &str, given: Duration) -> Result<(), Error> {
    if given > LONGEST {
        return Err(out_of_range(what, given.as_secs_f64(), format!("0 to {}", LONGEST.as_secs())));
    }
    Ok(())
}

/// A number that is not below 0.
pub(crate) fn not_negative(what: &str, given: f64) -> Result<(), Error> {
    if given.is_finite() && given >= 0.0 { Ok(()) } else { Err(out_of_range(what, given, "0 or more")) }
}

pub(crate) fn within<T: PartialOrd + Display + Copy>(what: &str, given: T, low: T, high: T) -> Result<(), Error> {
    if given < low || given > high {
        return Err(out_of_range(what, given, format!("{low} to {high}")));
    }
    Ok(())
}

fn out_of_range(what: &str, given: impl Display, allowed: impl Display) -> Error {
    Error::not_allowed(format!("{what} {given} is out of range; allowed is {allowed}"))
}
