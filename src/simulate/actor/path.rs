//! Smooth curves on the ground, open or closed, measured along their length.
//!
//! Owns the curve and its arc length; knows nothing of who moves along it, or when.
//!
//! `[CR74]` Catmull and Rom 1974, A class of local interpolating splines.

use glam::DVec2;

/// Points of the arc-length table for each corner. At 256 the speed is constant to within 0.5 % even past a
/// square's corners.
const STEPS_PER_CORNER: usize = 256;

/// A Catmull-Rom curve through given corners.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    corners: Vec<DVec2>,
    course: Course,
    /// Arc length from the first corner to each step, metres; one more entry than there are steps.
    length_to_step_m: Vec<f64>,
}

/// What lies after the last corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Course {
    /// The first.
    Closed,
    /// Nothing.
    Open,
}

/// Where something is on a path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathPoint {
    /// Place on the ground, metres.
    pub(crate) position: DVec2,
    /// Unit vector of the direction of travel.
    pub(crate) heading: DVec2,
}

impl Path {
    /// The curve through `corners` and back to the first, which needs three; `None` with fewer, or where it has no
    /// length worth the name (less than 1 mm).
    pub(crate) fn closed(corners: Vec<DVec2>) -> Option<Self> {
        (corners.len() >= 3).then(|| Self::measured(corners, Course::Closed)).flatten()
    }

    /// The curve from the first corner to the last, which needs two; `None` as for [`Self::closed`].
    pub(crate) fn open(corners: Vec<DVec2>) -> Option<Self> {
        (corners.len() >= 2).then(|| Self::measured(corners, Course::Open)).flatten()
    }

    fn measured(corners: Vec<DVec2>, course: Course) -> Option<Self> {
        let mut path = Self { corners, course, length_to_step_m: vec![0.0] };
        let n_steps = path.n_spans() * STEPS_PER_CORNER;
        let (mut length, mut before) = (0.0, path.corners[0]);
        for step in 1..=n_steps {
            let (here, _) = path.evaluate(step as f64 / STEPS_PER_CORNER as f64);
            length += (here - before).length();
            path.length_to_step_m.push(length);
            before = here;
        }
        (length.is_finite() && length >= 1e-3).then_some(path)
    }

    const fn is_closed(&self) -> bool {
        matches!(self.course, Course::Closed)
    }

    const fn n_spans(&self) -> usize {
        if self.is_closed() { self.corners.len() } else { self.corners.len() - 1 }
    }

    /// Length of the whole curve, metres.
    pub(crate) fn length_m(&self) -> f64 {
        self.length_to_step_m[self.length_to_step_m.len() - 1]
    }

    /// The point `travelled_m` along the curve; beyond its ends a closed one repeats and an open one goes on
    /// straight.
    pub(crate) fn at(&self, travelled_m: f64) -> PathPoint {
        let length = self.length_m();
        let within =
            if self.is_closed() { travelled_m.rem_euclid(length) } else { travelled_m.clamp(0.0, length) };
        let last_step = self.length_to_step_m.len() - 2;
        let step = self.length_to_step_m.partition_point(|length| *length <= within).saturating_sub(1);
        let step = step.min(last_step);
        let (from, to) = (self.length_to_step_m[step], self.length_to_step_m[step + 1]);
        let share = if to > from { ((within - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
        let (position, velocity) = self.evaluate((step as f64 + share) / STEPS_PER_CORNER as f64);
        let heading = velocity.normalize_or(DVec2::X);
        if self.is_closed() {
            return PathPoint { position, heading };
        }
        PathPoint { position: position + heading * (travelled_m - within), heading }
    }

    /// Place and derivative at `parameter`, whose whole part is the corner and whose rest the way to the next.
    fn evaluate(&self, parameter: f64) -> (DVec2, DVec2) {
        let n = self.corners.len();
        let span = parameter.floor().clamp(0.0, f64::from(u32::MAX));
        let span = if self.is_closed() { span } else { span.min((self.n_spans() - 1) as f64) };
        let t = parameter - span;
        let corner = span as usize;
        let [a, b, c, d] = if self.is_closed() {
            [n - 1, 0, 1, 2].map(|offset| self.corners[(corner + offset) % n])
        } else {
            // Beyond its ends an open curve is mirrored at the end.
            let at = |idx: usize| self.corners[idx];
            let before = if corner == 0 { at(0) * 2.0 - at(1) } else { at(corner - 1) };
            let after = if corner + 2 < n { at(corner + 2) } else { at(n - 1) * 2.0 - at(n - 2) };
            [before, at(corner), at(corner + 1), after]
        };
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

    fn corners() -> Vec<DVec2> {
        [[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]].map(DVec2::from_array).to_vec()
    }

    #[test]
    fn speed_is_constant_and_closed_curves_close() {
        for path in [Path::closed(corners()).unwrap(), Path::open(corners()).unwrap()] {
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
    }

    #[test]
    fn laps_repeat() {
        let path = Path::closed(corners()).unwrap();
        for travelled in [0.0, 3.3, 20.0] {
            let (first, third) = (path.at(travelled), path.at(travelled + 2.0 * path.length_m()));
            assert!((first.position - third.position).length() < 1e-9, "{travelled}");
            assert!((path.at(travelled - path.length_m()).position - first.position).length() < 1e-9);
        }
        assert_eq!(path.at(0.0).position, DVec2::ZERO);
    }

    #[test]
    fn open_curves_go_on_straight_beyond_their_ends() {
        let path = Path::open(vec![DVec2::ZERO, DVec2::new(3.0, 4.0)]).unwrap();
        assert!((path.length_m() - 5.0).abs() < 1e-9);
        let check = |travelled: f64, x: f64, y: f64| {
            let at = path.at(travelled);
            assert!((at.position - DVec2::new(x, y)).length() < 1e-9, "{travelled}: {}", at.position);
            assert!((at.heading - DVec2::new(0.6, 0.8)).length() < 1e-9);
        };
        check(0.0, 0.0, 0.0);
        check(2.5, 1.5, 2.0);
        check(5.0, 3.0, 4.0);
        check(-5.0, -3.0, -4.0);
        check(10.0, 6.0, 8.0);
    }

    #[test]
    fn curves_without_length_are_refused() {
        assert!(Path::closed(vec![DVec2::ONE; 5]).is_none());
        assert!(Path::open(vec![DVec2::ONE; 2]).is_none());
        assert!(Path::closed(corners()[..2].to_vec()).is_none());
        assert!(Path::open(corners()[..1].to_vec()).is_none());
        assert!(Path::open(vec![DVec2::ZERO, DVec2::splat(f64::INFINITY)]).is_none());
    }
}
