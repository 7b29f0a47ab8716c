//! Frames of the past: what a camera showed at an instant, decoded from what was recorded.
//!
//! In: a camera and an instant. Out: the recorded frame nearest to it with its own time, or the gap that the instant lies
//! in. Decoders that stand behind an instant are kept for a while, so that playing on costs a frame and not a group of
//! pictures. Blocks; knows nothing of backgrounds and masks.

use super::passed::{Passed, PassedPictures};
use super::ring::{REACH_NANOS, edges};
use crate::archive::{Archive, ArchiveError, Reading};
use crate::media::{Decoder, Fault, Input, Times};
use crate::memory;
use crate::store::SegmentState;
use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;
use tokio::runtime::Handle as Runtime;
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{CameraId, YuvImage};
use videofields_vision::lock::lock;

/// Pictures that a decoder holds, as far as can be told (those that others refer to, those it works on, those that wait), and
/// what it takes beside them. So one of 640 x 360 counts as 17 MB and one of 1280 x 720 as 42: they were seen to take 16 and
/// 40.
const PICTURES_HELD: usize = 24;
const DECODER_BYTES: usize = 8 << 20;

/// Time after which a decoder that nobody asked goes.
const IDLE_TIME: Duration = Duration::from_secs(15);

/// A decoder that stands no further behind an instant than this plays on to it without a look at the rows.
const FORWARD_NANOS: i64 = 2_000_000_000;

/// How long one look for a picture lasts, and how many there are before a recording counts as unreadable.
const LOOK: Duration = Duration::from_millis(50);
const MAX_LOOKS: u32 = 100;

/// Pictures that a codec puts out of their order, at most.
const REORDERED: usize = 16;

/// How long one wait for the disk lasts, and how many there are before what is there must do: a second.
const WAIT: Duration = Duration::from_millis(10);
const MAX_WAITS: u32 = 100;

/// Why there is no frame of an instant.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// Nothing was recorded near it.
    #[error("nothing was recorded at {at}: {}", edges(*before, *after))]
    Gap {
        /// The time asked for.
        at: Timestamp,
        /// Time of the newest recorded frame before it.
        before: Option<Timestamp>,
        /// Time of the oldest recorded frame after it.
        after: Option<Timestamp>,
    },
    /// The archive does not answer.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// What was recorded is not decoded.
    #[error("the recording {path} is not decoded: {reason}")]
    Undecoded {
        /// The file, from the archive's folder on.
        path: String,
        /// What the decoder said.
        reason: String,
    },
}

impl ReplayError {
    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Gap { .. } => ErrorKind::NotFound,
            Self::Archive(error) => error.kind(),
            Self::Undecoded { .. } => ErrorKind::Internal,
        }
    }
}

/// A recorded frame.
#[derive(Clone, Debug)]
pub struct PastFrame {
    /// The picture.
    pub image: Arc<YuvImage>,
    /// Its scene time.
    pub timestamp: Timestamp,
}

/// Decodes the past of all cameras. Any number of threads may ask at once; each decoder serves one of them at a time.
pub struct Replay {
    archive: Arc<Archive>,
    runtime: Runtime,
    clock: Arc<dyn Clock>,
    /// Bytes of decoders at rest.
    max_bytes: usize,
    /// Decoders at rest, the one used longest ago first.
    resting: Mutex<Vec<(Cursor, Duration)>>,
    passed: Mutex<PassedPictures>,
    /// One turn a camera: what one asks for, the next often finds among what was passed.
    turns: Mutex<HashMap<CameraId, Arc<Mutex<()>>>>,
    /// Whether anything was decoded since memory was given back.
    has_decoded: AtomicBool,
}

/// What was recorded on both sides of an instant.
struct Around {
    /// The frame at or before it.
    shown: Option<PastFrame>,
    /// The frame after it, within the same segment.
    next: Option<PastFrame>,
    /// Time of the frame after it.
    after: Option<Timestamp>,
    /// How far from a frame an instant may lie and still be shown by it.
    reach_nanos: i64,
}

