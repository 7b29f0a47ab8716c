//! One connection to an RTSP camera, from its first request to its end (RFC 2326).
//!
//! Requests go out one after the other, each waits for its answer; packets that come meanwhile are passed on. Signs of life go
//! out at two thirds of the time after which the camera would give the session up, whatever comes in.

use super::description::{Stream, base, first_video, missing_reader};
use super::message::{Piece, Reader, Response, Unreadable};
use super::packets::{Kind, sign_of_life, unify};
use super::{DATAGRAM_ORDER_TIME, ORDER_TIME, Sinks, Target, transport};
use crate::media::client::{ANSWER_TIME, Bytes, USER_AGENT, connect, expect_success};
use crate::media::fault::{ConnectionFault, Fault};
use crate::media::login::Answering;
use std::collections::BTreeSet;
use std::net::{IpAddr, SocketAddr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::UdpSocket;
use tokio::time::{Instant, sleep, sleep_until, timeout};
use videofields_vision::config::Transport;

/// Time for a camera to answer that it ends a session.
const END_TIME: Duration = Duration::from_millis(300);

/// Time after which a session without a sign of life ends, where the camera names none.
const USUAL_TIMEOUT: Duration = Duration::from_secs(60);

/// Time between two reports, which some cameras take for signs of life.
const REPORT_TIME: Duration = Duration::from_secs(5);

/// Status of an answer to a request without a login, or with another than is wanted.
const UNAUTHORIZED: u16 = 401;

/// Status of an answer for a session that the camera does not know any more.
const SESSION_NOT_FOUND: u16 = 454;

/// Time without any packet after which a transport is taken for one that gives nothing.
const SILENT_TIME: Duration = Duration::from_secs(4);

/// Bytes that are read at once.
const CHUNK_BYTES: usize = 64 << 10;

/// Most bytes of a packet over UDP.
const PACKET_BYTES: usize = 64 << 10;

/// Cameras that end the connection upon `GET_PARAMETER`, by scheme, host and port.
static ASKED_BY_OPTIONS: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Most cameras that are remembered so.
const MAX_ASKED_BY_OPTIONS: usize = 1024;

/// Ways on which packets come.
enum Way {
    /// Packets come within the connection.
    Tcp,
    /// Datagrams of their own; the second socket is the reports'.
    Udp { packets: UdpSocket, reports: UdpSocket, report_to: Option<SocketAddr> },
}

pub(super) struct Session<'a> {
    target: &'a Target,
    sinks: &'a Sinks,
    stream: Box<dyn Bytes>,
    reader: Reader,
    answering: Answering,
    next_number: u32,
    id: Option<String>,
    timeout: Duration,
    /// Methods that the camera says it has.
    methods: Option<String>,
    payload_type: Option<u8>,
    /// Transport over which the camera said that it plays, and when.
    played: Option<(Transport, Instant)>,
    /// True once any packet came.
    has_packet: AtomicBool,
    is_answered_otherwise: bool,
}

impl Drop for Session<'_> {
    /// Remembers what came over the transport, whoever ended the session.
    fn drop(&mut self) {
        let Some((transport, at)) = self.played else { return };
        let Target { peer, transport: wished, .. } = self.target;
        if *self.has_packet.get_mut() {
            transport::remember_packets(*wished, &peer.url, transport);
        } else if at.elapsed() > SILENT_TIME {
            self.remember_silence(transport);
        }
    }
}

/// A sign of life that was not answered yet.
struct Asked {
    number: u32,
    is_parameter: bool,
    at: Instant,
}

impl<'a> Session<'a> {
    /// Connects.
    ///
    /// # Errors
    /// When the camera is not reached, or does not prove its name.
    pub(super) async fn connect(target: &'a Target, sinks: &'a Sinks) -> Result<Self, Fault> {
        let stream = connect(&target.peer).await?;
        Ok(Self {
            target,
            sinks,
            stream,
            reader: Reader::default(),
            answering: Answering::new(target.login.clone()),
            next_number: 1,
            id: None,
            timeout: USUAL_TIMEOUT,
            methods: None,
            payload_type: None,
            played: None,
            has_packet: AtomicBool::new(false),
            is_answered_otherwise: false,
        })
    }

