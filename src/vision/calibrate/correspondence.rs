//! The pose of a camera from pairs of picture points and places, with its focal length and first distortion term where asked.
//!
//! A start is looked for over all directions that a fixed camera may look into: for each, the position follows by linear least
//! squares (the point nearest to all lines of sight). The best are refined by Levenberg-Marquardt (Hartley and Zisserman,
//! Multiple View Geometry, appendix 6.2), so pairs on one plane, the usual case, need no other way than any others. What the
//! pairs do not determine is refused, by the covariance of the solution.

use super::CalibrateError;
use crate::geometry::{Camera, Distortion, Pose, least_squares};
use glam::{DMat3, DQuat, DVec2, DVec3, EulerRot};

/// Most pairs; a person clicks ten.
pub const MAX_PAIRS: usize = 1000;

/// Largest coordinate of a place, metres: as far as a camera may stand.
const MAX_PLACE_M: f64 = 1e8;

/// Focal lengths from which the search begins where none is known, in widths of the picture: 113 to 7 degrees.
const FOCAL_STARTS: [f64; 8] = [0.33, 0.5, 0.75, 1.0, 1.5, 2.2, 4.0, 8.0];

/// Starts that are refined.
const N_STARTS: usize = 32;

/// Share of a length (distance, focal length) by which a solution may be uncertain when points are off by a pixel.
const MAX_UNCERTAINTY: f64 = 0.25;

/// A place in the world and where it lies in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Picture point, pixels from the upper left, pixel centres at +0.5.
    pub picture_px: DVec2,
    /// The place, metres.
    pub place_in_world: DVec3,
}

/// What is known of the camera, and what is to be found beside its pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unknowns {
    /// Columns and rows of the picture.
    pub size_px: (u32, u32),
    /// The principal point in pixels; the picture's middle where it is none.
    pub center_px: Option<DVec2>,
    /// The focal length in pixels; found where it is none.
    pub focal_px: Option<f64>,
    /// Whether the first radial term of Brown and Conrady's model is found too; 0 otherwise.
    pub finds_k1: bool,
}

impl Unknowns {
    /// Fewest pairs: each gives two numbers, and there is one more than needed to tell whether they fit.
    #[must_use]
    pub const fn min_pairs(&self) -> usize {
        match (self.focal_px.is_some(), self.finds_k1) {
            (true, false) => 4,
            (true, true) | (false, false) => 6,
            (false, true) => 7,
        }
    }
}

/// A camera that fits, and how well.
#[derive(Clone, Debug, PartialEq)]
pub struct Solved {
    /// The camera.
    pub camera: Camera,
    /// By how much each pair misses, in the order of the pairs.
    pub misses: Vec<Miss>,
    /// Root of the mean square of the misses, pixels.
    pub rms_px: f64,
    /// Standard deviation of the position where picture points are off by a pixel, metres.
    pub position_deviation_m: f64,
    /// The same of the direction, degrees.
    pub direction_deviation_degrees: f64,
    /// The same of the focal length, pixels; 0 where it was known.
    pub focal_deviation_px: f64,
}

/// By how much a pair misses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Miss {
    /// Where the place lies in the picture by the camera, less where it was said to, pixels.
    pub offset_px: DVec2,
    /// Distance of the place from the line of sight through the picture point, metres.
    pub distance_m: f64,
}

/// Position, rotation, focal length and first term, while they are looked for. Places are relative to their middle.
#[derive(Clone, Copy, Debug)]
struct Guess {
    position: DVec3,
    world_from_camera: DQuat,
    focal_px: f64,
    k1: f64,
}

/// Pairs about their middle, and what is known.
struct Problem {
    pairs: Vec<Pair>,
    size_px: DVec2,
    center_px: DVec2,
    unknowns: Unknowns,
}

