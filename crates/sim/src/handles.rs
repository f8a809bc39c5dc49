//! The handle to one simulated drive.

use std::sync::Arc;

use drivebus_rtu::{ExceptionCode, UnitAddress};

use crate::drive::{Drive, Refusals, WriteRecord};
use crate::error::SimError;
use crate::shared::Shared;

/// The heaviest load, as a share of rated torque.
const MAX_LOAD: f64 = 4.0;
/// The highest word of the digital inputs: S1 to S4, HDIA, HDIB.
const MAX_INPUTS: u16 = 0x3F;

/// One drive, seen from its shaft, its terminals and its keypad, not from the bus.
#[derive(Debug, Clone)]
pub struct SimulatedDrive {
    shared: Arc<Shared>,
    unit: UnitAddress,
}

impl SimulatedDrive {
    pub(crate) fn new(shared: Arc<Shared>, unit: UnitAddress) -> Self {
        Self { shared, unit }
    }

    /// Its address on the line.
    pub fn unit(&self) -> u8 {
        self.unit.get()
    }

    /// The name of its profile.
    pub fn profile(&self) -> String {
        self.with(|drive| drive.family().name.clone().into_owned()).unwrap_or_default()
    }

    /// What the motor does: `forward`, `reverse`, `stopped` or `fault`; of a rectifier `running` instead of the first two.
    pub fn state(&self) -> &'static str {
        self.with(|drive| drive.state()).unwrap_or("unknown")
    }

    /// Output frequency in Hz, negative in reverse; 0 while the output is off.
    pub fn frequency(&self) -> f64 {
        self.with(|drive| drive.frequency()).unwrap_or(0.0)
    }

    /// Shaft speed in rpm, negative in reverse.
    pub fn speed(&self) -> f64 {
        self.with(|drive| drive.speed()).unwrap_or(0.0)
    }

    /// Present fault number, 0 for none.
    pub fn fault(&self) -> u16 {
        self.with(|drive| drive.fault()).unwrap_or(0)
    }

    /// Load torque as a share of the motor's rated torque.
    pub fn load(&self) -> f64 {
        self.with(|drive| drive.load()).unwrap_or(0.0)
    }

    /// Sets the load torque: 0.0..=4.0 of the motor's rated torque.
    ///
    /// # Errors
    ///
    /// [`SimError::Load`]: out of range. [`SimError::NoMotor`]: it is a rectifier.
    pub fn set_load(&self, load: f64) -> Result<(), SimError> {
        if !(0.0..=MAX_LOAD).contains(&load) {
            return Err(SimError::Load { load });
        }
        if !self.with(|drive| drive.has_motor()).unwrap_or(true) {
            return Err(SimError::NoMotor { profile: self.profile() });
        }
        self.with(|drive| drive.set_load(load));
        Ok(())
    }

    /// Digital inputs, bit 0 = S1.
    pub fn inputs(&self) -> u16 {
        self.with(|drive| drive.inputs()).unwrap_or(0)
    }

    /// Sets the digital inputs: bits 0 to 5 are S1 to S4, HDIA, HDIB.
    ///
    /// # Errors
    ///
    /// [`SimError::Inputs`]: other bits are set.
    pub fn set_inputs(&self, inputs: u16) -> Result<(), SimError> {
        if inputs > MAX_INPUTS {
            return Err(SimError::Inputs { inputs });
        }
        self.with(|drive| drive.set_inputs(inputs));
        Ok(())
    }

    /// Sets the word that analog input `input` (1..=4) shows; hundredths of a volt, two's complement.
    ///
    /// # Errors
    ///
    /// [`SimError::Analog`]: there is no such input.
    pub fn set_analog(&self, input: u8, word: u16) -> Result<(), SimError> {
        match input {
            1..=4 => {
                self.with(|drive| drive.set_analog(usize::from(input) - 1, word));
                Ok(())
            }
            _ => Err(SimError::Analog { input }),
        }
    }

    /// Trips the drive with fault `code` (1..=65535), whose cause is gone at once.
    ///
    /// # Errors
    ///
    /// [`SimError::NoFault`]: `code` is 0.
    pub fn trip(&self, code: u16) -> Result<(), SimError> {
        if code == 0 {
            return Err(SimError::NoFault);
        }
        self.with(|drive| drive.trip(code));
        Ok(())
    }

    /// Trips the drive with fault `code` (1..=65535), which cannot be reset before
    /// [`release_fault`](Self::release_fault).
    ///
    /// # Errors
    ///
    /// [`SimError::NoFault`]: `code` is 0.
    pub fn hold_fault(&self, code: u16) -> Result<(), SimError> {
        if code == 0 {
            return Err(SimError::NoFault);
        }
        self.with(|drive| drive.hold_fault(code));
        Ok(())
    }

    /// Takes the cause of a held fault away. The fault stays until it is reset.
    pub fn release_fault(&self) {
        self.with(Drive::release_fault);
    }

    /// Lets the drive refuse requests as `refusals` say, from now on, instead of what it was told to refuse before.
    ///
    /// # Errors
    ///
    /// [`SimError::NoException`]: the code is 0. [`SimError::Share`]: the share is not in 0.0..=1.0.
    pub fn refuse(&self, refusals: Refusals) -> Result<(), SimError> {
        refusals.check()?;
        let mut world = self.shared.present();
        let (now, seed) = (world.now(), world.seed() ^ u64::from(self.unit.get()));
        if let Some(drive) = world.drive(self.unit) {
            drive.refuse(now, refusals, seed);
        }
        Ok(())
    }

    /// The drive refuses only what its family refuses.
    pub fn refuse_no_more(&self) {
        self.with(Drive::refuse_no_more);
    }

    /// Lets the drive take no more than `highest` where more is written to `address` by 06H: it takes that instead, and its answer
    /// says so.
    pub fn limit(&self, address: u16, highest: u16) {
        self.with(|drive| drive.limit(address, highest));
    }

    /// Switches the drive off and on: RAM is lost, EEPROM stays, the motor coasts to a stop.
    pub fn power_cycle(&self) {
        let mut world = self.shared.present();
        let now = world.now();
        if let Some(drive) = world.drive(self.unit) {
            drive.power_cycle(now);
        }
    }

    /// Gives every parameter its factory value, as the keypad does. The bus's own counters do not see it; the address
    /// on the line and the history of faults stay.
    ///
    /// # Errors
    ///
    /// [`SimError::Running`]: the motor is fed.
    pub fn factory_reset(&self) -> Result<(), SimError> {
        match self.with(Drive::factory_reset) {
            Some(false) => Err(SimError::Running { unit: self.unit() }),
            _ => Ok(()),
        }
    }

    /// The word at `address` as the drive would answer it now.
    ///
    /// # Errors
    ///
    /// The exception code with which it would refuse.
    pub fn register(&self, address: u16) -> Result<u16, ExceptionCode> {
        self.with(|drive| drive.read(address)).unwrap_or(Err(ExceptionCode::ILLEGAL_ADDRESS))
    }

    /// Sets the parameter at `address` at the keypad, for good. The bus's own counters do not see it.
    ///
    /// # Errors
    ///
    /// The exception code with which a write from the bus would be refused.
    pub fn set_parameter(&self, address: u16, word: u16) -> Result<(), ExceptionCode> {
        self.with(|drive| drive.set_parameter(address, word)).unwrap_or(Err(ExceptionCode::ILLEGAL_ADDRESS))
    }

    /// Words written to EEPROM from the bus.
    pub fn eeprom_writes(&self) -> u64 {
        self.with(|drive| drive.eeprom_writes()).unwrap_or(0)
    }

    /// Words written to the EEPROM of one parameter from the bus; its address with or without bit 15.
    pub fn eeprom_writes_of(&self, address: u16) -> u64 {
        self.with(|drive| drive.eeprom_writes_of(address)).unwrap_or(0)
    }

    /// The words that the drive took from the bus, oldest first; the last 100 000.
    pub fn writes(&self) -> Vec<WriteRecord> {
        self.with(|drive| drive.writes()).unwrap_or_default()
    }

    /// As [`writes`](Self::writes), and forgets them: who takes them often enough misses none.
    pub fn take_writes(&self) -> Vec<WriteRecord> {
        self.with(Drive::take_writes).unwrap_or_default()
    }

    /// How many words the drive has taken from the bus, ever.
    pub fn words_written(&self) -> u64 {
        self.with(|drive| drive.words_written()).unwrap_or(0)
    }

    /// A handle is given out only for a unit that exists, and units never go, so `None` does not happen.
    fn with<T>(&self, ask: impl FnOnce(&mut Drive) -> T) -> Option<T> {
        self.shared.present().drive(self.unit).map(ask)
    }
}
