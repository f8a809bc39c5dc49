//! Which port it is, whatever people call it.
//!
//! A serial port is told by the number of its device. A serial server is told by where a connection to it ends: a name, its
//! address and another name of the same machine lead there. On this machine that is the socket which listens, since
//! `127.0.0.1`, `::1` and the address of a network card may lead to one and the same.

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

#[cfg(all(any(unix, windows), feature = "share"))]
mod names {
    use std::net::{IpAddr, SocketAddr, ToSocketAddrs};

    use super::{Kind, PortKey, Server, device};
    use crate::ports::listening::listening;

    impl PortKey {
        /// The ports that may be meant, as file names, the same for every name of a port: one, or of a serial server one for
        /// each address that its name has. None while there is no such port.
        pub(crate) fn names(&self) -> Vec<String> {
            match &self.0 {
                Kind::Path(path) => device::name(path).into_iter().collect(),
                Kind::Server(Server { host, port }) => match (host.as_str(), *port).to_socket_addrs() {
                    Ok(addresses) => addresses.map(server).collect(),
                    // Whoever opens it says what is wrong with the name; who meets others over it needs no address.
                    Err(_) => vec![unknown(host, *port)],
                },
            }
        }

        /// The name of the one that was opened, whose connection ends at `peer` if it has such an end.
        pub(crate) fn name_of(&self, peer: Option<SocketAddr>) -> Option<String> {
            peer.map(server).or_else(|| self.names().into_iter().next())
        }

        /// Whether opening it keeps other programs out, as the lock of a serial port does.
        pub(crate) fn locks(&self) -> bool {
            matches!(self.0, Kind::Path(_))
        }
    }

    /// The server at the other end of a connection to `address`.
    pub(super) fn server(address: SocketAddr) -> String {
        let (ip, port) = (address.ip().to_canonical(), address.port());
        match listening(ip, port) {
            Some(socket) => format!("server-here-{port}-{socket}"),
            None => match ip {
                IpAddr::V4(ip) => format!("server-{ip}-{port}"),
                IpAddr::V6(ip) => format!("server-{}-{port}", ip.to_string().replace(':', "_")),
            },
        }
    }

    fn unknown(host: &str, port: u16) -> String {
        let is_plain = |letter: char| letter.is_ascii_alphanumeric() || ".-".contains(letter);
        let host = host.to_lowercase();
        let host: String = host.chars().map(|letter| if is_plain(letter) { letter } else { '_' }).take(64).collect();
        format!("server-{host}-{port}")
    }
}

/// Serial ports of this machine, by the number of their device.
#[cfg(all(unix, feature = "share"))]
mod device {
    use std::fs::Metadata;
    use std::os::unix::fs::{FileTypeExt, MetadataExt};
    use std::path::Path;
    use std::time::UNIX_EPOCH;

    use super::{Kind, PortKey};

    /// What the port that `path` leads to is called; `None` where it leads to none.
    pub(super) fn name(path: &Path) -> Option<String> {
        let status = std::fs::metadata(path).ok().filter(|status: &Metadata| status.file_type().is_char_device())?;
        Some(numbered(status.dev(), status.rdev()))
    }

    impl PortKey {
        /// When it was made, where another one may have its name next: a pseudo-terminal, an adapter that is plugged in
        /// again. 0 where that is not known.
        pub(crate) fn made(&self) -> u64 {
            let Kind::Path(path) = &self.0 else { return 0 };
            let Ok(status) = std::fs::metadata(path) else { return 0 };
            let made = status.created().ok().and_then(|made| made.duration_since(UNIX_EPOCH).ok());
            match made {
                Some(made) => u64::try_from(made.as_nanos()).unwrap_or(u64::MAX),
                // Their file system does not say; what changes a node there, `chmod`, is not done while it is in use.
                None if is_pseudo_terminal(status.rdev()) => status
                    .ctime()
                    .cast_unsigned()
                    .wrapping_mul(1_000_000_000)
                    .wrapping_add(status.ctime_nsec().cast_unsigned()),
                None => 0,
            }
        }
    }

    /// The device that a node stands for, wherever the node is: containers have nodes of their own. But a pseudo-terminal of a
    /// container may have the number of another one's, on a file system of its own. Source: `devices.txt` of Linux.
    fn numbered(file_system: u64, number: u64) -> String {
        if is_pseudo_terminal(number) { format!("port-{file_system:x}-{number:x}") } else { format!("port-{number:x}") }
    }

    #[cfg(target_os = "linux")]
    fn is_pseudo_terminal(number: u64) -> bool {
        (136..=143).contains(&rustix::fs::major(number))
    }

    /// Elsewhere the numbers do not tell.
    #[cfg(not(target_os = "linux"))]
    fn is_pseudo_terminal(_number: u64) -> bool {
        true
    }
}

/// Serial ports of this machine, by their names: `COM3`, and `\\.\COM3`, as who opens it says.
#[cfg(all(windows, feature = "share"))]
mod device {
    use std::path::Path;

    /// What the port is called that `path` names, whether there is one or not: who opens it says.
    pub(super) fn name(path: &Path) -> Option<String> {
        let name = path.to_str()?.to_uppercase();
        let name = name.strip_prefix(r"\\.\").unwrap_or(&name);
        let is_plain = |letter: char| letter.is_ascii_alphanumeric();
        Some(format!("port-{}", name.replace(|letter| !is_plain(letter), "_")))
    }
}

#[cfg(all(test, any(unix, windows), feature = "share"))]
mod tests {
    #![expect(clippy::unwrap_used, reason = "a test may panic")]

    #[cfg(target_os = "linux")]
    use std::net::TcpListener;

    use super::*;
    use crate::ports::url::Known;

    fn names(url: &str) -> Vec<String> {
        PortUrl::parse(url, &Known::default()).unwrap().key().unwrap().names()
    }

    #[test]
    fn an_address_is_the_same_however_it_is_written() {
        assert_eq!(names("socket://192.0.2.7:4001"), ["server-192.0.2.7-4001"]);
        assert_eq!(names("socket://[::ffff:192.0.2.7]:4001"), names("socket://192.0.2.7:4001"));
        assert_eq!(names("socket://[2001:DB8:0::7]:4001"), names("socket://[2001:db8::7]:4001"));
        assert_ne!(names("socket://192.0.2.7:4001"), names("socket://192.0.2.7:4002"));
    }

    #[test]
    fn a_name_that_leads_nowhere_is_still_one_place() {
        assert_eq!(names("socket://No_Such.Host.invalid:1"), ["server-no_such.host.invalid-1"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_server_of_this_machine_is_the_socket_that_listens() {
        let server = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = server.local_addr().unwrap().port();
        let of_it = names(&format!("socket://127.0.0.1:{port}"));
        assert!(of_it[0].starts_with("server-here-"), "{of_it:?}");
        // The name may have other addresses too, where nobody listens.
        assert!(names(&format!("socket://localhost:{port}")).contains(&of_it[0]));
        assert_eq!(names(&format!("socket://[::ffff:127.0.0.1]:{port}")), of_it);
        // One that listens at all addresses is reached under each of them.
        let everywhere = TcpListener::bind("0.0.0.0:0").unwrap();
        let port = everywhere.local_addr().unwrap().port();
        let first = names(&format!("socket://127.0.0.1:{port}"));
        assert_eq!(first, names(&format!("socket://127.1.2.3:{port}")));
        assert_ne!(first, of_it);
    }
}
