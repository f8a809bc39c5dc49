//! Which port it is, whatever people call it.

use std::fmt;
use std::path::PathBuf;

use super::url::{PortUrl, Server};

/// What tells a port from every other of this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PortKey(Kind);

#[derive(Debug, Clone, PartialEq, Eq)]
enum Kind {
    /// A serial port: the name leads to it, today under this name and tomorrow under that.
    Path(PathBuf),
    /// A serial server.
    Server(Server),
}

impl PortUrl {
    /// What tells this port from others, if it is of a kind that programs can share: a serial port, or a serial server.
    ///
    /// A gateway of Modbus TCP serves several masters by itself, and a simulated line is one program's.
    pub fn key(&self) -> Option<PortKey> {
        match self {
            Self::Path(path) => Some(PortKey(Kind::Path(PathBuf::from(path)))),
            Self::RtuOverTcp(server) => Some(PortKey(Kind::Server(server.clone()))),
            Self::ModbusTcp(_) | Self::Simulator(_) | Self::Foreign { .. } => None,
        }
    }
}

impl fmt::Display for PortKey {
    /// As it was named.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Kind::Path(path) => write!(f, "{}", path.display()),
            Kind::Server(Server { host, port }) => write!(f, "socket://{host}:{port}"),
        }
    }
}

#[cfg(all(unix, feature = "share"))]
impl PortKey {
    /// The port as a file name, the same for every name of the port; `None` while there is no such port.
    pub(crate) fn name(&self) -> Option<String> {
        use std::os::unix::fs::{FileTypeExt, MetadataExt};

        match &self.0 {
            Kind::Path(path) => {
                let status = std::fs::metadata(path).ok().filter(|status| status.file_type().is_char_device())?;
                // Pseudo-terminals of containers have the same numbers, on a file system of their own.
                Some(format!("port-{:x}-{:x}", status.dev(), status.rdev()))
            }
            Kind::Server(Server { host, port }) => {
                let host = host.to_lowercase();
                let is_plain = |letter: char| letter.is_ascii_alphanumeric() || ".-".contains(letter);
                let host: String = host.chars().map(|letter| if is_plain(letter) { letter } else { '_' }).collect();
                Some(format!("server-{}-{port}", host.chars().take(64).collect::<String>()))
            }
        }
    }

    /// Whether opening it keeps other programs out, as the lock of a serial port does.
    pub(crate) fn locks(&self) -> bool {
        matches!(self.0, Kind::Path(_))
    }
}
