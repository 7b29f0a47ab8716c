//! What cameras saw at instants that memory no longer holds: recorded frames, segmented with the background of their time.
//!
//! Blocks its caller for tens of milliseconds; requests for one camera wait for each other, those for several do not.

use super::looked_back::{LookedBack, LookedBackMemory};
use super::object_sizes::CameraObjectSizes;
use super::playheads::Step;
use super::privacy::Privacies;
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};
use std::time::Duration;
use tokio::runtime::Handle as Runtime;
use videofields_recording::archive::{Archive, ArchiveError, CameraRecording};
use videofields_recording::ingest::Pipeline;
use videofields_recording::store::{
    ActivityRecord, EntityRecord, EntitySet, EntitySpan, SegmentRecord, SegmentState, SpanChange, Store,
    StoreError, TrackRecord,
};
use videofields_recording::timeline::{PastFrame, Replay, ReplayError};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{CameraSettings, SegmentSettings};
use videofields_vision::frame::{CameraId, Frame, Mask, Zone};
use videofields_vision::observation::Observation;
use videofields_vision::segment::ObjectSizes;

/// How far the row of a segment may be behind what is written of it; a longer gap would have ended the segment.
const ROW_LAG_NANOS: i64 = 5_000_000_000;

/// The past of all cameras that are recorded.
pub(super) struct Past {
    /// Recorded frames, where anything is recorded.
    replay: Option<Replay>,
    store: Store,
    runtime: Runtime,
    cameras: RwLock<HashMap<CameraId, Arc<Mutex<PastCamera>>>>,
    /// What nobody may see of them.
    privacies: Arc<Privacies>,
    /// Least areas of objects in the cameras' pictures.
    object_sizes: Arc<CameraObjectSizes>,
    /// When the oldest recorded frame of each camera was seen.
    firsts: Mutex<BTreeMap<CameraId, Timestamp>>,
    /// Observations that pictures wait for.
    looked_back: Arc<LookedBackMemory>,
}

/// One camera's segmentation of its past.
struct PastCamera {
    settings: CameraSettings,
    pipeline: Pipeline,
    /// When the background in use was saved.
    background_of: Option<Timestamp>,
    /// What was hidden of the frame before.
    zones: Arc<[Zone]>,
    /// Least areas of objects in the frame before.
    object_sizes: Option<Arc<ObjectSizes>>,
    /// What was asked for last, under the zones of that number, and whether it is known what moved: several views of one
    /// instant ask for the same.
    last: Option<(u64, Observation, bool)>,
}

impl PastCamera {
    fn shared(settings: CameraSettings) -> Arc<Mutex<Self>> {
        let pipeline = Pipeline::new(&settings.background, &settings.segment).for_review();
        let pipeline = if settings.vision { pipeline } else { pipeline.without_vision() };
        let zones = Arc::from([]);
        Arc::new(Mutex::new(Self {
            settings,
            pipeline,
            background_of: None,
            zones,
            object_sizes: None,
            last: None,
        }))
    }

    /// Whether its past would look the same with other settings.
    fn looks_as(&self, other: &CameraSettings) -> bool {
        let of = |settings: &CameraSettings| {
            (settings.background.clone(), settings.segment.clone(), settings.vision)
        };
        of(&self.settings) == of(other)
    }
}

fn lock_camera(camera: &Mutex<PastCamera>) -> MutexGuard<'_, PastCamera> {
    // After a panic the pipeline's background is loaded anew.
    camera.lock().unwrap_or_else(|poisoned: PoisonError<_>| {
        let mut of = poisoned.into_inner();
        of.background_of = None;
        of
    })
}

impl Past {
    /// The past of `cameras` as far as `replay` holds it.
    pub(super) fn new(
        replay: Option<Replay>,
        store: Store,
        runtime: Runtime,
        (cameras, privacies, object_sizes): (
            impl Iterator<Item = CameraSettings>,
            &Arc<Privacies>,
            &Arc<CameraObjectSizes>,
        ),
    ) -> Self {
        let camera = |settings: CameraSettings| (settings.id.clone(), PastCamera::shared(settings));
        let cameras = RwLock::new(cameras.map(camera).collect());
        let (privacies, object_sizes) = (Arc::clone(privacies), Arc::clone(object_sizes));
        let (firsts, looked_back) = (Mutex::default(), Arc::default());
        Self { replay, store, runtime, cameras, privacies, object_sizes, firsts, looked_back }
    }

