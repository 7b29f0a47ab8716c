//! What a request's picture is put together from: parts that are drawn one after the other, each by one [`View`].
//!
//! The renderer knows parts alone; what is decided about a picture (cameras, sources, order) is decided once for all of
//! them, so that no seam shows where they meet.

use super::view::{check_fov, check_point, check_pose};
use super::{Frustum, Projection, View, ViewLimits};
use glam::{DMat3, DQuat, DVec2, DVec3};
use std::f64::consts::{PI, TAU};
use videofields_vision::error::Fault;
use videofields_vision::geometry::{Pose, Ray};

/// How far a panorama's strip may differ from the cylinder that it stands for, pixels.
const STRIP_ERROR_PX: f64 = 0.25;

/// Most strips of a panorama: each costs about what a small picture does.
const MAX_STRIPS: u32 = 512;

/// Most that a panorama's column may span (and what is a rounding more): a flat strip shows less than half a turn.
const WIDEST_COLUMN_RAD: f64 = PI / 3.0 * (1.0 + 1e-9);

/// Least angle that a panorama spans, radians.
const LEAST_SPAN_RAD: f64 = 0.01;

/// Ranges of an orthographic picture's width, and of a window's sides, metres.
pub const ACROSS_M: [f64; 2] = [1e-3, 1e7];

/// Furthest that two eyes' frusta may meet, metres.
const FARTHEST_CONVERGENCE_M: f64 = 1e8;

/// Furthest from level that the middle of a panorama may lie, radians: a cylinder has no top.
const STEEPEST_RAD: f64 = 1.4;

/// One part of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// What it shows; its size is the part's.
    pub view: View,
    /// First column of the picture that it fills.
    pub left_px: u32,
    /// First row of the picture that it fills.
    pub top_px: u32,
}

/// Where a picture is seen from, as far as decisions about all of it go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Viewer {
    /// From a place: for a stereo pair the middle between the eyes.
    At(DVec3),
    /// From infinitely far away.
    Along {
        /// Unit vector in which the viewer looks.
        direction: DVec3,
        /// Unit vector that the picture shows upwards.
        up: DVec3,
    },
}

impl Viewer {
    /// Unit vector from the viewer towards a point; zero at the viewer's own place.
    #[must_use]
    pub fn direction_to(&self, point_in_world: DVec3) -> DVec3 {
        match self {
            Self::At(eye) => (point_in_world - *eye).normalize_or_zero(),
            Self::Along { direction, .. } => *direction,
        }
    }

    /// Unit vector towards the viewer from a point, and the level direction in which what stands there points away from
    /// the viewer, unit too: straight below a viewer it is what the picture shows upwards, or north.
    #[must_use]
    pub fn seen_from(&self, point_in_world: DVec3) -> (DVec3, DVec2) {
        let direction = self.direction_to(point_in_world);
        let level = direction.truncate();
        // What is left of it straight below is rounding.
        let away = if level.length() > 1e-6 { level } else { self.up().truncate() };
        (-direction, away.try_normalize().unwrap_or(DVec2::Y))
    }

    const fn up(&self) -> DVec3 {
        match self {
            Self::At(_) => DVec3::Y,
            Self::Along { up, .. } => *up,
        }
    }
}

/// A picture and its parts, which fill it without overlap.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Where it is seen from.
    pub viewer: Viewer,
    /// True for a window into a larger picture, as a wall's tile is: what all windows must agree on is decided by everybody who is there,
    /// not by those whom one of them shows.
    pub is_window: bool,
    /// The parts, at least one.
    pub parts: Vec<Part>,
}

impl From<View> for Picture {
    fn from(view: View) -> Self {
        let viewer = match view.frustum.projection {
            Projection::Perspective => Viewer::At(view.pose.position_in_world),
            Projection::Orthographic => Viewer::Along {
                direction: view.pose.forward_in_world(),
                up: view.pose.world_from_local * DVec3::NEG_Y,
            },
        };
        let parts = vec![Part { view, left_px: 0, top_px: 0 }];
        Self { width_px: view.width_px, height_px: view.height_px, viewer, is_window: false, parts }
    }
}

