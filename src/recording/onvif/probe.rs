//! Finds devices: WS-Discovery's question to all devices of the networks at hand, and their answers.
//!
//! Answers come from strangers: a datagram is bounded, so are their number and the time, and a device is only ever asked at the address
//! from which it answered, whatever address it tells.

use super::place::{at_host, written};
use super::xml::{children, shown, text_at};
use super::{OnvifError, xml};
use percent_encoding::percent_decode_str;
use roxmltree::Node;
use rustix::net::sockopt::set_ip_multicast_if_with_ifindex;
use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::Path;
use std::time::Duration;
use tokio::net::UdpSocket;
use tokio::time::{Instant, sleep_until, timeout_at};
use videofields_vision::config::{CameraUrl, Network};

/// Longest time for answers to come.
pub const PROBE_TIME: Duration = Duration::from_secs(2);

/// The question is put twice, this long apart: datagrams get lost.
const AGAIN_AFTER: Duration = Duration::from_millis(400);

/// Address at which devices listen.
const EVERYBODY: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::new(239, 255, 255, 250)), 3702);

/// Routers between here and a device, at most.
const HOPS: u32 = 4;

/// Most bytes of an answer; devices' have one or two thousand.
const MAX_ANSWER_BYTES: usize = 16 << 10;

/// Most answers that are read.
const MAX_ANSWERS: usize = 1000;

/// Most devices that are told.
const MAX_DEVICES: usize = 256;

/// Most devices of one answer: one may answer for others.
const MAX_IN_ANSWER: usize = 8;

/// Most addresses of one device.
const MAX_ADDRESSES: usize = 4;

/// Most network interfaces that are asked through.
const MAX_INTERFACES: usize = 32;

/// Most letters of a name, and of an endpoint's address.
const MAX_LETTERS: usize = 128;

/// Most bytes of a URL.
const MAX_URL_BYTES: usize = 1024;

const DISCOVERY: &str = "http://schemas.xmlsoap.org/ws/2005/04/discovery";

/// Kinds of devices that are asked for: a question names one, and some devices are of the second alone.
const KINDS: [&str; 2] = [
    "xmlns:k=\"http://www.onvif.org/ver10/network/wsdl\">k:NetworkVideoTransmitter",
    "xmlns:k=\"http://www.onvif.org/ver10/device/wsdl\">k:Device",
];

/// Those who are asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Audience {
    /// All devices of the networks that this machine is in.
    Everybody,
    /// Listener at one address.
    One(SocketAddr),
}

/// A device that answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundDevice {
    /// Address of its endpoint, which stays the same wherever it is; a stranger's word.
    pub endpoint: String,
    /// Its name, where it tells one.
    pub name: Option<String>,
    /// Its model, where it tells one.
    pub model: Option<String>,
    /// Its device service at each address from which it answered, the first one first.
    pub services: Vec<CameraUrl>,
    /// Its device service as it tells it, where that is at other hosts.
    pub reported_services: Vec<CameraUrl>,
}

/// Answers to a question.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FoundDevices {
    /// By their addresses.
    pub devices: Vec<FoundDevice>,
    /// Answers that were left out: not understood, too long, or from where no camera may be.
    pub n_ignored: usize,
    /// True where there may be more.
    pub is_cut: bool,
}

/// Asks who is there and gathers answers from `networks` for [`PROBE_TIME`], which it blocks for.
///
/// # Errors
/// When nothing can be sent.
pub fn probe(audience: Audience, networks: &[Network]) -> Result<FoundDevices, OnvifError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    runtime.map_err(|source| OnvifError::Threads { source })?.block_on(ask(audience, networks))
}

