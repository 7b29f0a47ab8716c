//! Connected pieces of a mask of bits, by runs and union-find: one pass over the words, the rest over the runs.
//!
//! Bits flow in; pieces and the runs that they consist of flow out. Knows nothing of
//! what a piece means.

use crate::frame::{BitMask, WORD_PIXELS};

/// Which neighbours belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Connectivity {
    /// Left, right, above, below.
    Four,
    /// Diagonals too.
    Eight,
}

/// Which pixels are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    /// Those whose bit is 1.
    Ones,
    /// Those whose bit is 0.
    Zeros,
}

/// Pixels of one row that follow each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub(super) y: u32,
    /// First column.
    pub(super) start: u32,
    /// The column after the last.
    pub(super) end: u32,
    /// Index of its piece among [`Components::pieces`].
    pub(super) piece_idx: u32,
}

/// One connected piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    pub(super) left: u32,
    pub(super) top: u32,
    /// The column after the last.
    pub(super) right: u32,
    /// The row after the last.
    pub(super) bottom: u32,
    pub(super) area_px: u32,
    /// Sum and number of the columns of its lowest row.
    pub(super) foot: (u64, u32),
}

/// Finds pieces; keeps its memory from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Components {
    runs: Vec<Run>,
    parents: Vec<u32>,
    pieces: Vec<Piece>,
}

impl Components {
    /// Finds the pieces of the wanted pixels, in the order of their first pixels.
    pub(super) fn find(&mut self, mask: &BitMask, wanted: Wanted, connectivity: Connectivity) {
        self.runs.clear();
        self.parents.clear();
        let mut above = 0..0;
        for y in 0..mask.height() {
            let begin = self.runs.len();
            match wanted {
                _ if !mask.is_row_empty(y) => self.append_runs(mask, y, wanted),
                Wanted::Ones => {}
                Wanted::Zeros => self.push(y as u32, 0, mask.width() as u32),
            }
            self.join(above, begin, connectivity);
            above = begin..self.runs.len();
        }
        self.collect();
    }

    /// Finds the 8-connected pieces of these runs, which come in order of rows and columns.
    pub(super) fn find_in_runs(&mut self, runs: impl Iterator<Item = Run>) {
        self.runs.clear();
        self.parents.clear();
        let (mut above, mut begin, mut row) = (0..0, 0, None);
        for run in runs {
            if row != Some(run.y) {
                self.join(above, begin, Connectivity::Eight);
                let is_next = row.is_some_and(|row| row + 1 == run.y);
                above = if is_next { begin..self.runs.len() } else { 0..0 };
                begin = self.runs.len();
                row = Some(run.y);
            }
            self.push(run.y, run.start, run.end);
        }
        self.join(above, begin, Connectivity::Eight);
        self.collect();
    }

    pub(super) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    pub(super) fn runs(&self) -> &[Run] {
        &self.runs
    }

    fn push(&mut self, y: u32, start: u32, end: u32) {
        let run_idx = self.runs.len() as u32;
        self.runs.push(Run { y, start, end, piece_idx: run_idx });
        self.parents.push(run_idx);
    }

    fn append_runs(&mut self, mask: &BitMask, y: usize, wanted: Wanted) {
        let mut begun: Option<usize> = None;
        for (word, bits) in mask.row(y).iter().enumerate() {
            let first = word * WORD_PIXELS;
            let mut bits = match wanted {
                Wanted::Ones => *bits,
                Wanted::Zeros => !*bits & mask.inside(word),
            };
            if let Some(start) = begun {
                let n_more = bits.trailing_ones() as usize;
                if n_more == WORD_PIXELS {
                    continue;
                }
                self.push(y as u32, start as u32, (first + n_more) as u32);
                begun = None;
                bits &= u32::MAX << n_more;
            }
            while bits != 0 {
                let start = bits.trailing_zeros();
                let end = start + (bits >> start).trailing_ones();
                if end as usize == WORD_PIXELS {
                    begun = Some(first + start as usize);
                    break;
                }
                self.push(y as u32, first as u32 + start, first as u32 + end);
                bits &= u32::MAX << end;
            }
        }
        if let Some(start) = begun {
            self.push(y as u32, start as u32, mask.width() as u32);
        }
    }

