//! The engine's scenes: a list that is read as it was at one moment, and whose scenes are exchanged whole.

use std::collections::BTreeSet;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use videofields_picture::scene::Scene;
use videofields_vision::frame::CameraId;

/// The scenes, the default one first.
#[derive(Debug)]
pub(super) struct SceneList {
    now: Mutex<Listed>,
    changed: Condvar,
}

/// The list as it was at one moment.
#[derive(Clone, Debug)]
pub(super) struct Listed {
    /// How often it has been changed, or who waits for that was woken.
    pub(super) changes: u64,
    pub(super) scenes: Arc<[Arc<Scene>]>,
    /// Every camera that is configured or part of a scene, in the order of ids.
    pub(super) camera_ids: Arc<[CameraId]>,
    /// The configured cameras.
    cameras: Arc<[CameraId]>,
}

impl SceneList {
    pub(super) fn new<'a>(scenes: Vec<Arc<Scene>>, cameras: impl Iterator<Item = &'a CameraId>) -> Self {
        let cameras: Arc<[CameraId]> = cameras.cloned().collect();
        let camera_ids = camera_ids(&cameras, &scenes);
        let now = Mutex::new(Listed { changes: 0, scenes: scenes.into(), camera_ids, cameras });
        Self { now, changed: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, Listed> {
        // A panic leaves it whole: it is replaced whole.
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn now(&self) -> Listed {
        self.lock().clone()
    }

    /// All of them.
    pub(super) fn all(&self) -> Arc<[Arc<Scene>]> {
        Arc::clone(&self.lock().scenes)
    }

    /// The one of that id.
    pub(super) fn find(&self, id: &str) -> Option<Arc<Scene>> {
        self.all().iter().find(|scene| scene.id == id).cloned()
    }

    /// Whether a scene is the one that its id means now.
    pub(super) fn is_current(&self, scene: &Arc<Scene>) -> bool {
        self.all().iter().any(|of| Arc::ptr_eq(of, scene))
    }

    /// Puts a scene in the place of the one of its id, or after all others.
    pub(super) fn put(&self, scene: Arc<Scene>) {
        self.change(|scenes| match scenes.iter_mut().find(|of| of.id == scene.id) {
            Some(place) => *place = scene,
            None => scenes.push(scene),
        });
    }

    /// Takes a scene out, and answers whether there was one.
    pub(super) fn remove(&self, id: &str) -> bool {
        let is_there = self.find(id).is_some();
        self.change(|scenes| scenes.retain(|scene| scene.id != id));
        is_there
    }

    /// From now on these cameras are configured.
    pub(super) fn set_cameras(&self, cameras: Arc<[CameraId]>) {
        self.lock().cameras = cameras;
        self.change(|_| ());
    }

    /// Puts those of `order` first, in that order, and leaves the others behind them as they are.
    pub(super) fn order(&self, order: &[String]) {
        let place = |scene: &Arc<Scene>| order.iter().position(|id| *id == scene.id).unwrap_or(usize::MAX);
        self.change(|scenes| scenes.sort_by_key(place));
    }

    fn change(&self, change: impl FnOnce(&mut Vec<Arc<Scene>>)) {
        let mut now = self.lock();
        let mut scenes = now.scenes.to_vec();
        change(&mut scenes);
        let cameras = Arc::clone(&now.cameras);
        let camera_ids = camera_ids(&cameras, &scenes);
        *now = Listed { changes: now.changes + 1, scenes: scenes.into(), camera_ids, cameras };
        self.changed.notify_all();
    }

    /// Waits until the list has changed since `changes`, or who waits was woken.
    pub(super) fn wait_for_change(&self, changes: u64) {
        let changed = self.changed.wait_while(self.lock(), |now| now.changes == changes);
        drop(changed.unwrap_or_else(PoisonError::into_inner));
    }

    /// Wakes whoever waits for changes, though there is none.
    pub(super) fn wake(&self) {
        self.change(|_| ());
    }
}

fn camera_ids(cameras: &[CameraId], scenes: &[Arc<Scene>]) -> Arc<[CameraId]> {
    let members = scenes.iter().flat_map(|scene| scene.cameras.iter().map(|member| &member.id));
    let ids: BTreeSet<&CameraId> = cameras.iter().chain(members).collect();
    ids.into_iter().cloned().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(id: &str) -> Arc<Scene> {
        let text = format!(
            r#"{{"version": 1, "cameras": [{{"id": "of-{id}", "calibration": {{"image_size_px": [64, 48],
            "focal_px": [60, 60], "center_px": [32, 24], "position_m": [0, 8, 6],
            "world_from_camera": [0, -0.9238795325112867, 0.3826834323650898, 0]}}}}]}}"#
        );
        Arc::new(
            videofields_picture::scene::parse(id, &text, videofields_picture::scene::no_imports)
                .unwrap()
                .scene,
        )
    }

    fn ids(list: &SceneList) -> Vec<String> {
        list.all().iter().map(|scene| scene.id.clone()).collect()
    }

    #[test]
    fn a_scene_is_exchanged_in_its_place_and_who_looked_before_has_the_old_list() {
        let camera = CameraId::new("lone").unwrap();
        let (a, b) = (scene("a"), scene("b"));
        let list = SceneList::new(vec![Arc::clone(&a), Arc::clone(&b)], [&camera].into_iter());
        let before = list.now();
        let other = scene("a");
        list.put(Arc::clone(&other));
        assert!(Arc::ptr_eq(&before.scenes[0], &a) && list.is_current(&other) && !list.is_current(&a));
        list.put(scene("c"));
        assert_eq!(ids(&list), ["a", "b", "c"]);
        let known: Vec<_> = list.now().camera_ids.iter().map(ToString::to_string).collect();
        assert_eq!(known, ["lone", "of-a", "of-b", "of-c"]);
        assert!(list.remove("b") && !list.remove("b"));
        assert_eq!(ids(&list), ["a", "c"]);
        list.wait_for_change(before.changes);
        let (list, changes) = (Arc::new(list), before.changes + 4);
        let waiting = {
            let list = Arc::clone(&list);
            std::thread::Builder::new().spawn(move || list.wait_for_change(changes)).unwrap()
        };
        list.wake();
        waiting.join().unwrap();
    }
}
