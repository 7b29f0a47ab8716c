//! How far every pixel of a mask lies from the nearest pixel that is not part of it: exact, in linear time.
//!
//! A mask and which of its values are inside flow in; squared distances and feathering weights flow out. Knows
//! nothing of blobs or of what the weights are for.
//!
//! `[FH12]` Felzenszwalb and Huttenlocher 2012, Distance Transforms of Sampled Functions, Theory of Computing 8:
//! one pass along the columns, then the lower envelope of parabolas along each row. All numbers are whole, so the
//! distances are exact (the division by which two parabolas are parted is that of Meijster, Roerdink and Hesselink
//! 2000, A General Algorithm for Computing Distance Transforms in Linear Time).
//!
//! Beyond the papers: a row's envelope is taken run by run of inside pixels. The outside pixel at either end of a run
//! hides everything beyond it, so what is not inside costs nothing in the second pass.

use super::PixelRect;
use crate::frame::Mask;
use rayon::prelude::*;

/// Squared distance where there is no outside pixel at all.
pub const NO_OUTSIDE: u32 = u32::MAX;

/// Columns that one thread takes through the first pass: a few cache lines of every row.
const BLOCK_COLUMNS: usize = 64;

/// Rows that one thread takes through the second pass.
const STRIP_ROWS: usize = 32;

/// Distance along a column in which there is no outside pixel; sums with the sides of a picture stay below 2^32.
const FAR: u32 = 1 << 30;

/// One parabola of a lower envelope.
#[derive(Clone, Copy, Debug, Default)]
struct Parabola {
    /// Its lowest point's column, counted from the run's first.
    column: i64,
    /// Its value there, squared px.
    lowest: i64,
    /// First column at which it is the lowest of all.
    begin: i64,
}

/// The distance transform of a mask; keeps its memory from mask to mask.
#[derive(Debug)]
pub struct DistanceTransform {
    /// The part of the mask that was asked for.
    rect: PixelRect,
    /// The same with one more pixel on each side that the mask has: the outside is looked for in it.
    grown: PixelRect,
    /// Distances along the columns of `grown`, px: blocks of `BLOCK_COLUMNS` columns, each row-major.
    along_columns: Vec<u32>,
    /// Squared distances, px^2: the rows of `rect`, the columns of `grown`.
    squared: Vec<u32>,
    /// Memory of the second pass: for each strip of rows one row of distances and of parabolas.
    rows: Vec<u32>,
    envelopes: Vec<Parabola>,
}

const NOTHING: PixelRect = PixelRect { x: 0, y: 0, width: 0, height: 0 };

impl Default for DistanceTransform {
    fn default() -> Self {
        Self {
            rect: NOTHING,
            grown: NOTHING,
            along_columns: Vec::new(),
            squared: Vec::new(),
            rows: Vec::new(),
            envelopes: Vec::new(),
        }
    }
}

impl DistanceTransform {
    /// Takes the whole of `mask`; the pixels whose value satisfies `is_inside` get a distance, the others 0.
    ///
    /// What lies beyond the picture's border is not outside: nobody knows how a thing goes on there.
    ///
    /// **Cost** linear in the pixels. Allocates only for a mask larger than those before.
    pub fn compute(&mut self, mask: &Mask, is_inside: impl Fn(u8) -> bool + Sync) {
        self.compute_within(
            mask,
            PixelRect { x: 0, y: 0, width: mask.width, height: mask.height },
            is_inside,
        );
    }

    /// As [`Self::compute`], for the pixels of `rect` (of what the mask has of it) only.
    ///
    /// The outside is looked for in `rect` and the pixels next to it. For a connected piece that lies in `rect`
    /// altogether, such as a blob in its own rectangle, that gives the whole mask's distances, since on the way to any
    /// farther pixel there is a nearer one that is outside. A piece that `rect` cuts may get greater ones.
    pub fn compute_within(&mut self, mask: &Mask, rect: PixelRect, is_inside: impl Fn(u8) -> bool + Sync) {
        self.rect = clipped(rect, mask);
        if self.rect.width == 0 || self.rect.height == 0 {
            self.rect = NOTHING;
            return;
        }
        self.grown = grown(self.rect, mask);
        self.measure_columns(mask, &is_inside);
        self.measure_rows();
    }

    /// The part of the mask that was looked at last: as asked for, without what lies beyond the mask.
    #[must_use]
    pub const fn rect(&self) -> PixelRect {
        self.rect
    }

