//! The engine under way with other settings: cameras that come, go and change, and scenes that are read again.
//!
//! In: the cameras as they are to be, and scenes. Whoever changes settings through the door meanwhile is kept out by the
//! caller, who holds the lock that all changes take.

use super::EngineError;
use super::privacy::Privacy;
use super::roster::{Allotment, Roster};
use super::shared::Shared;
use std::collections::BTreeMap;
use std::sync::Arc;
use videofields_picture::scene::Scene;
use videofields_recording::timeline::EventKind;
use videofields_vision::config::{CameraSettings, Settings};
use videofields_vision::frame::CameraId;

impl Shared {
    /// Has one camera run so: [`Door::put_camera`](super::Door::put_camera).
    pub(super) fn run_camera(
        &self,
        camera: &CameraSettings,
        zones: Option<Privacy>,
        order: &[CameraId],
    ) -> Result<(), EngineError> {
        let roster = self.running(camera.id.as_str())?;
        roster.put(camera, zones, order)?;
        self.take_over_cameras(roster);
        Ok(())
    }

    /// Takes one camera away: [`Door::remove_camera`](super::Door::remove_camera).
    pub(super) fn take_camera_out(&self, camera: &str) -> Result<(), EngineError> {
        let roster = self.running(camera)?;
        roster.take_out(camera)?;
        self.take_over_cameras(roster);
        self.metrics.forget_camera(camera, EventKind::ALL.map(EventKind::as_str));
        Ok(())
    }

    /// From now on callers see the cameras that the roster has.
    fn take_over_cameras(&self, roster: &Roster) {
        self.set_cameras(roster.entries());
        if let Some(past) = &self.past {
            past.set_cameras(roster.settings().into_iter().filter(|camera| camera.record));
        }
    }
}

/// Has the engine go on with other settings. Cheap to clone.
#[derive(Clone)]
pub struct Reloader(Arc<Shared>);

impl Reloader {
    pub(super) const fn new(shared: Arc<Shared>) -> Self {
        Self(shared)
    }

    /// From now on there are these cameras, with these zones; those whose settings are the same do not notice. `settings` says
    /// where those that begin now may read from. Blocks for up to some seconds for each that ends. Those whose thread could not be started, and
    /// why.
    #[must_use]
    pub fn apply_cameras(
        &self,
        cameras: &[CameraSettings],
        zones: &BTreeMap<CameraId, Privacy>,
        settings: &Settings,
    ) -> Vec<(CameraId, String)> {
        let Some(roster) = &self.0.roster else { return Vec::new() };
        let before: Vec<CameraId> = self.0.all_cameras().iter().map(|camera| camera.id.clone()).collect();
        let failed = roster.apply(cameras, zones, Allotment::of(settings));
        self.0.take_over_cameras(roster);
        for gone in before.iter().filter(|id| !cameras.iter().any(|camera| camera.id == **id)) {
            self.0.metrics.forget_camera(gone.as_str(), EventKind::ALL.map(EventKind::as_str));
        }
        failed
    }

    /// Tries again to start cameras that are to run and have no thread. Never blocks for one that is being changed.
    pub fn mend(&self) {
        if let Some(roster) = &self.0.roster {
            roster.mend();
        }
    }

    /// The cameras' settings as they are in force.
    #[must_use]
    pub fn cameras(&self) -> Vec<CameraSettings> {
        self.0.roster.as_ref().map(|roster| roster.settings()).unwrap_or_default()
    }

    /// From now on there are these scenes, in this order; those whose documents are the same do not notice.
    pub fn apply_scenes(&self, scenes: Vec<Arc<Scene>>) {
        let before = self.0.scenes.all();
        let order: Vec<String> = scenes.iter().map(|scene| scene.id.clone()).collect();
        for gone in before.iter().filter(|scene| !order.contains(&scene.id)) {
            tracing::info!(scene = gone.id, "a scene is taken away");
            self.0.take_scene_out(&gone.id);
        }
        for scene in scenes {
            let was = before.iter().find(|of| of.id == scene.id);
            if was.is_none_or(|was| was.document != scene.document) {
                tracing::info!(scene = scene.id, "a scene is shown as it was read again");
                self.0.exchange_scene(scene);
            }
        }
        self.0.scenes.order(&order);
    }
}
