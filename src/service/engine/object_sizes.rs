//! Sizes of objects in each camera's pictures, as the scenes that have the camera say.
//!
//! Scenes flow in whenever they are exchanged; a camera's thread takes its camera's sizes before each frame. Of several scenes the
//! smaller sizes decide.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use videofields_picture::scene::{Scene, object_sizes};
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::is_stretched;
use videofields_vision::segment::ObjectSizes;

/// Keeps the sizes of objects of all cameras that a scene has.
#[derive(Debug, Default)]
pub(super) struct CameraObjectSizes {
    by_camera: RwLock<HashMap<CameraId, Arc<ObjectSizes>>>,
    /// Scenes that have a camera, each with the size of the picture that was calibrated.
    calibrated: RwLock<HashMap<CameraId, Vec<Calibrated>>>,
    /// Scenes whose sizes are known; held while they are brought up to date.
    known: Mutex<Vec<Known>>,
}

/// A scene, and the sizes in the order of its cameras.
type Known = (Arc<Scene>, Vec<Arc<ObjectSizes>>);

/// A scene's id, and columns and rows of the picture that was calibrated for it.
pub(super) type Calibrated = (String, (u32, u32));

impl CameraObjectSizes {
    /// Returns the sizes of a camera; none where no scene has it.
    pub(super) fn of(&self, camera: &CameraId) -> Option<Arc<ObjectSizes>> {
        self.by_camera.read().unwrap_or_else(PoisonError::into_inner).get(camera).cloned()
    }

    /// Returns the first scene by whose calibration pictures of a camera of that size are stretched, with the size that was calibrated.
    pub(super) fn stretched(&self, camera: &CameraId, size_px: (u32, u32)) -> Option<Calibrated> {
        let calibrated = self.calibrated.read().unwrap_or_else(PoisonError::into_inner);
        calibrated
            .get(camera)?
            .iter()
            .find(|(_, calibrated_px)| is_stretched(*calibrated_px, size_px))
            .cloned()
    }

    /// Brings the sizes up to date with the scenes that `now` returns. `now` is asked under the
    /// lock, so that of several callers none puts older scenes back.
    pub(super) fn refresh(&self, now: impl FnOnce() -> Arc<[Arc<Scene>]>) {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let before = std::mem::take(&mut *known);
        for scene in &*now() {
            let sizes = match before.iter().find(|(of, _)| Arc::ptr_eq(of, scene)) {
                Some((_, sizes)) => sizes.clone(),
                None => scene.cameras.iter().map(|member| Arc::new(object_sizes(scene, member))).collect(),
            };
            known.push((Arc::clone(scene), sizes));
        }
        let mut by_camera: HashMap<CameraId, Arc<ObjectSizes>> = HashMap::new();
        let mut calibrated: HashMap<CameraId, Vec<Calibrated>> = HashMap::new();
        for (scene, sizes) in &*known {
            for (member, sizes) in scene.cameras.iter().zip(sizes) {
                let smallest = match by_camera.get(&member.id) {
                    Some(others) => Arc::new(sizes.smaller_of(others)),
                    None => Arc::clone(sizes),
                };
                by_camera.insert(member.id.clone(), smallest);
                let of = calibrated.entry(member.id.clone()).or_default();
                of.push((scene.id.clone(), member.camera.size_px()));
            }
        }
        *self.by_camera.write().unwrap_or_else(PoisonError::into_inner) = by_camera;
        *self.calibrated.write().unwrap_or_else(PoisonError::into_inner) = calibrated;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_picture::scene::{no_imports, parse};

    /// Returns a scene of one camera that looks down at level ground, with objects of at least `size_m` metres.
    fn scene(id: &str, size_m: f64) -> Arc<Scene> {
        let text = format!(
            r#"{{"version": 1, "ground": [{{"polygon": [[-50, -50], [50, -50], [50, 50], [-50, 50]]}}],
            "entities": {{"min_size_m": {size_m}}}, "cameras": [{{"id": "north", "calibration": {{"image_size_px": [64, 48],
            "focal_px": [60, 60], "center_px": [32, 24], "position_m": [0, 8, 6],
            "world_from_camera": [0, -0.9238795325112867, 0.3826834323650898, 0]}}}}]}}"#
        );
        Arc::new(parse(id, &text, no_imports).unwrap().scene)
    }

    #[test]
    fn the_smallest_area_of_all_scenes_that_have_a_camera_decides_and_goes_with_its_scene() {
        let sizes = CameraObjectSizes::default();
        let north = CameraId::new("north").unwrap();
        let middle = || sizes.of(&north).map(|sizes| sizes.least_area_px([32.0, 24.0], (64, 48)));
        assert_eq!(middle(), None);
        let (large, small) = (scene("a", 2.0), scene("b", 0.5));
        sizes.refresh(|| [Arc::clone(&large)].into());
        let of_large = middle().unwrap();
        for both in [[&large, &small], [&small, &large]] {
            sizes.refresh(|| both.map(Arc::clone).into());
            let of_both = middle().unwrap();
            assert!((of_large / of_both - 16.0).abs() < 0.5, "{of_large} {of_both}");
        }
        sizes.refresh(|| [large].into());
        assert_eq!(middle(), Some(of_large));
        sizes.refresh(|| [].into());
        assert_eq!(middle(), None);
        assert_eq!(sizes.of(&CameraId::new("south").unwrap()), None);
    }
}
