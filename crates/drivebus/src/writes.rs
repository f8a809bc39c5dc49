//! What a program writes to a drive besides commands: its settings, values by name, setpoints, and bits.

use drivebus_drive::{FieldInput, Setting};
use drivebus_drives::{Input, Setpoint, Store};

use crate::driving::Drive;
use crate::error::Error;

impl Drive {
    /// Sets the drive to obey the bus, and to take its frequency from there, until it is switched off. All settings as they are
    /// then.
    ///
    /// Only what is set otherwise is written. A family of which no way to write to RAM alone is known is
    /// prepared by [`prepare_for`](Self::prepare_for), in EEPROM.
    ///
    /// ```
    /// use drivebus::{Bus, Profile};
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = Bus::open("sim://gd350?clock=virtual")?;
    /// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
    /// for setting in drive.prepare()? {
    ///     assert!(setting.is_right(), "{setting}");
    /// }
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Where [`may_have_acted`](Error::may_have_acted) says so, some of the settings were written.
    ///
    /// | kind | |
    /// | --- | --- |
    /// | [`NotAllowed`](crate::ErrorKind::NotAllowed) | nothing was written: no document prints what has to be set, or where RAM alone is; or it is to be set by hand |
    /// | [`Refused`](crate::ErrorKind::Refused) | the drive did not take one of them |
    /// | [`Port`](crate::ErrorKind::Port), [`NoAnswer`](crate::ErrorKind::NoAnswer), [`BadAnswer`](crate::ErrorKind::BadAnswer) | the line failed |
    /// | [`Unconfirmed`](crate::ErrorKind::Unconfirmed) | they were written, and are not shown |
    pub fn prepare(&self) -> Result<Vec<Setting>, Error> {
        self.prepare_for(Setpoint::Frequency, Store::Ram)
    }

    /// As [`prepare`](Self::prepare), to take `setpoint` from the bus, and kept where `store` says: in EEPROM also what was set
    /// in RAM before. An EEPROM wears out: what it has is not written again.
    ///
    /// # Errors
    ///
    /// Those of [`prepare`](Self::prepare).
    pub fn prepare_for(&self, setpoint: Setpoint, store: Store) -> Result<Vec<Setting>, Error> {
        self.bus().carry_out(self.named().prepare(setpoint, store))
    }

    /// Writes a value by name: to a register, or to a parameter in RAM, where it is lost when the drive is switched off.
    ///
    /// The name is one that [`read`](Self::read) takes, the value a number in the unit of the register or the label of a choice.
    /// All checks come before: the range, also as other parameters of the drive narrow it, and whether the motor must
    /// stand. A confirmation that was lost is cleared up by reading. What can move the motor is no value, and is not written.
    ///
    /// ```
    /// use drivebus::{Bus, Profile};
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = Bus::open("sim://gd350?clock=virtual")?;
    /// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
    /// drive.write("P00.11", 5.0)?; // seconds
    /// drive.write("P00.06", "Modbus")?;
    /// assert_eq!(drive.read("P00.11")?.to_f64(), 5.0);
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Unless [`may_have_acted`](Error::may_have_acted) says so, the drive has what it had.
    ///
    /// | kind | |
    /// | --- | --- |
    /// | [`NotAllowed`](crate::ErrorKind::NotAllowed) | nothing was written: a check failed, or no way to write to RAM alone is known of the family |
    /// | [`Refused`](crate::ErrorKind::Refused) | the drive did not take it |
    /// | any other | the line failed: it may have been taken, if it was sent |
    pub fn write<'a>(&self, name: &'a str, value: impl Into<Input<'a>>) -> Result<(), Error> {
        self.write_values([(name, value)], Store::Ram)
    }

    /// Several values in their order, and parameters where `store` says: as [`write`](Self::write).
    ///
    /// If one is not allowed, none is written. Each goes out by a request of its own; parameters with successive codes share one
    /// where documents of the family print that they may. What EEPROM has already is not written again.
    ///
    /// ```
    /// use drivebus::{Bus, Input, Profile, Store};
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = Bus::open("sim://gd350?clock=virtual")?;
    /// let drive = bus.drive(1, &Profile::builtin("gd350")?)?;
    /// drive.write_values([("P00.11", 5.0), ("P00.12", 8.0)], Store::Eeprom)?;
    /// drive.write_values([("P00.11", Input::from(6.0)), ("P00.06", "Modbus".into())], Store::Ram)?;
    /// # }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`write`](Self::write). The first that fails is the last that was sent: the message names those that were
    /// written before it, and [`may_have_acted`](Error::may_have_acted) is true of these as well, whatever the kind.
    pub fn write_values<'a, V: Into<Input<'a>>>(
        &self,
        values: impl IntoIterator<Item = (&'a str, V)>,
        store: Store,
    ) -> Result<(), Error> {
        self.bus().carry_out(self.named().write(values, store))
    }

    /// Gives another setpoint than the frequency: torque, PID, limits, analog outputs. A motor that runs follows it at once.
    ///
    /// The drive must take it from the bus, so far as is known what that needs: [`prepare_for`](Self::prepare_for) sets that.
    ///
    /// # Errors
    ///
    /// Those of [`write`](Self::write); [`NotAllowed`](crate::ErrorKind::NotAllowed) also where the drive would ignore it.
    pub fn give<'a>(&self, setpoint: Setpoint, value: impl Into<Input<'a>>) -> Result<(), Error> {
        self.bus().carry_out(self.named().give(setpoint, value.into()))
    }

    /// Sets bits of the word that takes `setpoint`: [`VirtualInputs`](Setpoint::VirtualInputs),
    /// [`VirtualOutputs`](Setpoint::VirtualOutputs), or [`SpecialControl`](Setpoint::SpecialControl).
    ///
    /// Each by the name that its [field](drivebus_drives::Entry::bits) has, on or off, a number, or a label. What is not named
    /// keeps what the drive says it has; where the word can only be written, it is off. **It may start the motor**: what an
    /// input does is set in the drive. So it is sent once, after the checks of [`run`](Self::run), but that the drive need not
    /// obey the bus.
    ///
    /// # Errors
    ///
    /// Those of [`run`](Self::run).
    pub fn set_bits<'a, V: Into<FieldInput<'a>>>(
        &self,
        setpoint: Setpoint,
        bits: impl IntoIterator<Item = (&'a str, V)>,
    ) -> Result<(), Error> {
        self.bus().carry_out(self.named().set_bits(setpoint, bits)?)
    }
}
