//! A device that speaks ONVIF, as many do and as some do oddly: it answers probes over UDP and questions over HTTP, one thread a
//! connection.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use http_auth::PasswordParams;
use http_auth::digest::DigestClient;
use sha1::{Digest, Sha1};
use std::collections::HashSet;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use videofields_vision::clock::{Clock, SystemClock, Timestamp};

/// The user that the device knows.
pub const USER: &str = "guard";

/// The user's password.
pub const PASSWORD: &str = "s3cret & <strong>";

/// Seconds by which a token may be older or newer than the device's clock.
const TOKEN_SECS: f64 = 5.0;

const CHALLENGE: &str = "Digest realm=\"device\", nonce=\"5f2b\"";

/// Ways in which a device wants to be told who asks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wanted {
    /// By a token in the message, made by the device's own clock.
    #[default]
    Token,
    /// By HTTP's digest alone.
    Digest,
    /// By HTTP's Basic alone, which tells the password.
    Basic,
    /// Not at all.
    Nothing,
}

/// Ways in which a device answers questions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Answers {
    /// Answers that are right.
    #[default]
    Well,
    /// With more than anybody reads.
    Huge,
    /// With entities that stand for entities.
    Entities,
    /// With nothing, while the connection stays.
    Never,
    /// With the address of somebody else.
    Redirected,
    /// Answers of a web server that is no camera.
    Page,
}

/// Differences of a device from others.
#[derive(Clone, Debug, Default)]
pub struct Oddities {
    /// The login that it wants.
    pub wanted: Wanted,
    /// Answers to questions.
    pub answers: Answers,
    /// Seconds by which its clock is ahead.
    pub ahead_secs: i64,
    /// Prefix of its elements' names in place of the usual ones.
    pub prefix: Option<&'static str>,
    /// Host and port that it tells in place of its own.
    pub told_authority: Option<&'static str>,
    /// User and password that it tells in its streams' URLs.
    pub told_login: Option<&'static str>,
    /// Does not know the second media service.
    pub is_old: bool,
    /// Does not know `GetServices` either.
    pub is_very_old: bool,
    /// Refuses to tell even its clock without a login.
    pub hides_clock: bool,
    /// Answers to a probe, before its own.
    pub before_own: Vec<Vec<u8>>,
}

/// A running device; what it serves ends with the process.
pub struct OnvifDevice {
    address: SocketAddr,
    probed: SocketAddr,
    asked: Arc<Mutex<Vec<String>>>,
}

impl OnvifDevice {
    /// Starts a device on loopback.
    pub fn start(oddities: Oddities) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let (address, probed) = (listener.local_addr().unwrap(), socket.local_addr().unwrap());
        let asked: Arc<Mutex<Vec<String>>> = Arc::default();
        let authority = oddities.told_authority.map_or_else(|| address.to_string(), str::to_owned);
        let device = Arc::new(Device {
            oddities,
            authority,
            asked: Arc::clone(&asked),
            seen: Mutex::default(),
            clock: SystemClock::new(),
        });
        let prober = Arc::clone(&device);
        let named = |name: &str| std::thread::Builder::new().name(name.to_owned());
        named("onvif-probed").spawn(move || prober.answer_probes(&socket)).unwrap();
        let serve = move || {
            for stream in listener.incoming() {
                let (stream, device) = (stream.unwrap(), Arc::clone(&device));
                let answer = move || device.answer(stream).unwrap_or_default();
                std::thread::Builder::new().name("onvif".to_owned()).spawn(answer).unwrap();
            }
        };
        named("onvif-device").spawn(serve).unwrap();
        Self { address, probed, asked }
    }

    /// Returns where it is asked, as host and port.
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Returns where it listens for probes.
    pub const fn probed(&self) -> SocketAddr {
        self.probed
    }

    /// Returns the questions so far: each operation, and the way in which its asker logged in.
    pub fn asked(&self) -> Vec<String> {
        self.asked.lock().unwrap().clone()
    }
}

struct Device {
    oddities: Oddities,
    /// Host and port that it tells.
    authority: String,
    asked: Arc<Mutex<Vec<String>>>,
    /// Nonces that were used.
    seen: Mutex<HashSet<String>>,
    clock: SystemClock,
}

/// A question as it came.
struct Question {
    path: String,
    authorization: String,
    body: String,
}

