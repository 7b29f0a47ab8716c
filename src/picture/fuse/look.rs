//! Describes how somebody looks by six numbers: how much redder and bluer than green the upper and the lower half are, how light somebody
//! is, and by how much the upper half is lighter than the lower.
//!
//! Ratios of gamma-coded channels: a change of exposure multiplies all three alike, so of these it changes but how light somebody is.

use videofields_vision::frame::{Mask, YuvImage};
use videofields_vision::segment::{MOVING, PixelRect};

/// Pixels a half that are looked at, about; on a grid.
const SAMPLES: u32 = 96;

/// Pixels a half that must be foreground, of those looked at.
const LEAST_SAMPLES: u32 = 12;

/// Rows or columns of foreground below which colours are the surroundings'.
const LEAST_SIDE_PX: u32 = 6;

/// Keeps ratios of dark colours finite: share of white.
const DARK: f64 = 0.04;

/// Numbers of a look.
const N: usize = 6;

/// Standard deviation of each number between two pictures of one person: white balance, the other side, and, of how light they are, sun
/// and shade. In one camera's pictures of ten people of PETS 2009 it is 0.03 to 0.07 for colours and 0.2 for lightness.
const SAME_SD: [f64; N] = [0.15, 0.15, 0.15, 0.15, 0.4, 0.2];

/// Standard deviation of each number among people: there 0.06 to 0.14 for colours, 0.37 for lightness, 0.38 for its difference.
const SPREAD: [f64; N] = [0.15, 0.15, 0.15, 0.15, 0.4, 0.4];

/// What looks may say at most for and against.
const COST: [f64; 2] = [-2.0, 4.0];

/// Natural logarithms of red over green and blue over green of the upper and the lower half, of the lightness of both, and of the upper
/// half's over the lower half's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Look([f64; N]);

impl Look {
    /// Returns the look of what moves within `rect`; `None` where that is too small. The masks have the picture's size.
    pub(super) fn of(image: &YuvImage, labels: &Mask, rect: PixelRect) -> Option<Self> {
        Self::of_pixels(image, labels, rect, |_, _| true)
    }

    /// Returns the look of what moves within `rect` at the pixels that `is_shown` (column and row) names.
    pub(super) fn of_pixels(
        image: &YuvImage,
        labels: &Mask,
        rect: PixelRect,
        is_shown: impl Fn(u32, u32) -> bool,
    ) -> Option<Self> {
        if rect.width < LEAST_SIDE_PX || rect.height < 2 * LEAST_SIDE_PX || labels.width != image.width() {
            return None;
        }
        let half = rect.height / 2;
        let [upper, lower] = [rect.y, rect.y + half]
            .map(|y| ratios(image, labels, PixelRect { y, height: half, ..rect }, &is_shown));
        let ([a, b, light], [c, d, lower_light]) = (upper?, lower?);
        Some(Self([a, b, c, d, f64::midpoint(light, lower_light), light - lower_light]))
    }

    /// Returns the look of somebody grey, so light above and below.
    #[cfg(test)]
    pub(super) fn grey(upper: f64, lower: f64) -> Self {
        let [upper, lower] = [upper, lower].map(|share| (share + DARK).ln());
        Self([0.0, 0.0, 0.0, 0.0, f64::midpoint(upper, lower), upper - lower])
    }

    /// This one and a share of another.
    pub(super) fn blended(&self, other: &Self, share: f64) -> Self {
        let [own, its] = [self.0, other.0];
        Self(std::array::from_fn(|idx| (its[idx] - own[idx]).mul_add(share, own[idx])))
    }

    /// Cost of both being one's: a log-likelihood ratio. The numbers hang together, so they count half.
    pub(super) fn cost(&self, other: &Self) -> f64 {
        let of = |idx: usize| {
            let variance = SAME_SD[idx].powi(2);
            let spread = variance + 2.0 * SPREAD[idx].powi(2);
            let gap = (self.0[idx] - other.0[idx]).powi(2);
            0.5 * (gap / variance - gap / spread + (variance / spread).ln())
        };
        (0.5 * (0..N).map(of).sum::<f64>()).clamp(COST[0], COST[1])
    }
}

