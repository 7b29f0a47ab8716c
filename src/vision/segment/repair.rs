//! Repair of the verdicts by what stands around them: shadow that must be body.
//!
//! Bits flow in and out. Every stage is linear in the pixels that are not background.

use super::components::{Components, Connectivity, Piece, Run, Wanted};
use crate::frame::{BitMask, WORD_PIXELS};

/// A body's pixels misread as shadow are at most this share of the body's run above and below them; a shadow between
/// two people is long compared with the feet and the head that it joins.
const GREATEST_GAP: f32 = 0.5;

/// A gap across a body is at most this share of the shorter of the body's runs above and beneath it.
const GREATEST_BRIDGE: f32 = 0.25;

/// Repairs columns, each by itself, from the top down; keeps its memory from frame to frame.
///
/// Something begins or ends only where a row differs from the one above it: other pixels are not looked at.
#[derive(Debug, Default)]
pub(super) struct Columns {
    columns: Vec<Column>,
    /// Moving and shadow pixels of the row above.
    above: Vec<[u32; 2]>,
}

/// State of a column on the way down.
#[derive(Clone, Copy, Debug, Default)]
struct Column {
    /// First row of what goes on.
    since: u32,
    /// Moving pixels in a row above the gap; 0 when there are none.
    n_above: u32,
    /// Pixels of the gap beneath them.
    n_gap: u32,
    /// Moving pixels in a row beneath the gap, if they are too few to decide.
    n_below: u32,
}

impl Columns {
    /// Makes shadow that lies within a body part of it again; no pixel is both at first.
    ///
    /// Dark clothes can look like the shadow of what is behind them. A cast shadow lies beneath or beside its owner, so
    /// shadow with moving pixels above and below it in its column, close to each other, is body.
    pub(super) fn restore_enclosed_shadow(&mut self, moving: &mut BitMask, shadow: &mut BitMask) {
        self.walk(moving, Some(shadow), Column::take_shadowed);
    }

    /// Joins what stands above and beneath a narrow gap.
    ///
    /// Nothing is found where a strip of the background has the colour of somebody's clothes, a belt say, and a body is two.
    pub(super) fn bridge_gaps(&mut self, moving: &mut BitMask) {
        self.walk(moving, None, Column::take_parted);
    }

    /// Calls `take` with what ends in each column and how many rows it had; makes so many rows above these moving as it returns.
    fn walk(
        &mut self,
        moving: &mut BitMask,
        mut shadow: Option<&mut BitMask>,
        take: fn(&mut Column, Seen, u32) -> u32,
    ) {
        let (words_per_row, height) = (moving.words_per_row(), moving.height());
        self.columns.clear();
        self.columns.resize(words_per_row * WORD_PIXELS, Column::default());
        self.above.clear();
        self.above.resize(words_per_row, [0; 2]);
        let mut is_empty_above = true;
        for y in 0..=height {
            let is_empty = |mask: &BitMask| y == height || mask.is_row_empty(y);
            let was_empty = is_empty_above;
            is_empty_above = is_empty(moving) && shadow.as_deref().is_none_or(is_empty);
            if was_empty && is_empty_above {
                continue;
            }
            for word in 0..words_per_row {
                let bits = |mask: &BitMask| if y == height { 0 } else { mask.row(y)[word] };
                let now = [bits(moving), shadow.as_deref().map_or(0, bits)];
                let above = std::mem::replace(&mut self.above[word], now);
                let mut ending = (now[0] ^ above[0]) | (now[1] ^ above[1]);
                while ending != 0 {
                    let bit = ending & ending.wrapping_neg();
                    let column = &mut self.columns[word * WORD_PIXELS + ending.trailing_zeros() as usize];
                    ending ^= bit;
                    let first = std::mem::replace(&mut column.since, y as u32);
                    let n_rows = take(column, Seen::of(above, bit), y as u32 - first);
                    let rows = (first - n_rows) as usize..first as usize;
                    fill(moving, shadow.as_deref_mut(), rows, (word, bit));
                }
            }
        }
    }
}

/// Makes rows of a column moving.
fn fill(
    moving: &mut BitMask,
    shadow: Option<&mut BitMask>,
    rows: std::ops::Range<usize>,
    (word, bit): (usize, u32),
) {
    for row in rows.clone() {
        moving.row_mut(row)[word] |= bit;
    }
    if let Some(shadow) = shadow {
        for row in rows {
            shadow.row_mut(row)[word] &= !bit;
        }
    }
}

