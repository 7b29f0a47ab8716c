//! Rain: drops that fall in front of everything during the exposure, and the grey of what falls behind them.
//!
//! Drops are drawn anew for every frame: at eight metres a second none is seen twice. Only those that are wide
//! enough to be told apart are drawn; the rest are the veil.
//!
//! `[MP48]` Marshall and Palmer 1948, The distribution of raindrops with size (numbers by diameter).
//! `[A73]` Atlas, Srivastava, Sekhon 1973, Doppler radar characteristics of precipitation (speed by diameter).
//! `[GN07]` Garg and Nayar 2007, Vision and rain (streaks as bright as the sky, in proportion to their time).

use super::ranges::Ranges;
use super::streak::{Streak, draw, veil};
use super::{Draw, EffectKind, Tally};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use videofields_vision::geometry::Camera;

/// Smallest and largest drops that are drawn, millimetres across.
const LEAST_MM: f64 = 1.0;
const MOST_MM: f64 = 6.0;
/// Nearest drops, metres: a roof keeps nearer ones off the lens.
const NEAR_M: f64 = 0.35;
/// Width below which drops are no longer told apart, pixels.
const LEAST_WIDTH_PX: f64 = 0.25;
/// Drops of one frame at most.
const MOST_DROPS: f64 = 200_000.0;
/// How far beyond the picture's edge drops are drawn, as a share of it.
const MARGIN: f64 = 0.08;

/// Settings of rain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rain {
    /// Rain that falls, millimetres an hour, 0.1 (drizzle) to 200 (cloudburst). Default 30.
    pub rate_mm_per_hour: f64,
    /// Wind towards east and north, metres a second, -50 to 50 each. Default [2, 0].
    pub wind_m_per_sec: [f64; 2],
    /// Exposure, seconds, 0.0001 to 1: streaks grow longer and fainter with it. A named `motion_blur` overrides it.
    /// Default 1/100.
    pub exposure_secs: f64,
    /// Light of a drop as a multiple of the sky's, 0 to 50. Default 6.
    pub brightness: f64,
    /// How far one sees, metres, 10 to 1000000. Default 600.
    pub visibility_m: f64,
}

impl Default for Rain {
    fn default() -> Self {
        Self {
            rate_mm_per_hour: 30.0,
            wind_m_per_sec: [2.0, 0.0],
            exposure_secs: 0.01,
            brightness: 6.0,
            visibility_m: 600.0,
        }
    }
}

impl Rain {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("rate_mm_per_hour", self.rate_mm_per_hour, 0.1..=200.0);
        ranges.wind("wind_m_per_sec", self.wind_m_per_sec);
        ranges.number("exposure_secs", self.exposure_secs, 0.0001..=1.0);
        ranges.number("brightness", self.brightness, 0.0..=50.0);
        ranges.number("visibility_m", self.visibility_m, 10.0..=1e6);
    }

    /// Rains on a linear picture that `camera` took, whose pixels show what is `depth_m` away along the axis (0 the
    /// sky); `sky` is the sky's light, `draw` the frame's.
    pub fn fall(
        &self,
        picture: &mut [[f32; 3]],
        depth_m: &[f32],
        camera: &Camera,
        sky: DVec3,
        draw_from: Draw,
        tally: &Tally<'_>,
    ) {
        tally.enter(EffectKind::Rain);
        veil(self.visibility_m, sky, picture, depth_m);
        let streaks = self.streaks(camera, draw_from.of_effect(EffectKind::Rain));
        draw(&streaks, sky * self.brightness, picture, depth_m, camera.size_px().0 as usize);
    }

    /// The slope of the sizes' distribution, 1/mm `[MP48]`.
    fn slope(&self) -> f64 {
        4.1 * self.rate_mm_per_hour.powf(-0.21)
    }

    fn streaks(&self, camera: &Camera, from: Draw) -> Vec<Streak> {
        let focal_px = camera.focal_px().max_element();
        let size = DVec2::new(f64::from(camera.size_px().0), f64::from(camera.size_px().1));
        let far_m = (focal_px * 1.5e-3 / LEAST_WIDTH_PX).max(NEAR_M * 1.5);
        let slope = self.slope();
        // [MP48]: 8000 drops for each cubic metre and millimetre of diameter at size 0.
        let drops_per_m3 = 8000.0 / slope * (-slope * LEAST_MM).exp();
        let spread = (size * (1.0 + 2.0 * MARGIN) / camera.focal_px()).element_product();
        let cubes = (NEAR_M.powi(3), far_m.powi(3));
        let volume_m3 = spread * (cubes.1 - cubes.0) / 3.0;
        let n_drops = (drops_per_m3 * volume_m3).min(MOST_DROPS) as u64;
        let streak = |i: u64| {
            let number = |k: u64| from.unit(4 * i + k);
            let texture = DVec2::new(number(0), number(1)) * (1.0 + 2.0 * MARGIN) - MARGIN;
            let depth_m = (cubes.0 + number(2) * (cubes.1 - cubes.0)).cbrt();
            let diameter_mm = (LEAST_MM - (1.0 - number(3)).ln() / slope).min(MOST_MM);
            let ray = camera.ray(texture)?;
            let along = ray.direction.dot(camera.pose().forward_in_world());
            if along < 0.05 {
                return None;
            }
            let place = ray.at(depth_m / along);
            let [east, north] = self.wind_m_per_sec;
            let half = DVec3::new(east, north, -speed_m_per_sec(diameter_mm)) * (self.exposure_secs * 0.5);
            let (start, end) = (camera.project(place - half)?, camera.project(place + half)?);
            let diameter_m = diameter_mm * 1e-3;
            Some(Streak {
                from: start.texture * size,
                to: end.texture * size,
                radius_px: 0.5 * diameter_m * focal_px / depth_m,
                opacity: diameter_m / (diameter_m + 2.0 * half.length()),
                depth_m,
            })
        };
        (0..n_drops).into_par_iter().filter_map(streak).collect()
    }
}

