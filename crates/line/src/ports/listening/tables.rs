//! The sockets that listen, as Linux lists them among all connections.
//!
//! `/proc/net/tcp` and `/proc/net/tcp6` have lines such as `0: 0100007F:0FA1 00000000:0000 0A … 0 0 4711 …`: the address as
//! words of the processor's own byte order and the port, the other end, the state (0AH listens), and as the tenth field the
//! number of the socket. Source: `proc(5)`.

use std::net::IpAddr;

use super::Listener;

/// All that listen; none where the system lists nothing.
#[cfg(target_os = "linux")]
pub(super) fn listeners() -> Vec<Listener> {
    let tables = ["/proc/net/tcp", "/proc/net/tcp6"].map(|path| std::fs::read_to_string(path).unwrap_or_default());
    tables.iter().flat_map(|table| of_table(table)).collect()
}

fn of_table(table: &str) -> impl Iterator<Item = Listener> {
    table.lines().filter_map(listener)
}

/// Who listens, if the socket on `line` does.
fn listener(line: &str) -> Option<Listener> {
    let fields: Vec<&str> = line.split_ascii_whitespace().collect();
    let (address, port) = fields.get(1)?.split_once(':')?;
    let listens = fields.get(3) == Some(&"0A");
    let port = u16::from_str_radix(port, 16).ok()?;
    listens.then(|| Some(Listener { ip: ip(address)?, port, socket: fields.get(9)?.parse().ok()? })).flatten()
}

/// The address of `text`, which has eight digits for each of its words.
fn ip(text: &str) -> Option<IpAddr> {
    let (digits, rest) = text.as_bytes().as_chunks::<8>();
    let word = |digits: &[u8; 8]| u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok().map(u32::to_ne_bytes);
    let words: Vec<[u8; 4]> = digits.iter().map(word).collect::<Option<_>>()?;
    match (words.as_slice(), rest) {
        (&[v4], []) => Some(v4.into()),
        (&[_, _, _, _], []) => <[u8; 16]>::try_from(words.concat()).ok().map(IpAddr::from),
        _ => None,
    }
}

#[cfg(all(test, target_endian = "little"))]
mod tests {
    use super::super::ends_at;
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
        let listeners: Vec<_> = [TCP, TCP6].into_iter().flat_map(of_table).collect();
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
            assert_eq!(ends_at(&listeners, ip.parse().unwrap(), port), socket, "{ip} {port:x}");
        }
    }
}
