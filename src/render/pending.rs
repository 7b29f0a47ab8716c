//! What the device does not have yet of a picture, told before it is drawn.

use super::image_array::Wanted;
use super::renderer::Renderer;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{Pending, Plan};
use videofields_vision::frame::YuvImage;

impl Renderer {
    /// What of `plan` must be made or uploaded first. An estimate: arrays that must grow take all of theirs anew.
    #[must_use]
    pub fn pending(&self, state: &SceneState, plan: &Plan) -> Pending {
        let cameras = |of: &[usize]| of.iter().filter_map(|idx| state.cameras.get(*idx)).collect::<Vec<_>>();
        let background = |bytes: u64, camera: &&videofields_picture::fuse::CameraState| {
            let image = &camera.observation.background;
            let has = self.backgrounds.has(&Wanted::in_sight(image));
            bytes + if has { 0 } else { plane_bytes(image, 0) }
        };
        let frame = |bytes: u64, camera: &&videofields_picture::fuse::CameraState| {
            let (image, mask) = (&camera.observation.frame.image, &camera.observation.soft_mask);
            let has = self.frames.has(&Wanted { image, mask: Some(mask) });
            bytes + if has { 0 } else { plane_bytes(image, mask.data.len() as u64) }
        };
        let upload_bytes = cameras(&plan.surface_cameras).iter().fold(0, background)
            + cameras(&plan.entity_cameras).iter().fold(0, frame);
        let lacks_map = |camera: &&&videofields_picture::fuse::CameraState| {
            !self.depth_maps.has(&state.scene, &camera.camera)
        };
        let depth_maps = cameras(&plan.depth_map_cameras).iter().filter(lacks_map).count();
        Pending { upload_bytes, depth_maps: depth_maps as u32, is_unprepared: !self.is_ready(state, plan) }
    }
}

/// Bytes of a picture's planes, two chroma samples for four of luma.
fn plane_bytes(image: &YuvImage, mask_bytes: u64) -> u64 {
    u64::from(image.width()) * u64::from(image.height()) * 3 / 2 + mask_bytes
}
