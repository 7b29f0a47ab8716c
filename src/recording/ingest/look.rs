//! One picture of a source that no camera is fed by yet, and what can be told of the source.
//!
//! Opened as a camera's is, by the same roots and networks; nothing is kept open. A file is sought in, which cameras never do:
//! where its container does not take that, it is read on to the time that is asked for.

use super::endpoint::Endpoint;
use super::images::NumberedPictures;
use super::live::LiveSource;
use super::medium::Medium;
use super::{IngestError, MediaRoots, Polled, Source, StopFlag, Tap, device, file, http, pattern, rtsp};
use std::path::Path;
use std::sync::Arc;
use videofields_vision::config::{Place, Scheme, SourceSettings};
use videofields_vision::frame::YuvImage;

const NANOS_PER_SEC: f64 = 1e9;

/// Polls of a live source for the frames behind its first, which tell how fast they come where it does not say: two seconds of them.
const LOOKS_FOR_INTERVALS: u32 = 20;

/// Most intervals between frames that are measured.
const MAX_INTERVALS: usize = 7;

/// What a source shows.
#[derive(Clone, Debug)]
pub struct Look {
    /// A picture.
    pub image: Arc<YuvImage>,
    /// Frames a second, where the source says it or it shows.
    pub rate_hz: Option<f64>,
    /// What its pictures are encoded in, such as `h264`; none where they come unencoded.
    pub codec: Option<String>,
    /// How long a file is, where it says so.
    pub duration_secs: Option<f64>,
    /// When in a file the picture is seen, seconds after the first.
    pub at_secs: Option<f64>,
}

/// Looks at a source once: at the picture `at_secs` after a file's first, at the next one of a live source. Blocks until there is
/// one, or `stop` is raised.
///
/// # Errors
/// As [`super::open`] and [`Source::next_frame`]; [`IngestError::CutAway`] where a file ends before that time.
pub fn look(
    source: &SourceSettings,
    at_secs: f64,
    roots: &MediaRoots,
    stop: &StopFlag,
) -> Result<Look, IngestError> {
    match source.place() {
        Some(Place::Path(path)) if pattern::is_pattern(path) => {
            of_pictures(path, source.rate_hz, at_secs, (roots, stop))
        }
        Some(Place::Path(path)) => of_file(path, at_secs, (roots, stop)),
        Some(Place::Url(url)) => {
            let endpoint = Endpoint::of(url, roots.networks())?;
            let open = match endpoint.scheme() {
                Scheme::Rtsp | Scheme::Rtsps => rtsp::open,
                Scheme::Http | Scheme::Https => http::open,
            };
            of_live(open(&endpoint, (source, roots), stop, Tap::Closed)?)
        }
        Some(Place::Device(path)) => of_live(device::open(path, source, stop, Tap::Closed)?),
        None => Err(IngestError::NoPlace),
    }
}

fn of_pictures(
    path: &Path,
    rate_hz: f64,
    at_secs: f64,
    (roots, stop): (&MediaRoots, &StopFlag),
) -> Result<Look, IngestError> {
    let pictures = NumberedPictures::open(path, roots, stop, Tap::Closed)?;
    let n_pictures = pictures.n_pictures();
    // A cast from float saturates.
    let idx = (at_secs * rate_hz).floor() as u64;
    let ended = || IngestError::CutAway { path: path.to_path_buf(), n_pictures: n_pictures as i64 };
    let image = pictures.nth(idx)?.ok_or_else(ended)?;
    let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
    Ok(Look {
        image: Arc::new(image),
        rate_hz: Some(rate_hz),
        codec: ending.map(|ending| if ending == "jpg" { "jpeg".to_owned() } else { ending }),
        duration_secs: Some(n_pictures as f64 / rate_hz),
        at_secs: Some(idx as f64 / rate_hz),
    })
}

fn of_file(path: &Path, at_secs: f64, (roots, stop): (&MediaRoots, &StopFlag)) -> Result<Look, IngestError> {
    let mut video = file::VideoFile::open(path, roots, stop, Tap::Closed)?;
    video.begin()?;
    let first = video.next_picture()?.ok_or_else(|| IngestError::Empty { path: path.to_path_buf() })?;
    let (codec, duration_nanos) = video.told();
    // Of a file that does not say it, two pictures do.
    let mut interval_nanos = first.interval_nanos.filter(|nanos| *nanos > 0);
    let zero_nanos = first.stream_nanos.unwrap_or_default();
    let since_first = |nanos: Option<i64>| nanos.map(|nanos| nanos.saturating_sub(zero_nanos));
    let at_nanos = (at_secs * NANOS_PER_SEC).round() as i64;
    let (mut shown, mut shown_nanos) = (first.image, 0);
    if at_nanos > 0 {
        video.seek(zero_nanos.saturating_add(at_nanos));
    }
    let (mut n_pictures, mut is_found) = (1, at_nanos == 0);
    while !is_found || interval_nanos.is_none() {
        let Some(picture) = video.next_picture()? else { break };
        n_pictures += 1;
        let nanos = since_first(picture.stream_nanos).unwrap_or(shown_nanos);
        let step_nanos = nanos.saturating_sub(shown_nanos);
        if is_found {
            interval_nanos = Some(step_nanos).filter(|nanos| *nanos > 0);
            break;
        }
        (shown, shown_nanos) = (picture.image, nanos);
        is_found = nanos >= at_nanos;
    }
    // The last picture is seen until the file ends.
    let is_last = shown_nanos.saturating_add(interval_nanos.unwrap_or_default()) >= at_nanos;
    if !is_found && !is_last {
        return Err(IngestError::CutAway { path: path.to_path_buf(), n_pictures });
    }
    Ok(Look {
        image: Arc::new(shown),
        rate_hz: interval_nanos.map(rate_of),
        codec,
        duration_secs: duration_nanos.map(|nanos| nanos as f64 / NANOS_PER_SEC),
        at_secs: Some(shown_nanos as f64 / NANOS_PER_SEC),
    })
}

/// Returns the middle one of the first intervals between a live source's pictures. While their decoder is started some pictures are
/// replaced, and others come at once.
fn middle_interval(source: &mut LiveSource, mut latest_nanos: i64) -> Option<i64> {
    let mut intervals = Vec::with_capacity(MAX_INTERVALS);
    for _ in 0..LOOKS_FOR_INTERVALS {
        match source.poll() {
            Ok(Polled::Frame(next)) => intervals.push(next.stream_nanos - latest_nanos),
            Ok(Polled::Waiting) => continue,
            // The first picture of a source that fails now is good all the same.
            _ => break,
        }
        latest_nanos += intervals.last().copied().unwrap_or(0);
        if intervals.len() == MAX_INTERVALS {
            break;
        }
    }
    intervals.sort_unstable();
    intervals.get(intervals.len() / 2).copied().filter(|nanos| *nanos > 0)
}

fn of_live(mut source: LiveSource) -> Result<Look, IngestError> {
    let first = loop {
        match source.poll()? {
            Polled::Frame(frame) => break frame,
            Polled::Waiting => {}
            Polled::Ended => return Err(IngestError::Empty { path: source.place().into() }),
        }
    };
    let interval_nanos = source.interval_nanos().or_else(|| middle_interval(&mut source, first.stream_nanos));
    Ok(Look {
        image: first.image,
        rate_hz: interval_nanos.map(rate_of),
        codec: source.codec(),
        duration_secs: None,
        at_secs: None,
    })
}

/// Frames a second, to a thousandth.
fn rate_of(interval_nanos: i64) -> f64 {
    (NANOS_PER_SEC / interval_nanos as f64 * 1e3).round() / 1e3
}
