//! Encoded frames, and the queue in which they wait to be recorded.
//!
//! One streaming thread pushes, one thread takes. The queue is bounded in bytes: when it is full, the frames up to the
//! next key frame are left out and counted, so that what is taken can always be decoded and decoding never waits.

use super::fault::gstreamer_fault;
use super::{Fault, Times, frame_number};
use gstreamer as gst;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What all encoded frames of a stretch of stream have in common: codec, size, the codec's own header.
#[derive(Clone, PartialEq, Eq)]
pub struct EncodedFormat {
    caps: gst::Caps,
}

/// One frame as its camera encoded it. Cheap to clone: the bytes are shared.
#[derive(Clone, Debug)]
pub struct EncodedFrame {
    /// Codec and size.
    pub format: Arc<EncodedFormat>,
    /// Time of its picture in nanoseconds from the stream's own zero; frames come in decoding order, so this may step
    /// back. None where the stream says none.
    pub stream_nanos: Option<i64>,
    /// Nanoseconds to the next picture, where the stream promises them.
    pub interval_nanos: Option<i64>,
    /// Number of the frame in its stream, in decoding order, by which its picture is found; none where it was not numbered.
    pub number: Option<u64>,
    /// Whether decoding can begin with it.
    pub is_key: bool,
    buffer: gst::Buffer,
}

/// Basis of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum FrameKind {
    /// Nothing: decoding can begin with it.
    Key,
    /// Frames before it.
    Delta,
}

/// Encoded frames on their way from a decoder's threads to whoever records them.
#[derive(Debug)]
pub struct EncodedQueue {
    waiting: Mutex<Waiting>,
    max_bytes: usize,
    /// Set once it is known that the stream comes in a form that is not recorded.
    wants_pictures: AtomicBool,
    n_dropped_elsewhere: AtomicU64,
}

#[derive(Debug, Default)]
struct Waiting {
    frames: VecDeque<EncodedFrame>,
    n_bytes: usize,
    /// Whether frames are left out up to the next key frame.
    is_broken: bool,
    n_dropped: u64,
}

impl EncodedFormat {
    /// The format that `caps` describe.
    pub(super) fn new(caps: gst::Caps) -> Self {
        Self { caps }
    }

    pub(super) const fn caps(&self) -> &gst::Caps {
        &self.caps
    }

    /// The format of that media type and nothing else, for tests.
    #[cfg(test)]
    pub(crate) fn named(codec: &str) -> Self {
        gst::init().expect("GStreamer starts");
        Self::new(gst::Caps::new_empty_simple(codec))
    }

    /// The codec's media type, such as `video/x-h264`.
    #[must_use]
    pub fn codec(&self) -> &str {
        self.caps.structure(0).map_or("", |structure| structure.name().as_str())
    }

    /// Columns and rows, where the stream says them.
    #[must_use]
    pub fn size_px(&self) -> Option<(u32, u32)> {
        let structure = self.caps.structure(0)?;
        let side = |name| structure.get::<i32>(name).ok().and_then(|side| u32::try_from(side).ok());
        Some((side("width")?, side("height")?))
    }
}

impl fmt::Debug for EncodedFormat {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The codec's header would fill lines.
        formatter.debug_tuple("EncodedFormat").field(&self.codec()).field(&self.size_px()).finish()
    }
}

impl EncodedFrame {
    /// The frame in `sample`, its time counted as `times` has it; none where a part is missing.
    pub(super) fn of(sample: &gst::Sample, format: Arc<EncodedFormat>, times: Times) -> Option<Self> {
        let buffer = sample.buffer_owned()?;
        let is_key = !buffer.flags().contains(gst::BufferFlags::DELTA_UNIT);
        let stream_nanos = times.nanos(sample, &buffer);
        let interval_nanos = buffer.duration().and_then(|time| i64::try_from(time.nseconds()).ok());
        let number = frame_number::of(&buffer);
        Some(Self { format, stream_nanos, interval_nanos, number, is_key, buffer })
    }

    /// A picture of that size as JPEG, of a stream that came without being encoded. Starts `GStreamer` if nobody has.
    ///
    /// # Errors
    /// When `GStreamer` cannot start.
    pub fn jpeg(
        bytes: Vec<u8>,
        (width, height): (u32, u32),
        stream_nanos: Option<i64>,
        interval_nanos: Option<i64>,
    ) -> Result<Self, Fault> {
        gst::init().map_err(|error| gstreamer_fault("start", &error))?;
        let side = |side: u32| i32::try_from(side).unwrap_or(i32::MAX);
        let caps = gst::Caps::builder("image/jpeg")
            .field("width", side(width))
            .field("height", side(height))
            .build();
        let format = Arc::new(EncodedFormat::new(caps));
        let buffer = gst::Buffer::from_mut_slice(bytes);
        Ok(Self { format, stream_nanos, interval_nanos, number: None, is_key: true, buffer })
    }

    /// Returns a frame of these bytes, of which another process took the times.
    pub(super) fn from_bytes(
        bytes: Vec<u8>,
        format: Arc<EncodedFormat>,
        ([stream_nanos, interval_nanos], number): ([Option<i64>; 2], Option<u64>),
        build: FrameKind,
    ) -> Self {
        let is_key = build == FrameKind::Key;
        let mut buffer = gst::Buffer::from_mut_slice(bytes);
        if let Some(buffer) = buffer.get_mut().filter(|_| !is_key) {
            buffer.set_flags(gst::BufferFlags::DELTA_UNIT);
        }
        Self { format, stream_nanos, interval_nanos, number, is_key, buffer }
    }