async fn ask(audience: Audience, networks: &[Network]) -> Result<FoundDevices, OnvifError> {
    let no_network = |source| OnvifError::NoNetwork { source };
    let target = match audience {
        Audience::Everybody => EVERYBODY,
        Audience::One(address) => address,
    };
    let own: SocketAddr =
        if target.is_ipv4() { (Ipv4Addr::UNSPECIFIED, 0).into() } else { ([0_u16; 8], 0).into() };
    let socket = UdpSocket::bind(own).await.map_err(no_network)?;
    if audience == Audience::Everybody {
        socket.set_multicast_ttl_v4(HOPS).map_err(no_network)?;
    }
    let questions: Vec<String> = KINDS.iter().map(|kind| question(kind)).collect::<Result<_, _>>()?;
    let begun = Instant::now();
    send(&socket, target, audience, &questions).await.map_err(no_network)?;
    let mut gathered = Gathered::default();
    let receive = gathered.receive(&socket, networks, begun + PROBE_TIME);
    let again = async {
        sleep_until(begun + AGAIN_AFTER).await;
        if let Err(error) = send(&socket, target, audience, &questions).await {
            tracing::debug!(%error, "devices are not asked again");
        }
    };
    tokio::join!(receive, again);
    Ok(gathered.into_devices())
}

/// Sends the questions, to everybody through each network interface.
async fn send(
    socket: &UdpSocket,
    target: SocketAddr,
    audience: Audience,
    questions: &[String],
) -> io::Result<()> {
    let interfaces = match audience {
        Audience::Everybody => interfaces(Path::new("/sys/class/net")),
        Audience::One(_) => Vec::new(),
    };
    let (mut n_sent, mut last_error) = (0, None);
    // Without one that is known, the way is the system's to choose.
    let ways = interfaces.iter().copied().map(Some).chain(interfaces.is_empty().then_some(None));
    for way in ways {
        let any = Ipv4Addr::UNSPECIFIED;
        if let Some(number) = way
            && let Err(error) = set_ip_multicast_if_with_ifindex(socket, &any, &any, number)
        {
            last_error = Some(error.into());
            continue;
        }
        for question in questions {
            match socket.send_to(question.as_bytes(), target).await {
                Ok(_) => n_sent += 1,
                // One without an address of its own.
                Err(error) => last_error = Some(error),
            }
        }
    }
    match last_error {
        Some(error) if n_sent == 0 => Err(error),
        _ => Ok(()),
    }
}

/// Numbers of the network interfaces that are up and take questions to everybody.
///
/// Read from the kernel's files: the usual call needs netlink, which a service that is locked in has not.
fn interfaces(folder: &Path) -> Vec<u32> {
    const UP: u32 = 0x1;
    const LOOPBACK: u32 = 0x8;
    const MULTICAST: u32 = 0x1000;
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut numbers: Vec<u32> = entries
        .filter_map(Result::ok)
        .filter_map(|entry| {
            let read = |name: &str| std::fs::read_to_string(entry.path().join(name)).ok();
            let flags = read("flags")?;
            let flags = u32::from_str_radix(flags.trim().trim_start_matches("0x"), 16).ok()?;
            let is_usable = flags & UP != 0 && flags & MULTICAST != 0 && flags & LOOPBACK == 0;
            read("ifindex")?.trim().parse().ok().filter(|_number| is_usable)
        })
        .collect();
    numbers.sort_unstable();
    numbers.truncate(MAX_INTERFACES);
    numbers
}

/// Returns a question, with a number of its own.
fn question(kind: &str) -> Result<String, OnvifError> {
    const ADDRESSING: &str = "http://schemas.xmlsoap.org/ws/2004/08/addressing";
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|_error| OnvifError::NoRandomness)?;
    // A random number as RFC 9562 has it (version 4).
    bytes[6] = bytes[6] & 0x0f | 0x40;
    bytes[8] = bytes[8] & 0x3f | 0x80;
    let digits: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    let number = [&digits[..8], &digits[8..12], &digits[12..16], &digits[16..20], &digits[20..]].join("-");
    Ok(format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\
         <s:Envelope xmlns:s=\"http://www.w3.org/2003/05/soap-envelope\" xmlns:a=\"{ADDRESSING}\"><s:Header>\
         <a:MessageID>urn:uuid:{number}</a:MessageID><a:To>urn:schemas-xmlsoap-org:ws:2005:04:discovery</a:To>\
         <a:Action>{DISCOVERY}/Probe</a:Action></s:Header><s:Body><d:Probe xmlns:d=\"{DISCOVERY}\">\
         <d:Types {kind}</d:Types></d:Probe></s:Body></s:Envelope>"
    ))
}

