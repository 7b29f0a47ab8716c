//! Sketchy stippling: `[M19]` Du et al. 2019, `Montage4D`, section 6.1, with dots in dark areas beside.
//!
//! `[JO20]` Jarzynski and Olano 2020, Hash functions for GPU rendering (PCG3D).

use super::Stipple;
use crate::frame::srgb_from_linear;
use glam::{Vec2, Vec3};

/// Of sRGB codes (ITU-R BT.709).
const LUMA: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// Three numbers from 0 to below 1 that follow from a cell alone: `[JO20]`.
fn random(cell: [i32; 2]) -> Vec3 {
    let mut v = [cell[0] as u32, cell[1] as u32, 0];
    v = v.map(|of| of.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    let mixed = |v: [u32; 3]| {
        let x = v[0].wrapping_add(v[1].wrapping_mul(v[2]));
        let y = v[1].wrapping_add(v[2].wrapping_mul(x));
        let z = v[2].wrapping_add(x.wrapping_mul(y));
        [x, y, z]
    };
    v = mixed(v).map(|of| of ^ (of >> 16));
    // 24 bits are what a float holds exactly.
    Vec3::from(mixed(v).map(|of| (of >> 8) as f32 / 16_777_216.0))
}

/// The cell of a pixel that lies at `anchored` in all of the picture, wherever that begins.
const fn cell(anchored: [i32; 2], dot_px: u32) -> [i32; 2] {
    let dot = dot_px as i32;
    [anchored[0].div_euclid(dot), anchored[1].div_euclid(dot)]
}

/// Pixels from one to that which its dot is of, and how dense dots must be for it to be one, 0 to 1.
#[must_use]
pub fn dot_of(anchored: [i32; 2], settings: &Stipple) -> ([i32; 2], f32) {
    let random = random(cell(anchored, settings.dot_px));
    // Evenly from the square, bent to the disc without an angle.
    let square = random.truncate() * 2.0 - 1.0;
    let disc = square
        * (Vec2::ONE - 0.5 * Vec2::new(square.y, square.x) * Vec2::new(square.y, square.x)).max(Vec2::ZERO);
    let offset = (disc * settings.blur_px as f32 + 0.5).floor();
    ([offset.x as i32, offset.y as i32], random.z)
}

/// The pixel that another's dot is of, within a picture of that size.
#[must_use]
pub fn partner(pixel: [i32; 2], anchored: [i32; 2], settings: &Stipple, size_px: [u32; 2]) -> [i32; 2] {
    let (offset, _) = dot_of(anchored, settings);
    let within = |axis: usize| (pixel[axis] + offset[axis]).clamp(0, size_px[axis] as i32 - 1);
    [within(0), within(1)]
}

/// The sRGB code of a pixel, grey: `color` is its own, `beside` that of its partner, linear light; `threshold` is [`dot_of`]'s.
///
/// Colour dodge by the inverse of what is beside is a / b, at most 1; of black on black 1, the limit of everything flat.
#[must_use]
pub fn stippled(color: Vec3, beside: Vec3, threshold: f32, settings: &Stipple) -> f32 {
    let dodged = |color: f32, beside: f32| {
        let [own, other] = [color, beside].map(|light| srgb_from_linear(light.clamp(0.0, 1.0)));
        if own >= other { 1.0 } else { own / other }
    };
    let dodged = Vec3::new(dodged(color.x, beside.x), dodged(color.y, beside.y), dodged(color.z, beside.z));
    let grey = dodged.dot(LUMA).clamp(0.0, 1.0).powf(settings.contrast);
    let tone = Vec3::from(color.to_array().map(|light| srgb_from_linear(light.clamp(0.0, 1.0)))).dot(LUMA);
    let dark = (1.0 - tone).max(0.0);
    // More than linearly, so that only what is dark is dotted densely.
    if threshold < settings.shade * dark * dark { 0.0 } else { grey }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Stipple = Stipple { dot_px: 1, blur_px: 6, contrast: 2.0, shade: 0.0 };

    #[test]
    fn what_is_flat_is_paper_from_black_to_white() {
        for light in [0.0, 1e-4, 0.2, 1.0] {
            let color = Vec3::splat(light);
            assert_eq!(stippled(color, color, 0.5, &PLAIN), 1.0, "{light}");
        }
    }

    #[test]
    fn the_darker_side_of_an_edge_is_ink_and_the_brighter_paper() {
        assert_eq!(stippled(Vec3::ZERO, Vec3::ONE, 0.5, &PLAIN), 0.0);
        assert_eq!(stippled(Vec3::ONE, Vec3::ZERO, 0.5, &PLAIN), 1.0);
        let grey = stippled(Vec3::splat(0.05), Vec3::splat(0.2), 0.5, &PLAIN);
        assert!((0.1..0.5).contains(&grey), "{grey}");
    }

    #[test]
    fn dots_are_as_dense_as_it_is_dark() {
        let shaded = Stipple { shade: 1.0, ..PLAIN };
        let density = |light: f32| {
            let color = Vec3::splat(light);
            let is_ink = |at: i32| {
                let (_, threshold) = dot_of([at % 100, at / 100], &shaded);
                stippled(color, color, threshold, &shaded) == 0.0
            };
            (0..10_000).filter(|at| is_ink(*at)).count() as f32 / 1e4
        };
        assert!(density(0.0) > 0.99 && density(1.0) == 0.0);
        let dark = 1.0 - srgb_from_linear(0.1);
        assert!((density(0.1) - dark * dark).abs() < 0.02, "{}", density(0.1));
    }

    #[test]
    fn cells_repeat_everywhere_alike_and_offsets_stay_within_the_blur() {
        for (x, y) in [(0, 0), (-1, -1), (i32::MIN, i32::MAX), (123_456, -98_765)] {
            for dot_px in [1, 3, 8] {
                let settings = Stipple { dot_px, blur_px: 32, ..PLAIN };
                let ([right, down], threshold) = dot_of([x, y], &settings);
                assert!(right * right + down * down <= 34 * 34, "{right} {down}");
                assert!((0.0..1.0).contains(&threshold));
            }
        }
        let settings = Stipple { dot_px: 4, ..PLAIN };
        assert_eq!(dot_of([-4, 8], &settings), dot_of([-1, 11], &settings), "one dot");
        assert_ne!(dot_of([-4, 8], &settings), dot_of([0, 8], &settings), "the next");
        assert_eq!(partner([0, 0], [7, 7], &settings, [1, 1]), [0, 0], "one pixel");
    }

    #[test]
    fn offsets_fill_the_disc_and_have_no_side() {
        let n = 10_000;
        let offsets = (0..n).map(|at| dot_of([at % 100, at / 100], &PLAIN).0);
        let sum = offsets.fold([0, 0], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
        assert!(sum.iter().all(|along| (along.abs() as f32 / n as f32) < 0.1), "{sum:?}");
    }
}
