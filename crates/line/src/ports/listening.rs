//! Which socket of this machine a connection to one of its addresses ends at.
//!
//! Linux tells it when it is asked, and lists it. The list is of all connections, whose looking up takes milliseconds: it
//! is read only where the system does not let one ask.

use std::net::IpAddr;
#[cfg(any(target_os = "linux", test))]
use std::net::{Ipv4Addr, Ipv6Addr};

#[cfg(target_os = "linux")]
mod asked;
#[cfg(any(target_os = "linux", test))]
mod tables;

/// A socket that listens.
#[cfg(any(target_os = "linux", test))]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Listener {
    /// Of the family of the socket, as it was bound.
    ip: IpAddr,
    port: u16,
    /// The number of the socket.
    socket: u64,
}

/// The number of the socket that a connection to `port` of `ip` ends at; `None` where `ip` is another machine's, or the system
/// does not tell.
#[cfg(target_os = "linux")]
pub(crate) fn listening(ip: IpAddr, port: u16) -> Option<u64> {
    // The system binds a socket to an address of this machine only.
    std::net::UdpSocket::bind((ip, 0)).ok()?;
    ends_at(&asked::listeners(port).unwrap_or_else(|_| tables::listeners()), ip, port)
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn listening(_ip: IpAddr, _port: u16) -> Option<u64> {
    None
}

/// Who listens at the address itself goes before who listens at all of them. Several may share a port: the first stands for
/// them.
#[cfg(any(target_os = "linux", test))]
fn ends_at(listeners: &[Listener], ip: IpAddr, port: u16) -> Option<u64> {
    let at = |ip: IpAddr| {
        let there = listeners.iter().filter(|listener| listener.ip == ip && listener.port == port);
        there.map(|listener| listener.socket).min()
    };
    let any: [IpAddr; 2] = [Ipv4Addr::UNSPECIFIED.into(), Ipv6Addr::UNSPECIFIED.into()];
    match ip {
        IpAddr::V4(v4) => at(ip).or_else(|| at(v4.to_ipv6_mapped().into())).or_else(|| any.into_iter().find_map(at)),
        IpAddr::V6(_) => at(ip).or_else(|| at(any[1])),
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::net::TcpListener;

    use super::*;

    #[test]
    fn who_is_asked_tells_what_the_tables_list() {
        for address in ["127.0.0.1", "0.0.0.0", "::1", "::", "::ffff:127.0.0.1"] {
            let Ok(listener) = TcpListener::bind((address, 0)) else { continue }; // a machine without IPv6
            let port = listener.local_addr().unwrap().port();
            let of_port = |from: Vec<Listener>| -> Vec<_> {
                from.into_iter()
                    .filter(|each| each.port == port && each.ip == address.parse::<IpAddr>().unwrap())
                    .collect()
            };
            let listed = of_port(tables::listeners());
            assert_eq!(listed.len(), 1, "{address}");
            match asked::listeners(port) {
                Ok(told) => assert_eq!(of_port(told), listed, "{address}"),
                // An emulated system has nobody who could be asked.
                Err(error) => assert_ne!(error.kind(), std::io::ErrorKind::InvalidData, "{error}"),
            }
        }
    }
}
