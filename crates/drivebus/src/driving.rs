//! One drive as a program uses it: checked before it moves, proved afterwards.

use std::sync::Arc;

use drivebus_drive::{Contradiction, Frequencies, Identification, Look, Setting, Start};
use drivebus_drives::{Fault, Profile, Value};

use crate::bus::Bus;
use crate::checks;
use crate::error::Error;
use crate::halting::Halting;
use crate::named::Named;
use crate::reading::Values;
use crate::status::Status;

/// One drive on a line: started after checks, halted until it takes that, and proved to do it by what it shows itself.
///
/// Get one of [`Bus::drive`]. It may be cloned, and used from any thread. What starts a motor is sent once and never
/// repeated; a halt goes before all who wait for the line, and takes back what was to start there.
///
/// ```
/// use drivebus::{Bus, Profile};
///
/// # #[cfg(feature = "sim")] {
/// let bus = Bus::open("sim://gd350?clock=virtual")?;
/// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
/// drive.prepare()?; // it obeys the bus until it is switched off
/// drive.run(10.0)?; // it turns
/// drive.stop()?; // it slows down along its ramp
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// A motor goes on turning when the handle is gone, and when the program is. [`running`](Self::running) gives a guard that
/// stops it.
#[derive(Debug, Clone)]
pub struct Drive {
    bus: Bus,
    named: Named,
}

impl Bus {
    /// The drive at `unit` (1..=247), which is one of the family of `profile`. Nothing is sent.
    ///
    /// All handles of a unit on one line, clones of the bus included, share what was sent to it and what it said of itself.
    ///
    /// ```
    /// use drivebus::{Bus, Profile};
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = Bus::open("sim://gd350?clock=virtual")?;
    /// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
    /// assert_eq!(drive.status()?.to_string(), "stopped, 0.00 of 50.00 Hz");
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`NotAllowed`](crate::ErrorKind::NotAllowed): no such unit.
    pub fn drive(&self, unit: u8, profile: &Arc<Profile>) -> Result<Drive, Error> {
        let unit = checks::unit(unit)?;
        self.core.set_meanings(unit, drivebus_drive::meanings(profile));
        self.core.set_protocol(unit, drivebus_drive::protocol(profile));
        Ok(Drive { bus: self.clone(), named: Named::new(unit, profile, self.record(unit)) })
    }
}

impl Drive {
    /// The same drive, also by what no document of its family proves: commands, states, registers.
    #[must_use]
    pub fn unverified(self) -> Self {
        Self { named: self.named.unverified(), ..self }
    }

    /// The same drive; its family is meant, whatever the unit says.
    #[must_use]
    pub fn trust_profile(self) -> Self {
        Self { named: self.named.trust_profile(), ..self }
    }

    /// The line that it is on.
    pub fn bus(&self) -> &Bus {
        &self.bus
    }

    /// Its address, 1..=247.
    pub fn unit(&self) -> u8 {
        self.named.address().get()
    }

    /// What its family means by its registers.
    pub fn profile(&self) -> &Arc<Profile> {
        self.named.profile()
    }

    pub(crate) fn named(&self) -> &Named {
        &self.named
    }

    /// Starts the motor forward at `hz`, 0 to the drive's own maximum; `None` is what the drive has. One that runs gets another
    /// speed.
    ///
    /// Returns when the state shows it running, not when it has reached its speed. Nothing is sent to a drive that is in
    /// fault, is not set to obey the bus, shows that it is of another family, or is reached so badly that its stop might be
    /// lost. A [halt](Self::halt) wins over it: once anybody on this line told the unit to halt, it is not sent any more.
    ///
    /// ```
    /// use drivebus::{Bus, ErrorKind, Profile};
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = Bus::open("sim://gd350?clock=virtual")?;
    /// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
    /// let error = drive.run(10.0).unwrap_err(); // as it comes, it obeys its keypad
    /// assert_eq!(error.kind(), ErrorKind::NotAllowed);
    /// assert!(!error.may_have_acted(), "nothing was sent that moves it");
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Where [`may_have_acted`](Error::may_have_acted) says so, the motor may turn: [halt](Self::halt) it.
    ///
    /// | kind | |
    /// | --- | --- |
    /// | [`NotAllowed`](crate::ErrorKind::NotAllowed) | a check failed, or the unit was told to halt meanwhile: the start was not sent |
    /// | [`Refused`](crate::ErrorKind::Refused) | the drive did not take it, or one of the words before it |
    /// | [`Port`](crate::ErrorKind::Port), [`NoAnswer`](crate::ErrorKind::NoAnswer), [`BadAnswer`](crate::ErrorKind::BadAnswer) | the line failed before the start was sent |
    /// | [`Unconfirmed`](crate::ErrorKind::Unconfirmed) | it was sent once, and is not shown; or the drive does not show a word that it wants before, and the start was not sent |
    pub fn run(&self, hz: impl Into<Option<f64>>) -> Result<(), Error> {
        self.run_with(&Start::run(false, hz.into()))
    }

