//! Addresses as devices tell them, and as they are reached from here.
//!
//! Devices tell the address that they were made with, one behind a router, or none: so what they tell is put beside the same at the host
//! that answered. Nothing but that host is ever asked.

use super::OnvifError;
use crate::media::Peer;
use std::net::IpAddr;
use url::Host;
use videofields_vision::config::{CameraUrl, Scheme, UrlParts};

/// Path of most devices' device service.
const DEVICE_SERVICE: &str = "/onvif/device_service";

/// The host that a device is asked at.
#[derive(Clone, Debug)]
pub(super) struct AskedHost {
    /// Host as it is written in URLs.
    pub(super) written: String,
    /// The address that was connected to.
    pub(super) address: IpAddr,
}

impl AskedHost {
    /// Returns true where a URL leads there.
    fn is_of(&self, parts: &UrlParts) -> bool {
        let written = parts.host.to_string();
        let address = match &parts.host {
            Host::Ipv4(address) => Some(IpAddr::V4(*address)),
            Host::Ipv6(address) => Some(IpAddr::V6(*address)),
            Host::Domain(_) => None,
        };
        written.eq_ignore_ascii_case(&self.written)
            || address.is_some_and(|address| address.to_canonical() == self.address.to_canonical())
    }
}

/// A URL that a device told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Placed {
    /// At the host that was asked.
    pub(super) url: CameraUrl,
    /// URL as the device gave it, where that is at another host.
    pub(super) reported: Option<CameraUrl>,
}

impl Placed {
    /// Returns whether it is one of RTSP.
    pub(super) fn is_stream(&self) -> bool {
        self.url.parse().is_ok_and(|parts| parts.is_rtsp())
    }
}

/// Returns the URL of the device service at `HOST`, `HOST:PORT` or an http or https URL.
///
/// # Errors
/// When it is none of these.
pub fn device_service(address: &str) -> Result<CameraUrl, OnvifError> {
    let text = if address.contains("://") {
        address.to_owned()
    } else {
        format!("http://{address}{DEVICE_SERVICE}")
    };
    let url = CameraUrl::new(text);
    let is_askable = url.parse().is_ok_and(|parts| !parts.is_rtsp());
    // A path without scheme would have become part of another.
    let is_whole = address.contains("://") || !(address.is_empty() || address.contains(['/', '?', '#']));
    if is_askable && is_whole { Ok(url) } else { Err(OnvifError::NoAddress) }
}

/// Returns a URL that a device told, without a login in it; none where it is none that cameras have.
pub(super) fn placed(reported: &str, asked: &AskedHost) -> Option<Placed> {
    let url = without_login(reported.trim())?;
    let parts = url.parse().ok()?;
    if asked.is_of(&parts) {
        return Some(Placed { url, reported: None });
    }
    Some(Placed { url: at_host(&parts, &asked.written)?, reported: Some(url) })
}

/// Returns how a service at `reported` is reached: always at the host of `peer`, and at another port only where the device tells one of
/// that host.
pub(super) fn service(reported: &str, peer: &Peer, asked: &AskedHost) -> Option<Peer> {
    let parts = without_login(reported.trim())?.parse().ok()?;
    let mut found = Peer { path_and_query: parts.path_and_query.clone(), ..peer.clone() };
    let is_same_way = !parts.is_rtsp() && parts.scheme.is_encrypted() == peer.is_encrypted;
    if asked.is_of(&parts) && is_same_way {
        found.address.set_port(parts.port);
        found.authority = authority(&parts, &asked.written);
        found.place = format!("{}://{}:{}", parts.scheme.as_str(), asked.written, parts.port);
    }
    found.url = format!("{}{}", found.place, found.path_and_query);
    Some(found)
}

/// Returns a URL without user and password; none where it is no camera's.
fn without_login(reported: &str) -> Option<CameraUrl> {
    let (scheme, rest) = reported.split_once("://")?;
    let (authority, behind) = rest.split_at(rest.find(['/', '?', '#']).unwrap_or(rest.len()));
    let place = authority.rsplit_once('@').map_or(authority, |(_login, place)| place);
    let url = CameraUrl::new(format!("{scheme}://{place}{behind}"));
    url.parse().is_ok().then_some(url)
}

/// Returns the same at another host; none where it is too long with what is escaped in it.
pub(super) fn at_host(parts: &UrlParts, host: &str) -> Option<CameraUrl> {
    let scheme = parts.scheme.as_str();
    let url = CameraUrl::new(format!("{scheme}://{}{}", authority(parts, host), parts.path_and_query));
    url.parse().is_ok().then_some(url)
}

