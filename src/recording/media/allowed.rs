//! The elements that may read what comes from outside, by the names of their factories.
//!
//! `GStreamer` would plug in whatever is installed and says that it reads a format: decoders of JPEG 2000, SVG and WebP among
//! them, of which a few bytes ask for gigabytes. An element that is not named here reads nothing, whatever its rank.

use super::input::Keep;
use gst::prelude::*;
use gstreamer as gst;

/// Readers of containers. A camera's stream is in none, and one that claims to be is not read.
const CONTAINERS: [&str; 9] = [
    "avidemux",
    "flvdemux",
    "ivfparse",
    "matroskademux",
    "mpegpsdemux",
    "multipartdemux",
    "qtdemux",
    "tsdemux",
    "y4mdec",
];

/// Readers of RTP payloads.
const DEPAYLOADERS: [&str; 8] = [
    "rtpav1depay",
    "rtph264depay",
    "rtph265depay",
    "rtpjpegdepay",
    "rtpmp4vdepay",
    "rtpvp8depay",
    "rtpvp9depay",
    "rtpvrawdepay",
];

/// Parsers of bare streams.
const PARSERS: [&str; 7] =
    ["av1parse", "h264parse", "h265parse", "jpegparse", "mpeg4videoparse", "pngparse", "vp9parse"];

/// Decoders, all of them in software. Not libvpx's for VP9: it decodes whatever follows a frame in the same buffer.
const DECODERS: [&str; 13] = [
    "av1dec",
    "avdec_av1",
    "avdec_bmp",
    "avdec_h264",
    "avdec_h265",
    "avdec_mjpeg",
    "avdec_mpeg4",
    "avdec_vp8",
    "avdec_vp9",
    "dav1ddec",
    "jpegdec",
    "pngdec",
    "vp8dec",
];

/// Decoders of what files alone may hold.
const DECODERS_OF_FILES: [&str; 1] = ["avdec_msmpeg4"];

/// The formats that are read, as people call them.
pub(super) const FORMATS: &str =
    "H.264, H.265, JPEG, VP8, VP9, AV1, MPEG-4 part 2, PNG, BMP and unencoded video";

/// The containers that are read, as people call them.
pub(super) const CONTAINER_FORMATS: &str =
    "MP4, MOV, Matroska, WebM, AVI, MPEG-TS, MPEG-PS, FLV, IVF and Y4M";

/// Returns whether an element of that factory may read what a source gives; a camera's where only the newest is kept.
pub(super) fn is_allowed(factory: &gst::ElementFactory, keep: Keep) -> bool {
    let name = factory.name();
    let is_in = |names: &[&str]| names.contains(&name.as_str());
    let is_of_files = || is_in(&CONTAINERS) || is_in(&DECODERS_OF_FILES);
    is_in(&PARSERS)
        || is_in(&DECODERS)
        || match keep {
            Keep::All => is_of_files(),
            Keep::Newest => is_in(&DEPAYLOADERS),
        }
}

/// Returns whether video of that media type is never read, whatever is installed.
pub(super) fn is_refused(caps: &gst::StructureRef, keep: Keep) -> bool {
    let (name, version) = (caps.name().as_str(), caps.get::<i32>("mpegversion"));
    let is_stream = matches!(caps.get::<bool>("systemstream"), Ok(true));
    let is_read = match name {
        "video/x-h264" | "video/x-h265" | "image/jpeg" | "video/x-vp8" | "video/x-vp9" | "video/x-av1"
        | "video/x-divx" | "video/x-xvid" | "image/png" | "image/bmp" | "video/x-raw"
        | "application/x-rtp" => true,
        "video/mpeg" => version == Ok(4) || is_stream && keep == Keep::All,
        "video/x-msmpeg" => keep == Keep::All,
        "video/mpegts"
        | "video/quicktime"
        | "video/x-matroska"
        | "video/webm"
        | "video/x-msvideo"
        | "video/x-flv"
        | "video/x-ivf"
        | "multipart/x-mixed-replace"
        | "application/x-yuv4mpeg" => keep == Keep::All,
        _ => false,
    };
    !is_read
}