impl Picture {
    /// An orthographic picture from `eye` along the way to `target`, `across_m` metres wide: nothing behind `eye` is shown.
    ///
    /// # Errors
    /// The first fault, its place the parameter's name: `eye`, `target`, `across`, `width` or `height`.
    pub fn orthographic(
        (eye, target): (DVec3, DVec3),
        across_m: f64,
        (width_px, height_px): (u32, u32),
        limits: &ViewLimits,
    ) -> Result<Self, Fault> {
        Self::parallel(check_pose(eye, target)?, across_m, (width_px, height_px), limits)
    }

    /// A map: straight down on `center` from `height_m` (world, metres), `across_m` metres wide, with the direction
    /// `heading_rad` (from north towards east) at the top.
    ///
    /// # Errors
    /// The first fault, its place the parameter's name: `target`, `heading`, `across`, `width` or `height`.
    pub fn map(
        center: DVec3,
        height_m: f64,
        heading_rad: f64,
        across_m: f64,
        (width_px, height_px): (u32, u32),
        limits: &ViewLimits,
    ) -> Result<Self, Fault> {
        check_point("target", center.truncate().extend(height_m))?;
        if !heading_rad.is_finite() {
            return Err(Fault::new("heading", "must be a finite number"));
        }
        let (sin, cos) = heading_rad.sin_cos();
        let (right, up) = (DVec3::new(cos, -sin, 0.0), DVec3::new(sin, cos, 0.0));
        let world_from_local = DQuat::from_mat3(&DMat3::from_cols(right, -up, -DVec3::Z)).normalize();
        let position_in_world = center.truncate().extend(height_m);
        Self::parallel(Pose { position_in_world, world_from_local }, across_m, (width_px, height_px), limits)
    }

    fn parallel(
        pose: Pose,
        across_m: f64,
        (width_px, height_px): (u32, u32),
        limits: &ViewLimits,
    ) -> Result<Self, Fault> {
        limits.check(width_px, height_px)?;
        check_extent("across", across_m)?;
        let [half_x, half_y] = [0.5 * across_m, 0.5 * across_m * f64::from(height_px) / f64::from(width_px)];
        let frustum =
            Frustum { projection: Projection::Orthographic, x: [-half_x, half_x], y: [-half_y, half_y] };
        let view = View { pose, frustum, width_px, height_px };
        if half_y > 0.5 * ACROSS_M[1] {
            let message = format!("leaves the picture more than {:e} metres high", ACROSS_M[1]);
            return Err(Fault::new("across", message));
        }
        Ok(view.into())
    }

    /// What a viewer at `eye` sees through a window: a rectangle in the world with its lower left, lower right and upper
    /// left corner as the viewer sees them (Kooima 2009, Generalized Perspective Projection).
    ///
    /// # Errors
    /// The first fault, its place the parameter's name: `eye`, `width`, `height`, or `window` where it is no rectangle or
    /// the eye lies in its plane or behind it.
    pub fn through_window(
        eye: DVec3,
        corners: [DVec3; 3],
        (width_px, height_px): (u32, u32),
        limits: &ViewLimits,
    ) -> Result<Self, Fault> {
        check_point("eye", eye)?;
        limits.check(width_px, height_px)?;
        for corner in corners {
            check_point("window", corner)?;
        }
        let [lower_left, lower_right, upper_left] = corners;
        let (across, upwards) = (lower_right - lower_left, upper_left - lower_left);
        let (width_m, height_m) = (across.length(), upwards.length());
        check_extent("window", width_m)?;
        check_extent("window", height_m)?;
        let (right, up) = (across / width_m, upwards / height_m);
        if right.dot(up).abs() > 1e-3 {
            let message = "must be a rectangle: the sides from its lower left corner must be perpendicular within 0.06 degrees";
            return Err(Fault::new("window", message));
        }
        // Exactly perpendicular, so that the pose is a rotation.
        let up = (up - right * right.dot(up)).normalize();
        let towards_eye = right.cross(up);
        let from_eye = lower_left - eye;
        let distance = -from_eye.dot(towards_eye);
        if distance.is_nan() || distance < 1e-6 * width_m.max(height_m) {
            let message = "must face the eye: its corners are given as the viewer sees them, lower left, lower right, upper left";
            return Err(Fault::new("window", message));
        }
        let world_from_local = DQuat::from_mat3(&DMat3::from_cols(right, -up, -towards_eye)).normalize();
        let left = from_eye.dot(right) / distance;
        let bottom = -from_eye.dot(up) / distance;
        let frustum = Frustum {
            projection: Projection::Perspective,
            x: [left, left + width_m / distance],
            y: [bottom - height_m / distance, bottom],
        };
        let view =
            View { pose: Pose { position_in_world: eye, world_from_local }, frustum, width_px, height_px };
        view.check(limits).map_err(|fault| Fault::new("window", fault.message))?;
        Ok(Self { is_window: true, ..view.into() })
    }