impl Device {
    fn answer_probes(&self, socket: &UdpSocket) {
        let mut bytes = [0; 4096];
        while let Ok((n_bytes, from)) = socket.recv_from(&mut bytes) {
            let text = String::from_utf8_lossy(&bytes[..n_bytes]).into_owned();
            if !text.contains("NetworkVideoTransmitter") {
                continue;
            }
            let relates = between(&text, "<a:MessageID>", "</a:MessageID>").unwrap_or_default();
            let body = format!(
                "<d:ProbeMatches xmlns:d=\"http://schemas.xmlsoap.org/ws/2005/04/discovery\" \
                 xmlns:a=\"http://schemas.xmlsoap.org/ws/2004/08/addressing\"><d:ProbeMatch><a:EndpointReference>\
                 <a:Address>urn:uuid:5f5a69c2-e0ae-504f-829b-00fcec000001</a:Address></a:EndpointReference>\
                 <d:Types>dn:NetworkVideoTransmitter</d:Types><d:Scopes>onvif://www.onvif.org/Profile/Streaming \
                 onvif://www.onvif.org/name/North%20gate onvif://www.onvif.org/hardware/XN-7</d:Scopes>\
                 <d:XAddrs>http://{}/onvif/device_service</d:XAddrs><d:MetadataVersion>1</d:MetadataVersion>\
                 </d:ProbeMatch></d:ProbeMatches><!-- {relates} -->",
                self.authority
            );
            for odd in &self.oddities.before_own {
                socket.send_to(odd, from).unwrap();
            }
            // Twice, as devices with two network interfaces do.
            for _ in 0..2 {
                socket.send_to(self.envelope(&body).as_bytes(), from).unwrap();
            }
        }
    }