/// Answers so far.
#[derive(Default)]
pub(super) struct Gathered {
    /// By their endpoints' addresses, with the address that each answered from first.
    devices: BTreeMap<String, (SocketAddr, FoundDevice)>,
    n_answers: usize,
    n_ignored: usize,
    is_cut: bool,
}

impl Gathered {
    async fn receive(&mut self, socket: &UdpSocket, networks: &[Network], until: Instant) {
        let mut bytes = vec![0; MAX_ANSWER_BYTES + 1];
        while let Ok(received) = timeout_at(until, socket.recv_from(&mut bytes)).await {
            let Ok((n_bytes, from)) = received else { continue };
            if self.n_answers >= MAX_ANSWERS {
                self.is_cut = true;
                return;
            }
            self.n_answers += 1;
            let is_allowed = networks.iter().any(|network| network.contains(from.ip()));
            if n_bytes > MAX_ANSWER_BYTES || !is_allowed || self.take(&bytes[..n_bytes], from).is_none() {
                self.n_ignored += 1;
            }
        }
    }

    /// Takes an answer; none where it is not understood.
    pub(super) fn take(&mut self, bytes: &[u8], from: SocketAddr) -> Option<()> {
        let text = String::from_utf8_lossy(bytes);
        let document = xml::read(&text).ok()?;
        let matches = xml::at(document.root_element(), &["Body", "ProbeMatches"])?;
        let mut found = children(matches, "ProbeMatch").filter_map(|of| device(of, from)).peekable();
        found.peek()?;
        for device in found.take(MAX_IN_ANSWER) {
            self.merge(device, from);
        }
        Some(())
    }

    fn merge(&mut self, found: FoundDevice, from: SocketAddr) {
        if let Some((_, known)) = self.devices.get_mut(&found.endpoint) {
            add(&mut known.services, found.services);
            add(&mut known.reported_services, found.reported_services);
            known.name = known.name.take().or(found.name);
            known.model = known.model.take().or(found.model);
        } else if self.devices.len() < MAX_DEVICES {
            self.devices.insert(found.endpoint.clone(), (from, found));
        } else {
            self.is_cut = true;
        }
    }

    pub(super) fn into_devices(self) -> FoundDevices {
        let mut devices: Vec<_> = self.devices.into_values().collect();
        devices.sort_by(|(from, device), (other, other_device)| {
            (from, &device.endpoint).cmp(&(other, &other_device.endpoint))
        });
        let devices = devices.into_iter().map(|(_from, device)| device).collect();
        FoundDevices { devices, n_ignored: self.n_ignored, is_cut: self.is_cut }
    }
}

/// Adds what is not there yet, as far as there is room.
fn add(known: &mut Vec<CameraUrl>, found: Vec<CameraUrl>) {
    for url in found {
        if known.len() < MAX_ADDRESSES && !known.contains(&url) {
            known.push(url);
        }
    }
}