/// The camera that shows the places of `pairs` where they lie in the picture.
///
/// **Cost**: some ten milliseconds, growing with the pairs.
///
/// # Errors
/// [`CalibrateError::Invalid`] with the place of what is wrong (`/pairs/3/place`): too few pairs or too many, numbers that are
/// not finite, a picture without size; or pairs that no camera fits, or that leave open where it stands.
pub fn solve(pairs: &[Pair], unknowns: Unknowns) -> Result<Solved, CalibrateError> {
    check(pairs, &unknowns)?;
    let middle = pairs.iter().map(|pair| pair.place_in_world).sum::<DVec3>() / pairs.len() as f64;
    let near = pairs.iter().map(|pair| Pair { place_in_world: pair.place_in_world - middle, ..*pair });
    let size_px = DVec2::new(f64::from(unknowns.size_px.0), f64::from(unknowns.size_px.1));
    let center_px = unknowns.center_px.unwrap_or(size_px / 2.0);
    let problem = Problem { pairs: near.collect(), size_px, center_px, unknowns };
    let none = || CalibrateError::invalid("/pairs", "no camera shows these places at these points");
    let best = problem.best().ok_or_else(none)?;
    let [position_deviation_m, direction_deviation, focal_deviation_px] = problem.deviations(&best)?;
    let pose = Pose { position_in_world: best.position + middle, world_from_local: best.world_from_camera };
    let camera =
        Camera::new(unknowns.size_px, DVec2::splat(best.focal_px), center_px, distortion(best.k1), pose)
            .map_err(|error| CalibrateError::no_camera("/pairs", &error))?;
    let misses = pairs.iter().map(|pair| miss(&camera, pair)).collect::<Option<Vec<_>>>().ok_or_else(none)?;
    let sum: f64 = misses.iter().map(|miss| miss.offset_px.length_squared()).sum();
    Ok(Solved {
        camera,
        rms_px: (sum / misses.len() as f64).sqrt(),
        misses,
        position_deviation_m,
        direction_deviation_degrees: direction_deviation.to_degrees(),
        focal_deviation_px,
    })
}

fn check(pairs: &[Pair], unknowns: &Unknowns) -> Result<(), CalibrateError> {
    let least = unknowns.min_pairs();
    if !(least..=MAX_PAIRS).contains(&pairs.len()) {
        let message = format!("{} pairs; what is to be found needs {least} to {MAX_PAIRS}", pairs.len());
        return Err(CalibrateError::invalid("/pairs", message));
    }
    if unknowns.size_px.0 == 0 || unknowns.size_px.1 == 0 {
        return Err(CalibrateError::invalid("/size_px", "the picture has no pixels"));
    }
    if unknowns.focal_px.is_some_and(|focal| !(focal > 1e-3 && focal <= 1e7)) {
        return Err(CalibrateError::invalid("/focal_px", "above 0.001 and at most 1e7 pixels"));
    }
    if unknowns.center_px.is_some_and(|center| !is_within(center.abs().max_element(), 1e7)) {
        return Err(CalibrateError::invalid("/center_px", "within 1e7 pixels of the picture's corner"));
    }
    for (idx, pair) in pairs.iter().enumerate() {
        if !(pair.picture_px.is_finite() && pair.picture_px.abs().max_element() <= 1e6) {
            return Err(CalibrateError::invalid(
                format!("/pairs/{idx}/picture_px"),
                "within 1e6 pixels of the corner",
            ));
        }
        if !(pair.place_in_world.is_finite() && pair.place_in_world.abs().max_element() <= MAX_PLACE_M) {
            return Err(CalibrateError::invalid(format!("/pairs/{idx}/place"), "within 1e8 m of the origin"));
        }
    }
    Ok(())
}

/// Whether it is at most that; what is no number is not.
fn is_within(value: f64, most: f64) -> bool {
    value <= most
}

const fn distortion(k1: f64) -> Distortion {
    if k1 == 0.0 {
        Distortion::None
    } else {
        Distortion::BrownConrady { coefficients: [k1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] }
    }
}

fn miss(camera: &Camera, pair: &Pair) -> Option<Miss> {
    let (columns, rows) = camera.size_px();
    let size_px = DVec2::new(f64::from(columns), f64::from(rows));
    let shown = camera.project(pair.place_in_world)?.texture * size_px;
    let ray = camera.ray(pair.picture_px / size_px)?;
    let to_place = pair.place_in_world - camera.pose().position_in_world;
    Some(Miss { offset_px: shown - pair.picture_px, distance_m: to_place.cross(ray.direction).length() })
}

