//! Limbs that more than one kind of actor has: bones between joints, the directions in which a body is built.

use super::super::shape::{Part, Shape};
use glam::{DVec2, DVec3};

/// The perpendicular unit vectors in which a body is built.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes {
    pub(super) forward: DVec3,
    pub(super) left: DVec3,
    pub(super) up: DVec3,
}

impl Axes {
    /// Upright axes.
    pub(super) fn along(heading: DVec2) -> Self {
        Self { forward: heading.extend(0.0), left: heading.perp().extend(0.0), up: DVec3::Z }
    }

    /// Axes of what stands on a slope: `forward` and `left` need only be about perpendicular.
    pub(super) fn on_slope(forward: DVec3, left: DVec3) -> Self {
        let forward = forward.normalize_or(DVec3::X);
        let up = forward.cross(left).normalize_or(DVec3::Z);
        Self { forward, left: up.cross(forward), up }
    }

    pub(super) const fn columns(self) -> [DVec3; 3] {
        [self.forward, self.left, self.up]
    }

    /// `from` moved along the axes.
    pub(super) fn at(self, from: DVec3, forward: f64, left: f64, up: f64) -> DVec3 {
        from + self.forward * forward + self.left * left + self.up * up
    }
}

/// A round bone.
pub(super) const fn bone(from: DVec3, to: DVec3, radius_m: f64, color: DVec3) -> Part {
    Part { shape: Shape::Capsule { from, to, radius_m }, color }
}

/// The joint of two bones between `hip` and `ankle`, bent forward. Where the ankle is out of reach the bones lie
/// straight and the shin ends short of it by what is missing.
pub(super) fn knee(hip: DVec3, ankle: DVec3, forward: DVec3, thigh_m: f64, shin_m: f64) -> DVec3 {
    let reach = (ankle - hip).length().clamp(1e-6, (thigh_m + shin_m) * 0.9999);
    let along = (ankle - hip).normalize_or(-DVec3::Z);
    // The triangle's foot and height over the line from hip to ankle.
    let foot = (reach * reach + thigh_m * thigh_m - shin_m * shin_m) / (2.0 * reach);
    let height = (thigh_m * thigh_m - foot * foot).max(0.0).sqrt();
    let bend = (forward - along * forward.dot(along)).normalize_or(forward);
    hip + along * foot + bend * height
}