    /// Plays until the connection ends.
    ///
    /// # Errors
    /// Always: why it ended.
    pub(super) async fn play(&mut self) -> Result<std::convert::Infallible, Fault> {
        let url = self.target.peer.url.clone();
        let options = self.request("OPTIONS", &url, &[]).await?;
        self.methods = options.header("public").map(str::to_ascii_uppercase);
        let described = self.request("DESCRIBE", &url, &[("Accept", "application/sdp")]).await?;
        expect_success(described.status)?;
        let base = base([described.header("content-base"), described.header("content-location")], &url);
        let stream = first_video(&described.body, &base)?;
        if let Some(fault) = missing_reader(&stream.caps) {
            return Err(fault);
        }
        self.payload_type = Some(stream.payload_type);
        let way = self.set_up(&stream).await?;
        self.sinks.begin(&stream.caps);
        let played = self.request("PLAY", &stream.session, &[("Range", "npt=0.000-")]).await?;
        expect_success(played.status)?;
        let transport = if matches!(way, Way::Tcp) { Transport::Tcp } else { Transport::Udp };
        self.played = Some((transport, Instant::now()));
        self.follow(&stream, way).await
    }

    /// Ends the session, as far as the camera answers in time.
    pub(super) async fn end(&mut self) {
        if self.id.is_none() {
            return;
        }
        let url = self.target.peer.url.clone();
        let ended = timeout(END_TIME, self.request("TEARDOWN", &url, &[])).await;
        tracing::trace!(is_answered = ended.is_ok_and(|answer| answer.is_ok()), "a session is ended");
    }

    /// Returns true where the camera answered with another transport than it was asked for: over a new connection it is asked for that.
    pub(super) const fn is_answered_otherwise(&self) -> bool {
        self.is_answered_otherwise
    }

    /// Remembers a transport that gave nothing. Over an encrypted connection silence counts for nothing: somebody on the way may cause it,
    /// and the other way is not encrypted.
    fn remember_silence(&self, transport: Transport) {
        let Target { peer, transport: wished, .. } = self.target;
        if !peer.is_encrypted {
            transport::remember_silence(*wished, &peer.url, transport);
        }
    }

    /// Asks for the stream in the wished way, and in the other where the camera refuses that.
    async fn set_up(&mut self, stream: &Stream) -> Result<Way, Fault> {
        let mut refused = None;
        for way in transport::in_order(self.target.transport, &self.target.peer.url) {
            match self.set_up_over(way, stream, refused).await {
                Ok(Ok(way)) => return Ok(way),
                Ok(Err(status)) => {
                    tracing::info!(transport = ?way, status, "a camera refuses a transport");
                    refused.get_or_insert((way, status));
                }
                // It refused the other before, and may have ended the connection with that: what it said of it counts.
                Err(fault) => {
                    let Some((first, status)) = refused else { return Err(fault) };
                    self.remember_silence(first);
                    return Err(refusal(status));
                }
            }
        }
        Err(refused.map_or(Fault::Connection(ConnectionFault::NoTransport), |(_, status)| refusal(status)))
    }

    /// Asks for the stream over the transport `way`. Returns the camera's status where it refuses that one; `refused` is the other
    /// transport with its status, where the camera refused it before.
    async fn set_up_over(
        &mut self,
        way: Transport,
        stream: &Stream,
        refused: Option<(Transport, u16)>,
    ) -> Result<Result<Way, u16>, Fault> {
        let sockets = if way == Transport::Udp { Some(self.sockets().await?) } else { None };
        let wish = match &sockets {
            None => "RTP/AVP/TCP;unicast;interleaved=0-1".to_owned(),
            Some((_, _, port)) => format!("RTP/AVP;unicast;client_port={port}-{}", port + 1),
        };
        let answer = self.request("SETUP", &stream.control, &[("Transport", &wish)]).await?;
        if transport::is_refusal(&self.target.peer, answer.status) {
            return Ok(Err(answer.status));
        }
        expect_success(answer.status)?;
        self.take_session(&answer);
        let given = answer.header("transport").and_then(transport::named);
        let is_other = given.is_some_and(|given| given != way);
        // One that has no other way writes its answer loosely.
        let Target { peer, transport: wished, .. } = self.target;
        let is_loose = refused.is_some() || transport::is_proven(*wished, &peer.url, way);
        if is_other && !is_loose && !peer.is_encrypted {
            tracing::info!(asked = ?way, ?given, "a camera answers with another transport");
            self.is_answered_otherwise = true;
            self.remember_silence(way);
            return Err(Fault::Connection(ConnectionFault::NoTransport));
        }
        let Some((packets, reports, _)) = sockets else { return Ok(Ok(Way::Tcp)) };
        let ports = answer.header("transport").and_then(transport::server_ports);
        let peer = |port: u16| {
            let mut address = self.target.peer.address;
            address.set_port(port);
            address
        };
        if let Some((port, _)) = ports {
            // A firewall lets in what was asked for.
            let knock = packets.send_to(&sign_of_life(), peer(port)).await;
            tracing::trace!(?knock, "a camera's port is knocked at");
        }
        Ok(Ok(Way::Udp { packets, reports, report_to: ports.map(|(_, port)| peer(port)) }))
    }

