//! Ports as people write them: a path, `socket://host:port`, `tcp://host:502`, `sim://1=gd350?clock=virtual`.
//!
//! One grammar for every language. It knows no drive and no simulator: which families and kinds of faults there are, who
//! reads a text says in [`Known`]. Nothing here opens anything but [`PortUrl::opener`].

mod closest;
mod error;
mod opener;
mod quoted;
mod server;
mod simulator;

use crate::options::AdapterEcho;

pub use error::{UnitError, UrlError};
pub use opener::{CONNECT, PortOptions};
pub use server::{MODBUS_TCP_PORT, Server};
pub use simulator::SimulatorUrl;

use closest::hint;

/// The schemes that the core opens, and the simulator's.
const SCHEMES: [&str; 3] = ["socket", "tcp", "sim"];

/// The names that a URL may hold beside those of its grammar.
#[derive(Debug, Clone, Copy, Default)]
#[non_exhaustive]
pub struct Known<'a> {
    /// Schemes that the caller opens itself.
    pub schemes: &'a [&'a str],
    /// The families of drives that can stand on a simulated line.
    pub families: &'a [&'a str],
    /// The kinds of faults that a simulated line can have.
    pub faults: &'a [&'a str],
}

impl<'a> Known<'a> {
    /// Sets [`schemes`](Self#structfield.schemes).
    #[must_use]
    pub const fn schemes(self, schemes: &'a [&'a str]) -> Self {
        Self { schemes, ..self }
    }

    /// Sets [`families`](Self#structfield.families).
    #[must_use]
    pub const fn families(self, families: &'a [&'a str]) -> Self {
        Self { families, ..self }
    }

    /// Sets [`faults`](Self#structfield.faults).
    #[must_use]
    pub const fn faults(self, faults: &'a [&'a str]) -> Self {
        Self { faults, ..self }
    }
}

/// What somebody names as a port.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum PortUrl {
    /// A serial port of this machine: `/dev/ttyUSB0`, `COM3`.
    Path(String),
    /// A serial server that passes bytes through: `socket://host:port`.
    RtuOverTcp(Server),
    /// A gateway: `tcp://host`, `tcp://host:502`.
    ModbusTcp(Server),
    /// A simulated line in this process: `sim://1=gd350,2=vfd500?clock=virtual&seed=1`.
    Simulator(SimulatorUrl),
    /// A URL of one of [`Known::schemes`], which the caller opens itself.
    Foreign {
        /// Its scheme.
        scheme: String,
    },
}

impl PortUrl {
    /// Reads `text`.
    ///
    /// # Errors
    ///
    /// [`UrlError`]: it names the part that is wrong and says what is allowed there.
    pub fn parse(text: &str, known: &Known<'_>) -> Result<Self, UrlError> {
        if text.trim().is_empty() || text.contains('\0') {
            return Err(UrlError::NoPort { port: text.to_owned() });
        }
        let Some((scheme, rest)) = text.split_once("://") else {
            return Ok(Self::Path(text.to_owned()));
        };
        match scheme {
            "socket" => Ok(Self::RtuOverTcp(Server::parse(text, rest, None)?)),
            "tcp" => Ok(Self::ModbusTcp(Server::parse(text, rest, Some(MODBUS_TCP_PORT))?)),
            "sim" => Ok(Self::Simulator(SimulatorUrl::parse(text, rest, known)?)),
            _ if known.schemes.contains(&scheme) => Ok(Self::Foreign { scheme: scheme.to_owned() }),
            _ => {
                let schemes: Vec<&str> = SCHEMES.iter().chain(known.schemes).copied().collect();
                Err(UrlError::Scheme {
                    port: text.to_owned(),
                    known: schemes.iter().map(|&scheme| scheme.to_owned()).collect(),
                    hint: hint(scheme, &schemes),
                })
            }
        }
    }
}

/// Refuses what cannot be meant of `port`, before anything is opened: `None` is a port that has no name.
///
/// # Errors
///
/// [`UrlError::Rs485`]: only a serial port that is opened by its path has an RTS to move. [`UrlError::Echo`]: Modbus TCP
/// has no adapter that could hand back what it was sent.
pub fn check_together(port: Option<&str>, has_rs485: bool, echo: AdapterEcho) -> Result<(), UrlError> {
    let scheme = port.and_then(|port| port.split_once("://")).map(|(scheme, _)| scheme);
    if has_rs485 && (port.is_none() || scheme.is_some_and(|scheme| !scheme.is_empty())) {
        return Err(UrlError::Rs485);
    }
    if echo == AdapterEcho::Present && scheme == Some("tcp") {
        return Err(UrlError::Echo);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_url_is_a_path() {
        for path in ["/dev/ttyUSB0", "COM3", r"\\.\COM10", "socket:host"] {
            assert_eq!(PortUrl::parse(path, &Known::default()), Ok(PortUrl::Path(path.to_owned())));
        }
    }

    #[test]
    fn a_scheme_of_the_callers_is_the_callers() {
        let known = Known { schemes: &["spy"], ..Known::default() };
        let foreign = PortUrl::parse("spy:///dev/ttyUSB0", &known);
        assert_eq!(foreign, Ok(PortUrl::Foreign { scheme: "spy".to_owned() }));
        let unknown = PortUrl::parse("spy:///dev/ttyUSB0", &Known::default()).unwrap_err().to_string();
        assert_eq!(unknown, "port \"spy:///dev/ttyUSB0\" has an unknown scheme; known are socket://, tcp://, sim://");
    }

    #[test]
    fn what_cannot_be_meant_of_a_port_is_refused() {
        let (auto, echoes) = (AdapterEcho::Auto, AdapterEcho::Present);
        assert_eq!(check_together(Some("/dev/ttyUSB0"), true, echoes), Ok(()));
        for port in [None, Some("socket://h:1"), Some("sim://gd350")] {
            assert_eq!(check_together(port, true, auto), Err(UrlError::Rs485), "{port:?}");
        }
        assert_eq!(check_together(Some("tcp://h"), false, echoes), Err(UrlError::Echo));
        assert_eq!(check_together(Some("socket://h:1"), false, echoes), Ok(()));
    }
}
