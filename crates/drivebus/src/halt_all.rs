//! Several drives of one line are halted side by side, and each is proved.

use std::fmt;
use std::sync::Arc;

use drivebus_line::ErrorKind;

use crate::bus::Bus;
use crate::driving::Drive;
use crate::error::Error;
use crate::halting::Halting;
use crate::named::{Each, Named, Work};

impl Bus {
    /// Halts `drives` of this line side by side, and proves each, as [`Drive::halt`] does with one.
    ///
    /// First each is told once, by the word of its own family; those that answered lately, and need not be asked first what
    /// they are, come before the others. Then each is told until it takes it, and looked at until it shows it. Nothing is
    /// broadcast: the word that halts one family starts another. Who is silent or refuses keeps no other from being halted.
    ///
    /// ```
    /// use drivebus::{Bus, Halting, Profile};
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = Bus::open("sim://1=gd350,2=acs355?clock=virtual")?;
    /// let first = bus.drive(1, &Profile::builtin("gd350")?)?;
    /// let second = bus.drive(2, &Profile::builtin("acs355")?)?;
    /// bus.halt_all([&first, &second], &Halting::stop())?;
    ///
    /// let absent = bus.drive(9, &Profile::builtin("gd350")?)?;
    /// let error = bus.halt_all([&absent, &first], &Halting::stop()).unwrap_err();
    /// assert_eq!(error.halted(), [1]);
    /// let says = "1 of 2 drives were proved to be halted; not proved: unit 9. stop of unit 9 as INVT Goodrive350: it was ";
    /// assert!(error.to_string().starts_with(says));
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`NotAllHalted`]: one or more are not proved to be halted, and their motors may still turn. All others are halted. A
    /// drive of another line is one of the former, and so is nobody at all.
    pub fn halt_all<'a>(
        &self,
        drives: impl IntoIterator<Item = &'a Drive>,
        halting: &Halting,
    ) -> Result<(), NotAllHalted> {
        let (told, work) = Told::of(self, drives, halting);
        told.came_to(work.and_then(|work| self.carry_out(work)))
    }
}

/// Drives of which one or more are not proved to be halted: the motors of those may still turn.
///
/// Displays as one sentence that names them, and then why of each.
#[derive(Clone, PartialEq, Eq)]
pub struct NotAllHalted {
    halted: Vec<u8>,
    failures: Vec<(u8, Error)>,
}

impl NotAllHalted {
    /// The units that are not proved to be halted, each with an error as [`Drive::halt`] has it. Empty where no drive was
    /// named at all.
    pub fn failures(&self) -> &[(u8, Error)] {
        &self.failures
    }

    /// The units that are.
    pub fn halted(&self) -> &[u8] {
        &self.halted
    }
}

impl fmt::Display for NotAllHalted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (proved, all) = (self.halted.len(), self.halted.len() + self.failures.len());
        if all == 0 {
            return f.write_str("no drive was named, so nobody was told to halt");
        }
        let units: Vec<_> = self.failures.iter().map(|(unit, _)| unit.to_string()).collect();
        let reasons: Vec<_> = self.failures.iter().map(|(_, error)| error.to_string()).collect();
        let plural = if units.len() == 1 { "" } else { "s" };
        write!(
            f,
            "{proved} of {all} drives were proved to be halted; not proved: unit{plural} {}. {}",
            units.join(", "),
            reasons.join("; ")
        )
    }
}

impl fmt::Debug for NotAllHalted {
    /// What `main` prints when it ends with an error is for people too.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Without a [`source`](std::error::Error::source), as [`Error`] is.
impl std::error::Error for NotAllHalted {}

impl From<NotAllHalted> for Error {
    /// Of the kind of all failures, or [`Unconfirmed`](ErrorKind::Unconfirmed) where they are of several.
    fn from(error: NotAllHalted) -> Self {
        let mut kinds = error.failures.iter().map(|(_, failure)| failure.kind());
        let first = kinds.next().unwrap_or(ErrorKind::NotAllowed);
        let kind = if kinds.all(|kind| kind == first) { first } else { ErrorKind::Unconfirmed };
        let has_acted = error.failures.iter().any(|(_, failure)| failure.may_have_acted());
        Self::of(kind, &error).having_acted(has_acted)
    }
}

/// The drives that are told to halt.
pub(crate) struct Told {
    /// Those of the line.
    units: Vec<u8>,
    /// Those of another one.
    elsewhere: Vec<u8>,
}

impl Told {
    /// The `drives`, and the work of halting those of `bus`.
    pub(crate) fn of<'a>(
        bus: &Bus,
        drives: impl IntoIterator<Item = &'a Drive>,
        halting: &Halting,
    ) -> (Self, Result<Work<Each>, Error>) {
        let (here, elsewhere): (Vec<_>, Vec<_>) =
            drives.into_iter().partition(|drive| Arc::ptr_eq(&drive.bus().core, &bus.core));
        let unit = |drives: &[&Drive]| drives.iter().map(|drive| drive.unit()).collect();
        let all = here.iter().map(|drive| drive.named().clone()).collect();
        let work = halting.order().map(|order| Named::halt_all(all, order));
        (Self { units: unit(&here), elsewhere: unit(&elsewhere) }, work)
    }

    /// Whether all of them are halted, where this `came` of those of the line.
    pub(crate) fn came_to(self, came: Result<Each, Error>) -> Result<(), NotAllHalted> {
        let came = came.unwrap_or_else(|error| vec![Err(error); self.units.len()]);
        let (mut halted, mut failures) = (Vec::new(), Vec::new());
        for (unit, came) in self.units.into_iter().zip(came) {
            match came {
                Ok(()) => halted.push(unit),
                Err(error) => failures.push((unit, error)),
            }
        }
        let elsewhere =
            |unit| (unit, Error::not_allowed(format_args!("unit {unit} is on another line: it was not told")));
        failures.extend(self.elsewhere.into_iter().map(elsewhere));
        if failures.is_empty() && !halted.is_empty() { Ok(()) } else { Err(NotAllHalted { halted, failures }) }
    }
}
