//! The one place that turns YUV into sRGB and sRGB into linear light on the CPU; `shaders/common/color.wgsl` is
//! its counterpart on the GPU.
//!
//! [H.273] ITU-T H.273 (2021), Coding-independent code points, equations 20 to 32 and 38 to 40.

/// Which matrix relates YUV and RGB, named as in [H.273] table 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorMatrix {
    /// Standard definition (also JPEG).
    Bt601,
    /// High definition.
    Bt709,
    /// Ultra high definition, non-constant luminance.
    Bt2020,
}

/// Which codes stand for black and white.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorRange {
    /// Luma 16 to 235, chroma 16 to 240.
    Limited,
    /// Luma and chroma 0 to 255.
    Full,
}

impl ColorMatrix {
    /// The weights of red and blue in luma, Kr and Kb.
    #[must_use]
    pub const fn red_blue_weights(self) -> (f32, f32) {
        match self {
            Self::Bt601 => (0.299, 0.114),
            Self::Bt709 => (0.2126, 0.0722),
            Self::Bt2020 => (0.2627, 0.0593),
        }
    }

    /// Rows R, G, B: factors of `(Y', Pb, Pr)`, with Y' in 0 to 1 and Pb, Pr in -0.5 to 0.5.
    #[must_use]
    pub fn rgb_from_ypbpr(self) -> [[f32; 3]; 3] {
        let (kr, kb) = self.red_blue_weights();
        let kg = 1.0 - kr - kb;
        [
            [1.0, 0.0, 2.0 * (1.0 - kr)],
            [1.0, -2.0 * (1.0 - kb) * kb / kg, -2.0 * (1.0 - kr) * kr / kg],
            [1.0, 2.0 * (1.0 - kb), 0.0],
        ]
    }
}

impl ColorRange {
    /// (luma code of black, luma codes from black to white, chroma codes of a unit of Pb or Pr).
    #[must_use]
    pub const fn luma_offset_luma_scale_chroma_scale(self) -> (f32, f32, f32) {
        match self {
            Self::Limited => (16.0, 219.0, 224.0),
            Self::Full => (0.0, 255.0, 255.0),
        }
    }
}

/// One row: luma of `n` columns and chroma of `n.div_ceil(2)` to `3 n` bytes of sRGB.
pub(super) fn rgb_from_yuv_rows(
    matrix: ColorMatrix,
    range: ColorRange,
    luma: &[u8],
    u: &[u8],
    v: &[u8],
    rgb: &mut [u8],
) {
    let m = matrix.rgb_from_ypbpr();
    let (luma_offset, luma_scale, chroma_scale) = range.luma_offset_luma_scale_chroma_scale();
    let (y_gain, c_gain) = (255.0 / luma_scale, 255.0 / chroma_scale);
    for (x, (y, out)) in luma.iter().zip(rgb.chunks_exact_mut(3)).enumerate() {
        let y = (f32::from(*y) - luma_offset) * y_gain;
        let pb = (f32::from(u[x / 2]) - 128.0) * c_gain;
        let pr = (f32::from(v[x / 2]) - 128.0) * c_gain;
        for (channel, row) in out.iter_mut().zip(m) {
            // A cast from float saturates, so codes outside the range become black or white.
            *channel = (row[0] * y + row[1] * pb + row[2] * pr + 0.5) as u8;
        }
    }
}

/// Rows Y, U, V: 16-bit fixed-point factors of 8-bit R, G, B, and the offset that rounds and places them.
pub(super) type YuvFromRgb = [([i32; 3], i32); 3];

/// Fraction bits of [`YuvFromRgb`].
pub(super) const FRACTION_BITS: u32 = 16;

/// The inverse of [`rgb_from_yuv_rows`] ([H.273] equations 38 to 40 with 20 to 25).
pub(super) fn yuv_from_rgb(matrix: ColorMatrix, range: ColorRange) -> YuvFromRgb {
    let (kr, kb) = matrix.red_blue_weights();
    let (luma_offset, luma_scale, chroma_scale) = range.luma_offset_luma_scale_chroma_scale();
    let one = (1_u32 << FRACTION_BITS) as f32;
    // An 8-bit channel c stands for c / 255; grey must come out without chroma, so green takes what the rounded
    // factors of red and blue leave over.
    let row = |red: f32, blue: f32, sum: f32, offset: f32| {
        let [red, blue, sum] = [red, blue, sum].map(|factor| (factor / 255.0 * one).round() as i32);
        ([red, sum - red - blue, blue], (offset * one + 0.5 * one) as i32)
    };
    let (u_red, v_blue) = (-0.5 * kr / (1.0 - kb), -0.5 * kb / (1.0 - kr));
    [
        row(kr * luma_scale, kb * luma_scale, luma_scale, luma_offset),
        row(u_red * chroma_scale, 0.5 * chroma_scale, 0.0, 128.0),
        row(0.5 * chroma_scale, v_blue * chroma_scale, 0.0, 128.0),
    ]
}

/// Linear light of an sRGB-coded value, both 0 to 1 (IEC 61966-2-1).
#[must_use]
pub fn linear_from_srgb(value: f32) -> f32 {
    if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB code of a linear value, both 0 to 1 (IEC 61966-2-1).
#[must_use]
pub fn srgb_from_linear(value: f32) -> f32 {
    if value <= 0.003_130_8 { value * 12.92 } else { 1.055_f32.mul_add(value.powf(1.0 / 2.4), -0.055) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_and_linear_are_inverses() {
        for code in 0..=255_u8 {
            let value = f32::from(code) / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(value)) - value).abs() < 1e-5, "{code}");
        }
    }

    #[test]
    fn white_has_no_chroma_in_any_matrix() {
        for matrix in [ColorMatrix::Bt601, ColorMatrix::Bt709, ColorMatrix::Bt2020] {
            for row in matrix.rgb_from_ypbpr() {
                assert_eq!(row[0], 1.0, "{matrix:?}");
            }
        }
    }
}
