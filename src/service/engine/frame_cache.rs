//! Finished pictures, kept within a bound in bytes to be shown again; what was not asked for longest goes first.
//!
//! A picture is found by its [`Subject`], which tells observations by their memory and not by their times alone: what a
//! camera saw of an instant may still change, and such a picture is then another one. What is kept holds no observation.

use super::picture::Subject;
use super::view::ViewAnswer;
use std::collections::VecDeque;
use std::sync::Arc;
use videofields_picture::plan::{Part, PlannedBillboard};

/// Most pictures, however small: they are looked through one by one.
const MAX_PICTURES: usize = 4096;

/// What a picture takes beside its pixels and lists: its subject, its plan's reasons.
const PICTURE_BYTES: usize = 2048;

struct Kept {
    subject: Arc<Subject>,
    answer: ViewAnswer,
    bytes: usize,
}

/// See the module.
pub(super) struct FrameCache {
    max_bytes: usize,
    bytes: usize,
    /// What was asked for last is last.
    pictures: VecDeque<Kept>,
}

impl FrameCache {
    /// An empty one that may hold `max_bytes`.
    pub(super) const fn new(max_bytes: usize) -> Self {
        Self { max_bytes, bytes: 0, pictures: VecDeque::new() }
    }

    /// The picture of `subject`, if it is there.
    pub(super) fn get(&mut self, subject: &Subject) -> Option<ViewAnswer> {
        let idx = self.pictures.iter().position(|kept| *kept.subject == *subject)?;
        let kept = self.pictures.remove(idx)?;
        let answer = kept.answer.clone();
        self.pictures.push_back(kept);
        Some(answer)
    }

    /// Keeps a picture, unless it is larger than all that may be kept.
    pub(super) fn insert(&mut self, subject: Arc<Subject>, answer: ViewAnswer) {
        let bytes = bytes_of(&subject, &answer);
        // What has gone from memory is never the same again.
        self.retain(|kept| *kept.subject != *subject && kept.subject.can_be_met());
        if bytes > self.max_bytes {
            return;
        }
        self.bytes += bytes;
        self.pictures.push_back(Kept { subject, answer, bytes });
        while self.bytes > self.max_bytes || self.pictures.len() > MAX_PICTURES {
            let Some(oldest) = self.pictures.pop_front() else { break };
            self.bytes -= oldest.bytes;
        }
    }

    /// Lets everything go.
    pub(super) fn clear(&mut self) {
        self.pictures = VecDeque::new();
        self.bytes = 0;
    }

    /// Bytes held.
    pub(super) const fn bytes(&self) -> usize {
        self.bytes
    }

    fn retain(&mut self, keeps: impl Fn(&Kept) -> bool) {
        self.pictures.retain(keeps);
        self.bytes = self.pictures.iter().map(|kept| kept.bytes).sum();
    }
}

