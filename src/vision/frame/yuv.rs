//! A picture in planar YUV 4:2:0, as decoders deliver it.

use super::color::{ColorMatrix, ColorRange, FRACTION_BITS, rgb_from_yuv_rows, yuv_from_rgb};
use super::{RgbImage, ZoneMask};
use std::fmt;
use std::sync::Arc;

/// Where the planes lie in the bytes of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct YuvLayout {
    /// Columns of the luma plane, at least 1.
    pub width: u32,
    /// Rows of the luma plane, at least 1.
    pub height: u32,
    /// Byte offset of the Y, U and V plane.
    pub offsets: [usize; 3],
    /// Bytes from one row to the next of the Y, U and V plane.
    pub strides: [usize; 3],
}

impl YuvLayout {
    /// Planes without padding, one after the other.
    #[must_use]
    pub const fn packed(width: u32, height: u32) -> Self {
        let (w, h) = (width as usize, height as usize);
        let (cw, ch) = (w.div_ceil(2), h.div_ceil(2));
        Self { width, height, offsets: [0, w * h, w * h + cw * ch], strides: [w, cw, cw] }
    }

    /// Bytes that a packed picture of this size takes.
    #[must_use]
    pub const fn packed_len(width: u32, height: u32) -> usize {
        let (w, h) = (width as usize, height as usize);
        w * h + 2 * w.div_ceil(2) * h.div_ceil(2)
    }

    /// Plane 0 (Y), 1 (U) or 2 (V) of a picture's bytes.
    ///
    /// # Panics
    /// When `data` ends before the plane begins.
    #[must_use]
    pub fn plane<'a>(&self, data: &'a [u8], index: usize) -> Plane<'a> {
        let (width, height) = plane_size(self, index);
        Plane { data: &data[self.offsets[index]..], stride: self.strides[index], width, height }
    }

    /// The Y, U and V planes of values laid out so, each up to where the next one begins.
    ///
    /// # Panics
    /// When the planes are not in this order, or `data` ends before the last one begins.
    #[must_use]
    pub fn split_mut<'a, T>(&self, data: &'a mut [T]) -> [&'a mut [T]; 3] {
        let (luma, chroma) = data.split_at_mut(self.offsets[1]);
        let (u, v) = chroma.split_at_mut(self.offsets[2] - self.offsets[1]);
        [luma, u, v]
    }

    /// Columns of the chroma planes: half the luma plane's, rounded up.
    #[must_use]
    pub const fn chroma_width(&self) -> u32 {
        self.width.div_ceil(2)
    }

    /// Rows of the chroma planes: half the luma plane's, rounded up.
    #[must_use]
    pub const fn chroma_height(&self) -> u32 {
        self.height.div_ceil(2)
    }
}

/// A picture whose bytes do not hold the planes that its layout promises.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum YuvError {
    /// No pixels.
    #[error("a picture needs at least one column and one row, got {width} x {height}")]
    Empty {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A plane reaches beyond the bytes.
    #[error("plane {plane} needs {needed} bytes, the buffer has {available}")]
    Short {
        /// 0 for Y, 1 for U, 2 for V.
        plane: usize,
        /// Bytes from the buffer's start to the plane's end.
        needed: usize,
        /// Bytes in the buffer.
        available: usize,
    },
    /// Rows of a plane overlap.
    #[error("plane {plane} has rows of {width} bytes but a stride of {stride}")]
    Stride {
        /// 0 for Y, 1 for U, 2 for V.
        plane: usize,
        /// Bytes of one row.
        width: usize,
        /// Bytes from row to row.
        stride: usize,
    },
}

/// One plane of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Plane<'a> {
    /// From the first row on; the last row may end without padding.
    pub data: &'a [u8],
    /// Bytes from one row to the next.
    pub stride: usize,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl<'a> Plane<'a> {
    /// Row `y`, `width` values.
    #[must_use]
    pub fn row(&self, y: u32) -> &'a [u8] {
        let start = y as usize * self.stride;
        &self.data[start..start + self.width as usize]
    }
}

