//! Growing a mask of bits by one pixel.

use crate::frame::BitMask;

/// Makes `out` the pixels of `of` and their eight neighbours.
pub fn dilate(of: &BitMask, out: &mut BitMask) {
    let (height, words_per_row) = (of.height(), of.words_per_row());
    out.reset(of.width(), height);
    for y in (0..height).filter(|y| !of.is_row_empty(*y)) {
        spread_row(of.row(y), out.row_mut(y));
        out.row_mut(y)[words_per_row - 1] &= of.inside(words_per_row - 1);
    }
    // Each row takes the one beneath it, and then, from the foot up, what is so above it.
    let words = out.words_mut();
    for y in 1..height {
        let (above, row) = words[(y - 1) * words_per_row..].split_at_mut(words_per_row);
        above.iter_mut().zip(row).for_each(|(above, word)| *above |= *word);
    }
    for y in (1..height).rev() {
        let (above, row) = words[(y - 1) * words_per_row..].split_at_mut(words_per_row);
        row.iter_mut().zip(above).for_each(|(word, above)| *word |= *above);
    }
}

/// Stores a row's pixels with their neighbours to the left and right: as [`spread`] by plain loops, which become vectors.
fn spread_row(row: &[u32], out: &mut [u32]) {
    for (out, own) in out.iter_mut().zip(row) {
        *out = own | own << 1 | own >> 1;
    }
    for (out, left) in out[1..].iter_mut().zip(row) {
        *out |= left >> 31;
    }
    for (out, right) in out.iter_mut().zip(&row[1..]) {
        *out |= right << 31;
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
                assert!((0..height).all(|j| {
                    out.row(j).last().is_some_and(|last| last & !out.inside(out.words_per_row() - 1) == 0)
                }));
                for (i, j) in (0..height).flat_map(|j| (0..width).map(move |i| (i, j))) {
                    let is_near = i.abs_diff(x) <= 1 && j.abs_diff(y) <= 1;
                    assert_eq!(out.get(i, j), is_near, "{width} x {height}: {x} {y} -> {i} {j}");
                }
            }
        }
    }
}
