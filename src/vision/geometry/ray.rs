//! Half-lines.

use glam::DVec3;

/// A half-line in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts, metres.
    pub origin: DVec3,
    /// Unit vector.
    pub direction: DVec3,
}

impl Ray {
    /// The point `distance_m` along the ray.
    #[must_use]
    pub fn at(&self, distance_m: f64) -> DVec3 {
        self.origin + self.direction * distance_m
    }

    /// Distance to the plane through `point` with unit `normal`, or `None` when the ray runs parallel to it
    /// (within 1e-12), away from it, or starts on it.
    #[must_use]
    pub fn distance_to_plane(&self, point: DVec3, normal: DVec3) -> Option<f64> {
        let approach = self.direction.dot(normal);
        if approach.abs() < 1e-12 {
            return None;
        }
        let distance = (point - self.origin).dot(normal) / approach;
        (distance > 0.0 && distance.is_finite()).then_some(distance)
    }
}
