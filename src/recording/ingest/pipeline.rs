//! One camera's way from frames to observations: background, segmentation, tracks.
//!
//! Frames of one camera flow in, in order of time; observations flow out, and checkpoints that carry everything that
//! a later mask depends on. Knows nothing of sources, threads or databases.

mod checkpoint;
mod light;
mod steady;
mod zoned;

use super::standing::{SETTLED_SECS, Seen, Standing};
use crate::telemetry::Stage;
use crate::timeline::{Event, EventKind};
pub use checkpoint::CHECKPOINT_VERSION;
use light::Light;
use std::sync::Arc;
use videofields_vision::background::{Detail, Format, GaussianMixture, Hints};
use videofields_vision::clock::Timestamp;
use videofields_vision::condition::{Condition, ConditionKind, Conditions, Phase};
use videofields_vision::config::{
    BackgroundSettings, ConditionSettings, Learning, SegmentSettings, TrackSettings,
};
use videofields_vision::frame::{BitMask, BufferPool, CameraId, Frame, Mask, YuvImage, Zone, ZoneMask};
use videofields_vision::observation::Observation;
use videofields_vision::segment::{Memory, ObjectSizes, Segmenter};
use videofields_vision::shake::{Shake, steadied};
use videofields_vision::stage::StageState;
use videofields_vision::track::Tracker;
use zoned::Zoned;

/// Models of other picture sizes or colours that are kept; the one left longest ago goes first.
const MAX_ASIDE: usize = 2;

/// Events that are kept until they are taken; what happens beyond that is lost.
const MAX_EVENTS: usize = 64;

/// Reduced or shifted pictures whose memory waits for the next: one of each is worked on, and one stays for what it may repeat.
const MAX_SPARE: usize = 3;

/// Shifted masks whose memory waits for the next, two a frame.
const MAX_SPARE_MASKS: usize = 4;

/// Scene time during which frames share one background picture.
const PICTURE_INTERVAL_NANOS: i64 = 1_000_000_000;

/// Time of a background clip from one look at its detail to the next, seconds.
const DETAIL_INTERVAL_SECS: f64 = 1.0;

/// Turns the frames of one camera into observations.
#[derive(Debug)]
pub struct Pipeline {
    settings: BackgroundSettings,
    segmenter: Segmenter,
    tracker: Tracker,
    standing: Standing,
    conditions: Conditions,
    /// What happened and was not taken yet.
    events: Vec<Event>,
    current: Option<Model>,
    /// Models of formats that the camera left, the one left last at the end: a picture of one size is never read by
    /// the model of another, and a size that comes back finds what was learned.
    aside: Vec<Model>,
    /// Number of times that pictures went over to another format.
    n_changes: u64,
    /// The background picture that frames share, and when it was taken.
    picture: Option<(Timestamp, Arc<YuvImage>)>,
    /// Whether frames of the past are looked at: backgrounds stay as they were restored, and nothing is told.
    is_review: bool,
    /// Whether anything is looked for; else pictures are passed on as they are.
    has_vision: bool,
    /// The mask of pictures in which nothing is looked for, which frames share.
    blank: Option<Arc<Mask>>,
    /// Memory of reduced pictures, and of those that are shifted back.
    pool: Arc<BufferPool>,
    /// Memory of masks that are shifted.
    masks: Arc<BufferPool>,
    /// What nobody may see.
    zoned: Zoned,
}

/// One model and what its next step depends on.
#[derive(Debug)]
struct Model {
    mixture: GaussianMixture,
    /// Memory of the segmentation of this format's pictures, while another model is current; the current one's is the segmenter's.
    memory: Memory,
    /// The frame it saw last; none before the first that has a time.
    seen: Option<Timestamp>,
    /// Whether it learned a background clip.
    has_clip: bool,
    /// Scene time that it has learned for, since this program runs.
    learned_secs: f64,
    /// The picture that it learned last, which later ones may repeat in part.
    previous: Option<Arc<YuvImage>>,
    /// What a reduced picture leaves out of the full one; none at full resolution and before the first look.
    detail: Option<Detail>,
    /// Time of the background clip since detail was looked at.
    since_detail_secs: f64,
    /// What was hidden of the pictures that it learned.
    hidden: Option<Arc<ZoneMask>>,
    /// Measures how far the camera shakes.
    shake: Shake,
    /// Follows the light.
    light: Light,
}

