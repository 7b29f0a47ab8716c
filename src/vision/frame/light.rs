//! Colours of RGB pictures in linear light: between pixels, in levels of detail, and as far apart as eyes see them.

use super::RgbImage;
use super::color::{linear_from_srgb, srgb_from_linear};
use glam::{DVec2, Vec3};
use std::sync::LazyLock;

/// Linear light of every code.
static LIGHT: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| linear_from_srgb(code as f32 / 255.0)));

impl RgbImage {
    /// A pixel in linear light, 0 to 1 a channel.
    ///
    /// # Panics
    /// Beside the picture.
    #[must_use]
    pub fn light(&self, x: u32, y: u32) -> Vec3 {
        let first = (y as usize * self.width as usize + x as usize) * 3;
        let [red, green, blue] = [0, 1, 2].map(|channel| LIGHT[usize::from(self.data[first + channel])]);
        Vec3::new(red, green, blue)
    }

    /// The colour at a texture coordinate, in linear light: between the four pixels around it, by how near each is. Beside the picture
    /// that of its nearest place.
    #[must_use]
    pub fn light_at(&self, texture: DVec2) -> Vec3 {
        let size = DVec2::new(f64::from(self.width), f64::from(self.height));
        let at = (texture * size - 0.5).clamp(DVec2::ZERO, (size - 1.0).max(DVec2::ZERO));
        let (low, share) = (at.floor(), at.fract().as_vec2());
        let pixel = |x: f64, y: f64| self.light(x.min(size.x - 1.0) as u32, y.min(size.y - 1.0) as u32);
        let across = |y: f64| pixel(low.x, y).lerp(pixel(low.x + 1.0, y), share.x);
        across(low.y).lerp(across(low.y + 1.0), share.y)
    }

    /// A picture half as large, each pixel the mean light of those that it stands for.
    #[must_use]
    pub fn halved(&self) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut data = Vec::with_capacity(width as usize * height as usize * 3);
        for y in 0..height {
            for x in 0..width {
                let of = |along: u32, last: u32| [2 * along, 2 * along + 1].map(|at| at.min(last - 1));
                let sum: Vec3 = of(y, self.height)
                    .into_iter()
                    .flat_map(|y| of(x, self.width).map(|x| self.light(x, y)))
                    .sum();
                data.extend(codes_of(sum / 4.0));
            }
        }
        Self { width, height, data }
    }
}

/// The sRGB codes of linear light; what is beyond 0 to 1 is cut off.
#[must_use]
pub fn codes_of(light: Vec3) -> [u8; 3] {
    light.to_array().map(|light| (srgb_from_linear(light.clamp(0.0, 1.0)) * 255.0).round() as u8)
}

/// A picture in levels of detail, each half as large as the one before.
#[derive(Clone, Debug)]
pub struct Levels {
    levels: Vec<RgbImage>,
}

impl Levels {
    /// Of a picture with at least one pixel, down to one of a single row or column.
    #[must_use]
    pub fn of(picture: RgbImage) -> Self {
        let mut levels = vec![picture];
        while let Some(last) = levels.last().filter(|last| last.width.min(last.height) > 1) {
            levels.push(last.halved());
        }
        Self { levels }
    }

    /// The picture itself.
    #[must_use]
    pub fn finest(&self) -> &RgbImage {
        &self.levels[0]
    }

    /// The colour at a texture coordinate in a level of detail, 0 the finest, between two levels by how near each is; linear light.
    #[must_use]
    pub fn light_at(&self, texture: DVec2, level: f32) -> Vec3 {
        let level = level.clamp(0.0, (self.levels.len() - 1) as f32);
        let finer = level.floor() as usize;
        let color = self.levels[finer].light_at(texture);
        match level.fract() {
            0.0 => color,
            share => color.lerp(self.levels[finer + 1].light_at(texture), share),
        }
    }

    /// Bytes that it takes.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.levels.iter().map(|level| level.data.len()).sum()
    }
}

/// CIE L*a*b* of linear light of sRGB's primaries, for D65 (CIE 15:2004): distances are Delta E 76.
#[must_use]
pub fn lab_of(light: Vec3) -> Vec3 {
    // IEC 61966-2-1, a row over white's X, Y and Z.
    let xyz = Vec3::new(
        light.dot(Vec3::new(0.412_456_4, 0.357_576_1, 0.180_437_5)) / 0.950_47,
        light.dot(Vec3::new(0.212_672_9, 0.715_152_2, 0.072_175)),
        light.dot(Vec3::new(0.019_333_9, 0.119_192, 0.950_304_1)) / 1.088_83,
    );
    let [x, y, z] = xyz
        .max(Vec3::ZERO)
        .to_array()
        .map(|of| if of > 216.0 / 24_389.0 { of.cbrt() } else { (24_389.0 / 27.0 * of + 16.0) / 116.0 });
    Vec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32, code: impl Fn(u32, u32) -> [u8; 3]) -> RgbImage {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        RgbImage { width, height, data: pixels.flat_map(|(x, y)| code(x, y)).collect() }
    }

    #[test]
    fn between_pixels_light_is_mixed_and_not_codes() {
        let of = picture(2, 1, |x, _| [if x == 0 { 0 } else { 255 }; 3]);
        let check = |u: f64, expected: f32| {
            let light = of.light_at(DVec2::new(u, 0.5));
            assert!((light - expected).abs().max_element() < 1e-6, "{light}");
        };
        check(0.25, 0.0);
        check(0.5, 0.5);
        check(0.75, 1.0);
        check(-3.0, 0.0);
        check(7.0, 1.0);
        assert_eq!(of.halved().data, [188; 3]);
    }

    #[test]
    fn levels_end_and_are_mixed() {
        let levels = Levels::of(picture(5, 3, |x, y| [(x * 50) as u8, (y * 100) as u8, 7]));
        assert_eq!(levels.levels.len(), 2);
        let at = DVec2::new(0.4, 0.6);
        let [fine, coarse] = [0.0, 1.0].map(|level| levels.light_at(at, level));
        assert_eq!(levels.light_at(at, -2.0), fine);
        assert_eq!(levels.light_at(at, 9.0), coarse);
        assert!((levels.light_at(at, 0.25) - fine.lerp(coarse, 0.25)).length() < 1e-6);
        assert_eq!(levels.finest().light_at(at), fine);
        assert_eq!(levels.n_bytes(), 3 * (15 + 2));
    }

    #[test]
    fn lab_is_that_of_tables() {
        // Of white, black and sRGB's red and blue: Lindbloom's calculator, D65.
        let check = |codes: [u8; 3], lab: [f32; 3]| {
            let light = picture(1, 1, |_, _| codes).light(0, 0);
            assert!((lab_of(light) - Vec3::from(lab)).abs().max_element() < 0.02, "{}", lab_of(light));
        };
        check([255; 3], [100.0, 0.0, 0.0]);
        check([0; 3], [0.0; 3]);
        check([255, 0, 0], [53.24, 80.09, 67.20]);
        check([0, 0, 255], [32.30, 79.19, -107.86]);
        check([119; 3], [50.03, 0.0, 0.0]);
    }
}