    /// As [`run`](Self::run), the other way round. A motor that runs forward slows down first.
    ///
    /// # Errors
    ///
    /// Those of [`run`](Self::run).
    pub fn run_reverse(&self, hz: impl Into<Option<f64>>) -> Result<(), Error> {
        self.run_with(&Start::run(true, hz.into()))
    }

    /// Jogs the motor forward at the drive's own jog frequency until it is halted. One that turns already is not jogged.
    ///
    /// # Errors
    ///
    /// Those of [`run`](Self::run).
    pub fn jog(&self) -> Result<(), Error> {
        self.run_with(&Start::jog(false))
    }

    /// As [`run`](Self::run), in whatever way `start` says.
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use drivebus::{Bus, Profile, Start};
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = Bus::open("sim://gd350?clock=virtual")?;
    /// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
    /// drive.prepare()?;
    /// let mut start = Start::run(true, Some(5.0));
    /// start.confirm = Duration::from_secs(3); // it is looked at for so long until it turns
    /// drive.run_with(&start)?;
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`run`](Self::run); [`NotAllowed`](crate::ErrorKind::NotAllowed) also where a time is longer than an hour.
    pub fn run_with(&self, start: &Start) -> Result<(), Error> {
        self.bus.carry_out(self.named.start(start)?)
    }

    /// Stops the motor as its drive is set to stop it, usually by its ramp, and proves it.
    ///
    /// # Errors
    ///
    /// Those of [`halt`](Self::halt).
    pub fn stop(&self) -> Result<(), Error> {
        self.halt(&Halting::stop())
    }

    /// Switches the output off, so that the motor freewheels to a standstill, and proves it.
    ///
    /// # Errors
    ///
    /// Those of [`halt`](Self::halt).
    pub fn coast(&self) -> Result<(), Error> {
        self.halt(&Halting::coast())
    }

    /// Halts the unit, and proves it: it is told until it takes that, and then looked at until its own state shows it.
    ///
    /// A halt goes before all who wait for the line, as do the looks that prove it. It returns when the unit stands; or, of a
    /// stop, after half a second and a hertz along the ramp that is set in the drive, where only the bus commands it. Where
    /// the family has no state that may be used, the unit's confirmation is all there is. Each halt is an absolute word, so
    /// one that is lost, or refused, is sent again.
    ///
    /// A unit that has not said yet what it is is asked before, where the word may start a drive of another family: one that
    /// shows another shipped family is halted as that. What was started as [`unverified`](Self::unverified) is halted so,
    /// too.
    ///
    /// # Errors
    ///
    /// The motor may still turn. Whether the drive may have taken a halt, [`may_have_acted`](Error::may_have_acted) says.
    ///
    /// | kind | |
    /// | --- | --- |
    /// | [`NotAllowed`](crate::ErrorKind::NotAllowed) | nothing was sent: a time is out of range, the command is not printed for the family, or the unit may be one of several families that want other words |
    /// | [`Refused`](crate::ErrorKind::Refused) | the drive did not take it, in all that time: what it was doing before, it still does |
    /// | [`Port`](crate::ErrorKind::Port), [`NoAnswer`](crate::ErrorKind::NoAnswer), [`BadAnswer`](crate::ErrorKind::BadAnswer) | it could not be sent |
    /// | [`Unconfirmed`](crate::ErrorKind::Unconfirmed) | it went out, and is not proved; or the unit never said what it is, and nothing was sent |
    pub fn halt(&self, halting: &Halting) -> Result<(), Error> {
        self.bus.carry_out(self.named.halt(halting)?)
    }

    /// Resets a fault after its cause is gone: sent once, and looked at for one second. Sends nothing if there is no fault.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run) has them. [`Unconfirmed`](crate::ErrorKind::Unconfirmed): it was sent, and the fault is still there.
    pub fn reset_fault(&self) -> Result<(), Error> {
        self.bus.carry_out(self.named.reset_fault())
    }

    /// Gives the frequency `hz`, 0 to the drive's own maximum. A motor that runs follows it at once.
    ///
    /// Whether the drive takes its frequency from the bus is not looked at: [`control`](Self::control) tells.
    ///
    /// # Errors
    ///
    /// [`Error`]: unless [`may_have_acted`](Error::may_have_acted) says so, the drive has what it had.
    pub fn set_frequency(&self, hz: f64) -> Result<(), Error> {
        self.bus.carry_out(self.named.set_frequency(hz))
    }

    /// The frequencies of this moment, at the output and the setpoint in force; `None` where the family does not tell.
    ///
    /// # Errors
    ///
    /// [`Error`]: a read changes nothing in a drive, whatever became of it.
    pub fn frequencies(&self) -> Result<Option<Frequencies>, Error> {
        self.bus.carry_out(self.named.frequencies())
    }

    /// What the status words say, in the fewest reads.
    ///
    /// # Errors
    ///
    /// Those of [`frequencies`](Self::frequencies).
    pub fn look(&self) -> Result<Look, Error> {
        self.bus.carry_out(self.named.look())
    }

    /// What the drive does: its state, a fault, how fast the motor turns and shall turn.
    ///
    /// # Errors
    ///
    /// Those of [`frequencies`](Self::frequencies).
    pub fn status(&self) -> Result<Status, Error> {
        self.bus.carry_out(self.named.status())
    }

    /// The present fault, with its name, its cause and what to do; `None` where there is none.
    ///
    /// # Errors
    ///
    /// Those of [`frequencies`](Self::frequencies); [`NotAllowed`](crate::ErrorKind::NotAllowed) where the family does not tell.
    pub fn fault(&self) -> Result<Option<Fault>, Error> {
        self.bus.carry_out(self.named.fault()?)
    }

    /// Whether the drive is set to obey the bus, and to take its frequency from there: each setting, with what it is.
    /// [`prepare`](Self::prepare) sets them.
    ///
    /// # Errors
    ///
    /// Those of [`frequencies`](Self::frequencies).
    pub fn control(&self) -> Result<Vec<Setting>, Error> {
        self.bus.carry_out(self.named.control())
    }

    /// Finds out what the unit is, whatever it was named as: as [`Bus::identify`].
    ///
    /// # Errors
    ///
    /// Those of [`Bus::identify`].
    pub fn identify(&self) -> Result<Identification, Error> {
        self.bus.carry_out(self.named.identify())
    }

    /// What the unit says against the family that it was named as; `None` if nothing.
    ///
    /// ```
    /// use drivebus::{Bus, Profile};
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = Bus::open("sim://vfd500?clock=virtual")?;
    /// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
    /// let against = drive.contradiction()?.expect("it is no GD350");
    /// println!("{against}");
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`frequencies`](Self::frequencies).
    pub fn contradiction(&self) -> Result<Option<Contradiction>, Error> {
        self.bus.carry_out(self.named.contradiction())
    }

    /// The value of that name: of a register, the code of a parameter (`P00.03`), or an address (`0x3004`).
    ///
    /// ```
    /// use drivebus::{Bus, Profile};
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = Bus::open("sim://gd350?clock=virtual")?;
    /// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
    /// assert_eq!(drive.read("P00.03")?.to_f64(), 50.0);
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`frequencies`](Self::frequencies); [`NotAllowed`](crate::ErrorKind::NotAllowed) where the name is unknown, cannot be
    /// read, or is not proved by a document of the family.
    pub fn read(&self, name: &str) -> Result<Value, Error> {
        self.values([name])?.only()
    }

    /// Several values at once, in the fewest reads: as [`read`](Self::read).
    ///
    /// # Errors
    ///
    /// Those of [`read`](Self::read).
    pub fn values<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> Result<Values, Error> {
        self.bus.carry_out(self.named.values(names)?)
    }

    /// The same drive, with futures for calls.
    pub fn aio(&self) -> crate::aio::Drive {
        crate::aio::Drive::from(self.clone())
    }
}