impl Problem {
    /// The numbers that are looked for: three of rotation, three of position, then focal length and first term.
    fn is_free(&self) -> [bool; 8] {
        let (focal, k1) = (self.unknowns.focal_px.is_none(), self.unknowns.finds_k1);
        [true, true, true, true, true, true, focal, k1]
    }

    /// Offsets of all pairs, pixels, two numbers each; none where a place lies behind the camera or the lens folds back.
    fn offsets(&self, guess: &Guess) -> Option<Vec<f64>> {
        let camera_from_world = guess.world_from_camera.inverse();
        let mut offsets = Vec::with_capacity(2 * self.pairs.len());
        for pair in &self.pairs {
            let local = camera_from_world * (pair.place_in_world - guess.position);
            if local.z.is_nan() || local.z <= 1e-3 {
                return None;
            }
            let plain = local.truncate() / local.z;
            let square = plain.length_squared();
            // Where the radius no longer grows the lens has folded back.
            if 1.0 + 3.0 * guess.k1 * square <= 0.0 {
                return None;
            }
            let shown = plain * (1.0 + guess.k1 * square) * guess.focal_px + self.center_px;
            offsets.extend((shown - pair.picture_px).to_array());
        }
        offsets.iter().all(|offset| offset.is_finite()).then_some(offsets)
    }

    /// Steps of the numbers that are alike in what they do to the picture: radians, metres, pixels, one.
    fn scales(&self, guess: &Guess) -> [f64; 8] {
        let distance = guess.position.length().max(1e-3);
        [1.0, 1.0, 1.0, distance, distance, distance, guess.focal_px, 1.0]
    }

    /// How offsets change with each number, by central differences; none at the edge of what can be shown.
    fn slopes(&self, guess: &Guess) -> Option<[Vec<f64>; 8]> {
        let (scales, is_free) = (self.scales(guess), self.is_free());
        let mut slopes: [Vec<f64>; 8] = Default::default();
        for (idx, slope) in slopes.iter_mut().enumerate() {
            if !is_free[idx] {
                *slope = vec![0.0; 2 * self.pairs.len()];
                continue;
            }
            let mut step = [0.0; 8];
            step[idx] = 1e-6 * scales[idx];
            let ahead = self.offsets(&guess.moved(&step))?;
            let behind = self.offsets(&guess.moved(&step.map(|of| -of)))?;
            *slope = ahead.iter().zip(&behind).map(|(ahead, behind)| (ahead - behind) / 2e-6).collect();
        }
        Some(slopes)
    }

