//! What is wrong with the text that names a port: the part, and what is allowed there.

use super::quoted::Quoted;

/// A port that nobody can open as it is written. Nothing was opened.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum UrlError {
    /// There is nothing to open.
    #[error("{} is not a port; give a path such as /dev/ttyUSB0 or COM3, or a URL", Quoted(port))]
    NoPort {
        /// The port as given.
        port: String,
    },
    /// Nobody opens URLs of this scheme.
    #[error("port {} has an unknown scheme; known are {}{hint}", Quoted(port), Schemes(known))]
    Scheme {
        /// The port as given.
        port: String,
        /// The schemes that there are.
        known: Vec<String>,
        /// `; did you mean "socket"?`, or nothing where none is near.
        hint: String,
    },
    /// A server needs a host and a port.
    #[error("port {port:?} is not scheme://host:port with a port from 0 to 65535")]
    Server {
        /// The port as given.
        port: String,
    },
    /// The unit is no number.
    #[error("unit {} in {} is not a whole number; allowed is 1 to 247, as in sim://1=gd350", Quoted(unit), Quoted(url))]
    UnitNumber {
        /// The URL as given.
        url: String,
        /// What stands in the place of the unit.
        unit: String,
    },
    /// No unit can have this number.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// Two drives have one address.
    #[error("unit {unit} stands twice in {}; give each unit once, as in sim://1=gd350,2=gd350", Quoted(url))]
    UnitTwice {
        /// The URL as given.
        url: String,
        /// The unit.
        unit: String,
    },
    /// A name is none of those that there are.
    #[error("{what} {} is unknown; allowed is {}{hint}", Quoted(given), known.join(", "))]
    Name {
        /// What it would name: `profile`, `simulator option`, `clock` …
        what: &'static str,
        /// The name as given.
        given: String,
        /// The names that there are.
        known: Vec<String>,
        /// `; did you mean "seed"?`, or nothing where none is near.
        hint: String,
    },
    /// One thing is said twice.
    #[error("simulator option {} stands twice in {}; give it once", Quoted(option), Quoted(url))]
    OptionTwice {
        /// The URL as given.
        url: String,
        /// The option.
        option: String,
    },
    /// The share of answers that a fault hits is no number.
    #[error("rate {} of {kind} in {} is not a number; allowed is 0 to 1", Quoted(rate), Quoted(url))]
    Rate {
        /// The URL as given.
        url: String,
        /// What was to happen.
        kind: String,
        /// What stands in the place of the share.
        rate: String,
    },
    /// The seed is no number.
    #[error("seed {} in {} is not a whole number; allowed is 0 or more", Quoted(seed), Quoted(url))]
    SeedNumber {
        /// The URL as given.
        url: String,
        /// What stands in the place of the seed.
        seed: String,
    },
    /// The seed has more than 64 bits.
    #[error("seed {seed} is out of range; allowed is 0 to {}", u64::MAX)]
    Seed {
        /// What was given.
        seed: String,
    },
    /// Direction control is asked for where nobody can switch a direction.
    #[error("rs485 is for a serial port given by its path: nobody would move an RTS here")]
    Rs485,
    /// An adapter that echoes is spoken of where there is none.
    #[error("echo \"yes\" is for an adapter that hands back what it sends, and tcp:// has none: Modbus TCP")]
    Echo,
}

/// A number that no unit can have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum UnitError {
    /// 0 is everybody.
    #[error("unit 0 is the broadcast address, which nobody answers; allowed is 1 to 247, or use broadcast()")]
    Broadcast,
    /// There are 247.
    #[error("unit {unit} is out of range; allowed is 1 to 247")]
    OutOfRange {
        /// What was given.
        unit: u64,
    },
}

impl UnitError {
    /// Checks a plain number.
    ///
    /// # Errors
    ///
    /// It is 0, or above 247.
    pub fn check(unit: u64) -> Result<drivebus_rtu::UnitAddress, Self> {
        let raw = u8::try_from(unit).ok();
        match raw.map(drivebus_rtu::UnitAddress::new) {
            Some(Ok(address)) => Ok(address),
            _ if unit == 0 => Err(Self::Broadcast),
            _ => Err(Self::OutOfRange { unit }),
        }
    }
}

/// `socket://, tcp://`.
struct Schemes<'a>(&'a [String]);

impl std::fmt::Display for Schemes<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (index, scheme) in self.0.iter().enumerate() {
            write!(f, "{}{scheme}://", if index == 0 { "" } else { ", " })?;
        }
        Ok(())
    }
}