impl Pipeline {
    /// A pipeline that has seen nothing.
    #[must_use]
    pub fn new(background: &BackgroundSettings, segment: &SegmentSettings) -> Self {
        Self {
            settings: background.clone(),
            segmenter: Segmenter::new(segment),
            tracker: Tracker::new(&TrackSettings::default()),
            standing: Standing::new(&TrackSettings::default()),
            conditions: Conditions::new(&ConditionSettings::default()),
            events: Vec::new(),
            current: None,
            aside: Vec::new(),
            n_changes: 0,
            picture: None,
            is_review: false,
            has_vision: true,
            blank: None,
            pool: BufferPool::new(MAX_SPARE),
            masks: BufferPool::new(MAX_SPARE_MASKS),
            zoned: Zoned::none(),
        }
    }

    /// The same pipeline for frames of the past, in any order: it finds what moves before the background that was
    /// restored, does not change that, and tells no events.
    #[must_use]
    pub fn for_review(mut self) -> Self {
        self.is_review = true;
        self.segmenter = self.segmenter.for_review();
        self
    }

    /// The same pipeline, which looks for nothing: each picture is its own background.
    #[must_use]
    pub const fn without_vision(mut self) -> Self {
        self.has_vision = false;
        self
    }

    /// Whether anything is looked for.
    #[must_use]
    pub const fn has_vision(&self) -> bool {
        self.has_vision
    }

    /// Hides these zones from the next picture on, be it learned or looked at: they are filled before anything is done with
    /// it. What was learned of them is forgotten then, and all tracks end.
    pub fn set_zones(&mut self, zones: &Arc<[Zone]>) {
        if !self.zoned.set(zones) {
            return;
        }
        self.aside.clear();
        self.picture = None;
        self.standing.reset();
        self.tracker.reset();
        // What shows beside a zone is no other place.
        self.conditions.accept();
        if let Some(model) = &mut self.current {
            model.previous = None;
        }
    }

    fn passed_on(&mut self, frame: Frame) -> Observation {
        let (width, height) = (frame.image.width(), frame.image.height());
        let fits = self.blank.take().filter(|mask| (mask.width, mask.height) == (width, height));
        let mask = fits.unwrap_or_else(|| Arc::new(Mask::filled(width, height, 0)));
        self.blank = Some(Arc::clone(&mask));
        Observation {
            background: Arc::clone(&frame.image),
            frame,
            soft_mask: Arc::clone(&mask),
            labels: mask,
            blobs: [].into(),
            tracks: [].into(),
        }
    }

    /// The same pipeline, which follows what moves by these settings instead of the default ones.
    #[must_use]
    pub fn with_track(mut self, track: &TrackSettings) -> Self {
        self.tracker = Tracker::new(track);
        self.standing = Standing::new(track);
        self
    }

    /// The same pipeline, which watches its pictures by these settings instead of the default ones.
    #[must_use]
    pub fn with_condition(mut self, condition: &ConditionSettings) -> Self {
        self.conditions = Conditions::new(condition);
        self
    }

    /// What is wrong with the camera's picture now.
    #[must_use]
    pub fn conditions(&self) -> &[Condition] {
        self.conditions.state()
    }

    /// Returns which stages of detection run now and why, in the order in which they run; none before the first frame, and of cameras
    /// whose pictures are only passed on.
    #[must_use]
    pub fn stages(&self) -> Option<[StageState; 6]> {
        let model = self.current.as_ref().filter(|_| self.has_vision)?;
        let settings = self.segmenter.settings();
        let [noise, flicker, shadow, blinking] = self.segmenter.stages();
        let (mut shake, mut light) = (model.shake.state(settings.shake), model.light.state(settings.light));
        // Pictures with zones are never shifted back, since zones stay where they are.
        if model.hidden.is_some() {
            shake = shake.impossible();
        }
        if self.settings.learning == Learning::Hold && model.has_clip {
            light = light.impossible();
        }
        Some([shake, light, noise, flicker, shadow, blinking])
    }

    /// Takes the place that a moved camera now shows for its place.
    pub fn accept_place(&mut self) {
        self.conditions.accept();
    }

    /// Finds foreground by other settings from the next frame on. The resolution is kept: it shapes the model.
    pub fn set_segment(&mut self, segment: &SegmentSettings) {
        self.segmenter.set(&SegmentSettings { resolution: self.segmenter.resolution(), ..segment.clone() });
    }

    /// Sets how small objects may be from the next frame on; none where no scene has the camera.
    pub fn set_object_sizes(&mut self, object_sizes: Option<Arc<ObjectSizes>>) {
        self.segmenter.set_object_sizes(object_sizes);
    }