/// A picture in planar YUV 4:2:0 (I420), 8 bits a sample, with its colour matrix and range.
///
/// The bytes are whatever the decoder handed over (a mapped buffer, a vector), so taking a frame copies nothing.
/// Chroma sample (i, j) covers luma columns 2i, 2i + 1 and rows 2j, 2j + 1.
pub struct YuvImage {
    layout: YuvLayout,
    matrix: ColorMatrix,
    range: ColorRange,
    data: Box<dyn AsRef<[u8]> + Send + Sync>,
    /// What of it is filled because nobody may see it.
    zones: Option<Arc<ZoneMask>>,
}

impl fmt::Debug for YuvImage {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "YuvImage({} x {}, {:?}, {:?})",
            self.width(),
            self.height(),
            self.matrix,
            self.range
        )
    }
}

impl YuvImage {
    /// Takes `data` as a picture laid out by `layout`.
    ///
    /// # Errors
    /// When the size is zero, a stride is shorter than its row, or a plane reaches beyond `data`.
    pub fn new(
        layout: YuvLayout,
        matrix: ColorMatrix,
        range: ColorRange,
        data: impl AsRef<[u8]> + Send + Sync + 'static,
    ) -> Result<Self, YuvError> {
        if layout.width == 0 || layout.height == 0 {
            return Err(YuvError::Empty { width: layout.width, height: layout.height });
        }
        let available = data.as_ref().len();
        for plane in 0..3 {
            let (width, height) = plane_size(&layout, plane);
            let (width, stride) = (width as usize, layout.strides[plane]);
            if stride < width {
                return Err(YuvError::Stride { plane, width, stride });
            }
            let needed = layout.offsets[plane] + stride * (height as usize - 1) + width;
            if needed > available {
                return Err(YuvError::Short { plane, needed, available });
            }
        }
        Ok(Self { layout, matrix, range, data: Box::new(data), zones: None })
    }

    /// A picture with every sample of a plane the same.
    ///
    /// # Panics
    /// When `width` or `height` is 0.
    #[must_use]
    pub fn filled(width: u32, height: u32, yuv: [u8; 3], matrix: ColorMatrix, range: ColorRange) -> Self {
        let layout = YuvLayout::packed(width, height);
        let mut data = vec![yuv[0]; YuvLayout::packed_len(width, height)];
        data[layout.offsets[1]..layout.offsets[2]].fill(yuv[1]);
        data[layout.offsets[2]..].fill(yuv[2]);
        Self::new(layout, matrix, range, data).expect("a packed layout fits its own length")
    }

    /// The picture that `rgb` shows; chroma is the mean of its 2 x 2 pixels (of those that exist at odd edges).
    ///
    /// # Errors
    /// When the picture has no pixels, or fewer bytes than its size promises.
    pub fn from_rgb(rgb: &RgbImage, matrix: ColorMatrix, range: ColorRange) -> Result<Self, YuvError> {
        let (width, height) = (rgb.width as usize, rgb.height as usize);
        if width == 0 || height == 0 {
            return Err(YuvError::Empty { width: rgb.width, height: rgb.height });
        }
        let needed = width * height * 3;
        if rgb.data.len() < needed {
            return Err(YuvError::Short { plane: 0, needed, available: rgb.data.len() });
        }
        let layout = YuvLayout::packed(rgb.width, rgb.height);
        let mut data = vec![0; YuvLayout::packed_len(rgb.width, rgb.height)];
        let [luma, u, v] = layout.split_mut(&mut data);
        let [from_luma, from_u, from_v] = yuv_from_rgb(matrix, range);
        let code = |(factors, offset): ([i32; 3], i32), [r, g, b]: [i32; 3], shift: u32| {
            let value = (factors[0] * r + factors[1] * g + factors[2] * b) >> shift;
            ((value + offset) >> FRACTION_BITS).clamp(0, 255) as u8
        };
        for (pixel, out) in rgb.data.chunks_exact(3).zip(luma) {
            *out = code(from_luma, [pixel[0], pixel[1], pixel[2]].map(i32::from), 0);
        }
        let chroma_width = layout.chroma_width() as usize;
        let rows = rgb.data[..needed].chunks(2 * width * 3);
        for ((rows, u), v) in rows.zip(u.chunks_exact_mut(chroma_width)).zip(v.chunks_exact_mut(chroma_width))
        {
            let (upper, lower) = rows.split_at(width * 3);
            let lower = if lower.is_empty() { upper } else { lower };
            for (x, (u, v)) in u.iter_mut().zip(v).enumerate() {
                let (left, right) = (6 * x, (6 * x + 3).min(3 * width - 3));
                let sum = [0, 1, 2].map(|channel| {
                    [
                        upper[left + channel],
                        upper[right + channel],
                        lower[left + channel],
                        lower[right + channel],
                    ]
                    .map(i32::from)
                    .iter()
                    .sum()
                });
                (*u, *v) = (code(from_u, sum, 2), code(from_v, sum, 2));
            }
        }
        Self::new(layout, matrix, range, data)
    }

