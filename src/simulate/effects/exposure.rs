//! Automatic exposure: a camera's gain follows the brightness of what it sees, with a delay.
//!
//! Settings and a step over a value that is handed on from frame to frame; a frame is exposed by what earlier ones
//! showed, as in a real camera, and a camera's first frame by itself.

use super::ranges::Ranges;
use super::{EffectKind, Tally};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Settings of the control.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Exposure {
    /// Mean luminance that it aims at, linear light, 0.01 to 0.9. Default 0.25.
    pub target: f64,
    /// Time constant of its way there, seconds, 0 (one frame) to 60. Default 0.6.
    pub time_constant_secs: f64,
    /// Least gain, 0.001 to 1000. Default 0.25.
    pub least_gain: f64,
    /// Most gain, 0.001 to 1000. Default 8.
    pub most_gain: f64,
}

impl Default for Exposure {
    fn default() -> Self {
        Self { target: 0.25, time_constant_secs: 0.6, least_gain: 0.25, most_gain: 8.0 }
    }
}

/// What a camera's control knows from its earlier frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExposureState {
    /// The gain for the next frame; none before the first.
    gain: Option<f64>,
}

impl Exposure {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("target", self.target, 0.01..=0.9);
        ranges.number("time_constant_secs", self.time_constant_secs, 0.0..=60.0);
        ranges.number("least_gain", self.least_gain, 0.001..=1000.0);
        ranges.number("most_gain", self.most_gain, 0.001..=1000.0);
        let is_ordered = || self.least_gain <= self.most_gain;
        ranges.hold("least_gain", is_ordered, "must be at most most_gain");
    }

    /// Multiplies a linear picture by the camera's gain; the gain for the next frame, `interval_secs` later, is
    /// then in `state`. Answers the gain.
    pub fn expose(
        &self,
        picture: &mut [[f32; 3]],
        state: &mut ExposureState,
        interval_secs: f64,
        tally: &Tally<'_>,
    ) -> f64 {
        tally.enter(EffectKind::Exposure);
        let wanted = self.wanted_gain(mean_luminance(picture));
        let gain = state.gain.unwrap_or(wanted);
        picture.par_iter_mut().for_each(|pixel| pixel.iter_mut().for_each(|value| *value *= gain as f32));
        let share = if self.time_constant_secs > 0.0 {
            1.0 - (-interval_secs.max(0.0) / self.time_constant_secs).exp()
        } else {
            1.0
        };
        // Eyes and controls work in ratios: half as bright is as far as twice as bright.
        state.gain = Some(gain * (wanted / gain).powf(share));
        gain
    }

    fn wanted_gain(&self, luminance: f64) -> f64 {
        let gain = self.target / luminance.max(1e-9);
        if gain.is_finite() { gain.clamp(self.least_gain, self.most_gain) } else { self.most_gain }
    }
}

/// Mean luminance (Rec. 709 weights), summed row-free in blocks so that it is the same with any number of threads.
fn mean_luminance(picture: &[[f32; 3]]) -> f64 {
    const BLOCK: usize = 4096;
    let block = |pixels: &[[f32; 3]]| -> f64 {
        pixels
            .iter()
            .map(|[red, green, blue]| {
                0.2126 * f64::from(*red) + 0.7152 * f64::from(*green) + 0.0722 * f64::from(*blue)
            })
            .sum()
    };
    let sums: Vec<f64> = picture.par_chunks(BLOCK).map(block).collect();
    sums.iter().sum::<f64>() / picture.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn gain_follows_the_light_with_its_time_constant_within_its_limits() {
        let exposure = Exposure { target: 0.2, time_constant_secs: 1.0, least_gain: 0.5, most_gain: 4.0 };
        let entries = Entries::default();
        let mut state = ExposureState::default();
        let mut step = |light: f32| {
            let mut picture = vec![[light; 3]; 9000];
            let gain = exposure.expose(&mut picture, &mut state, 0.1, &entries.tally());
            assert!((f64::from(picture[5][1]) - f64::from(light) * gain).abs() < 1e-6);
            gain
        };
        assert!((step(0.1) - 2.0).abs() < 1e-6, "the first frame is exposed by itself");
        assert!((step(0.2) - 2.0).abs() < 1e-6, "a change is seen a frame later");
        // Nine tenths of a second later a share exp(-0.9) of the ratio 2 is left.
        let gain = (0..9).map(|_| step(0.2)).last().expect("nine frames");
        assert!((gain - 2.0_f64.powf((-0.9_f64).exp())).abs() < 1e-3, "{gain}");
        assert!((0..200).map(|_| step(9.0)).last().is_some_and(|gain| (gain - 0.5).abs() < 1e-3));
        assert!((0..200).map(|_| step(0.0)).last().is_some_and(|gain| (gain - 4.0).abs() < 1e-2));
        assert_eq!(entries.count(EffectKind::Exposure), 411);
    }
}
