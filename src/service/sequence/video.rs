//! Pictures of a video by time: decoded forwards from where the last one was found, sought where that is far.

use std::path::{Path, PathBuf};
use videofields_recording::ingest::{IngestError, MediaRoots, Medium as _, StopFlag, Tap, VideoFile};
use videofields_recording::media::Picture;
use videofields_vision::frame::{RgbImage, YuvImage};

/// A time no farther ahead than this is decoded up to; what lies farther is sought.
const FORWARD_NANOS: i64 = 2_000_000_000;

/// Between two pictures where nothing tells.
const USUAL_INTERVAL_NANOS: i64 = 40_000_000;

/// A video of a camera.
pub(super) struct Video {
    path: PathBuf,
    roots: MediaRoots,
    /// Pictures a second, where its own times are not to be used.
    rate_hz: Option<f64>,
    decoding: Option<Decoding>,
}

impl std::fmt::Debug for Video {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Video").field("path", &self.path).finish_non_exhaustive()
    }
}

/// Where decoding stands: a picture, and the one after it.
struct Decoding {
    file: VideoFile,
    /// The container's time of the first picture.
    zero_nanos: i64,
    n_pictures: i64,
    interval_nanos: i64,
    shown: Timed,
    next: Option<Timed>,
    is_from_start: bool,
}

struct Timed {
    nanos: i64,
    image: YuvImage,
}

impl Video {
    pub(super) fn new(path: &Path, roots: &MediaRoots, rate_hz: Option<f64>) -> Self {
        Self { path: path.to_path_buf(), roots: roots.clone(), rate_hz, decoding: None }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The picture nearest to a time after the first one, no farther from it than two pictures are from each other; none where the video
    /// has none.
    pub(super) fn at(&mut self, nanos: i64) -> Result<Option<RgbImage>, IngestError> {
        let goes_on = |decoding: &Decoding| {
            let is_behind = decoding.shown.nanos <= nanos || decoding.is_at_first();
            let is_near =
                self.rate_hz.is_some() || nanos.saturating_sub(decoding.shown.nanos) <= FORWARD_NANOS;
            is_behind && (is_near || decoding.next.is_none())
        };
        let kept = self.decoding.take().filter(goes_on);
        let mut decoding = match kept {
            Some(decoding) => decoding,
            None => self.begin(nanos)?,
        };
        while decoding.next.as_ref().is_some_and(|next| next.nanos <= nanos) {
            if let Some(next) = decoding.next.take() {
                decoding.shown = next;
            }
            decoding.next = decoding.pull(self.rate_hz)?;
        }
        let away = |timed: &Timed| timed.nanos.saturating_sub(nanos).saturating_abs();
        let next = decoding.next.as_ref().filter(|next| away(next) < away(&decoding.shown));
        let nearest = next.unwrap_or(&decoding.shown);
        let interval_nanos =
            decoding.next.as_ref().map_or(decoding.interval_nanos, |next| next.nanos - decoding.shown.nanos);
        let found = (away(nearest) <= interval_nanos).then(|| nearest.image.to_rgb());
        self.decoding = Some(decoding);
        Ok(found)
    }

    fn begin(&self, nanos: i64) -> Result<Decoding, IngestError> {
        let start = || {
            let mut file = VideoFile::open(&self.path, &self.roots, &StopFlag::default(), Tap::Closed)?;
            file.begin()?;
            let first = file.next_picture()?;
            let first = first.ok_or_else(|| IngestError::Empty { path: self.path.clone() })?;
            Ok::<_, IngestError>((file, first))
        };
        let (file, first) = start()?;
        let mut decoding = Decoding {
            file,
            zero_nanos: first.stream_nanos.unwrap_or_default(),
            n_pictures: 1,
            interval_nanos: first.interval_nanos.filter(|nanos| *nanos > 0).unwrap_or(USUAL_INTERVAL_NANOS),
            shown: Timed { nanos: 0, image: first.image },
            next: None,
            is_from_start: true,
        };
        if let Some(rate_hz) = self.rate_hz {
            decoding.interval_nanos = (1e9 / rate_hz).round() as i64;
        } else if nanos > FORWARD_NANOS {
            decoding.file.seek(decoding.zero_nanos.saturating_add(nanos));
            let sought = decoding.file.next_picture()?;
            let time = |picture: &Picture| Some(picture.stream_nanos?.saturating_sub(decoding.zero_nanos));
            match sought.and_then(|picture| Some((time(&picture)?, picture))) {
                Some((found_nanos, picture)) if found_nanos <= nanos => {
                    decoding.shown = Timed { nanos: found_nanos, image: picture.image };
                    decoding.is_from_start = false;
                }
                // A file that is not sought in, or whose times are none.
                _ => decoding.file = start()?.0,
            }
        }
        decoding.next = decoding.pull(self.rate_hz)?;
        Ok(decoding)
    }
}

impl Decoding {
    /// Whether the picture that is shown is the video's first.
    const fn is_at_first(&self) -> bool {
        self.is_from_start && self.shown.nanos == 0
    }

    fn pull(&mut self, rate_hz: Option<f64>) -> Result<Option<Timed>, IngestError> {
        let Some(picture) = self.file.next_picture()? else { return Ok(None) };
        let following = self.shown.nanos.saturating_add(self.interval_nanos);
        let nanos = match (rate_hz, picture.stream_nanos) {
            (Some(rate_hz), _) => (self.n_pictures as f64 / rate_hz * 1e9).round() as i64,
            (None, Some(told)) => {
                let told = told.saturating_sub(self.zero_nanos);
                if told > self.shown.nanos { told } else { following }
            }
            (None, None) => following,
        };
        self.n_pictures += 1;
        Ok(Some(Timed { nanos, image: picture.image }))
    }
}
