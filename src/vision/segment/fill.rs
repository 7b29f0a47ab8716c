//! What lies within or between moving pixels is filled: holes, gaps, notches.
//!
//! Bits flow in and out. Holes cost what the pixels cost that are not background, closing the whole picture.

use super::components::{Components, Connectivity, Piece, Run, Wanted};
use super::dilate::spread;
use crate::frame::{BitMask, WORD_PIXELS};

/// A hole of which at least this share differs weakly from the background is no view of the background.
const LEAST_WEAK: f32 = 0.5;

/// Fills holes; keeps its memory.
#[derive(Debug, Default)]
pub(super) struct Holes {
    n_weak: Vec<u32>,
}

impl Holes {
    /// Makes holes that do not touch the picture's border moving: those of at most `max_hole_px` pixels, and larger ones
    /// in which most pixels are in `weak`, if they are no larger than all that moves.
    ///
    /// Through a gap in a body the background is seen as it is; a windscreen, which may look much like the road, differs
    /// from it a little all over.
    pub(super) fn fill(
        &mut self,
        moving: &mut BitMask,
        weak: &BitMask,
        max_hole_px: u32,
        components: &mut Components,
    ) {
        let (width, height) = (moving.width() as u32, moving.height() as u32);
        components.find(moving, Wanted::Zeros, Connectivity::Four);
        let is_enclosed =
            |hole: &Piece| hole.left > 0 && hole.top > 0 && hole.right < width && hole.bottom < height;
        self.n_weak.clear();
        self.n_weak.resize(components.pieces().len(), 0);
        for run in components.runs() {
            if is_enclosed(&components.pieces()[run.piece_idx as usize]) {
                self.n_weak[run.piece_idx as usize] +=
                    weak.count_run(run.y as usize, run.start as usize, run.end as usize);
            }
        }
        let most_px = moving.count_ones();
        for run in components.runs() {
            let hole = &components.pieces()[run.piece_idx as usize];
            let is_body = self.n_weak[run.piece_idx as usize] as f32 >= LEAST_WEAK * hole.area_px as f32
                && u64::from(hole.area_px) <= most_px;
            if is_enclosed(hole) && (hole.area_px <= max_hole_px || is_body) {
                moving.set_run(run.y as usize, run.start as usize, run.end as usize);
            }
        }
    }
}

/// Closes gaps by a square of `2 radius + 1` pixels: a dilation, then an erosion. Keeps its memory.
#[derive(Debug, Default)]
pub(super) struct Closing {
    /// The bits, with room for the dilation beneath the last row and behind the last column.
    words: Vec<u32>,
    words_per_row: usize,
}

impl Closing {
    /// Makes moving what the closing of the moving pixels covers.
    pub(super) fn close(&mut self, moving: &mut BitMask, radius: u32) {
        self.compute(moving, radius);
        for y in 0..moving.height() {
            moving.row_mut(y).iter_mut().zip(self.row(y)).for_each(|(moving, closed)| *moving |= closed);
        }
    }

    /// Returns a row of what was computed last, which has a few words more than the picture and nothing in these.
    fn row(&self, y: usize) -> &[u32] {
        &self.words[y * self.words_per_row..(y + 1) * self.words_per_row]
    }

    /// Computes the closing. Dilation and erosion are one-sided: the one spreads to the right and downwards alone, by the whole side of
    /// the square, and the other takes that back.
    fn compute(&mut self, moving: &BitMask, radius: u32) {
        let reach = 2 * radius as usize;
        self.words_per_row = (moving.width() + reach).div_ceil(WORD_PIXELS);
        let n_rows = moving.height() + reach;
        self.words.clear();
        self.words.resize(self.words_per_row * n_rows, 0);
        for (y, row) in self.words.chunks_exact_mut(self.words_per_row).take(moving.height()).enumerate() {
            let from = moving.row(y);
            row[..from.len()].copy_from_slice(from);
            if !moving.is_row_empty(y) {
                steps(reach).for_each(|step| spread_right(row, step));
            }
        }
        let per_row = self.words_per_row;
        for step in steps(reach) {
            for y in (step..n_rows).rev() {
                let (above, row) = self.words.split_at_mut(y * per_row);
                let above = &above[(y - step) * per_row..][..per_row];
                row[..per_row].iter_mut().zip(above).for_each(|(word, above)| *word |= above);
            }
        }
        for step in steps(reach) {
            for y in 0..n_rows - step {
                let (row, below) = self.words[y * per_row..].split_at_mut(step * per_row);
                row[..per_row].iter_mut().zip(below).for_each(|(word, below)| *word &= *below);
            }
        }
        for row in self.words.chunks_exact_mut(per_row).take(moving.height()) {
            if row.iter().any(|word| *word != 0) {
                steps(reach).for_each(|step| shrink_left(row, step));
            }
        }
    }
}

