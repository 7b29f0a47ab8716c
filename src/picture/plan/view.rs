//! The virtual camera that a part of a picture is drawn by.

use glam::{DVec2, DVec3};
use std::ops::Range;
use videofields_vision::error::Fault;
use videofields_vision::geometry::{Pose, Ray};

/// Furthest that eye and target may lie from the scene's origin, metres.
const FARTHEST_M: f64 = 1e8;

/// Nearer than this before the eye, a point has no place in a perspective picture, metres.
const NEAREST_M: f64 = 1e-6;

/// Largest extent of a frustum: a tangent off the axis, or metres off it.
const WIDEST: f64 = 1e8;

/// How the rays of a view's pixels lie to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// Through one point, the eye.
    Perspective,
    /// All along the view's axis.
    Orthographic,
}

/// What a view spans, in its own axes (x right, y down, z forward).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frustum {
    /// How the rays lie to each other.
    pub projection: Projection,
    /// Left and right edge of the picture: tangents of the angles off the axis, or for an orthographic view metres off it.
    /// The left one is the smaller; the axis need not lie between them.
    pub x: [f64; 2],
    /// Top and bottom edge, as `x`.
    pub y: [f64; 2],
}

impl Frustum {
    /// A perspective around the axis with square pixels.
    #[must_use]
    pub fn around_axis(fov_y_rad: f64, width_px: u32, height_px: u32) -> Self {
        let vertical = (fov_y_rad * 0.5).tan();
        let horizontal = vertical * f64::from(width_px) / f64::from(height_px);
        Self { projection: Projection::Perspective, x: [-horizontal, horizontal], y: [-vertical, vertical] }
    }

    /// The part of it between two shares (0 to 1) of its width and of its height.
    fn cropped(&self, x: [f64; 2], y: [f64; 2]) -> Self {
        let along = |[first, last]: [f64; 2], share: f64| (last - first).mul_add(share, first);
        Self { projection: self.projection, x: x.map(|s| along(self.x, s)), y: y.map(|s| along(self.y, s)) }
    }
}

/// A virtual camera without a lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where it stands and looks. An orthographic view shows nothing that lies behind it.
    pub pose: Pose,
    /// What it spans.
    pub frustum: Frustum,
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

impl ViewLimits {
    /// Holds a picture's size to them.
    ///
    /// # Errors
    /// With `width` or `height` as the fault's place.
    pub fn check(&self, width_px: u32, height_px: u32) -> Result<(), Fault> {
        for (place, side) in [("width", width_px), ("height", height_px)] {
            if !(1..=self.max_side_px).contains(&side) {
                let message = format!("must be 1 to {} pixels, got {side}", self.max_side_px);
                return Err(Fault::new(place, message));
            }
        }
        let pixels = u64::from(width_px) * u64::from(height_px);
        if pixels > self.max_pixels {
            let message = format!("width x height must be at most {} pixels, got {pixels}", self.max_pixels);
            return Err(Fault::new("width", message));
        }
        Ok(())
    }

    /// Holds what is drawn to them, where pixels are drawn `supersampling` times each way.
    ///
    /// # Errors
    /// With `supersampling` as the fault's place.
    pub fn check_drawn(&self, width_px: u32, height_px: u32, supersampling: u32) -> Result<(), Fault> {
        let pixels = u64::from(width_px) * u64::from(height_px);
        let drawn = pixels.saturating_mul(u64::from(supersampling).pow(2));
        if drawn > self.max_pixels {
            let message = format!(
                "width x height x supersampling^2 must be at most {} pixels, got {drawn}",
                self.max_pixels
            );
            return Err(Fault::new("supersampling", message));
        }
        Ok(())
    }
}

/// Holds a point to what a view can be given.
///
/// # Errors
/// With `place` as the fault's.
pub(super) fn check_point(place: &'static str, point: DVec3) -> Result<(), Fault> {
    // Written so that NaN fails.
    if point.is_finite() && point.abs().max_element() <= FARTHEST_M {
        return Ok(());
    }
    Err(Fault::new(place, "must be three finite numbers of at most 1e8 (metres)"))
}

/// Holds a vertical field of view to its range, radians.
///
/// # Errors
/// With `fov` as the fault's place.
pub(super) fn check_fov(fov_y_rad: f64) -> Result<(), Fault> {
    if (0.01..=3.0).contains(&fov_y_rad) {
        return Ok(());
    }
    Err(Fault::new("fov", "must be 0.01 to 3.0 radians (0.573 to 171.8 degrees)"))
}

/// Where `eye` looks from towards `target`: straight up or down, with north at the top.
///
/// # Errors
/// With `eye` or `target` as the fault's place.
pub(super) fn check_pose(eye: DVec3, target: DVec3) -> Result<Pose, Fault> {
    check_point("eye", eye)?;
    check_point("target", target)?;
    Pose::looking_at(eye, target)
        .ok_or_else(|| Fault::new("target", "must differ from eye: the view has no direction"))
}

