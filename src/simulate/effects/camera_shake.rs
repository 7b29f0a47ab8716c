//! Cameras that sway on their poles.
//!
//! Settings and a pure function of time: the pose that a camera has instead of the one it was calibrated with. The
//! motion is a sum of sines of unrelated rates, so it is smooth enough to be asked for by row and sample.

use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use glam::{DQuat, DVec3, EulerRot};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use videofields_vision::geometry::Pose;

/// Settings of the shake.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraShake {
    /// Deviation of each of the three angles, degrees, 0 to 10. Default 0.15.
    pub angle_deg: f64,
    /// Deviation of the position each way, metres, 0 to 1. Default 0.003.
    pub shift_m: f64,
    /// Swings a second of the slowest part, 0.01 to 100; others are up to four times as fast. Default 1.5.
    pub frequency_hz: f64,
}

impl Default for CameraShake {
    fn default() -> Self {
        Self { angle_deg: 0.15, shift_m: 0.003, frequency_hz: 1.5 }
    }
}

/// Rates of the sines, as multiples of the frequency, and their amplitudes: root mean square 1 together.
const SINES: [(f64, f64); 3] = [(1.0, 1.1), (2.271, 0.7), (3.871, 0.548)];

impl CameraShake {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("angle_deg", self.angle_deg, 0.0..=10.0);
        ranges.number("shift_m", self.shift_m, 0.0..=1.0);
        ranges.number("frequency_hz", self.frequency_hz, 0.01..=100.0);
    }

    /// Farthest that a ray is turned from where the calibration says, radians: for bounds of motion.
    #[must_use]
    pub fn reach_rad(&self) -> f64 {
        let peak: f64 = SINES.iter().map(|(_, amplitude)| amplitude).sum();
        self.angle_deg.to_radians() * peak * 3.0_f64.sqrt()
    }

    /// The pose at `time_secs` of a camera that rests at `rest`; `draw` is the camera's.
    #[must_use]
    pub fn pose(&self, rest: &Pose, draw: Draw, time_secs: f64, tally: &Tally<'_>) -> Pose {
        tally.enter(EffectKind::CameraShake);
        let draw = draw.of_effect(EffectKind::CameraShake);
        let wave = |axis: u64| -> f64 {
            let sines = SINES.iter().zip(0..);
            let at = |((rate, amplitude), i): (&(f64, f64), u64)| {
                let phase = draw.unit(axis * 3 + i);
                amplitude * (TAU * (self.frequency_hz * rate * time_secs + phase)).sin()
            };
            sines.map(at).sum()
        };
        let angle = self.angle_deg.to_radians();
        let turn = DQuat::from_euler(EulerRot::XYZ, angle * wave(0), angle * wave(1), angle * wave(2));
        let shift = DVec3::new(wave(3), wave(4), wave(5)) * self.shift_m;
        Pose {
            position_in_world: rest.world_from_local_point(shift),
            world_from_local: (rest.world_from_local * turn).normalize(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn a_camera_shakes_around_its_rest_by_what_is_said() {
        let shake = CameraShake { angle_deg: 0.5, shift_m: 0.01, frequency_hz: 2.0 };
        let rest = Pose::looking_at(DVec3::new(1.0, 2.0, 6.0), DVec3::new(10.0, 4.0, 0.0)).expect("a pose");
        let entries = Entries::default();
        let draw = Draw::of_camera(1, "a");
        let (n, mut squares, mut shifts) = (20_000, DVec3::ZERO, DVec3::ZERO);
        for i in 0..n {
            let time = f64::from(i) * 0.013;
            let pose = shake.pose(&rest, draw, time, &entries.tally());
            let turn = rest.world_from_local.inverse() * pose.world_from_local;
            let angles = DVec3::from(turn.to_euler(EulerRot::XYZ)).map(f64::to_degrees);
            squares += angles * angles;
            let shift = rest.local_from_world_point(pose.position_in_world);
            shifts += shift * shift;
            assert!(turn.angle_between(DQuat::IDENTITY) <= shake.reach_rad());
        }
        let (angles, shifts) =
            ((squares / f64::from(n)).map(f64::sqrt), (shifts / f64::from(n)).map(f64::sqrt));
        for axis in 0..3 {
            assert!((angles[axis] - 0.5).abs() < 0.02, "{angles}");
            assert!((shifts[axis] - 0.01).abs() < 0.0004, "{shifts}");
        }
        assert_eq!(entries.count(EffectKind::CameraShake), 20_000);
        let other = shake.pose(&rest, Draw::of_camera(1, "b"), 1.0, &entries.tally());
        assert_ne!(other, shake.pose(&rest, draw, 1.0, &entries.tally()));
    }
}
