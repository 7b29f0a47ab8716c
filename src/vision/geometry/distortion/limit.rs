//! Where a lens model stops being one to one: the smallest zero of its Jacobian's determinant, or its pole.
//!
//! Every bound found here errs towards the axis, so that nothing from beyond the fold is ever shown. Knows the
//! models' coefficients alone.
//!
//! For Brown-Conrady, with q the radial factor, s = r^2, and in the direction phi the tangential terms
//! a = p1 sin phi + p2 cos phi and b = p1 cos phi - p2 sin phi, the Jacobian in polar axes is
//! \[\[q + 2 s q' + 6 r a, 2 r b\], \[2 r b, q + 2 r a\]\]. As long as its determinant stays positive from the axis
//! outwards, it is positive definite.

use glam::DVec2;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Sectors in which the fold-back radius is kept, where it depends on the direction.
const N_SECTORS: usize = 128;

/// A model that folds back nearer to the axis than this is none.
const SMALLEST_REACH: f64 = 1e-3;

/// Fold-back radii beyond this one are not told apart: it lies 0.006 degrees from the picture plane.
const FARTHEST_RADIUS: f64 = 1e4;

/// Beyond which radius a distortion folds back (or its rational form has a pole). Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub struct DistortionLimit {
    max_radius: f64,
    max_theta_rad: f64,
    /// The radius for each sector of directions, the first from the x axis towards y; none where one radius
    /// holds for all.
    sectors: Option<Arc<[f64]>>,
}

impl DistortionLimit {
    /// A radius in the pinhole's picture, units of the focal length, up to which the model is one to one in every
    /// direction: what a shader may accept. Infinite for a model without a fold, and for a fisheye that sees 180
    /// degrees or more (use [`Self::max_theta_rad`]).
    #[must_use]
    pub const fn max_radius(&self) -> f64 {
        self.max_radius
    }

    /// The angle from the axis up to which the model is one to one in every direction, radians: at most pi for a
    /// fisheye and pi/2 else.
    #[must_use]
    pub const fn max_theta_rad(&self) -> f64 {
        self.max_theta_rad
    }

    /// Whether the model is one to one from the axis out to this point of the pinhole's picture.
    pub(super) fn contains(&self, point: DVec2) -> bool {
        let radius = point.length();
        if radius <= self.max_radius {
            return radius.is_finite();
        }
        let Some(sectors) = &self.sectors else { return false };
        let turn = point.y.atan2(point.x).rem_euclid(TAU) / TAU;
        let sector = (turn * N_SECTORS as f64) as usize % N_SECTORS;
        radius.is_finite() && radius <= sectors[sector]
    }

    pub(super) const fn unlimited() -> Self {
        Self { max_radius: f64::INFINITY, max_theta_rad: 0.5 * PI, sectors: None }
    }

    pub(super) fn of_fisheye(k: &[f64; 4]) -> Option<Self> {
        let slope = [1.0, 3.0 * k[0], 5.0 * k[1], 7.0 * k[2], 9.0 * k[3]];
        let max_theta_rad = root_free_reach(&slope, PI * PI)?.sqrt().min(PI);
        let max_radius = if max_theta_rad < 0.5 * PI { max_theta_rad.tan() } else { f64::INFINITY };
        (max_theta_rad >= SMALLEST_REACH).then_some(Self { max_radius, max_theta_rad, sectors: None })
    }

    pub(super) fn of_brown_conrady(k: &[f64; 8]) -> Option<Self> {
        let tangential = DVec2::new(k[3], k[2]);
        if tangential == DVec2::ZERO {
            return Self::with_radius(fold_radius(k, 0.0, 0.0)?, None);
        }
        // Within a sector a and b differ from their values in its middle by at most |p| times half its angle. The
        // determinant grows with a and falls with b^2 while both diagonal entries are positive, so its first zero
        // with the smallest a and the largest |b| lies before that of any direction in the sector.
        let half_sector = 0.5 * TAU / N_SECTORS as f64;
        let slack = tangential.length() * half_sector;
        let sectors = (0..N_SECTORS)
            .map(|sector| {
                let middle = DVec2::from_angle((2 * sector + 1) as f64 * half_sector);
                fold_radius(k, tangential.dot(middle) - slack, tangential.perp_dot(middle).abs() + slack)
            })
            .collect::<Option<Arc<[f64]>>>()?;
        let smallest = sectors.iter().copied().fold(f64::INFINITY, f64::min);
        Self::with_radius(smallest, Some(sectors))
    }

