//! One look's verdict: are the place's edges where they belong, elsewhere, gone?
//!
//! The place and the last looks flow in, a verdict flows out. Knows nothing of how long it lasts.

use super::edges::Edges;
use super::look::{Grid, Looks};
use super::reference::{Reference, sharpness};
use super::search::{Fit, Search, around, below_whole_cells};

/// Of this share of the blocks or more the edges are found: the place is seen.
const SEEN_SHARE: f64 = 0.5;

/// Of this share or less: it is not. In between nothing is told, since a lorry may stand before half of it.
const LOST_SHARE: f64 = 0.2;

/// A displacement must find so many times as many edges as no displacement does.
const CLEARLY_BETTER: f64 = 1.15;

/// Fewest blocks by which a displacement is believed, and the share of all that are textured.
const LEAST_BLOCKS: usize = 5;
const LEAST_BLOCK_SHARE: f64 = 0.25;

/// Least displacement, share of the picture's width, and pixels: what shakes less or settles is no accident.
const LEAST_DISPLACEMENT: f64 = 0.007;
const LEAST_DISPLACEMENT_PX: f64 = 2.5;

/// Lasting edges of a look over the place's own: less than this and they are gone ...
const GONE: f64 = 0.3;

/// ... more than this, and others are there.
const THERE: f64 = 0.5;

/// A look's edges are lasting, if this share of them agrees from look to look.
const LASTING: f64 = 0.5;

/// Sharpness of most blocks over what it was, below which the picture is out of focus.
const BLURRED: f32 = 0.3;

/// Looks from one search in vain to the next: it costs more than all the rest.
const LOOKS_A_SEARCH: u32 = 3;

/// What a look shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// The place where it belongs.
    Sound,
    /// The place, displaced by so many pixels of the full picture to the right and down.
    Displaced([f64; 2]),
    /// Other edges, that last.
    Elsewhere,
    /// Next to no edges.
    Gone,
    /// Too little of one or the other.
    Unsure,
}

/// A verdict with what was measured for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Finding {
    pub(super) verdict: Verdict,
    /// Share of the blocks with edges in which they were found where they belong.
    pub(super) edges_left: f64,
}

/// Judges looks; keeps its memory from look to look.
#[derive(Debug)]
pub(super) struct Judge {
    /// Pixels of the frame a cell.
    cell_px: f64,
    least_displacement_px: f64,
    /// The mean of the last looks, in levels.
    luma: Vec<f32>,
    edges: Edges,
    /// The edges of one half of the looks and of the other: noise is not the same in both.
    halves: [Edges; 2],
    half_luma: Vec<f32>,
    search: Search,
    /// Where the place was found last, cells: while it stays there it need not be searched for.
    shift: [i32; 2],
    /// Looks until it is searched for again, where it was not found.
    n_until_search: u32,
    sharpness: Vec<f32>,
}

impl Judge {
    pub(super) fn new(grid: Grid, frame_width: u32) -> Self {
        let edges = Edges::new(grid.width, grid.height);
        Self {
            cell_px: grid.frame_cell_px as f64,
            least_displacement_px: (LEAST_DISPLACEMENT * f64::from(frame_width)).max(LEAST_DISPLACEMENT_PX),
            luma: vec![0.0; grid.n_cells()],
            halves: [edges.clone(), edges.clone()],
            half_luma: vec![0.0; grid.n_cells()],
            search: Search::new(grid.width, grid.height),
            shift: [0, 0],
            n_until_search: 0,
            sharpness: Vec::with_capacity(64),
            edges,
        }
    }

    /// The mean that was taken last, in levels.
    pub(super) fn luma(&self) -> &[f32] {
        &self.luma
    }

    /// Takes the mean of the looks that are held.
    pub(super) fn see(&mut self, looks: &Looks) {
        looks.mean(0, 1, &mut self.luma);
    }

