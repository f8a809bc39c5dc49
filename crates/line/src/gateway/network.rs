//! Networks of clients: `192.168.7.0/24`, `10.0.0.5`, `fd00::/8`.

use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;

/// The addresses that begin with the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Network {
    address: IpAddr,
    bits: u8,
}

/// A text that is no network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a network is an address, or one with the number of bits that count, such as 192.168.7.0/24")]
#[non_exhaustive]
pub struct NoNetwork;

impl Network {
    /// Whether `host` is in it. An IPv4 address that came as an IPv6 one is what it is.
    pub fn has(&self, host: IpAddr) -> bool {
        match (self.address, host.to_canonical()) {
            (IpAddr::V4(own), IpAddr::V4(host)) => {
                same(u128::from(own.to_bits()), u128::from(host.to_bits()), 32, self.bits)
            }
            (IpAddr::V6(own), IpAddr::V6(host)) => same(own.to_bits(), host.to_bits(), 128, self.bits),
            _ => false,
        }
    }
}

/// Whether the first `bits` of two addresses of `width` bits are the same.
fn same(one: u128, other: u128, width: u8, bits: u8) -> bool {
    (one ^ other).checked_shr(u32::from(width - bits)).unwrap_or_default() == 0
}

impl FromStr for Network {
    type Err = NoNetwork;

    /// # Errors
    ///
    /// [`NoNetwork`]: it is none, or has bits behind those that count.
    fn from_str(text: &str) -> Result<Self, NoNetwork> {
        let (address, bits) = match text.split_once('/') {
            Some((address, bits)) if !bits.starts_with('+') => (address, Some(bits.parse().map_err(|_| NoNetwork)?)),
            Some(_) => return Err(NoNetwork),
            None => (text, None),
        };
        let address: IpAddr = address.parse().map_err(|_| NoNetwork)?;
        let (width, value): (u8, u128) = match address {
            IpAddr::V4(address) => (32, u128::from(address.to_bits())),
            IpAddr::V6(address) => (128, address.to_bits()),
        };
        let bits = bits.unwrap_or(width);
        let rest = width.checked_sub(bits).ok_or(NoNetwork)?;
        let is_whole = value == 0 || value.trailing_zeros() >= u32::from(rest);
        is_whole.then_some(Self { address, bits }).ok_or(NoNetwork)
    }
}

impl fmt::Display for Network {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.address, self.bits)
    }
}

#[cfg(test)]
mod tests {
    use std::net::{Ipv4Addr, Ipv6Addr};

    use proptest::prelude::*;

    use super::*;

    fn has(network: &str, host: &str) -> bool {
        network.parse::<Network>().unwrap().has(host.parse().unwrap())
    }

    #[test]
    fn hosts_inside_and_outside() {
        assert!(has("192.168.7.0/24", "192.168.7.255") && !has("192.168.7.0/24", "192.168.8.0"));
        assert!(has("10.0.0.5", "10.0.0.5") && !has("10.0.0.5", "10.0.0.4"));
        assert!(has("0.0.0.0/0", "203.0.113.9") && !has("0.0.0.0/0", "::1"));
        assert!(has("127.0.0.0/8", "::ffff:127.0.0.1"), "an IPv4 client at a socket of both kinds");
        assert!(has("fd00::/8", "fdff::1") && !has("fd00::/8", "fe80::1"));
        assert!(has("::/0", "fe80::1") && !has("::/0", "10.0.0.1"));
    }

    #[test]
    fn what_is_none() {
        for text in [
            "",
            "/",
            "10.0.0.0/",
            "10.0.0.0/33",
            "::/129",
            "10.0.0.1/24",
            "10.0.0/8",
            "host",
            "10.0.0.0/+8",
            "10.0.0.0/-1",
        ] {
            assert_eq!(text.parse::<Network>(), Err(NoNetwork), "{text}");
        }
    }

    proptest! {
        /// Against the addresses written as bits.
        #[test]
        fn the_first_bits_decide(own: u32, host: u32, bits in 0_u8..=32, shared in 0_u8..=32) {
            let keep = |bits: u8| u32::MAX.checked_shl(32 - u32::from(bits)).unwrap_or(0);
            let host = own & keep(shared) | host & !keep(shared);
            let network = format!("{}/{bits}", Ipv4Addr::from_bits(own & keep(bits))).parse::<Network>().unwrap();
            let [own, host_bits] = [own, host].map(|one| format!("{one:032b}"));
            let inside = own[..usize::from(bits)] == host_bits[..usize::from(bits)];
            prop_assert_eq!(network.has(Ipv4Addr::from_bits(host).into()), inside);
            prop_assert_eq!(network.has(Ipv4Addr::from_bits(host).to_ipv6_mapped().into()), inside);
            prop_assert!(!network.has(Ipv6Addr::LOCALHOST.into()));
        }
    }
}
