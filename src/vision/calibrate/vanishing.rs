//! How a camera is turned, and its focal length where asked, from lines of its picture that are parallel to the world's axes.
//!
//! Parallel lines meet in a point of the picture, which is the direction of their axis as the camera sees it; two such points of
//! perpendicular axes give the focal length. All of it is then refined so that the lines' ends miss least.
//!
//! - `[HZ04]` Hartley and Zisserman, Multiple View Geometry in Computer Vision, 2nd edition, 2004: section 8.6 (vanishing points),
//!   section 8.8 (calibration from perpendicular ones), appendix 6.2 (Levenberg-Marquardt).
//! - `[CT90]` Caprile and Torre, Using vanishing points for camera calibration, International Journal of Computer Vision 4 (1990),
//!   pages 127-139, <https://doi.org/10.1007/BF00127813>: rotation from vanishing points, square pixels, a known principal point.
//!
//! Deviations: a line misses by the distance of its ends from the line through its middle and the vanishing point; `[HZ04]` section
//! 8.6.1 draws that line best through both ends, which differs by the square of the miss alone. No distortion: lines are drawn
//! where the lens leaves them straight.

use super::CalibrateError;
use crate::geometry::least_squares;
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::PI;

/// Most lines of a pencil; a person draws five.
pub const MAX_LINES: usize = 100;

/// Shortest line, pixels: a shorter one has no direction.
const MIN_LENGTH_PX: f64 = 1.0;

/// Focal lengths from which the search begins beside those that vanishing points give, in widths of the picture.
const FOCAL_STARTS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];

/// Share of the focal length by which it may be uncertain when lines are off by a pixel.
const MAX_FOCAL_UNCERTAINTY: f64 = 0.25;

/// Radians by which the rotation may be uncertain then.
const MAX_TURN_UNCERTAINTY: f64 = 0.1;

/// Root of the mean square of the misses above which lines show no camera, in widths of the picture.
const MAX_MISS: f64 = 0.05;

/// Within this of level, how high a picture's upper side points says nothing: the camera looks straight down or up.
const LEVEL: f64 = 0.02;

/// An axis of the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorldAxis {
    /// To the east, or wherever the world's x points.
    X,
    /// To the north, or wherever its y points.
    Y,
    /// Up.
    Z,
}

impl WorldAxis {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    const fn direction(self) -> DVec3 {
        match self {
            Self::X => DVec3::X,
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }
}

/// Lines of the picture that are parallel to one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Pencil {
    /// The axis.
    pub axis: WorldAxis,
    /// Both ends of each, pixels from the upper left, pixel centres at +0.5.
    pub lines: Vec<[DVec2; 2]>,
}

/// What is known of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownView {
    /// Columns and rows of the picture.
    pub size_px: (u32, u32),
    /// The principal point in pixels; the picture's middle where it is none.
    pub center_px: Option<DVec2>,
    /// The focal length in pixels; found where it is none.
    pub focal_px: Option<f64>,
    /// How the camera is turned, roughly: of the two upright rotations that fit, which look opposite ways, the nearer one is taken.
    pub near: Option<DQuat>,
}

/// How a camera is turned.
#[derive(Clone, Debug, PartialEq)]
pub struct Turned {
    /// Focal length in pixels.
    pub focal_px: f64,
    /// Turns the camera's axes into the world's.
    pub world_from_camera: DQuat,
    /// By how much the ends of each line lie beside the line through its middle and the vanishing point, pixels: positive where its
    /// first end lies to the right, seen from the middle. In the order of the pencils and their lines.
    pub misses_px: Vec<Vec<f64>>,
    /// Root of the mean square of these.
    pub rms_px: f64,
}

/// Rotation and focal length, while they are looked for.
#[derive(Clone, Copy, Debug)]
struct Guess {
    world_from_camera: DQuat,
    focal_px: f64,
}

/// Numbers that are looked for: three of rotation, and the focal length's logarithm.
const N: usize = 4;

/// Lines about the principal point.
struct Problem {
    pencils: Vec<Pencil>,
    width_px: f64,
    known: KnownView,
}

