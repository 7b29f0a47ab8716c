//! Repair of the verdicts by what stands around them: shadow that must be body, gaps, holes.
//!
//! Bits flow in and out. Every stage is linear in the pixels that are not background, but for closing, which looks at
//! the whole picture.

use super::components::{Components, Connectivity, Piece, Wanted};
use crate::frame::{BitMask, WORD_PIXELS};

/// A body's pixels misread as shadow are at most this share of the body's run above and below them; a shadow between
/// two people is long compared with the feet and the head that it joins.
const GREATEST_GAP: f32 = 0.5;

/// Where a column stands, from the top down.
#[derive(Clone, Copy, Debug, Default)]
struct Column {
    /// Moving pixels in a row above the gap; 0 when there are none.
    n_above: u32,
    /// Shadow pixels in a row beneath them.
    n_gap: u32,
    /// Moving pixels in a row beneath the gap, while it is not decided.
    n_below: u32,
}

/// Makes shadow that lies within a body part of it again.
///
/// Dark clothes can look like the shadow of what is behind them. A cast shadow lies beneath or beside its owner, so
/// shadow with moving pixels above and below it in its column, close to each other, is body.
pub(super) fn restore_enclosed_shadow(moving: &mut BitMask, shadow: &mut BitMask) {
    for word in 0..moving.words_per_row() {
        let mut columns = [Column::default(); WORD_PIXELS];
        let mut is_begun = false;
        for y in 0..moving.height() {
            let (moving_bits, shadow_bits) = (moving.row(y)[word], shadow.row(y)[word]);
            if moving_bits | shadow_bits == 0 {
                if is_begun {
                    columns = [Column::default(); WORD_PIXELS];
                    is_begun = false;
                }
                continue;
            }
            is_begun = true;
            for (x, column) in columns.iter_mut().enumerate() {
                let bit = 1 << x;
                let seen = if moving_bits & bit != 0 {
                    Seen::Moving
                } else if shadow_bits & bit != 0 {
                    Seen::Shadow
                } else {
                    Seen::Background
                };
                for above in y - column.advance(seen) as usize..y {
                    moving.row_mut(above)[word] |= bit;
                    shadow.row_mut(above)[word] &= !bit;
                }
            }
        }
    }
}

/// Shadow beneath a piece is its legs if it is at least this share of the piece's height ...
const LEAST_LEGS: f32 = 0.25;

/// ... and at most this: who is seen down to the waist has legs as long as that, and rarely longer.
const MOST_LEGS: f32 = 2.5;

/// Share of a piece's columns that are shadow in a row of its legs.
const LEAST_LEG_COLUMNS: f32 = 0.3;

/// Makes shadow that stands in the place of legs part of its piece.
///
/// Dark trousers before a light ground can look like the ground in shadow, all of them: then a body ends at the waist,
/// and shadow follows right beneath, within its columns, about as long as the body. What a body casts beneath its feet
/// is short in comparison, or lies to the side.
pub(super) fn restore_legs(moving: &mut BitMask, shadow: &mut BitMask, pieces: &[Piece]) {
    let n_rows = moving.height() as u32;
    for piece in pieces {
        let (left, right) = (piece.left as usize, piece.right as usize);
        let least_px = LEAST_LEG_COLUMNS * (right - left) as f32;
        let is_leg_row = |y: u32| {
            moving.count_run(y as usize, left, right) == 0
                && shadow.count_run(y as usize, left, right) as f32 >= least_px
        };
        let (mut end, height) = (piece.bottom, (piece.bottom - piece.top) as f32);
        let length = |end: u32| (end - piece.bottom) as f32;
        while end < n_rows && length(end) <= MOST_LEGS * height && is_leg_row(end) {
            end += 1;
        }
        if (LEAST_LEGS * height..=MOST_LEGS * height).contains(&length(end)) {
            for y in piece.bottom as usize..end as usize {
                shadow.move_run(moving, y, left, right);
            }
        }
    }
}

/// What a pixel was judged to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seen {
    Background,
    Moving,
    Shadow,
}

impl Column {
    /// Takes the next pixel downwards; the number of rows above it that become moving, mostly none.
    fn advance(&mut self, seen: Seen) -> u32 {
        match seen {
            Seen::Moving if self.n_gap == 0 => self.n_above += 1,
            Seen::Moving => {
                self.n_below += 1;
                if self.n_gap as f32 <= GREATEST_GAP * (self.n_above + self.n_below) as f32 {
                    let n_rows = self.n_gap + self.n_below - 1;
                    *self = Self { n_above: self.n_above + n_rows + 1, ..Self::default() };
                    return n_rows;
                }
            }
            Seen::Shadow if self.n_below > 0 => *self = Self { n_above: self.n_below, n_gap: 1, n_below: 0 },
            Seen::Shadow if self.n_above > 0 => self.n_gap += 1,
            _ => *self = Self::default(),
        }
        0
    }
}

