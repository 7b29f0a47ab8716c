//! Ways on which cameras send packets: how they refuse one or answer with another, and which is asked for first.
//!
//! Keeps its knowledge by a stream's whole URL and by the transport that is configured: one stream of a recorder may give nothing while
//! its others play, and a camera that is configured for another transport begins anew.

use crate::media::client::Peer;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::sync::Mutex;
use videofields_vision::config::Transport;
use videofields_vision::lock::lock;

/// Status of an answer to a transport that the camera does not have.
pub(super) const UNSUPPORTED: u16 = 461;

/// Other statuses with which cameras refuse a transport.
const REFUSALS: [u16; 6] = [400, 406, 415, 500, 501, 551];

/// Digest of a stream's URL, which may hold secrets, and of the transport that is wished for.
type Key = [u8; 32];

/// Knowledge of streams that were asked for.
static KNOWN: Mutex<BTreeMap<Key, Known>> = Mutex::new(BTreeMap::new());

/// Most streams of which something is known; of others nothing is.
const MAX_KNOWN: usize = 4096;

/// Knowledge of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Known {
    /// It came over this transport, which is asked for first from then on.
    Came(Transport),
    /// Nothing came over this transport so far: the other is asked for first.
    Silent(Transport),
}

/// Returns true where a camera's answer to SETUP refuses its transport. Over an encrypted connection only the status counts that says
/// so: the other way is not encrypted.
pub(super) fn is_refusal(peer: &Peer, status: u16) -> bool {
    status == UNSUPPORTED || !peer.is_encrypted && REFUSALS.contains(&status)
}

/// Returns the transports in the order in which the stream at `url` is asked for over them.
pub(super) fn in_order(wished: Transport, url: &str) -> [Transport; 2] {
    let first = match lock(&KNOWN).get(&key(wished, url)) {
        Some(Known::Came(transport)) => *transport,
        Some(Known::Silent(transport)) => other(*transport),
        None => wished,
    };
    [first, other(first)]
}

/// Returns true where a stream came over that transport before, or nothing came over the other.
pub(super) fn is_proven(wished: Transport, url: &str, transport: Transport) -> bool {
    let known = lock(&KNOWN).get(&key(wished, url)).copied();
    known == Some(Known::Came(transport)) || known == Some(Known::Silent(other(transport)))
}

/// Remembers that packets of a stream came over that transport.
pub(super) fn remember_packets(wished: Transport, url: &str, transport: Transport) {
    remember(key(wished, url), Known::Came(transport));
}

/// Remembers that nothing came over that transport, unless it did before: a camera that gives nothing for a while starts anew.
pub(super) fn remember_silence(wished: Transport, url: &str, transport: Transport) {
    let key = key(wished, url);
    let has_come = lock(&KNOWN).get(&key) == Some(&Known::Came(transport));
    if !has_come {
        tracing::info!(
            ?transport,
            "a camera gives nothing over a transport: the other is asked for first now"
        );
        remember(key, Known::Silent(transport));
    }
}

fn remember(key: Key, known: Known) {
    let mut all = lock(&KNOWN);
    if all.len() < MAX_KNOWN || all.contains_key(&key) {
        all.insert(key, known);
    }
}

fn key(wished: Transport, url: &str) -> Key {
    Sha256::new().chain_update([u8::from(wished == Transport::Udp)]).chain_update(url).finalize().into()
}

const fn other(transport: Transport) -> Transport {
    match transport {
        Transport::Tcp => Transport::Udp,
        Transport::Udp => Transport::Tcp,
    }
}

/// Returns the transport that a `Transport` header names; none where it says too little.
pub(super) fn named(header: &str) -> Option<Transport> {
    let header = header.to_ascii_lowercase();
    if header.contains("/tcp") || header.contains("interleaved") {
        return Some(Transport::Tcp);
    }
    let has_ports = ["/udp", "client_port", "server_port"].iter().any(|part| header.contains(part));
    has_ports.then_some(Transport::Udp)
}

