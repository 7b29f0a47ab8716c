//! Hulls that were made, kept for pictures of what is still to be seen: several of one instant (a wall's tiles, several viewers), and
//! instants at which none of an entity's cameras had a new frame.

use super::hulls::HullMaking;
use super::{Entity, EntityHull, OwnerMap, SceneState};
use crate::scene::Scene;
use std::sync::{Arc, Weak};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::Mask;
use videofields_vision::geometry::Camera;

/// Most bytes of a scene's hulls that are kept; what was not asked for longest goes first.
const MAX_BYTES: usize = 16 << 20;

/// Pictures after which what none of them asked for goes: the tiles of a wall, and some who look elsewhere.
const MAX_AGE: u64 = 32;

/// What one camera showed.
#[derive(Clone, Debug)]
struct Seen {
    camera_idx: usize,
    camera: Weak<Camera>,
    timestamp: Timestamp,
    labels: Weak<Mask>,
    soft_mask: Weak<Mask>,
    owners: Option<Arc<OwnerMap>>,
}

/// All that a hull follows from.
#[derive(Clone, Debug)]
struct Basis {
    scene: Weak<Scene>,
    entity_idx: usize,
    entity: Entity,
    making: HullMaking,
    seen: Vec<Seen>,
}

#[derive(Clone, Debug)]
struct Kept {
    of: Basis,
    hull: Arc<EntityHull>,
    n_bytes: usize,
    used: u64,
}

/// Hulls of a scene that were made of late.
#[derive(Clone, Debug, Default)]
pub struct HullMemory {
    kept: Vec<Kept>,
    n_uses: u64,
}

impl Seen {
    fn of(state: &SceneState, camera_idx: usize) -> Self {
        let of = &state.cameras[camera_idx];
        Self {
            camera_idx,
            camera: Arc::downgrade(&of.corrected),
            timestamp: of.observation.frame.timestamp,
            labels: Arc::downgrade(&of.observation.labels),
            soft_mask: Arc::downgrade(&of.observation.soft_mask),
            owners: of.owners.clone(),
        }
    }

    fn is(&self, state: &SceneState) -> bool {
        // What has gone from memory is never met again: its address is kept from others by this.
        state.cameras.get(self.camera_idx).is_some_and(|of| {
            self.timestamp == of.observation.frame.timestamp
                && std::ptr::eq(self.camera.as_ptr(), Arc::as_ptr(&of.corrected))
                && std::ptr::eq(self.labels.as_ptr(), Arc::as_ptr(&of.observation.labels))
                && std::ptr::eq(self.soft_mask.as_ptr(), Arc::as_ptr(&of.observation.soft_mask))
                && self.owners == of.owners
        })
    }
}

impl Basis {
    fn of(state: &SceneState, entity_idx: usize, making: HullMaking) -> Self {
        let entity = state.entities[entity_idx].clone();
        let seen = entity.sources.iter().map(|source| Seen::of(state, source.camera_idx)).collect();
        Self { scene: Arc::downgrade(&state.scene), entity_idx, entity, making, seen }
    }

    fn is(&self, state: &SceneState, entity_idx: usize, making: HullMaking) -> bool {
        self.entity_idx == entity_idx
            && self.making == making
            && std::ptr::eq(self.scene.as_ptr(), Arc::as_ptr(&state.scene))
            && self.entity == state.entities[entity_idx]
            && self.seen.iter().all(|seen| seen.is(state))
    }

    /// Returns the bytes of owners' maps that are not `counted` yet, of which those of one instant share one a camera.
    fn n_new_bytes(&self, counted: &mut Vec<*const OwnerMap>) -> usize {
        let maps = self.seen.iter().filter_map(|seen| seen.owners.as_ref());
        let mut n_bytes = 0;
        for map in maps {
            if !counted.contains(&Arc::as_ptr(map)) {
                counted.push(Arc::as_ptr(map));
                n_bytes += size_of_val(map.of_cells());
            }
        }
        n_bytes
    }

    fn can_be_met(&self) -> bool {
        self.seen.iter().all(|seen| seen.labels.strong_count() > 0 && seen.soft_mask.strong_count() > 0)
    }
}

impl HullMemory {
    /// A hull that follows from the same.
    pub(super) fn get(
        &mut self,
        state: &SceneState,
        entity_idx: usize,
        making: HullMaking,
    ) -> Option<Arc<EntityHull>> {
        let kept = self.kept.iter_mut().find(|kept| kept.of.is(state, entity_idx, making))?;
        kept.used = self.n_uses;
        Some(Arc::clone(&kept.hull))
    }

    /// Keeps a hull.
    pub(super) fn insert(&mut self, state: &SceneState, making: HullMaking, hull: &Arc<EntityHull>) {
        let of = Basis::of(state, hull.entity_idx, making);
        self.kept.push(Kept { of, hull: Arc::clone(hull), n_bytes: hull.n_bytes(), used: self.n_uses });
    }

    /// Begins another look.
    pub(super) const fn begin(&mut self) {
        self.n_uses += 1;
    }

    /// Ends it: lets go of what cannot be met again or was not met for long, and of the oldest where it is too much.
    pub(super) fn end(&mut self) {
        let n_uses = self.n_uses;
        self.kept.retain(|kept| kept.used + MAX_AGE > n_uses && kept.of.can_be_met());
        self.kept.sort_by_key(|kept| std::cmp::Reverse(kept.used));
        let mut n_bytes = 0;
        let mut counted = Vec::new();
        self.kept.retain(|kept| {
            n_bytes += kept.n_bytes + kept.of.n_new_bytes(&mut counted);
            n_bytes <= MAX_BYTES
        });
    }

    /// Bytes of the hulls that are kept.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        let mut counted = Vec::new();
        self.kept.iter().map(|kept| kept.n_bytes + kept.of.n_new_bytes(&mut counted)).sum()
    }
}