    /// Joins the runs from `begin` on with those of the row above that they touch: both lists are sorted, so two
    /// fingers suffice.
    fn join(&mut self, mut above: std::ops::Range<usize>, begin: usize, connectivity: Connectivity) {
        let reach = if connectivity == Connectivity::Eight { 1 } else { 0 };
        for current in begin..self.runs.len() {
            let run = self.runs[current];
            while above.start < above.end && self.runs[above.start].end + reach <= run.start {
                above.start += 1;
            }
            let mut other = above.start;
            while other < above.end && self.runs[other].start < run.end + reach {
                self.unite(current as u32, other as u32);
                other += 1;
            }
        }
    }

    /// The lower index becomes the root, so roots come in the order of first pixels.
    fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        let (low, high) = (a.min(b), a.max(b));
        self.parents[high as usize] = low;
    }

    /// Halves the path on its way.
    fn root(&mut self, mut run_idx: u32) -> u32 {
        while self.parents[run_idx as usize] != run_idx {
            let parent = self.parents[run_idx as usize];
            self.parents[run_idx as usize] = self.parents[parent as usize];
            run_idx = self.parents[run_idx as usize];
        }
        run_idx
    }

    /// Gives every run the index of its piece and sums the pieces up. A root comes before the runs it stands for.
    fn collect(&mut self) {
        self.pieces.clear();
        for run_idx in 0..self.runs.len() {
            let root = self.root(run_idx as u32) as usize;
            if root == run_idx {
                self.runs[run_idx].piece_idx = self.pieces.len() as u32;
                self.pieces.push(Piece::of(self.runs[run_idx]));
            } else {
                let piece_idx = self.runs[root].piece_idx;
                self.runs[run_idx].piece_idx = piece_idx;
                let run = Piece::of(self.runs[run_idx]);
                self.pieces[piece_idx as usize].absorb(&run);
            }
        }
    }
}

impl Piece {
    pub(super) fn of(run: Run) -> Self {
        let len = run.end - run.start;
        let columns = u64::from(len) * u64::from(run.start + run.end - 1) / 2;
        Self {
            left: run.start,
            top: run.y,
            right: run.end,
            bottom: run.y + 1,
            area_px: len,
            foot: (columns, len),
        }
    }

