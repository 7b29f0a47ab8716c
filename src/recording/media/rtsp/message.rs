//! Reads an RTSP connection: answers, a camera's own requests, and packets between them (RFC 2326, 10.12).
//!
//! Cameras end lines with LF alone, send bytes that are no UTF-8, and now and then lose or add some between packets. What
//! cannot be read is skipped up to the next thing that can, and counted.

use super::packets::is_packet;
use std::cell::Cell;
use std::collections::{BTreeSet, VecDeque};

/// Most bytes of an answer's head.
const MAX_HEAD_BYTES: usize = 64 << 10;

/// Most bytes of an answer's body.
const MAX_BODY_BYTES: usize = 1 << 20;

/// Most bytes that are skipped in a row.
const MAX_SKIPPED_BYTES: usize = 1 << 20;

/// Beginning of a web server's answer.
const WEB_SERVER: &[u8] = b"HTTP/";

/// Bytes of a packet from which on it is searched for others in it: most have at most 1500.
const LARGE_BYTES: usize = 1600;

/// Bytes that are searched: two packets of the usual size begin in them.
const SEARCHED_BYTES: usize = 3072;

/// Least bytes of a packet: those of an empty receiver's report.
const LEAST_PACKET_BYTES: usize = 8;

/// Methods that a camera may ask us for.
const METHODS: [&str; 10] = [
    "ANNOUNCE ",
    "DESCRIBE ",
    "GET_PARAMETER ",
    "OPTIONS ",
    "PAUSE ",
    "PLAY",
    "REDIRECT ",
    "SETUP ",
    "SET_PARAMETER ",
    "TEARDOWN ",
];

/// An answer to a request.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Response {
    pub(super) status: u16,
    /// Names in lower case.
    headers: Vec<(String, String)>,
    pub(super) body: Vec<u8>,
}

impl Response {
    /// The first header of that name, in lower case.
    pub(super) fn header(&self, name: &str) -> Option<&str> {
        self.headers(name).next()
    }

    /// Returns all headers of that name, in lower case.
    pub(super) fn headers(&self, name: &str) -> impl Iterator<Item = &str> {
        self.headers.iter().filter(move |(found, _)| found == name).map(|(_, value)| value.as_str())
    }

    /// The number of the request that it answers.
    pub(super) fn number(&self) -> Option<u32> {
        self.header("cseq")?.parse().ok()
    }

    pub(super) const fn is_success(&self) -> bool {
        matches!(self.status, 200..=299)
    }
}

/// Thing that came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Piece {
    /// A packet, on whatever channel.
    Packet(Vec<u8>),
    Response(Response),
    /// A camera's request, of which the number alone is of use.
    Request(Option<u32>),
}

/// Bytes of which nothing further can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Unreadable;

/// Takes bytes as they come, and gives what they are.
#[derive(Debug, Default)]
pub(super) struct Reader {
    bytes: VecDeque<u8>,
    /// Bytes skipped since the last piece.
    n_skipped: usize,
    /// Times that bytes were skipped.
    n_damaged: u64,
    /// Channels on which packets came.
    channels: BTreeSet<u8>,
    /// Payload types that came, each with its channel.
    payload_types: BTreeSet<(u8, u8)>,
    /// True once no more bytes come.
    is_over: bool,
    /// Bytes before those that are kept, and the place at which a packet was searched last and holds no other.
    n_consumed: u64,
    searched_at: Cell<Option<u64>>,
}

/// Beginning of what is there.
enum Start {
    Packet,
    Response,
    Request,
    /// Too few bytes to tell.
    Unknown,
    Nothing,
}

impl Reader {
    /// Adds bytes that came.
    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    /// Says that no more bytes come, so that nothing is waited for.
    pub(super) const fn end(&mut self) {
        self.is_over = true;
    }

    /// Returns how often bytes were skipped.
    pub(super) const fn n_damaged(&self) -> u64 {
        self.n_damaged
    }

    /// Returns true where the newest bytes that came belong to no piece.
    pub(super) const fn is_astray(&self) -> bool {
        self.n_skipped > 0
    }