    /// What happened since this was last asked: at most 64, the oldest first.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// Whether the model in use learned a background clip, be it before the checkpoint that it came from: then the
    /// clip need not be learned again.
    #[must_use]
    pub fn has_learned_clip(&self) -> bool {
        self.current.as_ref().is_some_and(|model| model.has_clip)
    }

    /// Columns and rows of the model for pictures of this size: fewer, where the resolution is reduced.
    #[must_use]
    pub fn model_size_px(&self, width: u32, height: u32) -> (u32, u32) {
        let factor = self.factor((width, height));
        (width.div_ceil(factor), height.div_ceil(factor))
    }

    /// By how much the sides of pictures of this size are reduced before anything is done with them.
    fn factor(&self, size_px: (u32, u32)) -> u32 {
        self.segmenter.resolution().factor_in(size_px)
    }

    /// The picture that is worked on: reduced, where the resolution is.
    fn reduced(&self, image: &YuvImage) -> Option<Arc<YuvImage>> {
        let factor = self.factor((image.width(), image.height()));
        (factor > 1).then(|| Arc::new(image.reduced_of(&self.pool, factor)))
    }

    /// Learns a picture of the background clip, `dt_secs` after the one before it.
    pub fn learn(&mut self, image: &YuvImage, dt_secs: f64) {
        let masked = self.zoned.masked(image);
        let full = masked.as_ref().unwrap_or(image);
        let factor = self.factor((full.width(), full.height()));
        let reduced = self.reduced(full);
        let image = reduced.as_deref().unwrap_or(full);
        self.choose_model(image, None);
        self.hide(full, image, factor);
        if let Some(model) = &mut self.current {
            model.has_clip = true;
            model.learned_secs = SETTLED_SECS;
            model.previous = None;
            model.mixture.update(image, dt_secs).expect(MODEL_FITS);
            model.since_detail_secs += dt_secs.max(0.0);
            let is_due = model.detail.is_none() || model.since_detail_secs >= DETAIL_INTERVAL_SECS;
            if let Some(reduced) = reduced.as_deref().filter(|_| is_due) {
                model.since_detail_secs = 0.0;
                model.look_at_detail(full, reduced, factor, None);
            }
        }
        self.picture = None;
    }

    /// Takes the next frame: learns it, unless the background is held, and finds what moves in it.
    ///
    /// A background is held (`learning = "hold"`) once a clip was learned at the frame's size; at a size of which
    /// there is no clip it adapts, since a picture without a background would show nothing at all. A frame of
    /// another size or colour begins another model, or takes up the one left behind at that size.
    pub fn process(&mut self, frame: Frame) -> Observation {
        self.process_staged(frame, |_stage| {})
    }

