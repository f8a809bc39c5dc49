//! Which socket of this machine a connection to one of its addresses ends at.
//!
//! Linux lists them: `/proc/net/tcp` and `/proc/net/tcp6`, whose lines are
//! `0: 0100007F:0FA1 00000000:0000 0A … 0 0 4711 …`: the address as words of the processor's own byte order and the port, the
//! other end, the state (0AH listens), and as the tenth field the number of the socket. Source: `proc(5)`.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

/// The number of the socket that a connection to `port` of `ip` ends at; `None` where `ip` is another machine's, or the system
/// does not tell.
#[cfg(target_os = "linux")]
pub(crate) fn listening(ip: IpAddr, port: u16) -> Option<u64> {
    // The system binds a socket to an address of this machine only.
    std::net::UdpSocket::bind((ip, 0)).ok()?;
    let table = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    of_tables(&table("/proc/net/tcp"), &table("/proc/net/tcp6"), ip, port)
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn listening(_ip: IpAddr, _port: u16) -> Option<u64> {
    None
}

/// Who listens at the address itself goes before who listens at all of them. Several may share a port: the first stands for
/// them.
#[cfg_attr(not(any(target_os = "linux", test)), expect(dead_code, reason = "only Linux has such tables"))]
fn of_tables(tcp: &str, tcp6: &str, ip: IpAddr, port: u16) -> Option<u64> {
    let at = |table: &str, wanted: &str| table.lines().filter_map(|line| listener(line, wanted, port)).min();
    match ip {
        IpAddr::V4(ip) => at(tcp, &v4(ip))
            .or_else(|| at(tcp6, &v6(ip.to_ipv6_mapped())))
            .or_else(|| at(tcp, &v4(Ipv4Addr::UNSPECIFIED)))
            .or_else(|| at(tcp6, &v6(Ipv6Addr::UNSPECIFIED))),
        IpAddr::V6(ip) => at(tcp6, &v6(ip)).or_else(|| at(tcp6, &v6(Ipv6Addr::UNSPECIFIED))),
    }
}

/// The number of the socket on `line`, if it listens at `wanted` and `port`.
fn listener(line: &str, wanted: &str, port: u16) -> Option<u64> {
    let fields: Vec<&str> = line.split_ascii_whitespace().collect();
    let (address, listens_at) = fields.get(1)?.split_once(':')?;
    let listens = fields.get(3) == Some(&"0A");
    let is_it = listens && address == wanted && u16::from_str_radix(listens_at, 16) == Ok(port);
    is_it.then(|| fields.get(9)?.parse().ok()).flatten()
}

fn v4(ip: Ipv4Addr) -> String {
    format!("{:08X}", u32::from_ne_bytes(ip.octets()))
}

fn v6(ip: Ipv6Addr) -> String {
    let octets = ip.octets();
    let (words, _) = octets.as_chunks::<4>();
    let words: Vec<String> = words.iter().map(|word| format!("{:08X}", u32::from_ne_bytes(*word))).collect();
    words.concat()
}

#[cfg(all(test, target_endian = "little"))]
mod tests {
    use super::*;

    /// As a machine printed them.
    const TCP: &str = "
  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
   0: 0100007F:0FA1 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 11 1 0000000000000000 100 0 0 10 0
   1: 00000000:0FA1 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 12 1 0000000000000000 100 0 0 10 0
   2: 0100007F:0FA2 0100007F:C000 01 00000000:00000000 00:00000000 00000000     0        0 13 1 0000000000000000 100 0 0 10 0
";
    const TCP6: &str = "
   0: 00000000000000000000000000000000:0FA3 00000000000000000000000000000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 21 1 0000000000000000 100 0 0 10 0
   1: 00000000000000000000000001000000:0FA1 00000000000000000000000000000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 22 1 0000000000000000 100 0 0 10 0
   2: 0000000000000000FFFF00000100007F:0FA4 00000000000000000000000000000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 23 1 0000000000000000 100 0 0 10 0
";

    #[test]
    fn who_listens_at_the_address_goes_before_who_listens_at_all() {
        for (ip, port, socket) in [
            ("127.0.0.1", 0x0FA1, Some(11)),
            ("127.0.0.2", 0x0FA1, Some(12)),
            ("::1", 0x0FA1, Some(22)),
            ("127.0.0.1", 0x0FA2, None), // a connection, and nobody who listens
            ("127.0.0.1", 0x0FA3, Some(21)),
            ("::1", 0x0FA3, Some(21)),
            ("127.0.0.1", 0x0FA4, Some(23)),
            ("::1", 0x0FA4, None),
        ] {
            assert_eq!(of_tables(TCP, TCP6, ip.parse().unwrap(), port), socket, "{ip} {port:x}");
        }
    }
}