    /// From now on these cameras are recorded, and their past is looked at with these settings.
    pub(super) fn set_cameras(&self, recorded: impl Iterator<Item = CameraSettings>) {
        let mut cameras = self.cameras.write().unwrap_or_else(PoisonError::into_inner);
        let mut before = std::mem::take(&mut *cameras);
        for settings in recorded {
            let id = settings.id.clone();
            let known = before.remove(&id).filter(|known| lock_camera(known).looks_as(&settings));
            cameras.insert(id, known.unwrap_or_else(|| PastCamera::shared(settings)));
        }
    }

    /// From now on a camera's past is looked at with these settings of how its foreground is found.
    pub(super) fn set_segment(&self, camera: &CameraId, segment: &SegmentSettings) {
        let Some(known) = self.camera(camera) else { return };
        let settings = CameraSettings { segment: segment.clone(), ..lock_camera(&known).settings.clone() };
        let mut cameras = self.cameras.write().unwrap_or_else(PoisonError::into_inner);
        cameras.insert(camera.clone(), PastCamera::shared(settings));
    }

    fn camera(&self, camera: &CameraId) -> Option<Arc<Mutex<PastCamera>>> {
        self.cameras.read().unwrap_or_else(PoisonError::into_inner).get(camera).cloned()
    }

    /// What is recorded, where anything is.
    pub(super) fn archive(&self) -> Option<&Archive> {
        self.replay.as_ref().map(|replay| &**replay.archive())
    }

    /// Lets go what nobody has asked for a while.
    pub(super) fn tidy(&self) {
        if let Some(replay) = &self.replay {
            replay.tidy();
        }
    }

    /// Looks where recordings begin now, and gives freed memory back. Blocks for a short question of the database for each
    /// camera.
    pub(super) fn look(&self) {
        let Some(replay) = &self.replay else { return };
        replay.give_back_memory();
        let cameras: Vec<CameraId> =
            self.cameras.read().unwrap_or_else(PoisonError::into_inner).keys().cloned().collect();
        for camera in &cameras {
            let first = replay.archive().next_segment(camera, Timestamp::from_nanos(i64::MIN));
            match self.runtime.block_on(first) {
                Ok(Some(segment)) => drop(self.lock_firsts().insert(camera.clone(), segment.first_at)),
                Ok(None) => drop(self.lock_firsts().remove(camera)),
                Err(error) => {
                    tracing::warn!(%camera, %error, "the beginning of what is recorded is not known");
                }
            }
        }
    }

    /// When the oldest recorded frame of a camera was seen, as it was known a moment ago. Never blocks.
    pub(super) fn first(&self, camera: &CameraId) -> Option<Timestamp> {
        self.lock_firsts().get(camera).copied()
    }

    /// Time of the recorded frame that follows `at`, or that is before it.
    pub(super) fn neighbour(&self, camera: &CameraId, at: Timestamp, step: Step) -> Option<Timestamp> {
        let replay = self.replay.as_ref().filter(|_| self.camera(camera).is_some())?;
        let found = match step {
            Step::On => replay.next_after(camera, at),
            Step::Back => replay.last_before(camera, at),
        };
        found.unwrap_or_else(|error| {
            tracing::warn!(%camera, %error, "no step into what is recorded");
            None
        })
    }

    fn lock_firsts(&self) -> MutexGuard<'_, BTreeMap<CameraId, Timestamp>> {
        self.firsts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// From when to when a camera was recorded between two instants, in order. The row of what is being written is some
    /// seconds behind its frames: it reaches to `kept_from`, the oldest frame in memory, where that is no further away.
    pub(super) fn recorded(
        &self,
        camera: &CameraId,
        (from, to): (Timestamp, Timestamp),
        kept_from: Option<Timestamp>,
    ) -> Result<Vec<(Timestamp, Timestamp)>, ArchiveError> {
        let Some(replay) = &self.replay else { return Ok(Vec::new()) };
        let segments = self.runtime.block_on(replay.archive().segments(camera, from, to))?;
        let range = |segment: &SegmentRecord| {
            let goes_on = |kept: &Timestamp| {
                segment.state == SegmentState::Open
                    && (0..=ROW_LAG_NANOS).contains(&kept.nanos_since(segment.last_at))
            };
            (segment.first_at, kept_from.filter(goes_on).unwrap_or(segment.last_at))
        };
        Ok(segments.iter().map(range).collect())
    }

    /// How each camera's recording goes.
    pub(super) fn recordings(&self) -> Vec<CameraRecording> {
        self.replay.as_ref().map(|replay| replay.archive().status().cameras).unwrap_or_default()
    }

