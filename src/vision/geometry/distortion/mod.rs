//! Lens distortion: from the pinhole's picture to the lens's and back.
//!
//! Owns the two models' formulas and their inversion; `limit` owns where they stop being one to one. Works in
//! units of the focal length from the principal point and knows neither pixels nor poses.
//!
//! \[Brown66\] Brown 1966, Decentering distortion of lenses; the form and the order of its coefficients are
//! `OpenCV`'s (calib3d, detailed description). \[KB06\] Kannala and Brandt 2006, A generic camera model and
//! calibration method for conventional, wide-angle, and fish-eye lenses; again in `OpenCV`'s form (fisheye).

mod limit;

use super::NEAR_M;
use glam::{DMat2, DVec2, DVec3};

pub use limit::DistortionLimit;

/// How the lens bends what a pinhole would show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// A pinhole.
    None,
    /// Brown-Conrady: radial k1, k2, k3, tangential p1, p2, and the rational model's denominator k4, k5, k6,
    /// in OpenCV's order k1 k2 p1 p2 k3 k4 k5 k6.
    BrownConrady {
        /// k1 k2 p1 p2 k3 k4 k5 k6.
        coefficients: [f64; 8],
    },
    /// Kannala-Brandt fisheye (OpenCV's): `theta_d` = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).
    Fisheye {
        /// k1 k2 k3 k4.
        coefficients: [f64; 4],
    },
}

/// How far an undistorted point may miss when it is distorted again, relative to 1 + its radius. A thousandth of
/// a pixel at the longest focal length that a camera may have.
const ROUND_TRIP: f64 = 1e-10;

/// Radius of the search for what a model without a limit shows at some place; 1e-7 rad from the picture plane.
const FARTHEST_RADIUS: f64 = 1e7;

impl Distortion {
    /// Whether every coefficient is a finite number.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        match self {
            Self::None => true,
            Self::BrownConrady { coefficients } => coefficients.iter().all(|k| k.is_finite()),
            Self::Fisheye { coefficients } => coefficients.iter().all(|k| k.is_finite()),
        }
    }

    /// The region in which the distortion is one to one, or `None` if there is none worth the name (less than a
    /// thousandth of the focal length around the axis).
    ///
    /// **Cost**: some microseconds, with tangential terms up to a millisecond; found once per camera.
    #[must_use]
    pub fn limit(&self) -> Option<DistortionLimit> {
        match self {
            Self::None => Some(DistortionLimit::unlimited()),
            Self::BrownConrady { coefficients } => DistortionLimit::of_brown_conrady(coefficients),
            Self::Fisheye { coefficients } => DistortionLimit::of_fisheye(coefficients),
        }
    }

    /// Where the lens shows a point in the camera's axes, in units of the focal length from the principal point.
    ///
    /// `None` where it shows it nowhere: not further than [`NEAR_M`] along the axis (a fisheye: from its centre),
    /// or beyond `limit`, where the formula has folded back.
    #[must_use]
    pub fn distort_direction(&self, point: DVec3, limit: &DistortionLimit) -> Option<DVec2> {
        if let Self::Fisheye { coefficients } = self {
            return distort_fisheye(coefficients, point, limit.max_theta_rad());
        }
        // Tested before dividing.
        if point.z.is_nan() || point.z <= NEAR_M {
            return None;
        }
        let pinhole = point.truncate() / point.z;
        if !limit.contains(pinhole) {
            return None;
        }
        let shown = match self {
            Self::BrownConrady { coefficients } => brown_conrady(coefficients, pinhole),
            Self::None | Self::Fisheye { .. } => pinhole,
        };
        // A point at an absurd distance overflows the polynomials.
        shown.is_finite().then_some(shown)
    }

    /// The direction (not normalised) in the camera's axes that the lens shows at `distorted`.
    ///
    /// `None` where it shows none: beyond the picture of `limit`, or where the inversion's round trip fails.
    #[must_use]
    pub fn undistort_to_direction(&self, distorted: DVec2, limit: &DistortionLimit) -> Option<DVec3> {
        if !distorted.is_finite() {
            return None;
        }
        match self {
            Self::None => Some(distorted.extend(1.0)),
            Self::BrownConrady { coefficients } => {
                Some(undistort_brown_conrady(coefficients, distorted, limit)?.extend(1.0))
            }
            Self::Fisheye { coefficients } => {
                undistort_fisheye(coefficients, distorted, limit.max_theta_rad())
            }
        }
    }
}

/// \[KB06\] eq. 6 with theta against the axis, never z alone: beyond 180 degrees of view z is not positive.
fn distort_fisheye(k: &[f64; 4], point: DVec3, max_theta_rad: f64) -> Option<DVec2> {
    if !point.is_finite() || point.length() <= NEAR_M {
        return None;
    }
    let across = point.truncate();
    let radius = across.length();
    let theta = radius.atan2(point.z);
    // At pi exactly the point lies behind on the axis and has no direction across it.
    if theta >= max_theta_rad {
        return None;
    }
    if radius == 0.0 {
        return Some(DVec2::ZERO);
    }
    Some(across * (fisheye_theta(k, theta).0 / radius))
}

fn undistort_fisheye(k: &[f64; 4], distorted: DVec2, max_theta_rad: f64) -> Option<DVec3> {
    let radius = distorted.length();
    if radius == 0.0 {
        return Some(DVec3::Z);
    }
    let theta = invert_increasing(|theta| fisheye_theta(k, theta), radius, max_theta_rad)?;
    if (fisheye_theta(k, theta).0 - radius).abs() > ROUND_TRIP * (1.0 + radius) {
        return None;
    }
    let (sine, cosine) = theta.sin_cos();
    Some((distorted * (sine / radius)).extend(cosine))
}