    /// A pair for two eyes, side by side in one picture with the left eye's in its left half. The frusta are sheared, not
    /// turned, and meet at `convergence_m` before the middle between the eyes: what lies there appears on the screen.
    ///
    /// # Errors
    /// The first fault, its place the parameter's name: `eye_distance`, `convergence`, `width` where it is odd, or as
    /// [`View::new`].
    pub fn stereo(
        (eye, target): (DVec3, DVec3),
        fov_y_rad: f64,
        (width_px, height_px): (u32, u32),
        (eye_distance_m, convergence_m): (f64, f64),
        limits: &ViewLimits,
    ) -> Result<Self, Fault> {
        limits.check(width_px, height_px)?;
        if !width_px.is_multiple_of(2) {
            let message = format!("must be even for a stereo pair, got {width_px}");
            return Err(Fault::new("width", message));
        }
        let middle = View::new(eye, target, fov_y_rad, width_px / 2, height_px, limits)?;
        if !(0.0..=1e3).contains(&eye_distance_m) {
            return Err(Fault::new("eye_distance", "must be 0 to 1000 (metres)"));
        }
        // Nearer than this the eyes would squint by more than 90 degrees.
        if !(convergence_m >= (0.5 * eye_distance_m).max(1e-3) && convergence_m <= FARTHEST_CONVERGENCE_M) {
            let message = "must be 0.001 to 1e8 (metres), and at least half the eyes' distance";
            return Err(Fault::new("convergence", message));
        }
        let right = middle.pose.world_from_local * DVec3::X;
        let part = |side: f64, left_px: u32| {
            let aside_m = side * 0.5 * eye_distance_m;
            let shear = aside_m / convergence_m;
            let frustum = Frustum { x: middle.frustum.x.map(|edge| edge - shear), ..middle.frustum };
            let position_in_world = middle.pose.position_in_world + right * aside_m;
            let pose = Pose { position_in_world, ..middle.pose };
            Part { view: View { pose, frustum, ..middle }, left_px, top_px: 0 }
        };
        let parts = vec![part(-1.0, 0), part(1.0, width_px / 2)];
        for part in &parts {
            check_point("eye", part.view.pose.position_in_world)?;
        }
        Ok(Self { width_px, height_px, viewer: Viewer::At(eye), is_window: false, parts })
    }