    /// How much moved before a camera between two instants.
    pub(super) fn activity(
        &self,
        camera: &CameraId,
        from: Timestamp,
        to: Timestamp,
        minutes_each: u32,
    ) -> Result<Vec<ActivityRecord>, StoreError> {
        self.runtime.block_on(self.store.activity(camera, from, to, minutes_each))
    }

    /// What moved before a camera in a span of time, as [`Store::tracks`] has it.
    pub(super) fn tracks(
        &self,
        camera: &CameraId,
        span: (Timestamp, Timestamp),
        before: Option<(Timestamp, u64)>,
        limit: u32,
    ) -> Result<Vec<TrackRecord>, StoreError> {
        self.runtime.block_on(self.store.tracks(camera, span, before, limit))
    }

    /// Writes who was where, as [`Store::put_entities`] does.
    pub(super) fn put_entities(
        &self,
        set: &EntitySet,
        span: &SpanChange,
        records: &[EntityRecord],
    ) -> Result<i64, StoreError> {
        self.runtime.block_on(self.store.put_entities(set, span, records))
    }

    /// Hands out ids of a set, as [`Store::reserve_entity_ids`] does.
    pub(super) fn reserve_entity_ids(&self, set: &EntitySet, count: u32) -> Result<u64, StoreError> {
        self.runtime.block_on(self.store.reserve_entity_ids(set, count))
    }

    /// Returns when the first of a camera's tracks began that was seen at `at` or later.
    pub(super) fn next_track_at(
        &self,
        camera: &CameraId,
        at: Timestamp,
    ) -> Result<Option<Timestamp>, StoreError> {
        self.runtime.block_on(self.store.next_track_at(camera, at))
    }

    /// Returns the spans of a set that reach into a time, the one that counts first.
    pub(super) fn entity_spans(
        &self,
        set: &EntitySet,
        span: (Timestamp, Timestamp),
    ) -> Result<Vec<EntitySpan>, StoreError> {
        self.runtime.block_on(self.store.entity_spans(set, span))
    }

    /// Returns who was where, as [`Store::entities`] does.
    pub(super) fn entities(
        &self,
        span: i64,
        time: (Timestamp, Timestamp),
        limit: u32,
    ) -> Result<Vec<EntityRecord>, StoreError> {
        self.runtime.block_on(self.store.entities(span, time, limit))
    }

    /// What `camera` saw nearest to `at`; none where it is not recorded.
    pub(super) fn observation(
        &self,
        camera: &CameraId,
        at: Timestamp,
    ) -> Option<Result<Observation, ReplayError>> {
        Some(self.looked_at(camera, at)?.map(|(seen, _)| seen))
    }

    /// As [`Self::observation`], and whether it is known what moved: not where there is no background of that time.
    pub(super) fn looked_at(
        &self,
        camera: &CameraId,
        at: Timestamp,
    ) -> Option<Result<(Observation, bool), ReplayError>> {
        let (of, replay) = (self.camera(camera)?, self.replay.as_ref()?);
        if let Some(looked) = self.looked_back.find(camera, at, self.zones_of(camera)) {
            return Some(looked);
        }
        Some(replay.frame_at(camera, at).map(|frame| self.segmented(&mut lock_camera(&of), frame)))
    }

    /// Looks at what `cameras` saw nearest to `at`, and keeps that until the answer is dropped.
    pub(super) fn look_back(&self, cameras: &[CameraId], at: Timestamp) -> LookedBack {
        let kept = self.looked_back.begin();
        for camera in cameras {
            // Before it is looked at: where the zones change meanwhile, it is not found.
            let zones = self.zones_of(camera);
            if let Some(looked) = self.looked_at(camera, at) {
                kept.keep(camera.clone(), at, (zones, looked));
            }
        }
        kept
    }

    /// Returns the number of the camera's privacy zones.
    fn zones_of(&self, camera: &CameraId) -> u64 {
        self.privacies.of_known(camera).numbered().1
    }

    /// The recorded frame of `camera` nearest to `at`, with what is hidden of it filled; none where it is not recorded.
    pub(super) fn frame_at(
        &self,
        camera: &CameraId,
        at: Timestamp,
    ) -> Option<Result<PastFrame, ReplayError>> {
        let replay = self.replay.as_ref().filter(|_| self.camera(camera).is_some())?;
        Some(replay.frame_at(camera, at).map(|found| self.hidden(camera, found)))
    }

