//! A picture from a file, repeated over a surface.
//!
//! Held with all its halvings, so that a sample wider than a pixel gets the mean of what it covers.

use super::linear;
use glam::{DVec2, DVec3};

/// A repeated picture.
#[derive(Clone, Debug)]
pub(crate) struct PaintedPicture {
    /// Width of one copy on the surface, metres; its height follows from the picture's.
    width_m: f64,
    /// From the picture itself to one pixel.
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    /// Linear light. **Shape** height x width, row-major from the top.
    pixels: Vec<[f32; 3]>,
}

impl PaintedPicture {
    /// The picture of `width` columns whose 8-bit sRGB pixels are these, row by row from the top; `None` if they
    /// make no whole rows or there are none.
    pub(crate) fn new(width: usize, srgb: &[u8], width_m: f64) -> Option<Self> {
        let n_pixels = srgb.len() / 3;
        if width == 0 || n_pixels == 0 || !n_pixels.is_multiple_of(width) || !srgb.len().is_multiple_of(3) {
            return None;
        }
        let pixels = srgb.chunks_exact(3).map(|rgb| linear([rgb[0], rgb[1], rgb[2]]).as_vec3().to_array());
        let mut levels = vec![Level { width, height: n_pixels / width, pixels: pixels.collect() }];
        while let Some(level) = levels.last().and_then(Level::halved) {
            levels.push(level);
        }
        Some(Self { width_m, levels })
    }

    pub(super) fn albedo(&self, at: DVec2, footprint_m: f64) -> DVec3 {
        let pixel_m = self.width_m / self.levels[0].width as f64;
        let halvings = (footprint_m / pixel_m).log2().clamp(0.0, (self.levels.len() - 1) as f64);
        let (fine, share) = (halvings.floor(), halvings.fract());
        let level = |halvings: f64| {
            let level = &self.levels[(halvings as usize).min(self.levels.len() - 1)];
            let height_m = self.width_m * self.levels[0].height as f64 / self.levels[0].width as f64;
            level.at(DVec2::new(at.x / self.width_m, -at.y / height_m))
        };
        level(fine).lerp(level(fine + 1.0), share)
    }
}

impl Level {
    fn halved(&self) -> Option<Self> {
        if self.width == 1 && self.height == 1 {
            return None;
        }
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let pixel = |x: usize, y: usize| {
            let at =
                |x: usize, y: usize| self.pixels[y.min(self.height - 1) * self.width + x.min(self.width - 1)];
            let four =
                [at(2 * x, 2 * y), at(2 * x + 1, 2 * y), at(2 * x, 2 * y + 1), at(2 * x + 1, 2 * y + 1)];
            [0, 1, 2].map(|c| four.iter().map(|pixel| pixel[c]).sum::<f32>() * 0.25)
        };
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y));
        Some(Self { width, height, pixels: pixels.collect() })
    }

    /// The picture's colour at a place in widths and heights from its top left, joined evenly between pixels.
    fn at(&self, place: DVec2) -> DVec3 {
        let within = place - place.floor();
        let pixel = within * DVec2::new(self.width as f64, self.height as f64) - 0.5;
        let cell = pixel.floor();
        let share = pixel - cell;
        let at = |dx: i64, dy: i64| {
            let x = (cell.x as i64 + dx).rem_euclid(self.width as i64) as usize;
            let y = (cell.y as i64 + dy).rem_euclid(self.height as i64) as usize;
            DVec3::from_array(self.pixels[y * self.width + x].map(f64::from))
        };
        at(0, 0).lerp(at(1, 0), share.x).lerp(at(0, 1).lerp(at(1, 1), share.x), share.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_repeat_and_far_away_show_their_mean() {
        let mut srgb = vec![0; 4 * 2 * 3];
        srgb[..3].fill(255);
        let picture = PaintedPicture::new(4, &srgb, 2.0).unwrap();
        // Pixels are half a metre; the white one is at the top left of a copy that begins at y = 0 downwards.
        let white = DVec2::new(0.25, -0.25);
        for copy in [DVec2::ZERO, DVec2::new(2.0, 1.0), DVec2::new(-6.0, 4.0)] {
            assert!((picture.albedo(white + copy, 0.0) - DVec3::ONE).length() < 1e-6, "{copy}");
        }
        assert!(picture.albedo(DVec2::new(1.25, -0.25), 0.0).length() < 1e-6);
        assert!((picture.albedo(DVec2::new(0.7, 0.3), 50.0) - DVec3::splat(0.125)).length() < 1e-6);
        assert!(PaintedPicture::new(3, &srgb, 2.0).is_none() && PaintedPicture::new(0, &[], 2.0).is_none());
    }
}