impl Column {
    /// Takes rows of a column of body and shadow; returns the rows above them that become moving, mostly none.
    fn take_shadowed(&mut self, seen: Seen, n_rows: u32) -> u32 {
        match seen {
            Seen::Moving if self.n_gap == 0 => self.n_above += n_rows,
            Seen::Moving if self.n_gap as f32 <= GREATEST_GAP * (self.n_above + n_rows) as f32 => {
                return self.join(n_rows);
            }
            Seen::Moving => self.n_below = n_rows,
            Seen::Shadow if self.n_below > 0 => self.begin(self.n_below, n_rows),
            Seen::Shadow if self.n_above > 0 => self.n_gap = n_rows,
            _ => self.begin(0, 0),
        }
        0
    }

    /// Takes rows of a column of body and gaps; returns the rows above them that become moving, mostly none.
    fn take_parted(&mut self, seen: Seen, n_rows: u32) -> u32 {
        if seen != Seen::Moving {
            let n_above = if self.n_below > 0 { self.n_below } else { self.n_above };
            let is_narrow = n_rows as f32 <= GREATEST_BRIDGE * n_above as f32;
            self.begin(if is_narrow { n_above } else { 0 }, if is_narrow { n_rows } else { 0 });
        } else if self.n_gap == 0 {
            self.n_above += n_rows;
        } else if self.n_gap as f32 <= GREATEST_BRIDGE * n_rows as f32 {
            return self.join(n_rows);
        } else {
            self.n_below = n_rows;
        }
        0
    }

    fn begin(&mut self, n_above: u32, n_gap: u32) {
        *self = Self { n_above, n_gap, n_below: 0, ..*self };
    }