    fn with_radius(max_radius: f64, sectors: Option<Arc<[f64]>>) -> Option<Self> {
        (max_radius >= SMALLEST_REACH).then(|| Self { max_radius, max_theta_rad: max_radius.atan(), sectors })
    }
}

/// The radius of the first zero of the determinant or pole for given a and |b|; `None` when the coefficients are
/// too large for the arithmetic.
fn fold_radius(k: &[f64; 8], a: f64, b: f64) -> Option<f64> {
    let [k1, k2, _, _, k3, k4, k5, k6] = *k;
    let pole = root_free_reach(&[1.0, k4, k5, k6], FARTHEST_RADIUS * FARTHEST_RADIUS)?.sqrt();
    // Polynomials in r. With q = above / below, all is multiplied by below^3, which is positive before the pole.
    let above = [1.0, 0.0, k1, 0.0, k2, 0.0, k3];
    let below = [1.0, 0.0, k4, 0.0, k5, 0.0, k6];
    let above_slope = [0.0, 0.0, 2.0 * k1, 0.0, 4.0 * k2, 0.0, 6.0 * k3];
    let below_slope = [0.0, 0.0, 2.0 * k4, 0.0, 4.0 * k5, 0.0, 6.0 * k6];
    let below_squared = product(&below, &below);
    let along = sum(
        &sum(&product(&above, &below), &product(&above_slope, &below)),
        &sum(&product(&[-1.0], &product(&above, &below_slope)), &product(&[0.0, 6.0 * a], &below_squared)),
    );
    let across = sum(&above, &product(&[0.0, 2.0 * a], &below));
    let mixed = product(&[0.0, 0.0, -4.0 * b * b], &product(&below_squared, &below));
    let determinant = sum(&product(&along, &across), &mixed);
    Some(root_free_reach(&determinant, FARTHEST_RADIUS)?.min(pole))
}

/// How far from 0 a polynomial (constant term 1, ascending powers) certainly has no zero: a lower bound of its
/// smallest positive root, to about 1e-11 of it where the root is simple. Infinite when there is none, and
/// `farthest` when the first lies beyond. `None` when a coefficient is not finite.
///
/// Steps outwards by a length that only the falling terms could use up, and expands the polynomial anew there.
fn root_free_reach(polynomial: &[f64], farthest: f64) -> Option<f64> {
    let mut terms = polynomial.to_vec();
    let mut reach = 0.0;
    for _ in 0..256 {
        if !terms.iter().all(|term| term.is_finite()) {
            return None;
        }
        let step = safe_step(&terms);
        reach += step;
        if reach == f64::INFINITY {
            return Some(reach);
        }
        if reach >= farthest {
            return Some(farthest);
        }
        if step <= 1e-13 * reach {
            break;
        }
        expand_at(&mut terms, step);
    }
    // The expansions' rounding may have carried it over the root by a few units of the last place.
    Some(reach * (1.0 - 1e-11))
}

/// A step within which the polynomial's falling terms do not use up its constant term.
fn safe_step(terms: &[f64]) -> f64 {
    let constant = terms[0];
    if constant <= 0.0 {
        return 0.0;
    }
    let rest = |step: f64| {
        let falling = terms[1..].iter().rev().fold(0.0, |sum, term| (sum + term.min(0.0)) * step);
        constant + falling
    };
    // Where one falling term alone uses it up.
    let mut high = f64::INFINITY;
    for (power, term) in terms.iter().enumerate().skip(1).filter(|(_, term)| **term < 0.0) {
        high = high.min((constant / -term).powf(1.0 / power as f64));
    }
    if high == f64::INFINITY {
        return high;
    }
    let mut low = 0.0;
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        *(if rest(middle) > 0.0 { &mut low } else { &mut high }) = middle;
    }
    low
}