/// Which decoders will do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Age {
    /// Also one that stood by.
    Any,
    /// Only one that has just opened its file.
    New,
}

/// A decoder within a segment.
#[derive(Debug)]
struct Cursor {
    camera: CameraId,
    path: String,
    /// Whether the segment was being written when it was opened, so that its end is not where this one's is.
    is_growing: bool,
    /// Scene time of the segment's first frame, from which times in the file count.
    first_at: Timestamp,
    /// Scene time of the key frame with which decoding began.
    starts_at: Timestamp,
    decoder: Decoder,
    /// The frame before the one shown, for the distance between frames.
    before: Option<Timestamp>,
    shown: Option<PastFrame>,
    next: Option<PastFrame>,
    has_ended: bool,
}

impl Replay {
    /// Replays what `archive` holds; its database is asked on `runtime`. Decoders that stand by and pictures that they passed
    /// take at most about `max_bytes`, half of it each.
    #[must_use]
    pub fn new(archive: Arc<Archive>, runtime: Runtime, clock: Arc<dyn Clock>, max_bytes: usize) -> Self {
        let passed = Mutex::new(PassedPictures::new(max_bytes / 2));
        let (resting, turns) = (Mutex::default(), Mutex::default());
        let has_decoded = AtomicBool::new(false);
        Self { archive, runtime, clock, max_bytes: max_bytes / 2, resting, passed, turns, has_decoded }
    }

    /// Ends the decoders that nobody has asked for a while.
    pub fn tidy(&self) {
        let now = self.clock.monotonic();
        let gone: Vec<_> =
            self.lock().extract_if(.., |(_, since)| now.saturating_sub(*since) > IDLE_TIME).collect();
        // Ending a decoder takes a while, and nobody should wait for that.
        drop(gone);
        lock(&self.passed).tidy(now.saturating_sub(IDLE_TIME));
    }

    /// Gives what decoders have freed back to the system, if any has worked since the last time. To be called now and then;
    /// takes some milliseconds.
    pub fn give_back_memory(&self) {
        if self.has_decoded.swap(false, Ordering::Relaxed) {
            memory::give_back();
        }
    }

    /// What is recorded.
    #[must_use]
    pub const fn archive(&self) -> &Arc<Archive> {
        &self.archive
    }

    /// The recorded frame of `camera` nearest to `at`. Must not be called on a thread of the runtime.
    ///
    /// **Cost** decoding from the key frame before the instant, some tens of milliseconds; a frame where the instant
    /// lies just behind the one asked for before, and none where that was passed of late. Who asks for a camera while
    /// another does waits for its turn.
    ///
    /// # Errors
    /// When none is near, or the archive or the decoder fails.
    pub fn frame_at(&self, camera: &CameraId, at: Timestamp) -> Result<PastFrame, ReplayError> {
        let turn = self.turn(camera);
        let _turn = lock(&turn);
        let found = lock(&self.passed).find(camera, at, self.clock.monotonic());
        found.map_or_else(|| self.sought(camera, at), Ok)
    }

    /// A recorded frame of `camera` no further than `reach` from `at`: the key frame before it where that is near enough,
    /// which costs one frame's decoding, else the nearest frame as [`Self::frame_at`] has it.
    ///
    /// # Errors
    /// As [`Self::frame_at`].
    pub fn frame_near(
        &self,
        camera: &CameraId,
        at: Timestamp,
        reach: Duration,
    ) -> Result<PastFrame, ReplayError> {
        let reach_nanos = i64::try_from(reach.as_nanos()).unwrap_or(i64::MAX);
        {
            let turn = self.turn(camera);
            let _turn = lock(&turn);
            self.has_decoded.store(true, Ordering::Relaxed);
            let reading = self.runtime.block_on(self.archive.open_at(camera, at))?;
            if let Some(reading) = reading.filter(|key| at.nanos_since(key.starts_at()) <= reach_nanos)
                && let Some(frame) = Cursor::open(camera, reading)?.pull()?
            {
                return Ok(frame);
            }
        }
        match self.frame_at(camera, at) {
            Err(ReplayError::Gap { after: Some(after), .. }) if after.nanos_since(at) <= reach_nanos => {
                self.frame_at(camera, after)
            }
            found => found,
        }
    }

