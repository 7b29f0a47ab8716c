//! Learns a clip of the empty place before a camera's own frames come.

use super::{IngestError, MediaRoots, Pipeline, StopFlag, open_stoppable};
use std::path::Path;
use videofields_vision::config::{SourceSettings, Timing};

/// Shows every frame of a clip (or of numbered pictures) to the pipeline's background, timed by the file, or by
/// `rate_hz` where the file's own times are broken. Returns how many frames there were.
///
/// # Errors
/// When the clip cannot be opened or read to its end; what was read until then is learned.
pub fn learn_clip(
    pipeline: &mut Pipeline,
    path: &Path,
    rate_hz: Option<f64>,
    roots: &MediaRoots,
) -> Result<u64, IngestError> {
    learn_clip_stoppable(pipeline, path, rate_hz, roots, &StopFlag::default())
}

/// As [`learn_clip`]; once `stop` is raised it fails with [`IngestError::Stopped`] within a quarter of a second.
///
/// # Errors
/// As [`learn_clip`].
pub fn learn_clip_stoppable(
    pipeline: &mut Pipeline,
    path: &Path,
    rate_hz: Option<f64>,
    roots: &MediaRoots,
    stop: &StopFlag,
) -> Result<u64, IngestError> {
    let settings = SourceSettings {
        timing: rate_hz.map(|_| Timing::Index),
        rate_hz: rate_hz.unwrap_or(25.0),
        ..SourceSettings::of_path(path)
    };
    let mut source = open_stoppable(&settings, roots, stop)?;
    let (mut n_frames, mut before_nanos) = (0, None);
    while let Some(frame) = source.next_frame()? {
        let interval = |before: i64| (frame.stream_nanos - before) as f64 * 1e-9;
        pipeline.learn(&frame.image, before_nanos.map_or(0.0, interval));
        before_nanos = Some(frame.stream_nanos);
        n_frames += 1;
    }
    Ok(n_frames)
}

/// The rate by which a source's frames are timed, if not by the file: its background clip is timed alike.
#[must_use]
pub fn index_rate_hz(settings: &SourceSettings) -> Option<f64> {
    (settings.timing == Some(Timing::Index)).then_some(settings.rate_hz)
}