/// Returns the ratios of one half's mean colour, and its lightness.
fn ratios(
    image: &YuvImage,
    labels: &Mask,
    rect: PixelRect,
    is_shown: impl Fn(u32, u32) -> bool,
) -> Option<[f64; 3]> {
    let step = f64::from(rect.width * rect.height / SAMPLES).sqrt().floor().max(1.0) as u32;
    let [luma, u, v] = [0, 1, 2].map(|idx| image.plane(idx));
    let (mut sums, mut count) = ([0_u32; 3], 0);
    let bottom = (rect.y + rect.height).min(labels.height).min(image.height());
    for y in (rect.y..bottom).step_by(step as usize) {
        let (mask, rows) = (labels.row(y), [luma.row(y), u.row(y / 2), v.row(y / 2)]);
        for x in (rect.x..(rect.x + rect.width).min(labels.width)).step_by(step as usize) {
            let is_shown = is_shown(x, y);
            let x = x as usize;
            if is_shown && mask[x] == MOVING {
                for (sum, code) in sums.iter_mut().zip([rows[0][x], rows[1][x / 2], rows[2][x / 2]]) {
                    *sum += u32::from(code);
                }
                count += 1;
            }
        }
    }
    if count < LEAST_SAMPLES {
        return None;
    }
    let (offset, scale, chroma) = image.range().luma_offset_luma_scale_chroma_scale();
    let mean = sums.map(|sum| sum as f32 / count as f32);
    let ypbpr = [(mean[0] - offset) / scale, (mean[1] - 128.0) / chroma, (mean[2] - 128.0) / chroma];
    let rgb = image.matrix().rgb_from_ypbpr().map(|row| {
        let value: f32 = row.iter().zip(ypbpr).map(|(factor, part)| factor * part).sum();
        f64::from(value).max(0.0) + DARK
    });
    let lightness = (f64::from(ypbpr[0]).max(0.0) + DARK).ln();
    Some([(rgb[0] / rgb[1]).ln(), (rgb[2] / rgb[1]).ln(), lightness])
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::frame::{ColorMatrix, ColorRange, RgbImage};

    const RECT: PixelRect = PixelRect { x: 4, y: 2, width: 12, height: 32 };

    /// Somebody with a jacket and trousers of these colours, on grey.
    fn look(jacket: [u8; 3], trousers: [u8; 3], gain: f64, range: ColorRange) -> Option<Look> {
        let (width, height) = (24, 40);
        let mut labels = Mask::filled(width, height, 0);
        let mut data = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let is_inside =
                    (RECT.x..RECT.x + RECT.width).contains(&x) && (RECT.y..RECT.y + RECT.height).contains(&y);
                let color = if y < RECT.y + 16 { jacket } else { trousers };
                let color = if is_inside { color } else { [128; 3] };
                labels.data[(y * width + x) as usize] = if is_inside { MOVING } else { 0 };
                data.extend(color.map(|code| (f64::from(code) * gain).round() as u8));
            }
        }
        let image = YuvImage::from_rgb(&RgbImage { width, height, data }, ColorMatrix::Bt601, range).unwrap();
        Look::of(&image, &labels, RECT)
    }

    #[test]
    fn exposure_changes_little_and_clothes_much() {
        let own = look([180, 60, 50], [40, 60, 150], 1.0, ColorRange::Full).unwrap();
        let darker = look([180, 60, 50], [40, 60, 150], 0.6, ColorRange::Limited).unwrap();
        let other = look([60, 160, 70], [150, 140, 60], 1.0, ColorRange::Full).unwrap();
        let swapped = look([40, 60, 150], [180, 60, 50], 1.0, ColorRange::Full).unwrap();
        assert!(own.cost(&own) <= -0.99 && own.cost(&darker) < -0.5, "{}", own.cost(&darker));
        assert!(own.cost(&other) > 2.0 && own.cost(&swapped) > 2.0, "{}", own.cost(&other));
    }

    #[test]
    fn grey_clothes_are_told_apart_by_how_light_they_are_above_and_below() {
        let of = |jacket: u8, trousers: u8, gain: f64| {
            look([jacket; 3], [trousers; 3], gain, ColorRange::Full).unwrap()
        };
        let own = of(200, 60, 1.0);
        assert!(own.cost(&of(60, 200, 1.0)) > 2.0, "the other way round");
        assert!(own.cost(&of(60, 60, 1.0)) > 0.5 && own.cost(&of(200, 200, 1.0)) > 0.5);
        let shaded = own.cost(&of(200, 60, 0.6));
        assert!(shaded < -0.8 && shaded > own.cost(&own), "in the shade: {shaded}");
        let drawn = Look::grey(200.0 / 255.0, 60.0 / 255.0);
        assert!(own.0.iter().zip(drawn.0).all(|(a, b)| (a - b).abs() < 0.02), "{own:?} {drawn:?}");
    }

    #[test]
    fn black_is_finite_and_what_is_small_has_no_look() {
        let black = look([0; 3], [0; 3], 1.0, ColorRange::Limited).unwrap();
        let [colors @ .., lightness, difference] = black.0;
        assert!(colors.iter().chain([&difference]).all(|number| number.abs() < 0.2), "{black:?}");
        assert!((lightness - DARK.ln()).abs() < 0.2, "{black:?}");
        let image = YuvImage::filled(24, 40, [90, 128, 128], ColorMatrix::Bt709, ColorRange::Full);
        let nothing = Mask::filled(24, 40, 0);
        assert_eq!(Look::of(&image, &nothing, RECT), None);
        let all = Mask::filled(24, 40, MOVING);
        assert_eq!(Look::of(&image, &all, PixelRect { width: 3, ..RECT }), None);
        assert_eq!(Look::of(&image, &Mask::filled(8, 8, MOVING), RECT), None);
        assert!(Look::of(&image, &all, PixelRect { x: 0, y: 0, width: 24, height: 40 }).is_some());
        assert_eq!(
            Look::of(&image, &all, PixelRect { x: 20, y: 30, width: 30, height: 40 }),
            None,
            "beyond the picture"
        );
    }
}
