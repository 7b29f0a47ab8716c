//! Truths about codecs' headers and about logins, whatever a camera sends.

use super::announced::{Announced, Size, in_bytes, in_format, is_too_large};
use super::login::{Answering, Login, OwnedLogin};
use gst::glib::{self, LogLevel};
use gstreamer as gst;
use std::cell::Cell;
use std::sync::{LazyLock, Once};

pub use super::http::fuzzing::http_pictures;
pub use super::rtsp::fuzzing::{rtsp_connection, rtsp_description};
pub use super::worker::{worker_channel, worker_messages};

/// Cuts bytes into pieces of lengths that hang on `seed` alone, many of them a byte long.
pub(super) fn pieces(seed: u8, mut bytes: &[u8]) -> Vec<&[u8]> {
    let mut state = u32::from(seed);
    let mut found = Vec::new();
    while !bytes.is_empty() {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let most = [1, 4, 40, 1000][(state >> 30) as usize];
        let (piece, rest) = bytes.split_at((1 + (state >> 8) as usize % most).min(bytes.len()));
        found.push(piece);
        bytes = rest;
    }
    found
}

thread_local! {
    /// Complaints of libraries in C on this thread.
    static N_COMPLAINTS: Cell<u64> = const { Cell::new(0) };
}

/// Does something that libraries in C must not complain of: they do where they are called with what they do not take.
pub(super) fn without_complaints<T>(act: impl FnOnce() -> T) -> T {
    start();
    let n_before = N_COMPLAINTS.get();
    let came = act();
    assert_eq!(N_COMPLAINTS.get(), n_before, "a library complains");
    came
}

/// Starts `GStreamer`, and has complaints counted, once.
fn start() {
    static STARTED: Once = Once::new();
    STARTED.call_once(|| {
        gst::init().expect("GStreamer starts");
        glib::log_set_default_handler(|domain, level, text| {
            let is_grave = matches!(level, LogLevel::Error | LogLevel::Critical);
            N_COMPLAINTS.set(N_COMPLAINTS.get() + u64::from(is_grave));
            glib::log_default_handler(domain, level, Some(text));
        });
    });
}

/// Formats of streams, each with the longest side that its headers have room for.
const FORMATS: [(&str, u32); 15] = [
    ("video/x-h264,stream-format=byte-stream", u32::MAX),
    ("video/x-h264,stream-format=avc", u32::MAX),
    ("video/x-h264", u32::MAX),
    ("video/x-h265,stream-format=byte-stream", u32::MAX),
    ("video/x-h265,stream-format=hvc1", u32::MAX),
    ("image/jpeg", 0xffff),
    ("image/png", u32::MAX),
    ("image/bmp", 1 << 31),
    ("video/x-vp8", 0x3fff),
    ("video/x-vp9", 1 << 16),
    ("video/x-av1", 1 << 16),
    ("video/mpeg,mpegversion=4", 0x1fff),
    ("video/x-divx", 0x1fff),
    ("video/x-xvid", 0x1fff),
    ("video/x-raw", 0),
];

static STRUCTURES: LazyLock<Vec<gst::Structure>> = LazyLock::new(|| {
    start();
    FORMATS.iter().map(|(format, _)| format.parse().expect("a format is well-formed")).collect()
});

/// Reads sizes from a codec's header and from a stream's bytes: none is beyond what the header has room for, units are read alike by
/// themselves and behind others, and a size that is too large is never hidden by another.
///
/// The first byte names the format, the second one the length of the header, which comes before the stream.
pub fn codec_headers(data: &[u8]) -> usize {
    without_complaints(|| read_headers(data))
}

fn read_headers(data: &[u8]) -> usize {
    let [kind, n_header, rest @ ..] = data else { return 0 };
    let kind = usize::from(*kind) % FORMATS.len();
    let (plain, max_side) = (&STRUCTURES[kind], FORMATS[kind].1);
    let (header, stream) = rest.split_at(usize::from(*n_header).min(rest.len()));
    let mut format = plain.clone();
    format.set("codec_data", gst::Buffer::from_mut_slice(header.to_vec()));
    let all =
        [in_format(&format), in_bytes(&format, stream), in_bytes(plain, header), in_bytes(plain, stream)];
    for said in all {
        if let Announced::Size((width, height)) = said {
            assert!(width <= max_side && height <= max_side, "{}: {said:?}", FORMATS[kind].0);
        }
        for other in all {
            holds_more(said, other);
        }
    }
    let has_start_codes = matches!(kind, 0 | 2 | 3 | 11..=13);
    if has_start_codes {
        let unit = [&[0, 0, 1], stream].concat();
        let joined = in_bytes(plain, &[header, &unit].concat());
        assert_eq!(
            joined,
            in_bytes(plain, header).max(in_bytes(plain, &unit)),
            "two units one after the other"
        );
    }
    if plain.name() == "image/png"
        && let Some(size) = decoded_size(stream, image::ImageFormat::Png)
    {
        assert_eq!(in_bytes(plain, stream), Announced::Size(size), "as a decoder has it");
    }
    all.iter().filter(|said| matches!(said, Announced::Size(_))).count()
}

/// Holds two announcements to what both together come to: the same in either order, and too large where either is.
fn holds_more(one: Announced, other: Announced) {
    let both = one.max(other);
    assert_eq!(both, other.max(one), "{one:?} and {other:?}");
    let is_beyond = |said: Announced| matches!(said, Announced::Size(size) if is_too_large(size));
    assert_eq!(is_beyond(both), is_beyond(one) || is_beyond(other), "{one:?} and {other:?} are {both:?}");
}

/// Returns the size that a decoder of another origin reads.
pub(super) fn decoded_size(bytes: &[u8], format: image::ImageFormat) -> Option<Size> {
    image::ImageReader::with_format(std::io::Cursor::new(bytes), format).into_dimensions().ok()
}

/// Answers challenges: what is answered is one line of a kind that is known, the password never stands in it, and no more than two
/// challenges in a row are answered.
///
/// Each line is a challenge, a blank line ends an answer that wants a login, and a line of `+` is an answer that does not.
pub fn login_challenges(data: &[u8]) -> usize {
    const PASSWORD: &str = "s3cret of a camera";
    // Whoever reads headers leaves control characters out.
    let is_read = |letter: &char| *letter == '\n' || !letter.is_control();
    let text: String = String::from_utf8_lossy(data).chars().filter(is_read).collect();
    let login = Login { user: "operator", password: PASSWORD };
    let mut answering = Answering::new(Some(OwnedLogin::of(login)));
    let (mut asked, mut n_answered, mut n_in_a_row) = (Vec::new(), 0, 0);
    for line in text.split('\n').chain([""]) {
        match line {
            "+" => {
                answering.is_let_in();
                n_in_a_row = 0;
            }
            "" => {
                let answered = answering.challenge(asked.drain(..));
                n_in_a_row += usize::from(answered.is_ok());
                assert!(n_in_a_row <= 2, "a challenge is answered for the third time");
            }
            challenge => asked.push(challenge),
        }
        let Some(header) = answering.header("DESCRIBE", "rtsp://camera/stream") else { continue };
        assert!(header.starts_with("Basic ") || header.starts_with("Digest "), "{header:?}");
        assert!(!header.contains(PASSWORD) && !header.contains(char::is_control), "{header:?}");
        n_answered += 1;
    }
    n_answered
}
