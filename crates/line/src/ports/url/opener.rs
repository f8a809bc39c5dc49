//! From what was named to what opens it.

use std::time::Duration;

use drivebus_rtu::SerialFormat;

use super::{PortUrl, Server};
use crate::line::Opener;
#[cfg(any(not(feature = "serial"), not(feature = "tcp")))]
use crate::line::{PortError, PortErrorKind};
#[cfg(feature = "tcp")]
use crate::ports::closing::Closing;
#[cfg(feature = "tcp")]
use crate::ports::mbap::ModbusTcp;
#[cfg(feature = "tcp")]
use crate::ports::tcp::RtuOverTcp;
#[cfg(feature = "serial")]
use crate::ports::tty::{Adapter, TtyOptions};

/// How long a server may take to accept a connection.
pub const CONNECT: Duration = Duration::from_secs(3);

/// How a port is opened.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct PortOptions {
    /// Characters and silence.
    pub format: SerialFormat,
    /// What is asked of a serial port beside that.
    #[cfg(feature = "serial")]
    pub tty: TtyOptions,
}

impl PortOptions {
    /// As it is usual, with these characters.
    pub fn new(format: SerialFormat) -> Self {
        Self { format, ..Self::default() }
    }

    /// What is asked of a serial port.
    #[cfg(feature = "serial")]
    #[must_use]
    pub fn tty(self, tty: TtyOptions) -> Self {
        Self { tty, ..self }
    }
}

impl PortUrl {
    /// What opens this port, now and after it was lost; `None` for a simulator and for what the caller opens itself.
    ///
    /// Where the crate was built without such ports the opener says so.
    pub fn opener(self, options: &PortOptions) -> Option<Opener> {
        match self {
            Self::Path(path) => Some(serial(path, options)),
            Self::RtuOverTcp(server) => Some(rtu_over_tcp(server, options)),
            Self::ModbusTcp(server) => Some(modbus_tcp(server)),
            Self::Simulator(_) | Self::Foreign { .. } => None,
        }
    }
}

#[cfg(feature = "serial")]
fn serial(path: String, options: &PortOptions) -> Opener {
    let mut adapter = Adapter::new(path, options.format, options.tty.clone());
    Box::new(move || Ok(Box::new(adapter.open()?)))
}

#[cfg(not(feature = "serial"))]
fn serial(path: String, _: &PortOptions) -> Opener {
    without(path, "serial")
}

#[cfg(feature = "tcp")]
fn rtu_over_tcp(server: Server, options: &PortOptions) -> Opener {
    let (format, closing) = (options.format, Closing::default());
    Box::new(move || Ok(Box::new(RtuOverTcp::connect_to(&server.host, server.port, &format, CONNECT, &closing)?)))
}

#[cfg(not(feature = "tcp"))]
fn rtu_over_tcp(server: Server, _: &PortOptions) -> Opener {
    let Server { host, port } = server;
    without(format!("socket://{host}:{port}"), "tcp")
}

#[cfg(feature = "tcp")]
fn modbus_tcp(server: Server) -> Opener {
    let closing = Closing::default();
    Box::new(move || Ok(Box::new(ModbusTcp::connect_to(&server.host, server.port, CONNECT, &closing)?)))
}

#[cfg(not(feature = "tcp"))]
fn modbus_tcp(server: Server) -> Opener {
    let Server { host, port } = server;
    without(format!("tcp://{host}:{port}"), "tcp")
}

/// The opener of a port that this build knows nothing of.
#[cfg(any(not(feature = "serial"), not(feature = "tcp")))]
fn without(port: String, feature: &str) -> Opener {
    let message = format!("this program was built without the feature {feature:?}");
    let error = PortError::new(PortErrorKind::Unsupported, port, message);
    Box::new(move || Err(error.clone()))
}