    /// Binds two sockets side by side, the first at an even port.
    async fn sockets(&self) -> Result<(UdpSocket, UdpSocket, u16), Fault> {
        let any = match self.target.peer.address.ip() {
            IpAddr::V4(_) => IpAddr::from([0; 4]),
            IpAddr::V6(_) => IpAddr::from([0_u16; 8]),
        };
        for _ in 0..64 {
            let Ok(first) = UdpSocket::bind((any, 0)).await else { continue };
            let Ok(port) = first.local_addr().map(|address| address.port()) else { continue };
            if port % 2 == 1 || port == u16::MAX {
                continue;
            }
            if let Ok(second) = UdpSocket::bind((any, port + 1)).await {
                return Ok((first, second, port));
            }
        }
        Err(Fault::Connection(ConnectionFault::NoTransport))
    }

    fn take_session(&mut self, answer: &Response) {
        let Some(session) = answer.header("session") else { return };
        let mut parts = session.split(';').map(str::trim);
        self.id = parts.next().map(str::to_owned);
        let secs = parts.find_map(|part| part.strip_prefix("timeout=")?.trim().parse::<u64>().ok());
        if let Some(secs) = secs.filter(|secs| *secs > 0) {
            self.timeout = Duration::from_secs(secs.min(3600));
        }
    }

    /// Passes on packets, and keeps the session alive.
    async fn follow(&mut self, stream: &Stream, way: Way) -> Result<std::convert::Infallible, Fault> {
        let mut chunk = vec![0; CHUNK_BYTES];
        let mut datagrams = [vec![0; PACKET_BYTES], vec![0; PACKET_BYTES]];
        let order_time = match way {
            Way::Tcp => ORDER_TIME,
            Way::Udp { .. } => DATAGRAM_ORDER_TIME,
        };
        let alive_time = self.timeout * 2 / 3;
        let (mut alive_at, mut report_at) = (Instant::now() + alive_time, Instant::now() + REPORT_TIME);
        let mut has_parameter = self.has_parameter();
        let mut asked: Option<Asked> = None;
        loop {
            while let Some(piece) = self.next_piece()? {
                let Some(response) = self.take(piece).await? else { continue };
                let Some(answered) = asked.take_if(|asked| response.number() == Some(asked.number)) else {
                    continue;
                };
                if response.status == SESSION_NOT_FOUND {
                    return Err(Fault::Connection(ConnectionFault::Closed));
                }
                if response.status == UNAUTHORIZED {
                    // Its challenge has run out.
                    let challenges = response.headers("www-authenticate");
                    self.answering.challenge(challenges).map_err(Fault::Connection)?;
                    alive_at = Instant::now();
                    continue;
                }
                if response.is_success() {
                    self.answering.is_let_in();
                }
                // Whoever does not know the method is asked in the other way.
                has_parameter &= response.is_success() || !answered.is_parameter;
            }
            let (first, second, peer) = match &way {
                Way::Tcp => (None, None, None),
                Way::Udp { packets, reports, report_to } => (Some(packets), Some(reports), *report_to),
            };
            let [packet_bytes, report_bytes] = &mut datagrams;
            tokio::select! {
                n_bytes = self.stream.read(&mut chunk) => {
                    let n_bytes = n_bytes.unwrap_or(0);
                    if n_bytes == 0 {
                        self.remember_end(asked.as_ref());
                        self.take_rest();
                        return Err(Fault::Connection(ConnectionFault::Closed));
                    }
                    self.reader.push(&chunk[..n_bytes]);
                }
                packet = receive(first, packet_bytes), if first.is_some() => self.take_datagram(packet_bytes, packet),
                report = receive(second, report_bytes), if second.is_some() => self.take_datagram(report_bytes, report),
                () = sleep(order_time), if self.sinks.has_waiting() => self.sinks.flush(),
                () = sleep_until(alive_at) => {
                    alive_at = Instant::now() + alive_time;
                    let method = if has_parameter { "GET_PARAMETER" } else { "OPTIONS" };
                    let number = self.send(method, &stream.session, &[]).await?;
                    asked = Some(Asked { number, is_parameter: has_parameter, at: Instant::now() });
                }
                () = sleep_until(report_at) => {
                    report_at = Instant::now() + REPORT_TIME;
                    match (second, peer) {
                        (Some(socket), Some(peer)) => {
                            let sent = socket.send_to(&sign_of_life(), peer).await;
                            tracing::trace!(?sent, "a camera is told that somebody listens");
                        }
                        (None, _) => {
                            let report = sign_of_life();
                            let head = [b'$', 1, 0, report.len() as u8];
                            self.write(&[&head[..], &report].concat()).await?;
                        }
                        (Some(_), None) => {}
                    }
                }
            }
        }
    }

