//! Who halts a unit for a program or client that is gone, where families of drives are known: this crate knows none.

use std::fmt;
use std::time::Duration;

use drivebus_rtu::{Answer, Instant, Request, UnitAddress};

use crate::error::CallError;
use crate::options::{CallOptions, Named};

/// Halts units as ones of their families, and proves it. See [`BusOptions::halter`](super::BusOptions::halter).
pub trait Halter: fmt::Debug + Send + Sync {
    /// Halts `unit`, which was `named` so, over `line`; blocks until that is done, or not taken `within` that time of the
    /// line's clock. With none it is told once.
    fn halt(&self, unit: UnitAddress, named: &Named, within: Duration, line: &mut dyn HaltLine) -> Halted;
}

/// The line of one unit that is halted, from which others are kept.
pub trait HaltLine {
    /// Now, on the line's clock.
    fn now(&self) -> Instant;

    /// How often the port was opened again: while this stays the same, whoever answered still does.
    fn reconnects(&self) -> u64;

    /// Whether the bus was closed, or the port is another program's by now, which halts the unit itself.
    fn is_closed(&self) -> bool;

    /// Waits on the line's clock.
    fn sleep(&mut self, time: Duration);

    /// Asks the unit before all who wait for the line, and gives the answer to `take`.
    ///
    /// # Errors
    ///
    /// Those of [`Bus::call`](crate::Bus::call).
    fn ask(
        &mut self,
        request: &Request<'_>,
        options: CallOptions,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<(), Box<CallError>>;

    /// The unit took a halt: from here on others may ask it.
    fn took(&mut self);
}

/// What came of a halt.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Halted {
    /// The unit took it; in words, what shows of it.
    Took(String),
    /// It took none, in all that time: it is told again.
    NotTaken,
    /// Nothing was sent, and nothing is: it is another unit, which that might start.
    Another,
    /// It was not carried through, for a reason that says nothing of the unit: it is told again.
    GivenUp,
    /// Nobody here knows how: its will is carried out frame by frame.
    Unknown,
}
