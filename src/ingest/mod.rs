//! From files to frames: sources, the thread that paces one camera, and the bounds on what may be opened.
//!
//! In: settings (a path, a timing, an end) and the media roots. Out: `SourceFrame`s in the decoder's own planes,
//! timed from the first one on; a `CameraWorker` turns them into `Frame`s of scene time and hands them to its
//! consumer. Knows nothing of what consumers do with frames, nor of scenes.

mod clip;
mod error;
mod file;
mod images;
mod medium;
mod pacing;
mod pairing;
mod pattern;
mod pipeline;
mod roots;
mod standing;
mod status;
mod stop;
mod timed;
mod unchanging;
mod worker;

pub use clip::{index_rate_hz, learn_clip, learn_clip_stoppable};
pub use error::IngestError;
pub use pipeline::{CHECKPOINT_VERSION, Pipeline};
pub use roots::MediaRoots;
pub use status::{CameraState, CameraStatus, StatusReader};
pub use stop::StopFlag;
pub use worker::{CameraWorker, FrameConsumer};

use crate::config::{SourceSettings, Timing};
use crate::frame::YuvImage;
use crate::media::EncodedFrame;
use std::sync::Arc;

/// One picture of a source, before it belongs to a camera.
#[derive(Clone, Debug)]
pub struct SourceFrame {
    /// The pixels, in the decoder's own planes.
    pub image: Arc<YuvImage>,
    /// Nanoseconds since the source's first frame: 0 for it, then strictly growing, through loops too.
    pub stream_nanos: i64,
    /// Number of the frame, from 0; counts on through loops.
    pub number: u64,
}

/// Whether a source gives the encoded frames beside its pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Tap {
    /// Pictures alone.
    #[default]
    Closed,
    /// Both.
    Open,
}

/// Something that delivers pictures one after the other.
pub trait Source: Send {
    /// The next picture, or `None` after the last. Blocks until there is one, but never for longer than a few
    /// seconds: a source that gives nothing fails.
    ///
    /// # Errors
    /// When the source ends other than by its end: unreadable, damaged, no decoder, silent for too long, stopped.
    fn next_frame(&mut self) -> Result<Option<SourceFrame>, IngestError>;

    /// The next of the frames that pictures are decoded from, in decoding order, its `stream_nanos` that of its picture;
    /// as far as they are known after the picture at hand. None where the source was opened without them.
    fn take_encoded(&mut self) -> Option<EncodedFrame> {
        None
    }

    /// Encoded frames that were left out since the source was opened, because nobody took them in time.
    fn n_encoded_dropped(&self) -> u64 {
        0
    }
}

/// Opens the file or the numbered pictures that `settings` name. A path whose file name has a `%` is a pattern of
/// numbered pictures, every other is a video file.
///
/// # Errors
/// When the path lies outside `roots`, does not exist, cannot be read, or the settings contradict themselves.
/// Whether a file is a video that can be decoded shows with its first frame.
pub fn open(settings: &SourceSettings, roots: &MediaRoots) -> Result<Box<dyn Source>, IngestError> {
    open_stoppable(settings, roots, &StopFlag::default())
}

/// As [`open`]; once `stop` is raised the source fails with [`IngestError::Stopped`] within a quarter of a second.
///
/// # Errors
/// As [`open`].
pub fn open_stoppable(
    settings: &SourceSettings,
    roots: &MediaRoots,
    stop: &StopFlag,
) -> Result<Box<dyn Source>, IngestError> {
    open_tapped(settings, roots, stop, Tap::Closed)
}

/// As [`open_stoppable`], with the frames that the pictures are decoded from where `tap` is open. Numbered pictures have
/// none.
///
/// # Errors
/// As [`open`].
pub fn open_tapped(
    settings: &SourceSettings,
    roots: &MediaRoots,
    stop: &StopFlag,
    tap: Tap,
) -> Result<Box<dyn Source>, IngestError> {
    let is_usable_rate = settings.rate_hz.is_finite() && (0.01..=1000.0).contains(&settings.rate_hz);
    if !is_usable_rate {
        return Err(IngestError::Rate { rate_hz: settings.rate_hz });
    }
    let path = &settings.path;
    if pattern::is_pattern(path) {
        if settings.timing == Some(Timing::Pts) {
            return Err(IngestError::PictureTimes { path: path.clone() });
        }
        let pictures = images::NumberedPictures::open(path, roots, stop)?;
        return Ok(Box::new(timed::TimedSource::new(
            pictures,
            Timing::Index,
            settings.rate_hz,
            settings.end,
        )));
    }
    let file = file::VideoFile::open(path, roots, stop, tap)?;
    let timing = settings.timing.unwrap_or(Timing::Pts);
    Ok(Box::new(timed::TimedSource::new(file, timing, settings.rate_hz, settings.end)))
}
