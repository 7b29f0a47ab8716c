//! The place as it should look: its luma and edges, learned slowly from the background picture.
//!
//! Looks at the background flow in while all is well; edges, whole and by blocks, flow out. Knows nothing of what is
//! compared with them.

use super::edges::{Cells, Edges, FULL, halve};
use super::look::{Grid, STEPS};
use super::verdict::Verdict;

/// Blocks in a row and in a column: enough that who walks by or parks spoils only a few.
const BLOCKS: (usize, usize) = (8, 6);

/// Edges weaker than this share of a full one may be noise: they are no part of the place.
const LEAST_EDGE: f32 = 0.3;

/// Share of a block's cells that full edges would cover at least if it is to tell anything.
const TEXTURED_SHARE: f64 = 0.03;

/// Fewest such blocks by which a place is known again.
pub(super) const MIN_TEXTURED: usize = 6;

/// Seconds of learning before the place is known.
const LEARN_SECS: f64 = 10.0;

/// Levels by which the background may differ from what is seen where it teaches anything: who stands there is in the
/// one, and the ghost of who stood there in the other.
const TEACHING_LEVELS: f32 = 10.0;

/// Seconds in a row for which a learned place must be seen before its loss is believed ...
const CONFIRM_SECS: f64 = 10.0;

/// ... and those after which a place that was never seen so is learned again: what it was learned from has gone.
const REFUTE_SECS: f64 = 5.0;

/// Seconds in which the past fades to 1/e.
pub(super) const TAU_SECS: f64 = 60.0;

/// The same after the light was switched: soon the new light is the place's.
pub(super) const LIGHT_TAU_SECS: f64 = 10.0;

/// One part of the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    pub(super) cells: Cells,
    /// Sum of the squares of its edges.
    pub(super) energy: i64,
    /// Whether it has edges enough to be found again.
    pub(super) is_textured: bool,
    /// Squared gradients over the variance of luma: how sharp it is, whatever the contrast.
    pub(super) sharpness: f32,
}

/// What is known of the place.
#[derive(Debug)]
pub(super) struct Reference {
    /// Levels.
    pub(super) luma: Vec<f32>,
    pub(super) edges: Edges,
    /// At half the width and height.
    pub(super) half: Edges,
    /// Sums of the squares of `half` over all cells above and to the left: `(width + 1) * (height + 1)`.
    pub(super) half_energy: Vec<i64>,
    pub(super) blocks: Vec<Block>,
    pub(super) n_textured: usize,
    half_luma: Vec<f32>,
    learned_secs: f64,
    /// Seconds in a row of the place seen since it was learned, and of the place not seen.
    seen_secs: f64,
    unseen_secs: f64,
    n_learned: u32,
}

impl Reference {
    pub(super) fn new(grid: Grid) -> Self {
        let half = (grid.width / 2, grid.height / 2);
        let places = (0..BLOCKS.1).flat_map(|row| (0..BLOCKS.0).map(move |column| (column, row)));
        let blocks = places.map(|(column, row)| {
            let cells = Cells {
                left: column * grid.width / BLOCKS.0,
                top: row * grid.height / BLOCKS.1,
                right: (column + 1) * grid.width / BLOCKS.0,
                bottom: (row + 1) * grid.height / BLOCKS.1,
            };
            Block { cells, energy: 0, is_textured: false, sharpness: 0.0 }
        });
        Self {
            luma: vec![0.0; grid.n_cells()],
            edges: Edges::new(grid.width, grid.height),
            half: Edges::new(half.0, half.1),
            half_energy: vec![0; (half.0 + 1) * (half.1 + 1)],
            blocks: blocks.collect(),
            n_textured: 0,
            half_luma: vec![0.0; half.0 * half.1],
            learned_secs: 0.0,
            seen_secs: 0.0,
            unseen_secs: 0.0,
            n_learned: 0,
        }
    }

    /// Forgets the place: another is learned in its stead.
    pub(super) fn forget(&mut self) {
        (self.learned_secs, self.seen_secs, self.unseen_secs) = (0.0, 0.0, 0.0);
        (self.n_learned, self.n_textured) = (0, 0);
    }

    /// Whether the place has been seen for long enough, after it was learned, to believe that it is one.
    pub(super) fn is_confirmed(&self) -> bool {
        self.seen_secs >= CONFIRM_SECS
    }

    /// Takes `secs` in which the place was seen or not, until it is confirmed or forgotten.
    pub(super) fn confirm(&mut self, verdict: Verdict, secs: f64) {
        if self.is_confirmed() {
            return;
        }
        if verdict == Verdict::Sound {
            (self.seen_secs, self.unseen_secs) = (self.seen_secs + secs, 0.0);
        } else {
            (self.seen_secs, self.unseen_secs) = (0.0, self.unseen_secs + secs);
        }
        if self.unseen_secs >= REFUTE_SECS {
            self.forget();
        }
    }