    /// Columns of the luma plane.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.layout.width
    }

    /// Rows of the luma plane.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.layout.height
    }

    /// Which matrix turns YUV into RGB.
    #[must_use]
    pub const fn matrix(&self) -> ColorMatrix {
        self.matrix
    }

    /// Which codes stand for black and white.
    #[must_use]
    pub const fn range(&self) -> ColorRange {
        self.range
    }

    /// Plane 0 (Y, full size), 1 (U) or 2 (V, both half size rounded up).
    ///
    /// # Panics
    /// When `index` is above 2.
    #[must_use]
    pub fn plane(&self, index: usize) -> Plane<'_> {
        self.layout.plane((*self.data).as_ref(), index)
    }

    /// The same picture, of which `zones` are filled.
    pub(super) fn filled_by(self, zones: Arc<ZoneMask>) -> Self {
        Self { zones: Some(zones), ..self }
    }

    /// What of it is filled because nobody may see it; none where all of it is as the camera saw it.
    #[must_use]
    pub const fn zone_mask(&self) -> Option<&Arc<ZoneMask>> {
        self.zones.as_ref()
    }

    /// Bytes that the picture keeps alive, padding included.
    #[must_use]
    pub fn len_bytes(&self) -> usize {
        (*self.data).as_ref().len()
    }

    /// The picture as 8-bit sRGB, chroma repeated over its 2 x 2 luma samples.
    #[must_use]
    pub fn to_rgb(&self) -> RgbImage {
        let (width, height) = (self.width(), self.height());
        let mut data = vec![0; width as usize * height as usize * 3];
        let planes = [self.plane(0), self.plane(1), self.plane(2)];
        for (y, row) in (0..height).zip(data.chunks_exact_mut(width as usize * 3)) {
            let [luma, u, v] = [planes[0].row(y), planes[1].row(y / 2), planes[2].row(y / 2)];
            rgb_from_yuv_rows(self.matrix, self.range, luma, u, v, row);
        }
        RgbImage { width, height, data }
    }

    /// One pixel as 8-bit sRGB, the same as in [`Self::to_rgb`].
    ///
    /// # Panics
    /// When it lies beyond the picture.
    #[must_use]
    pub fn rgb_at(&self, x: u32, y: u32) -> [u8; 3] {
        let texel = |plane: usize, x: u32, y: u32| [self.plane(plane).row(y)[x as usize]];
        let [luma, u, v] = [texel(0, x, y), texel(1, x / 2, y / 2), texel(2, x / 2, y / 2)];
        let mut rgb = [0; 3];
        rgb_from_yuv_rows(self.matrix, self.range, &luma, &u, &v, &mut rgb);
        rgb
    }
}

