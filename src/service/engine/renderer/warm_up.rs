//! Making ready while nobody asks: the scenes' own views are drawn once, so that the first picture somebody asks for waits for
//! no program and no patches, and deadlines are judged by what pictures take and not by what their first takes.

use super::{Choice, Failure, RenderThread, no_renderer};
use crate::engine::EngineError;
use crate::engine::flow::Flow;
use crate::engine::picture::Subject;
use crate::engine::queue::{Job, JobId};
use crate::engine::resolve::{Resolved, Seen};
use crate::engine::shared::Shared;
use crate::engine::view::ViewRequest;
use std::sync::{Arc, Weak};
use std::time::Duration;
use videofields_picture::plan::{Aim, Detail, Effort, Filtering, Named, Preset};
use videofields_picture::scene::Scene;
use videofields_render::MAX_READY_SCENES;
use videofields_vision::frame::CameraId;

/// Pause between two looks at a scene that is not ready since no camera has seen anything.
const COLD_TIME: Duration = Duration::from_millis(500);

/// Times that each is drawn: what the first takes is mostly its programs, and tells little of the next.
const TIMES: usize = 2;

/// What deadlines choose between at first: the usual; less; and the least there is, without which short ones are refused that
/// could be kept.
fn efforts() -> [Effort; 3] {
    let of = |preset, named| Effort { aim: Aim::Preset(preset), named };
    let least =
        Named { filtering: Some(Filtering::Nearest), resolution: Some(Detail::Quarter), ..Named::default() };
    [of(Preset::Balanced, Named::default()), of(Preset::Draft, Named::default()), of(Preset::Draft, least)]
}

/// What a scene was made ready for.
#[derive(Debug)]
struct Ready {
    scene: Weak<Scene>,
    /// Whose pictures there were.
    cameras: Vec<CameraId>,
    /// Whether anything moved: what entities are drawn with is made only where one is.
    has_entities: bool,
}

/// Which scenes were made ready on this device, and which could not be on any.
#[derive(Debug, Default)]
pub(super) struct WarmUp {
    ready: Vec<Ready>,
    failed: Vec<Weak<Scene>>,
}

fn is(one: &Weak<Scene>, scene: &Arc<Scene>) -> bool {
    std::ptr::eq(one.as_ptr(), Arc::as_ptr(scene))
}

impl WarmUp {
    fn of(&self, scene: &Arc<Scene>) -> Option<&Ready> {
        self.ready.iter().find(|ready| is(&ready.scene, scene))
    }

    /// Nothing is ready on a new device; what failed stays so.
    pub(super) fn forget_device(&mut self) {
        self.ready.clear();
    }

    /// A scene that costs a device must not cost one again and again: whoever asks for it is told why it cannot be drawn.
    fn note_failed(&mut self, scene: &Arc<Scene>) {
        self.failed.push(Arc::downgrade(scene));
    }

    fn has_failed(&self, scene: &Arc<Scene>) -> bool {
        self.failed.iter().any(|failed| is(failed, scene))
    }

    /// Whether a picture of what was `seen` may call for something that none did before.
    fn is_needed(&self, scene: &Arc<Scene>, seen: &Seen) -> bool {
        self.of(scene).is_none_or(|ready| {
            let is_known = |(camera, _): &(CameraId, _)| ready.cameras.contains(camera);
            !seen.0.iter().all(is_known) || (has_entities(seen) && !ready.has_entities)
        })
    }

    fn note(&mut self, scene: &Arc<Scene>, seen: &Seen) {
        let cameras = seen.0.iter().map(|(camera, _)| camera.clone()).collect();
        let had_entities = self.of(scene).is_some_and(|ready| ready.has_entities);
        self.ready.retain(|ready| !is(&ready.scene, scene));
        let has_entities = had_entities || has_entities(seen);
        self.ready.push(Ready { scene: Arc::downgrade(scene), cameras, has_entities });
    }
}

fn has_entities((observations, _): &Seen) -> bool {
    observations.iter().any(|(_, observation)| !observation.blobs.is_empty())
}

