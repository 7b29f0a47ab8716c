//! One camera's clips of a span: its recorded frames from the key frame before the span to the span's end.

use super::ExportError;
use super::folder::ExportFolder;
use super::manifest::{Clip, Unreadable};
use super::redraw::Redraw;
use crate::archive::ArchiveError;
use crate::archive::shared::Shared;
use crate::media::{ClipContainer, ClipWriter, Demuxer, EncodedFormat, EncodedFrame, Input};
use crate::store::{SegmentRecord, SegmentState};
use std::collections::VecDeque;
use std::sync::Arc;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// What lies further apart than this, and than twice the frames before it, is no longer one clip, and is a gap.
const GAP_NANOS: i64 = 1_000_000_000;

/// Frames at or after the span's end that are read on for one before it: more than any camera puts out of order.
const MAX_HELD: usize = 32;

/// Bytes of frames before the span, from their key frame on, that wait for the first one within it.
const MAX_BEFORE_BYTES: usize = 256 << 20;

/// Told of each frame, with its time and bytes; ends the export by its failure.
type Tell<'a> = dyn FnMut(Timestamp, u64) -> Result<(), ExportError> + 'a;

/// A camera's part of the manifest.
#[derive(Debug)]
pub(super) struct Written {
    pub(super) clips: Vec<Clip>,
    pub(super) gaps: Vec<[String; 2]>,
    pub(super) unreadable: Vec<Unreadable>,
}

/// Writes one camera's clips.
pub(super) struct Clips<'a> {
    shared: &'a Shared,
    folder: &'a ExportFolder,
    from: Timestamp,
    to: Timestamp,
    camera: &'a CameraId,
    /// Whether all is to be finished.
    goes_on: &'a dyn Fn() -> bool,
    open: Option<OpenClip>,
    written: Vec<Clip>,
    unreadable: Vec<Unreadable>,
    /// From when to when each of them shows.
    spans: Vec<(Timestamp, Timestamp)>,
}

/// The clip that is being written.
struct OpenClip {
    writer: ClipWriter,
    format: Arc<EncodedFormat>,
    name: String,
    first_at: Timestamp,
    last_at: Timestamp,
    /// Between its newest two frames.
    interval_nanos: i64,
    n_frames: u64,
    recorded_in: Vec<String>,
}

/// A frame and its scene time.
type Timed = (EncodedFrame, Timestamp);

/// What is known of a segment while it is read.
struct Passage {
    path: String,
    /// Frames before the span, from the newest key frame on.
    before: Vec<Timed>,
    before_bytes: usize,
    /// Frames at or after the span's end, of which it is not known yet whether one before it follows.
    held: VecDeque<Timed>,
    has_ended: bool,
}

impl<'a> Clips<'a> {
    pub(super) fn new(
        (shared, folder): (&'a Shared, &'a ExportFolder),
        (from, to): (Timestamp, Timestamp),
        camera: &'a CameraId,
        goes_on: &'a dyn Fn() -> bool,
    ) -> Self {
        let (written, unreadable) = (Vec::new(), Vec::new());
        Self { shared, folder, from, to, camera, goes_on, open: None, written, unreadable, spans: Vec::new() }
    }

    /// Writes all of them. A recorded file that cannot be read costs what it holds.
    pub(super) fn write(mut self, tell: &mut Tell<'_>) -> Result<Written, ExportError> {
        let mut next = self.first_segment()?;
        while let Some(segment) = next {
            let begins_at = segment.first_at;
            if begins_at >= self.to {
                break;
            }
            match self.copy(segment, tell) {
                Err(ExportError::Unreadable { path: recorded_in, reason }) => {
                    tracing::warn!(recorded_in, reason, "a recorded file is exported as far as it is read");
                    self.unreadable.push(Unreadable { recorded_in, reason });
                }
                copied => copied?,
            }
            next = self.segment_after(begins_at)?;
        }
        self.ended()
    }