    fn envelope(&self, body: &str) -> String {
        let whole = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<SOAP-ENV:Envelope \
             xmlns:SOAP-ENV=\"http://www.w3.org/2003/05/soap-envelope\"><SOAP-ENV:Body>{body}</SOAP-ENV:Body>\
             </SOAP-ENV:Envelope>\n"
        );
        match self.oddities.prefix {
            Some(prefix) => {
                ["tds", "trt", "tr2", "tt", "SOAP-ENV"].iter().enumerate().fold(whole, |text, (n, usual)| {
                    let other = format!("{prefix}{n}");
                    text.replace(&format!("{usual}:"), &format!("{other}:"))
                        .replace(&format!("xmlns:{usual}="), &format!("xmlns:{other}="))
                })
            }
            None => whole,
        }
    }

    fn answer(&self, mut stream: TcpStream) -> std::io::Result<()> {
        let question = read(&stream)?;
        let operation = operation(&question.body);
        let way = match (question.authorization.split(' ').next(), question.body.contains("UsernameToken")) {
            (Some(scheme), false) if !scheme.is_empty() => scheme.to_owned(),
            (_, true) => "token".to_owned(),
            _ => "nobody".to_owned(),
        };
        self.asked.lock().unwrap().push(format!("{operation} {way} {}", question.path));
        match self.oddities.answers {
            Answers::Never => std::thread::park(),
            Answers::Huge => {
                let text = self.envelope(&format!("<tds:{operation}Response>{}", " ".repeat(4 << 20)));
                return send(&mut stream, "200 OK", "", &text);
            }
            Answers::Entities => {
                let bomb = "<?xml version='1.0'?><!DOCTYPE b [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;&a;&a;'>]><b>&b;</b>";
                return send(&mut stream, "200 OK", "", bomb);
            }
            Answers::Redirected => {
                return send(&mut stream, "302 Found", "Location: http://127.0.0.1:9/\r\n", "");
            }
            Answers::Page => {
                return send(&mut stream, "404 Not Found", "", "<html><body>nothing here<br></body></html>");
            }
            Answers::Well => {}
        }
        let is_open = operation == "GetSystemDateAndTime" && !self.oddities.hides_clock;
        if !is_open && !self.knows(&question) {
            let (status, head) = match self.oddities.wanted {
                Wanted::Digest => ("401 Unauthorized", format!("WWW-Authenticate: {CHALLENGE}\r\n")),
                Wanted::Basic => {
                    ("401 Unauthorized", "WWW-Authenticate: Basic realm=\"digest\"\r\n".to_owned())
                }
                _ => ("400 Bad Request", String::new()),
            };
            return send(&mut stream, status, &head, &self.fault("ter:NotAuthorized"));
        }
        match self.told(&operation, &question) {
            Some(body) => send(&mut stream, "200 OK", "", &self.envelope(&body)),
            None => send(&mut stream, "500 Internal Server Error", "", &self.fault("ter:ActionNotSupported")),
        }
    }

    fn fault(&self, code: &str) -> String {
        self.envelope(&format!(
            "<SOAP-ENV:Fault><SOAP-ENV:Code><SOAP-ENV:Value>SOAP-ENV:Sender</SOAP-ENV:Value><SOAP-ENV:Subcode>\
             <SOAP-ENV:Value>{code}</SOAP-ENV:Value></SOAP-ENV:Subcode></SOAP-ENV:Code><SOAP-ENV:Reason>\
             <SOAP-ENV:Text>no</SOAP-ENV:Text></SOAP-ENV:Reason></SOAP-ENV:Fault>"
        ))
    }

    fn now(&self) -> Timestamp {
        self.clock.now().saturating_add_nanos(self.oddities.ahead_secs * 1_000_000_000)
    }

    /// Returns whether a question comes from the user, in the way that is wanted.
    fn knows(&self, question: &Question) -> bool {
        match self.oddities.wanted {
            Wanted::Nothing => true,
            Wanted::Basic => {
                question.authorization == format!("Basic {}", STANDARD.encode(format!("{USER}:{PASSWORD}")))
            }
            Wanted::Digest => {
                let mut client =
                    DigestClient::try_from(&http_auth::parse_challenges(CHALLENGE).unwrap()[0]).unwrap();
                let uri = question.path.as_str();
                let params =
                    PasswordParams { username: USER, password: PASSWORD, uri, method: "POST", body: None };
                client.respond(&params).unwrap() == question.authorization
            }
            Wanted::Token => self.has_token(&question.body).unwrap_or(false),
        }
    }

    fn has_token(&self, body: &str) -> Option<bool> {
        let part = |name: &str| {
            let start = body.find(name)?;
            Some(between(&body[start..], ">", "<")?.to_owned())
        };
        let (nonce, created) = (part("<o:Nonce ")?, part("<Created ")?);
        let mut hash = Sha1::new();
        hash.update(STANDARD.decode(&nonce).ok()?);
        hash.update(&created);
        hash.update(PASSWORD);
        let is_right =
            part("<o:Password ")? == STANDARD.encode(hash.finalize()) && part("<o:Username>")? == USER;
        let age_secs = self.now().secs_since(created.parse().ok()?);
        Some(is_right && age_secs.abs() <= TOKEN_SECS && self.seen.lock().unwrap().insert(nonce))
    }

    /// Returns the answer to a question; none where the device does not know the operation.
    fn told(&self, operation: &str, question: &Question) -> Option<String> {
        let Oddities { is_old, is_very_old, .. } = self.oddities;
        let is_second = is_of_second(&question.body);
        let (device, media) =
            ("http://www.onvif.org/ver10/device/wsdl", "http://www.onvif.org/ver10/media/wsdl");
        let second = "http://www.onvif.org/ver20/media/wsdl";
        let service = |namespace: &str, path: &str| {
            let place = format!("http://{}/onvif/{path}", self.authority);
            format!(
                "<tds:Service><tds:Namespace>{namespace}</tds:Namespace><tds:XAddr>{place}</tds:XAddr></tds:Service>"
            )
        };
        let inner = match operation {
            "GetSystemDateAndTime" => self.time(),
            "GetDeviceInformation" => {
                "<tds:Manufacturer>Cameras &amp; Sons</tds:Manufacturer><tds:Model>XN-7</tds:Model>"
                    .to_owned()
            }
            "GetServices" if !is_very_old => {
                let newer = if is_old { String::new() } else { service(second, "media2") };
                [service(device, "device_service"), service(media, "media"), newer].concat()
            }
            "GetCapabilities" => format!(
                "<tds:Capabilities><tt:Media xmlns:tt=\"urn:tt\"><tt:XAddr>http://{}/onvif/media</tt:XAddr></tt:Media></tds:Capabilities>",
                self.authority
            ),
            "GetProfiles" if is_second && !is_old => {
                profile_2("main", "H265", [3840, 2160], 20) + &profile_2("sub", "H264", [640, 360], 10)
            }
            "GetProfiles" if !is_second => {
                profile("main", "H264", [1920, 1080], 25) + &profile("sub", "JPEG", [640, 360], 5)
            }
            "GetStreamUri" => self.stream(&question.body)?,
            _ => return None,
        };
        let (prefix, namespace) = match (is_second, question.body.contains(media)) {
            (true, _) => ("tr2", second),
            (_, true) => ("trt", media),
            _ => ("tds", device),
        };
        Some(format!(
            "<{prefix}:{operation}Response xmlns:{prefix}=\"{namespace}\">{inner}</{prefix}:{operation}Response>"
        ))
    }

    fn time(&self) -> String {
        let text = self.now().to_string();
        let number = |from: usize, to: usize| text[from..to].parse::<u32>().unwrap();
        format!(
            "<tds:SystemDateAndTime xmlns:tt=\"http://www.onvif.org/ver10/schema\"><tt:UTCDateTime><tt:Time><tt:Hour>{}</tt:Hour>\
             <tt:Minute>{}</tt:Minute><tt:Second>{}</tt:Second></tt:Time><tt:Date><tt:Year>{}</tt:Year><tt:Month>{}</tt:Month>\
             <tt:Day>{}</tt:Day></tt:Date></tt:UTCDateTime></tds:SystemDateAndTime>",
            number(11, 13),
            number(14, 16),
            number(17, 19),
            number(0, 4),
            number(5, 7),
            number(8, 10)
        )
    }

    fn stream(&self, body: &str) -> Option<String> {
        let token = between(body, "<q:ProfileToken>", "</q:ProfileToken>")?;
        let login = self.oddities.told_login.map(|login| format!("{login}@")).unwrap_or_default();
        let host = self.authority.rsplit_once(':').map_or(self.authority.as_str(), |(host, _port)| host);
        let url = format!("rtsp://{login}{host}:8554/live/{token}?a=1&amp;b=2");
        Some(if is_of_second(body) {
            format!("<tr2:Uri>{url}</tr2:Uri>")
        } else {
            format!("<trt:MediaUri><tt:Uri xmlns:tt=\"urn:tt\">{url}</tt:Uri></trt:MediaUri>")
        })
    }
}