    /// Squared distances of row `y`, counted from the top of [`Self::rect`], in px^2 between pixel centres:
    /// `rect().width` values. 0 outside, at least 1 inside; [`NO_OUTSIDE`] everywhere if there is no outside pixel.
    ///
    /// # Panics
    /// When there is no such row.
    #[must_use]
    pub fn squared_row(&self, y: u32) -> &[u32] {
        let start = y as usize * self.grown.width as usize + (self.rect.x - self.grown.x) as usize;
        &self.squared[start..start + self.rect.width as usize]
    }

    /// The greatest squared distance in [`Self::rect`]; 0 where nothing is inside.
    #[must_use]
    pub fn greatest_squared(&self) -> u32 {
        (0..self.rect.height).flat_map(|y| self.squared_row(y)).copied().max().unwrap_or(0)
    }

    /// The feathering weight of every pixel of [`Self::rect`]: its distance over the greatest, 255 standing for 1.
    ///
    /// 0 outside; at least 1 inside, so that nothing inside is lost to rounding; 255 everywhere if there is no
    /// outside. `weights` takes the rectangle's size.
    pub fn write_weights(&self, weights: &mut Mask) {
        (weights.width, weights.height) = (self.rect.width, self.rect.height);
        weights.data.resize(self.rect.width as usize * self.rect.height as usize, 0);
        let greatest = self.greatest_squared();
        let scale = 255.0 / f64::from(greatest.max(1)).sqrt();
        let width = self.rect.width.max(1) as usize;
        let rows = weights.data.par_chunks_mut(width).enumerate().with_min_len(STRIP_ROWS);
        rows.for_each(|(y, out)| {
            for (weight, squared) in out.iter_mut().zip(self.squared_row(y as u32)) {
                let rounded = (f64::from(*squared).sqrt() * scale).round() as u8;
                *weight = if *squared == 0 { 0 } else { rounded.max(1) };
            }
        });
    }

    /// First pass: of every pixel of `grown`, the distance to the nearest outside pixel of its column.
    fn measure_columns(&mut self, mask: &Mask, is_inside: &(impl Fn(u8) -> bool + Sync)) {
        let PixelRect { x: left, y: top, width, height } = self.grown;
        let n_blocks = (width as usize).div_ceil(BLOCK_COLUMNS);
        let block_len = BLOCK_COLUMNS * height as usize;
        self.along_columns.resize(n_blocks * block_len, 0);
        self.along_columns.par_chunks_mut(block_len).enumerate().for_each(|(block_idx, block)| {
            let first = block_idx * BLOCK_COLUMNS;
            let n_columns = BLOCK_COLUMNS.min(width as usize - first);
            let mut nearest = [FAR; BLOCK_COLUMNS];
            for (y, out) in (top..top + height).zip(block.chunks_exact_mut(BLOCK_COLUMNS)) {
                let row = &mask.row(y)[left as usize + first..][..n_columns];
                for ((nearest, value), out) in nearest.iter_mut().zip(row).zip(out) {
                    *nearest = u32::from(is_inside(*value)) * (*nearest + 1).min(FAR);
                    *out = *nearest;
                }
            }
            nearest.fill(FAR);
            for out in block.chunks_exact_mut(BLOCK_COLUMNS).rev() {
                for (nearest, out) in nearest.iter_mut().zip(out) {
                    *nearest = (*nearest + 1).min(*out);
                    *out = *nearest;
                }
            }
        });
    }

    /// Second pass: along every row of `rect`, the lowest parabola of all columns.
    fn measure_rows(&mut self) {
        let (width, height) = (self.grown.width as usize, self.rect.height as usize);
        let n_strips = height.div_ceil(STRIP_ROWS);
        self.squared.resize(width * height, 0);
        self.rows.resize(n_strips * width, 0);
        self.envelopes.resize(n_strips * width, Parabola::default());
        let block_len = BLOCK_COLUMNS * self.grown.height as usize;
        let n_rows_above = (self.rect.y - self.grown.y) as usize;
        let blocks = &self.along_columns;
        self.squared
            .par_chunks_mut(STRIP_ROWS * width)
            .zip(self.rows.par_chunks_mut(width))
            .zip(self.envelopes.par_chunks_mut(width))
            .enumerate()
            .for_each(|(strip_idx, ((strip, row), envelope))| {
                for (y, out) in strip.chunks_exact_mut(width).enumerate() {
                    let start = (strip_idx * STRIP_ROWS + y + n_rows_above) * BLOCK_COLUMNS;
                    for (part, block) in row.chunks_mut(BLOCK_COLUMNS).zip(blocks.chunks_exact(block_len)) {
                        part.copy_from_slice(&block[start..start + part.len()]);
                    }
                    measure_row(row, out, envelope);
                }
            });
    }
}