    /// Whether the place has been seen for long enough.
    pub(super) fn is_learned(&self) -> bool {
        self.learned_secs >= LEARN_SECS
    }

    /// Whether the place is known and has edges by which to know it again.
    pub(super) fn is_judge(&self) -> bool {
        self.is_learned() && self.n_textured >= MIN_TEXTURED
    }

    /// Takes a look at the background that stands for `step_secs`, where it is what is `seen` (in levels) too; the past
    /// fades to 1/e in `tau_secs`.
    pub(super) fn learn(&mut self, background: &[u16], seen: &[f32], step_secs: f64, tau_secs: f64) {
        self.n_learned = self.n_learned.saturating_add(1);
        self.learned_secs = (self.learned_secs + step_secs).min(LEARN_SECS);
        let rate = -(-step_secs / tau_secs).exp_m1();
        let rate = rate.max(1.0 / f64::from(self.n_learned)) as f32;
        let most_levels = if self.n_learned == 1 { f32::INFINITY } else { TEACHING_LEVELS };
        for ((luma, background), seen) in self.luma.iter_mut().zip(background).zip(seen) {
            let background = f32::from(*background) / STEPS;
            let is_teaching = (background - seen).abs() <= most_levels;
            *luma += if is_teaching { rate * (background - *luma) } else { 0.0 };
        }
        self.edges.compute(&self.luma);
        self.edges.drop_weak(LEAST_EDGE);
        halve(&self.luma, self.edges.width, &mut self.half_luma);
        self.half.compute(&self.half_luma);
        self.half.drop_weak(LEAST_EDGE);
        self.sum_half();
        self.n_textured = 0;
        for block in &mut self.blocks {
            let cells = block.cells;
            let n_cells = (cells.right - cells.left) * (cells.bottom - cells.top);
            block.energy = self.edges.product(cells, &self.edges, [0, 0]);
            let full_cells = block.energy as f64 / f64::from(FULL * FULL);
            block.is_textured = full_cells >= TEXTURED_SHARE * n_cells as f64;
            block.sharpness = sharpness(&self.luma, self.edges.width, cells);
            self.n_textured += usize::from(block.is_textured);
        }
    }

    /// Share of the cells that are darker or lighter than the place by more than `levels`.
    pub(super) fn changed_share(&self, luma: &[f32], levels: f32) -> f64 {
        let n_changed = self.luma.iter().zip(luma).filter(|(a, b)| (*a - *b).abs() > levels).count();
        n_changed as f64 / self.luma.len() as f64
    }

    fn sum_half(&mut self) {
        let stride = self.half.width + 1;
        for y in 0..self.half.height {
            let mut row = 0;
            for x in 0..self.half.width {
                let at = y * self.half.width + x;
                let (edge_x, edge_y) = (i64::from(self.half.x[at]), i64::from(self.half.y[at]));
                row += edge_x * edge_x + edge_y * edge_y;
                self.half_energy[(y + 1) * stride + x + 1] = row + self.half_energy[y * stride + x + 1];
            }
        }
    }

    /// Sum of the squares of the half-size edges in `cells`.
    pub(super) fn half_energy_in(&self, cells: Cells) -> i64 {
        let stride = self.half.width + 1;
        let at = |x: usize, y: usize| self.half_energy[y * stride + x];
        at(cells.right, cells.bottom) + at(cells.left, cells.top)
            - at(cells.left, cells.bottom)
            - at(cells.right, cells.top)
    }
}

/// Squared differences of neighbours over the variance of luma: falls as a picture loses focus, while gain and offset
/// leave it as it is.
pub(super) fn sharpness(luma: &[f32], width: usize, cells: Cells) -> f32 {
    let (mut sum, mut squares, mut differences) = (0.0_f32, 0.0_f32, 0.0_f32);
    let mean = luma[cells.top * width + cells.left];
    for y in cells.top..cells.bottom {
        let row = &luma[y * width + cells.left..y * width + cells.right];
        for value in row {
            let value = value - mean;
            sum += value;
            squares += value * value;
        }
        for (a, b) in row.iter().zip(&row[1..]) {
            differences += (a - b) * (a - b);
        }
        if y > cells.top {
            let above = &luma[(y - 1) * width + cells.left..(y - 1) * width + cells.right];
            for (a, b) in row.iter().zip(above) {
                differences += (a - b) * (a - b);
            }
        }
    }
    let n_cells = ((cells.right - cells.left) * (cells.bottom - cells.top)) as f32;
    let variance = squares - sum * sum / n_cells;
    // A hundredth of a level squared a cell, so that a flat block divides by something.
    differences / (variance + 0.01 * n_cells)
}
