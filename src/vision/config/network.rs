//! Blocks of addresses at which cameras may be reached.

use serde::{Deserialize, Deserializer, de};
use std::fmt;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};
use std::str::FromStr;

/// A block of addresses in CIDR notation, such as 192.168.0.0/16; a single address is a block of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Network {
    address: IpAddr,
    prefix: u8,
}

/// A text that is no block of addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected an address or a block of addresses, such as 192.168.1.20 or 192.168.0.0/16")]
pub struct NetworkError;

/// Where clouds tell a machine its own keys: reached only where it is named alone.
const METADATA: [IpAddr; 2] = [
    IpAddr::V4(Ipv4Addr::new(169, 254, 169, 254)),
    IpAddr::V6(Ipv6Addr::new(0xfd00, 0xec2, 0, 0, 0, 0, 0, 0x254)),
];

/// Where cameras usually are: private networks, this machine, and addresses that devices choose themselves.
const USUAL: [&str; 8] = [
    "10.0.0.0/8",
    "172.16.0.0/12",
    "192.168.0.0/16",
    "169.254.0.0/16",
    "127.0.0.0/8",
    "fc00::/7",
    "fe80::/10",
    "::1",
];

/// The networks where cameras usually are.
pub(super) fn usual() -> Vec<Network> {
    USUAL.iter().filter_map(|text| text.parse().ok()).collect()
}

impl Network {
    /// Whether the block holds `address`. An IPv4 address within IPv6 is the IPv4 address. The addresses at which clouds
    /// tell a machine its own keys are in no block but one that names them alone.
    #[must_use]
    pub fn contains(&self, address: IpAddr) -> bool {
        let address = address.to_canonical();
        let is_within = match (self.address, address) {
            (IpAddr::V4(own), IpAddr::V4(other)) => {
                let mask = u32::MAX.checked_shl(32 - u32::from(self.prefix)).unwrap_or(0);
                (own.to_bits() ^ other.to_bits()) & mask == 0
            }
            (IpAddr::V6(own), IpAddr::V6(other)) => {
                let mask = u128::MAX.checked_shl(128 - u32::from(self.prefix)).unwrap_or(0);
                (own.to_bits() ^ other.to_bits()) & mask == 0
            }
            _ => false,
        };
        is_within && (!METADATA.contains(&address) || self.is_single())
    }

    const fn is_single(&self) -> bool {
        self.prefix == if self.address.is_ipv4() { 32 } else { 128 }
    }
}

impl FromStr for Network {
    type Err = NetworkError;

    fn from_str(text: &str) -> Result<Self, NetworkError> {
        let (address, prefix) = match text.split_once('/') {
            Some((address, prefix)) => (address, Some(prefix)),
            None => (text, None),
        };
        let address: IpAddr =
            address.parse().map_err(|_unreadable: std::net::AddrParseError| NetworkError)?;
        let longest = if address.is_ipv4() { 32 } else { 128 };
        let prefix = match prefix {
            None => longest,
            Some(digits) if digits.bytes().all(|byte| byte.is_ascii_digit()) => {
                digits.parse().map_err(|_unreadable: std::num::ParseIntError| NetworkError)?
            }
            Some(_) => return Err(NetworkError),
        };
        // Mapped addresses are unwrapped before they are compared, so a block of them would hold nothing.
        let is_mapped = matches!(address, IpAddr::V6(v6) if v6.to_ipv4_mapped().is_some());
        if prefix > longest || is_mapped { Err(NetworkError) } else { Ok(Self { address, prefix }) }
    }
}

impl fmt::Display for Network {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}/{}", self.address, self.prefix)
    }
}

impl<'de> Deserialize<'de> for Network {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(|error: NetworkError| de::Error::custom(format!("{error}, not {text:?}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_hold_their_addresses_and_no_others() {
        let check = |network: &str, address: &str, expected: bool| {
            let (network, address): (Network, IpAddr) = (network.parse().unwrap(), address.parse().unwrap());
            assert_eq!(network.contains(address), expected, "{network} {address}");
        };
        check("10.0.0.0/8", "10.255.0.1", true);
        check("10.0.0.0/8", "11.0.0.1", false);
        check("10.1.2.3/8", "10.9.9.9", true);
        check("172.16.0.0/12", "172.31.255.255", true);
        check("172.16.0.0/12", "172.32.0.0", false);
        check("192.168.1.20", "192.168.1.20", true);
        check("192.168.1.20", "192.168.1.21", false);
        check("0.0.0.0/0", "8.8.8.8", true);
        check("0.0.0.0/0", "::1", false);
        check("::/0", "2001:db8::1", true);
        check("::/0", "::ffff:8.8.8.8", false);
        check("127.0.0.0/8", "::ffff:127.0.0.1", true);
        check("fe80::/10", "fe80::1", true);
        check("fe80::/10", "fec0::1", false);
        for everything in ["0.0.0.0/0", "169.254.0.0/16", "::ffff:a9fe:a9fe"] {
            if everything.parse::<Network>().is_ok() {
                check(everything, "169.254.169.254", false);
                check(everything, "::ffff:169.254.169.254", false);
            }
        }
        check("169.254.0.0/16", "169.254.169.253", true);
        check("169.254.169.254", "169.254.169.254", true);
        check("fc00::/7", "fd00:ec2::254", false);
    }

    #[test]
    fn by_default_only_what_is_near_is_reached() {
        let is_reached = |text: &str| usual().iter().any(|network| network.contains(text.parse().unwrap()));
        assert_eq!(usual().len(), USUAL.len());
        for near in
            ["10.1.1.1", "172.20.0.1", "192.168.3.4", "127.0.0.1", "::1", "fe80::1", "fd12::1", "169.254.3.4"]
        {
            assert!(is_reached(near), "{near}");
        }
        for far in
            ["8.8.8.8", "0.0.0.0", "::", "224.0.0.1", "255.255.255.255", "2001:db8::1", "169.254.169.254"]
        {
            assert!(!is_reached(far), "{far}");
        }
    }

    #[test]
    fn what_is_no_block_is_refused() {
        for text in [
            "",
            "10",
            "10.0.0.0/33",
            "::/129",
            "10.0.0.0/-1",
            "10.0.0.0/+8",
            "10.0.0.0/",
            "host",
            "::ffff:10.0.0.1",
        ] {
            assert_eq!(text.parse::<Network>(), Err(NetworkError), "{text}");
        }
    }
}
