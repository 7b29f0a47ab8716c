//! Where a picture lies on the plan of the world: maps between planes, from points that both show.
//!
//! `[HZ04]` Hartley and Zisserman 2004, Multiple View Geometry in Computer Vision, sections 4.1 and 4.4 (direct linear
//! transformation with normalisation, then the geometric error).

use super::least_squares::least_squares;
use glam::{DMat3, DVec2, DVec3};

/// A point that a picture and the plan both show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPoint {
    /// Texture coordinate: [0, 1]^2, origin top left.
    pub texture: DVec2,
    /// World x and y, metres.
    pub world: DVec2,
}

/// What a picture may undergo on its way to the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaneTransform {
    /// Parallels stay parallels: 6 numbers, 3 points.
    Affine,
    /// Straight lines stay straight: 8 numbers, 4 points.
    Homography,
}

impl PlaneTransform {
    /// How many points determine it.
    #[must_use]
    pub const fn least_points(self) -> usize {
        match self {
            Self::Affine => 3,
            Self::Homography => 4,
        }
    }
}

/// From world x and y to homogeneous texture coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneMap {
    /// Subtracted from world points first, so that nothing large is rounded.
    origin: DVec2,
    matrix: DMat3,
}

impl PlaneMap {
    /// The texture coordinate (s, t, q) of a world point, which lies at s/q, t/q of the picture; beyond the picture's
    /// horizon q is 0 or less. All three are linear in the world.
    #[must_use]
    pub fn texture_at(&self, world: DVec2) -> DVec3 {
        self.matrix * (world - self.origin).extend(1.0)
    }
}

/// A picture's place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Registration {
    /// Where it lies.
    pub map: PlaneMap,
    /// The root of the mean square of the distances between control points and where the picture shows them, metres; 0
    /// where there are no more than determine the map.
    pub residual_m: f64,
}

/// Why control points are no registration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RegistrationError {
    /// A number is not finite.
    #[error("control points must be finite numbers")]
    NotFinite,
    /// Too few.
    #[error("at least {least} control points are needed, got {count}")]
    TooFew {
        /// How many are needed.
        least: usize,
        /// How many there are.
        count: usize,
    },
    /// On one line, or in one place.
    #[error("the control points lie (almost) on one line, in the picture or in the world")]
    Collinear,
    /// Of too many kinds, or contradicting each other.
    #[error("the control points do not determine where the picture lies")]
    Undetermined,
    /// The picture would be seen from below.
    #[error(
        "the control points mirror the picture: pixels are counted from its upper left corner, downwards, the world's y \
         points north"
    )]
    Mirrored,
}

/// Control points spread less than this across the line through them, relative to along it, lie on it.
const LEAST_SPREAD: f64 = 1e-3;
/// Coefficients of less than this share of their own are not determined.
const LEAST_SHARE: f64 = 1e-7;
/// Most steps towards the least geometric error; a handful is enough.
const MOST_STEPS: usize = 30;

/// Finds where the picture lies that shows these points: with least squares of the distances in the world.
///
/// # Errors
/// When the points are too few, not finite, degenerate, or mirror the picture.
pub fn register(
    points: &[ControlPoint],
    transform: PlaneTransform,
) -> Result<Registration, RegistrationError> {
    let (least, count) = (transform.least_points(), points.len());
    if count < least {
        return Err(RegistrationError::TooFew { least, count });
    }
    if !points.iter().all(|point| point.texture.is_finite() && point.world.is_finite()) {
        return Err(RegistrationError::NotFinite);
    }
    let of_texture = Normal::of(points.iter().map(|point| point.texture))?;
    let of_world = Normal::of(points.iter().map(|point| point.world))?;
    let pairs: Vec<(DVec2, DVec2)> = points
        .iter()
        .map(|point| (of_texture.normalized(point.texture), of_world.normalized(point.world)))
        .collect();
    let world_from_texture = match transform {
        PlaneTransform::Affine => affine(&pairs)?,
        PlaneTransform::Homography => nearest_homography(&pairs)?,
    };
    let is_before_horizon =
        |(texture, _): &(DVec2, DVec2)| (world_from_texture * texture.extend(1.0)).z > 1e-3;
    let turn = world_from_texture.determinant();
    if !pairs.iter().all(is_before_horizon) || turn.is_nan() || turn.abs() < 1e-9 {
        return Err(RegistrationError::Undetermined);
    }
    // Rows run downwards, north upwards: what is seen from above is turned over once.
    if turn > 0.0 {
        return Err(RegistrationError::Mirrored);
    }
    let squares: f64 =
        pairs.iter().map(|pair| (shown(&world_from_texture, pair.0) - pair.1).length_squared()).sum();
    let is_exact = count == least;
    let residual_m = if is_exact { 0.0 } else { (squares / count as f64).sqrt() * of_world.scale };
    let texture_from_world = of_texture.matrix()
        * world_from_texture.inverse()
        * DMat3::from_scale(DVec2::splat(1.0 / of_world.scale));
    // Positive where the control points are.
    let matrix = texture_from_world * (1.0 / texture_from_world.z_axis.z);
    Ok(Registration { map: PlaneMap { origin: of_world.middle, matrix }, residual_m })
}