impl RenderThread<'_> {
    /// The scenes that are made ready: no more than stay so.
    fn warmed(&self) -> Vec<Arc<Scene>> {
        let most = if self.shared.render_settings.warm_up { MAX_READY_SCENES } else { 0 };
        self.shared.scenes.all().iter().take(most).cloned().collect()
    }

    /// For how long nothing is to be made ready.
    pub(super) fn until_warm_up(&self) -> Duration {
        let is_cold = |scene| self.warm_up.of(scene).is_none() && !self.warm_up.has_failed(scene);
        if self.warmed().iter().any(is_cold) { COLD_TIME } else { Duration::MAX }
    }

    /// Makes ready what is not, until somebody asks for a picture.
    pub(super) fn make_scenes_ready(&mut self) {
        for scene in self.warmed() {
            if self.warm_up.has_failed(&scene) {
                continue;
            }
            let done = self.contained(|thread| thread.make_scene_ready(&scene));
            match done {
                Ok(true) => {}
                Ok(false) => return,
                Err(error) => {
                    tracing::warn!(scene = scene.id, %error, "could not be made ready, and is left");
                    self.warm_up.note_failed(&scene);
                }
            }
        }
    }

    /// Whether that is done, as far as cameras have seen anything: not where somebody asked for a picture meanwhile, or there
    /// is no device.
    fn make_scene_ready(&mut self, scene: &Arc<Scene>) -> Result<bool, EngineError> {
        let mut drawn = None;
        for effort in std::iter::repeat_n(efforts(), TIMES).flatten() {
            if !is_idle(self.shared) {
                return Ok(false);
            }
            let request = ViewRequest::own(scene, effort);
            let Ok(Resolved { subject, seen }) = self.shared.resolve(&request) else {
                return Ok(true);
            };
            if drawn.is_none() && !self.warm_up.is_needed(scene, &seen) {
                return Ok(true);
            }
            if self.ensure_renderer().is_err() {
                return Ok(false);
            }
            match self.draw_unasked(&request, (&subject, &seen)) {
                Ok(true) => drawn = Some(seen),
                Ok(false) => return Ok(false),
                Err(failure) => {
                    if let Failure::Render(error) = &failure {
                        self.recovers_from(error);
                    }
                    return Err(self.told(failure));
                }
            }
        }
        if let Some(seen) = drawn {
            self.warm_up.note(scene, &seen);
            self.shared.metrics.render_warm_ups.inc();
        }
        Ok(true)
    }

    /// Draws what nobody waits for; whether nobody came meanwhile.
    fn draw_unasked(
        &mut self,
        request: &ViewRequest,
        (subject, seen): (&Subject, &Seen),
    ) -> Result<bool, Failure> {
        let shared = self.shared;
        // A panic on the way costs what is known of gains and hulls, and no more.
        let mut associations = std::mem::take(&mut self.associations);
        let remembered = associations.of(&subject.scene);
        shared.refresh_forecaster();
        let (nobody, now) = (JobId::nobody(), shared.clock.monotonic());
        let job = Job { id: nobody, request: request.clone(), asked_at: now, flow: Flow::Common };
        let decided = self.decided(subject, seen, (remembered, None), &job);
        self.associations = associations;
        let Choice::New(painting) = decided? else { return Ok(true) };
        let renderer = self.renderer.as_mut().ok_or_else(|| no_renderer(shared, shared.renderer_state()))?;
        let (clock, forecaster) = (&*shared.clock, &shared.forecaster);
        let drawn = painting.paint(subject, renderer, (clock, forecaster), &mut || is_idle(shared))?;
        Ok(drawn.is_some())
    }
}

fn is_idle(shared: &Shared) -> bool {
    shared.queue.waiting().is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_failed_is_left_on_a_new_device_and_what_was_ready_is_made_anew() {
        let scene = |id: &str| {
            Arc::new(
                videofields_picture::scene::parse(
                    id,
                    r#"{"version": 1}"#,
                    videofields_picture::scene::no_imports,
                )
                .unwrap()
                .scene,
            )
        };
        let (good, bad, nothing) = (scene("good"), scene("bad"), Seen::default());
        let mut warm_up = WarmUp::default();
        warm_up.note(&good, &nothing);
        warm_up.note_failed(&bad);
        assert!(!warm_up.is_needed(&good, &nothing) && !warm_up.has_failed(&good));
        warm_up.forget_device();
        assert!(warm_up.is_needed(&good, &nothing), "its programs went with the device");
        assert!(warm_up.has_failed(&bad));
        assert!(!warm_up.has_failed(&scene("bad")), "a changed scene is another");
    }
}
