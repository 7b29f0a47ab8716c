//! Lens distortion: from the pinhole's picture to the lens's and back.

use super::NEAR_M;
use glam::{DVec2, DVec3};

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

/// Beyond which radius a distortion folds back (or its rational form has a pole).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistortionLimit {}

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

    /// The region in which the distortion is one to one, or `None` if there is none worth the name.
    #[must_use]
    pub fn limit(&self) -> Option<DistortionLimit> {
        Some(DistortionLimit {})
    }

    /// Where the lens shows a point in the camera's axes, in units of the focal length from the principal point.
    #[must_use]
    pub fn distort_direction(&self, point: DVec3, limit: &DistortionLimit) -> Option<DVec2> {
        let DistortionLimit {} = limit;
        (point.z > NEAR_M).then(|| point.truncate() / point.z)
    }

    /// The direction (not normalised) in the camera's axes that the lens shows at `distorted`.
    #[must_use]
    pub fn undistort_to_direction(&self, distorted: DVec2, limit: &DistortionLimit) -> Option<DVec3> {
        let DistortionLimit {} = limit;
        distorted.is_finite().then(|| distorted.extend(1.0))
    }
}