/// What moves points to about 0 and their distances to about 1 [HZ04, 4.4.4].
struct Normal {
    middle: DVec2,
    scale: f64,
}

impl Normal {
    fn of(points: impl Iterator<Item = DVec2> + Clone) -> Result<Self, RegistrationError> {
        let count = points.clone().count() as f64;
        let middle = points.clone().sum::<DVec2>() / count;
        let [mut xx, mut xy, mut yy] = [0.0; 3];
        for offset in points.map(|point| point - middle) {
            xx += offset.x * offset.x;
            xy += offset.x * offset.y;
            yy += offset.y * offset.y;
        }
        // Along and across the line that fits them best: the roots of the covariance's eigenvalues.
        let (mean, half) = (0.5 * (xx + yy), (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt());
        let (along, across) = ((mean + half).sqrt(), (mean - half).max(0.0).sqrt());
        // So written that what is no number is refused.
        if across > LEAST_SPREAD * along && along.is_finite() {
            Ok(Self { middle, scale: ((xx + yy) / count).sqrt() })
        } else {
            Err(RegistrationError::Collinear)
        }
    }

    fn normalized(&self, point: DVec2) -> DVec2 {
        (point - self.middle) / self.scale
    }

    /// Back from what was normalised.
    fn matrix(&self) -> DMat3 {
        DMat3::from_translation(self.middle) * DMat3::from_scale(DVec2::splat(self.scale))
    }
}

fn shown(world_from_texture: &DMat3, texture: DVec2) -> DVec2 {
    let world = *world_from_texture * texture.extend(1.0);
    world.truncate() / world.z
}

fn column(pairs: &[(DVec2, DVec2)], of: impl Fn(DVec2, DVec2) -> f64) -> Vec<f64> {
    pairs.iter().map(|(texture, world)| of(*texture, *world)).collect()
}

fn affine(pairs: &[(DVec2, DVec2)]) -> Result<DMat3, RegistrationError> {
    let row = |axis: usize| {
        let columns =
            [column(pairs, |from, _| from.x), column(pairs, |from, _| from.y), column(pairs, |_, _| 1.0)];
        let (row, share) = least_squares(columns, column(pairs, |_, to| to[axis]));
        if share > LEAST_SHARE { Ok(DVec3::from(row)) } else { Err(RegistrationError::Undetermined) }
    };
    Ok(DMat3::from_cols(row(0)?, row(1)?, DVec3::Z).transpose())
}

/// What a homography's eight numbers (by rows, the ninth 1) each add to x and y of a point's place: of `at`, the
/// denominator being `q`.
fn rows(from: DVec2, q: f64, at: DVec2) -> [[f64; 8]; 2] {
    let DVec2 { x, y } = from / q;
    let one = 1.0 / q;
    [[x, y, one, 0.0, 0.0, 0.0, -at.x * x, -at.x * y], [0.0, 0.0, 0.0, x, y, one, -at.y * x, -at.y * y]]
}

fn solved(rows: impl Iterator<Item = ([[f64; 8]; 2], DVec2)>) -> Option<[f64; 8]> {
    let mut columns: [Vec<f64>; 8] = std::array::from_fn(|_| Vec::new());
    let mut right = Vec::new();
    for (rows, wanted) in rows {
        for (row, value) in rows.iter().zip(wanted.to_array()) {
            columns.iter_mut().zip(row).for_each(|(column, factor)| column.push(*factor));
            right.push(value);
        }
    }
    let (solution, share) = least_squares(columns, right);
    (share > LEAST_SHARE).then_some(solution)
}

fn matrix_of(h: &[f64; 8]) -> DMat3 {
    DMat3::from_cols_array(&[h[0], h[3], h[6], h[1], h[4], h[7], h[2], h[5], 1.0])
}

/// By the direct linear transformation [HZ04, 4.1.2], its last number 1 since the middle of the points lies before the
/// horizon; then on to the least squares of distances in the world, by Gauss-Newton steps that are taken while they
/// make these smaller.
fn nearest_homography(pairs: &[(DVec2, DVec2)]) -> Result<DMat3, RegistrationError> {
    let squares = |h: &[f64; 8]| -> f64 {
        let matrix = matrix_of(h);
        pairs.iter().map(|(from, to)| (shown(&matrix, *from) - *to).length_squared()).sum()
    };
    let linear = pairs.iter().map(|(from, to)| (rows(*from, 1.0, *to), *to));
    let mut best = solved(linear).ok_or(RegistrationError::Undetermined)?;
    let mut least = squares(&best);
    for _ in 0..MOST_STEPS {
        let matrix = matrix_of(&best);
        let near = pairs.iter().map(|(from, to)| {
            let at = shown(&matrix, *from);
            (rows(*from, (matrix * from.extend(1.0)).z, at), *to - at)
        });
        let Some(step) = solved(near) else { break };
        let next: [f64; 8] = std::array::from_fn(|idx| best[idx] + step[idx]);
        let fewer = squares(&next);
        // So written that what is no number ends it.
        let is_better = fewer < least;
        if !is_better {
            break;
        }
        (best, least) = (next, fewer);
    }
    Ok(matrix_of(&best))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture 200 m wide, turned and bent, at map coordinates.
    fn truth(at: DVec2) -> impl Fn(DVec2) -> DVec2 {
        move |texture: DVec2| {
            let q = 1.0 + 0.2 * texture.x - 0.1 * texture.y;
            let turned = DVec2::from_angle(0.4).rotate(DVec2::new(texture.x, -texture.y) * 200.0);
            at + turned / q
        }
    }

    fn points(n: u32, world: impl Fn(DVec2) -> DVec2) -> Vec<ControlPoint> {
        let place = |idx: u32| DVec2::new(f64::from(idx * 37 % 11) / 11.0, f64::from(idx * 53 % 7) / 7.0);
        (0..n).map(|idx| ControlPoint { texture: place(idx + 1), world: world(place(idx + 1)) }).collect()
    }

    fn worst(map: &PlaneMap, world: impl Fn(DVec2) -> DVec2) -> f64 {
        let at = |idx: u32| DVec2::new(f64::from(idx % 10), f64::from(idx / 10)) / 9.0;
        let miss = |texture: DVec2| {
            let found = map.texture_at(world(texture));
            assert!(found.z > 0.0);
            (found.truncate() / found.z - texture).length()
        };
        (0..100).map(|idx| miss(at(idx))).fold(0.0, f64::max)
    }

    #[test]
    fn points_without_error_give_the_map_back_at_any_coordinates() {
        for at in [DVec2::ZERO, DVec2::new(5e5, 5e6), DVec2::new(-1e7, 1e7)] {
            for n in [4, 6, 40] {
                let world = truth(at);
                let found = register(&points(n, &world), PlaneTransform::Homography).expect("a map");
                assert!(found.residual_m < 1e-7, "{n}: {}", found.residual_m);
                // A double resolves 2e-9 m at 1e7 m: 1e-11 of the picture.
                let miss = worst(&found.map, &world);
                assert!(miss < 1e-8, "{at} {n}: {miss}");
            }
            let flat = |texture: DVec2| at + DVec2::new(300.0 * texture.x, -200.0 * texture.y);
            let found = register(&points(3, flat), PlaneTransform::Affine).expect("a map");
            assert_eq!(found.residual_m, 0.0);
            assert!(worst(&found.map, flat) < 1e-10);
        }
    }

    #[test]
    fn the_residual_is_that_of_the_nearest_map() {
        let world = truth(DVec2::new(5e5, 5e6));
        let mut shifted = points(30, &world);
        for (idx, point) in shifted.iter_mut().enumerate() {
            point.world += DVec2::from_angle(idx as f64 * 2.4) * 0.5;
        }
        let squares = |map: &DMat3, middle: DVec2| -> f64 {
            let inverse = map.inverse();
            let miss = |point: &ControlPoint| shown(&inverse, point.texture) + middle - point.world;
            shifted.iter().map(|point| miss(point).length_squared()).sum()
        };
        for transform in [PlaneTransform::Affine, PlaneTransform::Homography] {
            let found = register(&shifted, transform).expect("a map");
            let PlaneMap { origin, matrix } = found.map;
            let least = squares(&matrix, origin);
            assert!((found.residual_m - (least / 30.0).sqrt()).abs() < 1e-9, "{transform:?}");
            // Any other map of its kind nearby is worse.
            let n_numbers = if transform == PlaneTransform::Affine { 6 } else { 8 };
            let inverse = matrix.inverse();
            for idx in 0..n_numbers {
                let (row, column) = (idx / 3, idx % 3);
                for sign in [-1e-5, 1e-5] {
                    let mut other = inverse;
                    let size = other.row(row).abs().max_element();
                    other.col_mut(column)[row] += sign * size;
                    let more = squares(&other.inverse(), origin);
                    assert!(more > least, "{transform:?} {idx}: {more} {least}");
                }
            }
        }
        let bent = register(&shifted, PlaneTransform::Homography).expect("a map");
        assert!((0.4..0.51).contains(&bent.residual_m), "{}", bent.residual_m);
        // What bends is told apart from what does not.
        let straight = register(&shifted, PlaneTransform::Affine).expect("a map");
        assert!(straight.residual_m > 2.0, "{}", straight.residual_m);
    }

    #[test]
    fn degenerate_points_are_refused() {
        let fault = |points: &[ControlPoint], transform| register(points, transform).expect_err("a refusal");
        let world = truth(DVec2::new(5e5, 5e6));
        let good = points(6, &world);
        let (affine, bent) = (PlaneTransform::Affine, PlaneTransform::Homography);
        assert_eq!(fault(&good[..2], affine), RegistrationError::TooFew { least: 3, count: 2 });
        assert_eq!(fault(&good[..3], bent), RegistrationError::TooFew { least: 4, count: 3 });
        let changed = |change: &dyn Fn(usize, &mut ControlPoint)| {
            let mut points = good.clone();
            points.iter_mut().enumerate().for_each(|(idx, point)| change(idx, point));
            points
        };
        for transform in [affine, bent] {
            let wrong =
                changed(&|idx, point| point.world.x = if idx == 3 { f64::NAN } else { point.world.x });
            assert_eq!(fault(&wrong, transform), RegistrationError::NotFinite);
            let wrong = changed(&|_, point| point.texture.y = f64::INFINITY);
            assert_eq!(fault(&wrong, transform), RegistrationError::NotFinite);
            let line = changed(&|_, point| point.texture.y = 0.3 + 2.0 * point.texture.x);
            assert_eq!(fault(&line, transform), RegistrationError::Collinear);
            let line = changed(&|idx, point| point.world = DVec2::new(5e5, 5e6) + idx as f64);
            assert_eq!(fault(&line, transform), RegistrationError::Collinear);
            let one = changed(&|_, point| point.world = DVec2::ONE);
            assert_eq!(fault(&one, transform), RegistrationError::Collinear);
            let mirrored = changed(&|_, point| point.texture.x = 1.0 - point.texture.x);
            assert_eq!(fault(&mirrored, transform), RegistrationError::Mirrored);
        }
        // Three of four on one line leave a homography open.
        let at = |x: f64, y: f64| ControlPoint { texture: DVec2::new(x, y), world: DVec2::new(x, -y) };
        let line = [at(0.0, 0.0), at(0.5, 0.0), at(1.0, 0.0), at(0.5, 1.0)];
        assert_eq!(fault(&line, bent), RegistrationError::Undetermined);
        // Corners in the wrong order fold the picture.
        let mut folded = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        (folded[0].world, folded[1].world) = (folded[1].world, folded[0].world);
        assert_eq!(fault(&folded, bent), RegistrationError::Undetermined);
    }
}
