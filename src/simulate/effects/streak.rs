//! Draws what falls in front of the picture: short strokes at a depth, blended in linear light.
//!
//! Strokes are drawn in their order, bands of rows in parallel, so the result does not hang on threads.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Rows of a band.
const BAND: usize = 16;

/// One drop or flake on the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Streak {
    /// Its ends, pixels; the same place for a dot.
    pub(super) from: DVec2,
    pub(super) to: DVec2,
    /// Half its width, pixels.
    pub(super) radius_px: f64,
    /// Share of the exposure for which it covers a place on its way, 0 to 1.
    pub(super) opacity: f64,
    /// Distance along the optical axis, metres.
    pub(super) depth_m: f64,
}

/// Half the width of the finest stroke that is drawn; finer ones are drawn this wide and fainter.
const LEAST_RADIUS_PX: f64 = 0.5;

impl Streak {
    /// Share of the light of pixel (x, y) that is the stroke's.
    fn cover(&self, x: usize, y: usize) -> f64 {
        let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        let along = self.to - self.from;
        let length_squared = along.length_squared();
        let share = if length_squared > 1e-12 {
            ((at - self.from).dot(along) / length_squared).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let distance = (at - self.from - along * share).length();
        let radius = self.radius_px.max(LEAST_RADIUS_PX);
        let thin = (self.radius_px / LEAST_RADIUS_PX).min(1.0);
        // A dot that is finer than a pixel is as much too long as it is too wide.
        let short = ((along.length() + 2.0 * self.radius_px) / (2.0 * LEAST_RADIUS_PX)).min(1.0);
        (radius + 0.5 - distance).clamp(0.0, 1.0) * thin * short * self.opacity
    }

    /// First and last row and column that it may touch, within a picture of this size.
    fn reach(&self, width: usize, height: usize) -> Option<[usize; 4]> {
        let reach = self.radius_px.max(LEAST_RADIUS_PX) + 1.0;
        let low = self.from.min(self.to) - reach;
        let high = self.from.max(self.to) + reach;
        let is_outside = high.x < 0.0 || high.y < 0.0 || low.x >= width as f64 || low.y >= height as f64;
        if is_outside || !self.from.is_finite() || !self.to.is_finite() {
            return None;
        }
        Some([
            low.x as usize,
            (high.x as usize).min(width - 1),
            low.y as usize,
            (high.y as usize).min(height - 1),
        ])
    }
}

/// Draws `streaks` that shine with `light` over a linear picture, where nothing stands in front of them.
///
/// `depth_m` is that of the picture, metres along the axis, 0 where it shows the sky.
pub(super) fn draw(
    streaks: &[Streak],
    light: DVec3,
    picture: &mut [[f32; 3]],
    depth_m: &[f32],
    width: usize,
) {
    if width == 0 || picture.is_empty() {
        return;
    }
    let height = picture.len() / width;
    let mut bands: Vec<Vec<usize>> = vec![Vec::new(); height.div_ceil(BAND)];
    for (i, streak) in streaks.iter().enumerate() {
        if let Some([_, _, top, bottom]) = streak.reach(width, height) {
            bands[top / BAND..=bottom / BAND].iter_mut().for_each(|band| band.push(i));
        }
    }
    let light = light.as_vec3().to_array();
    let rows = picture.par_chunks_mut(width * BAND).zip(depth_m.par_chunks(width * BAND)).zip(&bands);
    rows.enumerate().for_each(|(band, ((picture, depth_m), members))| {
        let first_row = band * BAND;
        let last_row = first_row + picture.len() / width - 1;
        for streak in members.iter().map(|i| &streaks[*i]) {
            let Some([left, right, top, bottom]) = streak.reach(width, height) else { continue };
            for y in top.max(first_row)..=bottom.min(last_row) {
                let start = (y - first_row) * width;
                let is_seen = |x: &usize| {
                    let behind = f64::from(depth_m[start + x]);
                    behind <= 0.0 || behind >= streak.depth_m
                };
                for x in (left..=right).filter(is_seen) {
                    blend(&mut picture[start + x], light, streak.cover(x, y) as f32);
                }
            }
        }
    });
}

/// Replaces this share of a pixel's light.
fn blend(pixel: &mut [f32; 3], light: [f32; 3], share: f32) {
    for (value, light) in pixel.iter_mut().zip(light) {
        *value += (light - *value) * share;
    }
}

/// Veils a linear picture with the `light` of air through which one sees `visibility_m` far.
///
/// Koschmieder 1924: light fades by exp(-3.912 d / V), to 2 % at the visibility, and what fades is replaced by the
/// air's own.
pub(super) fn veil(visibility_m: f64, light: DVec3, picture: &mut [[f32; 3]], depth_m: &[f32]) {
    let rate = (3.912 / visibility_m) as f32;
    let light = light.as_vec3().to_array();
    picture.par_iter_mut().zip(depth_m).for_each(|(pixel, depth)| {
        let left = if *depth > 0.0 { (-rate * depth).exp() } else { 0.0 };
        blend(pixel, light, 1.0 - left);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(streak: Streak, depth: f32) -> Vec<[f32; 3]> {
        let (width, height) = (40, 40);
        let mut picture = vec![[0.0; 3]; width * height];
        draw(&[streak], DVec3::ONE, &mut picture, &vec![depth; width * height], width);
        picture
    }

    #[test]
    fn a_stroke_has_the_light_of_its_area_even_finer_than_a_pixel() {
        for (radius_px, length) in [(2.0, 12.0), (1.0, 12.0), (0.25, 12.0), (0.05, 15.0)] {
            let from = DVec2::new(20.3, 12.6);
            let streak = Streak { from, to: from + DVec2::Y * length, radius_px, opacity: 1.0, depth_m: 3.0 };
            let sum: f32 = drawn(streak, 0.0).iter().map(|pixel| pixel[0]).sum();
            let area = 2.0 * radius_px * length;
            let ends = std::f64::consts::PI * radius_px.max(0.5).powi(2) * (radius_px / 0.5).min(1.0);
            assert!((f64::from(sum) / (area + ends) - 1.0).abs() < 0.15, "{radius_px}: {sum} of {area}");
        }
    }

    #[test]
    fn what_stands_in_front_hides_it() {
        let streak = Streak {
            from: DVec2::new(20.0, 10.0),
            to: DVec2::new(20.0, 30.0),
            radius_px: 1.0,
            opacity: 0.5,
            depth_m: 3.0,
        };
        let lit = |depth| drawn(streak, depth).iter().any(|pixel| pixel[0] > 0.0);
        assert!(lit(0.0) && lit(3.5) && !lit(2.5));
        let gone = Streak { from: DVec2::new(-50.0, 3.0), to: DVec2::new(-40.0, 3.0), ..streak };
        assert!(drawn(gone, 0.0).iter().all(|pixel| *pixel == [0.0; 3]));
        let nowhere = Streak { from: DVec2::NAN, ..streak };
        assert!(drawn(nowhere, 0.0).iter().all(|pixel| *pixel == [0.0; 3]));
    }

    #[test]
    fn a_veil_leaves_two_percent_at_the_visibility() {
        let mut picture = [[0.0_f32; 3], [0.0; 3], [0.3; 3]];
        veil(100.0, DVec3::ONE, &mut picture, &[100.0, 1e-3, 0.0]);
        assert!((picture[0][0] - 0.98).abs() < 1e-3 && picture[1][0] < 1e-4 && picture[2][0] == 1.0);
    }
}
