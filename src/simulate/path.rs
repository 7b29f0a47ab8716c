//! Closed smooth curves on the ground, walked at constant speed.
//!
//! Owns the curve and its arc length; knows nothing of who walks it.
//!
//! `[CR74]` Catmull and Rom 1974, A class of local interpolating splines.

use glam::DVec2;

/// Points of the arc-length table for each corner. At 256 the speed is constant to within 0.5 % even past a
/// square's corners.
const STEPS_PER_CORNER: usize = 256;

/// A closed Catmull-Rom curve through given corners.
#[derive(Clone, Debug)]
pub(super) struct ClosedPath {
    corners: Vec<DVec2>,
    /// Arc length from the first corner to each step, metres; one more entry than there are steps.
    length_to_step_m: Vec<f64>,
}

/// Where a walker is on a path.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathPoint {
    /// Place on the ground, metres.
    pub(super) position: DVec2,
    /// Unit vector of the direction walked.
    pub(super) heading: DVec2,
}

impl ClosedPath {
    /// The curve through `corners`, back to the first after the last.
    ///
    /// # Panics
    /// With fewer than three corners, which is a fault of the world's own numbers.
    pub(super) fn new(corners: Vec<DVec2>) -> Self {
        assert!(corners.len() >= 3, "a closed path needs at least three corners");
        let mut path = Self { corners, length_to_step_m: vec![0.0] };
        let n_steps = path.corners.len() * STEPS_PER_CORNER;
        let (mut length, mut before) = (0.0, path.corners[0]);
        for step in 1..=n_steps {
            let (here, _) = path.evaluate(step as f64 / STEPS_PER_CORNER as f64);
            length += (here - before).length();
            path.length_to_step_m.push(length);
            before = here;
        }
        path
    }

    /// Length of one lap, metres.
    pub(super) fn length_m(&self) -> f64 {
        self.length_to_step_m[self.length_to_step_m.len() - 1]
    }

    /// The point `travelled_m` along the curve; laps beyond the first repeat it.
    pub(super) fn at(&self, travelled_m: f64) -> PathPoint {
        let wrapped = travelled_m.rem_euclid(self.length_m());
        let last_step = self.length_to_step_m.len() - 2;
        let step = self.length_to_step_m.partition_point(|length| *length <= wrapped).saturating_sub(1);
        let step = step.min(last_step);
        let (from, to) = (self.length_to_step_m[step], self.length_to_step_m[step + 1]);
        let share = if to > from { ((wrapped - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
        let (position, velocity) = self.evaluate((step as f64 + share) / STEPS_PER_CORNER as f64);
        PathPoint { position, heading: velocity.normalize_or(DVec2::X) }
    }

    /// Place and derivative at `parameter`, whose whole part is the corner and whose rest the way to the next.
    fn evaluate(&self, parameter: f64) -> (DVec2, DVec2) {
        let n = self.corners.len();
        let corner = parameter.floor();
        let t = parameter - corner;
        let corner = corner as usize;
        let [a, b, c, d] = [n - 1, 0, 1, 2].map(|offset| self.corners[(corner + offset) % n]);
        // [CR74] with tension 1/2, in powers of t.
        let (linear, square, cube) =
            ((c - a) * 0.5, a - b * 2.5 + c * 2.0 - d * 0.5, (d - a) * 0.5 + (b - c) * 1.5);
        let position = b + (linear + (square + cube * t) * t) * t;
        let velocity = linear + (square * 2.0 + cube * (3.0 * t)) * t;
        (position, velocity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> ClosedPath {
        ClosedPath::new(vec![
            DVec2::new(0.0, 0.0),
            DVec2::new(8.0, 0.0),
            DVec2::new(8.0, 6.0),
            DVec2::new(0.0, 6.0),
        ])
    }

    #[test]
    fn speed_is_constant_and_the_curve_closes() {
        let path = square();
        let n = 1000;
        let step = path.length_m() / f64::from(n);
        for i in 0..n {
            let (here, next) = (path.at(f64::from(i) * step), path.at(f64::from(i + 1) * step));
            let walked = (next.position - here.position).length();
            assert!((walked / step - 1.0).abs() < 0.005, "step {i}: {walked} of {step}");
            let turned = here.heading.angle_to(next.heading).abs();
            assert!(turned < 0.05, "step {i} turns {turned}");
        }
    }

    #[test]
    fn laps_repeat() {
        let path = square();
        for travelled in [0.0, 3.3, 20.0] {
            let (first, third) = (path.at(travelled), path.at(travelled + 2.0 * path.length_m()));
            assert!((first.position - third.position).length() < 1e-9, "{travelled}");
            assert!((path.at(travelled - path.length_m()).position - first.position).length() < 1e-9);
        }
        assert_eq!(path.at(0.0).position, DVec2::ZERO);
    }
}