    /// Time of the recorded frame of `camera` that follows `at`. As [`Self::frame_at`], but what lies behind a gap counts.
    ///
    /// # Errors
    /// When the archive or the decoder fails.
    pub fn next_after(&self, camera: &CameraId, at: Timestamp) -> Result<Option<Timestamp>, ReplayError> {
        let turn = self.turn(camera);
        let _turn = lock(&turn);
        Ok(self.around(camera, at)?.after)
    }

    /// Time of the recorded frame of `camera` before `at`; as [`Self::next_after`].
    ///
    /// # Errors
    /// As [`Self::next_after`].
    pub fn last_before(&self, camera: &CameraId, at: Timestamp) -> Result<Option<Timestamp>, ReplayError> {
        let turn = self.turn(camera);
        let _turn = lock(&turn);
        let around = self.around(camera, at.saturating_add_nanos(-1))?;
        Ok(around.shown.map(|shown| shown.timestamp))
    }

    fn turn(&self, camera: &CameraId) -> Arc<Mutex<()>> {
        Arc::clone(lock(&self.turns).entry(camera.clone()).or_default())
    }

    fn sought(&self, camera: &CameraId, at: Timestamp) -> Result<PastFrame, ReplayError> {
        let Around { shown, next, after, reach_nanos } = self.around(camera, at)?;
        let before = shown.as_ref().map(|shown| shown.timestamp);
        let away =
            |time: Option<Timestamp>| time.map_or(i64::MAX, |time| time.nanos_since(at).saturating_abs());
        if away(before).min(away(after)) > reach_nanos {
            return Err(ReplayError::Gap { at, before, after });
        }
        let nearest = if away(before) <= away(after) { shown } else { next };
        match (nearest, after) {
            (Some(frame), _) => Ok(frame),
            // The first of the segment that follows.
            (None, Some(after)) => self.sought(camera, after),
            (None, None) => Err(ReplayError::Gap { at, before, after }),
        }
    }

    fn around(&self, camera: &CameraId, at: Timestamp) -> Result<Around, ReplayError> {
        let (mut shown, mut next, mut reach_nanos) = (None, None, REACH_NANOS);
        let mut age = Age::Any;
        while let Some((mut cursor, is_of)) = self.cursor(camera, at, age)? {
            let room = |n_bytes| lock(&self.passed).room(camera, n_bytes);
            let mut passed = cursor.play_to(at, &room)?;
            if cursor.is_growing && cursor.has_ended {
                // At the end of what is there, pictures may follow one another between which others are still to come.
                passed.truncate(passed.len().saturating_sub(REORDERED));
            }
            // What stood by knows the file as it was then.
            if is_of == Age::Any && cursor.has_run_dry() && self.goes_on_elsewhere(&cursor, at)? {
                age = Age::New;
                continue;
            }
            // Who plays on asks for nothing twice.
            if passed.len() > 1 {
                lock(&self.passed).add(camera, passed.into_iter(), self.clock.monotonic());
            }
            (shown, next) = (cursor.shown.clone(), cursor.next.clone());
            reach_nanos = cursor.reach_nanos();
            self.rest(cursor);
            break;
        }
        let mut after = next.as_ref().map(|next| next.timestamp);
        if after.is_none() {
            // The segment ends here; what follows is another, whose beginning is known without decoding it.
            let following = self.runtime.block_on(self.archive.next_segment(camera, at))?;
            after = following.map(|segment| segment.first_at);
        }
        Ok(Around { shown, next, after, reach_nanos })
    }