    /// As [`Self::process`]; `done` is told each stage as it ends, so that a caller with a clock can time them.
    pub fn process_staged(&mut self, mut frame: Frame, mut done: impl FnMut(Stage)) -> Observation {
        if let Some(masked) = self.zoned.masked(&frame.image) {
            frame.image = Arc::new(masked);
        }
        if !self.has_vision {
            return self.passed_on(frame);
        }
        let size_px = (frame.image.width(), frame.image.height());
        let factor = self.factor(size_px);
        let reduced = self.reduced(&frame.image);
        let image = reduced.as_ref().unwrap_or(&frame.image);
        self.choose_model(image, Some(&frame.camera));
        self.hide(&frame.image, image, factor);
        let is_hold = self.settings.learning == Learning::Hold;
        let model = self.current.as_mut().expect("a model was just chosen");
        let dt_secs = model.seen.map_or(0.0, |seen| frame.timestamp.secs_since(seen));
        model.seen = Some(frame.timestamp);
        let is_held = self.is_review || is_hold && model.has_clip;
        let settings = self.segmenter.settings();
        let (shake, light) = (settings.shake, settings.light);
        let shift =
            if self.is_review { model.shift_alone(image, shake) } else { model.shift(image, dt_secs, shake) };
        let steady;
        let image = if shift.is_none() {
            image
        } else {
            steady = Arc::new(steadied(image, model.mixture.background_planes(), shift, &self.pool));
            &steady
        };
        model.learned_secs += dt_secs.clamp(0.0, self.settings.max_step_secs);
        let mut foreground_share = 0.0;
        if !is_held {
            model.follow_light(image, dt_secs, light);
        }
        if is_held {
            model.mixture.classify(image).expect(MODEL_FITS);
        } else {
            let held = self.standing.held();
            let fits = (held.width(), held.height()) == (image.width() as usize, image.height() as usize);
            let hints = Hints { held: fits.then_some(held), previous: model.previous.as_deref() };
            let update = model.mixture.update_with(image, dt_secs, hints).expect(MODEL_FITS);
            model.previous = Some(Arc::clone(image));
            foreground_share = update.foreground_share;
            if update.light_changed {
                let (camera, share) = (&frame.camera, foreground_share);
                tracing::info!(%camera, share, "light changed, background learned afresh");
                self.standing.reset();
                let kind = EventKind::LightChanged;
                self.events.push(Event::of_picture(frame.camera.clone(), frame.timestamp, kind));
            }
        }
        done(Stage::Background);
        let mixture = &model.mixture;
        let background = mixture.background_planes();
        let mut found =
            self.segmenter.segment_reduced(image, background, mixture.unmatched(), dt_secs, size_px);
        if let Some(hidden) = &model.hidden {
            hidden.clear(&mut found.soft_mask);
            hidden.clear(&mut found.labels);
            zoned::mark_cut(&mut found.blobs, hidden);
        }
        done(Stage::Segment);
        let mut tracks = self.tracker.update(frame.timestamp, size_px, &found.blobs);
        if !is_held {
            let seen = Seen {
                camera: &frame.camera,
                time: frame.timestamp,
                size_px,
                factor,
                luma: [image.plane(0), background[0]],
                foreground_share,
                learned_secs: model.learned_secs,
                min_area_px: self.segmenter.min_area_px(size_px),
                blobs: &found.blobs,
                tracks: &tracks,
                moving: self.segmenter.moving(),
            };
            let events = &mut self.events;
            if let Some(pixels) = self.standing.observe(&seen, |event| events.push(event)) {
                model.mixture.adopt(image, pixels).expect(MODEL_FITS);
            }
        }
        steady::shift_back(&mut found, &mut tracks, shift.times(factor as i32), &self.masks);
        if !self.is_review {
            let learned_luma = model.mixture.background_planes()[0];
            for change in
                self.conditions.observe(frame.timestamp, &frame.image, learned_luma, foreground_share)
            {
                let Some(kind) = event_kind(change.kind) else { continue };
                let is_end = change.phase == Phase::Ended;
                let event = Event::of_picture(frame.camera.clone(), change.time, kind);
                self.events.push(Event { is_end, ..event });
            }
        }
        if self.events.len() > MAX_EVENTS {
            let n_lost = self.events.len() - MAX_EVENTS;
            tracing::warn!(camera = %frame.camera, n_lost, "more events than are kept: the newest are lost");
            self.events.truncate(MAX_EVENTS);
        }
        done(Stage::Track);
        // A held background never ages; the detail that makes a full picture of it is learned on.
        let max_age_nanos = if is_held && reduced.is_none() { i64::MAX } else { PICTURE_INTERVAL_NANOS };
        // Detail is learned of pictures that are where they belong.
        let detailed = reduced.as_deref().filter(|_| shift.is_none());
        let background = self.shown_background(&frame, detailed, max_age_nanos);
        Observation {
            frame,
            soft_mask: Arc::new(found.soft_mask),
            labels: Arc::new(found.labels),
            background,
            blobs: found.blobs.into(),
            tracks: tracks.into(),
        }
    }

    /// The background picture for `frame`, of its size: the one that frames share, or a new one if that is too old.
    fn shown_background(
        &mut self,
        frame: &Frame,
        reduced: Option<&YuvImage>,
        max_age_nanos: i64,
    ) -> Arc<YuvImage> {
        let size_px = (frame.image.width(), frame.image.height());
        if let Some((taken, shared)) = &self.picture {
            let is_fitting = (shared.width(), shared.height()) == size_px;
            if is_fitting && (0..max_age_nanos).contains(&frame.timestamp.nanos_since(*taken)) {
                return Arc::clone(shared);
            }
        }
        let factor = self.factor(size_px);
        let model = self.current.as_mut().expect("a model was chosen for this frame");
        if let Some(reduced) = reduced {
            model.look_at_detail(&frame.image, reduced, factor, Some(self.segmenter.moving()));
        }
        let fresh = model.background_picture(Format::of(&frame.image));
        let fresh = Arc::new(self.zoned.masked(&fresh).unwrap_or(fresh));
        self.picture = Some((frame.timestamp, Arc::clone(&fresh)));
        fresh
    }

