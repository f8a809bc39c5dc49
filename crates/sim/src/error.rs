//! Why a simulation cannot be as asked.

use drivebus_drives::ProfileError;
use drivebus_rtu::AddressError;

use crate::drive::Family;
use crate::faults::FaultKind;

/// Why a simulation cannot be as asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// No unit can have this address.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// There is no such profile, or it is broken.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// There is a profile, but no behaviour for it.
    #[error("no simulated drive behaves like \"{profile}\"; simulated are {}", Family::names().collect::<Vec<_>>().join(", "))]
    NotSimulated {
        /// The profile asked for.
        profile: String,
    },
    /// A profile of somebody's own does not say enough.
    #[error("profile \"{profile}\" cannot be simulated; it lacks\n  {}", missing.join("\n  "))]
    Lacking {
        /// The profile asked for.
        profile: String,
        /// What is missing, and in which file and table.
        missing: Vec<String>,
    },
    /// Two units were given one address.
    #[error("unit {unit} is there twice; give each unit an address of its own")]
    Twice {
        /// The address.
        unit: u8,
    },
    /// No unit has this address here.
    #[error("no unit {unit} is simulated; there are {}", listed(present))]
    NoUnit {
        /// The address asked for.
        unit: u8,
        /// The addresses there are.
        present: Vec<u8>,
    },
    /// Real time cannot be moved.
    #[error("this simulation runs in real time; only virtual time can be advanced")]
    RealTime,
    /// Other programs live in real time.
    #[error("this simulation runs in virtual time; a port that other programs open needs real time")]
    VirtualTime,
    /// The load is not a share of 0.0..=4.0.
    #[error("load {load} is not a number from 0.0 to 4.0 of the motor's rated torque")]
    Load {
        /// What was given.
        load: f64,
    },
    /// A rectifier has no shaft.
    #[error("{profile} drives no motor, so it has no load to set")]
    NoMotor {
        /// The family.
        profile: String,
    },
    /// Parameters get their factory values at standstill only.
    #[error("unit {unit} is running; stop it before its parameters get their factory values")]
    Running {
        /// Its address.
        unit: u8,
    },
    /// The digital inputs are six bits.
    #[error("inputs {inputs:#x} is not a number from 0x00 to 0x3f; bit 0 is S1, bit 5 HDIB")]
    Inputs {
        /// What was given.
        inputs: u16,
    },
    /// There are four analog inputs.
    #[error("analog input {input} is not a number from 1 to 4")]
    Analog {
        /// What was given.
        input: u8,
    },
    /// 0 is no fault.
    #[error("0 is not a fault; fault numbers are 1 to 65535")]
    NoFault,
    /// There is no such kind of fault.
    #[error("fault {name:?} is unknown; there are {}", FaultKind::ALL.map(FaultKind::name).join(", "))]
    Fault {
        /// The name asked for.
        name: String,
    },
    /// The rate is not a share of 0.0..=1.0.
    #[error("rate {share} of {kind} is not a number from 0.0 to 1.0")]
    Rate {
        /// What was to happen.
        kind: FaultKind,
        /// What was given.
        share: f64,
    },
    /// No answer has this code.
    #[error("0 is not an exception; exception codes are 1 to 255")]
    NoException,
    /// The share of requests to refuse is not one of 0.0..=1.0.
    #[error("share {share} is not a number from 0.0 to 1.0 of the requests")]
    Share {
        /// What was given.
        share: f64,
    },
    /// The system has no port to give.
    #[error("cannot serve the simulated line: {0}")]
    Io(std::io::Error),
}

impl From<std::io::Error> for SimError {
    /// The text says it all: it is no [`source`](std::error::Error::source), or a chain would say it twice.
    fn from(error: std::io::Error) -> Self {
        Self::Io(error)
    }
}

/// Numbers in words.
fn listed(numbers: &[u8]) -> String {
    numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}