    /// Goes downhill from `guess` for so many steps; where that led, and the sum of squares there.
    fn refined(&self, mut guess: Guess, n_steps: usize) -> Option<(Guess, f64)> {
        let sum = |offsets: &[f64]| offsets.iter().map(|offset| offset * offset).sum::<f64>();
        let mut offsets = self.offsets(&guess)?;
        let mut damping = 1e-3;
        for _ in 0..n_steps {
            let Some(slopes) = self.slopes(&guess) else { break };
            let scales = self.scales(&guess);
            let before = sum(&offsets);
            let mut is_better = false;
            for _ in 0..8 {
                let (columns, right) = damped(&slopes, &offsets, damping);
                let step = least_squares(columns, right).0;
                let moved = guess.moved(&std::array::from_fn(|idx| step[idx] * scales[idx]));
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

    /// The best of all guesses. The lens is straight until they are good: far from the truth its first term, which bends a
    /// picture at will, leads them away.
    fn best(&self) -> Option<Guess> {
        let unknowns = Unknowns { finds_k1: false, ..self.unknowns };
        let straight = Self { pairs: self.pairs.clone(), unknowns, ..*self };
        let mut starts = self.starts();
        starts.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        let refined = starts.into_iter().take(N_STARTS).filter_map(|(start, _)| straight.refined(start, 15));
        let mut refined: Vec<(Guess, f64)> = refined.collect();
        refined.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        let ended = refined.into_iter().take(3).filter_map(|(guess, _)| self.refined(guess, 200));
        ended.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(guess, _)| guess)
    }

    /// For each direction and focal length the position nearest to all lines of sight, and the mean square of their angles.
    fn starts(&self) -> Vec<(Guess, f64)> {
        let focals = match self.unknowns.focal_px {
            Some(focal_px) => vec![focal_px],
            None => FOCAL_STARTS.map(|widths| widths * self.size_px.x).to_vec(),
        };
        let mut starts = Vec::new();
        for focal_px in focals {
            let sights: Vec<DVec3> = self
                .pairs
                .iter()
                .map(|pair| ((pair.picture_px - self.center_px) / focal_px).extend(1.0).normalize())
                .collect();
            for (yaw, pitch, roll) in directions() {
                let world_from_camera = turned(yaw, pitch, roll);
                if let Some((position, error)) = self.nearest(&sights, world_from_camera) {
                    starts.push((Guess { position, world_from_camera, focal_px, k1: 0.0 }, error));
                }
            }
        }
        starts
    }

    fn nearest(&self, sights: &[DVec3], world_from_camera: DQuat) -> Option<(DVec3, f64)> {
        let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
        let across = |sight: &DVec3| {
            let sight = world_from_camera * *sight;
            DMat3::IDENTITY - DMat3::from_cols(sight * sight.x, sight * sight.y, sight * sight.z)
        };
        for (sight, pair) in sights.iter().zip(&self.pairs) {
            matrix += across(sight);
            right += across(sight) * pair.place_in_world;
        }
        // Lines of sight that are all but parallel meet nowhere.
        if matrix.determinant() < 1e-9 * (sights.len() as f64).powi(3) {
            return None;
        }
        let position = matrix.inverse() * right;
        let mut error = 0.0;
        for (sight, pair) in sights.iter().zip(&self.pairs) {
            let to_place = (pair.place_in_world - position).try_normalize()?;
            let ahead = to_place.dot(world_from_camera * *sight);
            error += 2.0 - 2.0 * ahead;
        }
        error.is_finite().then_some((position, error / sights.len() as f64))
    }

    /// Standard deviations for picture points that are off by a pixel: position in metres, direction in radians, focal length
    /// in pixels.
    fn deviations(&self, guess: &Guess) -> Result<[f64; 3], CalibrateError> {
        let open = |what: &str| {
            CalibrateError::invalid(
                "/pairs",
                format!("these pairs leave open {what}: add some elsewhere, at other distances"),
            )
        };
        let slopes = self.slopes(guess).ok_or_else(|| open("where the camera stands"))?;
        let (columns, _) = damped(&slopes, &vec![0.0; 2 * self.pairs.len()], 1e-9);
        // Rows that hold a step back count as observations with a vast deviation: what nothing else holds shows it.
        let n_rows = columns[0].len();
        let mut squares = [0.0; 8];
        for row in 0..n_rows {
            let mut unit = vec![0.0; n_rows];
            unit[row] = 1.0;
            let solution = least_squares(columns.clone(), unit).0;
            for (idx, value) in solution.into_iter().enumerate().filter(|(idx, _)| self.is_free()[*idx]) {
                squares[idx] += value * value;
            }
        }
        let scales = self.scales(guess);
        let of = |idx: usize| squares[idx].sqrt() * scales[idx];
        let together = |from: usize| DVec3::new(of(from), of(from + 1), of(from + 2)).length();
        let (direction, position, focal, k1) = (together(0), together(3), of(6), of(7));
        let distance = guess.position.length();
        if !(is_within(position, MAX_UNCERTAINTY * distance) && is_within(direction, MAX_UNCERTAINTY)) {
            return Err(open("where the camera stands"));
        }
        if !is_within(focal, MAX_UNCERTAINTY * guess.focal_px) {
            return Err(open("its focal length"));
        }
        if !is_within(k1, 1.0) {
            return Err(open("its distortion"));
        }
        Ok([position, direction, focal])
    }
}

impl Guess {
    /// With rotation (about the camera's axes), position, focal length and first term changed by that.
    fn moved(&self, step: &[f64; 8]) -> Self {
        let [right, down, forward, x, y, z, focal, k1] = *step;
        let turn = DQuat::from_scaled_axis(DVec3::new(right, down, forward));
        Self {
            position: self.position + DVec3::new(x, y, z),
            world_from_camera: (self.world_from_camera * turn).normalize(),
            // It never comes to nothing, however long the step.
            focal_px: (self.focal_px + focal).max(0.1 * self.focal_px),
            k1: self.k1 + k1,
        }
    }
}

/// Columns and right side of a step: those of the offsets, and below them a row for each number that holds it back.
fn damped(slopes: &[Vec<f64>; 8], offsets: &[f64], damping: f64) -> ([Vec<f64>; 8], Vec<f64>) {
    let columns = std::array::from_fn(|idx| {
        let length = slopes[idx].iter().map(|slope| slope * slope).sum::<f64>().sqrt();
        let mut column = slopes[idx].clone();
        column.extend((0..8).map(|row| if row == idx { damping.sqrt() * length.max(1.0) } else { 0.0 }));
        column
    });
    let mut right: Vec<f64> = offsets.iter().map(|offset| -offset).collect();
    right.extend([0.0; 8]);
    (columns, right)
}

/// Yaw, pitch and roll of the directions from which a start is looked for, radians: all around, from straight down to somewhat
/// up, a picture's top never below its middle.
fn directions() -> impl Iterator<Item = (f64, f64, f64)> {
    (0..24).flat_map(|yaw| {
        (-6..=2).flat_map(move |pitch| {
            (-1..=1).map(move |roll| {
                let degrees = (f64::from(yaw) * 15.0, f64::from(pitch) * 15.0, f64::from(roll) * 25.0);
                (degrees.0.to_radians(), degrees.1.to_radians(), degrees.2.to_radians())
            })
        })
    })
}

/// A camera's rotation: level and northwards (x east, y down, z north), then raised, turned about the vertical, and rolled.
fn turned(yaw: f64, pitch: f64, roll: f64) -> DQuat {
    let level = DQuat::from_mat3(&DMat3::from_cols(DVec3::X, -DVec3::Z, DVec3::Y));
    DQuat::from_rotation_z(yaw) * level * DQuat::from_euler(EulerRot::XYZ, pitch, 0.0, roll)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (1280, 720);

    fn known(focal_px: Option<f64>) -> Unknowns {
        Unknowns { size_px: SIZE, center_px: None, focal_px, finds_k1: false }
    }

    fn bent(focal_px: Option<f64>) -> Unknowns {
        Unknowns { finds_k1: true, ..known(focal_px) }
    }

    fn camera(eye: DVec3, target: DVec3, focal_px: f64, k1: f64) -> Camera {
        let center_px = DVec2::new(640.0, 360.0);
        let pose = Pose::looking_at(eye, target).unwrap();
        Camera::new(SIZE, DVec2::splat(focal_px), center_px, distortion(k1), pose).unwrap()
    }

    /// Where `camera` shows these places, each off by at most `noise_px`.
    fn seen(camera: &Camera, places: &[DVec3], noise_px: f64) -> Vec<Pair> {
        let mut state = 7_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 40) as f64 / f64::from(1 << 24) * 2.0 - 1.0) * noise_px
        };
        let size_px = DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
        let pair = |place: &DVec3| {
            let shown = camera.project(*place).unwrap().texture * size_px;
            Pair { picture_px: shown + DVec2::new(noise(), noise()), place_in_world: *place }
        };
        places.iter().map(pair).collect()
    }

    fn ground() -> Vec<DVec3> {
        [(-4.0, -3.0), (4.0, -3.5), (5.0, 4.0), (-5.0, 5.0), (0.5, 0.3), (2.0, 7.0), (-1.0, 3.0), (1.5, -1.5)]
            .map(|(x, y)| DVec3::new(x, y, 0.0))
            .to_vec()
    }

    /// How far off, metres and degrees.
    fn off(solved: &Solved, truth: &Camera) -> (f64, f64) {
        let (a, b) = (solved.camera.pose(), truth.pose());
        let turn = a.world_from_local.angle_between(b.world_from_local);
        ((a.position_in_world - b.position_in_world).length(), turn.to_degrees())
    }

    #[test]
    fn exact_pairs_give_the_camera_back() {
        let check = |truth: &Camera, places: &[DVec3], unknowns: Unknowns| {
            let solved = solve(&seen(truth, places, 0.0), unknowns).unwrap();
            let (metres, degrees) = off(&solved, truth);
            let far = (truth.pose().position_in_world - places[0]).length();
            assert!(metres < 1e-5 * far && degrees < 1e-4, "{metres} m, {degrees} degrees: {solved:?}");
            assert!(solved.rms_px < 1e-4, "{}", solved.rms_px);
            assert!((solved.camera.focal_px().x / truth.focal_px().x - 1.0).abs() < 1e-5, "{solved:?}");
        };
        let eyes =
            [(12.0, -9.0, 5.0), (-3.0, -14.0, 3.0), (0.5, 16.0, 9.0), (-20.0, 2.0, 12.0), (1.0, -2.0, 14.0)];
        for eye in eyes.map(|(x, y, z)| DVec3::new(x, y, z)) {
            for focal_px in [700.0, 1100.0] {
                let truth = camera(eye, DVec3::new(0.3, 0.8, 0.0), focal_px, 0.0);
                check(&truth, &ground()[..4], known(Some(focal_px)));
                check(&truth, &ground(), known(None));
                let mut house = ground();
                house.iter_mut().step_by(2).for_each(|place| place.z = 2.5 + 0.2 * place.x);
                check(&truth, &house, known(None));
                let curved = camera(eye, DVec3::new(0.3, 0.8, 0.0), focal_px, -0.12);
                check(&curved, &house, bent(None));
                check(&curved, &ground(), bent(Some(focal_px)));
            }
        }
    }

    #[test]
    fn a_click_that_is_off_by_a_pixel_costs_what_is_told() {
        let truth = camera(DVec3::new(9.0, -11.0, 6.0), DVec3::ZERO, 900.0, 0.0);
        let solved = solve(&seen(&truth, &ground()[..6], 1.0), known(Some(900.0))).unwrap();
        let (metres, degrees) = off(&solved, &truth);
        assert!(metres <= 0.1 && degrees <= 0.3, "{metres} m, {degrees} degrees");
        assert!(metres <= 4.0 * solved.position_deviation_m, "{metres} m of {solved:?}");
        assert!(solved.rms_px > 0.1 && solved.rms_px < 1.5, "{}", solved.rms_px);
        // The pair that is wrong is the one that misses most.
        let mut wrong = seen(&truth, &ground(), 0.0);
        wrong[4].picture_px += DVec2::new(0.0, 60.0);
        let solved = solve(&wrong, known(Some(900.0))).unwrap();
        let most = solved
            .misses
            .iter()
            .enumerate()
            .max_by(|(_, a), (_, b)| a.offset_px.length().total_cmp(&b.offset_px.length()));
        assert_eq!(most.map(|(idx, _)| idx), Some(4), "{:?}", solved.misses);
        assert!(solved.misses[4].distance_m > 0.1 && solved.misses[4].offset_px.y < -20.0);
    }

    #[test]
    fn a_lens_that_bends_is_found_from_clicks_to_the_pixel() {
        // Looking down between two buildings: with the first term free from the beginning the search lost its way.
        let clicks = [
            ((451.5, 289.5), (-1.0, 6.5, 0.0)),
            ((495.0, 26.0), (-1.0, 6.5, 6.4)),
            ((119.0, 293.0), (7.214978, 4.293681, 0.0)),
            ((61.0, 100.0), (8.69826, -0.27139, 4.0)),
            ((490.5, 128.5), (-10.0, -4.0, 0.0)),
            ((133.5, 137.0), (8.0, -8.0, 0.0)),
            ((507.5, 76.0), (-20.0, -15.0, 0.0)),
            ((252.9, 316.7), (4.0, 6.0, 0.0)),
            ((541.6, 181.2), (-8.0, 2.0, 0.0)),
        ];
        let pairs = clicks.map(|((column, row), (x, y, z))| Pair {
            picture_px: DVec2::new(column, row),
            place_in_world: DVec3::new(x, y, z),
        });
        let solved = solve(&pairs, Unknowns { size_px: (640, 360), ..bent(None) }).unwrap();
        let metres = (solved.camera.pose().position_in_world - DVec3::new(4.6, 13.6, 7.2)).length();
        assert!(metres < 0.1, "{metres} m: {solved:?}");
        assert!(solved.rms_px < 0.5, "{}", solved.rms_px);
        assert!((solved.camera.focal_px().x / 424.654 - 1.0).abs() < 0.02, "{solved:?}");
    }

    #[test]
    fn far_from_the_origin_nothing_is_lost() {
        let away = DVec3::new(4_400_000.0, 5_300_000.0, 300.0);
        let truth = camera(DVec3::new(9.0, -11.0, 6.0) + away, away, 900.0, 0.0);
        let places: Vec<DVec3> = ground().iter().map(|place| *place + away).collect();
        let solved = solve(&seen(&truth, &places, 0.0), known(None)).unwrap();
        let (metres, degrees) = off(&solved, &truth);
        assert!(metres < 1e-4 && degrees < 1e-3, "{metres} m, {degrees} degrees");
    }

    #[test]
    fn what_the_pairs_leave_open_is_refused() {
        let refused = |pairs: &[Pair], unknowns: Unknowns| match solve(pairs, unknowns) {
            Err(CalibrateError::Invalid(fault)) => format!("{fault}"),
            other => panic!("{other:?}"),
        };
        let truth = camera(DVec3::new(9.0, -11.0, 6.0), DVec3::ZERO, 900.0, 0.0);
        // One line, one place, and a focal length from straight above.
        let line: Vec<DVec3> = (0..8).map(|x| DVec3::new(f64::from(x) - 3.0, 0.5, 0.0)).collect();
        assert!(refused(&seen(&truth, &line, 0.0), known(None)).contains("/pairs"));
        assert!(refused(&seen(&truth, &line, 0.0), known(Some(900.0))).contains("/pairs"));
        assert!(refused(&seen(&truth, &[DVec3::ZERO; 8], 0.0), known(Some(900.0))).contains("/pairs"));
        let above = camera(DVec3::new(0.0, 0.0, 20.0), DVec3::ZERO, 900.0, 0.0);
        assert!(refused(&seen(&above, &ground(), 0.0), known(None)).contains("leave open"));
        assert!(solve(&seen(&above, &ground(), 0.0), known(Some(900.0))).is_ok());
    }

    #[test]
    fn what_is_wrong_is_told_at_its_place() {
        let truth = camera(DVec3::new(9.0, -11.0, 6.0), DVec3::ZERO, 900.0, 0.0);
        let pairs = seen(&truth, &ground(), 0.0);
        let place = |pairs: &[Pair], unknowns: Unknowns| match solve(pairs, unknowns) {
            Err(CalibrateError::Invalid(fault)) => fault.place,
            other => panic!("{other:?}"),
        };
        assert_eq!(place(&pairs[..3], known(Some(900.0))), "/pairs");
        assert_eq!(place(&pairs[..5], known(None)), "/pairs");
        assert_eq!(place(&pairs[..6], bent(None)), "/pairs");
        for (x, y, z) in [(f64::NAN, 0.0, 0.0), (0.0, f64::INFINITY, 0.0), (0.0, 0.0, 1e9)] {
            let mut bad = pairs.clone();
            bad[2].place_in_world = DVec3::new(x, y, z);
            assert_eq!(place(&bad, known(None)), "/pairs/2/place");
        }
        let mut bad = pairs.clone();
        bad[5].picture_px.x = f64::NAN;
        assert_eq!(place(&bad, known(None)), "/pairs/5/picture_px");
        assert_eq!(place(&pairs, known(Some(0.0))), "/focal_px");
        assert_eq!(place(&pairs, known(Some(f64::NAN))), "/focal_px");
        assert_eq!(place(&pairs, Unknowns { size_px: (0, 5), ..known(None) }), "/size_px");
        let off = Unknowns { center_px: Some(DVec2::NAN), ..known(None) };
        assert_eq!(place(&pairs, off), "/center_px");
    }
}