    /// Time of the recorded frame that follows `after`.
    pub(super) fn recorded_after(
        &self,
        camera: &CameraId,
        after: Timestamp,
    ) -> Result<Option<Timestamp>, ReplayError> {
        let replay = self.replay.as_ref().filter(|_| self.camera(camera).is_some());
        replay.map_or(Ok(None), |replay| replay.next_after(camera, after))
    }

    fn hidden(&self, camera: &CameraId, found: PastFrame) -> PastFrame {
        let privacy = self.privacies.of_known(camera);
        let image = privacy.hide(&privacy.now(), &found.image, found.timestamp);
        PastFrame { image, ..found }
    }

    /// A recorded frame of `camera` within `reach` of `at`, or the nearest; none where it is not recorded.
    pub(super) fn frame_near(
        &self,
        camera: &CameraId,
        at: Timestamp,
        reach: Duration,
    ) -> Option<Result<PastFrame, ReplayError>> {
        let replay = self.replay.as_ref().filter(|_| self.camera(camera).is_some())?;
        Some(replay.frame_near(camera, at, reach).map(|found| self.hidden(camera, found)))
    }

    fn segmented(&self, camera: &mut PastCamera, frame: PastFrame) -> (Observation, bool) {
        let of = self.privacies.of_known(&camera.settings.id);
        let (privacy, number) = of.numbered();
        let object_sizes = self.object_sizes.of(&camera.settings.id);
        if camera.object_sizes != object_sizes {
            camera.last = None;
            camera.pipeline.set_object_sizes(object_sizes.clone());
            camera.object_sizes = object_sizes;
        }
        let is_it = |(of, last, _): &&(u64, Observation, bool)| {
            *of == number && last.frame.timestamp == frame.timestamp
        };
        if let Some((_, last, is_known)) = camera.last.as_ref().filter(is_it) {
            return (last.clone(), *is_known);
        }
        // Those in force, and those that were lifted since.
        let zones: Arc<[Zone]> = privacy.at(frame.timestamp).cloned().collect();
        if camera.zones != zones {
            // What was taken from a picture where another zone ended is no background: whoever stood there would be in it.
            camera.background_of = None;
            camera.zones = Arc::clone(&zones);
        }
        camera.pipeline.set_zones(&zones);
        let id = camera.settings.id.clone();
        let has_background = self.load_background(camera, &frame).unwrap_or_else(|error| {
            tracing::error!(camera = %id, %error, "no background of that time");
            false
        });
        // Numbers of frames are their sources': what was recorded has none.
        let shown = Frame { camera: id, timestamp: frame.timestamp, number: 0, image: frame.image };
        let observation = if has_background {
            camera.pipeline.process(shown)
        } else {
            let image = of.hide(&privacy, &shown.image, shown.timestamp);
            without_background(Frame { image, ..shown })
        };
        let is_known = has_background && camera.pipeline.has_vision();
        camera.last = Some((number, observation.clone(), is_known));
        (observation, is_known)
    }

    /// Makes the background in use that of the frame's time: the last one saved until then, else the first one after.
    fn load_background(&self, camera: &mut PastCamera, frame: &PastFrame) -> Result<bool, StoreError> {
        let id = camera.settings.id.clone();
        let (width, height) = camera.pipeline.model_size_px(frame.image.width(), frame.image.height());
        let history = self.runtime.block_on(self.store.background_history(&id))?;
        let fitting = history.iter().filter(|(_, w, h, _)| (*w, *h) == (width, height)).map(|(at, ..)| *at);
        let before = fitting.clone().filter(|at| *at <= frame.timestamp).max();
        let Some(of) = before.or_else(|| fitting.min()) else { return Ok(false) };
        if camera.background_of == Some(of) {
            return Ok(true);
        }
        let record = self.runtime.block_on(self.store.background_at(&id, width, height, frame.timestamp))?;
        let Some(record) = record else { return Ok(false) };
        if let Err(error) = camera.pipeline.restore(&record.bytes) {
            tracing::warn!(camera = %id, %error, "a background of the past is not used");
            camera.background_of = None;
            return Ok(false);
        }
        camera.background_of = Some(of);
        Ok(true)
    }
}

/// A frame before which nothing is known to move: it is its own background.
fn without_background(frame: Frame) -> Observation {
    let (width, height) = (frame.image.width(), frame.image.height());
    let mask = || Arc::new(Mask::filled(width, height, 0));
    Observation {
        soft_mask: mask(),
        labels: mask(),
        background: Arc::clone(&frame.image),
        blobs: Arc::from([]),
        tracks: Arc::from([]),
        frame,
    }
}
