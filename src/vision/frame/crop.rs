//! A rectangle of a picture, copied.

use super::{YuvImage, YuvLayout};

impl YuvImage {
    /// The `width` x `height` pixels from column `x` and row `y` on, which are even, so that chroma samples stay whole.
    ///
    /// # Panics
    /// When the rectangle is empty, begins at an odd column or row, or reaches beyond the picture.
    #[must_use]
    pub fn cropped(&self, [x, y, width, height]: [u32; 4]) -> Self {
        assert!(
            x.is_multiple_of(2) && y.is_multiple_of(2),
            "a rectangle from ({x}, {y}) splits chroma samples"
        );
        assert!(x + width <= self.width() && y + height <= self.height(), "the rectangle lies within");
        let layout = YuvLayout::packed(width, height);
        let mut data = Vec::with_capacity(YuvLayout::packed_len(width, height));
        for (index, shift) in [(0, 0), (1, 1), (2, 1)] {
            let plane = self.plane(index);
            let (columns, rows) = match shift {
                0 => (width as usize, height),
                _ => (layout.chroma_width() as usize, layout.chroma_height()),
            };
            let left = (x >> shift) as usize;
            for row in 0..rows {
                data.extend_from_slice(&plane.row((y >> shift) + row)[left..left + columns]);
            }
        }
        Self::new(layout, self.matrix(), self.range(), data).expect("a packed layout fits its own length")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{ColorMatrix, ColorRange, RgbImage};

    #[test]
    fn a_rectangle_has_the_pictures_own_samples() {
        let data: Vec<u8> = (0..13 * 9 * 3).map(|idx| (idx * 7 % 256) as u8).collect();
        let rgb = RgbImage { width: 13, height: 9, data };
        let whole = YuvImage::from_rgb(&rgb, ColorMatrix::Bt601, ColorRange::Full).unwrap();
        let shown = whole.to_rgb();
        for [x, y, width, height] in [[0, 0, 13, 9], [4, 2, 5, 3], [12, 8, 1, 1], [2, 6, 11, 3]] {
            let part = whole.cropped([x, y, width, height]).to_rgb();
            let pixel = |of: &RgbImage, x: u32, y: u32| {
                let at = 3 * (y as usize * of.width as usize + x as usize);
                <[u8; 3]>::try_from(&of.data[at..at + 3]).unwrap()
            };
            for (i, j) in (0..width).flat_map(|i| (0..height).map(move |j| (i, j))) {
                assert_eq!(pixel(&part, i, j), pixel(&shown, x + i, y + j), "{i}, {j}");
            }
        }
    }
}
