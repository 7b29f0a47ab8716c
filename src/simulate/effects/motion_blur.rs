//! Motion blur: a frame gathers light for a time, not an instant.
//!
//! Settings and the times of a pixel's samples. A frame's capture instant is the middle of its exposure, so truth
//! at that instant lies in the middle of the blur.

use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use serde::{Deserialize, Serialize};

/// Settings of the blur.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionBlur {
    /// How long the shutter is open, seconds, 0 to 1. Default 1/30.
    pub open_secs: f64,
}

impl Default for MotionBlur {
    fn default() -> Self {
        Self { open_secs: 1.0 / 30.0 }
    }
}

impl MotionBlur {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("open_secs", self.open_secs, 0.0..=1.0);
    }

    /// When sample `sample` of `n_samples` of pixel `pixel` looks, seconds from the capture instant.
    ///
    /// The open time is cut into as many parts as there are samples; which part a sample of the grid gets is
    /// shuffled by pixel (so that time and place do not go together), and it looks at a random time within it.
    #[must_use]
    pub fn offset_secs(&self, draw: Draw, pixel: u64, sample: u32, n_samples: u32, tally: &Tally<'_>) -> f64 {
        tally.enter(EffectKind::MotionBlur);
        let n = u64::from(n_samples.max(1));
        // An odd multiplier coprime to n, and a shift: a permutation of 0..n.
        let step = (1..).map(|k| 2 * k + 1).find(|step| gcd(*step, n) == 1).unwrap_or(1);
        let shift = draw.below(pixel * 1024 + 1023, n);
        let part = (u64::from(sample) * step + shift) % n;
        let within = draw.unit(pixel * 1024 + u64::from(sample));
        ((part as f64 + within) / n as f64 - 0.5) * self.open_secs
    }
}

const fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn samples_fill_the_open_time_evenly() {
        let blur = MotionBlur { open_secs: 0.04 };
        let entries = Entries::default();
        let draw = Draw::of_camera(0, "a").at_frame(3);
        for n_samples in [1, 4, 9, 16, 225, 256] {
            for pixel in [0, 77] {
                let mut times: Vec<f64> = (0..n_samples)
                    .map(|sample| blur.offset_secs(draw, pixel, sample, n_samples, &entries.tally()))
                    .collect();
                times.sort_unstable_by(f64::total_cmp);
                for (i, time) in times.into_iter().enumerate() {
                    let part = (time / 0.04 + 0.5) * f64::from(n_samples);
                    assert!((part - i as f64 - 0.5).abs() <= 0.5 + 1e-9, "{n_samples}: {part} is not in {i}");
                }
            }
        }
        assert!(entries.count(EffectKind::MotionBlur) > 0);
    }
}