    /// Writes all of them from pictures that are drawn anew. What cannot be drawn ends the export.
    pub(super) fn redraw(mut self, redraw: &dyn Redraw, tell: &mut Tell<'_>) -> Result<Written, ExportError> {
        let mut after = self.from.saturating_add_nanos(-1);
        while let Some((frame, at)) = redraw.next_after(after, self.to).map_err(ExportError::NotRedrawn)? {
            tell(at, frame.len_bytes() as u64)?;
            self.append((frame, at), None)?;
            after = at;
        }
        self.ended()
    }

    fn ended(mut self) -> Result<Written, ExportError> {
        self.close()?;
        let gaps = gaps(&self.spans, (self.from, self.to));
        let gaps = gaps.into_iter().map(|(from, to)| [from.to_string(), to.to_string()]).collect();
        Ok(Written { clips: self.written, gaps, unreadable: self.unreadable })
    }

    /// The segment in which the span begins, or the first one behind that.
    fn first_segment(&self) -> Result<Option<SegmentRecord>, ExportError> {
        let shared = self.shared;
        let before = shared.runtime.block_on(shared.store.segment_before(self.camera, self.from));
        // The row of one that is being written is behind its frames.
        let reaches =
            |segment: &SegmentRecord| segment.last_at >= self.from || segment.state == SegmentState::Open;
        match before.map_err(ArchiveError::from)?.filter(reaches) {
            Some(segment) => Ok(Some(segment)),
            None => self.segment_after(self.from),
        }
    }

    fn segment_after(&self, at: Timestamp) -> Result<Option<SegmentRecord>, ExportError> {
        let shared = self.shared;
        let after = shared.runtime.block_on(shared.store.segment_after(self.camera, at));
        Ok(after.map_err(ArchiveError::from)?)
    }

    /// Copies what a segment has of the span.
    fn copy(&mut self, segment: SegmentRecord, tell: &mut Tell<'_>) -> Result<(), ExportError> {
        let (path, first_at) = (segment.path.clone(), segment.first_at);
        let unreadable = |reason: String| ExportError::Unreadable { path: path.clone(), reason };
        let reading = self.shared.open(segment, self.from.max(first_at));
        let reading = reading.map_err(|error| unreadable(error.without_places()))?;
        let starts_at = reading.starts_at();
        let mut demuxer =
            Demuxer::start(Input::stream(reading)).map_err(|fault| unreadable(fault.to_string()))?;
        let mut passage = Passage {
            path: path.clone(),
            before: Vec::new(),
            before_bytes: 0,
            held: VecDeque::new(),
            has_ended: false,
        };
        while !passage.has_ended
            && let Some(frame) = demuxer.frame(self.goes_on).map_err(|fault| unreadable(fault.to_string()))?
        {
            // Blocks without a time are none of ours.
            let Some(nanos) = frame.stream_nanos else { continue };
            let at = first_at.saturating_add_nanos(nanos);
            // What is shown before the key frame cannot be decoded without the group before.
            if at < starts_at {
                continue;
            }
            tell(at, frame.len_bytes() as u64)?;
            self.take((frame, at), &mut passage)?;
        }
        Ok(())
    }

    /// Takes one frame in decoding order.
    fn take(&mut self, timed: Timed, passage: &mut Passage) -> Result<(), ExportError> {
        let (frame, at) = (&timed.0, timed.1);
        if at >= self.to {
            // Pictures that follow a key frame may be shown before it, as long as none came that is shown after it.
            let follows_key = passage.held.iter().any(|(held, held_at)| held.is_key && at > *held_at);
            passage.has_ended = follows_key || passage.held.len() == MAX_HELD;
            passage.held.push_back(timed);
            return Ok(());
        }
        if at < self.from {
            if frame.is_key {
                passage.before.clear();
                passage.before_bytes = 0;
            }
            passage.before_bytes += frame.len_bytes();
            if passage.before_bytes > MAX_BEFORE_BYTES {
                let reason = "its key frames are too far apart".to_owned();
                return Err(ExportError::Unreadable { path: passage.path.clone(), reason });
            }
            // Its group may hold frames of the span whose pictures build on it.
            passage.before.push(timed);
            return Ok(());
        }
        let earlier = std::mem::take(&mut passage.before).into_iter();
        for timed in earlier.chain(passage.held.drain(..)).chain([timed]) {
            self.append(timed, Some(&passage.path))?;
        }
        Ok(())
    }