/// One row of squared distances from its distances along the columns.
fn measure_row(distances: &[u32], out: &mut [u32], envelope: &mut [Parabola]) {
    out.fill(0);
    let mut start = 0;
    while let Some(skip) = distances[start..].iter().position(|distance| *distance > 0) {
        let begin = start + skip;
        let len = distances[begin..].iter().position(|distance| *distance == 0);
        let end = len.map_or(distances.len(), |len| begin + len);
        // With the outside pixel on either side, where the row has one.
        let run = begin.saturating_sub(1)..(end + 1).min(distances.len());
        measure_run(&distances[run.clone()], &mut out[run], envelope);
        start = end;
    }
}

/// The lower envelope of a run's parabolas (`[FH12]` algorithm 1), and its values.
fn measure_run(distances: &[u32], out: &mut [u32], envelope: &mut [Parabola]) {
    let mut len = 0;
    for (column, distance) in (0_i64..).zip(distances) {
        if *distance >= FAR {
            continue;
        }
        let lowest = i64::from(*distance) * i64::from(*distance);
        let mut begin = 0;
        while let Some(last) = envelope[..len].last() {
            // From the column after this on, the new parabola is below the last; flooring keeps that true on the
            // negative side.
            let height = lowest + column * column - last.lowest - last.column * last.column;
            begin = height.div_euclid(2 * (column - last.column)) + 1;
            if begin > last.begin {
                break;
            }
            len -= 1;
            begin = 0;
        }
        if begin < distances.len() as i64 {
            envelope[len] = Parabola { column, lowest, begin };
            len += 1;
        }
    }
    if len == 0 {
        out.fill(NO_OUTSIDE);
        return;
    }
    for (idx, parabola) in envelope[..len].iter().enumerate() {
        let end = envelope[..len].get(idx + 1).map_or(distances.len() as i64, |next| next.begin);
        let columns = parabola.begin..end;
        for (column, out) in columns.clone().zip(&mut out[columns.start as usize..columns.end as usize]) {
            let across = column - parabola.column;
            let squared = across * across + parabola.lowest;
            // Sides beyond 46340 px could reach farther than 32 bits tell.
            *out = u32::try_from(squared).unwrap_or(NO_OUTSIDE).min(NO_OUTSIDE - 1);
        }
    }
}

/// What `mask` has of `rect`.
fn clipped(rect: PixelRect, mask: &Mask) -> PixelRect {
    let (x, y) = (rect.x.min(mask.width), rect.y.min(mask.height));
    PixelRect { x, y, width: rect.width.min(mask.width - x), height: rect.height.min(mask.height - y) }
}