    /// Passes on the packets that were waited for the end of something else when the connection ended.
    fn take_rest(&mut self) {
        self.reader.end();
        while let Ok(Some(piece)) = self.next_piece() {
            if let Piece::Packet(packet) = piece {
                self.take_packet(packet);
            }
        }
    }

    /// Returns whether signs of life are `GET_PARAMETER`, which cameras take for one and do nothing else upon.
    fn has_parameter(&self) -> bool {
        let ends = ASKED_BY_OPTIONS.lock().unwrap_or_else(PoisonError::into_inner);
        !ends.contains(&self.target.peer.place)
            && self.methods.as_ref().is_none_or(|methods| methods.contains("GET_PARAMETER"))
    }

    /// Remembers that the camera ended the connection instead of answering a sign of life.
    fn remember_end(&self, asked: Option<&Asked>) {
        let is_answer = asked.is_some_and(|asked| asked.is_parameter && asked.at.elapsed() < ANSWER_TIME);
        let mut ends = ASKED_BY_OPTIONS.lock().unwrap_or_else(PoisonError::into_inner);
        if is_answer && ends.len() < MAX_ASKED_BY_OPTIONS {
            ends.insert(self.target.peer.place.clone());
        }
    }

    fn next_piece(&mut self) -> Result<Option<Piece>, Fault> {
        let n_before = self.reader.n_damaged();
        let piece = self.reader.next();
        // Pictures show the cost; the log says once why.
        if n_before == 0 && self.reader.n_damaged() > 0 {
            tracing::warn!("bytes are lost or added between a camera's packets");
        }
        piece.map_err(|Unreadable| Fault::Connection(ConnectionFault::Garbled))
    }

    /// Does what a piece asks for; gives back an answer.
    async fn take(&mut self, piece: Piece) -> Result<Option<Response>, Fault> {
        match piece {
            Piece::Packet(packet) => self.take_packet(packet),
            Piece::Response(response) => return Ok(Some(response)),
            Piece::Request(number) => {
                let number = number.map_or(String::new(), |number| format!("CSeq: {number}\r\n"));
                self.write(format!("RTSP/1.0 200 OK\r\n{number}\r\n").as_bytes()).await?;
            }
        }
        Ok(None)
    }

    fn take_datagram(&self, bytes: &[u8], received: std::io::Result<(usize, SocketAddr)>) {
        match received {
            Ok((n_bytes, from))
                if from.ip().to_canonical() == self.target.peer.address.ip().to_canonical() =>
            {
                self.take_packet(bytes[..n_bytes].to_vec());
            }
            Ok((_, from)) => tracing::debug!(%from, "a packet that is not the camera's is left out"),
            // Whoever does not listen yet says so.
            Err(error) => tracing::debug!(%error, "a packet is not received"),
        }
    }

