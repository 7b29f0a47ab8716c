//! What a camera's thread feeds: its pipeline, its timeline, its checkpoints.

use super::activity::Activity;
use super::checkpoint::Checkpoints;
use super::handle::shape_concern;
use super::object_sizes::{Calibrated, CameraObjectSizes};
use super::privacy::{CameraPrivacy, Privacies, Privacy};
use super::sightings::Sightings;
use super::tracks::Tracks;
use super::tuning::Tuning;
use std::sync::Arc;
use videofields_recording::archive::Recorder;
use videofields_recording::ingest::{
    self, FrameConsumer, IngestError, MediaRoots, Pipeline, StopFlag, Tap, recorded_as_jpeg,
};
use videofields_recording::media::EncodedFrame;
use videofields_recording::telemetry::{DropReason, Metrics};
use videofields_recording::timeline::{EventKind, EventLog, Timeline, TimelineError};
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::condition::{Condition, ConditionKind};
use videofields_vision::config::{CameraSettings, Learning};
use videofields_vision::frame::{Frame, YuvImage};
use videofields_vision::observation::Observation;

/// Scene time that goes by, all of it older than what is kept, until that is let go.
const SET_BACK_NANOS: i64 = 1_000_000_000;

/// Takes a camera's frames: learns, segments, tracks, remembers.
pub(super) struct CameraConsumer {
    settings: CameraSettings,
    roots: MediaRoots,
    pipeline: Pipeline,
    timeline: Arc<Timeline>,
    events: Arc<EventLog>,
    tuning: Arc<Tuning>,
    sightings: Arc<Sightings>,
    checkpoints: Checkpoints,
    activity: Activity,
    tracks: Tracks,
    metrics: Arc<Metrics>,
    clock: Arc<dyn Clock>,
    stop: StopFlag,
    is_prepared: bool,
    /// Time of the first of the frames in hand that are older than what is kept.
    set_back: Option<Timestamp>,
    /// What nobody may see.
    privacy: Arc<CameraPrivacy>,
    /// Zones of all cameras.
    privacies: Arc<Privacies>,
    /// Where the camera is recorded, if it is.
    recorder: Option<Recorder>,
    /// Least areas of objects in the camera's pictures.
    object_sizes: Arc<CameraObjectSizes>,
    /// Whether what was recorded last was not what the camera sent, since part of that is hidden.
    records_hidden: bool,
    /// What is wrong with the background although frames come.
    background_concern: Option<String>,
    /// Metres by which the camera is told to see people elsewhere than other cameras do.
    misaligned_m: Option<f64>,
    /// The scene by whose calibration its pictures are stretched, as the log was told.
    stretched: Option<Calibrated>,
    /// Fault of the recording although frames come.
    recording_concern: Option<String>,
    /// Worst fault although frames come: the recording's first, then the picture's condition.
    concern: Option<String>,
}

impl CameraConsumer {
    /// `stop` ends the learning of a background clip.
    pub(super) fn new(
        settings: CameraSettings,
        roots: MediaRoots,
        (timeline, events, tuning, sightings): (Arc<Timeline>, Arc<EventLog>, Arc<Tuning>, Arc<Sightings>),
        (checkpoints, activity, tracks): (Checkpoints, Activity, Tracks),
        (metrics, privacies): (Arc<Metrics>, Arc<Privacies>),
        clock: Arc<dyn Clock>,
        stop: StopFlag,
    ) -> Self {
        let pipeline = Pipeline::new(&settings.background, &settings.segment)
            .with_track(&settings.track)
            .with_condition(&settings.condition);
        let pipeline = if settings.vision { pipeline } else { pipeline.without_vision() };
        let privacy = privacies.of_camera(&settings);
        Self {
            settings,
            roots,
            pipeline,
            timeline,
            events,
            tuning,
            sightings,
            checkpoints,
            activity,
            tracks,
            metrics,
            clock,
            stop,
            is_prepared: false,
            set_back: None,
            privacy,
            privacies,
            recorder: None,
            object_sizes: Arc::default(),
            records_hidden: false,
            background_concern: None,
            misaligned_m: None,
            stretched: None,
            recording_concern: None,
            concern: None,
        }
    }

    /// The same consumer, which also records what the camera sends.
    pub(super) fn with_recorder(self, recorder: Option<Recorder>) -> Self {
        Self { recorder, ..self }
    }

    /// Returns the same consumer, which takes from `object_sizes` how small objects may be.
    pub(super) fn with_object_sizes(self, object_sizes: Arc<CameraObjectSizes>) -> Self {
        Self { object_sizes, ..self }
    }

