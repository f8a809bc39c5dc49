//! Arguments are checked here, at the door, so that nothing wrong reaches a line.
//!
//! Every message names what was given and what is allowed.

use std::fmt::Display;
use std::time::Duration;

use drivebus_line::url::UnitError;
use drivebus_rtu::{MAX_READ, MAX_WRITE, Request, UnitAddress};

use crate::error::Error;
use crate::payload::Payload;

/// The longest time that can be asked for.
const LONGEST: Duration = Duration::from_secs(3600);

pub(crate) fn unit(unit: u8) -> Result<UnitAddress, Error> {
    Ok(UnitError::check(unit.into())?)
}

pub(crate) fn read(address: u16, count: u16) -> Result<Request<'static>, Error> {
    within("count", count, 1, MAX_READ)?;
    Ok(Request::read(address, count)?)
}

pub(crate) fn write<'a>(address: u16, payload: &'a Payload<'_>) -> Result<Request<'a>, Error> {
    match payload {
        Payload::Word(word) => Ok(Request::write(address, *word)),
        Payload::Words(words) => {
            within("number of values", words.len(), 1, usize::from(MAX_WRITE))?;
            Ok(Request::write_many(address, words)?)
        }
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

pub(crate) fn within<T: PartialOrd + Display + Copy>(what: &str, given: T, low: T, high: T) -> Result<(), Error> {
    if given < low || given > high {
        return Err(out_of_range(what, given, format!("{low} to {high}")));
    }
    Ok(())
}

fn out_of_range(what: &str, given: impl Display, allowed: impl Display) -> Error {
    Error::not_allowed(format!("{what} {given} is out of range; allowed is {allowed}"))
}