    /// The next piece, once it is there whole.
    ///
    /// # Errors
    /// When too much of what comes is none.
    pub(super) fn next(&mut self) -> Result<Option<Piece>, Unreadable> {
        loop {
            self.bytes.make_contiguous();
            let (bytes, _) = self.bytes.as_slices();
            if self.channels.is_empty() && self.n_skipped == 0 && bytes.starts_with(WEB_SERVER) {
                return Err(Unreadable);
            }
            let found = match self.start(bytes) {
                Start::Unknown if !self.is_over || bytes.is_empty() => return Ok(None),
                Start::Unknown | Start::Nothing => None,
                Start::Packet => {
                    let n_bytes = 4 + usize::from(u16::from_be_bytes([bytes[2], bytes[3]]));
                    self.channels.insert(bytes[1]);
                    let packet = bytes[4..n_bytes].to_vec();
                    self.payload_types.insert((bytes[1], payload_type(&packet)));
                    Some((Piece::Packet(packet), n_bytes))
                }
                Start::Response | Start::Request => match message(bytes)? {
                    Some(found) => Some(found),
                    None if self.is_over => None,
                    None => return Ok(None),
                },
            };
            if let Some((piece, n_bytes)) = found {
                self.consume(n_bytes);
                self.n_skipped = 0;
                return Ok(Some(piece));
            }
            self.skip()?;
        }
    }

    /// Goes to the next byte at which something may begin.
    fn skip(&mut self) -> Result<(), Unreadable> {
        let (bytes, _) = self.bytes.as_slices();
        let may_begin = |byte: &u8| *byte == b'$' || byte.is_ascii_uppercase();
        let n_bytes = bytes.iter().skip(1).position(may_begin).map_or(bytes.len(), |at| at + 1);
        // Line ends between messages are no damage.
        let is_blank = bytes[..n_bytes].iter().all(|byte| matches!(byte, b'\r' | b'\n'));
        self.consume(n_bytes);
        if !is_blank {
            // A piece that the end of the connection cuts is no damage.
            self.n_damaged += u64::from(self.n_skipped == 0 && !self.is_over);
            self.n_skipped += n_bytes;
        }
        if self.n_skipped > MAX_SKIPPED_BYTES { Err(Unreadable) } else { Ok(()) }
    }

    fn consume(&mut self, n_bytes: usize) {
        self.bytes.drain(..n_bytes);
        self.n_consumed += n_bytes as u64;
    }

    /// Returns what `bytes` begin with. Behind bytes that were skipped, and of a payload type that never came, a packet is one only if
    /// something begins after it.
    fn start(&self, bytes: &[u8]) -> Start {
        let is_lost = self.n_skipped > 0;
        let Some(first) = bytes.first() else { return Start::Unknown };
        if *first == b'$' {
            let [_, _, high, low, rest @ ..] = bytes else { return Start::Unknown };
            let n_bytes = usize::from(u16::from_be_bytes([*high, *low]));
            let Some(_) = rest.first() else { return Start::Unknown };
            if n_bytes == 0 || !is_packet(rest) {
                return Start::Nothing;
            }
            let is_doubtful = is_lost || n_bytes > LARGE_BYTES || !self.is_known(bytes[1]);
            if is_doubtful && self.searched_at.get() != Some(self.n_consumed) {
                let n_searched = n_bytes.min(SEARCHED_BYTES);
                if rest.len() < n_searched && !self.is_over {
                    return Start::Unknown;
                }
                if self.holds_packets(&rest[..n_searched.min(rest.len())]) {
                    return Start::Nothing;
                }
                // Once is enough: a hostile camera could have each byte looked at for each that comes.
                self.searched_at.set(Some(self.n_consumed));
            }
            let Some(after) = rest.get(n_bytes..) else { return Start::Unknown };
            let has_come = self.has_come(bytes[1], &rest[..n_bytes]);
            return if is_lost || !has_come { self.confirmed(after) } else { Start::Packet };
        }
        let begins = |word: &str| {
            let n_bytes = word.len().min(bytes.len());
            bytes[..n_bytes] == word.as_bytes()[..n_bytes]
        };
        if begins("RTSP/") {
            return if bytes.len() < 5 { Start::Unknown } else { Start::Response };
        }
        match METHODS.iter().find(|method| begins(method)) {
            Some(method) if bytes.len() < method.len() => Start::Unknown,
            Some(_) => Start::Request,
            None => Start::Nothing,
        }
    }

