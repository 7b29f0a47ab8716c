//! The one camera model: projection of world points into a picture and of texture coordinates into rays.
//!
//! Video Fields (Du, Bista, Varshney 2016) eq. 6 and 7, with distortion:
//! `p_c` = R^T (p - C); (x, y) = (`p_c.x`, `p_c.y`) / `p_c.z`; (x', y') = distort(x, y);
//! u = (fx x' + cx) / width; v = (fy y' + cy) / height.

use super::distortion::{Distortion, DistortionLimit};
use super::{Pose, Ray};
use glam::{DVec2, DVec3};

/// Distance along the optical axis below which a point has no texture coordinate, metres.
pub const NEAR_M: f64 = 0.01;

/// A calibrated camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    width_px: u32,
    height_px: u32,
    focal_px: DVec2,
    center_px: DVec2,
    distortion: Distortion,
    limit: DistortionLimit,
    pose: Pose,
}

/// Where a world point lies in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Texture coordinate; outside [0, 1]^2 the point is beside the picture.
    pub texture: DVec2,
    /// Distance along the optical axis, metres.
    pub depth_m: f64,
}

impl Projection {
    /// Whether the point lies in the picture.
    #[must_use]
    pub fn is_inside(&self) -> bool {
        (0.0..=1.0).contains(&self.texture.x) && (0.0..=1.0).contains(&self.texture.y)
    }
}

/// Why numbers are no camera.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CameraError {
    /// A value is not a finite number.
    #[error("{field} is not finite")]
    NotFinite {
        /// Which value.
        field: &'static str,
    },
    /// A value lies outside its range.
    #[error("{field} must be {allowed}")]
    OutOfRange {
        /// Which value.
        field: &'static str,
        /// What is allowed.
        allowed: &'static str,
    },
}

fn check_position(position_in_world: DVec3) -> Result<(), CameraError> {
    if !position_in_world.is_finite() {
        return Err(CameraError::NotFinite { field: "position" });
    }
    if position_in_world.abs().max_element() > 1e8 {
        let allowed = "within 1e8 m of the scene's origin";
        return Err(CameraError::OutOfRange { field: "position", allowed });
    }
    Ok(())
}

impl Camera {
    /// A camera calibrated for pictures of `size_px` columns and rows.
    ///
    /// `focal_px` and `center_px` (principal point) are in pixels of that size, pixel centres at +0.5. The pose's
    /// rotation is normalised.
    ///
    /// # Errors
    /// When a number is not finite, a size is 0 or above 65536, a focal length is not positive, the rotation is
    /// not near a unit quaternion (within 1 %), or the distortion has no usable region around the axis.
    pub fn new(
        size_px: (u32, u32),
        focal_px: DVec2,
        center_px: DVec2,
        distortion: Distortion,
        pose: Pose,
    ) -> Result<Self, CameraError> {
        let (width_px, height_px) = size_px;
        let finite = [
            ("focal length", focal_px.is_finite()),
            ("principal point", center_px.is_finite()),
            ("rotation", pose.world_from_local.is_finite()),
            ("distortion", distortion.is_finite()),
        ];
        if let Some((field, _)) = finite.into_iter().find(|(_, is_finite)| !is_finite) {
            return Err(CameraError::NotFinite { field });
        }
        let out = |field, allowed| Err(CameraError::OutOfRange { field, allowed });
        if !(1..=65_536).contains(&width_px) || !(1..=65_536).contains(&height_px) {
            return out("image size", "1 to 65536 pixels each way");
        }
        if focal_px.min_element() <= 1e-3 || focal_px.max_element() > 1e7 {
            return out("focal length", "above 0.001 and at most 1e7 pixels");
        }
        if center_px.abs().max_element() > 1e7 {
            return out("principal point", "within 1e7 pixels of the picture's corner");
        }
        check_position(pose.position_in_world)?;
        if (pose.world_from_local.length() - 1.0).abs() > 0.01 {
            return out("rotation", "a unit quaternion (length within 1 % of 1)");
        }
        let Some(limit) = distortion.limit() else {
            return out("distortion", "such that it grows with the radius around the axis");
        };
        let pose = Pose { world_from_local: pose.world_from_local.normalize(), ..pose };
        Ok(Self { width_px, height_px, focal_px, center_px, distortion, limit, pose })
    }

    /// A camera without distortion at `eye` that looks at `target`, its picture's middle on its axis.
    ///
    /// `fov_y_rad` is the vertical field of view, 0.01 to 3.0; `size_px` are columns and rows.
    ///
    /// # Errors
    /// When a number is out of its range or not finite, or eye and target coincide.
    pub fn pinhole(
        eye: DVec3,
        target: DVec3,
        fov_y_rad: f64,
        size_px: (u32, u32),
    ) -> Result<Self, CameraError> {
        let out = |field, allowed| CameraError::OutOfRange { field, allowed };
        if !(0.01..=3.0).contains(&fov_y_rad) {
            return Err(out("field of view", "0.01 to 3.0 rad"));
        }
        let pose = Pose::looking_at(eye, target)
            .ok_or_else(|| out("eye", "finite and somewhere else than the target"))?;
        let size = DVec2::new(f64::from(size_px.0), f64::from(size_px.1));
        let focal_px = size.y * 0.5 / (fov_y_rad * 0.5).tan();
        Self::new(size_px, DVec2::splat(focal_px), size * 0.5, Distortion::None, pose)
    }