/// Returns true where a question is one to the second media service.
fn is_of_second(body: &str) -> bool {
    body.contains("/ver20/media/wsdl")
}

fn profile(token: &str, encoding: &str, [width, height]: [u32; 2], rate: u32) -> String {
    format!(
        "<trt:Profiles token=\"{token}\" xmlns:tt=\"urn:tt\"><tt:Name>The {token}</tt:Name><tt:VideoEncoderConfiguration>\
         <tt:Encoding>{encoding}</tt:Encoding><tt:Resolution><tt:Width>{width}</tt:Width><tt:Height>{height}</tt:Height></tt:Resolution>\
         <tt:RateControl><tt:FrameRateLimit>{rate}</tt:FrameRateLimit></tt:RateControl></tt:VideoEncoderConfiguration></trt:Profiles>"
    )
}

fn profile_2(token: &str, encoding: &str, [width, height]: [u32; 2], rate: u32) -> String {
    format!(
        "<tr2:Profiles token=\"{token}\" xmlns:tt=\"urn:tt\"><tr2:Name>The {token}</tr2:Name><tr2:Configurations><tr2:VideoEncoder>\
         <tt:Encoding>{encoding}</tt:Encoding><tt:Resolution><tt:Width>{width}</tt:Width><tt:Height>{height}</tt:Height></tt:Resolution>\
         <tt:RateControl><tt:FrameRateLimit>{rate}.0</tt:FrameRateLimit></tt:RateControl></tr2:VideoEncoder></tr2:Configurations>\
         </tr2:Profiles>"
    )
}

fn read(stream: &TcpStream) -> std::io::Result<Question> {
    stream.set_read_timeout(Some(Duration::from_secs(5)))?;
    let mut reader = BufReader::new(stream);
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") && reader.read_line(&mut head)? > 0 {}
    let field = |name: &str| {
        let of = |line: &str| {
            let (found, value) = line.split_once(':')?;
            found.eq_ignore_ascii_case(name).then(|| value.trim().to_owned())
        };
        head.lines().find_map(of).unwrap_or_default()
    };
    let mut body = vec![0; field("content-length").parse().unwrap_or(0)];
    reader.read_exact(&mut body)?;
    let path = head.split(' ').nth(1).unwrap_or_default().to_owned();
    let body = String::from_utf8_lossy(&body).into_owned();
    Ok(Question { path, authorization: field("authorization"), body })
}

fn operation(body: &str) -> String {
    let start = body.find("<s:Body><q:").map_or(body.len(), |at| at + "<s:Body><q:".len());
    body[start..].chars().take_while(char::is_ascii_alphanumeric).collect()
}

fn send(stream: &mut TcpStream, status: &str, fields: &str, body: &str) -> std::io::Result<()> {
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\n{fields}Content-Type: application/soap+xml\r\nContent-Length: {length}\r\n\r\n"
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body.as_bytes())
}

fn between<'a>(text: &'a str, before: &str, behind: &str) -> Option<&'a str> {
    let rest = &text[text.find(before)? + before.len()..];
    Some(&rest[..rest.find(behind)?])
}