/// How fast a drop of this diameter falls `[A73]`.
fn speed_m_per_sec(diameter_mm: f64) -> f64 {
    9.65 - 10.3 * (-0.6 * diameter_mm).exp()
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    fn camera() -> Camera {
        Camera::pinhole(DVec3::new(0.0, 0.0, 5.0), DVec3::new(10.0, 0.0, 3.0), 0.7, (160, 90))
            .expect("a camera")
    }

    fn rained(rain: Rain, frame: u64, depth: f32) -> Vec<[f32; 3]> {
        let mut picture = vec![[0.05; 3]; 160 * 90];
        let entries = Entries::default();
        let draw = Draw::of_camera(1, "a").at_frame(frame);
        rain.fall(&mut picture, &vec![depth; 160 * 90], &camera(), DVec3::splat(0.5), draw, &entries.tally());
        assert_eq!(entries.count(EffectKind::Rain), 1);
        picture
    }

    #[test]
    fn big_drops_fall_faster() {
        assert!((speed_m_per_sec(1.0) - 4.0).abs() < 0.1 && (speed_m_per_sec(5.0) - 9.1).abs() < 0.1);
    }

    #[test]
    fn streaks_lie_along_the_fall_and_lengthen_with_the_exposure() {
        let mean_length = |rain: Rain| {
            let streaks = rain.streaks(&camera(), Draw::of_camera(1, "a"));
            assert!(streaks.len() > 20, "{}", streaks.len());
            let lengths = streaks.iter().map(|streak| (streak.to - streak.from).length() * streak.depth_m);
            lengths.sum::<f64>() / streaks.len() as f64
        };
        let still = Rain { wind_m_per_sec: [0.0, 0.0], ..Rain::default() };
        let ratio = mean_length(Rain { exposure_secs: 0.02, ..still }) / mean_length(still);
        assert!((ratio - 2.0).abs() < 0.2, "{ratio}");
        let streaks = still.streaks(&camera(), Draw::of_camera(1, "a"));
        let (down, across) = streaks.iter().fold((0.0, 0.0), |(down, across), streak| {
            let along = streak.to - streak.from;
            (down + along.y, across + along.x.abs())
        });
        assert!(down > 4.0 * across, "{down} down, {across} across");
    }

    #[test]
    fn rain_brightens_what_is_dark_differs_by_frame_and_is_hidden_by_what_is_near() {
        let rain = Rain { visibility_m: 1e6, ..Rain::default() };
        let (first, second) = (rained(rain, 0, 0.0), rained(rain, 1, 50.0));
        assert_ne!(first, second);
        assert_eq!(second, rained(rain, 1, 50.0), "the same frame has the same drops");
        let n_lit = |picture: &[[f32; 3]]| picture.iter().filter(|pixel| pixel[0] > 0.06).count();
        assert!(n_lit(&second) > 50, "{}", n_lit(&second));
        assert_eq!(n_lit(&rained(rain, 1, 0.2)), 0);
        let drizzle = Rain { rate_mm_per_hour: 1.0, ..rain };
        assert!(n_lit(&rained(drizzle, 1, 50.0)) < n_lit(&second) / 2);
    }
}
