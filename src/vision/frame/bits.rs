//! One bit a pixel, 32 pixels of a row in a word: what is asked of many pixels at once.

use super::Mask;

/// Pixels of a word, which lie in one row.
pub const WORD_PIXELS: usize = u32::BITS as usize;

/// A yes or no for every pixel.
///
/// **Shape** `height * words_per_row` words, row-major, rows from the top; the first pixel of a word is its lowest bit.
/// Bits beyond the right border are 0.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct BitMask {
    width: usize,
    words_per_row: usize,
    words: Vec<u32>,
}

impl Clone for BitMask {
    fn clone(&self) -> Self {
        Self { words: self.words.clone(), ..*self }
    }

    /// Allocates nothing where the mask was as large before.
    fn clone_from(&mut self, source: &Self) {
        (self.width, self.words_per_row) = (source.width, source.words_per_row);
        self.words.clone_from(&source.words);
    }
}

impl BitMask {
    /// A mask of `width * height` pixels, all 0.
    #[must_use]
    pub fn new(width: u32, height: u32) -> Self {
        let mut mask = Self::default();
        mask.reset(width as usize, height as usize);
        mask
    }

    /// Makes this a mask of `width * height` pixels, all 0; keeps its memory.
    pub fn reset(&mut self, width: usize, height: usize) {
        self.width = width;
        self.words_per_row = width.div_ceil(WORD_PIXELS);
        self.words.clear();
        self.words.resize(self.words_per_row * height, 0);
    }

    /// Columns.
    #[must_use]
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    #[must_use]
    pub const fn height(&self) -> usize {
        match self.words.len().checked_div(self.words_per_row) {
            Some(height) => height,
            None => 0,
        }
    }

    /// Words of a row: the columns by 32, rounded up.
    #[must_use]
    pub const fn words_per_row(&self) -> usize {
        self.words_per_row
    }

    /// All words.
    #[must_use]
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// All words. Bits beyond the right border must stay 0.
    pub fn words_mut(&mut self) -> &mut [u32] {
        &mut self.words
    }

    /// The words of row `y`.
    #[must_use]
    pub fn row(&self, y: usize) -> &[u32] {
        &self.words[y * self.words_per_row..(y + 1) * self.words_per_row]
    }

    /// The words of row `y`. Bits beyond the right border must stay 0.
    pub fn row_mut(&mut self, y: usize) -> &mut [u32] {
        &mut self.words[y * self.words_per_row..(y + 1) * self.words_per_row]
    }

    /// Returns whether nothing of row `y` is 1.
    #[must_use]
    pub fn is_row_empty(&self, y: usize) -> bool {
        // All words are read, since that is done on vectors.
        self.row(y).iter().fold(0, |any, word| any | word) == 0
    }

    /// The bits of a row's word `word` that lie in the picture.
    #[must_use]
    pub const fn inside(&self, word: usize) -> u32 {
        inside(self.width, word)
    }

    /// The bit at column `x`, row `y`.
    #[must_use]
    pub fn get(&self, x: usize, y: usize) -> bool {
        (self.words[y * self.words_per_row + x / WORD_PIXELS] >> (x % WORD_PIXELS)) & 1 == 1
    }

    /// Bits that are 1.
    #[must_use]
    pub fn count_ones(&self) -> u64 {
        // Most words are 0 in most masks.
        self.words.iter().filter(|word| **word != 0).map(|word| u64::from(word.count_ones())).sum()
    }

    /// Makes columns `start .. end` of row `y` 1.
    pub fn set_run(&mut self, y: usize, start: usize, end: usize) {
        for (word, bits) in run_words(start, end) {
            self.words[y * self.words_per_row + word] |= bits;
        }
    }

    /// Makes columns `start .. end` of row `y` 0.
    pub fn clear_run(&mut self, y: usize, start: usize, end: usize) {
        for (word, bits) in run_words(start, end) {
            self.words[y * self.words_per_row + word] &= !bits;
        }
    }

    /// Takes what is 1 in columns `start .. end` of row `y` over to `to`, a mask of the same size.
    pub fn move_run(&mut self, to: &mut Self, y: usize, start: usize, end: usize) {
        for (word, bits) in run_words(start, end) {
            let at = y * self.words_per_row + word;
            to.words[at] |= self.words[at] & bits;
            self.words[at] &= !bits;
        }
    }