fn authority(parts: &UrlParts, host: &str) -> String {
    if parts.port == Scheme::port(parts.scheme) { host.to_owned() } else { format!("{host}:{}", parts.port) }
}

/// Returns an address as it is written in URLs.
pub(super) fn written(address: IpAddr) -> String {
    match address.to_canonical() {
        IpAddr::V4(address) => address.to_string(),
        IpAddr::V6(address) => format!("[{address}]"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(written: &str) -> AskedHost {
        AskedHost { written: written.to_owned(), address: "10.0.0.7".parse().unwrap() }
    }

    #[test]
    fn addresses_become_device_services() {
        let check = |address: &str, expected: &str| {
            assert_eq!(device_service(address).unwrap(), CameraUrl::new(expected), "{address}");
        };
        check("10.0.0.7", "http://10.0.0.7/onvif/device_service");
        check("gate.example:8080", "http://gate.example:8080/onvif/device_service");
        check("[fd00::7]:81", "http://[fd00::7]:81/onvif/device_service");
        check("https://gate/other", "https://gate/other");
        for address in [
            "",
            "rtsp://10.0.0.7/",
            "10.0.0.7/a",
            "u:p@10.0.0.7",
            "http://u:p@10.0.0.7/",
            "a b",
            "10.0.0.7:0",
        ] {
            assert!(matches!(device_service(address), Err(OnvifError::NoAddress)), "{address}");
        }
    }

    #[test]
    fn other_hosts_are_told_beside_the_one_that_answered() {
        let check = |reported: &str, url: &str, other: Option<&str>| {
            let found = placed(reported, &asked("gate")).unwrap();
            assert_eq!(
                found,
                Placed { url: CameraUrl::new(url), reported: other.map(CameraUrl::new) },
                "{reported}"
            );
        };
        check(" rtsp://10.0.0.7:8554/a?b=c ", "rtsp://10.0.0.7:8554/a?b=c", None);
        check("rtsp://GATE/a", "rtsp://GATE/a", None);
        check("rtsp://admin:s3c@ret@gate/a@b", "rtsp://gate/a@b", None);
        check("rtsp://0.0.0.0:554/a", "rtsp://gate/a", Some("rtsp://0.0.0.0:554/a"));
        check("rtsp://192.168.0.100:8554/a?b", "rtsp://gate:8554/a?b", Some("rtsp://192.168.0.100:8554/a?b"));
        check("rtsp://u:p@other", "rtsp://gate/", Some("rtsp://other"));
        for reported in [
            "",
            "rtsp://",
            "file:///etc/passwd",
            "rtsp://a b/",
            "javascript://gate/%0aalert(1)",
            "10.0.0.7/a",
        ] {
            assert_eq!(placed(reported, &asked("gate")), None, "{reported}");
        }
        let long = format!("rtsp://gate/{}", "a".repeat(3000));
        assert_eq!(placed(&long, &asked("gate")), None);
        // Three letters for one, once they are written as URLs have them.
        let escaped = format!("rtsp://other/{}", "\u{e4}".repeat(500));
        assert_eq!(placed(&escaped, &asked("gate")), None);
    }

    #[test]
    fn services_are_asked_at_the_host_that_was_asked_whatever_a_device_tells() {
        let peer = Peer {
            address: "10.0.0.7:8080".parse().unwrap(),
            host: "gate".to_owned(),
            is_encrypted: false,
            place: "http://gate:8080".to_owned(),
            authority: "gate:8080".to_owned(),
            url: String::new(),
            path_and_query: DEVICE_SERVICE.to_owned(),
        };
        let check = |reported: &str, authority: &str, port: u16, path: &str| {
            let found = service(reported, &peer, &asked("gate")).unwrap();
            assert_eq!((found.address.ip(), found.host.as_str()), (peer.address.ip(), "gate"), "{reported}");
            assert_eq!((found.authority.as_str(), found.address.port()), (authority, port), "{reported}");
            assert_eq!(found.path_and_query, path, "{reported}");
        };
        check("http://gate:8080/onvif/media", "gate:8080", 8080, "/onvif/media");
        check("http://10.0.0.7:8000/onvif/media", "gate:8000", 8000, "/onvif/media");
        check("http://10.0.0.7/onvif/media?x=1", "gate", 80, "/onvif/media?x=1");
        check("http://192.168.0.100/onvif/media", "gate:8080", 8080, "/onvif/media");
        check("http://169.254.169.254/latest", "gate:8080", 8080, "/latest");
        check("https://10.0.0.7/onvif/media", "gate:8080", 8080, "/onvif/media");
        assert!(service("onvif/media", &peer, &asked("gate")).is_none());
    }
}
