//! The drive whose calls are futures.

use std::sync::Arc;

use drivebus_drive::{Contradiction, FieldInput, Frequencies, Identification, Look, Setting, Start};
use drivebus_drives::{Fault, Input, Profile, Setpoint, Store, Value};

use super::bus::Bus;
use crate::error::Error;
use crate::halting::Halting;
use crate::named::Work;
use crate::reading::Values;
use crate::status::Status;

/// One drive on a line, whose calls are futures. The calls are those of [`drivebus::Drive`](crate::Drive), and so is what
/// they say of errors.
///
/// Who drops a future of a start before it was sent has taken it back; what was sent goes on, and nobody looks at it any
/// more. [`running`](Self::running) stops what it started also then.
#[derive(Debug, Clone)]
pub struct Drive {
    bus: Bus,
    drive: crate::Drive,
}

impl From<crate::Drive> for Drive {
    fn from(drive: crate::Drive) -> Self {
        Self { bus: drive.bus().aio(), drive }
    }
}

impl Bus {
    /// The drive at `unit`: as [`Bus::drive`](crate::Bus::drive).
    ///
    /// # Errors
    ///
    /// Those of [`Bus::drive`](crate::Bus::drive).
    pub fn drive(&self, unit: u8, profile: &Arc<Profile>) -> Result<Drive, Error> {
        self.blocking().drive(unit, profile).map(Drive::from)
    }
}

impl Drive {
    /// As [`Drive::unverified`](crate::Drive::unverified).
    #[must_use]
    pub fn unverified(self) -> Self {
        Self { drive: self.drive.unverified(), ..self }
    }

    /// As [`Drive::trust_profile`](crate::Drive::trust_profile).
    #[must_use]
    pub fn trust_profile(self) -> Self {
        Self { drive: self.drive.trust_profile(), ..self }
    }

    /// The same drive for who waits in a thread.
    pub fn blocking(&self) -> &crate::Drive {
        &self.drive
    }

    /// The line that it is on.
    pub fn bus(&self) -> &Bus {
        &self.bus
    }

    /// Its address, 1..=247.
    pub fn unit(&self) -> u8 {
        self.drive.unit()
    }

    /// What its family means by its registers.
    pub fn profile(&self) -> &Arc<Profile> {
        self.drive.profile()
    }

    /// As [`Drive::run`](crate::Drive::run).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::run`](crate::Drive::run).
    pub async fn run(&self, hz: impl Into<Option<f64>>) -> Result<(), Error> {
        self.run_with(&Start::run(false, hz.into())).await
    }

    /// As [`Drive::run_reverse`](crate::Drive::run_reverse).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::run`](crate::Drive::run).
    pub async fn run_reverse(&self, hz: impl Into<Option<f64>>) -> Result<(), Error> {
        self.run_with(&Start::run(true, hz.into())).await
    }

    /// As [`Drive::jog`](crate::Drive::jog).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::run`](crate::Drive::run).
    pub async fn jog(&self) -> Result<(), Error> {
        self.run_with(&Start::jog(false)).await
    }

    /// As [`Drive::run_with`](crate::Drive::run_with).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::run_with`](crate::Drive::run_with).
    pub async fn run_with(&self, start: &Start) -> Result<(), Error> {
        self.bus.carry_out(self.drive.named().start(start)?).await
    }

    /// As [`Drive::stop`](crate::Drive::stop).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::halt`](crate::Drive::halt).
    pub async fn stop(&self) -> Result<(), Error> {
        self.halt(&Halting::stop()).await
    }

    /// As [`Drive::coast`](crate::Drive::coast).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::halt`](crate::Drive::halt).
    pub async fn coast(&self) -> Result<(), Error> {
        self.halt(&Halting::coast()).await
    }

    /// As [`Drive::halt`](crate::Drive::halt). Where this future is dropped, a halt that was not sent yet is not sent, and one
    /// that was is not proved.
    ///
    /// # Errors
    ///
    /// Those of [`Drive::halt`](crate::Drive::halt).
    pub async fn halt(&self, halting: &Halting) -> Result<(), Error> {
        self.bus.carry_out(self.drive.named().halt(halting)?).await
    }

    /// As [`Drive::reset_fault`](crate::Drive::reset_fault).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::reset_fault`](crate::Drive::reset_fault).
    pub async fn reset_fault(&self) -> Result<(), Error> {
        self.bus.carry_out(self.drive.named().reset_fault()).await
    }

    /// As [`Drive::set_frequency`](crate::Drive::set_frequency).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::set_frequency`](crate::Drive::set_frequency).
    pub async fn set_frequency(&self, hz: f64) -> Result<(), Error> {
        self.bus.carry_out(self.drive.named().set_frequency(hz)).await
    }

