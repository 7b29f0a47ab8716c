//! Random numbers that hang on what they are for, not on who asks first.
//!
//! A number is a hash of (seed, camera, frame, effect, index), so threads and their order cannot change it.

use super::EffectKind;
use std::f64::consts::TAU;

/// The golden ratio's odd multiplier of `SplitMix64`.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finaliser of `SplitMix64` (Steele, Lea, Flood 2014, Fast splittable pseudorandom number generators).
const fn finish(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

const fn mix(state: u64, value: u64) -> u64 {
    finish(state.wrapping_add(STEP) ^ finish(value.wrapping_add(STEP)))
}

/// Where random numbers for one effect of one frame (or of a whole camera) are drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draw {
    state: u64,
}

impl Draw {
    /// Numbers for the camera with this id in a world with this seed.
    #[must_use]
    pub fn of_camera(seed: u64, camera_id: &str) -> Self {
        let name = camera_id.bytes().fold(camera_id.len() as u64, |state, byte| mix(state, u64::from(byte)));
        Self { state: mix(mix(0, seed), name) }
    }

    /// The same camera's numbers for one frame.
    #[must_use]
    pub const fn at_frame(self, frame: u64) -> Self {
        Self { state: mix(self.state ^ 0x66_7261_6d65, frame) }
    }

    /// Numbers of one effect alone.
    #[must_use]
    pub const fn of_effect(self, kind: EffectKind) -> Self {
        Self { state: mix(self.state, 1 + kind as u64) }
    }

    /// A number in [0, 1).
    #[must_use]
    pub const fn unit(self, index: u64) -> f64 {
        (mix(self.state, index) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number in [-1, 1).
    #[must_use]
    pub const fn signed(self, index: u64) -> f64 {
        self.unit(index) * 2.0 - 1.0
    }

    /// A number of the normal distribution with mean 0 and deviation 1, by Box and Muller's formula.
    #[must_use]
    pub fn normal(self, index: u64) -> f64 {
        self.two_normal(index).0
    }

    /// Two independent normal numbers for the price of one.
    #[must_use]
    pub fn two_normal(self, index: u64) -> (f64, f64) {
        let bits = mix(self.state, index);
        // 32 bits each; the radius' number is in (0, 1], so that its logarithm is finite.
        let radius_from = ((bits >> 32) + 1) as f64 / 4_294_967_296.0;
        let turn = (bits & 0xffff_ffff) as f64 / 4_294_967_296.0;
        let radius = (-2.0 * radius_from.ln()).sqrt();
        let (sin, cos) = (TAU * turn).sin_cos();
        (radius * cos, radius * sin)
    }

    /// Which of `n` things, evenly.
    #[must_use]
    pub fn below(self, index: u64, n: u64) -> u64 {
        ((self.unit(index) * n as f64) as u64).min(n.saturating_sub(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_hang_on_everything_that_they_are_for() {
        let base = Draw::of_camera(1, "west");
        let others = [
            Draw::of_camera(2, "west").unit(0),
            Draw::of_camera(1, "east").unit(0),
            Draw::of_camera(1, "wes").unit(0),
            base.at_frame(0).unit(0),
            base.at_frame(1).unit(0),
            base.of_effect(EffectKind::Rain).unit(0),
            base.of_effect(EffectKind::Snow).unit(0),
            base.unit(1),
        ];
        for (i, a) in others.iter().enumerate() {
            assert_ne!(*a, base.unit(0));
            assert!(others[i + 1..].iter().all(|b| a != b), "{i}");
        }
        assert_eq!(base.unit(7), Draw::of_camera(1, "west").unit(7));
    }

    #[test]
    fn numbers_are_spread_as_they_should_be() {
        let draw = Draw::of_camera(3, "a");
        let n = 100_000_u64;
        let mean = |value: &dyn Fn(u64) -> f64| (0..n).map(value).sum::<f64>() / n as f64;
        assert!((mean(&|i| draw.unit(i)) - 0.5).abs() < 0.005);
        assert!((mean(&|i| draw.unit(i).powi(2)) - 1.0 / 3.0).abs() < 0.005);
        for value in [&(|i| draw.two_normal(i).0) as &dyn Fn(u64) -> f64, &|i| draw.two_normal(i).1] {
            assert!(mean(value).abs() < 0.015);
            assert!((mean(&|i| value(i).powi(2)) - 1.0).abs() < 0.02);
            // A normal number's fourth moment is 3.
            assert!((mean(&|i| value(i).powi(4)) - 3.0).abs() < 0.15);
        }
        assert!(mean(&|i| draw.two_normal(i).0 * draw.two_normal(i).1).abs() < 0.015);
        assert!((0..n).all(|i| draw.below(i, 7) < 7));
    }
}
