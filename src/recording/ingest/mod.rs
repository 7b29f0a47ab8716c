//! From files and cameras to frames: sources, the thread that paces one camera, and the bounds on what may be opened.
//!
//! In: settings (a path, a URL or a device, and what goes with each), and the folders and networks that may be reached. Out: `SourceFrame`s in the decoder's own planes,
//! timed from the first one on; a `CameraWorker` turns them into `Frame`s of scene time and hands them to its
//! consumer. Knows nothing of what consumers do with frames, nor of scenes.

mod arrival;
mod browse;
mod clip;
mod device;
mod endpoint;
mod error;
mod file;
mod http;
mod images;
mod jpeg;
mod live;
mod look;
mod losses;
mod medium;
mod pacing;
mod pairing;
mod pattern;
mod pipeline;
mod reach;
mod roots;
mod rtsp;
mod secret;
mod standing;
mod status;
mod stop;
mod time_map;
mod timed;
mod together;
mod unchanging;
mod worker;

pub use browse::{FoundFile, FoundFiles, browse, devices};
pub use clip::{index_rate_hz, learn_clip, learn_clip_stoppable};
pub(crate) use endpoint::Endpoint;
pub use error::IngestError;
pub use file::VideoFile;
pub use images::{read_bytes, read_picture};
pub use jpeg::recorded_as_jpeg;
pub use look::{Look, look};
pub use medium::Medium;
pub use pattern::Pattern;
pub use pipeline::{CHECKPOINT_VERSION, Pipeline};
pub use reach::CameraError;
pub use roots::MediaRoots;
pub(crate) use secret::Credentials;
pub use status::{CameraState, CameraStatus, StatusReader};
pub use stop::StopFlag;
pub use together::{Member, Together};
pub use worker::{CameraWorker, Feed, FrameConsumer};

use crate::media::{Decoding, EncodedFrame};
use std::sync::Arc;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{Place, Scheme, SourceSettings, Timing};
use videofields_vision::frame::YuvImage;

/// One picture of a source, before it belongs to a camera.
#[derive(Clone, Debug)]
pub struct SourceFrame {
    /// The pixels, in the decoder's own planes.
    pub image: Arc<YuvImage>,
    /// Nanoseconds since the source's first frame: 0 for it, then strictly growing, through loops too.
    pub stream_nanos: i64,
    /// Number of the frame, from 0; counts on through loops.
    pub number: u64,
    /// When it was taken as the camera says, if it does.
    pub reference: Option<Timestamp>,
}

/// What a source has at the moment.
#[derive(Clone, Debug)]
pub enum Polled {
    /// The next picture.
    Frame(SourceFrame),
    /// Nothing yet; live sources only.
    Waiting,
    /// Nothing more.
    Ended,
}

/// Frames that a source left out since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lost {
    /// A newer one came before they were taken; of live sources alone.
    pub n_replaced: u64,
    /// They could not be decoded whole.
    pub n_damaged: u64,
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

    /// Says that no picture comes any more, so that the encoded frames that wait for theirs are not held back.
    fn end_encoded(&mut self) {}

    /// Encoded frames that were left out since the source was opened, because nobody took them in time.
    fn n_encoded_dropped(&self) -> u64 {
        0
    }

    /// As [`Self::next_frame`], but a live source waits no longer than about a tenth of a second.
    ///
    /// # Errors
    /// As [`Self::next_frame`], but a live source that is silent does not fail: how long that lasts is its user's choice.
    fn poll(&mut self) -> Result<Polled, IngestError> {
        Ok(self.next_frame()?.map_or(Polled::Ended, Polled::Frame))
    }

    /// Whether pictures come when they are taken and wait for nobody: a newer one replaces one that was not taken.
    fn is_live(&self) -> bool {
        false
    }

    /// What messages call a live source: scheme, host and port, or the device.
    fn place(&self) -> &str {
        ""
    }

    /// Returns the process that decodes it and what holds that; none before its first picture, and where nothing is decoded.
    fn decoding(&self) -> Option<Decoding> {
        None
    }

    /// Returns what it left out so far.
    fn lost(&self) -> Lost {
        Lost::default()
    }

    /// Returns what is wrong with a file although its pictures come.
    fn concern(&self) -> Option<&str> {
        None
    }
}

/// Opens the file, the numbered pictures or the camera that `settings` name. A path whose file name has a `%` is a
/// pattern of numbered pictures, every other is a video file.
///
/// # Errors
/// When the path lies outside `roots`, does not exist or cannot be read, the camera's address is none that may be
/// reached, or the settings contradict themselves. Whether a file is a video that can be decoded and whether a camera
/// answers shows with the first frame.
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

/// As [`open_stoppable`], with the frames that the pictures are decoded from where `tap` is open: as JPEG where they come
/// unencoded, or in a form that is not recorded.
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
    let path = match settings.place() {
        Some(Place::Path(path)) => path,
        Some(Place::Url(url)) => {
            let endpoint = Endpoint::of(url, roots.networks())?;
            let open = match endpoint.scheme() {
                Scheme::Rtsp | Scheme::Rtsps => rtsp::open,
                Scheme::Http | Scheme::Https => http::open,
            };
            return Ok(Box::new(open(&endpoint, (settings, roots), stop, tap)?));
        }
        Some(Place::Device(device)) => return Ok(Box::new(device::open(device, settings, stop, tap)?)),
        None => return Err(IngestError::NoPlace),
    };
    if pattern::is_pattern(path) {
        if settings.timing == Some(Timing::Pts) {
            return Err(IngestError::PictureTimes { path: path.to_path_buf() });
        }
        let pictures = images::NumberedPictures::open(path, roots, stop, tap)?;
        let timed = timed::TimedSource::new(pictures, Timing::Index, settings.rate_hz, settings.end);
        return Ok(Box::new(timed.with_cut(cut_of(settings))));
    }
    let file = VideoFile::open(path, roots, stop, tap)?;
    let timing = settings.timing.unwrap_or(Timing::Pts);
    let timed = timed::TimedSource::new(file, timing, settings.rate_hz, settings.end);
    Ok(Box::new(timed.with_cut(cut_of(settings))))
}

/// The part of a file that is played.
fn cut_of(settings: &SourceSettings) -> timed::Cut {
    // Checked with the configuration; a cast from float saturates.
    let nanos = |secs: f64| (secs * 1e9).round() as i64;
    timed::Cut { from_nanos: nanos(settings.from_secs), until_nanos: settings.until_secs.map(nanos) }
}