    /// Returns true for packets of a payload type that came on that channel before, and for all before the first one.
    fn has_come(&self, channel: u8, packet: &[u8]) -> bool {
        self.payload_types.is_empty() || self.payload_types.contains(&(channel, payload_type(packet)))
    }

    /// Returns what a doubtful packet is by the bytes after it.
    fn confirmed(&self, after: &[u8]) -> Start {
        match after {
            [b'$', _, _, _, rest @ ..] if !rest.is_empty() => {
                if is_packet(rest) {
                    Start::Packet
                } else {
                    Start::Nothing
                }
            }
            [] | [b'$', ..] if !self.is_over => Start::Unknown,
            [] | [b'$' | b'R' | b'\r' | b'\n', ..] => Start::Packet,
            _ => Start::Nothing,
        }
    }

    /// Returns true for a channel on which packets came, and for all before the first one.
    fn is_known(&self, channel: u8) -> bool {
        self.channels.is_empty() || self.channels.contains(&channel)
    }

    /// Returns true where two packets follow one another in `bytes`: then these are no packet themselves, but what only looks like
    /// the beginning of one, with the packets after it.
    fn holds_packets(&self, bytes: &[u8]) -> bool {
        // The place behind a packet, and its payload type.
        let packet = |at: usize| match bytes.get(at..)? {
            [b'$', channel, high, low, rest @ ..] if self.is_known(*channel) && is_packet(rest) => {
                let n_bytes = usize::from(u16::from_be_bytes([*high, *low]));
                (n_bytes >= LEAST_PACKET_BYTES).then_some((at + 4 + n_bytes, rest.get(1)? & 127))
            }
            _ => None,
        };
        let is_chain = |at: usize| {
            let (next, kind) = packet(at)?;
            let (_, next_kind) = packet(next)?;
            // Reports have types of their own, 200 to 223.
            let is_report = |kind: u8| (72..96).contains(&kind);
            Some(kind == next_kind || is_report(kind) || is_report(next_kind))
        };
        let mut begins = bytes.iter().enumerate().filter(|(_, byte)| **byte == b'$').map(|(at, _)| at);
        begins.any(|at| is_chain(at) == Some(true))
    }
}

/// Returns a packet's payload type; of a report seven bits of its own type.
fn payload_type(packet: &[u8]) -> u8 {
    packet.get(1).map_or(0, |second| second & 127)
}

/// The message at the beginning of `bytes` and how long it is, once it is there whole.
fn message(bytes: &[u8]) -> Result<Option<(Piece, usize)>, Unreadable> {
    let Some(n_head) = head_bytes(bytes) else {
        return if bytes.len() > MAX_HEAD_BYTES { Err(Unreadable) } else { Ok(None) };
    };
    let head = String::from_utf8_lossy(&bytes[..n_head]);
    let mut lines = head.lines();
    let first = lines.next().unwrap_or_default();
    let headers: Vec<(String, String)> = lines
        .filter_map(|line| line.split_once(':'))
        .map(|(name, value)| (name.trim().to_ascii_lowercase(), plain(value.trim())))
        .collect();
    let mut response = Response { headers, ..Response::default() };
    let n_body: usize = response
        .header("content-length")
        .map_or(Ok(0), |length| length.parse().map_err(|_no_number| Unreadable))?;
    if n_body > MAX_BODY_BYTES {
        return Err(Unreadable);
    }
    let Some(body) = bytes.get(n_head..n_head + n_body) else { return Ok(None) };
    let piece = if first.starts_with("RTSP/") {
        let status = first.split_ascii_whitespace().nth(1).and_then(|status| status.parse().ok());
        response.status = status.ok_or(Unreadable)?;
        response.body = body.to_vec();
        Piece::Response(response)
    } else {
        Piece::Request(response.number())
    };
    Ok(Some((piece, n_head + n_body)))
}

/// Returns a value without control characters: some of them are sent back, in lines of a request.
fn plain(value: &str) -> String {
    value.chars().filter(|letter| !letter.is_control()).collect()
}

