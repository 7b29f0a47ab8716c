//! Views from where a camera stands, to be drawn without it.

use super::SweepError;
use super::gate::Stopwatch;
use super::measures::NO_OWNER;
use super::subject::{Scope, Subject, SubjectView, owners};
use crate::geometry::Camera;
use crate::scene::SceneView;
use crate::simulate::World;
use glam::{DVec2, DVec3};

/// Vertical fields of view that a camera's place is judged with, radians.
const LEAST_FOV_RAD: f64 = 0.2;
const MOST_FOV_RAD: f64 = 1.4;

impl Subject {
    /// The view from the place of one of the subject's cameras, without its lens and its roll, at the scope's moments.
    /// Its still part is what another camera sees.
    ///
    /// # Errors
    /// When there is no such camera, its truth cannot be cast, or the gate ends it.
    pub fn left_out_view(
        &self,
        world: &World,
        scope: &Scope,
        camera_idx: usize,
        watch: &Stopwatch<'_>,
    ) -> Result<SubjectView, SweepError> {
        let of = self.cameras.get(camera_idx).ok_or(SweepError::NoCamera)?;
        let mut view = self.judged(world, scope, place_of(&of.camera), watch)?;
        let others = self.cameras.iter().enumerate().filter(|(idx, _)| *idx != camera_idx);
        let others: Vec<&Camera> = others.map(|(_, camera)| &camera.camera).collect();
        view.owners = owners(&self.scene.surfaces, &others, &view.view);
        for (_, judged) in &mut view.frames {
            let unseen = view.owners.data.iter().map(|owner| *owner == NO_OWNER);
            for (still, _) in judged.still.data.iter_mut().zip(unseen).filter(|(_, is_unseen)| *is_unseen) {
                *still = 0;
            }
        }
        Ok(view)
    }
}

/// Where a camera stands, where it looks, and how far up and down it sees.
fn place_of(camera: &Camera) -> SceneView {
    let pose = camera.pose();
    let ahead = pose.world_from_local * DVec3::Z;
    let edges = [DVec2::new(0.5, 0.0), DVec2::new(0.5, 1.0)].map(|place| camera.ray(place));
    let fov_y_rad = match edges {
        [Some(top), Some(bottom)] => top.direction.angle_between(bottom.direction),
        _ => MOST_FOV_RAD,
    };
    SceneView {
        eye: pose.position_in_world,
        target: pose.position_in_world + 10.0 * ahead,
        fov_y_rad: fov_y_rad.clamp(LEAST_FOV_RAD, MOST_FOV_RAD),
    }
}