    /// Sees to it that the current model holds nothing of what is hidden of `full`, of which it sees `image`.
    fn hide(&mut self, full: &YuvImage, image: &YuvImage, factor: u32) {
        let hidden = self.zoned.mask((full.width(), full.height()));
        let Some(model) = &mut self.current else { return };
        let size_px = (image.width() as usize, image.height() as usize);
        let is_left_out = self.segmenter.hidden().map(|pixels| (pixels.width(), pixels.height()))
            == hidden.as_ref().map(|_| size_px);
        if is_left_out && zoned::is_same(hidden.as_ref(), model.hidden.as_ref()) {
            return;
        }
        if let Some(pixels) = zoned::renewed(hidden.as_deref(), model.hidden.as_deref(), factor) {
            model.mixture.adopt(image, &pixels).expect(MODEL_FITS);
        }
        self.segmenter.hide(hidden.as_deref().map(|hidden| hidden.reduced(factor)));
        (model.previous, model.detail) = (None, None);
        model.hidden = hidden;
        self.picture = None;
    }

    /// Makes the model of the picture's format the current one.
    fn choose_model(&mut self, image: &YuvImage, camera: Option<&CameraId>) {
        let format = Format::of(image);
        if self.current.as_ref().is_some_and(|model| model.mixture.format() == format) {
            return;
        }
        self.picture = None;
        self.standing.reset();
        let kept = self.aside.iter().position(|model| model.mixture.format() == format);
        let mut next = match kept {
            Some(index) => self.aside.remove(index),
            None => Model {
                mixture: GaussianMixture::new(&self.settings, format),
                memory: Memory::default(),
                seen: None,
                has_clip: false,
                learned_secs: 0.0,
                previous: None,
                detail: None,
                since_detail_secs: 0.0,
                hidden: None,
                shake: Shake::default(),
                light: Light::default(),
            },
        };
        let remembered = std::mem::replace(self.segmenter.memory_mut(), std::mem::take(&mut next.memory));
        if let Some(mut left) = self.current.replace(next) {
            left.memory = remembered;
            self.n_changes += 1;
            // Pictures that go to and fro, such as numbered ones of mixed sizes, would make a line of each change.
            if self.n_changes.is_power_of_two() {
                let (camera, n_changes) = (camera.map(CameraId::as_str), self.n_changes);
                tracing::warn!(
                    camera, n_changes, from = %left.mixture.format(), to = %format, "picture format changed"
                );
            }
            self.aside.push(left);
            if self.aside.len() > MAX_ASIDE {
                self.aside.remove(0);
            }
        }
    }

    /// What the current model was made for and the time of the frame it saw last; `None` before the first.
    #[must_use]
    pub fn current(&self) -> Option<(Format, Option<Timestamp>)> {
        self.current.as_ref().map(|model| (model.mixture.format(), model.seen))
    }

    /// Bytes that the current model takes; 0 before the first frame.
    #[must_use]
    pub fn model_bytes(&self) -> usize {
        self.current.as_ref().map_or(0, |model| model.len_bytes() + self.segmenter.memory().len_bytes())
    }
}

impl Model {
    /// Learns the detail that `reduced` leaves out of `full`, where nothing moves and the background is seen.
    fn look_at_detail(&mut self, full: &YuvImage, reduced: &YuvImage, factor: u32, moving: Option<&BitMask>) {
        let format = Format::of(full);
        if self.detail.as_ref().is_none_or(|detail| detail.format() != format) {
            self.detail = Some(Detail::new(format, factor));
        }
        let unmatched = self.mixture.unmatched();
        if let Some(detail) = &mut self.detail {
            detail.learn(full, reduced, [moving.unwrap_or(unmatched), unmatched]);
        }
    }

    /// The background picture for frames of `format`, of their size.
    fn background_picture(&self, format: Format) -> YuvImage {
        match self.detail.as_ref().filter(|detail| detail.format() == format) {
            Some(detail) => detail.picture(self.mixture.background_planes()),
            None => self.mixture.background_picture(),
        }
    }

    fn len_bytes(&self) -> usize {
        self.mixture.len_bytes() + self.detail.as_ref().map_or(0, Detail::len_bytes)
    }
}

/// The event that a condition's change is; none for a change of the light, which the background tells.
const fn event_kind(kind: ConditionKind) -> Option<EventKind> {
    match kind {
        ConditionKind::Frozen => Some(EventKind::Frozen),
        ConditionKind::Covered => Some(EventKind::Covered),
        ConditionKind::Moved => Some(EventKind::Moved),
        ConditionKind::LightChanged => None,
    }
}

/// Why a model and its picture cannot mismatch here.
const MODEL_FITS: &str = "the model was chosen by the picture's format";

#[cfg(test)]
mod tests;
