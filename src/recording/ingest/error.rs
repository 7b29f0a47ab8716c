//! What can go wrong between a path and its frames.

use crate::media::{ConnectionFault, Fault, SIZE_LIMIT};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::YuvError;

/// A source that cannot be opened or read on. Paths stand as they were asked for, escaped.
#[derive(Debug, thiserror::Error)]
pub enum IngestError {
    /// A folder named as a media root cannot be used.
    #[error("cannot use {path:?} as a media root: {source}")]
    Root {
        /// The root as configured.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The path leads out of the media roots, perhaps through a symbolic link.
    #[error("{path:?} lies outside the media roots, allowed are files beneath {allowed}")]
    Outside {
        /// The path as asked for.
        path: PathBuf,
        /// The roots as configured, joined by commas.
        allowed: String,
    },
    /// The file is the daemon's own: a recording, an export, a snapshot, a database.
    #[error(
        "{path:?} belongs to what the daemon keeps itself (recordings, exports, snapshots, databases), which is no source: \
         export a recording and put the export beneath a media root"
    )]
    Private {
        /// The path as asked for.
        path: PathBuf,
    },
    /// The path has a step upwards.
    #[error("{path:?} has a `..`, which file sources do not take: name the file beneath {allowed} directly")]
    ParentStep {
        /// The path as asked for.
        path: PathBuf,
        /// The roots as configured, joined by commas.
        allowed: String,
    },
    /// The path is a URL. Only its scheme is told: the rest may hold a password.
    #[error(
        "{scheme:?} URLs are no paths: a path is a file or a pattern of numbered pictures beneath {allowed}, and a \
         camera's URL stands in the key url"
    )]
    Url {
        /// What stands before `://`.
        scheme: String,
        /// The roots as configured, joined by commas.
        allowed: String,
    },
    /// A camera is not reached, or sends nothing.
    #[error(transparent)]
    Camera(#[from] super::CameraError),
    /// The settings name no source, or several.
    #[error("exactly one of path, url and device is needed")]
    NoPlace,
    /// Nothing is there.
    #[error("there is no file {path:?}")]
    NotFound {
        /// The path as asked for.
        path: PathBuf,
    },
    /// A folder, a device, a pipe.
    #[error("{path:?} is no regular file")]
    NotAFile {
        /// The path as asked for.
        path: PathBuf,
    },
    /// A file, where a folder is asked for.
    #[error("{path:?} is no folder")]
    NotAFolder {
        /// The path as asked for.
        path: PathBuf,
    },
    /// Reading fails.
    #[error("cannot read {path:?}: {source}")]
    Unreadable {
        /// The path as asked for.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A `%` that does not make a pattern.
    #[error("{path:?} is no pattern of numbered pictures: {reason}")]
    Pattern {
        /// The path as asked for.
        path: PathBuf,
        /// What is wrong and what is allowed.
        reason: &'static str,
    },
    /// No picture fits the pattern.
    #[error("no file fits the pattern {path:?}")]
    NoPictures {
        /// The pattern.
        path: PathBuf,
    },
    /// A number is left out.
    #[error("picture {missing} of {path:?} is missing, though higher numbers are there")]
    Gap {
        /// The pattern.
        path: PathBuf,
        /// The first number that is left out.
        missing: u64,
    },
    /// A picture cannot be decoded.
    #[error("cannot decode {path:?} (JPEG or PNG of at most {SIZE_LIMIT}): {source}")]
    Picture {
        /// The picture's file.
        path: PathBuf,
        /// Why.
        source: image::ImageError,
    },
    /// Numbered pictures have no timestamps of their own.
    #[error("{path:?} is a pattern of pictures, which have no timestamps: timing must be \"index\"")]
    PictureTimes {
        /// The pattern.
        path: PathBuf,
    },
    /// A frame rate out of range.
    #[error("rate_hz must be 0.01 to 1000, got {rate_hz}")]
    Rate {
        /// The rate as asked for.
        rate_hz: f64,
    },
    /// The file is of no type that `GStreamer` knows, or has no video in it.
    #[error("{path:?} holds no video that GStreamer knows: {detail}")]
    NotVideo {
        /// The path as asked for.
        path: PathBuf,
        /// What was found instead.
        detail: String,
    },
    /// A demuxer or decoder is not installed.
    #[error("{path:?} needs a {codec}, which is not installed; the Debian package {package} may have it")]
    MissingCodec {
        /// The path as asked for.
        path: PathBuf,
        /// What is missing, in `GStreamer`'s words.
        codec: String,
        /// The package or packages that may have it.
        package: Cow<'static, str>,
    },
    /// A video without a single frame.
    #[error("{path:?} ends before its first frame")]
    Empty {
        /// The path as asked for.
        path: PathBuf,
    },
    /// A video that has ended before the part of it begins that is to be played.
    #[error("{path:?} has {n_pictures} frames, and none of them lies in the part that is to be played")]
    CutAway {
        /// The path as asked for.
        path: PathBuf,
        /// Its frames, as far as they were looked at.
        n_pictures: i64,
    },
    /// Decoding broke off.
    #[error("{path:?} cannot be decoded further: {detail}")]
    Damaged {
        /// The path as asked for.
        path: PathBuf,
        /// What the decoder said.
        detail: String,
    },
    /// The process that decodes it ended.
    #[error("{path:?} is not decoded any more: its decoding process ended, since {how}")]
    Worker {
        /// The path as asked for.
        path: PathBuf,
        /// Manner in which it ended.
        how: String,
    },
    /// A format that is never read.
    #[error("{path:?} holds {format}, which is not supported; supported are {allowed}")]
    Refused {
        /// The path as asked for.
        path: PathBuf,
        /// The format.
        format: String,
        /// The formats that are read.
        allowed: String,
    },
    /// Frames larger than the limits.
    #[error("{path:?} has frames of {width} x {height} pixels, allowed are {SIZE_LIMIT}")]
    TooLarge {
        /// The path as asked for.
        path: PathBuf,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// No frame came for too long.
    #[error("{path:?} gave no frame for {secs} s")]
    Silent {
        /// The path as asked for.
        path: PathBuf,
        /// Seconds waited.
        secs: u64,
    },
    /// The stop flag was raised.
    #[error("the source was stopped")]
    Stopped,
    /// The decoder's buffer does not hold the picture that it announced.
    #[error("{path:?} was decoded into a buffer that does not hold it: {source}")]
    Layout {
        /// The path as asked for.
        path: PathBuf,
        /// What does not fit.
        source: YuvError,
    },
    /// `GStreamer` itself fails.
    #[error("GStreamer cannot {action}: {detail}")]
    Gstreamer {
        /// What was tried.
        action: Cow<'static, str>,
        /// What it said.
        detail: String,
    },
    /// The camera's thread cannot be started.
    #[error("cannot start the thread of camera {camera}: {source}")]
    Thread {
        /// The camera.
        camera: videofields_vision::frame::CameraId,
        /// Why.
        source: std::io::Error,
    },
}

impl IngestError {
    /// Returns the error that a fault of the file or the camera at `place` is.
    pub(super) fn of_fault(place: &(impl AsRef<Path> + ?Sized), fault: Fault) -> Self {
        let path = place.as_ref().to_path_buf();
        match fault {
            Fault::NotVideo(detail) => Self::NotVideo { path, detail },
            Fault::MissingCodec { codec, package } => Self::MissingCodec { path, codec, package },
            Fault::Refused { format, allowed } => Self::Refused { path, format, allowed },
            Fault::TooLarge { width, height } => Self::TooLarge { path, width, height },
            Fault::Damaged(detail) => Self::Damaged { path, detail },
            Fault::Worker(how) => Self::Worker { path, how },
            Fault::Gstreamer { action, detail } => Self::Gstreamer { action, detail },
            Fault::Connection(fault) => {
                super::CameraError::Connection { place: path.display().to_string(), fault }.into()
            }
        }
    }

    /// Returns the fault for callers who do not administer the site: no path, no address, and nothing of what answers there.
    pub(super) fn public_text(&self) -> String {
        let cause = match self {
            Self::Camera(_) => "it cannot be connected",
            Self::TooLarge { .. } => "its frames are too large",
            Self::Refused { .. } | Self::MissingCodec { .. } => "its video's format is not supported",
            Self::Damaged { .. } | Self::Worker { .. } => "its video cannot be decoded further",
            Self::Silent { .. } => "it gave no frame for too long",
            Self::Layout { .. } | Self::Gstreamer { .. } | Self::Thread { .. } => "decoding fails",
            Self::Stopped => "it is stopped",
            _ => "its file cannot be played",
        };
        format!("{cause}; administrators see more")
    }

    /// Whether the fault lies in what the source holds, so that reading it again meets it again.
    #[must_use]
    pub(super) const fn is_of_content(&self) -> bool {
        matches!(
            self,
            Self::Damaged { .. }
                | Self::Picture { .. }
                | Self::Layout { .. }
                | Self::Refused { .. }
                | Self::TooLarge { .. }
        )
    }

    /// Returns true where what was played of a recording until this fault cannot be followed by anything but itself.
    #[must_use]
    pub(super) const fn ends_a_recording(&self) -> bool {
        self.is_of_content() || matches!(self, Self::Worker { .. })
    }

    /// Returns whether a camera refused the user or the password that it was given.
    #[must_use]
    pub(super) const fn is_login_refused(&self) -> bool {
        matches!(
            self,
            Self::Camera(super::CameraError::Connection { fault: ConnectionFault::LoginRefused, .. })
        )
    }

    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Camera(error) => error.kind(),
            Self::NoPlace
            | Self::Root { .. }
            | Self::Outside { .. }
            | Self::Private { .. }
            | Self::ParentStep { .. }
            | Self::Url { .. }
            | Self::NotAFile { .. }
            | Self::NotAFolder { .. }
            | Self::Pattern { .. }
            | Self::Gap { .. }
            | Self::Picture { .. }
            | Self::PictureTimes { .. }
            | Self::Rate { .. }
            | Self::NotVideo { .. }
            | Self::Empty { .. }
            | Self::CutAway { .. }
            | Self::Damaged { .. } => ErrorKind::Invalid,
            Self::NotFound { .. } | Self::NoPictures { .. } => ErrorKind::NotFound,
            Self::MissingCodec { .. } | Self::Refused { .. } => ErrorKind::Unsupported,
            Self::TooLarge { .. } => ErrorKind::TooLarge,
            Self::Unreadable { .. } | Self::Silent { .. } | Self::Stopped | Self::Worker { .. } => {
                ErrorKind::Unavailable
            }
            Self::Layout { .. } | Self::Gstreamer { .. } | Self::Thread { .. } => ErrorKind::Internal,
        }
    }
}
