//! Snow: flakes that drift through the picture from frame to frame, and the white of what falls behind them.
//!
//! Flakes live in a cube around the camera that repeats without end: a flake that leaves it on one side enters on
//! the other, so each is a pure function of time. Numbers and speeds are of the middle of what is observed (Langleben
//! 1954, The terminal velocity of snowflakes: about 1 m/s, hardly more for large ones).

use super::ranges::Ranges;
use super::streak::{Streak, draw, veil};
use super::{Draw, EffectKind, Tally};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use videofields_vision::geometry::Camera;

/// Nearest flakes, metres: a roof keeps nearer ones off the lens.
const NEAR_M: f64 = 0.35;
/// Width below which flakes are no longer told apart, pixels.
const LEAST_WIDTH_PX: f64 = 0.35;
/// Flakes around a camera at most.
const MOST_FLAKES: f64 = 400_000.0;

/// Settings of snow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Snow {
    /// Flakes in a cubic metre, 0.1 to 1000. Default 60.
    pub flakes_per_m3: f64,
    /// Width of a typical flake, millimetres, 0.5 to 30; single ones have half to one and a half of it. Default 6.
    pub flake_mm: f64,
    /// How fast flakes fall, metres a second, 0.1 to 5. Default 1.1.
    pub fall_m_per_sec: f64,
    /// Wind towards east and north, metres a second, -50 to 50 each. Default [0.8, 0.3].
    pub wind_m_per_sec: [f64; 2],
    /// Exposure, seconds, 0.0001 to 1: flakes grow longer and fainter with it. A named `motion_blur` overrides it.
    /// Default 1/100.
    pub exposure_secs: f64,
    /// How far one sees, metres, 10 to 1000000. Default 250.
    pub visibility_m: f64,
}

impl Default for Snow {
    fn default() -> Self {
        Self {
            flakes_per_m3: 60.0,
            flake_mm: 6.0,
            fall_m_per_sec: 1.1,
            wind_m_per_sec: [0.8, 0.3],
            exposure_secs: 0.01,
            visibility_m: 250.0,
        }
    }
}