    /// Before the first frame: the background of the last run, else that of the clip. A held background is always
    /// learned anew, so that another clip takes effect; one that adapts learns a clip that was named since. False
    /// where the camera was stopped meanwhile.
    fn learn_place(&mut self, first: &YuvImage) -> bool {
        if !self.pipeline.has_vision() {
            return true;
        }
        let id = &self.settings.id;
        let is_held = self.settings.background.learning == Learning::Hold;
        let is_restored = !is_held && self.checkpoints.restore(&mut self.pipeline, first);
        let Some(clip) = &self.settings.background.clip else { return true };
        if is_restored && self.pipeline.has_learned_clip() {
            return true;
        }
        let rate_hz = ingest::index_rate_hz(&self.settings.source);
        match ingest::learn_clip_stoppable(&mut self.pipeline, clip, rate_hz, &self.roots, &self.stop) {
            Ok(n_frames) => tracing::info!(camera = %id, n_frames, "background clip learned"),
            Err(IngestError::Stopped) => return false,
            Err(error) => {
                tracing::error!(camera = %id, %error, "background clip not learned");
                let concern = format!("background clip not learned, the background adapts: {error}");
                self.background_concern = Some(concern.clone());
                self.concern = Some(concern);
            }
        }
        true
    }

    /// Adds to the timeline. Where time was set back for good, by another source or by a clock that was corrected, what
    /// was kept is let go: it would keep out all that comes, until time is where it was.
    fn remember(&mut self, observation: Observation) -> Result<(), TimelineError> {
        let at = observation.frame.timestamp;
        let is_newer = self.timeline.range().is_none_or(|(_, last)| at > last);
        let since = *self.set_back.get_or_insert(at);
        if is_newer || at < since {
            self.set_back = None;
        } else if at.nanos_since(since) >= SET_BACK_NANOS {
            self.timeline.clear();
            self.set_back = None;
        }
        self.timeline.push(observation)
    }

    /// Takes what was seen under the zones of that number into all that is remembered, unless these were changed meanwhile.
    fn take_in(&mut self, observation: Observation, number: u64, privacy: &Privacy) {
        // Encoded before anybody waits for it.
        let recorded = self.recorder.as_ref().filter(|_| !privacy.zones.is_empty());
        let recorded = recorded.and_then(|_| recorded_as_jpeg(&observation.frame.image));
        let at = observation.frame.timestamp;
        let privacy = Arc::clone(&self.privacy);
        let mut remembered = Ok(());
        let is_kept = privacy.keep(number, || {
            self.activity.observe(&observation);
            self.tracks.observe(&observation);
            self.sightings.observe(&observation);
            remembered = self.remember(observation);
            if let (Some(recorder), Some(frame)) = (&mut self.recorder, &recorded) {
                self.records_hidden = true;
                recorder.push(frame, at);
            }
        });
        let id = self.settings.id.as_str();
        match remembered {
            _ if !is_kept => {
                drop(self.pipeline.take_events());
                self.metrics.count_dropped(id, DropReason::Hidden, 1);
            }
            Ok(()) => self.metrics.ingest_frames.with_label_values(&[id]).inc(),
            Err(error) => {
                tracing::debug!(camera = id, %error, "frame out of order");
                self.metrics.count_dropped(id, DropReason::OutOfOrder, 1);
            }
        }
    }

    /// Passes on what happened.
    fn tell(&mut self) {
        let happened = self.pipeline.take_events();
        if happened.is_empty() {
            return;
        }
        if happened.iter().any(|event| event.kind == EventKind::Moved) {
            // Sightings before were of another place.
            self.sightings.clear();
        }
        for event in happened {
            let (camera, kind) = (event.camera.as_str(), event.kind.as_str());
            tracing::info!(
                camera, kind, is_end = event.is_end, time = %event.time, track = event.track, rect = ?event.rect,
                "event"
            );
            self.metrics.ingest_events.with_label_values(&[camera, kind]).inc();
            self.events.push(event, self.clock.now());
        }
        self.concern = self.worst();
    }

    /// Tells the log where pictures of that size have another shape than the one that was calibrated, whenever that changes. Callers
    /// see it in the camera's summary.
    fn compare_shape(&mut self, size_px: (u32, u32)) {
        let stretched = self.object_sizes.stretched(&self.settings.id, size_px);
        if stretched != self.stretched {
            if let Some((scene, calibrated_px)) = &stretched {
                let concern = shape_concern(scene, *calibrated_px, size_px);
                tracing::warn!(camera = %self.settings.id, concern, "a calibration does not fit");
            }
            self.stretched = stretched;
        }
    }

