//! What lies within or between moving pixels is filled: holes, gaps, notches.
//!
//! Bits flow in and out. Holes cost what the pixels cost that are not background, closing the whole picture.

use super::components::{Components, Connectivity, Piece, Wanted};
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
    near: Vec<u8>,
    distances: Vec<u8>,
    below: Vec<u8>,
}

impl Closing {
    /// Makes moving what the closing of the moving pixels covers.
    pub(super) fn close(&mut self, moving: &mut BitMask, radius: u32) {
        let reach = radius.min(254) as u8;
        let margin = usize::from(reach);
        let (width, height) = (moving.width(), moving.height());
        let padded_width = width + 2 * margin;
        // With a margin as wide as the dilation reaches, the border needs no case of its own.
        self.near.clear();
        self.near.resize(padded_width * (height + 2 * margin), 0);
        let first = margin * padded_width + margin;
        for (y, near) in self.near[first..].chunks_mut(padded_width).take(height).enumerate() {
            for (near, word) in near[..width].chunks_mut(WORD_PIXELS).zip(moving.row(y)) {
                for (x, near) in near.iter_mut().enumerate() {
                    *near = ((word >> x) & 1) as u8;
                }
            }
        }
        for value in [1, 0] {
            // Eroding is spreading what is not there.
            self.spread_along_rows(padded_width, reach, value);
            self.spread_along_columns(padded_width, reach, value);
        }
        for (y, near) in self.near[first..].chunks(padded_width).take(height).enumerate() {
            for (near, word) in near[..width].chunks(WORD_PIXELS).zip(moving.row_mut(y)) {
                *word |= near.iter().rev().fold(0, |bits, near| bits << 1 | u32::from(*near));
            }
        }
    }

    /// One pass to the right notes how far the last pixel with `value` lies behind; one back to the left takes
    /// whichever side is nearer.
    fn spread_along_rows(&mut self, width: usize, reach: u8, value: u8) {
        self.distances.resize(self.near.len(), 0);
        for (row, distances) in self.near.chunks_exact_mut(width).zip(self.distances.chunks_exact_mut(width))
        {
            let mut left = u8::MAX;
            for (pixel, distance) in row.iter().zip(distances.iter_mut()) {
                left = if *pixel == value { 0 } else { left.saturating_add(1) };
                *distance = left;
            }
            let mut right = u8::MAX;
            for (pixel, distance) in row.iter_mut().zip(distances.iter()).rev() {
                right = if *pixel == value { 0 } else { right.saturating_add(1) };
                if right.min(*distance) <= reach {
                    *pixel = value;
                }
            }
        }
    }

    /// The same downwards and back up, a row at a time.
    fn spread_along_columns(&mut self, width: usize, reach: u8, value: u8) {
        self.below.clear();
        self.below.resize(width, u8::MAX);
        for (row, distances) in self.near.chunks_exact(width).zip(self.distances.chunks_exact_mut(width)) {
            for ((above, distance), pixel) in self.below.iter_mut().zip(distances).zip(row) {
                *above = if *pixel == value { 0 } else { above.saturating_add(1) };
                *distance = *above;
            }
        }
        self.below.fill(u8::MAX);
        let rows = self.near.chunks_exact_mut(width).zip(self.distances.chunks_exact(width));
        for (row, distances) in rows.rev() {
            for ((below, distance), pixel) in self.below.iter_mut().zip(distances).zip(row) {
                *below = if *pixel == value { 0 } else { below.saturating_add(1) };
                if (*below).min(*distance) <= reach {
                    *pixel = value;
                }
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