    /// Makes one of what is above the gap and `n_rows` beneath it; returns the gap's rows.
    fn join(&mut self, n_rows: u32) -> u32 {
        let n_gap = self.n_gap;
        self.begin(self.n_above + n_gap + n_rows, 0);
        n_gap
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
/// is short in comparison, or lies to the side; shadow that goes on to both sides is none of it.
pub(super) fn restore_legs(moving: &mut BitMask, shadow: &mut BitMask, pieces: &[Piece]) {
    let n_rows = moving.height() as u32;
    for piece in pieces {
        let (left, right) = (piece.left as usize, piece.right as usize);
        let least_px = LEAST_LEG_COLUMNS * (right - left) as f32;
        let strip = (right - left).div_ceil(2);
        // Shadow that goes on to both sides is that of something larger, in which somebody stands.
        let goes_on = |y: u32, start: usize, end: usize| {
            2 * shadow.count_run(y as usize, start, end) as usize >= strip.min(end - start).max(1)
        };
        let is_leg_row = |y: u32| {
            moving.count_run(y as usize, left, right) == 0
                && shadow.count_run(y as usize, left, right) as f32 >= least_px
                && !(goes_on(y, left.saturating_sub(strip), left)
                    && goes_on(y, right, (right + strip).min(shadow.width())))
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

/// Shadow of which at least this share of the outline touches moving pixels is part of what it lies in ...
const LEAST_SURROUNDED: f32 = 0.55;

/// ... if this share of its underside does: what casts a shadow stands on it, and not under it.
const LEAST_SURROUNDED_BELOW: f32 = 0.5;

/// Makes shadow that lies mostly within moving pixels, and not beneath them, part of them; keeps its memory.
///
/// The dark window of a car looks like the road in shadow. What casts a shadow touches it along a side; the rest of a
/// shadow's outline is background. Shadow larger than all that moves is part of nothing: a light was switched.
#[derive(Debug, Default)]
pub(super) struct Surroundings {
    outlines: Vec<Outline>,
}

/// The sides of a piece's pixels that are not the piece's own, and those at the picture's border.
#[derive(Clone, Copy, Debug, Default)]
struct Outline {
    n_sides: u32,
    n_moving: u32,
    /// Of these, the undersides.
    n_below: u32,
    n_moving_below: u32,
}

impl Outline {
    fn is_surrounded(self) -> bool {
        self.n_moving > 0
            && self.n_moving as f32 >= LEAST_SURROUNDED * self.n_sides as f32
            && self.n_moving_below as f32 >= LEAST_SURROUNDED_BELOW * self.n_below as f32
    }
}

impl Surroundings {
    pub(super) fn restore(
        &mut self,
        moving: &mut BitMask,
        shadow: &mut BitMask,
        components: &mut Components,
    ) {
        components.find(shadow, Wanted::Ones, Connectivity::Four);
        if components.pieces().is_empty() {
            return;
        }
        let most_px = moving.count_ones();
        self.outlines.clear();
        self.outlines.resize(components.pieces().len(), Outline::default());
        for run in components.runs() {
            self.outlines[run.piece_idx as usize].add(run, moving, shadow);
        }
        for run in components.runs() {
            let piece_idx = run.piece_idx as usize;
            let area_px = components.pieces()[piece_idx].area_px;
            if u64::from(area_px) <= most_px && self.outlines[piece_idx].is_surrounded() {
                shadow.move_run(moving, run.y as usize, run.start as usize, run.end as usize);
            }
        }
    }
}

impl Outline {
    fn add(&mut self, run: &Run, moving: &BitMask, shadow: &BitMask) {
        let (y, start, end) = (run.y as usize, run.start as usize, run.end as usize);
        for x in [start.checked_sub(1), Some(end)].into_iter().flatten().filter(|x| *x < moving.width()) {
            // The run ends there, so it is not shadow.
            self.n_sides += 1;
            self.n_moving += u32::from(moving.get(x, y));
        }
        let beyond = |row: usize| {
            let n_sides = (end - start) as u32 - shadow.count_run(row, start, end);
            (n_sides, moving.count_run(row, start, end))
        };
        if y > 0 {
            let (n_sides, n_moving) = beyond(y - 1);
            self.n_sides += n_sides;
            self.n_moving += n_moving;
        }
        if y + 1 < moving.height() {
            let (n_sides, n_moving) = beyond(y + 1);
            self.n_sides += n_sides;
            self.n_moving += n_moving;
            self.n_below += n_sides;
            self.n_moving_below += n_moving;
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

impl Seen {
    /// Returns what a bit of words of moving and shadow pixels says.
    const fn of([moving, shadow]: [u32; 2], bit: u32) -> Self {
        if moving & bit != 0 {
            Self::Moving
        } else if shadow & bit != 0 {
            Self::Shadow
        } else {
            Self::Background
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::drawn::{drawn, shown};
    use super::*;
    use proptest::prelude::*;

    /// A column as it is judged pixel by pixel.
    #[derive(Clone, Copy, Default)]
    struct Plain {
        n_above: usize,
        n_gap: usize,
        n_below: usize,
    }

    impl Plain {
        /// Takes the next pixel downwards of body and shadow; returns the number of rows above it that become moving.
        fn advance_shadowed(&mut self, seen: Seen) -> usize {
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
                Seen::Shadow if self.n_below > 0 => {
                    *self = Self { n_above: self.n_below, n_gap: 1, n_below: 0 };
                }
                Seen::Shadow if self.n_above > 0 => self.n_gap += 1,
                _ => *self = Self::default(),
            }
            0
        }

        /// Takes the next pixel downwards of body and gaps; returns the number of rows above it that become moving.
        fn advance_parted(&mut self, seen: Seen) -> usize {
            if seen != Seen::Moving {
                if self.n_below > 0 {
                    *self = Self { n_above: self.n_below, n_gap: 0, n_below: 0 };
                }
                self.n_gap += usize::from(self.n_above > 0);
                if self.n_gap as f32 > GREATEST_BRIDGE * self.n_above as f32 {
                    *self = Self::default();
                }
                return 0;
            }
            if self.n_gap == 0 {
                self.n_above += 1;
                return 0;
            }
            self.n_below += 1;
            if self.n_gap as f32 > GREATEST_BRIDGE * self.n_below as f32 {
                return 0;
            }
            let n_rows = self.n_gap + self.n_below - 1;
            *self = Self { n_above: self.n_above + n_rows + 1, ..Self::default() };
            n_rows
        }
    }

    /// Repairs every column pixel by pixel.
    fn repaired(
        moving: &BitMask,
        shadow: &BitMask,
        advance: fn(&mut Plain, Seen) -> usize,
    ) -> (BitMask, BitMask) {
        let (mut out_moving, mut out_shadow) = (moving.clone(), shadow.clone());
        for x in 0..moving.width() {
            let mut column = Plain::default();
            for y in 0..moving.height() {
                let seen = match (moving.get(x, y), shadow.get(x, y)) {
                    (true, _) => Seen::Moving,
                    (false, true) => Seen::Shadow,
                    (false, false) => Seen::Background,
                };
                for above in y - advance(&mut column, seen)..y {
                    out_moving.set_run(above, x, x + 1);
                    out_shadow.clear_run(above, x, x + 1);
                }
            }
        }
        (out_moving, out_shadow)
    }

    proptest! {
        #[test]
        fn columns_by_what_ends_are_columns_pixel_by_pixel(
            columns in prop::collection::vec(prop::collection::vec((0..5_u8, 1..12_usize), 1..14), 1..70),
            height in 1..90_usize,
        ) {
            let [mut moving, mut shadow] = [(); 2].map(|()| BitMask::new(columns.len() as u32, height as u32));
            for (x, runs) in columns.iter().enumerate() {
                let letters = runs.iter().flat_map(|(kind, n_rows)| std::iter::repeat_n(*kind, *n_rows));
                for (y, kind) in letters.take(height).enumerate() {
                    let of = match kind {
                        0 | 1 => &mut moving,
                        2 | 3 => &mut shadow,
                        _ => continue,
                    };
                    of.set_run(y, x, x + 1);
                }
            }
            let mut columns = Columns::default();
            // Bits of an earlier frame must not show.
            columns.bridge_gaps(&mut repaired(&shadow, &moving, Plain::advance_shadowed).0);
            let expected = repaired(&moving, &shadow, Plain::advance_parted).0;
            let mut found = moving.clone();
            columns.bridge_gaps(&mut found);
            prop_assert_eq!(found, expected);
            let expected = repaired(&moving, &shadow, Plain::advance_shadowed);
            columns.restore_enclosed_shadow(&mut moving, &mut shadow);
            prop_assert_eq!((moving, shadow), expected);
        }
    }

    #[test]
    fn a_narrow_gap_in_a_column_of_body_is_body() {
        let check = |column: &str, expected: &str| {
            let upright: Vec<String> = column.chars().map(String::from).collect();
            let (mut moving, shadow) = drawn(&upright.join(" "));
            Columns::default().bridge_gaps(&mut moving);
            assert_eq!(shown(&moving, &shadow).replace(' ', ""), expected, "{column}");
        };
        check("########..########", "##################");
        // Wider than a quarter of what is above, or beneath.
        check("########...############", "########...############");
        check("########..#######", "########..#######");
        check("###.####", "###.####");
        // A bridged gap counts as body for the next one.
        check("####.####.####", "##############");
        // A gap that is none by what is above it begins anew beneath.
        check("###...####.####", "###...#########");
        check("....", "....");
        check("####.###", "####.###");
    }

    #[test]
    fn shadow_within_a_column_of_body_is_body() {
        let check = |column: &str, expected: &str| {
            let upright: Vec<String> = column.chars().map(String::from).collect();
            let (mut moving, mut shadow) = drawn(&upright.join(" "));
            Columns::default().restore_enclosed_shadow(&mut moving, &mut shadow);
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
        Columns::default().restore_enclosed_shadow(&mut moving, &mut shadow);
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
    fn shadow_within_moving_pixels_is_part_of_them() {
        let check = |picture: &str, expected: &str| {
            let (mut moving, mut shadow) = drawn(picture);
            Surroundings::default().restore(&mut moving, &mut shadow, &mut Components::default());
            assert_eq!(shown(&moving, &shadow), expected, "{picture}");
        };
        // A window, and one at the edge of what it belongs to.
        check("###### #ssss# #ssss# ######", "###### ###### ###### ######");
        check(".#####. .#ss#.. .####..", ".#####. .####.. .####..");
        check("#### #### sss# ####", "#### #### #### ####");
        // Beneath, beside, and larger than what it would be part of.
        check("####. ####. sssss .....", "####. ####. sssss .....");
        check("#.... #sss. #sss. .....", "#.... #sss. #sss. .....");
        let large = "######## #ssssss# #ssssss# #ssssss# #ssssss# #ssssss# #ssssss# ########";
        check(large, large);
        // At the border there is nothing to be surrounded by.
        check("s", "s");
        check("ss ss", "ss ss");
        // Under an arch: most of its sides, but not its underside.
        check("##### #sss# #sss# #sss# .....", "##### #sss# #sss# #sss# .....");
    }
}
