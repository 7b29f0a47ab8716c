//! Who is before a scene's cameras, without a picture: now, asked for again and again by those who follow it, or at another time.
//!
//! Answers hang on the scene's identity, and so on the cameras that the caller may see.

use super::EngineError;
use super::associations::MAX_SCENES;
use super::handle::At;
use super::picture::find_in;
use super::shared::Shared;
use super::view::SourceTime;
use glam::DVec3;
use std::sync::{Arc, Mutex, PoisonError};
use videofields_picture::fuse::{self, Entity, SceneState};
use videofields_picture::scene::Scene;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;
use videofields_vision::observation::Observation;

/// What stands before a scene's cameras at an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Present {
    /// The instant.
    pub instant: Timestamp,
    /// The cameras that had a frame for it.
    pub sources: Vec<SourceTime>,
    /// What stands there, in growing order of ids.
    pub entities: Vec<PresentEntity>,
}

/// One thing that stands there.
#[derive(Clone, Debug, PartialEq)]
pub struct PresentEntity {
    /// The same from camera to camera and from instant to instant while the daemon runs.
    pub id: u64,
    /// Where it touches the ground, metres.
    pub foot_in_world: DVec3,
    /// Its height, metres.
    pub height_m: f64,
    /// The cameras that see it.
    pub seen_by: Vec<CameraId>,
}

/// Latest answer about who is present in each scene; the newest is the last.
#[derive(Debug, Default)]
pub(super) struct Presences(Mutex<Vec<Kept>>);

/// Answer, with the number of times that privacy zones had been changed before.
type Answer = (u64, Arc<Present>);

#[derive(Debug)]
struct Kept {
    scene: Arc<Scene>,
    newest: Answer,
}

impl Shared {
    /// Who is present in `scene` now.
    pub(super) fn present_of(&self, scene: &Arc<Scene>) -> Result<Arc<Present>, EngineError> {
        // Asked for first: what is seen then hides at least this.
        let changes = self.privacies.changes();
        let instant = self.live_instant(scene)?;
        let (observations, gaps) = self.seen_at(scene, At::Live, (instant, None))?;
        let source = |(camera, of): &(CameraId, Observation)| SourceTime {
            camera: camera.clone(),
            timestamp: of.frame.timestamp,
        };
        let sources: Vec<SourceTime> = observations.iter().map(source).collect();
        let is_it = |of: &Present| of.instant == instant && of.sources == sources;
        let known = self.presences.newest(scene).filter(|(number, of)| *number == changes && is_it(of));
        if let Some((_, present)) = known {
            return Ok(present);
        }
        let state = {
            let placing = self.placings.of(scene);
            let mut own = placing.lock();
            own.assemble(scene, instant, find_in(&observations, &gaps))
        };
        let present = Arc::new(Present { instant, sources, entities: present_in(&state) });
        self.presences.keep(scene, (changes, Arc::clone(&present)));
        Ok(present)
    }

    /// What stands in `scene` at a time: now with the ids that [`Self::present_of`] tells, at another time with such as hold for that
    /// instant alone.
    pub(super) fn standing_in(&self, scene: &Arc<Scene>, at: At) -> Result<SceneState, EngineError> {
        let instant = match at {
            At::Live => self.live_instant(scene)?,
            At::Time(instant) => instant,
        };
        let (observations, gaps) = self.seen_at(scene, at, (instant, None))?;
        let placing = self.placings.of(scene);
        let mut placing = placing.lock();
        Ok(match at {
            At::Live => placing.assemble(scene, instant, find_in(&observations, &gaps)),
            At::Time(_) => placing.assemble_alone(scene, instant, find_in(&observations, &gaps)),
        })
    }
}

impl Presences {
    /// Returns the latest answer about a scene.
    fn newest(&self, scene: &Arc<Scene>) -> Option<Answer> {
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.iter().find(|of| Arc::ptr_eq(&of.scene, scene)).map(|of| of.newest.clone())
    }

    /// Keeps the latest answer about a scene, in place of those before, also of those about the scene before it was changed.
    fn keep(&self, scene: &Arc<Scene>, newest: Answer) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.retain(|of| !Arc::ptr_eq(&of.scene, scene) && !scene.replaces(&of.scene));
        if kept.len() == MAX_SCENES {
            kept.remove(0);
        }
        kept.push(Kept { scene: Arc::clone(scene), newest });
    }
}

/// Who stands in a state.
#[must_use]
pub fn present_in(state: &SceneState) -> Vec<PresentEntity> {
    state.entities.iter().map(|entity| present(state, entity)).collect()
}

fn present(state: &SceneState, entity: &Entity) -> PresentEntity {
    let camera = |source: &fuse::Billboard| state.cameras[source.camera_idx].id.clone();
    PresentEntity {
        id: entity.id,
        foot_in_world: entity.foot_in_world,
        height_m: entity.height_m,
        seen_by: entity.sources.iter().map(camera).collect(),
    }
}
