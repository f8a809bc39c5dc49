//! What a program says of a halt: by which command, and for how long the unit is told and looked at.

use std::time::Duration;

use drivebus_drive::{Besides, Order};
use drivebus_drives::Command;

use crate::checks;
use crate::error::Error;

/// How a drive is halted: for [`Drive::halt`](crate::Drive::halt).
///
/// ```
/// use std::time::Duration;
///
/// use drivebus::{Bus, Halting, Profile};
///
/// # #[cfg(feature = "sim")] {
/// let bus = Bus::open("sim://gd350?clock=virtual")?;
/// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
/// drive.halt(&Halting::coast().within(Duration::from_secs(2)))?;
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Halting(Order);

impl Halting {
    /// How long a unit is looked at for a proof where nothing else is said.
    pub(crate) const CONFIRM: Duration = Duration::from_secs(1);

    /// Stops the motor as its drive is set to stop it, usually by its ramp.
    ///
    /// It is told for ten seconds until it takes that, and looked at for one second.
    pub fn stop() -> Self {
        Self::by(Command::Stop)
    }

    /// Switches the output off: the motor freewheels to a standstill. Else as [`stop`](Self::stop).
    pub fn coast() -> Self {
        Self::by(Command::Coast)
    }

    /// Ends a jog by its own ramp, in a family that has a command for that alone. Else as [`stop`](Self::stop).
    pub fn jog_stop() -> Self {
        Self::by(Command::JogStop)
    }

    fn by(command: Command) -> Self {
        Self(Order { command, besides: Besides::Nothing, within: Order::WITHIN, confirm: Self::CONFIRM })
    }

    /// For how long it is told until it takes that, 0 to 3600 s. A unit that answers, and has not said yet what it is, is
    /// asked for two seconds in any case.
    #[must_use]
    pub fn within(self, time: Duration) -> Self {
        Self(Order { within: time, ..self.0 })
    }

    /// For how long its state is looked at for a proof, 0 to 3600 s; 0 does not look. A frequency that falls is looked at
    /// for as long as it does, up to a minute, or where the drive tells its ramp half as long again as that takes.
    #[must_use]
    pub fn confirm(self, time: Duration) -> Self {
        Self(Order { confirm: time, ..self.0 })
    }

    /// Where it is not taken, it is told to coast each fourth time, if its family may be.
    #[must_use]
    pub fn or_coast(self) -> Self {
        Self(Order { besides: Besides::Coast, ..self.0 })
    }

    /// What it is to the core.
    pub(crate) fn order(&self) -> Result<Order, Error> {
        checks::time("within", self.0.within)?;
        checks::time("confirm", self.0.confirm)?;
        Ok(self.0.clone())
    }
}