/// Returns the steps, each at most one more than all before it together, that sum up to `reach`.
fn steps(reach: usize) -> impl Iterator<Item = usize> {
    let mut done = 0;
    std::iter::from_fn(move || {
        let step = (done + 1).min(reach - done);
        done += step;
        (step > 0).then_some(step)
    })
}

/// Adds to a row its own pixels moved to the right by `step`.
fn spread_right(row: &mut [u32], step: usize) {
    let (words, bits) = (step / WORD_PIXELS, step % WORD_PIXELS);
    for word in (words..row.len()).rev() {
        let near = row[word - words] << bits;
        let far = if bits > 0 && word > words { row[word - words - 1] >> (WORD_PIXELS - bits) } else { 0 };
        row[word] |= near | far;
    }
}

/// Leaves of a row what is also there by `step` to the right.
fn shrink_left(row: &mut [u32], step: usize) {
    let (words, bits) = (step / WORD_PIXELS, step % WORD_PIXELS);
    for word in 0..row.len() {
        let at = |word: usize| row.get(word).copied().unwrap_or(0);
        let near = at(word + words) >> bits;
        let far = if bits > 0 { at(word + words + 1) << (WORD_PIXELS - bits) } else { 0 };
        row[word] &= near | far;
    }
}

/// Fills the notches of pieces; keeps its memory from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Notches {
    closing: Closing,
    /// The piece in its rectangle, from the beginning of a word on.
    piece: BitMask,
    others: Vec<u32>,
}

impl Notches {
    /// Makes moving the pixels of `faint` that lie in notches of a piece, given by its runs: in its closing by a quarter of its lesser
    /// side, at most `greatest_radius_px`. A pixel next to another piece stays as it is, so that nothing is joined. Pixels need not touch
    /// the piece.
    ///
    /// **Cost** linear in the piece's rectangle, where it holds anything faint.
    pub(super) fn fill(
        &mut self,
        moving: &mut BitMask,
        (piece, runs): (&Piece, &[Run]),
        faint: &BitMask,
        greatest_radius_px: u32,
    ) {
        let (width, height) = (piece.right - piece.left, piece.bottom - piece.top);
        let radius = (width.min(height) / 4).min(greatest_radius_px);
        if radius == 0 {
            return;
        }
        let (first_word, top) = (piece.left as usize / WORD_PIXELS, piece.top as usize);
        let first_column = first_word * WORD_PIXELS;
        let columns = first_word..(piece.right as usize).div_ceil(WORD_PIXELS);
        let has_faint = |y: usize| {
            let mut words = faint.row(y)[columns.clone()].iter().zip(&moving.row(y)[columns.clone()]);
            words.any(|(faint, moving)| faint & !moving != 0)
        };
        if !(top..top + height as usize).any(has_faint) {
            return;
        }
        self.piece.reset(piece.right as usize - first_column, height as usize);
        for run in runs {
            let columns = [run.start, run.end].map(|column| column as usize - first_column);
            self.piece.set_run(run.y as usize - top, columns[0], columns[1]);
        }
        self.closing.compute(&self.piece, radius);
        for row in 0..height as usize {
            let y = top + row;
            let masks = self.closing.row(row).iter().zip(&faint.row(y)[columns.clone()]);
            let mut masks = masks.zip(&moving.row(y)[columns.clone()]);
            if masks.all(|((closed, faint), moving)| closed & faint & !moving == 0) {
                continue;
            }
            self.find_others(moving, y, (first_word, top));
            for (word, place) in columns.clone().enumerate() {
                let near_others = spread(&self.others, word + usize::from(first_word > 0));
                let added = self.closing.row(row)[word] & faint.row(y)[place] & !near_others;
                moving.row_mut(y)[place] |= added;
                self.piece.row_mut(row)[word] |= added;
            }
        }
    }

