//! Repair of labels by what stands around them: shadow that must be body, gaps, holes.
//!
//! Labels flow in and out. Every stage is linear in the pixels.

use super::components::{Components, Connectivity};
use super::{MOVING, SHADOW};

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

/// Makes shadow that lies within a body part of it again; keeps its memory from frame to frame.
///
/// Dark clothes can look like the shadow of what is behind them. A cast shadow lies beneath or beside its owner, so
/// shadow with moving pixels above and below it in its column, close to each other, is body.
#[derive(Debug, Default)]
pub(super) struct EnclosedShadow {
    columns: Vec<Column>,
}

impl EnclosedShadow {
    pub(super) fn restore(&mut self, labels: &mut [u8], width: usize) {
        self.columns.clear();
        self.columns.resize(width, Column::default());
        for y in 0..labels.len() / width {
            for (x, column) in self.columns.iter_mut().enumerate() {
                let n_rows = column.advance(labels[y * width + x]);
                for above in y - n_rows as usize..y {
                    labels[above * width + x] = MOVING;
                }
            }
        }
    }
}

impl Column {
    /// Takes the next label downwards; the number of rows above it that become moving, mostly none.
    fn advance(&mut self, label: u8) -> u32 {
        match label {
            MOVING if self.n_gap == 0 => self.n_above += 1,
            MOVING => {
                self.n_below += 1;
                if self.n_gap as f32 <= GREATEST_GAP * (self.n_above + self.n_below) as f32 {
                    let n_rows = self.n_gap + self.n_below - 1;
                    *self = Self { n_above: self.n_above + n_rows + 1, ..Self::default() };
                    return n_rows;
                }
            }
            SHADOW if self.n_below > 0 => *self = Self { n_above: self.n_below, n_gap: 1, n_below: 0 },
            SHADOW if self.n_above > 0 => self.n_gap += 1,
            _ => *self = Self::default(),
        }
        0
    }
}

/// Fills every hole of at most `max_hole_px` pixels that does not touch the picture's border.
pub(super) fn fill_holes(labels: &mut [u8], width: usize, max_hole_px: u32, components: &mut Components) {
    let height = (labels.len() / width) as u32;
    components.find(labels, width, Connectivity::Four, |label| label != MOVING);
    for run in components.runs() {
        let hole = &components.pieces()[run.piece_idx as usize];
        let is_enclosed = hole.left > 0 && hole.top > 0 && hole.right < width as u32 && hole.bottom < height;
        if is_enclosed && hole.area_px <= max_hole_px {
            let row = run.y as usize * width;
            labels[row + run.start as usize..row + run.end as usize].fill(MOVING);
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
    pub(super) fn close(&mut self, labels: &mut [u8], width: usize, radius: u32) {
        let reach = radius.min(254) as u8;
        let margin = usize::from(reach);
        let (padded_width, height) = (width + 2 * margin, labels.len() / width);
        // With a margin as wide as the dilation reaches, the border needs no case of its own.
        self.near.clear();
        self.near.resize(padded_width * (height + 2 * margin), 0);
        let first = margin * padded_width + margin;
        for (near, row) in self.near[first..].chunks_mut(padded_width).zip(labels.chunks_exact(width)) {
            for (near, label) in near.iter_mut().zip(row) {
                *near = u8::from(*label == MOVING);
            }
        }
        for value in [1, 0] {
            // Eroding is spreading what is not there.
            self.spread_along_rows(padded_width, reach, value);
            self.spread_along_columns(padded_width, reach, value);
        }
        for (near, row) in self.near[first..].chunks(padded_width).zip(labels.chunks_exact_mut(width)) {
            for (near, label) in near.iter().zip(row) {
                if *near == 1 {
                    *label = MOVING;
                }
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

    /// Labels drawn with `#` moving, `s` shadow, `.` background, one row a word.
    fn drawn(picture: &str) -> (Vec<u8>, usize) {
        let rows: Vec<&str> = picture.split_whitespace().collect();
        let label = |c| match c {
            '#' => MOVING,
            's' => SHADOW,
            _ => 0,
        };
        (rows.concat().chars().map(label).collect(), rows[0].len())
    }

    fn shown(labels: &[u8], width: usize) -> String {
        let letter = |label: &u8| match *label {
            MOVING => '#',
            SHADOW => 's',
            _ => '.',
        };
        labels.chunks(width).map(|row| row.iter().map(letter).collect()).collect::<Vec<String>>().join(" ")
    }

    #[test]
    fn shadow_within_a_column_of_body_is_body() {
        let check = |column: &str, expected: &str| {
            let (mut labels, _) = drawn(column);
            EnclosedShadow::default().restore(&mut labels, 1);
            assert_eq!(shown(&labels, labels.len()), expected, "{column}");
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
        let (mut labels, width) = drawn("#.# #s# s## ###");
        EnclosedShadow::default().restore(&mut labels, width);
        assert_eq!(shown(&labels, width), "#.# #s# ### ###");
    }

    #[test]
    fn small_enclosed_holes_are_filled() {
        let check = |picture: &str, max_hole_px: u32, expected: &str| {
            let (mut labels, width) = drawn(picture);
            fill_holes(&mut labels, width, max_hole_px, &mut Components::default());
            assert_eq!(shown(&labels, width), expected);
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
            let (mut labels, width) = drawn(picture);
            Closing::default().close(&mut labels, width, radius);
            assert_eq!(shown(&labels, width), expected, "{picture} by {radius}");
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