    /// A picture on a cylinder around the vertical through `eye`: columns are equal steps of direction, `span_rad` in all,
    /// the middle one towards `target`; rows are equal steps on the cylinder, so that what is upright stays straight, and
    /// the middle one shows the target's elevation. `fov_y_rad` is what the rows would span if the target were level.
    ///
    /// It is drawn as flat strips so narrow that nothing is further than a quarter of a pixel from its place.
    ///
    /// # Errors
    /// The first fault, its place the parameter's name: `span`, `target` where it is nearly above or below, or as
    /// [`View::new`].
    pub fn panorama(
        (eye, target): (DVec3, DVec3),
        span_rad: f64,
        fov_y_rad: f64,
        (width_px, height_px): (u32, u32),
        limits: &ViewLimits,
    ) -> Result<Self, Fault> {
        let forward = check_pose(eye, target)?.forward_in_world();
        check_fov(fov_y_rad)?;
        limits.check(width_px, height_px)?;
        // A little more than the whole is the whole, written in degrees and back.
        if !(LEAST_SPAN_RAD..=TAU * (1.0 + 1e-9)).contains(&span_rad) {
            return Err(Fault::new("span", "must be 0.01 to 2 pi radians (0.573 to 360 degrees)"));
        }
        let level_m = forward.truncate().length();
        if forward.z.atan2(level_m).abs() > STEEPEST_RAD {
            let message = "must lie within 80 degrees of the horizon as seen from eye, for a panorama";
            return Err(Fault::new("target", message));
        }
        let elevation = forward.z / level_m;
        let half = (fov_y_rad * 0.5).tan();
        let y = [-elevation - half, -elevation + half];
        let azimuth = forward.y.atan2(forward.x);
        let pixel_rad = span_rad / f64::from(width_px);
        if pixel_rad > WIDEST_COLUMN_RAD {
            return Err(Fault::new(
                "width",
                "must be at least one column for every 60 degrees of a panorama",
            ));
        }
        let n_strips = strips(width_px, height_px, pixel_rad, y);
        if n_strips > MAX_STRIPS {
            let message = format!(
                "needs {n_strips} strips of at most {MAX_STRIPS} to be right to a quarter of a pixel: fewer rows, a wider \
                 field of view or a target nearer to the horizon need fewer"
            );
            return Err(Fault::new("height", message));
        }
        let parts = (0..n_strips).map(|idx| {
            let edge = |idx: u32| (u64::from(idx) * u64::from(width_px) / u64::from(n_strips)) as u32;
            let (left_px, right_px) = (edge(idx), edge(idx + 1));
            let strip_px = right_px - left_px;
            // Of the strip's middle column, counted from the picture's.
            let column = 0.5 * (f64::from(left_px) + f64::from(right_px) - f64::from(width_px));
            let (sin, cos) = column.mul_add(-pixel_rad, azimuth).sin_cos();
            let ahead = DVec3::new(cos, sin, 0.0);
            let right = DVec3::new(sin, -cos, 0.0);
            let world_from_local = DQuat::from_mat3(&DMat3::from_cols(right, -DVec3::Z, ahead)).normalize();
            let across = (0.5 * f64::from(strip_px) * pixel_rad).tan();
            let frustum = Frustum { projection: Projection::Perspective, x: [-across, across], y };
            let pose = Pose { position_in_world: eye, world_from_local };
            Part { view: View { pose, frustum, width_px: strip_px, height_px }, left_px, top_px: 0 }
        });
        let parts = parts.collect();
        Ok(Self { width_px, height_px, viewer: Viewer::At(eye), is_window: false, parts })
    }

    /// Holds every part to its ranges and the whole to `limits`.
    ///
    /// # Errors
    /// As [`View::check`].
    pub fn check(&self, limits: &ViewLimits) -> Result<(), Fault> {
        limits.check(self.width_px, self.height_px)?;
        let fits =
            |start: u32, length: u32, side: u32| start.checked_add(length).is_some_and(|end| end <= side);
        for part in &self.parts {
            part.view.check(limits)?;
            if !(fits(part.left_px, part.view.width_px, self.width_px)
                && fits(part.top_px, part.view.height_px, self.height_px))
            {
                return Err(Fault::new("parts", "must lie within the picture"));
            }
        }
        Ok(())
    }

    /// The ray through the place (x, y) of the picture, [0, 1]^2, rows from the top; `None` where no part lies.
    #[must_use]
    pub fn ray(&self, x: f64, y: f64) -> Option<Ray> {
        let (column, row) = (x * f64::from(self.width_px), y * f64::from(self.height_px));
        self.parts.iter().find_map(|Part { view, left_px, top_px }| {
            let within = [
                (column - f64::from(*left_px)) / f64::from(view.width_px),
                (row - f64::from(*top_px)) / f64::from(view.height_px),
            ];
            within.iter().all(|share| (0.0..=1.0).contains(share)).then(|| view.ray(within[0], within[1]))
        })
    }

    /// Whether any of a sphere may be in the picture: never no to one that is.
    #[must_use]
    pub fn may_show(&self, center_in_world: DVec3, radius_m: f64) -> bool {
        self.parts.iter().any(|part| part.view.may_show(center_in_world, radius_m))
    }

