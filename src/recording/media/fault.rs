//! Why a pipeline gives nothing further, and which package would help.

use super::allowed::{CONTAINER_FORMATS, FORMATS};
use gstreamer as gst;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;

/// The limits of pictures, as people read them: `MAX_SIDE` and `MAX_PIXELS`.
pub const SIZE_LIMIT: &str = "8192 pixels a side and 36 megapixels";

/// Why a pipeline gives no further picture.
#[derive(Debug, Serialize, Deserialize)]
pub enum Fault {
    /// No type, no video stream.
    NotVideo(String),
    /// No demuxer or decoder.
    MissingCodec {
        /// What is missing.
        codec: String,
        /// Debian packages that may have it.
        package: Cow<'static, str>,
    },
    /// A format that is never read, whatever is installed.
    Refused {
        /// The format.
        format: String,
        /// The formats that are read.
        allowed: String,
    },
    /// Pictures beyond the limits.
    TooLarge {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The stream breaks off.
    Damaged(String),
    /// A camera is not reached, or sends nothing.
    Connection(ConnectionFault),
    /// The process that decodes it ended, and how.
    Worker(String),
    /// `GStreamer` fails or is incomplete.
    Gstreamer {
        /// What was tried.
        action: Cow<'static, str>,
        /// What it said.
        detail: String,
    },
}

impl fmt::Display for Fault {
    /// What is wrong, without the name of the stream: whoever knows that says it.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotVideo(detail) | Self::Damaged(detail) => formatter.write_str(detail),
            Self::MissingCodec { codec, package } => write!(formatter, "no {codec}: install {package}"),
            Self::Refused { format, allowed } => {
                write!(formatter, "{format} is not supported; supported are {allowed}")
            }
            Self::TooLarge { width, height } => {
                write!(formatter, "pictures of {width} x {height}: allowed are {SIZE_LIMIT}")
            }
            Self::Worker(how) => write!(formatter, "its decoding process ended: {how}"),
            Self::Connection(fault) => write!(formatter, "the connection failed: {fault:?}"),
            Self::Gstreamer { action, detail } => write!(formatter, "cannot {action}: {detail}"),
        }
    }
}

/// Why a camera gives nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ConnectionFault {
    /// Nothing listens there, or there is no way there.
    Unreachable,
    /// It does not answer in time.
    TimedOut,
    /// It wants another user or password, or one at all.
    Unauthorized,
    /// It has no such stream.
    NotFound,
    /// It answers with this status.
    Status(u32),
    /// It says that the stream is elsewhere.
    Redirected,
    /// It does not prove its name.
    Insecure,
    /// Something else is using it.
    Busy,
    /// It ended the connection.
    Closed,
    /// It has no format of those that are asked for.
    NoFormat,
    /// It refused the user or the password that it was given.
    LoginRefused,
    /// The way in which it wants a user and a password is not known.
    UnknownLogin,
    /// Neither TCP nor UDP is a way in which it gives the stream.
    NoTransport,
    /// Its answer is none of the protocol's.
    Garbled,
}

/// A failure of `GStreamer` itself while `action` was tried.
pub(super) fn gstreamer_fault(action: &'static str, error: &dyn std::error::Error) -> Fault {
    Fault::Gstreamer { action: action.into(), detail: error.to_string() }
}

/// Returns the fault of a stream of `format`, which is never read.
pub(super) fn refused_format(format: &gst::StructureRef) -> Fault {
    let kind = format.name().as_str();
    let format = match kind {
        "image/x-jpc" | "image/x-jpc-striped" | "image/jp2" => "JPEG 2000".to_owned(),
        "image/svg" | "image/svg+xml" => "SVG".to_owned(),
        "image/webp" => "WebP".to_owned(),
        "video/mpeg" => "MPEG-1 or MPEG-2 video".to_owned(),
        _ => four_letters(format).unwrap_or_else(|| kind.to_owned()),
    };
    Fault::Refused { format, allowed: format!("{FORMATS}, in files of {CONTAINER_FORMATS}") }
}

/// What a stream of `format` lacks.
pub(super) fn missing_codec(format: &gst::StructureRef) -> Fault {
    let kind = format.name().as_str();
    let codec = four_letters(format).unwrap_or_else(|| kind.to_owned());
    Fault::MissingCodec { codec: format!("decoder for {codec}"), package: package_of(kind).into() }
}

/// The four letters by which a container names a codec that nobody knows, quoted.
fn four_letters(format: &gst::StructureRef) -> Option<String> {
    let letters = format.get::<i32>("fourcc").ok()?.to_le_bytes();
    Some(format!("{:?}", String::from_utf8_lossy(&letters)))
}

const ANY_PACKAGE: &str = "gstreamer1.0-libav, gstreamer1.0-plugins-bad or gstreamer1.0-plugins-ugly";

fn package_of(kind: &str) -> &'static str {
    match kind {
        "video/x-vp8" | "video/x-vp9" | "image/jpeg" | "image/png" | "video/quicktime"
        | "video/x-matroska" | "video/webm" | "video/x-msvideo" | "video/x-flv" => {
            "gstreamer1.0-plugins-good"
        }
        "video/x-h264" | "video/x-h265" | "video/mpeg" | "video/x-divx" | "video/x-xvid"
        | "video/x-msmpeg" | "image/bmp" => "gstreamer1.0-libav",
        "video/mpegts" | "video/x-av1" | "video/x-ivf" => "gstreamer1.0-plugins-bad",
        _ => ANY_PACKAGE,
    }
}
