//! Cameras whose calibration is wrong: what is written of one differs from how it truly stands, and its clock is off.
//!
//! Owns the errors and what they make of a camera. What is cast is always the true camera.

use super::SimulateError;
use super::effects::Draw;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use videofields_vision::error::Fault;
use videofields_vision::geometry::{Camera, Distortion, Pose};

/// Errors of a camera's written calibration: each is just so large, in a direction that the world's seed and the camera's id draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CalibrationError {
    /// Distance of its place, metres, 0 to 100.
    pub move_m: f64,
    /// Angle by which it is turned, degrees, 0 to 45.
    pub turn_deg: f64,
    /// Longer or shorter focal length, percent, 0 to 50.
    pub focal_percent: f64,
    /// More or less of its lens' first coefficient of distortion, 0 to 0.5.
    pub lens: f64,
    /// Time by which frames are captured earlier or later than their times say, milliseconds, 0 to 60000.
    pub clock_ms: f64,
}

/// Errors' numbers are other than those of effects.
const SEED_MARK: u64 = 0x6361_6c69_6272;

impl CalibrationError {
    /// Returns the faults of settings outside their ranges, each at its key.
    #[must_use]
    pub fn validate(&self) -> Vec<Fault> {
        let ranges = [
            ("move_m", self.move_m, 100.0, "metres"),
            ("turn_deg", self.turn_deg, 45.0, "degrees"),
            ("focal_percent", self.focal_percent, 50.0, "percent"),
            ("lens", self.lens, 0.5, ""),
            ("clock_ms", self.clock_ms, 60_000.0, "milliseconds"),
        ];
        let faulty = ranges.into_iter().filter(|(_, value, most, _)| !(0.0..=*most).contains(value));
        let fault = |(key, value, most, unit): (&str, f64, f64, &str)| {
            let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
            Fault::new(format!("/{key}"), format!("expected 0 to {most}{unit}, got {value}"))
        };
        faulty.map(fault).collect()
    }

    fn draw(seed: u64, camera_id: &str) -> Draw {
        Draw::of_camera(seed ^ SEED_MARK, camera_id)
    }

    /// Returns the camera as its calibration has it.
    ///
    /// # Errors
    /// When the error leaves none that a camera can be.
    pub fn applied(&self, camera: &Camera, seed: u64, camera_id: &str) -> Result<Camera, SimulateError> {
        let geometry = Self { clock_ms: 0.0, ..*self };
        if geometry == Self::default() {
            return Ok(camera.clone());
        }
        let draw = Self::draw(seed, camera_id);
        let direction = |first: u64| {
            let [x, y, z] = [0, 1, 2].map(|axis| draw.normal(first + axis));
            DVec3::new(x, y, z).normalize_or(DVec3::Z)
        };
        let sign = |index: u64| if draw.signed(index) < 0.0 { -1.0 } else { 1.0 };
        let pose = camera.pose();
        let turn = DQuat::from_axis_angle(direction(10), self.turn_deg.to_radians());
        let pose = Pose {
            position_in_world: pose.position_in_world + direction(20) * self.move_m,
            world_from_local: (turn * pose.world_from_local).normalize(),
        };
        let focal_px = camera.focal_px() * (1.0 + 0.01 * self.focal_percent * sign(30));
        let distortion = bent(camera.distortion(), self.lens * sign(31));
        Ok(Camera::new(camera.size_px(), focal_px, camera.center_px(), distortion, pose)?)
    }

    /// Returns how much later than their times say the camera's frames are captured, seconds.
    #[must_use]
    pub fn late_secs(&self, seed: u64, camera_id: &str) -> f64 {
        let sign = if Self::draw(seed, camera_id).signed(40) < 0.0 { -1.0 } else { 1.0 };
        self.clock_ms * 1e-3 * sign
    }
}

/// The lens with its first coefficient changed.
fn bent(lens: &Distortion, more: f64) -> Distortion {
    match *lens {
        lens if more == 0.0 => lens,
        Distortion::None => {
            Distortion::BrownConrady { coefficients: [more, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] }
        }
        Distortion::BrownConrady { mut coefficients } => {
            coefficients[0] += more;
            Distortion::BrownConrady { coefficients }
        }
        Distortion::Fisheye { mut coefficients } => {
            coefficients[0] += more;
            Distortion::Fisheye { coefficients }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibration_is_off_by_just_so_much() {
        let camera =
            Camera::pinhole(DVec3::new(0.0, -10.0, 3.0), DVec3::ZERO, 0.6, (640, 360)).expect("a camera");
        let error =
            CalibrationError { move_m: 0.2, turn_deg: 1.5, focal_percent: 2.0, lens: 0.03, clock_ms: 80.0 };
        let believed = |seed: u64, id: &str| error.applied(&camera, seed, id).expect("a camera");
        let off = believed(1, "a");
        assert_eq!(off.pose(), believed(1, "a").pose());
        assert_ne!(off.pose(), believed(1, "b").pose());
        assert_ne!(off.pose(), believed(2, "a").pose());
        let (pose, true_pose) = (off.pose(), camera.pose());
        let moved_m = (pose.position_in_world - true_pose.position_in_world).length();
        assert!((moved_m - 0.2).abs() < 1e-12, "{moved_m}");
        let turned = pose.world_from_local.angle_between(true_pose.world_from_local).to_degrees();
        assert!((turned - 1.5).abs() < 1e-6, "{turned}");
        let longer = off.focal_px().x / camera.focal_px().x - 1.0;
        assert!((longer.abs() - 0.02).abs() < 1e-12, "{longer}");
        let Distortion::BrownConrady { coefficients } = off.distortion() else { panic!("a lens") };
        assert!((coefficients[0].abs() - 0.03).abs() < 1e-12);
        let late: Vec<f64> = ["a", "b", "c", "d", "e", "f"].map(|id| error.late_secs(1, id)).to_vec();
        assert!(
            late.iter().all(|late| (late.abs() - 0.08).abs() < 1e-12) && late.contains(&0.08),
            "{late:?}"
        );
        assert!(late.contains(&-0.08), "some are early");
    }

    #[test]
    fn without_an_error_a_calibration_is_the_camera() {
        let camera = Camera::pinhole(DVec3::Z * 3.0, DVec3::X, 0.6, (64, 36)).expect("a camera");
        let late = CalibrationError { clock_ms: 40.0, ..CalibrationError::default() };
        assert_eq!(late.applied(&camera, 7, "a").expect("a camera"), camera);
        assert_eq!(CalibrationError::default().late_secs(7, "a"), 0.0);
        assert!(late.validate().is_empty());
        let faulty = CalibrationError { move_m: -1.0, turn_deg: f64::NAN, ..late };
        let places: Vec<String> = faulty.validate().into_iter().map(|fault| fault.place).collect();
        assert_eq!(places, ["/move_m", "/turn_deg"]);
    }
}