    /// Adds a frame, and the recorded file that it comes from if it comes from one as it is.
    fn append(&mut self, (frame, at): Timed, path: Option<&str>) -> Result<(), ExportError> {
        // Within a segment there is one format, and pictures build on one another.
        let goes_on = |clip: &OpenClip| {
            let reach_nanos = clip.interval_nanos.saturating_mul(2).max(GAP_NANOS);
            let is_near = at.nanos_since(clip.last_at) <= reach_nanos;
            clip.recorded_in.last().is_some_and(|last| Some(last.as_str()) == path)
                || is_near && *clip.format == *frame.format
        };
        if self.open.as_ref().is_some_and(|clip| !goes_on(clip)) {
            self.close()?;
        }
        if self.open.is_none() {
            // Decoding begins with a key frame.
            if !frame.is_key {
                return Ok(());
            }
            self.open = Some(self.begin(&frame.format, at)?);
        }
        let Some(clip) = &mut self.open else { return Ok(()) };
        let Ok(nanos) = u64::try_from(at.nanos_since(clip.first_at)) else { return Ok(()) };
        clip.writer.push(&frame, nanos, self.goes_on).map_err(ExportError::Unwritable)?;
        if at > clip.last_at {
            clip.interval_nanos = at.nanos_since(clip.last_at);
            clip.last_at = at;
        }
        clip.n_frames += 1;
        if let Some(path) = path.filter(|path| clip.recorded_in.last().is_none_or(|last| last != path)) {
            clip.recorded_in.push(path.to_owned());
        }
        Ok(())
    }

    fn begin(&self, format: &Arc<EncodedFormat>, at: Timestamp) -> Result<OpenClip, ExportError> {
        let extension = ClipContainer::of(format).extension();
        // Colons are not for names of files everywhere.
        let instant = at.to_string().replace(['-', ':'], "");
        let name = format!("{}-{instant}.{extension}", self.camera);
        let file = self.folder.create(&name)?;
        let writer = ClipWriter::start(format, file).map_err(ExportError::Unwritable)?;
        Ok(OpenClip {
            writer,
            format: Arc::clone(format),
            name,
            first_at: at,
            last_at: at,
            interval_nanos: 0,
            n_frames: 0,
            recorded_in: Vec::new(),
        })
    }

    /// Finishes the clip that is being written.
    fn close(&mut self) -> Result<(), ExportError> {
        let Some(clip) = self.open.take() else { return Ok(()) };
        clip.writer.finish(self.goes_on).map_err(ExportError::Unwritable)?;
        let digest = self.folder.digest(&clip.name, self.goes_on)?;
        let (bytes, sha256) = digest.ok_or(ExportError::Cancelled)?;
        self.spans.push((clip.first_at, clip.last_at));
        self.written.push(Clip {
            file: clip.name,
            sha256,
            bytes,
            media_type: ClipContainer::of(&clip.format).media_type().to_owned(),
            codec: clip.format.codec().to_owned(),
            size_px: clip.format.size_px().map(|(width, height)| [width, height]),
            first_at: clip.first_at.to_string(),
            last_at: clip.last_at.to_string(),
            frames: clip.n_frames,
            recorded_in: clip.recorded_in,
        });
        Ok(())
    }
}

/// What of `span` no clip shows; that between two frames of a camera is no gap.
fn gaps(spans: &[(Timestamp, Timestamp)], (from, to): (Timestamp, Timestamp)) -> Vec<(Timestamp, Timestamp)> {
    let mut gaps = Vec::new();
    let mut shown_until = from;
    for (first, last) in spans.iter().copied().chain([(to, to)]) {
        if first.nanos_since(shown_until) > GAP_NANOS {
            gaps.push((shown_until, first));
        }
        shown_until = shown_until.max(last);
    }
    gaps
}
