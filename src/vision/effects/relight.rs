//! Another light on a pixel: `[M19]` Du et al. 2019, `Montage4D`, section 6.2.
//!
//! `[RH01]` Ramamoorthi and Hanrahan 2001, An efficient representation for irradiance environment maps.

use super::harmonics::{BANDS, Harmonics, N_HARMONICS, basis, luminance};
use crate::frame::{linear_from_srgb, srgb_from_linear};
use glam::Vec3;

/// What a matt surface's cosine leaves of each band, over pi: `[RH01]` equation 8.
pub const MATT_BANDS: [f32; 3] = [1.0, 2.0 / 3.0, 0.25];

/// The sRGB code of light that changes nothing.
pub const MEAN_CODE: f32 = 0.5;

/// What a white matt surface sends out, by its normal: linear light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MattLight(pub [Vec3; N_HARMONICS]);

impl MattLight {
    /// The light as bright as it is.
    #[must_use]
    pub fn unscaled(light: &Harmonics) -> Self {
        let mut harmonics = light.0;
        for (value, band) in harmonics.iter_mut().zip(BANDS) {
            *value *= MATT_BANDS[band];
        }
        Self(harmonics)
    }

    /// The light so bright that the luminance of all directions has the code [`MEAN_CODE`] in the mean, and `exposure_stops`
    /// beyond that.
    #[must_use]
    pub fn new(light: &Harmonics, exposure_stops: f32) -> Self {
        let mean = luminance(light.mean()).max(f32::MIN_POSITIVE);
        let scale = linear_from_srgb(MEAN_CODE) / mean * exposure_stops.exp2();
        Self(Self::unscaled(light).0.map(|value| value * scale))
    }

    /// What a surface with that unit normal sends out. Three bands cannot hold hard light: below 0 is 0.
    #[must_use]
    pub fn at(&self, normal: Vec3) -> Vec3 {
        let sum: Vec3 = self.0.iter().zip(basis(normal)).map(|(of, value)| *of * value).sum();
        sum.max(Vec3::ZERO)
    }
}

/// The linear colour of a pixel in another light, of which a white surface there would send out `light`; `strength` (0 to 1) of it.
///
/// `[M19]` equation 2 on sRGB codes, L clamped to 0 to 1: the exponent is 0.5 to 1.5, so that black stays black.
#[must_use]
pub fn relit(color: Vec3, light: Vec3, strength: f32) -> Vec3 {
    let one = |color: f32, light: f32| {
        let code = srgb_from_linear(color.clamp(0.0, 1.0));
        let light = srgb_from_linear(light.clamp(0.0, 1.0));
        let changed = (1.0 - 2.0 * light).abs() * (code.powf(1.5 - light) - code);
        linear_from_srgb((code + strength * changed).clamp(0.0, 1.0))
    };
    Vec3::new(one(color.x, light.x), one(color.y, light.y), one(color.z, light.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Mat3, Quat};

    fn coded(code: f32) -> Vec3 {
        Vec3::splat(linear_from_srgb(code))
    }

    #[test]
    fn half_light_changes_nothing_and_strength_0_neither() {
        for code in [0.0, 0.2, 0.5, 1.0] {
            let color = coded(code);
            assert!((relit(color, coded(0.5), 1.0) - color).abs().max_element() < 1e-6, "{code}");
            assert!((relit(color, coded(1.0), 0.0) - color).abs().max_element() < 1e-6, "{code}");
        }
    }

    #[test]
    fn no_light_darkens_and_full_light_brightens_by_the_formula() {
        let check = |code: f32, light: f32, expected: f32| {
            let found = srgb_from_linear(relit(coded(code), coded(light), 1.0).x);
            assert!((found - expected).abs() < 1e-5, "{code} {light}: {found} {expected}");
        };
        // L = 0: c^1.5; L = 1: c^0.5.
        check(0.25, 0.0, 0.125);
        check(0.25, 1.0, 0.5);
        check(0.25, 0.75, 0.25 + 0.5 * (0.25_f32.powf(0.75) - 0.25));
    }

    #[test]
    fn black_and_white_stay_in_any_light_also_beyond_what_there_is() {
        for light in [0.0, 0.5, 1.0, 1.6, 40.0, f32::INFINITY, -1.0] {
            let light = Vec3::splat(light);
            assert_eq!(relit(Vec3::ZERO, light, 1.0), Vec3::ZERO, "{light}");
            assert!((relit(Vec3::ONE, light, 1.0) - Vec3::ONE).abs().max_element() < 1e-6, "{light}");
        }
    }

    #[test]
    fn even_light_has_the_mean_code_for_every_normal() {
        let even = Harmonics::of(|_| Vec3::splat(0.07)).expect("light");
        let light = MattLight::new(&even, 0.0);
        for normal in [Vec3::X, -Vec3::Z, Vec3::new(0.6, 0.0, 0.8)] {
            assert!((srgb_from_linear(light.at(normal).y) - MEAN_CODE).abs() < 1e-3);
        }
        let brighter = MattLight::new(&even, 1.0).at(Vec3::X).x / light.at(Vec3::X).x;
        assert!((brighter - 2.0).abs() < 1e-4);
    }

    #[test]
    fn hard_light_from_one_side_is_never_below_none() {
        let hard = Harmonics::of(|_| Vec3::splat(0.01)).expect("light").with_sun(Vec3::Z, 20.0);
        let light = MattLight::new(&hard, 0.0);
        for step in 0..64 {
            let (sin, cos) = (step as f32 * 0.0982).sin_cos();
            let at = light.at(Vec3::new(sin, 0.0, cos));
            assert!(at.is_finite() && at.min_element() >= 0.0, "{at}");
        }
    }

    /// `[M19]`: the probe stands in the view, and the normal comes there by the inverse transpose of the model-view matrix.
    #[test]
    fn a_probe_that_is_turned_into_the_view_gives_the_same_light_there() {
        let in_world = |d: Vec3| Vec3::new(1.0 + 0.6 * d.x, 1.0 - 0.4 * d.z, 1.0 + 0.5 * d.x * d.y);
        let view_from_world = Mat3::from_quat(Quat::from_euler(glam::EulerRot::ZYX, 0.7, -0.3, 1.1));
        let in_view = |d: Vec3| in_world(view_from_world.transpose() * d);
        let [world, view] = [Harmonics::of(in_world), Harmonics::of(in_view)].map(|of| of.expect("light"));
        let [world, view] = [world, view].map(|of| MattLight::new(&of, 0.0));
        for normal in [Vec3::X, Vec3::Z, Vec3::new(-0.48, 0.6, 0.64)] {
            // A model that is stretched too: its own normal is what the inverse transpose brings to this one.
            let world_from_model = Mat3::from_diagonal(Vec3::new(2.0, 0.5, 1.0));
            let in_model = (world_from_model.transpose() * normal).normalize();
            let model_view = view_from_world * world_from_model;
            let there = (model_view.inverse().transpose() * in_model).normalize();
            let difference = (world.at(normal) - view.at(there)).abs().max_element();
            assert!(difference < 0.004, "{normal}: {difference}");
        }
    }
}
