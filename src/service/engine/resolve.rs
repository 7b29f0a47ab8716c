//! From a request to what it means at this moment: the instant, what every camera saw then, and the picture's subject.
//!
//! Used by the render thread and by whoever asks for a plan alone; knows no device.

use super::EngineError;
use super::handle::At;
use super::picture::{Observations, Subject};
use super::shared::Shared;
use super::view::ViewRequest;
use std::sync::Arc;
use videofields_picture::plan::ViewLimits;
use videofields_picture::scene::Scene;
use videofields_recording::timeline::Horizon;
use videofields_render::view_limits;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::RenderSettings;
use videofields_vision::frame::CameraId;

/// A live view shows what moved before a camera that lags, until its newest picture is this much older than the instant
/// shown; then its background alone, since whom it saw last may be long gone.
const STALE_NANOS: i64 = 5_000_000_000;

/// What cameras saw of an instant, and which of them saw nothing then.
pub(super) type Seen = (Observations, Vec<CameraId>);

/// A request at a moment.
pub(super) struct Resolved {
    pub(super) subject: Arc<Subject>,
    pub(super) seen: Seen,
}

/// The largest picture that may be asked for; the renderer's own, known without one.
pub(super) const fn limits_of(settings: &RenderSettings) -> ViewLimits {
    view_limits(settings.max_pixels)
}

impl Shared {
    /// What `request` means now. Blocks where an instant is asked for that memory does not hold.
    pub(super) fn resolve(&self, request: &ViewRequest) -> Result<Resolved, EngineError> {
        let scene = self.scene_within(&request.scene, &request.scope)?;
        let instant = match request.at {
            At::Live => self.live_instant(&scene)?,
            At::Time(instant) => instant,
        };
        let seen = self.seen_at(&scene, request.at, (instant, request.horizon.as_ref()))?;
        let subject = Arc::new(self.subject(request, &scene, instant, &seen)?);
        Ok(Resolved { subject, seen })
    }

    /// What `request` means at `instant`, of which the cameras saw `seen`.
    pub(super) fn subject(
        &self,
        request: &ViewRequest,
        scene: &Arc<Scene>,
        instant: Timestamp,
        (observations, gaps): &Seen,
    ) -> Result<Subject, EngineError> {
        let limits = (limits_of(&self.render_settings), self.render_settings.samples);
        let subject = Subject::of(request, scene, instant, observations, limits)?;
        let blurs = match &request.blur_people {
            Some(asked) => Some(self.blurs(asked, scene, observations)?),
            None => None,
        };
        Ok(Subject { gaps: gaps.clone(), blurs, ..subject })
    }