const fn plane_size(layout: &YuvLayout, index: usize) -> (u32, u32) {
    if index == 0 { (layout.width, layout.height) } else { (layout.chroma_width(), layout.chroma_height()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layout_that_reaches_beyond_its_bytes_is_refused() {
        let make =
            |layout, len| YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, vec![0_u8; len]);
        assert!(make(YuvLayout::packed(5, 3), YuvLayout::packed_len(5, 3)).is_ok());
        let short = make(YuvLayout::packed(5, 3), YuvLayout::packed_len(5, 3) - 1).unwrap_err();
        assert_eq!(short, YuvError::Short { plane: 2, needed: 27, available: 26 });
        assert!(matches!(make(YuvLayout::packed(0, 3), 100), Err(YuvError::Empty { .. })));
        let mut narrow = YuvLayout::packed(4, 4);
        narrow.strides[1] = 1;
        assert!(matches!(make(narrow, 100), Err(YuvError::Stride { plane: 1, width: 2, stride: 1 })));
    }

    #[test]
    fn known_codes_become_known_colours() {
        let check = |yuv, matrix, range, expected: [u8; 3]| {
            let image = YuvImage::filled(3, 3, yuv, matrix, range);
            let rgb = image.to_rgb();
            assert_eq!(image.rgb_at(2, 1), rgb.data[15..18]);
            assert_eq!(rgb.data.len(), 27);
            for pixel in rgb.data.chunks_exact(3) {
                for (got, want) in pixel.iter().zip(expected) {
                    assert!(
                        got.abs_diff(want) <= 1,
                        "{yuv:?} {matrix:?} {range:?}: {pixel:?}, not {expected:?}"
                    );
                }
            }
        };
        check([16, 128, 128], ColorMatrix::Bt601, ColorRange::Limited, [0, 0, 0]);
        check([235, 128, 128], ColorMatrix::Bt709, ColorRange::Limited, [255, 255, 255]);
        check([255, 128, 128], ColorMatrix::Bt601, ColorRange::Full, [255, 255, 255]);
        check([81, 90, 240], ColorMatrix::Bt601, ColorRange::Limited, [255, 0, 0]);
        check([63, 102, 240], ColorMatrix::Bt709, ColorRange::Limited, [255, 0, 0]);
        check([76, 85, 255], ColorMatrix::Bt601, ColorRange::Full, [254, 0, 0]);
        check([0, 128, 128], ColorMatrix::Bt601, ColorRange::Limited, [0, 0, 0]);
    }

    #[test]
    fn colours_survive_the_way_to_yuv_and_back() {
        let colors =
            [[0, 0, 0], [255, 255, 255], [255, 0, 0], [0, 255, 0], [0, 0, 255], [12, 130, 251], [77, 77, 77]];
        for (color, (width, height)) in
            colors.iter().zip([(4, 4), (1, 1), (3, 5), (5, 3), (2, 1), (1, 2), (7, 7)])
        {
            let rgb = RgbImage { width, height, data: color.repeat((width * height) as usize) };
            for matrix in [ColorMatrix::Bt601, ColorMatrix::Bt709, ColorMatrix::Bt2020] {
                for (range, tolerance) in [(ColorRange::Full, 2), (ColorRange::Limited, 2)] {
                    let back = YuvImage::from_rgb(&rgb, matrix, range).unwrap().to_rgb();
                    let worst = back.data.iter().zip(&rgb.data).map(|(a, b)| a.abs_diff(*b)).max();
                    assert!(
                        worst <= Some(tolerance),
                        "{color:?} {matrix:?} {range:?}: {:?}",
                        &back.data[..3]
                    );
                }
            }
        }
    }

    #[test]
    fn grey_has_no_chroma_and_chroma_is_the_mean_of_four_pixels() {
        for grey in 0..=255_u8 {
            let rgb = RgbImage { width: 2, height: 2, data: vec![grey; 12] };
            let yuv = YuvImage::from_rgb(&rgb, ColorMatrix::Bt709, ColorRange::Full).unwrap();
            assert_eq!(
                (yuv.plane(0).row(0)[0], yuv.plane(1).row(0), yuv.plane(2).row(0)),
                (grey, &[128][..], &[128][..])
            );
        }
        let rgb = RgbImage { width: 2, height: 2, data: vec![255, 0, 0, 0, 0, 0, 0, 0, 0, 255, 0, 0] };
        let yuv = YuvImage::from_rgb(&rgb, ColorMatrix::Bt601, ColorRange::Full).unwrap();
        assert_eq!(yuv.plane(0).row(0)[..2], [76, 0]);
        assert_eq!((yuv.plane(1).row(0)[0], yuv.plane(2).row(0)[0]), (106, 192));
        assert!(
            YuvImage::from_rgb(
                &RgbImage { width: 2, height: 2, data: vec![0; 11] },
                ColorMatrix::Bt601,
                ColorRange::Full
            )
            .is_err()
        );
        assert!(
            YuvImage::from_rgb(
                &RgbImage { width: 0, height: 2, data: vec![] },
                ColorMatrix::Bt601,
                ColorRange::Full
            )
            .is_err()
        );
    }
}