    /// Takes notice of what was told of the camera's calibration.
    fn hear_of_calibration(&mut self) {
        let misaligned_m = self.sightings.misaligned_m();
        if misaligned_m != self.misaligned_m {
            self.misaligned_m = misaligned_m;
            self.concern = self.worst();
        }
    }

    /// Returns what is wrong although frames come.
    fn worst(&self) -> Option<String> {
        let of_picture = self.pipeline.conditions().iter().find_map(condition_concern);
        let of_calibration = || self.misaligned_m.map(misaligned_concern);
        let of_recording = self.recording_concern.clone();
        of_recording.or(of_picture).or_else(|| self.background_concern.clone()).or_else(of_calibration)
    }
}

/// Returns what people are told of a camera that sees people elsewhere than others do.
fn misaligned_concern(offset_m: f64) -> String {
    format!("its calibration disagrees with other cameras by {offset_m:.1} m on the ground")
}

/// What people are told of a picture's condition; nothing of a light that changed.
fn condition_concern(condition: &Condition) -> Option<String> {
    let since = condition.since;
    match (condition.kind, condition.evidence.displacement_px) {
        (ConditionKind::Frozen, _) => Some(format!("the picture is frozen since {since}")),
        (ConditionKind::Covered, _) => Some(format!("the camera is covered or blind since {since}")),
        (ConditionKind::Moved, Some([x, y])) => Some(format!(
            "the camera has moved since {since}: its calibration is suspect, the place shows {x:.0} px to the right \
             and {y:.0} px down of where it was"
        )),
        (ConditionKind::Moved, None) => {
            Some(format!("the camera looks elsewhere since {since}: its calibration is suspect"))
        }
        (ConditionKind::LightChanged, _) => None,
    }
}

impl FrameConsumer for CameraConsumer {
    fn prepare(&mut self, first: &YuvImage) {
        self.pipeline.set_zones(&self.privacy.now().zones);
        self.is_prepared = self.learn_place(first);
    }

    fn consume(&mut self, frame: Frame) {
        let (privacy, number) = self.privacy.numbered();
        self.pipeline.set_zones(&privacy.zones);
        if !self.is_prepared {
            self.is_prepared = self.learn_place(&frame.image);
            if !self.is_prepared {
                return;
            }
        }
        self.tuning.apply(&mut self.pipeline);
        self.pipeline.set_object_sizes(self.object_sizes.of(&self.settings.id));
        self.compare_shape((frame.image.width(), frame.image.height()));
        let id = self.settings.id.as_str();
        let mut started = self.clock.monotonic();
        let observation = self.pipeline.process_staged(frame, |stage| {
            let ended = self.clock.monotonic();
            self.metrics.observe_stage(id, stage, ended.saturating_sub(started).as_secs_f64());
            started = ended;
        });
        self.take_in(observation, number, &privacy);
        self.tell();
        self.hear_of_calibration();
    }

    fn tap(&self) -> Tap {
        if self.recorder.is_some() { Tap::Open } else { Tap::Closed }
    }

    fn begin(&mut self) {
        self.privacies.opened(self.settings.id.as_str(), &self.settings.source);
        if let Some(recorder) = &mut self.recorder {
            recorder.break_off();
        }
    }

    fn record(&mut self, frame: &EncodedFrame, time: Timestamp) {
        // What the camera sent shows what its zones hide: its pictures are recorded instead, once that is filled.
        let Some(recorder) = self.recorder.as_mut().filter(|_| self.privacy.now().zones.is_empty()) else {
            return;
        };
        if std::mem::take(&mut self.records_hidden) {
            recorder.break_off();
        }
        recorder.push(frame, time);
    }

    fn has_room(&self) -> bool {
        self.recorder.as_ref().is_none_or(Recorder::has_room)
    }

    fn concern(&self) -> Option<&str> {
        self.concern.as_deref()
    }

    fn is_frozen(&self) -> bool {
        self.pipeline.conditions().iter().any(|condition| condition.kind == ConditionKind::Frozen)
    }

    fn miss(&mut self, reason: DropReason, n: u64) {
        self.metrics.count_dropped(self.settings.id.as_str(), reason, n);
    }

    fn tick(&mut self) {
        let recording_concern = self.recorder.as_mut().and_then(Recorder::look);
        if recording_concern != self.recording_concern {
            self.recording_concern = recording_concern;
            self.concern = self.worst();
        }
        // What half a clip taught is not kept: the next start would take it for the whole.
        if self.is_prepared {
            self.checkpoints.write_if_due(&self.pipeline);
            self.activity.write();
            self.tracks.write();
        }
    }

    fn finish(&mut self) {
        if self.is_prepared {
            self.checkpoints.write_finally(&self.pipeline);
            self.activity.write_finally();
            self.tracks.write_finally();
        }
    }
}