/// The rotation, and the focal length where it is not known, by which lines of these pencils meet in their axes' vanishing points.
/// Of the rotations that fit alike, z is up and the camera upright; of these two the one nearer to `known.near`, or else the one
/// that looks along y, or along x.
///
/// # Errors
/// [`CalibrateError::Invalid`] with the place of what is wrong (`/pencils/1/lines/0`): numbers that are not finite, too few lines;
/// or lines that no camera shows so, or that leave open what is looked for.
pub fn turn(pencils: &[Pencil], known: KnownView) -> Result<Turned, CalibrateError> {
    check(pencils, &known)?;
    let size_px = DVec2::new(f64::from(known.size_px.0), f64::from(known.size_px.1));
    let center_px = known.center_px.unwrap_or(size_px / 2.0);
    let about_center = |pencil: &Pencil| {
        let lines = pencil.lines.iter().map(|ends| ends.map(|end| end - center_px)).collect();
        Pencil { axis: pencil.axis, lines }
    };
    let pencils = pencils.iter().map(about_center).collect();
    let problem = Problem { pencils, width_px: size_px.x, known };
    let starts = problem.starts()?;
    let refined = starts.into_iter().filter_map(|start| problem.refined(start));
    let best = refined.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(guess, _)| guess);
    let none =
        || CalibrateError::invalid("/pencils", "no camera shows lines of perpendicular axes like that");
    let best = best.ok_or_else(none)?;
    let offsets = problem.offsets(&best).ok_or_else(none)?;
    let rms_px = (sum(&offsets) / offsets.len() as f64).sqrt();
    if rms_px > MAX_MISS * problem.width_px {
        return Err(none());
    }
    problem.check_certainty(&best)?;
    let mut misses = offsets.into_iter();
    let misses_px =
        problem.pencils.iter().map(|pencil| misses.by_ref().take(pencil.lines.len()).collect()).collect();
    let world_from_camera = upright(best.world_from_camera, known.near);
    Ok(Turned { focal_px: best.focal_px, world_from_camera, misses_px, rms_px })
}

fn check(pencils: &[Pencil], known: &KnownView) -> Result<(), CalibrateError> {
    let refuse = |place: String, message: &str| Err(CalibrateError::invalid(place, message));
    if !(2..=3).contains(&pencils.len()) {
        return refuse("/pencils".to_owned(), "expected 2 or 3 pencils, each of another axis");
    }
    if known.size_px.0 == 0 || known.size_px.1 == 0 {
        return refuse("/image_size_px".to_owned(), "the picture has no pixels");
    }
    if known.focal_px.is_some_and(|focal| !(focal > 1e-3 && focal <= 1e7)) {
        return refuse("/focal_px".to_owned(), "above 0.001 and at most 1e7 pixels");
    }
    let is_within = |point: DVec2, most: f64| point.is_finite() && point.abs().max_element() <= most;
    if known.center_px.is_some_and(|center| !is_within(center, 1e7)) {
        return refuse("/center_px".to_owned(), "within 1e7 pixels of the picture's corner");
    }
    if known.near.is_some_and(|near| !(near.is_finite() && (0.5..=2.0).contains(&near.length()))) {
        return refuse("/near".to_owned(), "expected a quaternion of length 1");
    }
    for (idx, pencil) in pencils.iter().enumerate() {
        if pencils[..idx].iter().any(|other| other.axis == pencil.axis) {
            return refuse(format!("/pencils/{idx}/axis"), "another pencil has this axis");
        }
        if !(2..=MAX_LINES).contains(&pencil.lines.len()) {
            return refuse(format!("/pencils/{idx}/lines"), "expected 2 to 100 lines");
        }
        for (line_idx, [from, to]) in pencil.lines.iter().enumerate() {
            let place = || format!("/pencils/{idx}/lines/{line_idx}");
            if !(is_within(*from, 1e6) && is_within(*to, 1e6)) {
                return refuse(place(), "within 1e6 pixels of the corner");
            }
            if from.distance(*to) < MIN_LENGTH_PX {
                return refuse(place(), "the ends of a line must be a pixel apart");
            }
        }
    }
    Ok(())
}

impl Problem {
    /// From each two pencils the rotation by their vanishing points, with each focal length that is tried.
    fn starts(&self) -> Result<Vec<Guess>, CalibrateError> {
        let mut focals = match self.known.focal_px {
            Some(focal_px) => vec![focal_px],
            None => FOCAL_STARTS.map(|widths| widths * self.width_px).to_vec(),
        };
        let pairs: &[(usize, usize)] =
            if self.pencils.len() == 3 { &[(0, 1), (0, 2), (1, 2)] } else { &[(0, 1)] };
        if self.known.focal_px.is_none() {
            let seen = self.directions(self.width_px)?;
            focals.extend(pairs.iter().filter_map(|(a, b)| self.focal_px(seen[*a], seen[*b])));
        }
        let mut starts = Vec::new();
        for focal_px in focals {
            let seen = self.directions(focal_px)?;
            for (a, b) in pairs {
                let axes = [a, b].map(|idx| self.pencils[*idx].axis.direction());
                if let Some(world_from_camera) = rotation(axes, [seen[*a], seen[*b]]) {
                    starts.push(Guess { world_from_camera, focal_px });
                }
            }
        }
        Ok(starts)
    }

