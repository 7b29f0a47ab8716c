//! How somebody moves over the ground: a Kalman filter of constant velocity over the plane, whose covariance lies any
//! way. `[BLK01]` Bar-Shalom, Li, Kirubarajan 2001, Estimation with Applications to Tracking and Navigation, sections
//! 5.2 and 6.2.2.
//!
//! The library's filter that `track` uses is one of fixed axes; this one keeps four blocks of two by two.

use super::Velocity;
use super::estimate::Foot;
use glam::{DMat2, DVec2};

/// Noise of acceleration, m^2/s^3: people start, stop and turn.
const ACCELERATION: f64 = 1.0;

/// Standard deviation of the velocity of who was seen once, metres a second.
pub(super) const FIRST_VELOCITY: f64 = 1.5;

/// What calibrations err by whatever is averaged, standard deviation, metres.
const BIAS_M: f64 = 0.1;

/// Where somebody is and how fast they go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Walk {
    at: DVec2,
    velocity: DVec2,
    /// Covariance of the place, of place and velocity, of the velocity.
    place: DMat2,
    cross: DMat2,
    pace: DMat2,
}

fn round(variance: f64) -> DMat2 {
    DMat2::from_diagonal(DVec2::splat(variance))
}

impl Walk {
    /// Somebody seen for the first time.
    pub(super) fn new(foot: &Foot) -> Self {
        Self {
            at: foot.at,
            velocity: DVec2::ZERO,
            place: foot.covariance,
            cross: DMat2::ZERO,
            pace: round(FIRST_VELOCITY.powi(2)),
        }
    }

    /// Lets time pass, either way.
    pub(super) fn pass(&mut self, secs: f64) {
        let noise = ACCELERATION * secs.abs();
        // [BLK01] eq. 6.2.2-12.
        self.place += (self.cross + self.cross.transpose()) * secs
            + self.pace * secs.powi(2)
            + round(noise * secs.powi(2) / 3.0);
        self.cross += self.pace * secs + round(0.5 * noise * secs);
        self.pace += round(noise);
        self.at += self.velocity * secs;
    }

    /// Takes in where they were seen.
    pub(super) fn correct(&mut self, seen: &Foot) {
        let gain = (self.place + seen.covariance).inverse();
        let (of_place, of_pace) = (self.place * gain, self.cross.transpose() * gain);
        let off = seen.at - self.at;
        self.at += of_place * off;
        self.velocity += of_pace * off;
        self.pace -= of_pace * self.cross;
        self.cross -= of_place * self.cross;
        self.place -= of_place * self.place;
        // Rounding must not turn it.
        self.place = (self.place + self.place.transpose()) * 0.5;
        self.pace = (self.pace + self.pace.transpose()) * 0.5;
    }

    /// Returns the same with where they were seen taken in.
    pub(super) fn corrected(mut self, seen: &Foot) -> Self {
        self.correct(seen);
        self
    }

    /// How fast they go.
    pub(super) fn velocity(&self) -> Velocity {
        // The greater of the two eigenvalues.
        let (a, b, d) = (self.pace.x_axis.x, self.pace.x_axis.y, self.pace.y_axis.y);
        let variance = f64::midpoint(a, d) + (0.5 * (a - d)).hypot(b);
        Velocity { over_ground_m_per_s: self.velocity, sd_m_per_s: variance.max(0.0).sqrt() }
    }

    /// Where they are.
    pub(super) fn foot(&self) -> Foot {
        Foot::new(self.at, self.place + round(BIAS_M.powi(2)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_walk_is_foreseen_over_a_gap() {
        let foot = |x: f64| Foot::new(DVec2::new(x, 2.0), DMat2::from_cols_array(&[0.04, 0.03, 0.03, 0.09]));
        let mut walk = Walk::new(&foot(0.0));
        for step in 1..=20 {
            walk.pass(0.1);
            walk.correct(&foot(0.14 * f64::from(step)));
        }
        let velocity = walk.velocity();
        assert!((velocity.over_ground_m_per_s - DVec2::new(1.4, 0.0)).length() < 0.1, "{velocity:?}");
        assert!(velocity.sd_m_per_s > 0.1 && velocity.sd_m_per_s < 0.7, "{velocity:?}");
        let before = walk.foot();
        walk.pass(2.0);
        let after = walk.foot();
        assert!((after.at - DVec2::new(5.6, 2.0)).length() < 0.4, "{}", after.at);
        assert!(after.covariance.determinant() > 4.0 * before.covariance.determinant());
        walk.pass(-2.0);
        assert!((walk.foot().at - before.at).length() < 1e-9, "time may run back");
    }

    #[test]
    fn hours_without_a_sight_and_unknown_feet_leave_it_sound() {
        let mut walk = Walk::new(&Foot::new(DVec2::new(5e5, 5e6), round(f64::NAN)));
        for _ in 0..1000 {
            walk.pass(60.0);
            walk.correct(&Foot::new(DVec2::new(5e5, 5e6), round(f64::INFINITY)));
        }
        assert!((walk.foot().at - DVec2::new(5e5, 5e6)).length() < 1.0 && walk.foot().covariance.is_finite());
        let velocity = walk.velocity();
        assert!(velocity.over_ground_m_per_s.is_finite() && velocity.sd_m_per_s.is_finite(), "{velocity:?}");
    }
}