    /// Whether what was recorded until `at` is more than what a decoder that came to its end could give.
    fn goes_on_elsewhere(&self, cursor: &Cursor, at: Timestamp) -> Result<bool, ReplayError> {
        let Some(shown) = cursor.shown.as_ref().filter(|_| !cursor.is_growing) else { return Ok(true) };
        let following = self.runtime.block_on(self.archive.next_segment(&cursor.camera, shown.timestamp))?;
        Ok(following.is_some_and(|segment| segment.first_at <= at))
    }

    /// A decoder from which `at` is played to, and whether it stood by or is new.
    fn cursor(
        &self,
        camera: &CameraId,
        at: Timestamp,
        age: Age,
    ) -> Result<Option<(Cursor, Age)>, ReplayError> {
        self.has_decoded.store(true, Ordering::Relaxed);
        if age == Age::Any
            && let Some(cursor) = self.take(camera, |cursor| cursor.is_near(at))
        {
            return Ok(Some((cursor, Age::Any)));
        }
        let Some(reading) = self.reading(camera, at)? else { return Ok(None) };
        // One that has the key frame behind it already has less to decode.
        let is_ahead = |cursor: &Cursor| {
            cursor.path == reading.segment().path && cursor.stands_within(reading.starts_at(), at)
        };
        if age == Age::Any
            && let Some(cursor) = self.take(camera, is_ahead)
        {
            return Ok(Some((cursor, Age::Any)));
        }
        Ok(Some((Cursor::open(camera, reading)?, Age::New)))
    }

    /// What was recorded from the key frame before `at` on. Of what is being written right now, all that the camera handed
    /// over until now: what memory forgets may still be on its way to the disk.
    fn reading(&self, camera: &CameraId, at: Timestamp) -> Result<Option<Reading>, ReplayError> {
        let open = || self.runtime.block_on(self.archive.open_at(camera, at));
        let reading = open()?;
        if reading.as_ref().is_some_and(|reading| at <= reading.last_at()) {
            return Ok(reading);
        }
        for _ in 0..MAX_WAITS {
            if !self.archive.is_behind(camera) {
                break;
            }
            std::thread::sleep(WAIT);
        }
        Ok(open()?)
    }

    /// A resting decoder of `camera` that is as `wanted`.
    fn take(&self, camera: &CameraId, wanted: impl Fn(&Cursor) -> bool) -> Option<Cursor> {
        let mut resting = self.lock();
        let place = resting.iter().position(|(cursor, _)| cursor.camera == *camera && wanted(cursor));
        place.map(|place| resting.remove(place).0)
    }

    /// Keeps a decoder for the next who asks.
    fn rest(&self, cursor: Cursor) {
        // What is still being written may have grown since: that needs a look at the rows.
        if cursor.has_ended && cursor.next.is_none() {
            return;
        }
        let mut resting = self.lock();
        resting.push((cursor, self.clock.monotonic()));
        // The newest that fit; the one just used at least stays as long as nobody else needs its place.
        let mut n_bytes = 0;
        let n_kept = resting
            .iter()
            .rev()
            .take_while(|(cursor, _)| {
                n_bytes += cursor.len_bytes();
                n_bytes <= self.max_bytes
            })
            .count();
        let n_gone = resting.len() - n_kept.max(1);
        let gone: Vec<_> = resting.drain(..n_gone).collect();
        drop(resting);
        // Ending a decoder takes a while, and nobody should wait for that.
        drop(gone);
    }

    fn lock(&self) -> MutexGuard<'_, Vec<(Cursor, Duration)>> {
        lock(&self.resting)
    }
}

impl Cursor {
    fn open(camera: &CameraId, reading: Reading) -> Result<Self, ReplayError> {
        let (path, first_at) = (reading.segment().path.clone(), reading.segment().first_at);
        let starts_at = reading.starts_at();
        let is_growing = reading.segment().state == SegmentState::Open;
        let undecoded =
            |fault: Fault| ReplayError::Undecoded { path: path.clone(), reason: fault.to_string() };
        let input = Input::stream(reading).with_times(Times::Written);
        let decoder = Decoder::start(input, None).map_err(undecoded)?;
        decoder.lower_priority();
        Ok(Self {
            camera: camera.clone(),
            path,
            is_growing,
            first_at,
            starts_at,
            decoder,
            before: None,
            shown: None,
            next: None,
            has_ended: false,
        })
    }

