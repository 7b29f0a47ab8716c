//! Pictures for the tests of both forms.

use super::Format;
use crate::frame::{ColorMatrix, ColorRange, Mask, YuvImage, YuvLayout};

pub(super) fn format(width: u32, height: u32) -> Format {
    Format { width, height, matrix: ColorMatrix::Bt601, range: ColorRange::Limited }
}

pub(super) fn filled(width: u32, height: u32, yuv: [u8; 3]) -> YuvImage {
    YuvImage::filled(width, height, yuv, ColorMatrix::Bt601, ColorRange::Limited)
}

/// 16 x 8 pixels of luma 100, one of 200 at column 5 of row 2, its rows padded with what must not be read.
pub(super) fn padded_with_a_light_pixel() -> YuvImage {
    let layout = YuvLayout { strides: [20, 12, 12], offsets: [3, 170, 230], width: 16, height: 8 };
    let mut data = vec![255; 300];
    for (plane, (width, height)) in [(16, 8), (8, 4), (8, 4)].into_iter().enumerate() {
        for y in 0..height {
            let start = layout.offsets[plane] + y * layout.strides[plane];
            data[start..start + width].fill(if plane == 0 { 100 } else { 128 });
        }
    }
    data[layout.offsets[0] + 2 * 20 + 5] = 200;
    YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data)
        .expect("every plane lies within the bytes")
}

/// Share of the pixels that are foreground.
pub(super) fn share(mask: &Mask) -> f64 {
    mask.data.iter().filter(|value| **value == 255).count() as f64 / mask.data.len() as f64
}
