//! Slow change of daylight: clouds that come and go.
//!
//! Settings and a pure function of time; the change repeats with its period, so that a looped clip has no seam
//! where the period divides its length.

use super::ranges::Ranges;
use super::{EffectKind, LightGains, Tally};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Settings of the drift.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightDrift {
    /// Share by which daylight falls at most, 0 to 1. Default 0.4.
    pub depth: f64,
    /// Seconds of one rise and fall, 0.1 to 86400. Default 24.
    pub period_secs: f64,
    /// How much of the fall the sky shares; the sun takes the whole, 0 to 1. Default 0.3.
    pub sky_share: f64,
    /// How much redder (above 0) or bluer the light is at its darkest, -0.5 to 0.5. Default -0.05.
    pub warmth: f64,
}

impl Default for LightDrift {
    fn default() -> Self {
        Self { depth: 0.4, period_secs: 24.0, sky_share: 0.3, warmth: -0.05 }
    }
}

impl LightDrift {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("depth", self.depth, 0.0..=1.0);
        ranges.number("period_secs", self.period_secs, 0.1..=86_400.0);
        ranges.number("sky_share", self.sky_share, 0.0..=1.0);
        ranges.number("warmth", self.warmth, -0.5..=0.5);
    }

    /// Multiplies the gains of sun and sky by those of `time_secs`.
    pub fn change(&self, gains: &mut LightGains, time_secs: f64, tally: &Tally<'_>) {
        tally.enter(EffectKind::LightDrift);
        let darkness = 0.5 - 0.5 * (TAU * time_secs / self.period_secs).cos();
        let tint = DVec3::new(1.0 + self.warmth * darkness, 1.0, 1.0 - self.warmth * darkness);
        gains.sun *= tint * (1.0 - self.depth * darkness);
        gains.sky *= tint * (1.0 - self.depth * self.sky_share * darkness);
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn daylight_falls_to_its_depth_and_comes_back() {
        let drift = LightDrift { depth: 0.6, period_secs: 10.0, sky_share: 0.5, warmth: 0.0 };
        let entries = Entries::default();
        let at = |time| {
            let mut gains = LightGains::default();
            drift.change(&mut gains, time, &entries.tally());
            (gains.sun.x, gains.sky.x, gains.lamps.x)
        };
        let near = |got: (f64, f64, f64), sun: f64, sky: f64| {
            assert!((got.0 - sun).abs() < 1e-9 && (got.1 - sky).abs() < 1e-9 && got.2 == 1.0, "{got:?}");
        };
        near(at(0.0), 1.0, 1.0);
        near(at(5.0), 0.4, 0.7);
        near(at(30.0), 1.0, 1.0);
        assert_eq!(entries.count(EffectKind::LightDrift), 3);
    }
}
