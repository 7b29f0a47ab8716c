//! The address from which a request comes, also through proxies.

use axum::http::{HeaderMap, HeaderValue};
use std::net::{IpAddr, Ipv6Addr};
use videofields_vision::config::Network;

/// Bits of an IPv6 address that tell customers apart: providers give each a block of 56 bits or a larger one.
const V6_NETWORK_BITS: u32 = 56;

/// Most proxies that a request is followed through.
const MAX_HOPS: usize = 16;

/// Returns the address from which a request comes: that of its connection, or, where that is a proxy of `trusted`, the last in
/// `X-Forwarded-For` (or `Forwarded`) that is none of them. What others say in these fields counts for nothing. None where nothing
/// tells: without a connection, and behind a proxy on this machine that the configuration does not know.
pub(super) fn of(peer: Option<IpAddr>, headers: &HeaderMap, trusted: &[Network]) -> Option<IpAddr> {
    let peer = peer?.to_canonical();
    let is_trusted = |address: &IpAddr| trusted.iter().any(|network| network.contains(*address));
    if !is_trusted(&peer) {
        let is_of_proxy = headers.contains_key("x-forwarded-for") || headers.contains_key("forwarded");
        return (!(peer.is_loopback() && is_of_proxy)).then_some(peer);
    }
    let mut last = peer;
    for hop in hops(headers).into_iter().rev().take(MAX_HOPS) {
        // Behind what cannot be read nothing is known.
        let Some(address) = hop else { break };
        last = address;
        if !is_trusted(&address) {
            break;
        }
    }
    Some(last)
}

/// Returns the addresses through which a request went as proxies noted them in `X-Forwarded-For` or `Forwarded` (RFC 7239), the farthest
/// first; none for each that cannot be read, and no hops where both fields are there and disagree.
fn hops(headers: &HeaderMap) -> Vec<Option<IpAddr>> {
    let read = |name: &str, read: &dyn Fn(&str) -> Option<IpAddr>| -> Vec<Option<IpAddr>> {
        // Proxies append to what a client wrote, whatever that is: a part that is no text is a hop that cannot be read.
        let lines = headers.get_all(name).iter().map(HeaderValue::as_bytes);
        let parts = lines.flat_map(|line| line.split(|byte| *byte == b','));
        parts.map(|part| read(std::str::from_utf8(part).ok()?.trim())).collect()
    };
    let usual = read("x-forwarded-for", &address);
    let noted = read("forwarded", &|element| {
        let pairs = element.split(';').filter_map(|pair| pair.trim().split_once('='));
        let mut of = pairs.filter(|(name, _)| name.eq_ignore_ascii_case("for"));
        of.next().and_then(|(_, value)| address(value.trim_matches('"')))
    });
    match (usual.is_empty(), noted.is_empty()) {
        (false, true) => usual,
        (true, _) => noted,
        // A proxy writes one of them, and a client may have written the other.
        (false, false) => {
            if usual.last() == noted.last() {
                usual
            } else {
                Vec::new()
            }
        }
    }
}

/// Reads an address with or without a port, IPv6 in brackets or not.
fn address(text: &str) -> Option<IpAddr> {
    let bare = text.strip_prefix('[').and_then(|rest| Some(rest.split_once(']')?.0));
    let without_port = || text.rsplit_once(':').filter(|(host, _)| !host.contains(':')).map(|(host, _)| host);
    let text = bare.or_else(without_port).unwrap_or(text);
    text.parse().ok().map(|address: IpAddr| address.to_canonical())
}

/// Returns the address by which somebody's log-ins are counted: as [`of`], but none where proxies that are not trusted may stand before
/// many people.
pub(super) fn of_log_in(peer: Option<IpAddr>, headers: &HeaderMap, trusted: &[Network]) -> Option<IpAddr> {
    let is_trusted = |address: IpAddr| trusted.iter().any(|network| network.contains(address));
    let is_of_proxy = headers.contains_key("x-forwarded-for") || headers.contains_key("forwarded");
    if is_of_proxy && !peer.is_some_and(is_trusted) {
        return None;
    }
    of(peer, headers, trusted).map(network_of)
}

