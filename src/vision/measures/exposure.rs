//! Pictures as if they were exposed alike, so that what is compared is all else.

use crate::frame::{Mask, RgbImage, codes_of};
use glam::Vec3;

/// Light that codes cannot tell from none.
const DARK: f32 = 1e-4;

/// A picture as if it had another's exposure and white balance: its light times one factor a channel, so that both have the same median
/// where `part` is not 0. As it is where `part` is 0 everywhere.
///
/// # Panics
/// When the sizes differ.
#[must_use]
pub fn exposed_like(of: &RgbImage, like: &RgbImage, part: &Mask) -> RgbImage {
    let light = |picture: &RgbImage, pixel: usize| {
        picture.light(pixel as u32 % picture.width, pixel as u32 / picture.width).to_array()
    };
    let pixels = || part.data.iter().enumerate().filter(|(_, value)| **value > 0).map(|(pixel, _)| pixel);
    let median = |picture: &RgbImage, channel: usize| {
        let mut all: Vec<f32> = pixels().map(|pixel| light(picture, pixel)[channel]).collect();
        let middle = all.len() / 2;
        if all.is_empty() {
            return DARK;
        }
        all.select_nth_unstable_by(middle, f32::total_cmp).1.max(DARK)
    };
    let gain = [0, 1, 2].map(|channel| median(like, channel) / median(of, channel));
    let n_pixels = of.data.len() / 3;
    let data =
        (0..n_pixels).flat_map(|pixel| codes_of(Vec3::from(light(of, pixel)) * Vec3::from(gain))).collect();
    RgbImage { width: of.width, height: of.height, data }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_darker_picture_is_as_bright_as_the_other_where_it_counts() {
        let code = |i: u32| (40 + 3 * i) as u8;
        let like = RgbImage {
            width: 8,
            height: 8,
            data: (0..64).flat_map(|i| [code(i), 90, 200 - code(i) / 2]).collect(),
        };
        let dark = (0..64).flat_map(|i| codes_of(like.light(i % 8, i / 8) * Vec3::new(0.5, 0.8, 1.0)));
        let of = RgbImage { width: 8, height: 8, data: dark.collect() };
        let mut part = Mask::filled(8, 8, 255);
        part.data[0] = 0;
        let found = exposed_like(&of, &like, &part);
        assert!(found.data.iter().zip(&like.data).all(|(found, like)| found.abs_diff(*like) <= 2));
        assert_eq!(exposed_like(&of, &like, &Mask::filled(8, 8, 0)), of);
    }
}