    /// Finds what moves in row `y` and the rows next to it and is not the piece, in its columns of words and one more to either side.
    fn find_others(&mut self, moving: &BitMask, y: usize, (first_word, top): (usize, usize)) {
        let n_words = self.piece.words_per_row();
        let words = first_word.saturating_sub(1)..(first_word + n_words + 1).min(moving.words_per_row());
        self.others.clear();
        self.others.resize(words.len(), 0);
        for row in y.saturating_sub(1)..(y + 2).min(moving.height()) {
            for (other, word) in self.others.iter_mut().zip(words.clone()) {
                let own = match (row.checked_sub(top), word.checked_sub(first_word)) {
                    (Some(row), Some(word)) if row < self.piece.height() && word < n_words => {
                        self.piece.row(row)[word]
                    }
                    _ => 0,
                };
                *other |= moving.row(row)[word] & !own;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::drawn::{drawn, shown};
    use super::*;

    #[test]
    fn small_enclosed_holes_are_filled() {
        let check = |picture: &str, max_hole_px: u32, expected: &str| {
            let (mut moving, shadow) = drawn(picture);
            let weak = BitMask::new(moving.width() as u32, moving.height() as u32);
            Holes::default().fill(&mut moving, &weak, max_hole_px, &mut Components::default());
            assert_eq!(shown(&moving, &shadow), expected);
        };
        check("##### #.s## ##### #...# #####", 2, "##### ##### ##### #...# #####");
        check("##### #.s## ##### #...# #####", 1, "##### #.s## ##### #...# #####");
        check("##### #.s## ##### #...# #####", 3, "##### ##### ##### ##### #####");
        check("##.## #.### #####", 9, "##.## ##### #####");
        check("... ... ...", 9, "... ... ...");
        check("### ### ###", 9, "### ### ###");
        check(".", 9, ".");
    }

    #[test]
    fn large_holes_that_differ_weakly_are_filled() {
        let check = |picture: &str, n_weak: usize, expected: &str| {
            let (mut moving, _) = drawn(picture);
            let mut weak = BitMask::new(moving.width() as u32, moving.height() as u32);
            weak.set_run(2, 2, 2 + n_weak);
            Holes::default().fill(&mut moving, &weak, 0, &mut Components::default());
            assert_eq!(shown(&moving, &moving), expected, "{n_weak}");
        };
        let (ring, full) = ("######## ######## ##....## ########", "######## ######## ######## ########");
        check(ring, 1, ring);
        check(ring, 2, full);
        check(ring, 4, full);
        // More hole than body.
        let (mut moving, _) =
            drawn("######## #......# #......# #......# #......# #......# #......# ########");
        let (before, mut everything) = (moving.clone(), moving.clone());
        (0..8).for_each(|y| everything.set_run(y, 0, 8));
        Holes::default().fill(&mut moving, &everything, 0, &mut Components::default());
        assert_eq!(moving, before, "a hole that large is no part of its frame");
    }

    /// Shows a picture after the notches of its first piece were filled.
    fn filled(picture: &str, faint: &str, greatest_radius_px: u32) -> String {
        let (mut moving, shadow) = drawn(picture);
        let (faint, _) = drawn(faint);
        let mut components = Components::default();
        components.find(&moving, Wanted::Ones, Connectivity::Eight);
        let runs: Vec<Run> = components.runs().iter().filter(|run| run.piece_idx == 0).copied().collect();
        Notches::default().fill(&mut moving, (&components.pieces()[0], &runs), &faint, greatest_radius_px);
        shown(&moving, &shadow)
    }

    #[test]
    fn notches_are_filled_where_they_differ_faintly() {
        let notched = "######## ######## ###..### ###..### ######## ###..### ###..### ########";
        let all = "######## ######## ######## ######## ######## ######## ######## ########";
        assert_eq!(filled(notched, all, 9), all);
        assert_eq!(filled(notched, &notched.replace('.', "s"), 9), notched, "nothing is faint");
        let upper = "######## ######## ######## ######## ######## ........ ........ ........";
        let half = "######## ######## ######## ######## ######## ###..### ###..### ########";
        assert_eq!(filled(notched, upper, 9), half);
        assert_eq!(filled(notched, all, 0), notched);
        // What is narrower than four pixels has no notches.
        assert_eq!(filled("###### #....# ######", "###### ###### ######", 9), "###### #....# ######");
    }

    #[test]
    fn a_notch_is_as_narrow_as_a_quarter_of_the_piece_and_as_the_limit() {
        let row = |columns: std::ops::Range<usize>| -> String {
            (0..16).map(|x| if columns.contains(&x) { '.' } else { '#' }).collect()
        };
        let picture = |columns: std::ops::Range<usize>| {
            let mut rows = vec![row(0..0); 16];
            rows[4..].fill(row(columns));
            rows.join(" ")
        };
        let all = picture(0..0);
        // 16 pixels: a radius of 4 closes 8 columns and not 9.
        assert_eq!(filled(&picture(4..12), &all, 9), all);
        assert_eq!(filled(&picture(4..13), &all, 9), picture(4..13));
        assert_eq!(filled(&picture(4..8), &all, 2), all);
        assert_eq!(filled(&picture(4..9), &all, 2), picture(4..9));
    }

    #[test]
    fn nothing_next_to_another_piece_is_filled() {
        // An arch of 16 x 16 pixels, and a piece of one pixel in it.
        let picture = |is_dot: &dyn Fn(i32, i32) -> bool| {
            let row = |y| (0..16).map(|x| if is_dot(x, y) { '.' } else { '#' }).collect::<String>();
            (0..16).map(row).collect::<Vec<_>>().join(" ")
        };
        let arch = picture(&|x, y| (4..12).contains(&x) && y >= 4 && (x, y) != (8, 10));
        let around = picture(&|x, y| (x, y) != (8, 10) && (x - 8).abs() <= 1 && (y - 10).abs() <= 1);
        assert_eq!(filled(&arch, &picture(&|_, _| false), 9), around);
    }

    #[test]
    fn other_pieces_are_seen_across_words() {
        for left in 0..70 {
            // Open to the right, before which another piece stands; and one within.
            let others = [(left + 9, 8), (left + 16, 8)];
            let (mut moving, mut faint) = (BitMask::new(96, 20), BitMask::new(96, 20));
            for y in 0..16 {
                moving.set_run(y, left, if (4..12).contains(&y) { left + 4 } else { left + 16 });
                faint.set_run(y, 0, 96);
            }
            others.iter().for_each(|(x, y)| moving.set_run(*y, *x, *x + 1));
            let mut components = Components::default();
            components.find(&moving, Wanted::Ones, Connectivity::Eight);
            let runs: Vec<Run> = components.runs().iter().filter(|run| run.piece_idx == 0).copied().collect();
            Notches::default().fill(&mut moving, (&components.pieces()[0], &runs), &faint, 9);
            for (x, y) in (4..12).flat_map(|y| (left + 4..left + 16).map(move |x| (x, y))) {
                let is_near =
                    others.iter().any(|(of, row)| x.abs_diff(*of) <= 1 && usize::abs_diff(y, *row) <= 1);
                let is_other = others.contains(&(x, y));
                assert_eq!(moving.get(x, y), is_other || !is_near, "{left}: {x} {y}");
            }
        }
    }

    #[test]
    fn pieces_at_words_and_borders_are_filled_as_elsewhere() {
        for (left, width) in [(0, 40), (27, 64), (31, 100), (32, 70), (60, 100), (28, 36)] {
            let mut moving = BitMask::new(width, 12);
            let mut faint = BitMask::new(width, 12);
            let end = left + 8;
            for y in 0..8 {
                moving.set_run(y, left, end);
                faint.set_run(y, 0, width as usize);
            }
            (2..8).for_each(|y| moving.clear_run(y, left + 3, left + 5));
            let mut components = Components::default();
            components.find(&moving, Wanted::Ones, Connectivity::Eight);
            let runs = components.runs().to_vec();
            Notches::default().fill(&mut moving, (&components.pieces()[0], &runs), &faint, 9);
            assert_eq!(moving.count_ones(), 64, "{left} of {width}");
            assert!((0..8).all(|y| moving.count_run(y, left, end) == 8), "{left} of {width}");
        }
    }

    #[test]
    fn closing_is_a_dilation_and_an_erosion_by_a_square() {
        let by_definition = |of: &BitMask, radius: i64| {
            let (width, height) = (of.width() as i64, of.height() as i64);
            let is_set = |x: i64, y: i64| {
                (0..width).contains(&x) && (0..height).contains(&y) && of.get(x as usize, y as usize)
            };
            let square = |x: i64, y: i64| {
                (y - radius..=y + radius).flat_map(move |y| (x - radius..=x + radius).map(move |x| (x, y)))
            };
            let is_near = |x: i64, y: i64| square(x, y).any(|(x, y)| is_set(x, y));
            let mut out = BitMask::new(of.width() as u32, of.height() as u32);
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                if square(x, y).all(|(x, y)| is_near(x, y)) {
                    out.set_run(y as usize, x as usize, x as usize + 1);
                }
            }
            out
        };
        let mut state = 7_u32;
        for (width, height, radius) in [(1, 1, 1), (33, 9, 1), (64, 20, 3), (70, 24, 5), (100, 12, 16)] {
            let mut of = BitMask::new(width, height);
            for (x, y) in (0..height as usize).flat_map(|y| (0..width as usize).map(move |x| (x, y))) {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                if state >> 24 < 12 {
                    of.set_run(y, x, x + 1);
                }
            }
            let mut closed = of.clone();
            Closing::default().close(&mut closed, radius);
            assert_eq!(closed, by_definition(&of, i64::from(radius)), "{width} x {height} by {radius}");
        }
    }

    #[test]
    fn closing_joins_what_is_near_and_grows_nothing() {
        let check = |picture: &str, radius: u32, expected: &str| {
            let (mut moving, shadow) = drawn(picture);
            Closing::default().close(&mut moving, radius);
            assert_eq!(shown(&moving, &shadow), expected, "{picture} by {radius}");
        };
        check("#..#...#", 1, "####...#");
        check("#..#...#", 2, "########");
        check("# . . # . . . #", 1, "# # # # . . . #");
        check("..... ..#.. .....", 2, "..... ..#.. .....");
        check("##.## ##s## #####", 1, "##### ##### #####");
        check("#...# #...# #####", 1, "#...# #...# #####");
        check(".", 16, ".");
        check("#", 16, "#");
    }
}