    /// A key frame of no bytes, for tests.
    #[cfg(test)]
    pub(crate) fn blank(
        format: Arc<EncodedFormat>,
        stream_nanos: Option<i64>,
        interval_nanos: Option<i64>,
    ) -> Self {
        let buffer = gst::Buffer::new();
        Self { format, stream_nanos, interval_nanos, number: None, is_key: true, buffer }
    }

    pub(super) const fn buffer(&self) -> &gst::Buffer {
        &self.buffer
    }

    /// Bytes of the frame.
    #[must_use]
    pub fn len_bytes(&self) -> usize {
        self.buffer.size()
    }
}

impl EncodedQueue {
    /// An empty queue for at most `max_bytes` of frames.
    #[must_use]
    pub fn new(max_bytes: usize) -> Self {
        Self {
            waiting: Mutex::default(),
            max_bytes,
            wants_pictures: AtomicBool::new(false),
            n_dropped_elsewhere: AtomicU64::new(0),
        }
    }

    /// Adds a frame, or leaves it out where there is no room or one before it was left out.
    pub fn push(&self, frame: EncodedFrame) {
        let mut waiting = self.lock();
        let has_room = waiting.n_bytes + frame.len_bytes() <= self.max_bytes;
        if !has_room || waiting.is_broken && !frame.is_key {
            waiting.is_broken = true;
            waiting.n_dropped += 1;
            return;
        }
        waiting.is_broken = false;
        waiting.n_bytes += frame.len_bytes();
        waiting.frames.push_back(frame);
    }

    /// The frame that has waited longest.
    #[must_use]
    pub fn take(&self) -> Option<EncodedFrame> {
        let mut waiting = self.lock();
        let frame = waiting.frames.pop_front()?;
        waiting.n_bytes -= frame.len_bytes();
        Some(frame)
    }

    /// From now on nothing comes but what is made from the stream's pictures.
    pub(super) fn want_pictures(&self) {
        self.wants_pictures.store(true, Ordering::Relaxed);
    }

    /// Whether the stream comes unencoded, or in a codec that Matroska does not hold: whoever has its pictures pushes them
    /// as JPEG.
    #[must_use]
    pub fn wants_pictures(&self) -> bool {
        self.wants_pictures.load(Ordering::Relaxed)
    }

    /// Returns the number of frames that were left out so far.
    #[must_use]
    pub fn n_dropped(&self) -> u64 {
        self.lock().n_dropped + self.n_dropped_elsewhere.load(Ordering::Relaxed)
    }

    /// Counts frames that were left out before they came here.
    pub(super) fn drop_elsewhere(&self, n_more: u64) {
        self.n_dropped_elsewhere.fetch_add(n_more, Ordering::Relaxed);
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        // No panic falls between two changes that belong together.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: gst::BufferFlags = gst::BufferFlags::empty();
    const DELTA: gst::BufferFlags = gst::BufferFlags::DELTA_UNIT;

    fn frame(n_bytes: usize, flags: gst::BufferFlags, nanos: u64) -> EncodedFrame {
        gst::init().unwrap();
        let mut buffer = gst::Buffer::with_size(n_bytes).unwrap();
        let writable = buffer.get_mut().unwrap();
        writable.set_pts(gst::ClockTime::from_nseconds(nanos));
        writable.set_flags(flags);
        let caps = gst::Caps::builder("video/x-h264").field("width", 64_i32).field("height", 48_i32).build();
        let segment = gst::FormattedSegment::<gst::ClockTime>::new();
        let sample = gst::Sample::builder().buffer(&buffer).caps(&caps).segment(&segment).build();
        EncodedFrame::of(&sample, Arc::new(EncodedFormat::new(caps)), Times::Played).unwrap()
    }

    #[test]
    fn frames_carry_what_their_sample_says() {
        let delta = frame(10, DELTA, 40);
        assert_eq!((delta.stream_nanos, delta.interval_nanos), (Some(40), None));
        assert_eq!((delta.is_key, delta.len_bytes()), (false, 10));
        assert_eq!((delta.format.codec(), delta.format.size_px()), ("video/x-h264", Some((64, 48))));
        assert!(frame(10, KEY, 0).is_key);
    }

    #[test]
    fn a_full_queue_leaves_out_whole_groups_and_counts_them() {
        let queue = EncodedQueue::new(100);
        for (n_bytes, flags, nanos) in [(60, KEY, 0), (30, DELTA, 1), (30, DELTA, 2)] {
            queue.push(frame(n_bytes, flags, nanos));
        }
        assert_eq!(queue.n_dropped(), 1);
        let times =
            || std::iter::from_fn(|| queue.take()).map(|frame| frame.stream_nanos).collect::<Vec<_>>();
        assert_eq!(times(), [Some(0), Some(1)]);
        // There is room again, but without the frame that was left out these cannot be decoded.
        queue.push(frame(5, DELTA, 3));
        assert_eq!((times().len(), queue.n_dropped()), (0, 2));
        queue.push(frame(50, KEY, 4));
        queue.push(frame(5, DELTA, 5));
        assert_eq!(times(), [Some(4), Some(5)]);
        assert_eq!(queue.n_dropped(), 2);
    }
}
