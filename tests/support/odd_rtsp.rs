//! An RTSP camera that behaves as some do and no server of a library would: one thread a connection, H.264 over TCP and UDP.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use crate::video::start_numbered;
use gstreamer as gst;
use gstreamer::prelude::*;
use gstreamer_app as gst_app;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use videofields_vision::clock::{Clock, SystemClock};

/// Pictures between two key frames.
const GROUP: usize = 5;

/// Pictures that are sent over and over, two groups; those of an encrypted camera show their numbers, from 0 on.
pub const ODD_PICTURES: u64 = 2 * GROUP as u64;

/// Time between two pictures.
const INTERVAL: Duration = Duration::from_millis(40);

/// Time by which late pictures come late.
const LATE: Duration = Duration::from_millis(300);

/// Reactions of a camera to `GET_PARAMETER`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Parameter {
    /// An answer.
    #[default]
    Answered,
    /// An answer that it does not know that.
    Unknown,
    /// No answer.
    Silent,
    /// The end of the connection.
    Closes,
}

/// Status of an answer to a transport that is not there.
pub const UNSUPPORTED_TRANSPORT: &str = "461 Unsupported Transport";

/// Reaction of a camera to a client that asks for its stream over TCP.
#[derive(Clone, Copy, Debug, Default)]
pub enum OverTcp {
    /// Gives it.
    #[default]
    Given,
    /// Refuses with this status.
    Refused(&'static str),
    /// Refuses with this status, and ends the connection with the next request.
    RefusedAndClosed(&'static str),
    /// Answers with ports of UDP.
    AnsweredByUdp,
    /// Answers with ports of UDP, and gives it.
    GivenLoosely,
    /// Says that it gives it, and sends nothing.
    Silent,
}

/// Differences of a camera from others.
#[derive(Clone, Debug, Default)]
pub struct Oddities {
    /// Gives each group of pictures another SSRC.
    pub ssrc_each_group: bool,
    /// Number of packets at the beginning with another SSRC.
    pub n_first_ssrc: usize,
    /// A session ends after so many seconds without a request.
    pub timeout_secs: Option<u64>,
    /// Reaction to `GET_PARAMETER`.
    pub parameter: Parameter,
    /// The methods that it names.
    pub methods: Option<&'static str>,
    /// Challenges with which it asks for a login, which is checked only as far as it is there.
    pub challenges: Vec<&'static str>,
    /// Lets in whoever brings a login.
    pub lets_in: bool,
    /// Challenge with which it answers signs of life until they bring its nonce, `late`.
    pub late_challenge: Option<&'static str>,
    /// Reaction to a client that asks for its stream over TCP.
    pub over_tcp: OverTcp,
    /// Gives its stream over TCP alone.
    pub is_tcp_only: bool,
    /// Bytes that it sends between packets, every so many packets.
    pub garbage: Option<(usize, &'static [u8])>,
    /// Number of packets of which one lacks its last byte.
    pub cut_each: Option<usize>,
    /// Number of pictures of which one comes late, with two packets that changed places.
    pub late_each: Option<usize>,
    /// Ends each connection after so many pictures.
    pub ends_after: Option<usize>,
    /// Ends its lines with LF alone.
    pub has_bare_lines: bool,
    /// Description of its streams in place of H.264.
    pub description: Option<&'static str>,
}

/// A connection, encrypted or not.
trait Bytes: Read + Write + Send {}
impl<S: Read + Write + Send> Bytes for S {}

/// A packet as it came from a payloader, and the picture that it belongs to.
type Packets = Arc<Vec<(usize, Vec<u8>)>>;

/// A running camera; connections that it has end with the process.
pub struct OddCamera {
    address: SocketAddr,
    scheme: &'static str,
    requests: Arc<Mutex<Vec<String>>>,
}

impl OddCamera {
    /// Starts a camera on loopback.
    pub fn start(oddities: Oddities) -> Self {
        Self::listen(oddities, ("rtsp", &ball()), |stream| Box::new(stream))
    }

    /// Starts a camera whose connections are encrypted, and whose pictures show their numbers.
    pub fn encrypted(config: &Arc<rustls::ServerConfig>, oddities: Oddities) -> Self {
        let config = Arc::clone(config);
        let numbered = start_numbered((ODD_PICTURES, 25), (320, 240), &packing());
        Self::listen(oddities, ("rtsps", &numbered), move |stream| {
            let connection = rustls::ServerConnection::new(Arc::clone(&config)).unwrap();
            Box::new(rustls::StreamOwned::new(connection, stream))
        })
    }

    fn listen(
        oddities: Oddities,
        (scheme, pictures): (&'static str, &gst::Pipeline),
        wrap: impl Fn(TcpStream) -> Box<dyn Bytes> + Send + 'static,
    ) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let requests: Arc<Mutex<Vec<String>>> = Arc::default();
        let (kept, packets) = (Arc::clone(&requests), Arc::new(packets(pictures)));
        let serve = move || {
            for stream in listener.incoming() {
                let stream = stream.unwrap();
                stream.set_read_timeout(Some(Duration::from_millis(2))).unwrap();
                let connection = Connection {
                    stream: wrap(stream),
                    oddities: oddities.clone(),
                    requests: Arc::clone(&kept),
                    packets: Arc::clone(&packets),
                    peer: None,
                    is_closing: false,
                };
                std::thread::Builder::new().name("odd".to_owned()).spawn(move || connection.serve()).unwrap();
            }
        };
        std::thread::Builder::new().name("odd-camera".to_owned()).spawn(serve).unwrap();
        Self { address, scheme, requests }
    }

    /// The stream's URL.
    pub fn url(&self) -> String {
        format!("{}://localhost:{}/odd", self.scheme, self.address.port())
    }

    /// The heads of all requests that came.
    pub fn requests(&self) -> Vec<String> {
        self.requests.lock().unwrap().clone()
    }
}

/// Fate of pictures that are sent.
fn packing() -> String {
    format!(
        "x264enc tune=zerolatency key-int-max={GROUP} threads=1 ! rtph264pay pt=96 config-interval=-1 mtu=600 ! \
         appsink name=out sync=false max-buffers=0"
    )
}

/// Starts to make two groups of pictures of a ball.
fn ball() -> gst::Pipeline {
    gst::init().unwrap();
    let description = format!(
        "videotestsrc num-buffers={ODD_PICTURES} pattern=ball ! video/x-raw,format=I420,width=320,height=240,framerate=25/1 ! {}",
        packing()
    );
    let pipeline = gst::parse::launch(&description).unwrap().downcast::<gst::Pipeline>().unwrap();
    pipeline.set_state(gst::State::Playing).unwrap();
    pipeline
}

/// Takes two groups of pictures as RTP packets.
fn packets(pipeline: &gst::Pipeline) -> Vec<(usize, Vec<u8>)> {
    let sink = pipeline.by_name("out").unwrap().downcast::<gst_app::AppSink>().unwrap();
    let (mut found, mut n_pictures): (Vec<(usize, Vec<u8>)>, usize) = (Vec::new(), 0);
    let mut keep = |buffer: &gst::BufferRef| {
        let bytes = buffer.map_readable().unwrap().to_vec();
        let has_marker = bytes[1] & 128 != 0;
        found.push((n_pictures, bytes));
        n_pictures += usize::from(has_marker);
    };
    while let Ok(sample) = sink.pull_sample() {
        match sample.buffer_list() {
            Some(list) => list.iter().for_each(&mut keep),
            None => keep(sample.buffer().unwrap()),
        }
    }
    pipeline.set_state(gst::State::Null).unwrap();
    assert_eq!(found.last().map(|(picture, _)| *picture), Some(2 * GROUP - 1));
    found
}

struct Connection {
    stream: Box<dyn Bytes>,
    oddities: Oddities,
    requests: Arc<Mutex<Vec<String>>>,
    packets: Packets,
    /// Place of packets that do not go through the connection.
    peer: Option<(UdpSocket, SocketAddr)>,
    /// True where it ends with the next request for a transport.
    is_closing: bool,
}

impl Connection {
    fn serve(mut self) {
        let mut unread = Vec::new();
        let mut player: Option<Player> = None;
        let clock = SystemClock::new();
        let mut asked = clock.monotonic();
        loop {
            if let Some(player) = &mut player
                && player.play(&mut self, clock.monotonic()).is_err()
            {
                return;
            }
            let limit = self.oddities.timeout_secs.filter(|_| player.is_some());
            if limit.is_some_and(|secs| clock.monotonic() > asked + Duration::from_secs(secs)) {
                return;
            }
            let mut bytes = [0; 4096];
            match self.stream.read(&mut bytes) {
                Ok(0) => return,
                Ok(n) => unread.extend_from_slice(&bytes[..n]),
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => continue,
                Err(_closed) => return,
            }
            // Reports come between requests.
            while unread.first() == Some(&b'$') && unread.len() >= 4 {
                let n = 4 + usize::from(u16::from_be_bytes([unread[2], unread[3]]));
                if unread.len() < n {
                    break;
                }
                unread.drain(..n);
            }
            let Some(end) = unread.windows(4).position(|bytes| bytes == b"\r\n\r\n") else { continue };
            let head = String::from_utf8(unread.drain(..end + 4).collect()).unwrap();
            asked = clock.monotonic();
            self.requests.lock().unwrap().push(head.clone());
            if self.answer(&head).is_err() {
                return;
            }
            if head.starts_with("PLAY") && player.is_none() && self.is_let_in(&head) {
                player = Some(Player { next: 0, number: 900, due: clock.monotonic() });
            }
        }
    }

    fn is_let_in(&self, head: &str) -> bool {
        self.oddities.challenges.is_empty() || self.oddities.lets_in && head.contains("Authorization:")
    }

    fn answer(&mut self, head: &str) -> std::io::Result<()> {
        let header = |name: &str| {
            head.lines().find_map(|line| line.strip_prefix(name)).map(|value| value.trim().to_owned())
        };
        let method = head.split(' ').next().unwrap();
        let timeout = self.oddities.timeout_secs.map_or(String::new(), |secs| format!(";timeout={secs}"));
        let mut lines = vec![format!("CSeq: {}", header("CSeq:").unwrap()), format!("Session: 77{timeout}")];
        let mut body = String::new();
        let mut status = "200 OK";
        let is_late = method == "GET_PARAMETER" && !head.contains("nonce=\"late\"");
        let late = self.oddities.late_challenge.filter(|_| is_late);
        if method != "OPTIONS" && (late.is_some() || !self.is_let_in(head)) {
            status = "401 Unauthorized";
            let ask = |challenge: &&str| format!("WWW-Authenticate: {challenge}");
            lines.extend(late.as_ref().into_iter().chain(self.oddities.challenges.iter()).map(ask));
        } else {
            match method {
                "OPTIONS" => lines.extend(self.oddities.methods.map(|methods| format!("Public: {methods}"))),
                "DESCRIBE" => {
                    let media = self.oddities.description.unwrap_or(
                        "m=video 0 RTP/AVP 96\r\na=rtpmap:96 H264/90000\r\na=fmtp:96 packetization-mode=1\r\na=control:track1\r\n",
                    );
                    body = format!("v=0\r\no=- 1 1 IN IP4 0.0.0.0\r\ns=odd\r\nt=0 0\r\n{media}");
                    lines.push("Content-Type: application/sdp".to_owned());
                    lines.push(format!("Content-Length: {}", body.len()));
                }
                "SETUP" => {
                    let wish = header("Transport:").unwrap();
                    if self.is_closing {
                        return Err(std::io::ErrorKind::BrokenPipe.into());
                    }
                    self.is_closing = matches!(self.oddities.over_tcp, OverTcp::RefusedAndClosed(_))
                        && wish.contains("TCP");
                    match self.set_up(&wish) {
                        Ok(transport) => lines.push(format!("Transport: {transport}")),
                        Err(refusal) => status = refusal,
                    }
                }
                "GET_PARAMETER" => match self.oddities.parameter {
                    Parameter::Answered => {}
                    Parameter::Unknown => status = "501 Not Implemented",
                    Parameter::Silent => return Ok(()),
                    Parameter::Closes => return Err(std::io::ErrorKind::BrokenPipe.into()),
                },
                _ => {}
            }
        }
        lines.insert(0, format!("RTSP/1.0 {status}"));
        let line_end = if self.oddities.has_bare_lines { "\n" } else { "\r\n" };
        let text = lines.join(line_end) + line_end + line_end + &body;
        self.stream.write_all(text.as_bytes())
    }

    /// Returns how the stream is given to who wishes for it so, or the status of a refusal.
    fn set_up(&mut self, wish: &str) -> Result<String, &'static str> {
        let Some((_, ports)) = wish.split_once("client_port=") else {
            self.peer = None;
            return match self.oddities.over_tcp {
                OverTcp::Given | OverTcp::Silent => Ok("RTP/AVP/TCP;unicast;interleaved=0-1".to_owned()),
                OverTcp::Refused(status) | OverTcp::RefusedAndClosed(status) => Err(status),
                OverTcp::AnsweredByUdp | OverTcp::GivenLoosely => {
                    Ok("RTP/AVP;unicast;client_port=0-0;server_port=40000-40001".to_owned())
                }
            };
        };
        if self.oddities.is_tcp_only {
            return Err(UNSUPPORTED_TRANSPORT);
        }
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let port: u16 = ports.split('-').next().unwrap().parse().unwrap();
        let own_port = socket.local_addr().unwrap().port();
        self.peer = Some((socket, ([127, 0, 0, 1], port).into()));
        Ok(format!("RTP/AVP;unicast;client_port={ports};server_port={own_port}-{}", own_port + 1))
    }

    fn send(&mut self, packet: &[u8]) -> std::io::Result<()> {
        if let Some((socket, peer)) = &self.peer {
            return socket.send_to(packet, peer).map(|_n_bytes| ());
        }
        if matches!(self.oddities.over_tcp, OverTcp::Silent | OverTcp::AnsweredByUdp) {
            return Ok(());
        }
        let length = packet.len() as u16;
        self.stream.write_all(&[&[b'$', 0][..], &length.to_be_bytes(), packet].concat())
    }
}

/// Place of a connection in its stream.
struct Player {
    /// The picture that comes next, counted from the first.
    next: usize,
    /// The next packet's number.
    number: u16,
    due: Duration,
}

impl Player {
    /// Sends the pictures that are due.
    fn play(&mut self, connection: &mut Connection, now: Duration) -> std::io::Result<()> {
        let packets = Arc::clone(&connection.packets);
        while self.due <= now {
            if connection.oddities.ends_after == Some(self.next) {
                return Err(std::io::ErrorKind::ConnectionReset.into());
            }
            let picture = self.next % (2 * GROUP);
            let mut own = packets.iter().filter(|(of, _)| *of == picture).map(|(_, packet)| packet.clone());
            let is_late = connection.oddities.late_each.is_some_and(|each| self.next % each == each - 1);
            if is_late {
                std::thread::sleep(LATE);
                let (first, second) =
                    (own.next().unwrap(), own.next().expect("pictures have several packets"));
                self.number += 1;
                self.send(connection, second)?;
                self.number -= 2;
                self.send(connection, first)?;
                self.number += 1;
            }
            for packet in own {
                self.send(connection, packet)?;
            }
            self.next += 1;
            self.due += INTERVAL;
        }
        Ok(())
    }

    fn send(&mut self, connection: &mut Connection, mut packet: Vec<u8>) -> std::io::Result<()> {
        let oddities = connection.oddities.clone();
        let n_sent = usize::from(self.number - 900);
        let mut ssrc = 0x1111_1111_u32;
        if oddities.ssrc_each_group {
            ssrc += (self.next / GROUP) as u32;
        }
        if n_sent < oddities.n_first_ssrc {
            ssrc = !ssrc;
        }
        packet[2..4].copy_from_slice(&self.number.to_be_bytes());
        packet[4..8].copy_from_slice(&(self.next as u32 * 3600).to_be_bytes());
        packet[8..12].copy_from_slice(&ssrc.to_be_bytes());
        self.number += 1;
        let is_nth = |n: usize| n_sent % n == n - 1;
        if let Some((each, garbage)) = oddities.garbage
            && is_nth(each)
        {
            connection.stream.write_all(garbage)?;
        }
        if oddities.cut_each.is_some_and(is_nth) {
            let length = packet.len() as u16;
            let bytes = [&[b'$', 0][..], &length.to_be_bytes(), &packet[..packet.len() - 1]].concat();
            return connection.stream.write_all(&bytes);
        }
        connection.send(&packet)
    }
}
