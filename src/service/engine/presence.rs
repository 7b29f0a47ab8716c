//! Tells who is before a scene's cameras, without a picture: now, asked for again and again by those who follow it, or at a time that is over.
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
use videofields_picture::fuse::{Entity, SceneState};
use videofields_picture::scene::Scene;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;
use videofields_vision::observation::Observation;

/// Entities before a scene's cameras at an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Present {
    /// The instant.
    pub instant: Timestamp,
    /// The cameras that had a frame for it; none at a time that is over.
    pub sources: Vec<SourceTime>,
    /// The entities, in growing order of ids.
    pub entities: Vec<PresentEntity>,
}

/// One thing that stands there.
#[derive(Clone, Debug, PartialEq)]
pub struct PresentEntity {
    /// Id, the same from camera to camera and from instant to instant, now and when it is over.
    pub id: u64,
    /// Place where it touches the ground, metres.
    pub foot_in_world: DVec3,
    /// Its height, metres.
    pub height_m: f64,
    /// The cameras that see it.
    pub seen_by: Vec<CameraId>,
}

/// Most metres between where somebody is kept and where pictures of the same instant show them, and most standard deviations of the latter,
/// whichever is more: what is kept was known with the instants before.
const SAME_M: f64 = 1.0;
const SAME_SDS: f64 = 2.0;

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
    /// Returns who is present in `scene` now: at the instant that was placed last, where everybody is placed unasked.
    pub(super) fn present_of(&self, scene: &Arc<Scene>) -> Result<Arc<Present>, EngineError> {
        self.ask_to_place(scene);
        match self.placed_lately(scene) {
            Some(present) => Ok(present),
            None => self.place(scene).map(|(present, _)| present),
        }
    }

    /// Returns who was placed last, where that goes on unasked and was not long ago.
    fn placed_lately(&self, scene: &Arc<Scene>) -> Option<Arc<Present>> {
        let period = self.entities.period().filter(|_| self.entities.is_placed(scene))?;
        let (changes, present) = self.presences.newest(scene)?;
        let passed = self.live_instant(scene).ok()?.nanos_since(present.instant);
        let is_of_late = (0..=2 * period.as_nanos() as i64).contains(&passed);
        (is_of_late && changes == self.privacies.changes()).then_some(present)
    }

    /// Places everybody in `scene` now, and tells whether that was not known before.
    pub(super) fn place(&self, scene: &Arc<Scene>) -> Result<(Arc<Present>, bool), EngineError> {
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
            return Ok((present, false));
        }
        let state = {
            let placing = self.placing_of(scene);
            let mut own = placing.lock();
            own.assemble(scene, instant, find_in(&observations, &gaps))
        };
        let present = Arc::new(Present { instant, sources, entities: present_in(&state) });
        self.gather(scene, &present);
        self.presences.keep(scene, (changes, Arc::clone(&present)));
        Ok((present, true))
    }

    /// Returns who was present in `scene` at a time: as it is kept, or by what the cameras saw where it is not.
    pub(super) fn present_at(&self, scene: &Arc<Scene>, at: At) -> Result<Arc<Present>, EngineError> {
        let At::Time(instant) = at else { return self.present_of(scene) };
        let entities = match self.recalled_at(scene, instant)? {
            Some(entities) => entities,
            None => present_in(&self.standing_named(scene, at, (instant, None))?),
        };
        Ok(Arc::new(Present { instant, sources: Vec::new(), entities }))
    }

    /// Returns what stands in `scene` at a time, with the ids that [`Self::present_at`] tells; whom that does not tell of is left out.
    pub(super) fn standing_in(&self, scene: &Arc<Scene>, at: At) -> Result<SceneState, EngineError> {
        let (instant, kept) = match at {
            At::Live => (self.live_instant(scene)?, None),
            At::Time(instant) => (instant, self.recalled_at(scene, instant)?),
        };
        self.standing_named(scene, at, (instant, kept))
    }

    fn standing_named(
        &self,
        scene: &Arc<Scene>,
        at: At,
        (instant, kept): (Timestamp, Option<Vec<PresentEntity>>),
    ) -> Result<SceneState, EngineError> {
        let (observations, gaps) = self.seen_at(scene, at, (instant, None))?;
        let find = find_in(&observations, &gaps);
        let placing = self.placing_of(scene);
        let mut placing = placing.lock();
        let Some(kept) = kept else { return Ok(placing.assemble(scene, instant, find)) };
        let mut state = placing.assemble_alone(scene, instant, find);
        name_as_kept(&mut state, &kept);
        Ok(state)
    }
}

/// Names the entities of a state as those that are kept of its instant, the nearest first; leaves out whom these do not tell of.
fn name_as_kept(state: &mut SceneState, kept: &[PresentEntity]) {
    let mut pairs: Vec<(f64, usize, u64)> = Vec::new();
    for (idx, entity) in state.entities.iter().enumerate() {
        let away = |of: &PresentEntity| of.foot_in_world.distance(entity.foot_in_world);
        let covariance = entity.foot_covariance_m2;
        let sd_m = (covariance.x_axis.x + covariance.y_axis.y).sqrt();
        let most_m = SAME_M.max(SAME_SDS * sd_m);
        let near = kept.iter().map(|of| (away(of), idx, of.id)).filter(|(away_m, ..)| *away_m <= most_m);
        pairs.extend(near);
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut names: Vec<Option<u64>> = vec![None; state.entities.len()];
    for (_, idx, id) in pairs {
        if names[idx].is_none() && !names.contains(&Some(id)) {
            names[idx] = Some(id);
        }
    }
    let mut names = names.into_iter();
    state.entities.retain_mut(|entity| {
        let name = names.next().flatten();
        entity.id = name.unwrap_or(entity.id);
        name.is_some()
    });
    state.entities.sort_by_key(|entity| entity.id);
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

/// Returns who stands in a state.
#[must_use]
pub fn present_in(state: &SceneState) -> Vec<PresentEntity> {
    state.entities.iter().map(|entity| present(state, entity)).collect()
}

fn present(state: &SceneState, entity: &Entity) -> PresentEntity {
    let id = |camera_idx: usize| state.cameras[camera_idx].id.clone();
    PresentEntity {
        id: entity.id,
        foot_in_world: entity.foot_in_world,
        height_m: entity.height_m,
        seen_by: entity.cameras().map(id).collect(),
    }
}
