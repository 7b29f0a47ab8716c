//! The virtual camera that a picture is asked for.

use crate::error::Fault;
use crate::geometry::Pose;
use glam::DVec3;

/// Furthest that eye and target may lie from the scene's origin, metres.
const FARTHEST_M: f64 = 1e8;

/// A virtual camera: a pinhole with square pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where it stands and looks.
    pub pose: Pose,
    /// Vertical field of view, radians, 0.01 to 3.0.
    pub fov_y_rad: f64,
    /// Columns of the picture.
    pub width_px: u32,
    /// Rows of the picture.
    pub height_px: u32,
}

/// The largest picture that may be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewLimits {
    /// Most columns, and most rows.
    pub max_side_px: u32,
    /// Most pixels.
    pub max_pixels: u64,
}

impl View {
    /// A view from `eye` towards `target` (metres) with the world's up at the top; straight up or down, north is.
    ///
    /// # Errors
    /// The first fault, its place the parameter's name: `eye`, `target`, `fov`, `width` or `height`.
    pub fn new(
        eye: DVec3,
        target: DVec3,
        fov_y_rad: f64,
        width_px: u32,
        height_px: u32,
        limits: &ViewLimits,
    ) -> Result<Self, Fault> {
        for (place, point) in [("eye", eye), ("target", target)] {
            // Written so that NaN fails.
            if !(point.is_finite() && point.abs().max_element() <= FARTHEST_M) {
                return Err(Fault::new(place, "must be three finite numbers of at most 1e8 (metres)"));
            }
        }
        let pose = Pose::looking_at(eye, target)
            .ok_or_else(|| Fault::new("target", "must differ from eye: the view has no direction"))?;
        let view = Self { pose, fov_y_rad, width_px, height_px };
        view.check(limits)?;
        Ok(view)
    }

    /// Holds a view to its ranges and to `limits`.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn check(&self, limits: &ViewLimits) -> Result<(), Fault> {
        let Self { pose, fov_y_rad, width_px, height_px } = *self;
        let eye = pose.position_in_world;
        if !(eye.is_finite() && eye.abs().max_element() <= FARTHEST_M) {
            return Err(Fault::new("eye", "must be three finite numbers of at most 1e8 (metres)"));
        }
        if !(pose.world_from_local.is_finite() && pose.world_from_local.is_normalized()) {
            return Err(Fault::new("target", "the view's rotation must be a unit quaternion"));
        }
        if !(0.01..=3.0).contains(&fov_y_rad) {
            return Err(Fault::new("fov", "must be 0.01 to 3.0 radians (0.573 to 171.8 degrees)"));
        }
        for (place, side) in [("width", width_px), ("height", height_px)] {
            if !(1..=limits.max_side_px).contains(&side) {
                let message = format!("must be 1 to {} pixels, got {side}", limits.max_side_px);
                return Err(Fault::new(place, message));
            }
        }
        let pixels = u64::from(width_px) * u64::from(height_px);
        if pixels > limits.max_pixels {
            let message =
                format!("width x height must be at most {} pixels, got {pixels}", limits.max_pixels);
            return Err(Fault::new("width", message));
        }
        Ok(())
    }

    /// Tangents of half the horizontal and half the vertical field of view.
    #[must_use]
    pub fn half_tangents(&self) -> [f64; 2] {
        let vertical = (self.fov_y_rad * 0.5).tan();
        [vertical * f64::from(self.width_px) / f64::from(self.height_px), vertical]
    }

    /// Where a world point lies in the picture, [0, 1]^2 inside, rows from the top; `None` behind the eye.
    #[must_use]
    pub fn project(&self, point_in_world: DVec3) -> Option<[f64; 2]> {
        let local = self.pose.local_from_world_point(point_in_world);
        let [tan_x, tan_y] = self.half_tangents();
        (local.z > 1e-6)
            .then(|| [0.5 + 0.5 * local.x / (local.z * tan_x), 0.5 + 0.5 * local.y / (local.z * tan_y)])
    }

    /// Unit vector in the world through the place (x, y) of the picture, [0, 1]^2, rows from the top.
    #[must_use]
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        let [tan_x, tan_y] = self.half_tangents();
        let local = DVec3::new((2.0 * x - 1.0) * tan_x, (2.0 * y - 1.0) * tan_y, 1.0);
        self.pose.world_from_local * local.normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: ViewLimits = ViewLimits { max_side_px: 4096, max_pixels: 1_000_000 };

    #[test]
    fn what_is_no_view_is_refused_by_parameter() {
        let check = |eye: DVec3, target: DVec3, fov: f64, width, height, place: &str| {
            let fault = View::new(eye, target, fov, width, height, &LIMITS).expect_err(place);
            assert_eq!(fault.place, place, "{fault}");
        };
        let (eye, target) = (DVec3::ZERO, DVec3::X);
        check(DVec3::NAN, target, 1.0, 64, 64, "eye");
        check(DVec3::new(1e9, 0.0, 0.0), target, 1.0, 64, 64, "eye");
        check(eye, DVec3::INFINITY, 1.0, 64, 64, "target");
        check(eye, eye, 1.0, 64, 64, "target");
        check(eye, target, f64::NAN, 64, 64, "fov");
        check(eye, target, 0.0, 64, 64, "fov");
        check(eye, target, 3.1, 64, 64, "fov");
        check(eye, target, 1.0, 0, 64, "width");
        check(eye, target, 1.0, 64, 0, "height");
        check(eye, target, 1.0, 4097, 1, "width");
        check(eye, target, 1.0, 1001, 1000, "width");
        assert!(View::new(eye, target, 1.0, 1000, 1000, &LIMITS).is_ok());
    }

    #[test]
    fn a_direction_projects_to_where_it_came_from() {
        let view =
            View::new(DVec3::new(5e5, 5e6, 9.0), DVec3::new(5e5, 5e6 + 8.0, 0.0), 1.1, 320, 200, &LIMITS)
                .expect("a view");
        for (x, y) in [(0.5, 0.5), (0.0, 1.0), (0.93, 0.11)] {
            let [px, py] =
                view.project(view.pose.position_in_world + view.direction(x, y) * 7.0).expect("in front");
            assert!((px - x).abs() < 1e-8 && (py - y).abs() < 1e-8);
        }
        assert_eq!(view.project(view.pose.position_in_world), None);
    }
}