fn bytes_of(subject: &Subject, answer: &ViewAnswer) -> usize {
    PICTURE_BYTES
        + answer.image.data.len()
        + subject.picture.parts.len() * size_of::<Part>()
        + answer.plan.billboards.len() * size_of::<PlannedBillboard>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::picture::Observations;
    use crate::engine::resolve::limits_of;
    use crate::engine::{At, Origin, ViewKind, ViewRequest};
    use videofields_picture::plan::{Effort, EntityStyle, Plan, Settings};
    use videofields_picture::scene::{self, Scene};
    use videofields_recording::timeline::Timeline;
    use videofields_vision::clock::Timestamp;
    use videofields_vision::config::RenderSettings;
    use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, Mask, RgbImage, YuvImage};
    use videofields_vision::observation::Observation;

    const INSTANT: Timestamp = Timestamp::from_nanos(1_000_000_000);

    fn scene() -> Arc<Scene> {
        let text =
            r#"{"version": 1, "ground": [{"polygon": [[-5, -5], [5, -5], [5, 5], [-5, 5]], "height_m": 0}]}"#;
        Arc::new(scene::parse("yard", text, scene::no_imports).expect("a scene").scene)
    }

    /// What `north` saw some milliseconds after one second.
    fn seen(millis: i64, luma: u8) -> Observation {
        let image =
            || Arc::new(YuvImage::filled(4, 2, [luma, 128, 128], ColorMatrix::Bt601, ColorRange::Limited));
        let mask = || Arc::new(Mask::filled(4, 2, 0));
        let camera = CameraId::new("north").expect("an id");
        let timestamp = INSTANT.saturating_add_nanos(millis * 1_000_000);
        Observation {
            frame: Frame { camera, timestamp, number: 0, image: image() },
            soft_mask: mask(),
            labels: mask(),
            background: image(),
            blobs: Arc::from([]),
            tracks: Arc::from([]),
        }
    }

    fn observations(of: &[Observation]) -> Observations {
        of.iter().map(|seen| (seen.frame.camera.clone(), seen.clone())).collect()
    }

    fn subject(scene: &Arc<Scene>, width_px: u32, of: &[Observation]) -> Arc<Subject> {
        let request = ViewRequest {
            scene: "yard".to_owned(),
            kind: ViewKind::Perspective,
            eye: None,
            target: None,
            fov_y_rad: None,
            width_px,
            height_px: 1,
            at: At::Time(INSTANT),
            style: EntityStyle::None,
            see_through: true,
            colors: videofields_picture::plan::Colors::Even,
            session: None,
            effort: Effort::default(),
            effects: Default::default(),
            horizon: None,
            blur_people: None,
            scope: videofields_vision::access::Scope::all(),
        };
        let limits = (limits_of(&RenderSettings::default()), 4);
        Arc::new(Subject::of(&request, scene, INSTANT, &observations(of), limits).expect("a picture"))
    }

    fn answer(subject: &Subject, n_pixels: usize) -> ViewAnswer {
        ViewAnswer {
            image: Arc::new(RgbImage { width: n_pixels as u32, height: 1, data: vec![0; n_pixels * 3] }),
            instant: subject.instant,
            kind: subject.kind,
            view: subject.from,
            sources: subject.sources.clone(),
            frames: Vec::new(),
            gaps: Vec::new(),
            blurs: None,
            settings: Settings::default(),
            expected: None,
            plan: Arc::new(Plan::bare(&Settings::default())),
            timings: Vec::new(),
            origin: Origin::Drawn,
            identity: None,
        }
    }

    fn insert(cache: &mut FrameCache, subject: &Arc<Subject>, n_pixels: usize) {
        cache.insert(Arc::clone(subject), answer(subject, n_pixels));
    }

    #[test]
    fn what_was_not_asked_for_longest_goes_first() {
        let (scene, mut cache) = (scene(), FrameCache::new(100_000));
        let subjects = [1, 2, 3, 4].map(|width| subject(&scene, width, &[]));
        for of in &subjects[..3] {
            insert(&mut cache, of, 10_000);
        }
        assert!((90_000..=100_000).contains(&cache.bytes()), "{}", cache.bytes());
        assert!(cache.get(&subjects[0]).is_some());
        insert(&mut cache, &subjects[3], 10_000);
        let kept = subjects.each_ref().map(|of| cache.get(of).is_some());
        assert_eq!(kept, [true, false, true, true]);
        assert!(cache.bytes() <= 100_000);
        // What is drawn anew takes its own place.
        insert(&mut cache, &subjects[3], 5_000);
        assert_eq!(cache.pictures.len(), 3);
        assert!(cache.bytes() <= 90_000, "{}", cache.bytes());
        cache.clear();
        assert_eq!((cache.bytes(), cache.get(&subjects[0]).is_none()), (0, true));
    }

    #[test]
    fn a_picture_larger_than_the_bound_is_not_kept_and_costs_no_other() {
        let (scene, mut cache) = (scene(), FrameCache::new(50_000));
        let [small, large] = [1, 2].map(|width| subject(&scene, width, &[]));
        insert(&mut cache, &small, 100);
        insert(&mut cache, &large, 50_000);
        assert!(cache.get(&large).is_none() && cache.get(&small).is_some());
        let mut none = FrameCache::new(0);
        insert(&mut none, &small, 0);
        assert_eq!((none.get(&small).is_none(), none.bytes()), (true, 0));
    }

    #[test]
    fn tiny_pictures_are_bounded_in_number() {
        let (scene, mut cache) = (scene(), FrameCache::new(usize::MAX));
        for width in 0..MAX_PICTURES + 10 {
            insert(&mut cache, &subject(&scene, width as u32 + 1, &[]), 1);
        }
        assert_eq!(cache.pictures.len(), MAX_PICTURES);
    }

    #[test]
    fn a_picture_is_not_shown_once_its_frame_is_another() {
        let (scene, mut cache, timeline) = (scene(), FrameCache::new(1 << 20), Timeline::new(1 << 20));
        let now = || [timeline.at(INSTANT).expect("a frame is near")];
        let first = seen(-40, 90);
        timeline.push(first.clone()).expect("it is newer");
        let early = subject(&scene, 8, &now());
        insert(&mut cache, &early, 8);
        assert!(cache.get(&subject(&scene, 8, &now())).is_some(), "nothing has changed");
        // A frame comes that is nearer.
        timeline.push(seen(10, 120)).expect("it is newer");
        let settled = subject(&scene, 8, &now());
        assert!(cache.get(&settled).is_none());
        insert(&mut cache, &settled, 8);
        // One that is further away changes nothing.
        timeline.push(seen(50, 200)).expect("it is newer");
        assert!(cache.get(&subject(&scene, 8, &now())).is_some());
        // Another file has frames of the same times, and a background learned anew the same frame.
        assert!(cache.get(&subject(&scene, 8, &[seen(10, 30)])).is_none());
        let [kept] = now();
        let relearned = Observation { background: seen(10, 99).background, ..kept.clone() };
        assert!(cache.get(&subject(&scene, 8, &[relearned])).is_none());
        let segmented = Observation { soft_mask: seen(10, 99).soft_mask, ..kept.clone() };
        assert!(cache.get(&subject(&scene, 8, &[segmented])).is_none());
        // Nor is it another scene's, though that one says the same.
        let other_scene = Arc::new(Scene::clone(&scene));
        assert!(cache.get(&subject(&other_scene, 8, &[kept])).is_none());
        drop(first);
    }

    #[test]
    fn what_can_never_be_asked_for_again_makes_room() {
        let (scene, mut cache) = (scene(), FrameCache::new(1 << 20));
        let gone = seen(0, 50);
        insert(&mut cache, &subject(&scene, 8, std::slice::from_ref(&gone)), 8);
        let kept = seen(5, 60);
        let other = subject(&scene, 8, std::slice::from_ref(&kept));
        drop(gone);
        insert(&mut cache, &other, 8);
        assert_eq!(cache.pictures.len(), 1);
        assert!(cache.get(&other).is_some());
    }
}
