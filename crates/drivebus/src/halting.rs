//! What a program says of a halt: which unit, as one of which family, and for how long it is told and looked at.

use std::sync::Arc;
use std::time::Duration;

use drivebus_drive::task::Task;
use drivebus_drive::{Families, Family, Halt, Looks, NotHalted, Order, Record, SameUnit, Speeds, Taken, Why};
use drivebus_drives::{Command, Profile};
use drivebus_line::ErrorKind;
use drivebus_rtu::UnitAddress;

use crate::bus::Bus;
use crate::checks;
use crate::error::Error;

/// How one unit is halted. What the unit said of itself is remembered here, for as long as the port stays open: one that is
/// kept for several halts asks less.
///
/// ```
/// use std::time::Duration;
///
/// use drivebus::{Bus, CallOptions, Halting, Profile};
///
/// # #[cfg(feature = "sim")] {
/// let bus = Bus::open("sim://gd350?clock=virtual")?;
/// let gd350 = Profile::builtin("gd350")?;
/// let halting = Halting::stop(1, &gd350)?;
/// for (address, word) in [(0x8001, 2), (0x8006, 8), (0x2001, 1_000), (0x2000, 1)] {
///     bus.write(1, address, word)?; // it obeys the bus, and runs at 10 Hz
/// }
/// bus.sleep(Duration::from_secs(30));
/// bus.halt(&halting)?; // it slows down now, as its ramp says
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Halting {
    unit: UnitAddress,
    family: Arc<Family>,
    record: Record,
    order: Order,
    is_unverified: bool,
    is_trusted: bool,
}

impl Halting {
    /// Stops `unit` (1..=247), which is one of the family of `profile`, as it is set to stop: usually by its ramp.
    ///
    /// It is told for ten seconds until it takes that, and looked at for one second.
    ///
    /// # Errors
    ///
    /// [`NotAllowed`](ErrorKind::NotAllowed): no such unit.
    pub fn stop(unit: u8, profile: &Arc<Profile>) -> Result<Self, Error> {
        Self::by(Command::Stop, unit, profile)
    }

    /// Switches the output of `unit` (1..=247) off: the motor freewheels to a standstill. Else as [`stop`](Self::stop).
    ///
    /// # Errors
    ///
    /// Those of [`stop`](Self::stop).
    pub fn coast(unit: u8, profile: &Arc<Profile>) -> Result<Self, Error> {
        Self::by(Command::Coast, unit, profile)
    }

    fn by(command: Command, unit: u8, profile: &Arc<Profile>) -> Result<Self, Error> {
        Ok(Self {
            unit: checks::unit(unit)?,
            family: Families::shipped().family(profile),
            record: Record::default(),
            order: Order { command, coasts: false, within: Order::WITHIN, confirm: Duration::from_secs(1) },
            is_unverified: false,
            is_trusted: false,
        })
    }

    /// For how long it is told until it takes that, 0 to 3600 s. A unit that answers, and has not said yet what it is, is
    /// asked for two seconds in any case.
    #[must_use]
    pub fn within(mut self, time: Duration) -> Self {
        self.order.within = time;
        self
    }

    /// For how long its state is looked at for a proof, 0 to 3600 s; 0 does not look. A frequency that falls is looked at
    /// for as long as it does, up to a minute, or where the drive tells its ramp half as long again as that takes.
    #[must_use]
    pub fn confirm(mut self, time: Duration) -> Self {
        self.order.confirm = time;
        self
    }

    /// Also by a command, and proved by words, that no document of the family prints.
    #[must_use]
    pub fn unverified(mut self) -> Self {
        self.is_unverified = true;
        self
    }

    /// The family is meant, whatever the unit says.
    #[must_use]
    pub fn trust_profile(mut self) -> Self {
        self.is_trusted = true;
        self
    }

    /// What halts it over `bus`.
    pub(crate) fn task(&self, bus: &Bus) -> Result<Task<Result<(), Error>, Error>, Error> {
        checks::time("within", self.order.within)?;
        checks::time("confirm", self.order.confirm)?;
        let profile = self.family.profile();
        let identity = self.record.identity(self.family.name(), bus.core.reconnects());
        let same = SameUnit::new(self.unit, &self.family, &identity, self.is_trusted);
        let looks = Arc::new(Looks::new(profile, self.is_unverified));
        let unit = Taken::as_named(same, &looks, &Arc::new(Speeds::new(profile, self.is_unverified)));
        let (record, order) = (self.record.clone(), self.order.clone());
        Ok(Task::new(async move |line| {
            let mut halt = Halt::new(unit, &record, order, Families::shipped(), line.now());
            Ok(halt.carry_out(&line, Families::shipped()).await?)
        }))
    }
}

impl From<NotHalted<Self>> for Error {
    fn from(error: NotHalted<Self>) -> Self {
        let kind = match &error.why {
            Why::MayNot(_) | Why::Undecided { .. } => ErrorKind::NotAllowed,
            Why::NotSent(line) | Why::Failed(line) => line.kind(),
            Why::Refused { .. } => ErrorKind::Refused,
            _ => ErrorKind::Unconfirmed,
        };
        let was_refused = matches!(kind, ErrorKind::Refused);
        Self::of(kind, &error).having_acted(error.was_sent && !was_refused)
    }
}