    /// The direction of each pencil's vanishing point by the two of its lines that differ most, in the camera's axes.
    fn directions(&self, focal_px: f64) -> Result<Vec<DVec3>, CalibrateError> {
        let direction = |(idx, pencil): (usize, &Pencil)| {
            // Planes through the eye and each line; what is parallel to all lies in all of them.
            let plane = |[from, to]: &[DVec2; 2]| {
                let [from, to] = [from, to].map(|end| end.extend(focal_px).normalize());
                from.cross(to).normalize_or_zero()
            };
            let planes: Vec<DVec3> = pencil.lines.iter().map(plane).collect();
            let both = planes.iter().enumerate().flat_map(|(i, a)| planes[..i].iter().map(|b| a.cross(*b)));
            let best = both.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
            best.filter(|best| best.length() > 1e-9).map(DVec3::normalize).ok_or_else(|| {
                let message = "its lines lie on one line of the picture: draw some beside it";
                CalibrateError::invalid(format!("/pencils/{idx}/lines"), message)
            })
        };
        self.pencils.iter().enumerate().map(direction).collect()
    }

    /// The focal length by which two directions, seen with the picture's width for one, are perpendicular (`[HZ04]` section 8.8,
    /// `[CT90]`); none where a vanishing point lies at infinity, or both on one side of the principal point.
    fn focal_px(&self, a: DVec3, b: DVec3) -> Option<f64> {
        let square = -(a.x * b.x + a.y * b.y) / (a.z * b.z);
        (square.is_finite() && square > 0.0).then(|| self.width_px * square.sqrt())
    }

    /// By how much each line misses, pixels; none where a vanishing point lies in the middle of one.
    fn offsets(&self, guess: &Guess) -> Option<Vec<f64>> {
        let camera_from_world = guess.world_from_camera.inverse();
        let mut offsets = Vec::new();
        for pencil in &self.pencils {
            // Homogeneous: it may lie at infinity.
            let seen = camera_from_world * pencil.axis.direction();
            let vanishing = DVec3::new(guess.focal_px * seen.x, guess.focal_px * seen.y, seen.z);
            for [from, to] in &pencil.lines {
                let line = ((from + to) / 2.0).extend(1.0).cross(vanishing);
                let offset = line.dot(from.extend(1.0)) / line.truncate().length();
                offsets.push(Some(offset).filter(|offset| offset.is_finite())?);
            }
        }
        Some(offsets)
    }

    /// How offsets change with each number, by central differences.
    fn slopes(&self, guess: &Guess) -> Option<[Vec<f64>; N]> {
        let mut slopes: [Vec<f64>; N] = Default::default();
        for (idx, slope) in slopes.iter_mut().enumerate() {
            let mut step = [0.0; N];
            step[idx] = if idx == 3 && self.known.focal_px.is_some() { 0.0 } else { 1e-6 };
            let ahead = self.offsets(&guess.moved(step))?;
            let behind = self.offsets(&guess.moved(step.map(|of| -of)))?;
            *slope = ahead.iter().zip(&behind).map(|(ahead, behind)| (ahead - behind) / 2e-6).collect();
        }
        Some(slopes)
    }

    /// Goes downhill from `guess` (`[HZ04]` appendix 6.2); where that led, and the sum of squares there.
    fn refined(&self, mut guess: Guess) -> Option<(Guess, f64)> {
        let mut offsets = self.offsets(&guess)?;
        let mut damping = 1e-3;
        for _ in 0..100 {
            let Some(slopes) = self.slopes(&guess) else { break };
            let before = sum(&offsets);
            let mut is_better = false;
            for _ in 0..8 {
                let (columns, right) = damped(&slopes, &offsets, damping);
                let moved = guess.moved(least_squares(columns, right).0);
                match self.offsets(&moved).filter(|after| sum(after) < before) {
                    Some(after) => {
                        (guess, offsets, is_better) = (moved, after, true);
                        damping = (damping / 5.0).max(1e-12);
                        break;
                    }
                    None => damping *= 10.0,
                }
            }
            if !is_better || before - sum(&offsets) < 1e-14 * (1.0 + before) {
                break;
            }
        }
        Some((guess, sum(&offsets)))
    }