    /// Adds what is 1 in columns `start .. end` of row `y` to `to`, a mask of the same size.
    pub fn copy_run(&self, to: &mut Self, y: usize, start: usize, end: usize) {
        for (word, bits) in run_words(start, end) {
            let at = y * self.words_per_row + word;
            to.words[at] |= self.words[at] & bits;
        }
    }

    /// How many of columns `start .. end` of row `y` are 1.
    #[must_use]
    pub fn count_run(&self, y: usize, start: usize, end: usize) -> u32 {
        let row = self.row(y);
        run_words(start, end).map(|(word, bits)| (row[word] & bits).count_ones()).sum()
    }

    /// Takes the pixels of a mask that are at least `least`; of `mask`'s size afterwards.
    pub fn take(&mut self, mask: &Mask, least: u8) {
        self.reset(mask.width as usize, mask.height as usize);
        let words_per_row = self.words_per_row;
        let rows = self.words.chunks_exact_mut(words_per_row.max(1));
        for (words, row) in rows.zip(mask.data.chunks_exact(self.width.max(1))) {
            for (word, pixels) in words.iter_mut().zip(row.chunks(WORD_PIXELS)) {
                *word = pixels.iter().rev().fold(0, |word, value| word << 1 | u32::from(*value >= least));
            }
        }
    }

    /// A byte a pixel: 255 for 1, 0 for 0.
    #[must_use]
    pub fn to_mask(&self) -> Mask {
        let mut mask = Mask::filled(self.width as u32, self.height() as u32, 0);
        for (row, words) in mask
            .data
            .chunks_exact_mut(self.width.max(1))
            .zip(self.words.chunks_exact(self.words_per_row.max(1)))
        {
            for (pixels, word) in row.chunks_mut(WORD_PIXELS).zip(words).filter(|(_, word)| **word != 0) {
                for (x, pixel) in pixels.iter_mut().enumerate() {
                    *pixel = 255 * ((word >> x) & 1) as u8;
                }
            }
        }
        mask
    }
}

/// The bits of a row's word `word` that lie within `width` columns.
#[must_use]
pub const fn inside(width: usize, word: usize) -> u32 {
    let n_pixels = width.saturating_sub(word * WORD_PIXELS);
    if n_pixels >= WORD_PIXELS { u32::MAX } else { (1 << n_pixels) - 1 }
}

/// The words that columns `start .. end` lie in, and their bits in each.
fn run_words(start: usize, end: usize) -> impl Iterator<Item = (usize, u32)> {
    let words = if start < end { start / WORD_PIXELS..end.div_ceil(WORD_PIXELS) } else { 0..0 };
    words.map(move |word| {
        let first = start.saturating_sub(word * WORD_PIXELS);
        (word, inside(end, word) & (u32::MAX << first))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_of_the_same_size_is_copied_into_the_memory_that_is_there() {
        let (mut from, mut to) = (BitMask::new(70, 3), BitMask::new(70, 3));
        from.set_run(1, 5, 66);
        let before = to.words().as_ptr();
        to.clone_from(&from);
        assert_eq!((&to, to.words().as_ptr()), (&from, before));
        // Another size is taken over too.
        to.clone_from(&BitMask::new(3, 9));
        assert_eq!((to.width(), to.height()), (3, 9));
        assert_eq!(from.clone(), from);
    }

    #[test]
    fn runs_are_filled_and_counted_over_words() {
        for width in [1, 31, 32, 33, 64, 95, 130] {
            for (start, end) in [(0, 0), (0, 1), (0, width), (width / 3, width), (width / 2, width / 2 + 1)] {
                let mut mask = BitMask::new(width as u32, 3);
                mask.set_run(1, start, end);
                assert_eq!(mask.count_ones(), (end - start) as u64, "{width}: {start} to {end}");
                assert!((0..width).all(|x| mask.get(x, 1) == (start..end).contains(&x)));
                assert_eq!(mask.count_run(1, 0, width), (end - start) as u32);
                assert_eq!(mask.count_run(1, start, width), (end - start) as u32);
                let bytes = mask.to_mask();
                let mut back = BitMask::default();
                back.take(&bytes, 255);
                assert_eq!(back, mask);
                assert_eq!([0, 1, 2].map(|y| mask.is_row_empty(y)), [true, start == end, true]);
                mask.clear_run(1, 0, width);
                assert_eq!(mask.count_ones(), 0);
            }
        }
    }
}