/// Tells that a proxy of `trusted` says that it was asked over HTTPS, in `Forwarded` or `X-Forwarded-Proto`; the last word is the nearest
/// proxy's own.
pub(super) fn is_encrypted(peer: Option<IpAddr>, headers: &HeaderMap, trusted: &[Network]) -> bool {
    let is_trusted = |address: IpAddr| trusted.iter().any(|network| network.contains(address.to_canonical()));
    let last = |name: &str| {
        let line = headers.get_all(name).iter().next_back()?.to_str().ok()?;
        line.rsplit(',').next().map(|part| part.trim().to_owned())
    };
    let noted = last("forwarded").and_then(|element| {
        let pairs = element.split(';').filter_map(|pair| pair.trim().split_once('='));
        let mut of = pairs.filter(|(name, _)| name.eq_ignore_ascii_case("proto"));
        of.next().map(|(_, scheme)| scheme.trim_matches('"').to_owned())
    });
    let scheme = noted.or_else(|| last("x-forwarded-proto"));
    peer.is_some_and(is_trusted) && scheme.is_some_and(|scheme| scheme.eq_ignore_ascii_case("https"))
}

/// Returns what stands for all addresses that one caller has.
pub(super) fn network_of(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(v6) => {
            let mask = u128::MAX << (u128::BITS - V6_NETWORK_BITS);
            Ipv6Addr::from_bits(v6.to_bits() & mask).into()
        }
        v4 => v4,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(peer: &str, fields: &[(&'static str, &str)], trusted: &[&str]) -> Option<String> {
        let mut headers = HeaderMap::new();
        for (name, value) in fields {
            headers.append(*name, value.parse().unwrap());
        }
        let trusted: Vec<Network> = trusted.iter().map(|text| text.parse().unwrap()).collect();
        of(Some(peer.parse().unwrap()), &headers, &trusted).map(|address| address.to_string())
    }

    #[test]
    fn proxies_are_believed_where_they_are_trusted_alone() {
        let forwarded = [("x-forwarded-for", "1.2.3.4, 5.6.7.8"), ("x-forwarded-for", "10.0.0.9")];
        assert_eq!(found("9.9.9.9", &forwarded, &[]).unwrap(), "9.9.9.9");
        assert_eq!(
            found("10.0.0.1", &forwarded, &["10.0.0.0/8"]).unwrap(),
            "5.6.7.8",
            "the last of no proxy"
        );
        assert_eq!(
            found("10.0.0.1", &forwarded, &["0.0.0.0/0"]).unwrap(),
            "1.2.3.4",
            "all of them are proxies"
        );
        assert_eq!(found("10.0.0.1", &[], &["10.0.0.0/8"]).unwrap(), "10.0.0.1");
        // A client wrote the other field.
        let both = [("x-forwarded-for", "9.9.9.9"), ("forwarded", "for=1.1.1.1")];
        assert_eq!(found("10.0.0.1", &both, &["10.0.0.0/8"]).unwrap(), "10.0.0.1", "they disagree");
        let mut odd = HeaderMap::new();
        odd.append("x-forwarded-for", HeaderValue::from_bytes(b"\xff, 6.6.6.6").unwrap());
        odd.append("forwarded", HeaderValue::from_static("for=1.1.1.1"));
        let trusted = ["10.0.0.1".parse().unwrap()];
        assert_eq!(of(Some([10, 0, 0, 1].into()), &odd, &trusted), Some([10, 0, 0, 1].into()));
        odd.remove("forwarded");
        assert_eq!(of(Some([10, 0, 0, 1].into()), &odd, &trusted), Some([6, 6, 6, 6].into()));
        let forged = [("x-forwarded-for", "1.2.3.4, what, 10.0.0.9")];
        assert_eq!(found("10.0.0.1", &forged, &["10.0.0.0/8"]).unwrap(), "10.0.0.9");
    }

    #[test]
    fn a_proxy_on_this_machine_that_is_not_configured_hides_who_asks() {
        let forwarded = [("x-forwarded-for", "1.2.3.4")];
        assert_eq!(found("127.0.0.1", &forwarded, &[]), None);
        assert_eq!(found("127.0.0.1", &[], &[]).unwrap(), "127.0.0.1");
        assert_eq!(found("::1", &forwarded, &["::1"]).unwrap(), "1.2.3.4");
        assert_eq!(of(None, &HeaderMap::new(), &[]), None);
    }

    #[test]
    fn a_trusted_proxy_tells_that_it_was_asked_over_https() {
        let told = |peer: &str, name: &str, value: &str| {
            let headers = HeaderMap::from_iter([(name.parse().unwrap(), value.parse().unwrap())]);
            is_encrypted(Some(peer.parse().unwrap()), &headers, &["10.0.0.0/8".parse().unwrap()])
        };
        for (name, value) in [
            ("x-forwarded-proto", "https"),
            ("x-forwarded-proto", "http, HTTPS"),
            ("forwarded", "for=1.2.3.4;proto=https"),
            ("forwarded", "proto=http, for=\"[::1]\"; Proto=\"https\""),
        ] {
            assert!(told("10.0.0.1", name, value), "{name}: {value}");
            assert!(!told("9.9.9.9", name, value), "{name}: {value}, of somebody else");
        }
        for (name, value) in [
            ("x-forwarded-proto", "https, http"),
            ("x-forwarded-proto", ""),
            ("forwarded", "for=1.2.3.4"),
            ("forwarded", "proto=https, proto=http"),
        ] {
            assert!(!told("10.0.0.1", name, value), "{name}: {value}");
        }
    }

    #[test]
    fn log_ins_through_unknown_proxies_have_no_address() {
        let forwarded =
            HeaderMap::from_iter([("x-forwarded-for".parse().unwrap(), HeaderValue::from_static("1.2.3.4"))]);
        let (peer, trusted) = ([10, 0, 0, 1].into(), ["10.0.0.1".parse().unwrap()]);
        assert_eq!(of_log_in(Some(peer), &forwarded, &[]), None);
        assert_eq!(of_log_in(Some(peer), &forwarded, &trusted), Some([1, 2, 3, 4].into()));
        assert_eq!(of_log_in(Some(peer), &HeaderMap::new(), &[]), Some(peer));
    }

    #[test]
    fn addresses_are_read_however_proxies_write_them() {
        let read = |text: &str| address(text).map(|address| address.to_string());
        for (text, expected) in [
            ("1.2.3.4", "1.2.3.4"),
            ("1.2.3.4:5678", "1.2.3.4"),
            ("2001:db8::7", "2001:db8::7"),
            ("[2001:db8::7]", "2001:db8::7"),
            ("[2001:db8::7]:443", "2001:db8::7"),
            ("::ffff:1.2.3.4", "1.2.3.4"),
        ] {
            assert_eq!(read(text).as_deref(), Some(expected), "{text}");
        }
        for text in ["", "unknown", "_hidden", "1.2.3", "[::1", "1.2.3.4.5"] {
            assert_eq!(read(text), None, "{text}");
        }
        let noted = [("forwarded", "for=1.1.1.1;proto=https, For=\"[2001:db8::7]:99\";by=3.3.3.3")];
        assert_eq!(found("10.0.0.1", &noted, &["10.0.0.1"]).unwrap(), "2001:db8::7");
    }

    #[test]
    fn all_addresses_of_one_ipv6_network_are_one_caller() {
        let network = |text: &str| network_of(text.parse().unwrap()).to_string();
        assert_eq!(network("2001:db8:1:203:3:4:5:6"), "2001:db8:1:200::");
        assert_eq!(network("::ffff:1.2.3.4"), "1.2.3.4");
    }
}