/// The distorted angle and its derivative.
fn fisheye_theta(k: &[f64; 4], theta: f64) -> (f64, f64) {
    let t = theta * theta;
    let value = theta * (1.0 + t * (k[0] + t * (k[1] + t * (k[2] + t * k[3]))));
    let slope = 1.0 + t * (3.0 * k[0] + t * (5.0 * k[1] + t * (7.0 * k[2] + t * 9.0 * k[3])));
    (value, slope)
}

/// The radial factor q = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3) and dq/ds, s = r^2.
fn radial_factor(k: &[f64; 8], s: f64) -> (f64, f64) {
    let [k1, k2, _, _, k3, k4, k5, k6] = *k;
    let above = 1.0 + s * (k1 + s * (k2 + s * k3));
    let below = 1.0 + s * (k4 + s * (k5 + s * k6));
    let above_slope = k1 + s * (2.0 * k2 + s * 3.0 * k3);
    let below_slope = k4 + s * (2.0 * k5 + s * 3.0 * k6);
    (above / below, (above_slope * below - above * below_slope) / (below * below))
}

/// \[Brown66\] in `OpenCV`'s form.
fn brown_conrady(k: &[f64; 8], point: DVec2) -> DVec2 {
    let [_, _, p1, p2, ..] = *k;
    let (x, y) = (point.x, point.y);
    let s = point.length_squared();
    let (q, _) = radial_factor(k, s);
    DVec2::new(
        x * q + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
        y * q + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
    )
}

/// The Jacobian of [`brown_conrady`]; symmetric, as the distortion is the gradient of a potential.
fn brown_conrady_jacobian(k: &[f64; 8], point: DVec2) -> DMat2 {
    let [_, _, p1, p2, ..] = *k;
    let (x, y) = (point.x, point.y);
    let (q, slope) = radial_factor(k, point.length_squared());
    let mixed = 2.0 * (slope * x * y + p1 * x + p2 * y);
    DMat2::from_cols(
        DVec2::new(q + 2.0 * (slope * x * x + p1 * y + 3.0 * p2 * x), mixed),
        DVec2::new(mixed, q + 2.0 * (slope * y * y + 3.0 * p1 * y + p2 * x)),
    )
}

fn undistort_brown_conrady(k: &[f64; 8], distorted: DVec2, limit: &DistortionLimit) -> Option<DVec2> {
    let target = distorted.length();
    if target == 0.0 {
        return Some(DVec2::ZERO);
    }
    let radial = |radius: f64| {
        let s = radius * radius;
        let (q, slope) = radial_factor(k, s);
        (radius * q, q + 2.0 * slope * s)
    };
    let is_radial = k[2] == 0.0 && k[3] == 0.0;
    let reach = limit.max_radius();
    let point = match invert_increasing(radial, target, reach) {
        Some(radius) => distorted * (radius / target),
        // The tangential terms may carry a point further out than the radial ones alone.
        None if !is_radial && reach.is_finite() => distorted * (0.999 * reach / target),
        None => return None,
    };
    let point = if is_radial { point } else { refine(k, point, distorted, limit)? };
    let miss = (brown_conrady(k, point) - distorted).length();
    (limit.contains(point) && miss <= ROUND_TRIP * (1.0 + target)).then_some(point)
}

/// Newton in two dimensions with halved steps. Within the disc of `limit.max_radius()` the Jacobian is positive
/// definite, so every step points downhill and the point that is found is the only one.
fn refine(k: &[f64; 8], start: DVec2, distorted: DVec2, limit: &DistortionLimit) -> Option<DVec2> {
    let mut point = start;
    let mut error = brown_conrady(k, point) - distorted;
    for _ in 0..50 {
        let jacobian = brown_conrady_jacobian(k, point);
        let determinant = jacobian.determinant();
        if determinant.is_nan() || determinant <= 0.0 {
            return None;
        }
        let step = jacobian.inverse() * error;
        let halved = (0..40).map(|n| point - step * 0.5_f64.powi(n)).find_map(|candidate| {
            let candidate_error = brown_conrady(k, candidate) - distorted;
            (limit.contains(candidate) && candidate_error.length() < error.length())
                .then_some((candidate, candidate_error))
        });
        // No step comes closer: the point is as good as rounding allows, or there is none. The caller's round
        // trip tells which.
        let Some((candidate, candidate_error)) = halved else { break };
        (point, error) = (candidate, candidate_error);
    }
    Some(point)
}

/// The x in [0, `farthest`] at which an increasing function with f(0) = 0 takes the value `target`, by Newton's
/// method held in a bracket; `function` answers value and slope. `None` when the function stays below `target`.
fn invert_increasing(function: impl Fn(f64) -> (f64, f64), target: f64, farthest: f64) -> Option<f64> {
    let mut low = 0.0;
    let mut high = if farthest.is_finite() { farthest } else { target.clamp(1.0, FARTHEST_RADIUS) };
    while function(high).0 < target {
        if farthest.is_finite() || high >= FARTHEST_RADIUS {
            return None;
        }
        (low, high) = (high, high * 2.0);
    }
    let mut x = target.clamp(low, high);
    for _ in 0..200 {
        let (value, slope) = function(x);
        // Not `value >= target`: a value that overflowed to NaN lies above as well.
        if value < target {
            low = x;
        } else {
            high = x;
        }
        let newton = x - (value - target) / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - x).abs() <= 1e-16 * (1.0 + x) {
            return Some(next);
        }
        x = next;
    }
    Some(x)
}

#[cfg(test)]
mod tests;
