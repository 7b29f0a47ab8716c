//! Making ready while nobody asks: the scenes' own views are drawn once, so that the first picture somebody asks for waits for
//! no program and no patches, and deadlines are judged by what pictures take and not by what their first takes.

use super::{Failure, RenderThread};
use crate::engine::EngineError;
use crate::engine::picture::Subject;
use crate::engine::resolve::{Resolved, Seen};
use crate::engine::shared::Shared;
use crate::engine::view::ViewRequest;
use crate::frame::CameraId;
use crate::plan::{Aim, Detail, Effort, Filtering, Named, Preset};
use crate::render::MAX_READY_SCENES;
use crate::scene::Scene;
use std::sync::{Arc, Weak};
use std::time::Duration;

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

/// Which scenes were made ready on this device.
#[derive(Debug, Default)]
pub(super) struct WarmUp(Vec<Ready>);

impl WarmUp {
    fn of(&self, scene: &Arc<Scene>) -> Option<&Ready> {
        self.0.iter().find(|ready| std::ptr::eq(ready.scene.as_ptr(), Arc::as_ptr(scene)))
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
        self.0.retain(|ready| !std::ptr::eq(ready.scene.as_ptr(), Arc::as_ptr(scene)));
        let has_entities = had_entities || has_entities(seen);
        self.0.push(Ready { scene: Arc::downgrade(scene), cameras, has_entities });
    }
}

fn has_entities((observations, _): &Seen) -> bool {
    observations.iter().any(|(_, observation)| !observation.blobs.is_empty())
}

impl RenderThread<'_> {
    /// The scenes that are made ready: no more than stay so.
    fn warmed(&self) -> &[Arc<Scene>] {
        let scenes = &self.shared.scenes;
        if self.shared.render_settings.warm_up { &scenes[..scenes.len().min(MAX_READY_SCENES)] } else { &[] }
    }

    /// For how long nothing is to be made ready.
    pub(super) fn until_warm_up(&self) -> Duration {
        let is_cold = |scene| self.warm_up.of(scene).is_none();
        if self.warmed().iter().any(is_cold) { COLD_TIME } else { Duration::MAX }
    }

    /// Makes ready what is not, until somebody asks for a picture.
    pub(super) fn make_scenes_ready(&mut self) {
        for scene in self.warmed().to_vec() {
            let done = self.contained(|thread| thread.make_scene_ready(&scene));
            match done {
                Ok(true) => {}
                Ok(false) => return,
                Err(error) => tracing::debug!(scene = scene.id, %error, "not made ready"),
            }
        }
    }

    /// Whether that is done: not where somebody asked for a picture meanwhile.
    fn make_scene_ready(&mut self, scene: &Arc<Scene>) -> Result<bool, EngineError> {
        let mut drawn = None;
        for effort in std::iter::repeat_n(efforts(), TIMES).flatten() {
            if !is_idle(self.shared) {
                return Ok(false);
            }
            let Resolved { subject, seen } = self.shared.resolve(&ViewRequest::own(scene, effort))?;
            if drawn.is_none() && !self.warm_up.is_needed(scene, &seen) {
                return Ok(true);
            }
            self.ensure_renderer()?;
            match self.draw_unasked(&subject, &seen) {
                Ok(true) => drawn = Some(seen),
                Ok(false) => return Ok(false),
                Err(failure) => {
                    if let Failure::Render(error) = &failure {
                        self.recovers_from(error);
                    }
                    // Not again and again: whoever asks for it is told why it cannot be drawn.
                    self.warm_up.note(scene, &seen);
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
    fn draw_unasked(&mut self, subject: &Subject, seen: &Seen) -> Result<bool, Failure> {
        let shared = self.shared;
        // A panic on the way costs what is known of who is who and of gains, and no more.
        let mut associations = std::mem::take(&mut self.associations);
        let remembered = associations.of(&subject.scene);
        shared.refresh_forecaster();
        let mut wanted = || is_idle(shared);
        let drawn = self.drawn(subject, seen, (remembered, None), shared.clock.monotonic(), &mut wanted);
        self.associations = associations;
        Ok(drawn?.is_some())
    }
}

fn is_idle(shared: &Shared) -> bool {
    shared.queue.waiting().is_empty()
}
