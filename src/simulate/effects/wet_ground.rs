//! Wet ground: puddles that mirror what stands behind them, and paving that is darker for being wet.
//!
//! Settings and pure functions of place and angle; the mirrored ray is cast by `cast`.
//!
//! `[BW80]` Born and Wolf 1980, Principles of optics, 1.5.2 (Fresnel's formulae).

use super::super::material::noise::{noise, smooth_step};
use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// Refractive index of water.
const WATER_INDEX: f64 = 1.333;
/// Half the width of a puddle's rim, as a share of the noise's range.
const RIM: f64 = 0.04;

/// Settings of wet ground.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WetGround {
    /// Share of level ground that lies under puddles, 0 to 1. Default 0.4.
    pub coverage: f64,
    /// Width of a typical puddle, metres, 0.1 to 100. Default 3.
    pub puddle_m: f64,
    /// How far mirrored rays are spread, as the slope's deviation, 0 (a mirror) to 0.3. Default 0.01.
    pub roughness: f64,
    /// What is left of the colour of ground that is wet between the puddles, 0.2 to 1. Default 0.65.
    pub wet_albedo: f64,
}

impl Default for WetGround {
    fn default() -> Self {
        Self { coverage: 0.4, puddle_m: 3.0, roughness: 0.01, wet_albedo: 0.65 }
    }
}

/// What is wet of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wetness {
    /// What the dry colour is multiplied by.
    pub albedo_gain: f64,
    /// Share of light that is mirrored, 0 to 1.
    pub mirrored: f64,
}

/// Values of the puddles' noise at many places, in order: their shares are its distribution.
static NOISE_VALUES: LazyLock<Vec<f64>> = LazyLock::new(|| {
    let mut values: Vec<f64> =
        (0..8192_u32).map(|i| puddle_noise(DVec2::new(f64::from(i) * 7.913, f64::from(i) * 3.117))).collect();
    values.sort_unstable_by(f64::total_cmp);
    values
});

/// Noise of two sizes; `at` in puddles.
fn puddle_noise(at: DVec2) -> f64 {
    0.75 * noise(at, 1.0, 0.0, 301) + 0.25 * noise(at, 0.31, 0.0, 302)
}

impl WetGround {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("coverage", self.coverage, 0.0..=1.0);
        ranges.number("puddle_m", self.puddle_m, 0.1..=100.0);
        ranges.number("roughness", self.roughness, 0.0..=0.3);
        ranges.number("wet_albedo", self.wet_albedo, 0.2..=1.0);
    }

    /// How wet level ground is at a place, seen at an angle whose cosine with the normal is `cosine`.
    #[must_use]
    pub fn at(&self, place: DVec2, cosine: f64, tally: &Tally<'_>) -> Wetness {
        tally.enter(EffectKind::WetGround);
        let water = self.water(place);
        // Still water mirrors; a wet stone's film is broken by its grain and mirrors a quarter of that.
        let mirrored = fresnel(cosine) * (0.25 + 0.75 * water);
        Wetness { albedo_gain: self.wet_albedo, mirrored }
    }

    /// 1 in a puddle, 0 outside, a ramp at its rim.
    fn water(&self, place: DVec2) -> f64 {
        if self.coverage <= 0.0 {
            return 0.0;
        }
        if self.coverage >= 1.0 {
            return 1.0;
        }
        let values = &*NOISE_VALUES;
        let threshold = values[((values.len() - 1) as f64 * self.coverage) as usize];
        1.0 - smooth_step(threshold - RIM, threshold + RIM, puddle_noise(place / self.puddle_m))
    }

    /// Where a ray that arrives along `direction` is mirrored to on ground whose normal is `normal`; `draw` and
    /// `index` choose the slope of the ripple that it meets.
    #[must_use]
    pub fn mirrored(
        &self,
        direction: DVec3,
        normal: DVec3,
        draw: Draw,
        index: u64,
        tally: &Tally<'_>,
    ) -> DVec3 {
        tally.enter(EffectKind::WetGround);
        let mut facet = normal;
        if self.roughness > 0.0 {
            let (across, up) = normal.any_orthonormal_pair();
            let reach = self.roughness * (-2.0 * (1.0 - draw.unit(2 * index)).ln()).sqrt();
            let (sin, cos) = (TAU * draw.unit(2 * index + 1)).sin_cos();
            facet = (normal + (across * cos + up * sin) * reach.min(1.0)).normalize();
        }
        let away = direction - facet * (2.0 * direction.dot(facet));
        // A steep facet may point a grazing ray into the ground: it leaves along it instead.
        let sunk = away.dot(normal).min(0.0);
        (away - normal * (sunk - 1e-3 * f64::from(sunk < 0.0))).normalize()
    }
}

/// Share of unpolarised light that water mirrors, by the cosine of the angle with its normal `[BW80]` (36).
fn fresnel(cosine: f64) -> f64 {
    let cosine = cosine.abs().min(1.0);
    let sine_inside = (1.0 - cosine * cosine).max(0.0).sqrt() / WATER_INDEX;
    let cosine_inside = (1.0 - sine_inside * sine_inside).sqrt();
    let across = (cosine - WATER_INDEX * cosine_inside) / (cosine + WATER_INDEX * cosine_inside);
    let along = (WATER_INDEX * cosine - cosine_inside) / (WATER_INDEX * cosine + cosine_inside);
    0.5 * (across * across + along * along)
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn water_mirrors_two_percent_from_above_and_all_when_grazing() {
        assert!((fresnel(1.0) - 0.020_4).abs() < 1e-4);
        assert!((fresnel(0.0) - 1.0).abs() < 1e-12);
        // At Brewster's angle half of the light across is all that is mirrored.
        let brewster = WATER_INDEX.atan().cos();
        assert!((fresnel(brewster) - 0.039_2).abs() < 1e-3, "{}", fresnel(brewster));
        let steps: Vec<f64> = (0..=100).map(|i| fresnel(f64::from(i) / 100.0)).collect();
        assert!(steps.windows(2).all(|pair| pair[0] >= pair[1]));
    }

    #[test]
    fn puddles_cover_their_share() {
        for coverage in [0.0, 0.1, 0.4, 0.8, 1.0] {
            let wet = WetGround { coverage, ..WetGround::default() };
            let n = 160;
            let places = (0..n * n).map(|i| DVec2::new(f64::from(i % n), f64::from(i / n)) * 1.37);
            let mean = places.map(|place| wet.water(place)).sum::<f64>() / f64::from(n * n);
            assert!((mean - coverage).abs() < 0.04, "{coverage}: {mean}");
        }
    }

    #[test]
    fn mirrored_rays_leave_the_ground() {
        let entries = Entries::default();
        let draw = Draw::of_camera(0, "a");
        let arriving = DVec3::new(0.6, 0.0, -0.8);
        let mirror = WetGround { roughness: 0.0, ..WetGround::default() };
        let away = mirror.mirrored(arriving, DVec3::Z, draw, 0, &entries.tally());
        assert!((away - DVec3::new(0.6, 0.0, 0.8)).length() < 1e-12);
        let rough = WetGround { roughness: 0.3, ..mirror };
        for index in 0..1000 {
            for arriving in [arriving, DVec3::new(0.9999, 0.0, -0.0141).normalize()] {
                let away = rough.mirrored(arriving, DVec3::Z, draw, index, &entries.tally());
                assert!(away.z > 0.0 && (away.length() - 1.0).abs() < 1e-9, "{away}");
            }
        }
        assert_eq!(entries.count(EffectKind::WetGround), 2001);
    }
}
