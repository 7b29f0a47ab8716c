//! From a camera's URL to the address that is connected to.
//!
//! A name is looked up once for each connection; its addresses are held against the networks in which cameras may be, and
//! the connection goes to an address that was, not to the name. Only where TLS makes the camera prove its name does
//! the name itself go on, and then all its addresses must be allowed: whoever sends the name elsewhere meanwhile gains
//! nothing without the camera's certificate. A fresh look-up may answer otherwise, which is looked at anew.

use super::{CameraError, IngestError};
use crate::media::Peer;
use std::net::{IpAddr, SocketAddr, SocketAddrV6, ToSocketAddrs};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;
use videofields_vision::config::{CameraUrl, Network, Scheme, UrlParts};

/// Longest time for a name to be looked up. The system's own limit may be half a minute: its thread is left then.
const LOOK_UP_TIME: Duration = Duration::from_secs(5);

/// Most look-ups at once, those that were left included.
const MAX_LOOK_UPS: usize = 64;

static N_LOOK_UPS: AtomicUsize = AtomicUsize::new(0);

/// Where a camera is connected to.
pub(crate) struct Endpoint {
    parts: UrlParts,
    address: IpAddr,
    /// Number of the network interface behind which a link-local address lies; 0 for all others.
    interface: u32,
}

impl Endpoint {
    /// Takes a URL apart, finds its address, and checks it.
    pub(crate) fn of(url: &CameraUrl, networks: &[Network]) -> Result<Self, IngestError> {
        let parts = url.parse().map_err(CameraError::Url)?;
        let interface = interface_of(&parts)?;
        Ok(Self { interface, ..Self::checked(parts, networks, look_up)? })
    }

    fn checked(
        parts: UrlParts,
        networks: &[Network],
        look_up: impl FnOnce(&str) -> Result<Vec<IpAddr>, String>,
    ) -> Result<Self, CameraError> {
        let addresses = match &parts.host {
            url::Host::Ipv4(address) => vec![IpAddr::V4(*address)],
            url::Host::Ipv6(address) => vec![IpAddr::V6(*address)],
            url::Host::Domain(host) => {
                look_up(host).map_err(|detail| CameraError::Unknown { host: host.clone(), detail })?
            }
        };
        let is_allowed = |address: &IpAddr| networks.iter().any(|network| network.contains(*address));
        let found = addresses.iter().find(|address| is_allowed(address));
        let refused = addresses.iter().find(|address| !is_allowed(address));
        let place = parts.to_string();
        match (found, refused) {
            (Some(_), Some(address)) if parts.scheme.is_encrypted() => {
                Err(CameraError::Forbidden { place, address: address.to_canonical() })
            }
            (Some(address), _) => Ok(Self { address: address.to_canonical(), parts, interface: 0 }),
            (None, Some(address)) => Err(CameraError::Forbidden { place, address: address.to_canonical() }),
            (None, None) => {
                Err(CameraError::Unknown { host: parts.host.to_string(), detail: "no address".to_owned() })
            }
        }
    }

    /// How it is spoken to.
    pub(super) const fn scheme(&self) -> Scheme {
        self.parts.scheme
    }

    /// Scheme, host and port: what messages may show.
    pub(crate) fn place(&self) -> String {
        self.parts.to_string()
    }

    /// Returns whether the address that is connected to lies in one of `networks`.
    pub(crate) fn is_within(&self, networks: &[Network]) -> bool {
        networks.iter().any(|network| network.contains(self.address))
    }

    /// The URL to connect to; may hold secrets behind the port.
    fn location(&self) -> String {
        if self.parts.scheme.is_encrypted() {
            return format!("{}{}", self.parts, self.parts.path_and_query);
        }
        let address = SocketAddr::new(self.address, self.parts.port);
        format!("{}://{address}{}", self.parts.scheme.as_str(), self.parts.path_and_query)
    }