/// Makes every hole of at most `max_hole_px` pixels that does not touch the picture's border moving.
pub(super) fn fill_holes(moving: &mut BitMask, max_hole_px: u32, components: &mut Components) {
    let (width, height) = (moving.width() as u32, moving.height() as u32);
    components.find(moving, Wanted::Zeros, Connectivity::Four);
    for run in components.runs() {
        let hole = &components.pieces()[run.piece_idx as usize];
        let is_enclosed = hole.left > 0 && hole.top > 0 && hole.right < width && hole.bottom < height;
        if is_enclosed && hole.area_px <= max_hole_px {
            moving.set_run(run.y as usize, run.start as usize, run.end as usize);
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
    use super::*;

    /// Moving and shadow pixels drawn with `#` moving, `s` shadow, `.` background, one row a word.
    fn drawn(picture: &str) -> (BitMask, BitMask) {
        let rows: Vec<&str> = picture.split_whitespace().collect();
        let bits = |letter| {
            let mut mask = BitMask::new(rows[0].len() as u32, rows.len() as u32);
            for (y, row) in rows.iter().enumerate() {
                for (x, _) in row.chars().enumerate().filter(|(_, drawn)| *drawn == letter) {
                    mask.set_run(y, x, x + 1);
                }
            }
            mask
        };
        (bits('#'), bits('s'))
    }

    fn shown(moving: &BitMask, shadow: &BitMask) -> String {
        let letter = |x: usize, y: usize| match (moving.get(x, y), shadow.get(x, y)) {
            (true, _) => '#',
            (false, true) => 's',
            (false, false) => '.',
        };
        let row = |y: usize| (0..moving.width()).map(|x| letter(x, y)).collect::<String>();
        (0..moving.height()).map(row).collect::<Vec<String>>().join(" ")
    }

    #[test]
    fn shadow_within_a_column_of_body_is_body() {
        let check = |column: &str, expected: &str| {
            let upright: Vec<String> = column.chars().map(String::from).collect();
            let (mut moving, mut shadow) = drawn(&upright.join(" "));
            restore_enclosed_shadow(&mut moving, &mut shadow);
            assert_eq!(shown(&moving, &shadow).replace(' ', ""), expected, "{column}");
        };
        check("####ss####", "##########");
        check("##s..", "##s..");
        check("s####", "s####");
        check("#s.##", "#s.##");
        check("#ssssss#", "#ssssss#");
        check("##ss##", "######");
        check("#sss#####", "#########");
        check("#ssss#ss####", "#ssss#######");
        check("##s##s##", "########");
        check("ssss", "ssss");
    }

    #[test]
    fn columns_are_judged_by_themselves() {
        let (mut moving, mut shadow) = drawn("#.# #s# s## ###");
        restore_enclosed_shadow(&mut moving, &mut shadow);
        assert_eq!(shown(&moving, &shadow), "#.# #s# ### ###");
    }

    #[test]
    fn shadow_in_the_place_of_legs_is_legs() {
        let check = |picture: &str, expected: &str| {
            let (mut moving, mut shadow) = drawn(picture);
            let mut components = Components::default();
            components.find(&moving, Wanted::Ones, Connectivity::Eight);
            restore_legs(&mut moving, &mut shadow, components.pieces());
            assert_eq!(shown(&moving, &shadow), expected, "{picture}");
        };
        // Down to the waist, with legs.
        check(".##. .##. .ss. .ss. ....", ".##. .##. .##. .##. ....");
        // What lies to the side stays shadow.
        check(".##. .##. .sss .sss ....", ".##. .##. .##s .##s ....");
        // A short shadow at the feet.
        check(".#. .#. .#. .#. .#. .s. ...", ".#. .#. .#. .#. .#. .s. ...");
        // A shadow longer than any legs.
        check("# s s s .", "# s s s .");
        // Legs are seen: what is between them is no leg.
        check("### #s# #s# ...", "### #s# #s# ...");
        check("#", "#");
    }

    #[test]
    fn small_enclosed_holes_are_filled() {
        let check = |picture: &str, max_hole_px: u32, expected: &str| {
            let (mut moving, shadow) = drawn(picture);
            fill_holes(&mut moving, max_hole_px, &mut Components::default());
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
