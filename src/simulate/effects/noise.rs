//! Sensor noise: the photons' own, the amplifier's, and the pattern of unequal pixels.
//!
//! `[EMVA]` EMVA Standard 1288, the linear camera model: variance = read noise squared + signal, in electrons. The
//! photons' Poisson distribution is drawn as a normal one of the same variance, which differs below some ten electrons
//! alone.

use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Settings of the sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Noise {
    /// Electrons of a pixel that shows white at gain 1, 50 to 1000000: few make much shot noise. Default 1500.
    pub full_well_electrons: f64,
    /// Deviation of the noise that reading adds, electrons, 0 to 10000. Default 12.
    pub read_noise_electrons: f64,
    /// Deviation of the pixels' own sensitivities, as a share, 0 to 0.5; the same in every frame. Default 0.
    pub fixed_pattern: f64,
}

impl Default for Noise {
    fn default() -> Self {
        Self { full_well_electrons: 1500.0, read_noise_electrons: 12.0, fixed_pattern: 0.0 }
    }
}

impl Noise {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("full_well_electrons", self.full_well_electrons, 50.0..=1e6);
        ranges.number("read_noise_electrons", self.read_noise_electrons, 0.0..=1e4);
        ranges.number("fixed_pattern", self.fixed_pattern, 0.0..=0.5);
    }

    /// Adds noise to a linear picture that was amplified by `gain`; `camera` draws what stays, `camera.at_frame` what
    /// changes with `frame`. Values may fall below 0.
    pub fn disturb(&self, picture: &mut [[f32; 3]], gain: f64, camera: Draw, frame: u64, tally: &Tally<'_>) {
        tally.enter(EffectKind::Noise);
        let pattern = camera.of_effect(EffectKind::Noise);
        let noise = camera.at_frame(frame).of_effect(EffectKind::Noise);
        // One electron on the picture's scale.
        let electron = gain / self.full_well_electrons;
        let read = self.read_noise_electrons;
        picture.par_iter_mut().enumerate().for_each(|(i, pixel)| {
            let i = i as u64;
            let (a, b) = noise.two_normal(2 * i);
            let c = noise.normal(2 * i + 1);
            if self.fixed_pattern > 0.0 {
                let (p, q) = pattern.two_normal(2 * i);
                let r = pattern.normal(2 * i + 1);
                for (value, own) in pixel.iter_mut().zip([p, q, r]) {
                    *value *= (1.0 + self.fixed_pattern * own).max(0.0) as f32;
                }
            }
            for (value, normal) in pixel.iter_mut().zip([a, b, c]) {
                let electrons = (f64::from(*value) / electron).max(0.0);
                *value += ((electrons + read * read).sqrt() * normal * electron) as f32;
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    fn moments(noise: Noise, level: f32, gain: f64) -> (f64, f64) {
        let mut picture = vec![[level; 3]; 40_000];
        let entries = Entries::default();
        noise.disturb(&mut picture, gain, Draw::of_camera(1, "a"), 5, &entries.tally());
        assert_eq!(entries.count(EffectKind::Noise), 1);
        let values: Vec<f64> = picture.iter().flatten().map(|value| f64::from(*value)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
        (mean, variance.sqrt())
    }

    #[test]
    fn deviation_is_that_of_the_camera_model() {
        let noise = Noise { full_well_electrons: 1000.0, read_noise_electrons: 10.0, fixed_pattern: 0.0 };
        for (level, gain) in [(0.5_f32, 1.0), (0.05, 1.0), (0.5, 4.0), (0.0, 1.0)] {
            let (mean, deviation) = moments(noise, level, gain);
            let electrons = f64::from(level) * 1000.0 / gain;
            let expected = (electrons + 100.0).sqrt() * gain / 1000.0;
            assert!((mean - f64::from(level)).abs() < 0.03 * expected, "{level}: {mean}");
            assert!((deviation / expected - 1.0).abs() < 0.02, "{level}: {deviation}, expected {expected}");
        }
    }

    #[test]
    fn the_pattern_stays_and_the_rest_changes() {
        let noise = Noise { full_well_electrons: 1e6, read_noise_electrons: 0.0, fixed_pattern: 0.1 };
        let entries = Entries::default();
        let frame = |number| {
            let mut picture = vec![[0.5_f32; 3]; 5000];
            noise.disturb(&mut picture, 1.0, Draw::of_camera(1, "a"), number, &entries.tally());
            picture.into_iter().flatten().collect::<Vec<_>>()
        };
        let (first, second) = (frame(0), frame(1));
        assert_ne!(first, second);
        let mean_difference =
            first.iter().zip(&second).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / 15_000.0;
        let deviation =
            (first.iter().map(|value| f64::from(value - 0.5).powi(2)).sum::<f64>() / 15_000.0).sqrt();
        assert!((deviation - 0.05).abs() < 0.002, "{deviation}");
        assert!(mean_difference < 0.002, "{mean_difference}");
    }
}