/// The polynomial's terms around `offset`, by repeated synthetic division.
fn expand_at(terms: &mut [f64], offset: f64) {
    for first in 0..terms.len() {
        for idx in (first..terms.len() - 1).rev() {
            terms[idx] += offset * terms[idx + 1];
        }
    }
}

fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut terms = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            terms[i + j] += x * y;
        }
    }
    terms
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    let term = |terms: &[f64], idx: usize| terms.get(idx).copied().unwrap_or(0.0);
    (0..a.len().max(b.len())).map(|idx| term(a, idx) + term(b, idx)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reach_is_the_first_root_and_never_beyond() {
        let check = |polynomial: &[f64], expected: f64| {
            let reach = root_free_reach(polynomial, 1e6).expect("finite terms");
            assert!(reach <= expected, "{polynomial:?}: {reach} > {expected}");
            assert!(reach >= expected * (1.0 - 1e-9), "{polynomial:?}: {reach} < {expected}");
        };
        check(&[1.0, -1.0], 1.0);
        check(&[1.0, 0.0, -0.25], 2.0);
        // (1 - x) (1 - x / 1.01) (1 + x^2): two close roots.
        check(&product(&product(&[1.0, -1.0], &[1.0, -1.0 / 1.01]), &[1.0, 0.0, 1.0]), 1.0);
        check(&product(&[1.0, -1.0 / 300.0], &[1.0, 2.0, 5.0]), 300.0);
        assert_eq!(root_free_reach(&[1.0, 3.0, 0.0, 2.0], 10.0), Some(f64::INFINITY));
        assert_eq!(root_free_reach(&[1.0, -1e-3], 10.0), Some(10.0));
        assert_eq!(root_free_reach(&[1.0, f64::NAN], 10.0), None);
        // A double root is no sign change, but nothing beyond it may count as reached without a step over it.
        assert!(root_free_reach(&[1.0, -2.0, 1.0], 10.0).expect("finite") <= 1.0 + 1e-6);
    }

    #[test]
    fn barrel_folds_where_the_book_says() {
        // g = r (1 + k1 r^2): g' = 0 at 1 / sqrt(-3 k1).
        let limit =
            DistortionLimit::of_brown_conrady(&[-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).expect("a limit");
        assert!((limit.max_radius() - 1.0 / 0.9_f64.sqrt()).abs() < 1e-9);
        assert!((limit.max_theta_rad() - limit.max_radius().atan()).abs() < 1e-15);
        // q = 1 / (1 - s): pole at 1, and it only grows before.
        let pole =
            DistortionLimit::of_brown_conrady(&[0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0]).expect("a limit");
        assert!((pole.max_radius() - 1.0).abs() < 1e-9 && pole.max_radius() <= 1.0);
        // theta_d = theta (1 - 0.1 theta^2): fold at sqrt(1 / 0.3).
        let fisheye = DistortionLimit::of_fisheye(&[-0.1, 0.0, 0.0, 0.0]).expect("a limit");
        assert!((fisheye.max_theta_rad() - (1.0 / 0.3_f64).sqrt()).abs() < 1e-9);
        assert_eq!(DistortionLimit::of_fisheye(&[0.0; 4]).expect("a limit").max_theta_rad(), PI);
        assert_eq!(DistortionLimit::of_brown_conrady(&[0.1; 8].map(|_| 0.0)).map(|l| l.max_radius()), {
            Some(f64::INFINITY)
        });
        assert_eq!(DistortionLimit::of_brown_conrady(&[-1e9, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), None);
        assert_eq!(DistortionLimit::of_brown_conrady(&[1e300; 8]), None);
    }

    #[test]
    fn tangential_terms_move_the_radius_with_the_direction() {
        // Along -x: 1 - 6 p2 r = 0.
        let limit =
            DistortionLimit::of_brown_conrady(&[0.0, 0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 0.0]).expect("a limit");
        let fold = 1.0 / 0.3;
        assert!(limit.max_radius() <= fold && limit.max_radius() > 0.95 * fold);
        assert!(limit.contains(DVec2::new(fold * 1.5, 0.0)));
        assert!(!limit.contains(DVec2::new(-fold * 1.001, 0.0)));
        assert!(!limit.contains(DVec2::new(f64::NAN, 0.0)) && !limit.contains(DVec2::INFINITY));
    }
}