    /// What every camera of the scene saw at `instant` as far as it was known at `horizon`, and which of them saw nothing
    /// then: of these the background known at that time is there, without what moved. A camera without even that is left out, but not all may be: then
    /// the first configured camera's reason is the answer.
    pub(super) fn seen_at(
        &self,
        scene: &Scene,
        asked: At,
        (instant, horizon): (Timestamp, Option<&Horizon>),
    ) -> Result<Seen, EngineError> {
        let (mut found, mut gaps) = (Vec::new(), Vec::new());
        let mut failure = None;
        for member in &scene.cameras {
            let camera = member.id.as_str();
            match self.observation_within(camera, instant, horizon) {
                Ok(observation) => found.push((member.id.clone(), observation)),
                Err(EngineError::Gap { before: Some(_), .. }) => {
                    // Gone only if the ring has moved on since.
                    let newest = horizon.and_then(|horizon| horizon.of(&member.id));
                    let until = newest.map_or(instant, |newest| newest.min(instant));
                    let Ok(mut observation) = self.known_at(camera, until) else { continue };
                    let age_nanos = instant.nanos_since(observation.frame.timestamp);
                    if asked != At::Live || age_nanos > STALE_NANOS {
                        observation.blobs = Arc::default();
                        gaps.push(member.id.clone());
                    }
                    found.push((member.id.clone(), observation));
                }
                Err(error) => {
                    if matches!(failure, None | Some(EngineError::NoCamera { .. })) {
                        failure = Some(error);
                    }
                }
            }
        }
        match failure {
            Some(error) if found.is_empty() => Err(error),
            _ => Ok((found, gaps)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::shared::CameraEntry;
    use crate::engine::tuning::Tuning;
    use videofields_recording::ingest::StatusReader;
    use videofields_recording::telemetry::Metrics;
    use videofields_recording::timeline::{EventLog, Timeline};
    use videofields_vision::clock::SimulatedClock;
    use videofields_vision::frame::{ColorMatrix, ColorRange, Frame, Mask, YuvImage};
    use videofields_vision::observation::Observation;

    const SCENE: &str = r#"{"version": 1, "cameras": [
        {"id": "quick", "calibration": {"image_size_px": [4, 2], "focal_px": [4, 4], "center_px": [2, 1],
            "position_m": [0, 0, 6], "world_from_camera": [1, 0, 0, 0]}},
        {"id": "slow", "calibration": {"image_size_px": [4, 2], "focal_px": [4, 4], "center_px": [2, 1],
            "position_m": [1, 0, 6], "world_from_camera": [1, 0, 0, 0]}}
    ]}"#;

    fn seen(camera: &CameraId, millis: i64) -> Observation {
        let image = Arc::new(YuvImage::filled(4, 2, [9, 128, 128], ColorMatrix::Bt601, ColorRange::Limited));
        let mask = Arc::new(Mask::filled(4, 2, 0));
        let timestamp = Timestamp::from_nanos(millis * 1_000_000);
        Observation {
            frame: Frame { camera: camera.clone(), timestamp, number: 0, image: Arc::clone(&image) },
            soft_mask: Arc::clone(&mask),
            labels: mask,
            background: image,
            blobs: Arc::from([]),
            tracks: Arc::from([]),
        }
    }

    /// Two cameras that nobody runs, and what they have seen.
    fn shared() -> (Shared, [Arc<Timeline>; 2]) {
        let timelines = [(); 2].map(|()| Arc::new(Timeline::new(usize::MAX)));
        let entry = |(id, timeline): (&str, &Arc<Timeline>)| CameraEntry {
            id: CameraId::new(id).unwrap(),
            name: id.to_owned(),
            timeline: Arc::clone(timeline),
            tuning: Arc::new(Tuning::new(&videofields_vision::config::SegmentSettings::default())),
            status: StatusReader::switched_off(Timestamp::from_nanos(0)),
        };
        let cameras = ["quick", "slow"].into_iter().zip(&timelines).map(entry).collect();
        let scene = Arc::new(
            videofields_picture::scene::parse("yard", SCENE, videofields_picture::scene::no_imports)
                .unwrap()
                .scene,
        );
        let shared = Shared::new(
            Arc::new(SimulatedClock::new(Timestamp::from_nanos(0))),
            Arc::new(Metrics::new()),
            (cameras, Arc::new(crate::engine::privacy::Privacies::new(&[])), None),
            (Arc::new(EventLog::new(1)), None),
            (vec![scene], Arc::default()),
            (RenderSettings::default(), crate::engine::entities::Entities::default()),
            Arc::default(),
        );
        (shared, timelines)
    }

    /// What every camera shows, and which are gaps.
    fn times((observations, gaps): &Seen) -> (Vec<i64>, usize) {
        let millis = |(_, of): &(CameraId, Observation)| of.frame.timestamp.as_nanos() / 1_000_000;
        (observations.iter().map(millis).collect(), gaps.len())
    }

    /// Tiles of one frame of a wall are drawn one after the other, while cameras go on.
    #[test]
    fn what_an_instant_shows_follows_from_what_was_known_when_it_was_chosen() {
        let (shared, [quick, slow]) = shared();
        let [first, second] = ["quick", "slow"].map(|id| CameraId::new(id).unwrap());
        let push = |slow_ms: i64, quick_ms: i64| {
            quick.push(seen(&first, quick_ms)).unwrap();
            slow.push(seen(&second, slow_ms)).unwrap();
        };
        push(1000, 9000);
        push(1100, 9040);
        let scene = shared.scene_within("yard", &videofields_vision::access::Scope::all()).unwrap();
        let moment = shared.moment_of(&scene, At::Live).unwrap();
        assert_eq!(moment.instant.as_nanos(), 9_040_000_000);
        let at = At::Time(moment.instant);
        let look = |horizon| times(&shared.seen_at(&scene, at, (moment.instant, horizon)).unwrap());
        let chosen = look(Some(&moment.horizon));
        assert_eq!(chosen, (vec![9040, 1100], 1));
        // The slow one catches up: its newest background is another, and soon it has seen the instant itself.
        push(1200, 9080);
        assert_eq!(look(None), (vec![9040, 1200], 1));
        assert_eq!(look(Some(&moment.horizon)), chosen);
        push(9060, 9120);
        assert_eq!(look(None), (vec![9040, 9060], 0));
        assert_eq!(look(Some(&moment.horizon)), chosen);
        // One of which nothing was known then is left out, whatever it has seen since.
        let known = Horizon::new([(first, moment.instant)]);
        assert_eq!(look(Some(&known)), (vec![9040], 0));
    }
}
