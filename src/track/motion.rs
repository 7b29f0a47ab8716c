//! How a place moves along one axis: a constant-velocity Kalman filter.
//!
//! [BLK01] Bar-Shalom, Li and Kirubarajan 2001, Estimation with Applications to Tracking and Navigation, section
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
