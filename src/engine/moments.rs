//! Where the playheads of the running engine stand: their scenes' extents, and steps from frame to frame.

use super::EngineError;
use super::handle::Door;
use super::playheads::{Change, Entry, PlayheadState, Step};
use super::shared::Shared;
use crate::clock::Timestamp;
use crate::scene::Scene;
use crate::timeline::Extent;
use std::sync::Arc;

impl Shared {
    /// What there is of a scene's time.
    fn extent(&self, scene: &Scene) -> Extent {
        let live = self.live_instant(scene).unwrap_or_else(|_nothing_yet| self.clock.now());
        let firsts = self.timelines(scene).filter_map(|timeline| Some(timeline.range()?.0));
        Extent { first: firsts.min(), live }
    }

    /// The frame nearest to `from` on one side of it, of any of the scene's cameras.
    fn stepped(&self, scene: &Scene, step: Step, from: Timestamp) -> Option<Timestamp> {
        match step {
            Step::On => self.timelines(scene).filter_map(|timeline| timeline.next_after(from)).min(),
            Step::Back => self.timelines(scene).filter_map(|timeline| timeline.last_before(from)).max(),
        }
    }

    /// A playhead as callers see it now.
    pub(super) fn playhead_state(&self, entry: &Entry) -> Result<PlayheadState, EngineError> {
        let scene = self.scene(&entry.scene)?;
        Ok(entry.state(self.clock.monotonic(), self.extent(&scene)))
    }

    /// Where the playhead of that name stands.
    pub(super) fn playhead_position(&self, id: &str) -> Result<Timestamp, EngineError> {
        let entry = self.playheads.find(id)?;
        let scene = self.scene(&entry.scene)?;
        Ok(entry.playhead.position(self.clock.monotonic(), self.extent(&scene)))
    }

    /// Changes the playhead of that name; makes it where `scene` says of which scene.
    pub(super) fn change_playhead_of(
        &self,
        id: &str,
        change: &Change,
        scene: Option<&str>,
    ) -> Result<PlayheadState, EngineError> {
        loop {
            let known = self.playheads.find(id);
            let mut entry = match (&known, scene) {
                (Ok(entry), _) => entry.clone(),
                (Err(_), Some(scene)) => Entry::new(id, scene),
                (Err(error), None) => return Err(error.clone()),
            };
            let of: Arc<Scene> = self.scene(change.scene.as_deref().unwrap_or(&entry.scene))?;
            entry.scene.clone_from(&of.id);
            let extent = self.extent(&of);
            let stepped = |from| change.step.and_then(|step| self.stepped(&of, step, from));
            entry.apply(change, self.clock.monotonic(), extent, stepped);
            // Another caller's change comes first, and this one is done again upon it.
            if self.playheads.replace(entry.clone(), known.ok().map(|entry| entry.version()))? {
                return self.playhead_state(&entry);
            }
        }
    }
}