/// `rect` with the pixels next to it that `mask` has.
fn grown(rect: PixelRect, mask: &Mask) -> PixelRect {
    let (x, y) = (rect.x.saturating_sub(1), rect.y.saturating_sub(1));
    let (right, bottom) = (rect.x + rect.width, rect.y + rect.height);
    let (right, bottom) = ((right + 1).min(mask.width), (bottom + 1).min(mask.height));
    PixelRect { x, y, width: right - x, height: bottom - y }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::MOVING;
    use proptest::prelude::*;

    fn is_moving(label: u8) -> bool {
        label == MOVING
    }

    fn mask(width: u32, height: u32, is_inside: impl Fn(u32, u32) -> bool) -> Mask {
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let data = places.map(|(x, y)| if is_inside(x, y) { MOVING } else { 50 }).collect();
        Mask { width, height, data }
    }

    /// Every pixel against every outside pixel of the mask.
    fn expected(mask: &Mask, x: u32, y: u32) -> u32 {
        if mask.get(x, y) != MOVING {
            return 0;
        }
        let places = (0..mask.height).flat_map(|j| (0..mask.width).map(move |i| (i, j)));
        let outside = places.filter(|(i, j)| mask.get(*i, *j) != MOVING);
        outside.map(|(i, j)| i.abs_diff(x).pow(2) + j.abs_diff(y).pow(2)).min().unwrap_or(NO_OUTSIDE)
    }

    fn check(transform: &mut DistanceTransform, mask: &Mask) {
        transform.compute(mask, is_moving);
        assert_eq!((transform.rect().width, transform.rect().height), (mask.width, mask.height));
        for y in 0..mask.height {
            let expected: Vec<u32> = (0..mask.width).map(|x| expected(mask, x, y)).collect();
            assert_eq!(transform.squared_row(y), expected, "row {y} of {} x {}", mask.width, mask.height);
        }
    }

    #[test]
    fn distances_are_exact_in_every_size_and_memory_does_not_carry_over() {
        let mut transform = DistanceTransform::default();
        // From larger to smaller and back; primes, single rows, single columns, a single pixel.
        for (width, height) in [(67, 71), (1, 1), (1, 131), (131, 1), (64, 64), (2, 2), (65, 33), (7, 3)] {
            check(&mut transform, &mask(width, height, |_, _| true));
            check(&mut transform, &mask(width, height, |_, _| false));
            check(&mut transform, &mask(width, height, |x, y| (x, y) != (width / 3, height / 2)));
            check(&mut transform, &mask(width, height, |x, y| (x * 7 + y * 11) % 13 > 1));
            check(&mut transform, &mask(width, height, |x, _| x > width / 2));
            check(&mut transform, &mask(width, height, |_, y| y > height / 2));
            check(&mut transform, &mask(width, height, |x, y| (x, y) == (width - 1, height - 1)));
        }
    }

    #[test]
    fn a_very_wide_row_is_exact() {
        let mut transform = DistanceTransform::default();
        transform.compute(&mask(8192, 1, |x, _| x != 5), is_moving);
        assert_eq!(transform.squared_row(0)[8191], 8186 * 8186);
        transform.compute(&mask(1, 8192, |_, y| y != 5), is_moving);
        assert_eq!(transform.squared_row(8191), [8186 * 8186]);
        // The farthest that 32 bits can tell, and one beyond, which is still told from "no outside".
        transform.compute(&mask(65_538, 1, |x, _| x != 0), is_moving);
        let row = transform.squared_row(0);
        assert_eq!((row[65_535], row[65_536]), (65_535 * 65_535, NO_OUTSIDE - 1));
    }

    #[test]
    fn a_blob_s_rectangle_gives_what_the_whole_picture_gives() {
        let ring = |x: u32, y: u32| (9..20).contains(&(x.abs_diff(30) + y.abs_diff(25)));
        let other = |x: u32, y: u32| x > 60 && y > 3;
        let at_border = |x: u32, y: u32| y < 5 && x < 7;
        let mask = mask(73, 59, |x, y| ring(x, y) || other(x, y) || at_border(x, y));
        let (mut whole, mut part) = (DistanceTransform::default(), DistanceTransform::default());
        whole.compute(&mask, is_moving);
        for (x, y, width, height) in [(11, 6, 39, 39), (61, 4, 12, 55), (0, 0, 7, 5), (61, 4, 999, 999)] {
            part.compute_within(&mask, PixelRect { x, y, width, height }, is_moving);
            let rect = part.rect();
            for row in 0..rect.height {
                let expected = &whole.squared_row(y + row)[x as usize..][..rect.width as usize];
                assert_eq!(part.squared_row(row), expected, "row {row} of {rect:?}");
            }
        }
    }

    #[test]
    fn a_rectangle_with_nothing_in_it_has_no_rows_and_no_weights() {
        let mask = mask(5, 4, |_, _| true);
        let mut transform = DistanceTransform::default();
        let mut weights = Mask::filled(9, 9, 7);
        for (x, y, width, height) in [(5, 0, 3, 3), (0, 4, 3, 3), (1, 1, 0, 2), (1, 1, 2, 0), (9, 9, 9, 9)] {
            transform.compute_within(&mask, PixelRect { x, y, width, height }, is_moving);
            assert_eq!(transform.greatest_squared(), 0);
            transform.write_weights(&mut weights);
            assert!(weights.data.is_empty());
        }
    }

    #[test]
    fn weights_run_from_the_edge_to_their_own_maximum() {
        let mut transform = DistanceTransform::default();
        let mut weights = Mask::filled(0, 0, 0);
        let mut check = |mask: &Mask, expected: &[u8]| {
            transform.compute(mask, is_moving);
            transform.write_weights(&mut weights);
            assert_eq!((weights.width, weights.height), (mask.width, mask.height));
            assert_eq!(*weights.data, expected);
        };
        check(&mask(7, 1, |x, _| x > 0 && x < 6), &[0, 85, 170, 255, 170, 85, 0]);
        check(&mask(3, 2, |_, _| true), &[255; 6]);
        check(&mask(3, 2, |_, _| false), &[0; 6]);
        // One of a thousand would round to nothing.
        transform.compute(&mask(1001, 1, |x, _| x > 0), is_moving);
        transform.write_weights(&mut weights);
        assert_eq!((weights.data[0], weights.data[1], weights.data[1000]), (0, 1, 255));
    }

    proptest! {
        #[test]
        fn distances_equal_the_search_of_all_pairs(
            width in 1..90_u32,
            share in 0.0..1.0_f64,
            noise in prop::collection::vec(0.0..1.0_f64, 90..900),
        ) {
            let height = noise.len() as u32 / width;
            let mask = mask(width, height, |x, y| noise[(y * width + x) as usize] < share.sqrt());
            let mut transform = DistanceTransform::default();
            check(&mut transform, &mask);
        }
    }
}
