//! Cameras whose clocks are wrong: set wrong, and running too fast or too slow.
//!
//! Settings, each camera's own error, and the instant that its clock shows.

use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use serde::{Deserialize, Serialize};

/// Settings of the clocks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Clock {
    /// How far off a clock is at time 0 at most, seconds either way, 0 to 86400; each camera has its own. Default 0.5.
    pub most_offset_secs: f64,
    /// How much too fast or slow a clock runs at most, millionths, 0 to 100000; each camera has its own. Default 100.
    pub most_drift_ppm: f64,
}

impl Default for Clock {
    fn default() -> Self {
        Self { most_offset_secs: 0.5, most_drift_ppm: 100.0 }
    }
}

/// A camera's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ClockError {
    /// What it shows at time 0, seconds.
    pub offset_secs: f64,
    /// How much too fast it runs, millionths.
    pub drift_ppm: f64,
}

impl Clock {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("most_offset_secs", self.most_offset_secs, 0.0..=86_400.0);
        ranges.number("most_drift_ppm", self.most_drift_ppm, 0.0..=100_000.0);
    }

    /// The error of a camera's clock; `camera` is the camera's draw.
    #[must_use]
    pub fn error(&self, camera: Draw, tally: &Tally<'_>) -> ClockError {
        tally.enter(EffectKind::Clock);
        let draw = camera.of_effect(EffectKind::Clock);
        ClockError {
            offset_secs: self.most_offset_secs * draw.signed(0),
            drift_ppm: self.most_drift_ppm * draw.signed(1),
        }
    }
}

impl ClockError {
    /// What the clock shows at the true time `time_secs`, seconds.
    #[must_use]
    pub fn shown_secs(&self, time_secs: f64) -> f64 {
        time_secs + self.offset_secs + time_secs * self.drift_ppm * 1e-6
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn every_camera_has_its_own_steady_error() {
        let entries = Entries::default();
        let clock = Clock { most_offset_secs: 2.0, most_drift_ppm: 500.0 };
        let of = |id: &str| clock.error(Draw::of_camera(1, id), &entries.tally());
        let (a, b) = (of("a"), of("b"));
        assert_ne!(a, b);
        assert_eq!(a, of("a"));
        assert!(a.offset_secs.abs() <= 2.0 && a.drift_ppm.abs() <= 500.0);
        let rate = (a.shown_secs(1000.0) - a.shown_secs(0.0)) / 1000.0;
        assert!((rate - 1.0 - a.drift_ppm * 1e-6).abs() < 1e-12);
        assert_eq!(ClockError::default().shown_secs(3.25), 3.25);
        assert_eq!(entries.count(EffectKind::Clock), 3);
    }
}