    /// Refuses what is not determined, by the covariance of the solution where lines are off by a pixel.
    fn check_certainty(&self, guess: &Guess) -> Result<(), CalibrateError> {
        let open = |message: &str| Err(CalibrateError::invalid("/pencils", message));
        let Some(slopes) = self.slopes(guess) else {
            return open("these lines leave open how the camera is turned");
        };
        let (columns, right) = damped(&slopes, &vec![0.0; slopes[0].len()], 1e-9);
        // Rows that hold a step back count as observations: what nothing else holds shows a vast deviation.
        let mut squares = [0.0; N];
        for row in 0..right.len() {
            let mut unit = vec![0.0; right.len()];
            unit[row] = 1.0;
            let solution = least_squares(columns.clone(), unit).0;
            squares.iter_mut().zip(solution).for_each(|(square, value)| *square += value * value);
        }
        let [right, down, forward, focal] = squares;
        let is_focal_open = self.known.focal_px.is_none() && !is_at_most(focal.sqrt(), MAX_FOCAL_UNCERTAINTY);
        if is_focal_open {
            return open(
                "these lines leave open the focal length: lines that are parallel in the picture too do not tell it; draw lines \
                 of two axes that run together, or say the focal length",
            );
        }
        if !is_at_most((right + down + forward).sqrt(), MAX_TURN_UNCERTAINTY) {
            return open(
                "these lines leave open how the camera is turned: draw longer ones, and some further apart",
            );
        }
        Ok(())
    }
}

impl Guess {
    /// Turned about the camera's axes, and with another focal length by that step of its logarithm.
    fn moved(&self, [right, down, forward, focal]: [f64; N]) -> Self {
        let turn = DQuat::from_scaled_axis(DVec3::new(right, down, forward));
        Self {
            world_from_camera: (self.world_from_camera * turn).normalize(),
            // A long step is a wrong one.
            focal_px: self.focal_px * focal.clamp(-1.0, 1.0).exp(),
        }
    }
}

/// What is no number is not.
fn is_at_most(value: f64, most: f64) -> bool {
    value <= most
}

fn sum(offsets: &[f64]) -> f64 {
    offsets.iter().map(|offset| offset * offset).sum()
}

/// Columns and right side of a step: those of the offsets, and below them a row for each number that holds it back.
fn damped(slopes: &[Vec<f64>; N], offsets: &[f64], damping: f64) -> ([Vec<f64>; N], Vec<f64>) {
    let columns = std::array::from_fn(|idx| {
        let length = slopes[idx].iter().map(|slope| slope * slope).sum::<f64>().sqrt();
        let mut column = slopes[idx].clone();
        column.extend((0..N).map(|row| if row == idx { damping.sqrt() * length.max(1.0) } else { 0.0 }));
        column
    });
    let right = offsets.iter().map(|offset| -offset).chain([0.0; N]).collect();
    (columns, right)
}

/// The rotation by which two of the world's axes are seen in these directions, the first exactly (`[CT90]`); none where both
/// are seen in one.
fn rotation(axes: [DVec3; 2], seen: [DVec3; 2]) -> Option<DQuat> {
    let frame = |[first, second]: [DVec3; 2]| {
        let across = first.cross(second).try_normalize()?;
        Some(glam::DMat3::from_cols(first, across.cross(first), across))
    };
    let is_apart = seen[0].cross(seen[1]).length() > 1e-6;
    let (world, camera) = (frame(axes)?, frame(seen).filter(|_| is_apart)?);
    Some(DQuat::from_mat3(&(world * camera.transpose())).normalize())
}

/// Of the four rotations by which every axis is seen along the same line, one with the camera upright.
fn upright(found: DQuat, near: Option<DQuat>) -> DQuat {
    let flips = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| DQuat::from_axis_angle(axis, PI));
    let all = std::iter::once(found).chain(flips.map(|flip| (flip * found).normalize()));
    let is_upright = |turned: &DQuat| {
        let (up, forward) = (*turned * -DVec3::Y, *turned * DVec3::Z);
        if up.z.abs() > LEVEL { up.z > 0.0 } else { forward.z < 0.0 }
    };
    let away = |turned: &DQuat| match near {
        Some(near) => turned.angle_between(near.normalize()),
        None => {
            let forward = *turned * DVec3::Z;
            -(forward.y + 1e-3 * forward.x)
        }
    };
    let best = all.filter(is_upright).min_by(|a, b| away(a).total_cmp(&away(b)));
    best.unwrap_or(found)
}

#[cfg(test)]
mod tests;
