//! Connected pieces of a mask, by runs and union-find: one pass over the pixels, the rest over the runs.
//!
//! A predicate over the mask's bytes flows in; pieces and the runs that they consist of flow out. Knows nothing of
//! what a piece means.

/// Which neighbours belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Connectivity {
    /// Left, right, above, below.
    Four,
    /// Diagonals too.
    Eight,
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
    /// Finds the pieces of the pixels whose byte satisfies `belongs`, in the order of their first pixels.
    pub(super) fn find(
        &mut self,
        mask: &[u8],
        width: usize,
        connectivity: Connectivity,
        belongs: impl Fn(u8) -> bool,
    ) {
        self.runs.clear();
        self.parents.clear();
        let mut above = 0..0;
        for (y, row) in mask.chunks_exact(width).enumerate() {
            let begin = self.runs.len();
            self.append_runs(row, y as u32, &belongs);
            self.join(above, begin, connectivity);
            above = begin..self.runs.len();
        }
        self.collect();
    }

    pub(super) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    pub(super) fn runs(&self) -> &[Run] {
        &self.runs
    }

    fn append_runs(&mut self, row: &[u8], y: u32, belongs: &impl Fn(u8) -> bool) {
        let mut x = 0;
        while let Some(skip) = row[x..].iter().position(|value| belongs(*value)) {
            let start = x + skip;
            let len = row[start..].iter().position(|value| !belongs(*value)).unwrap_or(row.len() - start);
            x = start + len;
            let run_idx = self.runs.len() as u32;
            self.runs.push(Run { y, start: start as u32, end: x as u32, piece_idx: run_idx });
            self.parents.push(run_idx);
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
    fn of(run: Run) -> Self {
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
    use proptest::prelude::*;

    fn find(picture: &str, connectivity: Connectivity) -> Vec<Piece> {
        let rows: Vec<&str> = picture.split_whitespace().collect();
        let mut components = Components::default();
        components.find(rows.concat().as_bytes(), rows[0].len(), connectivity, |byte| byte == b'#');
        components.pieces().to_vec()
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
            width in 1..24_usize,
            bits in prop::collection::vec(prop::bool::weighted(0.55), 24..400),
        ) {
            let height = bits.len() / width;
            let mask: Vec<u8> = bits[..width * height].iter().map(|bit| u8::from(*bit)).collect();
            for connectivity in [Connectivity::Four, Connectivity::Eight] {
                let mut components = Components::default();
                components.find(&mask, width, connectivity, |byte| byte == 1);
                let areas: Vec<u32> = components.pieces().iter().map(|piece| piece.area_px).collect();
                prop_assert_eq!(areas, flooded(&mask, width, connectivity));
                let n_run_pixels: u32 = components.runs().iter().map(|run| run.end - run.start).sum();
                prop_assert_eq!(n_run_pixels, mask.iter().map(|byte| u32::from(*byte)).sum::<u32>());
            }
        }
    }
}
