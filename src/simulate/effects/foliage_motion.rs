//! Crowns and bushes in the wind.
//!
//! Settings and a pure function of time: how far a crown's middle is from where it rests. The deformation of its
//! leaves is `cast`'s: a shift that grows with height.

use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Settings of the sway.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FoliageMotion {
    /// How far a crown 4 m above the ground sways from its rest, metres, 0 to 2; in proportion to its height.
    /// Default 0.15.
    pub sway_m: f64,
    /// Sways a second, 0.01 to 5. Default 0.4.
    pub frequency_hz: f64,
    /// Direction in which it sways most, degrees from east towards north, -360 to 360. Default 20.
    pub direction_deg: f64,
    /// How much of the sway is the gusts' own rhythm, 0 (an even swing) to 1. Default 0.4.
    pub gustiness: f64,
}

impl Default for FoliageMotion {
    fn default() -> Self {
        Self { sway_m: 0.15, frequency_hz: 0.4, direction_deg: 20.0, gustiness: 0.4 }
    }
}

/// Height for which `sway_m` is given, metres.
const SWAY_HEIGHT_M: f64 = 4.0;

impl FoliageMotion {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("sway_m", self.sway_m, 0.0..=2.0);
        ranges.number("frequency_hz", self.frequency_hz, 0.01..=5.0);
        ranges.number("direction_deg", self.direction_deg, -360.0..=360.0);
        ranges.number("gustiness", self.gustiness, 0.0..=1.0);
    }

    /// Farthest from its rest that the middle of a crown at `height_m` comes, metres: for bounds of motion.
    #[must_use]
    pub fn reach_m(&self, height_m: f64) -> f64 {
        self.sway_m * height_m.max(0.0) / SWAY_HEIGHT_M * 1.25
    }

    /// Displacement at `time_secs` of crown number `crown`, whose middle rests `height_m` above its root, metres.
    #[must_use]
    pub fn sway(&self, seed: u64, crown: u64, height_m: f64, time_secs: f64, tally: &Tally<'_>) -> DVec3 {
        tally.enter(EffectKind::FoliageMotion);
        let draw = Draw::of_camera(seed, "foliage").of_effect(EffectKind::FoliageMotion);
        let phase = |i: u64| TAU * draw.unit(4 * crown + i);
        let pace = TAU * self.frequency_hz * (0.85 + 0.3 * draw.unit(4 * crown + 3));
        let wave = |rate: f64, i: u64| (pace * rate * time_secs + phase(i)).sin();
        let along = (1.0 - self.gustiness) * wave(1.0, 0) + self.gustiness * wave(2.37, 1);
        let across = 0.35 * wave(0.71, 2);
        let (sin, cos) = self.direction_deg.to_radians().sin_cos();
        let scale = self.sway_m * height_m.max(0.0) / SWAY_HEIGHT_M;
        DVec3::new(cos * along - sin * across, sin * along + cos * across, 0.0) * scale
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn crowns_sway_steadily_each_in_its_own_time_and_no_farther_than_said() {
        let motion = FoliageMotion::default();
        let entries = Entries::default();
        let at = |crown, time| motion.sway(1, crown, 4.0, time, &entries.tally());
        let (mut most, mut differ) = (0.0_f64, 0.0_f64);
        for i in 0..2000 {
            let time = f64::from(i) * 0.02;
            let here = at(0, time);
            assert!((at(0, time + 0.001) - here).length() < 0.003, "no jump");
            assert!(here.length() <= motion.reach_m(4.0));
            most = most.max(here.length());
            differ = differ.max((at(1, time) - here).length());
        }
        assert!(most > 0.1 && differ > 0.1, "{most} {differ}");
        assert_eq!(motion.sway(1, 0, 0.0, 3.0, &entries.tally()), DVec3::ZERO, "roots stand still");
        assert_eq!(entries.count(EffectKind::FoliageMotion), 6001);
    }
}