    /// Bytes that the decoder takes, about.
    fn len_bytes(&self) -> usize {
        let shown = self.shown.as_ref().or(self.next.as_ref());
        let picture_bytes = shown.map_or(0, |shown| shown.image.len_bytes());
        picture_bytes.saturating_mul(PICTURES_HELD).saturating_add(DECODER_BYTES)
    }

    /// Whether playing on to `at` is cheaper than seeking it.
    fn is_near(&self, at: Timestamp) -> bool {
        let behind = self.shown.as_ref().map(|shown| at.nanos_since(shown.timestamp));
        behind.is_some_and(|behind| (0..=FORWARD_NANOS).contains(&behind))
    }

    /// Whether it came to the end of what it read.
    const fn has_run_dry(&self) -> bool {
        self.has_ended && self.next.is_none()
    }

    fn stands_within(&self, from: Timestamp, to: Timestamp) -> bool {
        self.shown.as_ref().is_some_and(|shown| (from..=to).contains(&shown.timestamp))
    }

    /// Plays until the frame after `at` is known, or there is none. The last of the frames on the way, the one shown among
    /// them: as many as there is `room` for of so many bytes each.
    fn play_to(
        &mut self,
        at: Timestamp,
        room: &dyn Fn(usize) -> usize,
    ) -> Result<VecDeque<Passed>, ReplayError> {
        let mut passed = VecDeque::new();
        let mut most = None;
        while self.next.as_ref().is_none_or(|next| next.timestamp <= at) {
            if let Some(next) = self.next.take() {
                self.before = self.shown.as_ref().map(|shown| shown.timestamp);
                self.shown = Some(next);
            }
            if self.has_ended {
                break;
            }
            let Some(next) = self.pull()? else {
                self.has_ended = true;
                continue;
            };
            if let Some(shown) = &self.shown {
                let most = *most.get_or_insert_with(|| room(shown.image.len_bytes()));
                passed.push_back(Passed { frame: shown.clone(), next_at: next.timestamp });
                if passed.len() > most {
                    passed.pop_front();
                }
            }
            self.next = Some(next);
        }
        Ok(passed)
    }

    fn pull(&mut self) -> Result<Option<PastFrame>, ReplayError> {
        let undecoded = |reason: String| ReplayError::Undecoded { path: self.path.clone(), reason };
        for _ in 0..MAX_LOOKS {
            if let Some(picture) = self.decoder.pull(LOOK) {
                let stream_nanos =
                    picture.stream_nanos.ok_or_else(|| undecoded("a frame without a time".to_owned()))?;
                let timestamp = self.first_at.saturating_add_nanos(stream_nanos);
                // Shown before the key frame: built on pictures that were not decoded.
                if timestamp < self.starts_at {
                    continue;
                }
                return Ok(Some(PastFrame { image: Arc::new(picture.image), timestamp }));
            }
            if let Some(fault) = self.decoder.fault() {
                return Err(undecoded(fault.to_string()));
            }
            if self.decoder.has_ended() {
                return Ok(None);
            }
        }
        Err(undecoded("its decoder gives nothing".to_owned()))
    }

    /// How far from a frame an instant may lie and still be shown by it; as [`super::Timeline::at`] has it.
    fn reach_nanos(&self) -> i64 {
        let shown = self.shown.as_ref().map(|shown| shown.timestamp);
        let next = self.next.as_ref().map(|next| next.timestamp);
        let distances = [(self.before, shown), (shown, next)];
        let distances = distances.into_iter().filter_map(|(from, to)| Some(to?.nanos_since(from?)));
        distances.min().map_or(REACH_NANOS, |distance| REACH_NANOS.max(distance.saturating_mul(2)))
    }
}