    /// Returns the address that is connected to, and what the camera is asked for.
    pub(crate) fn peer(&self) -> Peer {
        Peer {
            address: match self.address {
                IpAddr::V4(address) => (address, self.parts.port).into(),
                IpAddr::V6(address) => SocketAddrV6::new(address, self.parts.port, 0, self.interface).into(),
            },
            host: match &self.parts.host {
                // Without the brackets that it has in a URL.
                url::Host::Ipv6(address) => address.to_string(),
                host => host.to_string(),
            },
            is_encrypted: self.parts.scheme.is_encrypted(),
            place: self.place(),
            authority: self.host(),
            url: self.location(),
            path_and_query: self.parts.path_and_query.clone(),
        }
    }

    /// What an HTTP camera is told to be called.
    fn host(&self) -> String {
        if self.parts.port == self.parts.scheme.port() {
            self.parts.host.to_string()
        } else {
            format!("{}:{}", self.parts.host, self.parts.port)
        }
    }
}

/// The number of the network interface that a link-local address names; 0 where the host is none.
fn interface_of(parts: &UrlParts) -> Result<u32, CameraError> {
    let url::Host::Ipv6(address) = &parts.host else { return Ok(0) };
    if !address.is_unicast_link_local() {
        return Ok(0);
    }
    let unknown =
        |detail: &str| CameraError::Unknown { host: parts.host.to_string(), detail: detail.to_owned() };
    let Some(zone) = &parts.zone else {
        return Err(unknown("a link-local address needs a network interface, such as [fe80::1%25eth0]"));
    };
    if let Ok(number) = zone.parse() {
        return Ok(number);
    }
    let socket = rustix::net::socket(rustix::net::AddressFamily::INET6, rustix::net::SocketType::DGRAM, None);
    let number = socket.and_then(|socket| rustix::net::netdevice::name_to_index(&socket, zone));
    number.map_err(|_error| unknown(&format!("this machine has no network interface {zone:?}")))
}