/// Returns the device of a match that came from an address; none where it tells no device service.
fn device(found: Node<'_, '_>, from: SocketAddr) -> Option<FoundDevice> {
    let reported =
        text_at(found, &["XAddrs"])?.split_whitespace().filter(|reported| reported.len() <= MAX_URL_BYTES);
    let mut reported =
        reported.map(CameraUrl::new).filter(|url| url.parse().is_ok_and(|parts| !parts.is_rtsp()));
    let own = written(from.ip());
    let is_own = |url: &CameraUrl| url.parse().is_ok_and(|parts| parts.host.to_string() == own);
    let reported: Vec<CameraUrl> = reported.by_ref().take(MAX_ADDRESSES).collect();
    let service = match reported.iter().find(|url| is_own(url)) {
        Some(url) => url.clone(),
        None => at_host(&reported.first()?.parse().ok()?, &own)?,
    };
    let endpoint =
        text_at(found, &["EndpointReference", "Address"]).map(|address| shown(address, MAX_LETTERS));
    let scopes = text_at(found, &["Scopes"]).unwrap_or_default();
    let scope = |kind: &str| {
        let value = scopes.split_whitespace().find_map(|scope| scope.strip_prefix(kind))?;
        let value = percent_decode_str(value).decode_utf8_lossy();
        Some(shown(&value, MAX_LETTERS)).filter(|value| !value.is_empty())
    };
    Some(FoundDevice {
        endpoint: endpoint.filter(|address| !address.is_empty()).unwrap_or_else(|| from.ip().to_string()),
        name: scope("onvif://www.onvif.org/name/"),
        model: scope("onvif://www.onvif.org/hardware/"),
        services: vec![service],
        reported_services: reported.into_iter().filter(|url| !is_own(url)).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from(last: u8) -> SocketAddr {
        ([10, 0, 0, last], 3702).into()
    }

    fn answer(endpoint: &str, scopes: &str, addresses: &str) -> String {
        format!(
            "<e:Envelope xmlns:e='e' xmlns:d='d'><e:Body><d:ProbeMatches><d:ProbeMatch><x:EndpointReference xmlns:x='x'>\
             <x:Address>{endpoint}</x:Address></x:EndpointReference><d:Scopes>{scopes}</d:Scopes>\
             <d:XAddrs>{addresses}</d:XAddrs></d:ProbeMatch></d:ProbeMatches></e:Body></e:Envelope>"
        )
    }

    fn taken(answers: &[(String, SocketAddr)]) -> FoundDevices {
        let mut gathered = Gathered::default();
        for (answer, from) in answers {
            if gathered.take(answer.as_bytes(), *from).is_none() {
                gathered.n_ignored += 1;
            }
        }
        gathered.into_devices()
    }

    fn urls(urls: &[&str]) -> Vec<CameraUrl> {
        urls.iter().copied().map(CameraUrl::new).collect()
    }

    #[test]
    fn a_device_is_asked_where_it_answered_from_whatever_it_tells() {
        let reported = |addresses: &str| {
            let found = taken(&[(answer("urn:uuid:1", "", addresses), from(7))]);
            found.devices.first().map(|device| (device.services.clone(), device.reported_services.clone()))
        };
        let own = "http://10.0.0.7/onvif/device_service";
        assert_eq!(reported(own), Some((urls(&[own]), vec![])));
        assert_eq!(
            reported(&format!("http://[fe80::1]/a {own}")),
            Some((urls(&[own]), urls(&["http://[fe80::1]/a"])))
        );
        let factory = "http://192.168.0.100:8080/onvif/device_service";
        let moved = "http://10.0.0.7:8080/onvif/device_service";
        assert_eq!(reported(factory), Some((urls(&[moved]), urls(&[factory]))));
        let keys = "http://169.254.169.254/latest";
        assert_eq!(reported(keys), Some((urls(&["http://10.0.0.7/latest"]), urls(&[keys]))));
        assert_eq!(
            reported(&format!("http://other/{}", "\u{e4}".repeat(400))),
            None,
            "too long, once it is escaped"
        );
        for nothing in ["", "rtsp://10.0.0.7/", "file:///etc/passwd", "http://u:p@10.0.0.7/", "urn:uuid:1"] {
            assert_eq!(reported(nothing), None, "{nothing}");
        }
    }

    #[test]
    fn a_device_that_answers_twice_is_one() {
        let scopes = "onvif://www.onvif.org/type/video_encoder onvif://www.onvif.org/name/North%20gate%1b%5B2J \
                      onvif://www.onvif.org/hardware/X-1";
        let found = taken(&[
            (answer("urn:uuid:1", "", "http://10.0.0.8/a"), from(8)),
            (answer("urn:uuid:1", scopes, "http://10.0.0.9/a"), from(9)),
            (answer("urn:uuid:1", "", "http://10.0.0.8/a"), from(8)),
            (answer("urn:uuid:0", "", "http://10.0.0.9/b"), from(9)),
            (answer("", "", "http://10.0.0.2/b"), from(2)),
            ("<a/>".to_owned(), from(3)),
            ("hello".to_owned(), from(3)),
        ]);
        let ends: Vec<_> = found.devices.iter().map(|device| device.endpoint.as_str()).collect();
        assert_eq!(ends, ["10.0.0.2", "urn:uuid:1", "urn:uuid:0"]);
        assert_eq!((found.n_ignored, found.is_cut), (2, false));
        let first = &found.devices[1];
        assert_eq!(first.services, urls(&["http://10.0.0.8/a", "http://10.0.0.9/a"]));
        assert_eq!((first.name.as_deref(), first.model.as_deref()), (Some("North gate[2J"), Some("X-1")));
    }

    #[test]
    fn devices_and_their_addresses_are_bounded() {
        let all: Vec<_> = (0..MAX_DEVICES + 9)
            .map(|n| (answer(&format!("urn:uuid:{n}"), "", "http://10.0.0.9/a"), from(9)))
            .collect();
        let found = taken(&all);
        assert_eq!((found.devices.len(), found.is_cut), (MAX_DEVICES, true));
        let same: Vec<_> = (0..9).map(|n| (answer("urn:uuid:1", "", "http://10.0.0.9/a"), from(n))).collect();
        assert_eq!(taken(&same).devices[0].services.len(), MAX_ADDRESSES);
        let long = "a".repeat(9000);
        let found = taken(&[(
            answer(&long, &format!("onvif://www.onvif.org/name/{long}"), "http://10.0.0.9/a"),
            from(9),
        )]);
        let device = &found.devices[0];
        assert_eq!(
            (device.endpoint.len(), device.name.as_ref().map(String::len)),
            (MAX_LETTERS, Some(MAX_LETTERS))
        );
    }

    #[test]
    fn interfaces_are_those_that_are_up_and_no_loopback() {
        let folder = tempfile::tempdir().unwrap();
        let make = |name: &str, flags: &str, number: &str| {
            let folder = folder.path().join(name);
            std::fs::create_dir(&folder).unwrap();
            std::fs::write(folder.join("flags"), flags).unwrap();
            std::fs::write(folder.join("ifindex"), number).unwrap();
        };
        make("eth0", "0x1003\n", "4\n");
        make("eth1", "0x1002\n", "5\n");
        make("lo", "0x1009\n", "1\n");
        make("tun0", "0x11\n", "6\n");
        make("odd", "up\n", "7\n");
        make("wlan0", "0x1043\n", "2\n");
        assert_eq!(interfaces(folder.path()), [2, 4]);
        assert!(interfaces(&folder.path().join("none")).is_empty());
    }

    #[test]
    fn questions_are_well_formed_and_each_its_own() {
        let first = question(KINDS[0]).unwrap();
        let document = xml::read(&first).unwrap();
        let types = xml::at(document.root_element(), &["Body", "Probe", "Types"]).unwrap();
        assert_eq!(types.text(), Some("k:NetworkVideoTransmitter"));
        assert_eq!(types.lookup_namespace_uri(Some("k")), Some("http://www.onvif.org/ver10/network/wsdl"));
        let number = text_at(document.root_element(), &["Header", "MessageID"]).unwrap();
        assert_eq!((number.len(), number.as_bytes()[23]), (45, b'4'), "{number}");
        assert_ne!(first, question(KINDS[0]).unwrap());
        assert!(xml::read(&question(KINDS[1]).unwrap()).is_ok());
    }
}
