//! Where the playheads of the running engine stand: their scenes' extents, and steps from frame to frame.

use super::EngineError;
use super::playheads::{Change, Entry, PlayheadState, Step};
use super::shared::{CameraEntry, Shared};
use std::sync::Arc;
use videofields_picture::scene::Scene;
use videofields_recording::timeline::Extent;
use videofields_vision::access::Scope;
use videofields_vision::clock::Timestamp;

impl Shared {
    /// What there is of a scene's time.
    fn extent(&self, scene: &Scene) -> Extent {
        let live = self.live_instant(scene).unwrap_or_else(|_nothing_yet| self.clock.now());
        let first = |camera: &Arc<CameraEntry>| {
            let recorded = self.past.as_ref().and_then(|past| past.first(&camera.id));
            [recorded, camera.timeline.range().map(|(first, _)| first)].into_iter().flatten().min()
        };
        Extent { first: self.members(scene).iter().filter_map(first).min(), live }
    }

    /// The frame nearest to `from` on one side of it, of any of the scene's cameras. Blocks where memory does not hold it.
    fn stepped(&self, scene: &Scene, step: Step, from: Timestamp) -> Option<Timestamp> {
        let times = self.members(scene);
        let times = times.iter().filter_map(|camera| self.neighbour(camera, step, from));
        match step {
            Step::On => times.min(),
            Step::Back => times.max(),
        }
    }

    fn neighbour(&self, camera: &CameraEntry, step: Step, from: Timestamp) -> Option<Timestamp> {
        let timeline = &camera.timeline;
        let (kept, is_whole) = match step {
            // Between the oldest kept and what is asked may lie what was recorded.
            Step::On => (timeline.next_after(from), timeline.range().is_some_and(|(first, _)| first <= from)),
            Step::Back => {
                let kept = timeline.last_before(from);
                (kept, kept.is_some())
            }
        };
        let recorded = || self.past.as_ref()?.neighbour(&camera.id, from, step);
        if is_whole { kept } else { recorded().or(kept) }
    }

    /// A playhead as callers see it now.
    pub(super) fn playhead_state(&self, entry: &Entry, scope: &Scope) -> Result<PlayheadState, EngineError> {
        let scene = self.scene_within(&entry.scene, scope)?;
        Ok(entry.state(self.clock.monotonic(), self.extent(&scene)))
    }

    /// Where the playhead of that name stands.
    pub(super) fn playhead_position(&self, id: &str, scope: &Scope) -> Result<Timestamp, EngineError> {
        let entry = self.playheads.find(id)?;
        let scene = self.scene_within(&entry.scene, scope)?;
        Ok(entry.playhead.position(self.clock.monotonic(), self.extent(&scene)))
    }

    /// Changes the playhead of that name; makes it where `scene` says of which scene.
    pub(super) fn change_playhead_of(
        &self,
        id: &str,
        change: &Change,
        (scene, scope): (Option<&str>, &Scope),
    ) -> Result<PlayheadState, EngineError> {
        loop {
            let known = self.playheads.find(id);
            let mut entry = match (&known, scene) {
                (Ok(entry), _) => entry.clone(),
                (Err(_), Some(scene)) => Entry::new(id, scene),
                (Err(error), None) => return Err(error.clone()),
            };
            let of = self.scene_within(change.scene.as_deref().unwrap_or(&entry.scene), scope)?;
            entry.scene.clone_from(&of.id);
            let extent = self.extent(&of);
            let stepped = |from| change.step.and_then(|step| self.stepped(&of, step, from));
            entry.apply(change, self.clock.monotonic(), extent, stepped);
            // Another caller's change comes first, and this one is done again upon it.
            if self.playheads.replace(entry.clone(), known.ok().map(|entry| entry.version()))? {
                return self.playhead_state(&entry, scope);
            }
        }
    }
}