    /// Size of the calibrated picture: columns, rows.
    #[must_use]
    pub const fn size_px(&self) -> (u32, u32) {
        (self.width_px, self.height_px)
    }

    /// Focal lengths in pixels of the calibrated picture.
    #[must_use]
    pub const fn focal_px(&self) -> DVec2 {
        self.focal_px
    }

    /// Principal point in pixels of the calibrated picture, pixel centres at +0.5.
    #[must_use]
    pub const fn center_px(&self) -> DVec2 {
        self.center_px
    }

    /// The lens distortion.
    #[must_use]
    pub const fn distortion(&self) -> &Distortion {
        &self.distortion
    }

    /// Beyond which the distortion folds back.
    #[must_use]
    pub const fn limit(&self) -> &DistortionLimit {
        &self.limit
    }

    /// The same camera where it stands further on by `offset_m` (metres, world).
    ///
    /// What has moved by so much since the camera saw it is seen by it as it was.
    ///
    /// # Errors
    /// As [`Self::new`], of the position.
    pub fn moved(mut self, offset_m: DVec3) -> Result<Self, CameraError> {
        let position_in_world = self.pose.position_in_world + offset_m;
        check_position(position_in_world)?;
        self.pose.position_in_world = position_in_world;
        Ok(self)
    }

    /// Where the camera stands and looks.
    #[must_use]
    pub const fn pose(&self) -> &Pose {
        &self.pose
    }

    /// The texture coordinate of a world point, or `None` where there is none: at or behind the near plane
    /// ([`NEAR_M`]; for fisheyes, beyond the lens's angle), or where the distortion has folded back.
    #[must_use]
    pub fn project(&self, point_in_world: DVec3) -> Option<Projection> {
        self.project_local(self.pose.local_from_world_point(point_in_world))
    }

    /// As [`Self::project`], for a point in the camera's own axes.
    #[must_use]
    pub fn project_local(&self, point: DVec3) -> Option<Projection> {
        let distorted = self.distortion.distort_direction(point, &self.limit)?;
        let size = DVec2::new(f64::from(self.width_px), f64::from(self.height_px));
        let texture = (self.focal_px * distorted + self.center_px) / size;
        texture.is_finite().then_some(Projection { texture, depth_m: point.z })
    }

    /// The ray through a texture coordinate, or `None` when the lens brings no light there (beyond the fold-back
    /// radius) or the undistortion does not converge.
    #[must_use]
    pub fn ray(&self, texture: DVec2) -> Option<Ray> {
        let size = DVec2::new(f64::from(self.width_px), f64::from(self.height_px));
        let distorted = (texture * size - self.center_px) / self.focal_px;
        let local = self.distortion.undistort_to_direction(distorted, &self.limit)?;
        let direction = (self.pose.world_from_local * local).try_normalize()?;
        Some(Ray { origin: self.pose.position_in_world, direction })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        let pose =
            Pose::looking_at(DVec3::new(3.0, -4.0, 5.0), DVec3::new(0.0, 6.0, 0.5)).expect("a direction");
        Camera::new((640, 360), DVec2::splat(500.0), DVec2::new(320.0, 180.0), Distortion::None, pose)
            .expect("a camera")
    }

    #[test]
    fn the_target_lies_in_the_middle_and_up_is_up() {
        let camera = camera();
        let middle = camera.project(DVec3::new(0.0, 6.0, 0.5)).expect("in front");
        assert!((middle.texture - 0.5).length() < 1e-12);
        let above = camera.project(DVec3::new(0.0, 6.0, 1.5)).expect("in front");
        assert!(above.texture.y < 0.5 && (above.texture.x - 0.5).abs() < 1e-12);
    }

    #[test]
    fn what_lies_behind_has_no_texture_coordinate() {
        let camera = camera();
        let behind = camera.pose().position_in_world - camera.pose().forward_in_world() * 3.0;
        assert_eq!(camera.project(behind), None);
        assert_eq!(camera.project(camera.pose().position_in_world), None);
        assert_eq!(camera.project(DVec3::NAN), None);
    }

    #[test]
    fn a_projected_point_lies_on_its_own_ray() {
        let camera = camera();
        for point in [DVec3::new(0.3, 2.0, 0.0), DVec3::new(-20.0, 90.0, 3.0), DVec3::new(2.0, 0.0, 4.0)] {
            let texture = camera.project(point).expect("in front").texture;
            let ray = camera.ray(texture).expect("a ray");
            let distance = (point - ray.origin).length();
            assert!((ray.at(distance) - point).length() < 1e-9 * distance, "{point}");
        }
    }

    #[test]
    fn numbers_that_are_no_camera_are_refused_by_name() {
        let pose = *camera().pose();
        let check = |size, focal: f64, center: f64, pose: Pose, expected: &str| {
            let error = Camera::new(size, DVec2::splat(focal), DVec2::splat(center), Distortion::None, pose)
                .expect_err(expected);
            assert!(error.to_string().contains(expected), "{error}");
        };
        check((0, 5), 1.0, 1.0, pose, "image size");
        check((5, 5), f64::NAN, 1.0, pose, "focal length is not finite");
        check((5, 5), 0.0, 1.0, pose, "focal length");
        check((5, 5), 1.0, f64::INFINITY, pose, "principal point");
        check((5, 5), 1.0, 1.0, Pose { position_in_world: DVec3::NAN, ..pose }, "position");
        check((5, 5), 1.0, 1.0, Pose { world_from_local: pose.world_from_local * 2.0, ..pose }, "rotation");
    }
}
