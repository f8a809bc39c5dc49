//! A serial port that is found again after it was unplugged, under whatever name it comes back.
//!
//! The name a person gives is good for the first opening. From then on it is the adapter that counts, where anything is
//! known of it: the name may belong to another one by now, which carries another line with other drives.

use std::path::Path;

use drivebus_rtu::SerialFormat;

use super::{Tty, TtyOptions, present_ports};
use crate::line::{PortError, PortErrorKind};
use crate::ports::adapters::identity::{Found, Identity, Places, device_number};

/// What opens one serial port, at first by its name and later by its adapter.
#[derive(Debug)]
pub struct Adapter {
    /// As it was given.
    name: String,
    format: SerialFormat,
    options: TtyOptions,
    places: Places,
    /// `None` as long as it was not opened, and for a port of which nothing but its name is known.
    known: Option<Identity>,
    /// When it was made: of a pseudo-terminal that was opened by its number, which is given to others once it is gone.
    made: Option<Made>,
}

impl Adapter {
    /// The adapter whose port is `name` when it is opened first.
    pub fn new(name: impl Into<String>, format: SerialFormat, options: TtyOptions) -> Self {
        Self { name: name.into(), format, options, places: Places::default(), known: None, made: None }
    }

    /// Looks up adapters in `places`, not in those of this machine.
    #[must_use]
    pub fn within(self, places: Places) -> Self {
        Self { places, ..self }
    }

    /// Opens the port: at first the one with the name that was given, later the same adapter's, whatever its name is
    /// now. Where nothing but its name is known of an adapter, the name is opened again, as a link perhaps elsewhere; but
    /// not the number of a pseudo-terminal that is another one by now.
    ///
    /// # Errors
    ///
    /// Those of [`Tty::open`]. [`PortErrorKind::NotFound`]: the adapter is not plugged in, also when another one has its
    /// name now, which is then left alone.
    pub fn open(&mut self) -> Result<Tty, PortError> {
        if self.made.is_some_and(|made| made_at(&self.name).is_some_and(|now| now != made)) {
            let message = "it was a pseudo-terminal, and another one has its number now, so it was not opened: make a \
                           new bus, or give a link that is kept leading to it";
            return Err(PortError::new(PortErrorKind::NotFound, &self.name, message));
        }
        let name = match &self.known {
            Some(known) => self.whereabouts(known)?,
            None => self.name.clone(),
        };
        let tty = Tty::open_within(&name, &self.format, &self.options, &self.places)
            .map_err(|error| if self.known.is_some() { just_back(error) } else { error })?;
        // Asked of what is open, whose number is given to nothing else meanwhile; the name may lead elsewhere by now.
        let found = tty.device_number().and_then(|number| self.places.identify(number));
        self.known = match (self.known.take(), found) {
            (Some(known), Some(found)) if known.is(&found) => Some(known.seen_again(found)),
            (Some(known), found) => {
                let error = self.missing(&known, found.as_ref());
                self.known = Some(known);
                return Err(error);
            }
            (None, found) => found,
        };
        let is_bare = self.known.is_none() && tty.is_pseudo_terminal();
        self.made = if is_bare { made_at(&self.name) } else { None };
        Ok(tty)
    }

    /// The name under which `known` can be opened now: the one that was given, if it leads there.
    fn whereabouts(&self, known: &Identity) -> Result<String, PortError> {
        let given = device_number(Path::new(&self.name));
        match self.places.find(known) {
            Found::At(path) if given.is_some() && device_number(&path) == given => Ok(self.name.clone()),
            Found::At(path) => Ok(path.to_string_lossy().into_owned()),
            Found::OneOf(paths) => {
                let paths: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
                let message = format!(
                    "it was {known}, and {} say the same of themselves; leave only one of them plugged in",
                    paths.join(" and ")
                );
                Err(PortError::new(PortErrorKind::NotFound, &self.name, message))
            }
            Found::Nowhere => {
                let there_now = given.and_then(|number| self.places.identify(number));
                Err(self.missing(known, there_now.as_ref()))
            }
        }
    }

    /// `known` cannot be found; `there_now` has its name.
    fn missing(&self, known: &Identity, there_now: Option<&Identity>) -> PortError {
        let message = match there_now {
            Some(other) => format!(
                "it is another adapter now, so it was not opened: expected {known}, found {other}; plug the first one in \
                 again, or make a new bus on this one"
            ),
            None => format!("its adapter is not plugged in: {known}; plug it in again; {}", present_ports()),
        };
        PortError::new(PortErrorKind::NotFound, &self.name, message)
    }
}

/// Seconds and nanoseconds.
type Made = (i64, i64);

/// When what has this `name` was made, which a pseudo-terminal shows by when its owner or rights were set last; `None`
/// for a link, which may lead to something new on purpose.
#[cfg(unix)]
fn made_at(name: &str) -> Option<Made> {
    use std::os::unix::fs::MetadataExt;

    let status = std::fs::symlink_metadata(name).ok().filter(|status| !status.is_symlink())?;
    Some((status.ctime(), status.ctime_nsec()))
}

/// Nothing: there are no pseudo-terminals.
#[cfg(not(unix))]
fn made_at(_name: &str) -> Option<Made> {
    None
}

/// `error` of opening a port again: its user could open it before, so it is not the user who lacks a right.
fn just_back(error: PortError) -> PortError {
    match error.kind {
        PortErrorKind::Denied => {
            let message =
                format!("{}; right after plugging in, the rights may not be set yet: ask again", error.message);
            PortError { message, ..error }
        }
        _ => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rights_that_are_not_set_yet_are_nobodys_fault() {
        let message_of = |kind| just_back(PortError::new(kind, "/dev/ttyUSB0", "it fails")).to_string();
        assert_eq!(message_of(PortErrorKind::Busy), "/dev/ttyUSB0: it fails");
        assert!(message_of(PortErrorKind::Denied).starts_with("/dev/ttyUSB0: it fails; right after plugging in"));
    }
}