/// Returns the camera's ports of packets and of reports in a `Transport` header.
pub(super) fn server_ports(header: &str) -> Option<(u16, u16)> {
    let ports = header.split(';').find_map(|part| part.trim().strip_prefix("server_port="))?;
    let (first, second) = ports.split_once('-').unwrap_or((ports, ""));
    let first: u16 = first.trim().parse().ok()?;
    Some((first, second.trim().parse().unwrap_or(first.saturating_add(1))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transports_are_named_by_their_profile_or_their_ports() {
        for tcp in
            ["RTP/AVP/TCP;unicast;interleaved=0-1", "RTP/AVP;unicast;interleaved=2-3;ssrc=1", "rtp/avp/tcp"]
        {
            assert_eq!(named(tcp), Some(Transport::Tcp), "{tcp}");
        }
        for udp in [
            "RTP/AVP;unicast;client_port=0-0;server_port=40000-40001",
            "RTP/AVP/UDP;unicast",
            "RTP/AVP;server_port=6970",
        ] {
            assert_eq!(named(udp), Some(Transport::Udp), "{udp}");
        }
        for unclear in ["", "RTP/AVP;unicast;mode=play"] {
            assert_eq!(named(unclear), None, "{unclear}");
        }
        assert_eq!(server_ports("RTP/AVP;unicast; server_port=40000-40001"), Some((40_000, 40_001)));
        assert_eq!(server_ports("RTP/AVP;server_port=6970"), Some((6970, 6971)));
        assert_eq!(server_ports("RTP/AVP/TCP;interleaved=0-1"), None);
    }

    #[test]
    fn a_transport_that_gives_nothing_comes_second_unless_it_gave_something_before() {
        let url = "rtsp://transport-test:554/first";
        let order = |wished| in_order(wished, url);
        let (tcp_first, udp_first) = ([Transport::Tcp, Transport::Udp], [Transport::Udp, Transport::Tcp]);
        assert_eq!([order(Transport::Tcp), order(Transport::Udp)], [tcp_first, udp_first]);
        // A second silence changes nothing.
        for _ in 0..2 {
            remember_silence(Transport::Tcp, url, Transport::Tcp);
            assert_eq!([order(Transport::Tcp), order(Transport::Udp)], [udp_first; 2]);
        }
        assert_eq!(in_order(Transport::Tcp, "rtsp://transport-test:554/second"), tcp_first, "another stream");
        remember_silence(Transport::Tcp, url, Transport::Udp);
        assert_eq!(order(Transport::Tcp), tcp_first);
        let proven = |transport| is_proven(Transport::Tcp, url, transport);
        assert_eq!([proven(Transport::Tcp), proven(Transport::Udp)], [true, false]);
        remember_packets(Transport::Tcp, url, Transport::Udp);
        remember_silence(Transport::Tcp, url, Transport::Udp);
        assert_eq!(order(Transport::Tcp), udp_first, "it starts anew");
        remember_silence(Transport::Tcp, url, Transport::Tcp);
        assert_eq!(order(Transport::Tcp), udp_first);
        assert_eq!([proven(Transport::Tcp), proven(Transport::Udp)], [false, true]);
    }

    #[test]
    fn an_encrypted_camera_refuses_by_the_one_status_alone() {
        let peer = |is_encrypted| Peer {
            address: ([127, 0, 0, 1], 554).into(),
            host: String::new(),
            is_encrypted,
            place: String::new(),
            authority: String::new(),
            url: String::new(),
            path_and_query: String::new(),
        };
        let (plain, encrypted) = (peer(false), peer(true));
        for (status, expected) in [(461, [true, true]), (406, [true, false]), (500, [true, false])] {
            assert_eq!([is_refusal(&plain, status), is_refusal(&encrypted, status)], expected, "{status}");
        }
        assert!([200, 404, 453].iter().all(|status| !is_refusal(&plain, *status)));
    }
}
