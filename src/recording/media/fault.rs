//! Why a pipeline gives nothing further, and which package would help.

use gstreamer as gst;
use std::fmt;

/// Why a pipeline gives no further picture.
#[derive(Debug)]
pub enum Fault {
    /// No type, no video stream.
    NotVideo(String),
    /// No demuxer or decoder.
    MissingCodec {
        /// What is missing.
        codec: String,
        /// Debian packages that may have it.
        package: &'static str,
    },
    /// A picture beyond the limit.
    TooLarge {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Most of either.
        limit: u32,
    },
    /// The stream breaks off.
    Damaged(String),
    /// A camera is not reached, or sends nothing.
    Connection(ConnectionFault),
    /// `GStreamer` fails or is incomplete.
    Gstreamer {
        /// What was tried.
        action: &'static str,
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
            Self::TooLarge { width, height, limit } => {
                write!(formatter, "{width} x {height}: at most {limit}")
            }
            Self::Connection(fault) => write!(formatter, "the connection failed: {fault:?}"),
            Self::Gstreamer { action, detail } => write!(formatter, "cannot {action}: {detail}"),
        }
    }
}

/// Why a camera gives nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
}

/// A failure of `GStreamer` itself while `action` was tried.
pub(super) fn gstreamer_fault(action: &'static str, error: &dyn std::error::Error) -> Fault {
    Fault::Gstreamer { action, detail: error.to_string() }
}

/// What a stream of `format` lacks.
pub(super) fn missing_codec(format: &gst::StructureRef) -> Fault {
    let kind = format.name().as_str();
    let fourcc = format.get::<i32>("fourcc").ok().map(i32::to_le_bytes);
    let codec =
        fourcc.map_or_else(|| kind.to_owned(), |code| format!("{:?}", String::from_utf8_lossy(&code)));
    Fault::MissingCodec { codec: format!("decoder for {codec}"), package: package_of(kind) }
}

const ANY_PACKAGE: &str = "gstreamer1.0-libav, gstreamer1.0-plugins-bad or gstreamer1.0-plugins-ugly";

fn package_of(kind: &str) -> &'static str {
    match kind {
        "video/x-vp8" | "video/x-vp9" | "image/jpeg" | "image/png" | "video/x-dv" | "video/quicktime"
        | "video/x-matroska" | "video/webm" | "video/x-msvideo" => "gstreamer1.0-plugins-good",
        "video/x-theora" | "application/ogg" => "gstreamer1.0-plugins-base",
        "video/x-h264"
        | "video/x-h265"
        | "video/mpeg"
        | "video/x-divx"
        | "video/x-xvid"
        | "video/x-msmpeg"
        | "video/x-h263"
        | "video/x-wmv"
        | "video/x-flash-video"
        | "video/x-prores"
        | "video/x-dnxhd" => "gstreamer1.0-libav",
        "video/mpegts" | "video/x-av1" => "gstreamer1.0-plugins-bad",
        _ => ANY_PACKAGE,
    }
}