    /// As [`Drive::prepare`](crate::Drive::prepare).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::prepare`](crate::Drive::prepare).
    pub async fn prepare(&self) -> Result<Vec<Setting>, Error> {
        self.prepare_for(Setpoint::Frequency, Store::Ram).await
    }

    /// As [`Drive::prepare_for`](crate::Drive::prepare_for).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::prepare`](crate::Drive::prepare).
    pub async fn prepare_for(&self, setpoint: Setpoint, store: Store) -> Result<Vec<Setting>, Error> {
        self.bus.carry_out(self.drive.named().prepare(setpoint, store)).await
    }

    /// As [`Drive::write`](crate::Drive::write). Where this future is dropped, what was not sent yet is not written.
    ///
    /// # Errors
    ///
    /// Those of [`Drive::write`](crate::Drive::write).
    pub async fn write<'a>(&self, name: &'a str, value: impl Into<Input<'a>>) -> Result<(), Error> {
        self.write_values([(name, value)], Store::Ram).await
    }

    /// As [`Drive::write_values`](crate::Drive::write_values).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::write_values`](crate::Drive::write_values).
    pub async fn write_values<'a, V: Into<Input<'a>>>(
        &self,
        values: impl IntoIterator<Item = (&'a str, V)>,
        store: Store,
    ) -> Result<(), Error> {
        let work = self.drive.named().write(values, store);
        self.bus.carry_out(work).await
    }

    /// As [`Drive::give`](crate::Drive::give).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::give`](crate::Drive::give).
    pub async fn give<'a>(&self, setpoint: Setpoint, value: impl Into<Input<'a>>) -> Result<(), Error> {
        let work = self.drive.named().give(setpoint, value.into());
        self.bus.carry_out(work).await
    }

    /// As [`Drive::set_bits`](crate::Drive::set_bits).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::set_bits`](crate::Drive::set_bits).
    pub async fn set_bits<'a, V: Into<FieldInput<'a>>>(
        &self,
        setpoint: Setpoint,
        bits: impl IntoIterator<Item = (&'a str, V)>,
    ) -> Result<(), Error> {
        let work = self.drive.named().set_bits(setpoint, bits);
        self.carry_out_planned(work).await
    }

    /// As [`Drive::frequencies`](crate::Drive::frequencies).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::frequencies`](crate::Drive::frequencies).
    pub async fn frequencies(&self) -> Result<Option<Frequencies>, Error> {
        self.bus.carry_out(self.drive.named().frequencies()).await
    }

    /// As [`Drive::look`](crate::Drive::look).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::frequencies`](crate::Drive::frequencies).
    pub async fn look(&self) -> Result<Look, Error> {
        self.bus.carry_out(self.drive.named().look()).await
    }

    /// As [`Drive::status`](crate::Drive::status).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::frequencies`](crate::Drive::frequencies).
    pub async fn status(&self) -> Result<Status, Error> {
        self.bus.carry_out(self.drive.named().status()).await
    }

    /// As [`Drive::fault`](crate::Drive::fault).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::fault`](crate::Drive::fault).
    pub async fn fault(&self) -> Result<Option<Fault>, Error> {
        self.bus.carry_out(self.drive.named().fault()?).await
    }

    /// As [`Drive::control`](crate::Drive::control).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::frequencies`](crate::Drive::frequencies).
    pub async fn control(&self) -> Result<Vec<Setting>, Error> {
        self.bus.carry_out(self.drive.named().control()).await
    }

    /// As [`Drive::identify`](crate::Drive::identify).
    ///
    /// # Errors
    ///
    /// Those of [`Bus::identify`](crate::Bus::identify).
    pub async fn identify(&self) -> Result<Identification, Error> {
        self.bus.carry_out(self.drive.named().identify()).await
    }

    /// As [`Drive::contradiction`](crate::Drive::contradiction).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::frequencies`](crate::Drive::frequencies).
    pub async fn contradiction(&self) -> Result<Option<Contradiction>, Error> {
        self.bus.carry_out(self.drive.named().contradiction()).await
    }

    /// As [`Drive::read`](crate::Drive::read).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::read`](crate::Drive::read).
    pub async fn read(&self, name: &str) -> Result<Value, Error> {
        self.carry_out_planned(self.drive.named().values([name])).await?.only()
    }

    /// As [`Drive::values`](crate::Drive::values).
    ///
    /// # Errors
    ///
    /// Those of [`Drive::read`](crate::Drive::read).
    pub async fn values<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> Result<Values, Error> {
        self.carry_out_planned(self.drive.named().values(names)).await
    }

    async fn carry_out_planned<T>(&self, work: Result<Work<T>, Error>) -> Result<T, Error> {
        self.bus.carry_out(work?).await
    }
}
