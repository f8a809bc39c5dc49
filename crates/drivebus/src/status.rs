//! What a drive does at one moment.

use std::fmt;

use drivebus_drive::{Frequencies, Look};
use drivebus_drives::{Fault, Profile, State};

/// What a drive does at one moment. It prints as a line: `forward, 10.00 of 10.00 Hz`.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Status {
    /// What the motor does; unknown where no word tells, or that word is none of the documented ones.
    pub state: State,
    /// Whether the drive is in fault: a number alone may be a warning, under which it runs.
    pub is_in_fault: bool,
    /// The present fault; `None` where it shows none, or does not tell.
    pub fault: Option<Fault>,
    /// The output frequency in Hz, whichever way the motor turns; `None` where the drive does not tell it.
    pub hz: Option<f64>,
    /// The setpoint in force in Hz; `None` where the drive does not tell it, or in another unit.
    pub setpoint: Option<f64>,
}

impl Status {
    pub(crate) fn new(profile: &Profile, look: &Look, frequencies: Option<Frequencies>) -> Self {
        Self {
            state: look.state,
            is_in_fault: look.is_tripped(),
            fault: look.fault_of(profile).map(std::borrow::Cow::into_owned),
            hz: frequencies.map(|both| both.output),
            setpoint: frequencies.and_then(|both| both.setpoint),
        }
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.state.name().replace('_', " "))?;
        match (self.hz, self.setpoint) {
            (Some(hz), Some(setpoint)) => write!(f, ", {hz:.2} of {setpoint:.2} Hz")?,
            (Some(hz), None) => write!(f, ", {hz:.2} Hz")?,
            (None, _) => {}
        }
        let Some(Fault { code, mnemonic, label, .. }) = &self.fault else { return Ok(()) };
        write!(f, ", fault {code}")?;
        if mnemonic.is_empty() { write!(f, " ({label})") } else { write!(f, " ({mnemonic}: {label})") }
    }
}