    /// Whether a point lies in the picture, or beside it by no more than `margin` (share of the picture's size).
    #[must_use]
    pub fn shows(&self, point_in_world: DVec3, margin: f64) -> bool {
        self.parts.iter().any(|Part { view, .. }| {
            let sides = [(self.width_px, view.width_px), (self.height_px, view.height_px)];
            view.project(point_in_world).is_some_and(|place| {
                place.into_iter().zip(sides).all(|(along, (whole, part))| {
                    let margin = margin * f64::from(whole) / f64::from(part);
                    (-margin..=1.0 + margin).contains(&along)
                })
            })
        })
    }
}

fn check_extent(place: &'static str, extent_m: f64) -> Result<(), Fault> {
    let [least, most] = ACROSS_M;
    if (least..=most).contains(&extent_m) {
        return Ok(());
    }
    Err(Fault::new(place, format!("must be {least} to {most:e} metres wide and high")))
}

/// Into how many strips a panorama is cut: a flat strip of half angle a shows what lies h rows off the horizon
/// h (1 / cos a - 1) rows too far off at its edges, and its columns are off by less than a^3 / 3 over a pixel's angle.
fn strips(width_px: u32, height_px: u32, pixel_rad: f64, [top, bottom]: [f64; 2]) -> u32 {
    let rows_off = f64::from(height_px) * top.abs().max(bottom.abs()) / (bottom - top);
    let by_rows = (1.0 / (1.0 + STRIP_ERROR_PX / rows_off.max(STRIP_ERROR_PX))).acos();
    let by_columns = (3.0 * STRIP_ERROR_PX * pixel_rad).cbrt();
    let half_angle = by_rows.min(by_columns).min(PI / 6.0);
    // A strip is a pixel wide at least, and none is wider than this.
    let widest_px = (2.0 * half_angle / pixel_rad).floor().clamp(1.0, f64::from(width_px)) as u32;
    width_px.div_ceil(widest_px)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: ViewLimits = ViewLimits { max_side_px: 8192, max_pixels: 1 << 26 };
    const EYE: DVec3 = DVec3::new(5e5, 5e6, 12.0);

    fn place_of(fault: Fault) -> String {
        fault.place
    }

    #[test]
    fn a_map_has_its_heading_at_the_top() {
        let check = |heading_deg: f64, x: f64, y: f64, expected: DVec2| {
            let size = (400, 200);
            let map = Picture::map(EYE, 80.0, heading_deg.to_radians(), 100.0, size, &LIMITS).expect("a map");
            let ray = map.ray(x, y).expect("within");
            assert!((ray.direction + DVec3::Z).length() < 1e-12);
            let ground = ray.at(80.0) - EYE.truncate().extend(0.0);
            assert!((ground - expected.extend(0.0)).length() < 1e-6, "{heading_deg}: {ground}");
        };
        check(0.0, 0.5, 0.5, DVec2::ZERO);
        check(0.0, 1.0, 0.0, DVec2::new(50.0, 25.0));
        check(90.0, 0.5, 0.0, DVec2::new(25.0, 0.0));
        check(-90.0, 1.0, 0.5, DVec2::new(0.0, 50.0));
        let map = |heading, across| Picture::map(EYE, 80.0, heading, across, (4, 4), &LIMITS);
        assert_eq!(map(f64::NAN, 1.0).map_err(place_of), Err("heading".to_owned()));
        for across in [0.0, -1.0, 1e8, f64::NAN] {
            assert_eq!(map(0.0, across).map_err(place_of), Err("across".to_owned()));
        }
    }

    #[test]
    fn a_window_shows_its_corners_in_the_corners() {
        let corners = [(-3.0, -1.0), (2.0, -1.0), (-3.0, 3.0)].map(|(x, z)| EYE + DVec3::new(x, 4.0, z));
        let picture = Picture::through_window(EYE, corners, (500, 300), &LIMITS).expect("a window");
        let view = picture.parts[0].view;
        for (corner, expected) in corners.into_iter().zip([[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]]) {
            let place = view.project(corner).expect("before the eye");
            assert!(place.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-8), "{place:?}");
        }
        // Turned windows too, and the eye beside them.
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.2, 1.0);
        let turned = corners.map(|corner| EYE + turn * (corner - EYE + DVec3::new(6.0, 0.0, 0.0)));
        let view = Picture::through_window(EYE, turned, (500, 300), &LIMITS).expect("a window").parts[0].view;
        let upper_right = turned[1] + turned[2] - turned[0];
        let place = view.project(upper_right).expect("before the eye");
        assert!((place[0] - 1.0).abs() < 1e-8 && place[1].abs() < 1e-8);
        assert_eq!(view.check(&LIMITS), Ok(()));
    }

    #[test]
    fn what_is_no_window_is_refused() {
        let [a, b, c] = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)].map(|(x, z)| EYE + DVec3::new(x, 4.0, z));
        let check = |eye, corners: [DVec3; 3], place: &str| {
            let refused = Picture::through_window(eye, corners, (64, 64), &LIMITS).map_err(place_of);
            assert_eq!(refused, Err(place.to_owned()), "{corners:?}");
        };
        check(EYE, [b, a, c], "window");
        check(EYE, [a, a, c], "window");
        check(EYE, [a, b, b], "window");
        check(EYE, [a, b, c + DVec3::X * 0.1], "window");
        check(EYE, [a, b, DVec3::NAN], "window");
        check(a, [a, b, c], "window");
        check(EYE + DVec3::Y * 9.0, [a, b, c], "window");
        check(DVec3::NAN, [a, b, c], "eye");
    }

    #[test]
    fn both_eyes_see_the_convergence_plane_in_one_place() {
        let target = EYE + DVec3::new(3.0, 9.0, -1.0);
        let pair = Picture::stereo((EYE, target), 0.9, (1920, 1080), (0.064, 8.0), &LIMITS).expect("a pair");
        let [left, right] = [pair.parts[0], pair.parts[1]];
        assert_eq!((left.left_px, right.left_px, left.view.width_px), (0, 960, 960));
        let gap = right.view.pose.position_in_world - left.view.pose.position_in_world;
        assert!((gap.length() - 0.064).abs() < 1e-8);
        let middle = View::new(EYE, target, 0.9, 960, 1080, &LIMITS).expect("a view");
        for (x, y) in [(0.2, 0.1), (0.5, 0.5), (0.9, 0.8)] {
            let ray = middle.ray(x, y);
            let along = 8.0 / ray.direction.dot(middle.pose.forward_in_world());
            let seen = [left, right].map(|part| part.view.project(ray.at(along)).expect("in front"));
            assert!(seen.iter().all(|[a, b]| (a - x).abs() < 1e-8 && (b - y).abs() < 1e-8), "{seen:?}");
            // What is nearer lies further right for the left eye.
            let near = [left, right].map(|part| part.view.project(ray.at(along * 0.5)).expect("in front"));
            assert!(near[0][0] > near[1][0] + 1e-3);
        }
        let check = |width, eyes: (f64, f64), place: &str| {
            let refused = Picture::stereo((EYE, target), 0.9, (width, 64), eyes, &LIMITS).map_err(place_of);
            assert_eq!(refused, Err(place.to_owned()));
        };
        check(63, (0.064, 8.0), "width");
        check(64, (-0.1, 8.0), "eye_distance");
        check(64, (f64::NAN, 8.0), "eye_distance");
        check(64, (1.0, 0.4), "convergence");
        check(64, (0.1, f64::INFINITY), "convergence");
    }

    /// The ray of the true cylinder through a place of the picture.
    fn on_cylinder(x: f64, y: f64, azimuth: f64, span: f64, rows: [f64; 2]) -> DVec3 {
        let (sin, cos) = (azimuth - (x - 0.5) * span).sin_cos();
        DVec3::new(cos, sin, -((rows[1] - rows[0]) * y + rows[0])).normalize()
    }

    #[test]
    fn a_panoramas_strips_are_its_cylinder_to_a_quarter_of_a_pixel() {
        for (width, height, span_deg, fov_deg, up) in [
            (2048, 512, 360.0, 60.0, 0.0),
            (6000, 3000, 360.0, 100.0, -0.4),
            (300, 200, 90.0, 40.0, 0.2),
            (6, 2, 360.0, 90.0, 0.0),
            (1, 1, 60.0, 170.0, 0.0),
        ] {
            let (span, fov) = (f64::to_radians(span_deg), f64::to_radians(fov_deg));
            let target = EYE + DVec3::new(1.0, 1.0, up * 2_f64.sqrt());
            let picture = Picture::panorama((EYE, target), span, fov, (width, height), &LIMITS);
            let picture = picture.expect("a panorama");
            let filled: u32 = picture.parts.iter().map(|part| part.view.width_px).sum();
            assert_eq!(filled, width);
            assert_eq!(picture.check(&LIMITS), Ok(()), "{width} x {height}");
            assert!(picture.parts.windows(2).all(|pair| {
                pair[0].left_px + pair[0].view.width_px == pair[1].left_px && pair[0].view.width_px > 0
            }));
            let half = (fov * 0.5).tan();
            let rows = [-up - half, -up + half];
            if width < 8 {
                continue;
            }
            for part in &picture.parts {
                for (x, y) in [(0.0, 0.0), (0.2, 0.0), (0.5, 0.5), (0.8, 1.0), (1.0, 1.0)] {
                    let column = f64::from(part.left_px) + x * f64::from(part.view.width_px);
                    let truth =
                        on_cylinder(column / f64::from(width), y, std::f64::consts::FRAC_PI_4, span, rows);
                    let [px, py] = part.view.project(EYE + truth * 10.0).expect("before the eye");
                    let off =
                        DVec2::new((px - x) * f64::from(part.view.width_px), (py - y) * f64::from(height));
                    assert!(off.abs().max_element() <= STRIP_ERROR_PX + 1e-4, "{width} x {height}: {off}");
                }
            }
        }
    }

    #[test]
    fn what_is_no_panorama_is_refused() {
        let check = |target: DVec3, span: f64, fov: f64, place: &str| {
            let refused =
                Picture::panorama((EYE, EYE + target), span, fov, (64, 32), &LIMITS).map_err(place_of);
            assert_eq!(refused, Err(place.to_owned()));
        };
        check(DVec3::X, 0.0, 1.0, "span");
        check(DVec3::X, 7.0, 1.0, "span");
        let sized = |size: (u32, u32), fov: f64, up: f64| {
            let target = EYE + DVec3::new(1.0, 0.0, up);
            Picture::panorama((EYE, target), TAU, fov, size, &LIMITS).map(|_| ()).map_err(place_of)
        };
        assert_eq!(sized((5, 5), 1.0, 0.0), Err("width".to_owned()));
        // Thousands of strips, each a picture of its own: one request must not keep everybody else waiting.
        assert_eq!(sized((8000, 3600), 0.02, 5.0), Err("height".to_owned()));
        assert_eq!(sized((8000, 4000), 1.0, 0.0), Ok(()));
        check(DVec3::X, f64::NAN, 1.0, "span");
        check(DVec3::Z, 3.0, 1.0, "target");
        check(DVec3::ZERO, 3.0, 1.0, "target");
        check(DVec3::X, 3.0, 3.1, "fov");
        let whole = 360_f64.to_radians();
        assert!(Picture::panorama((EYE, EYE + DVec3::X), whole, 1.0, (64, 32), &LIMITS).is_ok());
    }

    #[test]
    fn a_place_belongs_to_the_part_that_fills_it() {
        let picture = Picture::panorama((EYE, EYE + DVec3::X), TAU, 1.0, (64, 32), &LIMITS).expect("one");
        // West lies at both ends, south right of the middle.
        for (x, expected) in [(0.5, DVec3::X), (0.75, -DVec3::Y), (0.25, DVec3::Y), (0.99, -DVec3::X)] {
            let ray = picture.ray(x, 0.5).expect("within");
            assert!(ray.direction.dot(expected) > 0.99, "{x}: {}", ray.direction);
            // On the edge between two strips rounding decides.
            assert!(picture.shows(EYE + expected * 5.0, 1e-6));
        }
        assert_eq!(picture.ray(1.5, 0.5), None);
        assert!(!picture.shows(EYE + DVec3::new(1.0, 0.0, 3.0), 0.15));
        assert!(picture.may_show(EYE - DVec3::Y * 4.0, 0.5));
        assert!(!picture.may_show(EYE + DVec3::Z * 4.0, 0.5));
    }
}
