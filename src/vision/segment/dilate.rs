//! Growing a mask of bits by one pixel.

use crate::frame::BitMask;

/// Makes `out` the pixels of `of` and their eight neighbours.
pub fn dilate(of: &BitMask, out: &mut BitMask) {
    let height = of.height();
    out.reset(of.width(), height);
    for y in 0..height {
        let row = of.row(y);
        if row.iter().all(|word| *word == 0) {
            continue;
        }
        for word in 0..row.len() {
            let spread = spread(row, word) & of.inside(word);
            if spread != 0 {
                for near in y.saturating_sub(1)..(y + 2).min(height) {
                    out.row_mut(near)[word] |= spread;
                }
            }
        }
    }
}

/// A word of a row with its pixels' neighbours to the left and right.
pub(super) fn spread(row: &[u32], word: usize) -> u32 {
    let own = row[word];
    let left = if word == 0 { 0 } else { row[word - 1] >> 31 };
    let right = row.get(word + 1).map_or(0, |next| next << 31);
    own | own << 1 | own >> 1 | left | right
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_grows_to_nine_within_the_picture() {
        for (width, height) in [(1, 1), (1, 7), (7, 1), (33, 5), (64, 3), (70, 9)] {
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                let mut of = BitMask::new(width as u32, height as u32);
                of.set_run(y, x, x + 1);
                let mut out = BitMask::new(1, 1);
                dilate(&of, &mut out);
                for (i, j) in (0..height).flat_map(|j| (0..width).map(move |i| (i, j))) {
                    let is_near = i.abs_diff(x) <= 1 && j.abs_diff(y) <= 1;
                    assert_eq!(out.get(i, j), is_near, "{width} x {height}: {x} {y} -> {i} {j}");
                }
            }
        }
    }
}