/// The addresses of a name, found on a thread of its own, because the system's look-up cannot be ended.
fn look_up(host: &str) -> Result<Vec<IpAddr>, String> {
    if N_LOOK_UPS.fetch_add(1, Ordering::AcqRel) >= MAX_LOOK_UPS {
        N_LOOK_UPS.fetch_sub(1, Ordering::AcqRel);
        return Err("too many names are being looked up".to_owned());
    }
    let (reply, answer) = sync_channel(1);
    let name = host.to_owned();
    let thread = std::thread::Builder::new().name("look-up".to_owned()).spawn(move || {
        let found = (name.as_str(), 0).to_socket_addrs();
        N_LOOK_UPS.fetch_sub(1, Ordering::AcqRel);
        let found = found.map(|found| found.map(|address| address.ip()).collect());
        if reply.send(found.map_err(|error| error.to_string())).is_err() {
            tracing::debug!("an address came too late");
        }
    });
    if let Err(error) = thread {
        N_LOOK_UPS.fetch_sub(1, Ordering::AcqRel);
        return Err(error.to_string());
    }
    answer.recv_timeout(LOOK_UP_TIME).unwrap_or_else(|error| {
        Err(match error {
            RecvTimeoutError::Timeout => format!("no answer within {} s", LOOK_UP_TIME.as_secs()),
            RecvTimeoutError::Disconnected => "the look-up broke off".to_owned(),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::config::Settings;
    use videofields_vision::error::ErrorKind;

    fn endpoint(url: &str, addresses: &[&str]) -> Result<Endpoint, CameraError> {
        let networks = Settings::default().media.networks;
        let found = || addresses.iter().map(|address| address.parse().unwrap()).collect();
        Endpoint::checked(CameraUrl::new(url).parse().unwrap(), &networks, |_host| Ok(found()))
    }

    #[test]
    fn what_is_connected_to_is_the_address_that_was_checked() {
        let check = |url: &str, addresses: &[&str], location: &str, host: &str| {
            let found = endpoint(url, addresses).unwrap();
            assert_eq!((found.location().as_str(), found.host().as_str()), (location, host));
        };
        check("rtsp://cam/a?b", &["192.168.0.9"], "rtsp://192.168.0.9:554/a?b", "cam");
        check("http://cam:81/a", &["8.8.8.8", "10.0.0.9"], "http://10.0.0.9:81/a", "cam:81");
        check("http://cam/a", &["fe80::1"], "http://[fe80::1]:80/a", "cam");
        check("rtsp://[::ffff:127.0.0.1]/a", &[], "rtsp://127.0.0.1:554/a", "[::ffff:7f00:1]");
        check("rtsp://0x7f000001/a", &["8.8.8.8"], "rtsp://127.0.0.1:554/a", "127.0.0.1");
        // A name that must be proved goes on as a name.
        check("rtsps://cam/a", &["10.0.0.9"], "rtsps://cam:322/a", "cam");
    }

    #[test]
    fn addresses_outside_the_networks_are_refused() {
        let check = |url: &str, addresses: &[&str], named: &str| {
            let error = endpoint(url, addresses).err().unwrap();
            assert!(matches!(error, CameraError::Forbidden { .. }), "{url}: {error}");
            assert_eq!(error.kind(), ErrorKind::Invalid);
            let said = error.to_string();
            assert!(said.contains(named) && said.contains("media.networks"), "{said}");
            assert!(!said.contains("s3cret"), "{said}");
        };
        check("http://169.254.169.254/latest/s3cret", &[], "169.254.169.254");
        check("http://[::ffff:169.254.169.254]/", &[], "169.254.169.254");
        check("http://2852039166/", &[], "169.254.169.254");
        check("rtsp://0251.0376.0251.0376/", &[], "169.254.169.254");
        check("rtsp://8.8.8.8/s3cret", &[], "8.8.8.8");
        check("rtsp://0.0.0.0/", &[], "0.0.0.0");
        check("rtsp://evil.example/", &["169.254.169.254"], "169.254.169.254");
        check("rtsp://evil.example/", &["::ffff:9.9.9.9"], "9.9.9.9");
        check("https://evil.example/", &["10.0.0.1", "9.9.9.9"], "9.9.9.9");
    }

    #[test]
    fn link_local_addresses_lie_behind_the_interface_that_they_name() {
        let networks = Settings::default().media.networks;
        let of = |url: &str| Endpoint::of(&CameraUrl::new(url), &networks);
        for (url, number) in [("rtsp://[fe80::1%25lo]:8554/a", 1), ("rtsp://[fe80::1%7]/a", 7)] {
            let peer = of(url).unwrap().peer();
            assert!(matches!(peer.address, SocketAddr::V6(address) if address.scope_id() == number), "{url}");
            assert!(!peer.url.contains('%') && !peer.authority.contains('%'), "{}", peer.url);
            assert!(peer.place.contains('%'), "{}", peer.place);
        }
        let said = |url: &str| of(url).err().unwrap().to_string();
        assert!(said("rtsp://[fe80::1]/a").contains("needs a network interface"));
        assert!(said("rtsp://[fe80::1%25none0]/a").contains("no network interface \"none0\""));
    }

    #[test]
    fn names_that_nobody_knows_are_told() {
        let parts = || CameraUrl::new("rtsp://cam/").parse().unwrap();
        let error = Endpoint::checked(parts(), &[], |_host| Err("no such name".to_owned())).err().unwrap();
        assert_eq!(error.to_string(), "cannot find the address of \"cam\": no such name");
        assert!(Endpoint::checked(parts(), &[], |_host| Ok(Vec::new())).is_err());
        let localhost = look_up("localhost").unwrap();
        assert!(!localhost.is_empty() && localhost.iter().all(IpAddr::is_loopback), "{localhost:?}");
    }
}
