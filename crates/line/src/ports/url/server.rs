//! The host and the port behind `socket://` and `tcp://`.

use super::error::UrlError;

/// The port of Modbus TCP where none is given. Source: *Modbus Messaging on TCP/IP* V1.0b, §4.2.1.
pub const MODBUS_TCP_PORT: u16 = 502;

/// Where a server listens.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Server {
    /// A name or an address; of IPv6 without brackets.
    pub host: String,
    /// Its TCP port.
    pub port: u16,
}

impl Server {
    /// Reads `host:port` or `[ipv6]:port` behind the scheme of `url`; only the host where the scheme has a `usual` port.
    pub(super) fn parse(url: &str, rest: &str, usual: Option<u16>) -> Result<Self, UrlError> {
        let rest = rest.trim_end_matches('/');
        let (host, port) = match rest.rsplit_once(':') {
            Some((host, port)) if !port.contains(']') => (host, port.parse().ok()),
            _ => (rest, usual),
        };
        let host = host.trim_start_matches('[').trim_end_matches(']');
        match port {
            Some(port) if !host.is_empty() => Ok(Self { host: host.to_owned(), port }),
            _ => Err(UrlError::Server { port: url.to_owned() }),
        }
    }
}