    /// Takes another piece in.
    pub(super) fn absorb(&mut self, other: &Self) {
        if other.bottom > self.bottom {
            self.foot = other.foot;
        } else if other.bottom == self.bottom {
            self.foot = (self.foot.0 + other.foot.0, self.foot.1 + other.foot.1);
        }
        self.left = self.left.min(other.left);
        self.top = self.top.min(other.top);
        self.right = self.right.max(other.right);
        self.bottom = self.bottom.max(other.bottom);
        self.area_px += other.area_px;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Mask;
    use proptest::prelude::*;

    fn mask_of(bytes: &[u8], width: usize) -> BitMask {
        let (width, height) = (width as u32, (bytes.len() / width) as u32);
        let mut bits = BitMask::default();
        bits.take(&Mask { width, height, data: bytes.to_vec().into() }, 1);
        bits
    }

    fn find(picture: &str, connectivity: Connectivity) -> Vec<Piece> {
        let rows: Vec<&str> = picture.split_whitespace().collect();
        let bytes: Vec<u8> = rows.concat().bytes().map(|byte| u8::from(byte == b'#')).collect();
        let mut components = Components::default();
        components.find(&mask_of(&bytes, rows[0].len()), Wanted::Ones, connectivity);
        let pieces = components.pieces().to_vec();
        if connectivity == Connectivity::Eight {
            let runs = components.runs().to_vec();
            components.find_in_runs(runs.into_iter());
            assert_eq!(components.pieces(), pieces, "runs alone say the same");
        }
        // What is not asked for in a picture of its opposite is the same.
        let opposite: Vec<u8> = bytes.iter().map(|byte| 1 - byte).collect();
        components.find(&mask_of(&opposite, rows[0].len()), Wanted::Zeros, connectivity);
        assert_eq!(components.pieces(), pieces);
        pieces
    }

    #[test]
    fn pieces_are_told_apart() {
        let areas = |picture: &str, connectivity| {
            find(picture, connectivity).iter().map(|piece| piece.area_px).collect::<Vec<_>>()
        };
        let check = |picture: &str, four: &[u32], eight: &[u32]| {
            assert_eq!(areas(picture, Connectivity::Four), four, "{picture}");
            assert_eq!(areas(picture, Connectivity::Eight), eight, "{picture}");
        };
        check(".", &[], &[]);
        check("#", &[1], &[1]);
        check("### ###", &[6], &[6]);
        check("#. .#", &[1, 1], &[2]);
        check(".# #.", &[1, 1], &[2]);
        check("#.# .#. #.#", &[1, 1, 1, 1, 1], &[5]);
        check("#.# #.# ###", &[7], &[7]);
        check("#..# .##.", &[1, 1, 2], &[4]);
        check("##.. ...# ####", &[2, 5], &[2, 5]);
        check("#...# .###.", &[1, 1, 3], &[5]);
        check("#.#.# ..... #.#.#", &[1; 6], &[1; 6]);
        check("##### #...# #.#.# #...# #####", &[16, 1], &[16, 1]);
    }

    #[test]
    fn rectangle_and_foot_are_exact() {
        let pieces = find(".##.. .#... .#.#. .###. .#.#.", Connectivity::Eight);
        assert_eq!(pieces, [Piece { left: 1, top: 0, right: 4, bottom: 5, area_px: 10, foot: (1 + 3, 2) }],);
    }

    /// What a person would do: flood from every pixel.
    fn flooded(mask: &[u8], width: usize, connectivity: Connectivity) -> Vec<u32> {
        let (width, height) = (width as i64, (mask.len() / width) as i64);
        let mut seen = vec![false; mask.len()];
        let mut flood = |start: i64| {
            let (mut stack, mut area) = (vec![start], 0);
            while let Some(at) = stack.pop() {
                if mask[at as usize] == 0 || std::mem::replace(&mut seen[at as usize], true) {
                    continue;
                }
                area += 1;
                let neighbours = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy)));
                stack.extend(
                    neighbours
                        .filter(|(dx, dy)| connectivity == Connectivity::Eight || *dx == 0 || *dy == 0)
                        .map(|(dx, dy)| (at % width + dx, at / width + dy))
                        .filter(|(x, y)| (0..width).contains(x) && (0..height).contains(y))
                        .map(|(x, y)| y * width + x),
                );
            }
            area
        };
        (0..width * height).map(&mut flood).filter(|area| *area > 0).collect()
    }

    proptest! {
        #[test]
        fn pieces_equal_flooding(
            width in 1..80_usize,
            bits in prop::collection::vec(prop::bool::weighted(0.55), 80..600),
        ) {
            let height = bits.len() / width;
            let mask: Vec<u8> = bits[..width * height].iter().map(|bit| u8::from(*bit)).collect();
            for connectivity in [Connectivity::Four, Connectivity::Eight] {
                let mut components = Components::default();
                components.find(&mask_of(&mask, width), Wanted::Ones, connectivity);
                let areas: Vec<u32> = components.pieces().iter().map(|piece| piece.area_px).collect();
                prop_assert_eq!(areas, flooded(&mask, width, connectivity));
                let n_run_pixels: u32 = components.runs().iter().map(|run| run.end - run.start).sum();
                prop_assert_eq!(n_run_pixels, mask.iter().map(|byte| u32::from(*byte)).sum::<u32>());
            }
        }
    }
}
