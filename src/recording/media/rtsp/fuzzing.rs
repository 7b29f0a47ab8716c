//! Truths about an RTSP connection, whatever a camera sends.

use super::description::first_video;
use super::message::{Piece, Reader};
use super::packets::{Kind, unify};
use super::transport::{named, server_ports};
use crate::media::fault::Fault;
use crate::media::fuzzing::{pieces, without_complaints};

/// The address that is asked for.
const BASE: &str = "rtsp://camera/stream";

/// Reads a connection: the same comes out however the bytes are cut, headers are one line each, and packets of the stream keep all but
/// their SSRC.
///
/// The first byte says how the others are cut, and is the stream's payload type.
pub fn rtsp_connection(data: &[u8]) -> usize {
    let [seed, bytes @ ..] = data else { return 0 };
    let found = read([bytes]);
    assert_eq!(read(pieces(*seed, bytes)), found, "cut in pieces");
    assert_eq!(read(bytes.chunks(1)), found, "a byte at a time");
    holds_packet(bytes, *seed & 127);
    for piece in &found.pieces {
        match piece {
            Piece::Packet(packet) => holds_packet(packet, *seed & 127),
            Piece::Response(response) => {
                for name in ["session", "transport", "content-base", "www-authenticate", "public"] {
                    let is_line = |value: &str| !value.contains(char::is_control);
                    assert!(response.headers(name).all(is_line), "{response:?}");
                }
                std::hint::black_box(
                    response.header("transport").map(|header| (named(header), server_ports(header))),
                );
            }
            Piece::Request(_) => {}
        }
    }
    found.pieces.len()
}

/// Everything that a connection gave.
#[derive(Debug, PartialEq)]
struct Found {
    pieces: Vec<Piece>,
    is_unreadable: bool,
    n_damaged: u64,
}

fn read<'a>(bytes: impl IntoIterator<Item = &'a [u8]>) -> Found {
    let mut reader = Reader::default();
    let mut found = Found { pieces: Vec::new(), is_unreadable: false, n_damaged: 0 };
    for bytes in bytes.into_iter().map(Some).chain([None]) {
        match bytes {
            Some(bytes) => reader.push(bytes),
            None => reader.end(),
        }
        while !found.is_unreadable {
            match reader.next() {
                Ok(Some(piece)) => found.pieces.push(piece),
                Ok(None) => break,
                Err(_unreadable) => found.is_unreadable = true,
            }
        }
    }
    found.n_damaged = reader.n_damaged();
    found
}

fn holds_packet(before: &[u8], payload_type: u8) {
    let mut packet = before.to_vec();
    let kind = unify(&mut packet, payload_type);
    let at = match kind {
        Kind::Other => {
            assert_eq!(packet, before);
            return;
        }
        Kind::Rtp => {
            assert_eq!(packet.len(), before.len());
            8..12
        }
        Kind::SenderReport => {
            assert!(packet.len() >= 28 && packet.len().is_multiple_of(4));
            4..8
        }
    };
    assert_eq!(packet[at.clone()], *b"vfld");
    assert_eq!(
        (&packet[..at.start], &packet[at.end..]),
        (&before[..at.start], &before[at.end..packet.len()])
    );
    let mut again = packet.clone();
    assert_eq!((unify(&mut again, payload_type), again), (kind, packet), "done a second time");
}

/// Takes a stream of a description: of a format that is read, at addresses of one line; what is refused is told in plain letters.
pub fn rtsp_description(data: &[u8]) -> usize {
    match without_complaints(|| first_video(data, BASE)) {
        Ok(stream) => {
            let is_address = |text: &str| {
                text.to_ascii_lowercase().starts_with("rtsp")
                    && !text.contains(|letter: char| letter.is_control())
            };
            assert!(is_address(&stream.control) && is_address(&stream.session), "{stream:?}");
            let structure = stream.caps.structure(0).expect("a format has one");
            assert_eq!((stream.caps.size(), structure.name().as_str()), (1, "application/x-rtp"));
            assert!(structure.has_field("encoding-name") && stream.caps.is_fixed(), "{stream:?}");
            assert!(stream.payload_type < 128, "{stream:?}");
            1
        }
        Err(fault @ (Fault::NotVideo(_) | Fault::Refused { .. })) => {
            assert!(!fault.to_string().contains(char::is_control), "{fault:?}");
            0
        }
        Err(fault) => panic!("{fault:?}"),
    }
}