    /// Judges the looks of which the mean was taken last.
    pub(super) fn judge(&mut self, reference: &Reference, looks: &Looks) -> Finding {
        self.edges.compute(&self.luma);
        let here = Fit::at(reference, &self.edges, [0, 0]);
        let finding = |verdict| Finding { verdict, edges_left: here.intact_share };
        let products = around(reference, &self.edges, [0, 0]);
        if is_peak(&products) && here.intact_share >= SEEN_SHARE {
            let is_blurred = self.relative_sharpness(reference) < BLURRED;
            return finding(if is_blurred { Verdict::Gone } else { Verdict::Sound });
        }
        let (there, products) = self.find(reference);
        let shift = there.shift;
        let below = below_whole_cells(&products);
        let displacement_px = [0, 1].map(|i| (f64::from(shift[i]) + below[i]) * self.cell_px);
        let is_near = displacement_px[0].hypot(displacement_px[1]) < self.least_displacement_px;
        let least_judged =
            LEAST_BLOCKS.max((LEAST_BLOCK_SHARE * reference.n_textured as f64).ceil() as usize);
        let is_seen_there = there.intact_share >= SEEN_SHARE && there.n_judged >= least_judged;
        if is_seen_there && !is_near && there.found > CLEARLY_BETTER * here.found {
            return finding(Verdict::Displaced(displacement_px));
        }
        if here.intact_share >= SEEN_SHARE || (is_near && is_seen_there) {
            return finding(Verdict::Sound);
        }
        let best_share = here.intact_share.max(if is_seen_there { there.intact_share } else { 0.0 });
        if best_share > LOST_SHARE {
            return finding(Verdict::Unsure);
        }
        finding(self.without_the_place(reference, looks))
    }

    /// Where the place is seen best: where it was the last time, or else wherever it is found.
    fn find(&mut self, reference: &Reference) -> (Fit, [i64; 9]) {
        let kept = Fit::at(reference, &self.edges, self.shift);
        let products = around(reference, &self.edges, self.shift);
        self.n_until_search = self.n_until_search.saturating_sub(1);
        if (kept.intact_share >= SEEN_SHARE && is_peak(&products)) || self.n_until_search > 0 {
            return (kept, products);
        }
        self.shift = self.search.best(reference, &self.luma, &self.edges);
        let found = Fit::at(reference, &self.edges, self.shift);
        if found.intact_share < SEEN_SHARE {
            self.n_until_search = LOOKS_A_SEARCH;
        }
        (found, around(reference, &self.edges, self.shift))
    }

    /// What there is instead of the place's edges.
    fn without_the_place(&mut self, reference: &Reference, looks: &Looks) -> Verdict {
        for (i, edges) in self.halves.iter_mut().enumerate() {
            looks.mean(i, 2, &mut self.half_luma);
            edges.compute(&self.half_luma);
        }
        let [even, odd] = &self.halves;
        let all = even.cells();
        let lasting = even.product(all, odd, [0, 0]) as f64;
        let both = even.product(all, even, [0, 0]) as f64 + odd.product(all, odd, [0, 0]) as f64;
        let expected: i64 = reference.blocks.iter().map(|block| block.energy).sum();
        let share = lasting / (expected as f64).max(1.0);
        if share < GONE {
            Verdict::Gone
        } else if share >= THERE && lasting >= 0.5 * LASTING * both {
            Verdict::Elsewhere
        } else {
            Verdict::Unsure
        }
    }

    /// The median over the textured blocks of how sharp they are now over what they were.
    fn relative_sharpness(&mut self, reference: &Reference) -> f32 {
        self.sharpness.clear();
        for block in reference.blocks.iter().filter(|block| block.is_textured) {
            let now = sharpness(&self.luma, self.edges.width, block.cells);
            self.sharpness.push(now / block.sharpness.max(f32::MIN_POSITIVE));
        }
        let middle = self.sharpness.len() / 2;
        if self.sharpness.is_empty() {
            return 1.0;
        }
        *self.sharpness.select_nth_unstable_by(middle, f32::total_cmp).1
    }
}

/// Whether nothing next to the middle fits better than the middle does.
fn is_peak(around: &[i64; 9]) -> bool {
    around.iter().all(|product| *product <= around[4])
}
