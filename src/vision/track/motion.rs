//! How a place moves along one axis: a constant-velocity Kalman filter.
//!
//! `[BLK01]` Bar-Shalom, Li and Kirubarajan 2001, Estimation with Applications to Tracking and Navigation, section
//! 6.2.2: the discretised continuous white-noise acceleration model. Both axes move independently, so each has a
//! filter of two states. The filter is the library's; tracks keep only its numbers, and one filter serves them all.

use minikalman::prelude::*;
use minikalman::regular::builder::{KalmanFilterBuilder, KalmanFilterObservationType, KalmanFilterType};
use std::fmt;

/// Place and velocity along one axis, with their covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    /// Pixels and pixels a second.
    state: [f64; 2],
    /// Of the state, row-major: pixels squared, a second, a second squared.
    covariance: [f64; 4],
}

impl Axis {
    /// A place seen for the first time, of which no velocity is known.
    pub(super) const fn new(position_px: f64, variance_px2: f64, velocity_variance: f64) -> Self {
        Self { state: [position_px, 0.0], covariance: [variance_px2, 0.0, 0.0, velocity_variance] }
    }

    /// Where it is, pixels.
    pub(super) const fn position_px(&self) -> f64 {
        self.state[0]
    }

    /// How fast it moves, pixels a second.
    pub(super) const fn velocity_px_per_sec(&self) -> f64 {
        self.state[1]
    }

    /// Variance of the place, pixels squared.
    pub(super) const fn variance_px2(&self) -> f64 {
        self.covariance[0]
    }

    /// Moves the place without a change of what is known of its motion: another point of the same thing.
    pub(super) const fn shift(&mut self, by_px: f64) {
        self.state[0] += by_px;
    }
}

/// The filter through which every axis of every track goes.
pub(super) struct Motion {
    filter: KalmanFilterType<2, f64>,
    sighting: KalmanFilterObservationType<2, 1, f64>,
}

impl fmt::Debug for Motion {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Motion").finish_non_exhaustive()
    }
}

impl Motion {
    pub(super) fn new() -> Self {
        let builder = KalmanFilterBuilder::<2, f64>::new();
        let (mut filter, mut sighting) = (builder.build(), builder.observations().build::<1>());
        filter.state_transition_mut().make_identity();
        sighting.observation_matrix_mut().set_at(0, 0, 1.0);
        sighting.observation_matrix_mut().set_at(0, 1, 0.0);
        Self { filter, sighting }
    }

    /// Lets `dt_secs` pass, 0 or more; `density` is the acceleration's noise, pixels squared a second cubed.
    pub(super) fn predict(&mut self, axis: &mut Axis, dt_secs: f64, density: f64) {
        self.load(axis);
        self.filter.state_transition_mut().set_at(0, 1, dt_secs);
        // [BLK01] eq. 6.2.2-12.
        let noise = [dt_secs.powi(3) / 3.0, dt_secs.powi(2) / 2.0, dt_secs.powi(2) / 2.0, dt_secs];
        for (i, value) in noise.into_iter().enumerate() {
            self.filter.direct_process_noise_mut().set_at(i / 2, i % 2, value * density);
        }
        self.filter.predict();
        self.store(axis);
    }

    /// Takes in a sighting of the place, of a variance above 0.
    pub(super) fn correct(&mut self, axis: &mut Axis, position_px: f64, variance_px2: f64) {
        self.load(axis);
        self.sighting.measurement_vector_mut().set_at(0, 0, position_px);
        self.sighting.measurement_noise_covariance_mut().set_at(0, 0, variance_px2);
        self.filter.correct(&mut self.sighting);
        self.store(axis);
    }

    fn load(&mut self, axis: &Axis) {
        self.filter.state_vector_mut().as_mut_slice().copy_from_slice(&axis.state);
        self.filter.estimate_covariance_mut().as_mut_slice().copy_from_slice(&axis.covariance);
    }

    fn store(&self, axis: &mut Axis) {
        axis.state.copy_from_slice(self.filter.state_vector().as_slice());
        axis.covariance.copy_from_slice(self.filter.estimate_covariance().as_slice());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Follows 40 pixels a second for two seconds of frames.
    fn followed(rate_hz: f64) -> Axis {
        let mut motion = Motion::new();
        let mut axis = Axis::new(0.0, 9.0, 1e4);
        for number in 1..=(2.0 * rate_hz) as u32 {
            motion.predict(&mut axis, 1.0 / rate_hz, 100.0);
            motion.correct(&mut axis, 40.0 * f64::from(number) / rate_hz, 9.0);
        }
        axis
    }

    #[test]
    fn a_steady_motion_is_found_at_any_rate() {
        for rate_hz in [5.0, 10.0, 30.0] {
            let axis = followed(rate_hz);
            assert!((axis.position_px() - 80.0).abs() < 0.5, "{rate_hz}: {axis:?}");
            assert!((axis.velocity_px_per_sec() - 40.0).abs() < 1.0, "{rate_hz}: {axis:?}");
        }
    }

    #[test]
    fn a_prediction_in_two_steps_is_that_in_one() {
        let mut motion = Motion::new();
        let (mut once, mut twice) = (followed(10.0), followed(10.0));
        motion.predict(&mut once, 1.0, 50.0);
        motion.predict(&mut twice, 0.3, 50.0);
        motion.predict(&mut twice, 0.7, 50.0);
        let pairs = once.state.iter().zip(&twice.state).chain(once.covariance.iter().zip(&twice.covariance));
        for (a, b) in pairs {
            assert!((a - b).abs() < 1e-9, "{once:?} {twice:?}");
        }
        assert!(once.variance_px2() > followed(10.0).variance_px2());
    }
}