    fn take_packet(&self, mut packet: Vec<u8>) {
        self.has_packet.store(true, Ordering::Relaxed);
        let Some(payload_type) = self.payload_type else { return };
        match unify(&mut packet, payload_type) {
            Kind::Rtp => self.sinks.push_packet(packet),
            Kind::SenderReport => self.sinks.push_report(packet),
            Kind::Other => {}
        }
    }

    /// Sends a request and waits for its answer, to a challenge too.
    async fn request(
        &mut self,
        method: &str,
        url: &str,
        headers: &[(&str, &str)],
    ) -> Result<Response, Fault> {
        loop {
            let number = self.send(method, url, headers).await?;
            let response = timeout(ANSWER_TIME, self.answer(number)).await;
            let response = response.map_err(|_elapsed| self.unanswered(ConnectionFault::TimedOut))??;
            if response.status != UNAUTHORIZED {
                if response.is_success() {
                    self.answering.is_let_in();
                }
                return Ok(response);
            }
            self.answering.challenge(response.headers("www-authenticate")).map_err(Fault::Connection)?;
        }
    }

    /// Waits for the answer to request `number`. Cameras answer in order: one without a number, or with a number that nobody used,
    /// is the answer too; those with a lower one come late.
    async fn answer(&mut self, number: u32) -> Result<Response, Fault> {
        let mut chunk = vec![0; CHUNK_BYTES];
        loop {
            while let Some(piece) = self.next_piece()? {
                if let Some(response) = self.take(piece).await?
                    && response.number().is_none_or(|found| found == 0 || found >= number)
                {
                    return Ok(response);
                }
            }
            let n_bytes = self.stream.read(&mut chunk).await.unwrap_or(0);
            if n_bytes == 0 {
                return Err(self.unanswered(ConnectionFault::Closed));
            }
            self.reader.push(&chunk[..n_bytes]);
        }
    }

    /// Returns the fault of a request that got no answer, `otherwise` unless what came is none of the protocol's.
    fn unanswered(&self, otherwise: ConnectionFault) -> Fault {
        Fault::Connection(if self.reader.is_astray() { ConnectionFault::Garbled } else { otherwise })
    }

    /// Sends a request, and gives its number.
    async fn send(&mut self, method: &str, url: &str, headers: &[(&str, &str)]) -> Result<u32, Fault> {
        use std::fmt::Write;
        let number = self.next_number;
        self.next_number += 1;
        let mut text = format!("{method} {url} RTSP/1.0\r\nCSeq: {number}\r\nUser-Agent: {}\r\n", USER_AGENT);
        let login = self.answering.header(method, url);
        let session = self.id.clone();
        let own = [("Authorization", login.as_deref()), ("Session", session.as_deref())];
        let own = own.into_iter().filter_map(|(name, value)| Some((name, value?)));
        for (name, value) in headers.iter().copied().chain(own) {
            write!(text, "{name}: {value}\r\n").expect("a text takes what is written");
        }
        text.push_str("\r\n");
        self.write(text.as_bytes()).await?;
        Ok(number)
    }

    async fn write(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        match timeout(ANSWER_TIME, self.stream.write_all(bytes)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_closed)) => Err(Fault::Connection(ConnectionFault::Closed)),
            Err(_elapsed) => Err(Fault::Connection(ConnectionFault::TimedOut)),
        }
    }
}

/// Waits for a packet; for ever where there is no socket.
async fn receive(socket: Option<&UdpSocket>, bytes: &mut [u8]) -> std::io::Result<(usize, SocketAddr)> {
    match socket {
        Some(socket) => socket.recv_from(bytes).await,
        None => std::future::pending().await,
    }
}

/// Returns the fault of a camera that refuses the transport that it was asked for first with that status, and the other too.
fn refusal(status: u16) -> Fault {
    let says_so = status == transport::UNSUPPORTED;
    let fault =
        if says_so { ConnectionFault::NoTransport } else { ConnectionFault::Status(u32::from(status)) };
    Fault::Connection(fault)
}