impl View {
    /// A perspective view from `eye` towards `target` (metres) with the world's up at the top; straight up or down, north is.
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
        let pose = check_pose(eye, target)?;
        check_fov(fov_y_rad)?;
        limits.check(width_px, height_px)?;
        let frustum = Frustum::around_axis(fov_y_rad, width_px, height_px);
        Ok(Self { pose, frustum, width_px, height_px })
    }

    /// Holds a view to its ranges, its size to `limits`.
    ///
    /// # Errors
    /// As [`Self::new`]; `frustum` where it spans nothing.
    pub fn check(&self, limits: &ViewLimits) -> Result<(), Fault> {
        let Self { pose, frustum, width_px, height_px } = *self;
        check_point("eye", pose.position_in_world)?;
        if !(pose.world_from_local.is_finite() && pose.world_from_local.is_normalized()) {
            return Err(Fault::new("target", "the view's rotation must be a unit quaternion"));
        }
        let is_span = |[first, last]: [f64; 2]| first.abs() <= WIDEST && last.abs() <= WIDEST && first < last;
        if !(is_span(frustum.x) && is_span(frustum.y)) {
            let message = "must span something: left before right, top before bottom, each within 1e8";
            return Err(Fault::new("frustum", message));
        }
        limits.check(width_px, height_px)
    }

    /// Where a world point lies in the picture, [0, 1]^2 inside, rows from the top; `None` behind the eye.
    #[must_use]
    pub fn project(&self, point_in_world: DVec3) -> Option<[f64; 2]> {
        let local = self.pose.local_from_world_point(point_in_world);
        let on_plane = match self.frustum.projection {
            Projection::Perspective => (local.z > NEAREST_M).then(|| local.truncate() / local.z),
            Projection::Orthographic => (local.z >= 0.0).then(|| local.truncate()),
        }?;
        let share = |value: f64, [first, last]: [f64; 2]| (value - first) / (last - first);
        Some([share(on_plane.x, self.frustum.x), share(on_plane.y, self.frustum.y)])
    }

    /// The ray through the place (x, y) of the picture, [0, 1]^2, rows from the top.
    #[must_use]
    pub fn ray(&self, x: f64, y: f64) -> Ray {
        let Frustum { projection, x: [left, right], y: [top, bottom] } = self.frustum;
        let on_plane = DVec2::new((right - left).mul_add(x, left), (bottom - top).mul_add(y, top));
        match projection {
            Projection::Perspective => Ray {
                origin: self.pose.position_in_world,
                direction: self.pose.world_from_local * on_plane.extend(1.0).normalize(),
            },
            Projection::Orthographic => Ray {
                origin: self.pose.world_from_local_point(on_plane.extend(0.0)),
                direction: self.pose.forward_in_world(),
            },
        }
    }

    /// Whether any of a sphere may be in the picture: never no to one that is.
    #[must_use]
    pub fn may_show(&self, center_in_world: DVec3, radius_m: f64) -> bool {
        let local = self.pose.local_from_world_point(center_in_world);
        if local.z < -radius_m {
            return false;
        }
        let is_within = |value: f64, [first, last]: [f64; 2]| match self.frustum.projection {
            // Distance from the plane through the eye and an edge, inside positive.
            Projection::Perspective => {
                (value - first * local.z) / first.hypot(1.0) >= -radius_m
                    && (last * local.z - value) / last.hypot(1.0) >= -radius_m
            }
            Projection::Orthographic => value >= first - radius_m && value <= last + radius_m,
        };
        is_within(local.x, self.frustum.x) && is_within(local.y, self.frustum.y)
    }

    /// Pixels that a metre across the line of sight covers at a point, along rows and along columns; at and behind the eye those
    /// of a metre before it.
    #[must_use]
    pub fn pixels_per_metre(&self, point_in_world: DVec3) -> [f64; 2] {
        let depth_m = match self.frustum.projection {
            Projection::Perspective => self.pose.local_from_world_point(point_in_world).z.max(1.0),
            Projection::Orthographic => 1.0,
        };
        let along = |side_px: u32, [first, last]: [f64; 2]| f64::from(side_px) / (last - first) / depth_m;
        [along(self.width_px, self.frustum.x), along(self.height_px, self.frustum.y)]
    }

    /// The part of the view that fills some columns and rows of its picture; they must lie within it.
    #[must_use]
    pub fn cropped(&self, columns: Range<u32>, rows: Range<u32>) -> Self {
        let shares = |part: &Range<u32>, side: u32| {
            [part.start, part.end].map(|pixel| f64::from(pixel) / f64::from(side))
        };
        Self {
            pose: self.pose,
            frustum: self.frustum.cropped(shares(&columns, self.width_px), shares(&rows, self.height_px)),
            width_px: columns.len() as u32,
            height_px: rows.len() as u32,
        }
    }

    /// The same view with `times` as many columns and rows.
    #[must_use]
    pub const fn enlarged(&self, times: u32) -> Self {
        Self { width_px: self.width_px * times, height_px: self.height_px * times, ..*self }
    }

    /// The same view with one column and row for `step_px` of them (the last may reach beyond), and `margin_px` of such
    /// columns and rows more on every side.
    #[must_use]
    pub fn coarse(&self, step_px: u32, margin_px: u32) -> Self {
        let step_px = step_px.max(1);
        let along = |side: u32| {
            let share = |coarse: f64| coarse * f64::from(step_px) / f64::from(side);
            let n = side.div_ceil(step_px);
            (n + 2 * margin_px, [share(-f64::from(margin_px)), share(f64::from(n + margin_px))])
        };
        let ((width_px, x), (height_px, y)) = (along(self.width_px), along(self.height_px));
        Self { pose: self.pose, frustum: self.frustum.cropped(x, y), width_px, height_px }
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
        let good = View::new(eye, target, 1.0, 1000, 1000, &LIMITS).expect("a view");
        assert_eq!(good.check(&LIMITS), Ok(()));
        let spans = [[0.2, 0.2], [0.3, -0.3], [f64::NAN, 1.0], [-1.0, f64::INFINITY]];
        for x in spans {
            let view = View { frustum: Frustum { x, ..good.frustum }, ..good };
            assert_eq!(view.check(&LIMITS).expect_err("no span").place, "frustum", "{x:?}");
        }
    }

    /// A perspective and an orthographic view off their axes, at map coordinates.
    fn off_axis() -> [View; 2] {
        let eye = DVec3::new(5e5, 5e6, 9.0);
        let view = View::new(eye, eye + DVec3::new(1.0, 8.0, -3.0), 1.1, 320, 200, &LIMITS).expect("a view");
        let frustum = |projection, scale: f64| Frustum {
            projection,
            x: [0.1 * scale, 0.9 * scale],
            y: [-0.7 * scale, -0.2 * scale],
        };
        [(Projection::Perspective, 1.0), (Projection::Orthographic, 10.0)]
            .map(|(projection, scale)| View { frustum: frustum(projection, scale), ..view })
    }

    #[test]
    fn a_ray_projects_to_where_it_came_from() {
        let eye = DVec3::new(5e5, 5e6, 9.0);
        let straight = View::new(eye, eye + DVec3::Y, 1.1, 320, 200, &LIMITS).expect("a view");
        for view in off_axis().into_iter().chain([straight]) {
            for (x, y) in [(0.5, 0.5), (0.0, 1.0), (0.93, 0.11)] {
                let [px, py] = view.project(view.ray(x, y).at(7.0)).expect("in front");
                assert!((px - x).abs() < 1e-8 && (py - y).abs() < 1e-8, "{view:?}");
            }
        }
        assert_eq!(straight.project(eye), None);
        assert_eq!(straight.project(eye - DVec3::Y), None);
    }

    #[test]
    fn a_crop_shows_what_the_whole_shows_there() {
        for view in off_axis() {
            let part = view.cropped(64..96, 150..200);
            assert_eq!((part.width_px, part.height_px), (32, 50));
            for (x, y) in [(0.0, 0.0), (0.5, 0.25), (1.0, 1.0)] {
                let (whole, part) =
                    (view.ray((64.0 + x * 32.0) / 320.0, (150.0 + y * 50.0) / 200.0), part.ray(x, y));
                assert!((whole.direction - part.direction).length() < 1e-12);
                assert!((whole.origin - part.origin).length() < 1e-8);
            }
        }
    }

    #[test]
    fn what_may_be_shown_is_never_left_out() {
        for view in off_axis() {
            for idx in 0..400 {
                let along = |step: u32| f64::from(idx / step % 5) * 0.25;
                let ray = view.ray(along(1), along(5));
                // On the edge, or as far beside it as the sphere reaches.
                assert!(view.may_show(ray.at(along(25) * 40.0), 1e-6), "{view:?} {idx}");
            }
            let beside = view.ray(1.5, 0.5).at(20.0);
            let edge = view.ray(1.0, 0.5).at(20.0);
            assert!(!view.may_show(beside, 0.1));
            assert!(view.may_show(beside, (beside - edge).length()));
            assert!(!view.may_show(view.ray(0.5, 0.5).at(-5.0), 1.0));
            assert!(view.may_show(view.pose.position_in_world, 10.0));
        }
    }
}