/// Bytes up to the end of the first blank line.
fn head_bytes(bytes: &[u8]) -> Option<usize> {
    let mut line_begins = 0;
    for (at, byte) in bytes.iter().enumerate().take(MAX_HEAD_BYTES + 1) {
        if *byte != b'\n' {
            continue;
        }
        if matches!(&bytes[line_begins..at], [] | [b'\r']) {
            return Some(at + 1);
        }
        line_begins = at + 1;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(channel: u8, bytes: &[u8]) -> Vec<u8> {
        [&[b'$', channel][..], &(bytes.len() as u16).to_be_bytes(), bytes].concat()
    }

    const RTP: [u8; 14] = [0x80, 96, 0, 1, 0, 0, 0, 2, 1, 1, 1, 1, b'$', b'R'];

    fn read(reader: &mut Reader, bytes: &[u8]) -> Vec<Piece> {
        reader.push(bytes);
        std::iter::from_fn(|| reader.next().unwrap()).collect()
    }

    #[test]
    fn what_comes_in_pieces_is_read_as_what_comes_at_once() {
        let answer = b"RTSP/1.0 200 OK\r\nCSeq: 3\r\nSession: 9;timeout=20\r\nContent-Length: 4\r\n\r\nbody";
        let request = b"GET_PARAMETER rtsp://cam/ RTSP/1.0\r\nCSeq: 7\r\n\r\n";
        let all =
            [&packet(0, &RTP)[..], answer, &packet(9, &RTP), b"\r\n", request, &packet(0, &RTP)].concat();
        let mut reader = Reader::default();
        let at_once = read(&mut reader, &all);
        assert_eq!((at_once.len(), reader.n_damaged), (5, 0));
        let Piece::Response(response) = &at_once[1] else { panic!("{at_once:?}") };
        assert_eq!((response.status, response.number(), &response.body[..]), (200, Some(3), &b"body"[..]));
        assert_eq!(response.header("session"), Some("9;timeout=20"));
        assert_eq!(at_once[3], Piece::Request(Some(7)));
        for n in [1, 2, 3, 5, 7, 50] {
            let mut reader = Reader::default();
            let pieces: Vec<Piece> = all.chunks(n).flat_map(|chunk| read(&mut reader, chunk)).collect();
            assert_eq!(pieces, at_once, "{n} bytes at a time");
            assert_eq!(reader.n_damaged, 0);
        }
    }

    #[test]
    fn loose_answers_are_read() {
        let loose = b"RTSP/1.0 401\nWWW-Authenticate: Digest realm=\"\xe9\"\nwww-authenticate :Basic realm=\"b\"\nno header\n\n";
        let pieces = read(&mut Reader::default(), loose);
        let [Piece::Response(response)] = &pieces[..] else { panic!("{pieces:?}") };
        assert_eq!(response.status, 401);
        assert_eq!(response.headers("www-authenticate").count(), 2);
    }

    #[test]
    fn headers_are_one_line_each() {
        let pieces = read(
            &mut Reader::default(),
            b"RTSP/1.0 200 OK\r\nSession: 9\rCSeq: 4\0\x1b\r\nContent-Base: rtsp://a/\tb\n\n",
        );
        let [Piece::Response(response)] = &pieces[..] else { panic!("{pieces:?}") };
        assert_eq!(response.header("session"), Some("9CSeq: 4"));
        assert_eq!((response.header("content-base"), response.number()), (Some("rtsp://a/b"), None));
    }

    #[test]
    fn damage_between_packets_costs_no_more_than_the_packet_beside_it() {
        for garbage in [
            &b"\0\xff\0\x12"[..],
            b"$\0",
            b"$\0\0\x08\x11garbage",
            b"RTP!",
            b"$$$",
            b"$\0\xff\xff\x80\x60",
            b"$R\xff\xff\xa4",
            b"$\0\x13\x24\x87",
        ] {
            let packets = |n: usize| (0..n).flat_map(|_| packet(0, &RTP)).collect::<Vec<u8>>();
            let mut reader = Reader::default();
            // The last three claim up to 64 kB, which are not waited for, and hold the packets behind them.
            let all = [&packets(2)[..], garbage, &packets(200)].concat();
            let n_read = read(&mut reader, &all).len();
            assert!(n_read >= 200, "{garbage:?}: {n_read} packets");
            assert!(reader.n_damaged > 0, "{garbage:?}");
        }
        // A packet that lost its end takes the next ones' beginnings.
        let mut reader = Reader::default();
        let cut = [&packet(0, &RTP)[..12], &packet(0, &RTP).repeat(9)].concat();
        let n_read = read(&mut reader, &cut).len();
        assert!((7..=9).contains(&n_read) && reader.n_damaged > 0, "{n_read}");
    }

    #[test]
    fn garbage_that_looks_like_a_packet_of_another_kind_takes_nothing_with_it() {
        for garbage in [&b"$\0\0\x24\x86\0"[..], b"$\0\0\x10\x80\x61", b"$\x01\0\x24\x80\xc8"] {
            let packets = |n: usize| (0..n).flat_map(|_| packet(0, &RTP)).collect::<Vec<u8>>();
            for cut in [1, 7, 1000] {
                let mut reader = Reader::default();
                let all = [&packets(2)[..], garbage, &packets(20)].concat();
                let n_read: usize = all.chunks(cut).map(|bytes| read(&mut reader, bytes).len()).sum();
                assert_eq!((n_read, reader.n_damaged), (22, 1), "{garbage:?}");
            }
        }
        // A kind that comes for the first time is taken, and from then on at once.
        let (report, mut reader) = ([&[0x80, 200, 0, 6][..], &[7; 24]].concat(), Reader::default());
        let begun = [packet(0, &RTP), packet(1, &report), packet(0, &RTP)].concat();
        assert_eq!(read(&mut reader, &begun).len(), 3);
        assert_eq!((read(&mut reader, &packet(1, &report)).len(), reader.n_damaged), (1, 0));
    }

    #[test]
    fn at_the_end_nothing_is_waited_for() {
        let mut reader = Reader::default();
        let all = [&packet(0, &RTP)[..], b"$\0\x01\0\x80", &packet(0, &RTP), b"RTSP/1.0 200"].concat();
        assert_eq!(read(&mut reader, &all).len(), 1);
        reader.end();
        assert_eq!(read(&mut reader, &[]), [Piece::Packet(RTP.to_vec())]);
        assert_eq!((reader.bytes.len(), reader.n_damaged), (0, 0));
    }

    #[test]
    fn large_packets_are_read_though_they_hold_what_looks_like_one() {
        let large = [&RTP[..], &[7; 30_000], &packet(0, &RTP), &[9; 20_000]].concat();
        let mut reader = Reader::default();
        let all = [packet(0, &RTP), packet(0, &large), packet(0, &RTP)].concat();
        let pieces: Vec<Piece> = all.chunks(1400).flat_map(|chunk| read(&mut reader, chunk)).collect();
        assert_eq!((pieces.len(), reader.n_damaged), (3, 0));
        assert_eq!(pieces[1], Piece::Packet(large));
    }

    #[test]
    fn what_never_ends_is_given_up() {
        let fails = |bytes: &[u8]| {
            let mut reader = Reader::default();
            reader.push(bytes);
            while let Ok(piece) = reader.next() {
                if piece.is_none() {
                    return false;
                }
            }
            true
        };
        assert!(fails(&[7; MAX_SKIPPED_BYTES + 2]));
        assert!(fails(&[b"RTSP/1.0 200 OK\r\n".to_vec(), b"a: b\r\n".repeat(20_000)].concat()));
        assert!(fails(b"RTSP/1.0 200 OK\r\nContent-Length: 99999999\r\n\r\n"));
        assert!(fails(b"RTSP/1.0 200 OK\r\nContent-Length: -1\r\n\r\n"));
        assert!(fails(b"RTSP/1.0 two hundred\r\n\r\n"));
        assert!(fails(b"HTTP/1.1 400 Bad Request\r\n"), "a web server, at once");
        assert!(fails(b"RTSP/1.0 200 OK\r\n\r\nHTTP/1.1 200 OK\r\n\r\n<html>"));
        let mut reader = Reader::default();
        let all = [&packet(0, &RTP)[..], b"HTTP/1.1", &packet(0, &RTP), &packet(0, &RTP)].concat();
        assert_eq!(read(&mut reader, &all).len(), 3, "bytes between packets are skipped");
        assert!(!reader.is_astray());
        assert!(read(&mut reader, b"SSH-2.0-OpenSSH\r\n").is_empty() && reader.is_astray());
        assert!(!fails(b"RTSP/1.0 200 OK\r\nContent-Length: 5\r\n\r\nbody"));
    }
}