impl Snow {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("flakes_per_m3", self.flakes_per_m3, 0.1..=1000.0);
        ranges.number("flake_mm", self.flake_mm, 0.5..=30.0);
        ranges.number("fall_m_per_sec", self.fall_m_per_sec, 0.1..=5.0);
        ranges.wind("wind_m_per_sec", self.wind_m_per_sec);
        ranges.number("exposure_secs", self.exposure_secs, 0.0001..=1.0);
        ranges.number("visibility_m", self.visibility_m, 10.0..=1e6);
    }

    /// Snows on a linear picture that `camera` took at `time_secs`, whose pixels show what is `depth_m` away along
    /// the axis (0 the sky); `sky` is the sky's light, `draw_from` the camera's (not the frame's).
    #[expect(clippy::too_many_arguments, reason = "a frame's whole situation, as every weather gets it")]
    pub fn fall(
        &self,
        picture: &mut [[f32; 3]],
        depth_m: &[f32],
        camera: &Camera,
        sky: DVec3,
        draw_from: Draw,
        time_secs: f64,
        tally: &Tally<'_>,
    ) {
        tally.enter(EffectKind::Snow);
        veil(self.visibility_m, sky, picture, depth_m);
        let streaks = self.streaks(camera, draw_from.of_effect(EffectKind::Snow), time_secs);
        // Flakes scatter the whole sky's light towards the eye: they are whiter than it.
        let light = sky.lerp(DVec3::splat(sky.max_element()), 0.7);
        draw(&streaks, light, picture, depth_m, camera.size_px().0 as usize);
    }

    fn streaks(&self, camera: &Camera, from: Draw, time_secs: f64) -> Vec<Streak> {
        let focal_px = camera.focal_px().max_element();
        let size = DVec2::new(f64::from(camera.size_px().0), f64::from(camera.size_px().1));
        let flake_m = self.flake_mm * 1e-3;
        let far_m = (focal_px * flake_m / LEAST_WIDTH_PX).clamp(NEAR_M * 2.0, 30.0);
        let side_m = (2.0 * far_m).min((MOST_FLAKES / self.flakes_per_m3).cbrt());
        let n_flakes = (self.flakes_per_m3 * side_m.powi(3)) as u64;
        let eye = camera.pose().position_in_world;
        let forward = camera.pose().forward_in_world();
        let [east, north] = self.wind_m_per_sec;
        let streak = |i: u64| {
            let number = |k: u64| from.unit(8 * i + k);
            let pace = 0.7 + 0.6 * number(3);
            let velocity = DVec3::new(east, north, -self.fall_m_per_sec * pace);
            let start = DVec3::new(number(0), number(1), number(2)) * side_m;
            // Flakes reel: a slow circle of a few centimetres.
            let turn = TAU * (number(4) + time_secs * (0.5 + number(5)));
            let reel = DVec3::new(turn.cos(), turn.sin(), 0.0) * (0.05 * number(6));
            let place = start + velocity * time_secs + reel - eye;
            let around = place - (place / side_m).round() * side_m;
            let depth_m = around.dot(forward);
            if depth_m < NEAR_M || depth_m > far_m {
                return None;
            }
            let half = velocity * (self.exposure_secs * 0.5);
            let (start, end) = (camera.project(eye + around - half)?, camera.project(eye + around + half)?);
            let width_m = flake_m * (0.5 + number(7));
            Some(Streak {
                from: start.texture * size,
                to: end.texture * size,
                radius_px: 0.5 * width_m * focal_px / depth_m,
                opacity: 0.9 * width_m / (width_m + 2.0 * half.length()),
                depth_m,
            })
        };
        (0..n_flakes).into_par_iter().filter_map(streak).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    fn camera() -> Camera {
        Camera::pinhole(DVec3::new(0.0, 0.0, 5.0), DVec3::new(10.0, 0.0, 3.0), 0.7, (160, 90))
            .expect("a camera")
    }

    #[test]
    fn flakes_are_the_same_ones_a_moment_later_and_lower() {
        let snow = Snow { wind_m_per_sec: [0.0, 0.0], ..Snow::default() };
        let draw = Draw::of_camera(1, "a");
        let (before, after) = (snow.streaks(&camera(), draw, 5.0), snow.streaks(&camera(), draw, 5.001));
        assert!(before.len() > 30, "{}", before.len());
        // One or two may have crossed a bound; the rest are in their order.
        assert!(before.len().abs_diff(after.len()) <= 2, "{} {}", before.len(), after.len());
        let n_lower = before
            .iter()
            .filter(|a| {
                after.iter().any(|b| {
                    let fall = b.from - a.from;
                    (b.radius_px - a.radius_px).abs() < 0.01 && fall.length() < 1.0 && fall.y > -0.1
                })
            })
            .count();
        assert!(n_lower * 10 > before.len() * 9, "{n_lower} of {}", before.len());
    }

    #[test]
    fn snow_lightens_what_is_dark_and_is_repeatable() {
        let snowed = |depth: f32, seed| {
            let mut picture = vec![[0.05; 3]; 160 * 90];
            let entries = Entries::default();
            let draw = Draw::of_camera(seed, "a");
            let snow = Snow { visibility_m: 1e6, ..Snow::default() };
            let sky = DVec3::splat(0.5);
            snow.fall(&mut picture, &vec![depth; 160 * 90], &camera(), sky, draw, 2.0, &entries.tally());
            assert_eq!(entries.count(EffectKind::Snow), 1);
            picture
        };
        let n_lit = |picture: &[[f32; 3]]| picture.iter().filter(|pixel| pixel[0] > 0.08).count();
        let open = snowed(60.0, 1);
        assert!(n_lit(&open) > 50, "{}", n_lit(&open));
        assert_eq!(n_lit(&snowed(0.2, 1)), 0);
        assert_eq!(open, snowed(60.0, 1));
        assert_ne!(open, snowed(60.0, 2));
    }
}
