//! Where the edges of the place stand in a look: the displacement at which most of them are found.
//!
//! Edges of the place and of a look flow in; a displacement and how well it fits flow out. Coarse to fine: every
//! displacement at half the size, those around the best at the full one, and a parabola through the best and its
//! neighbours.

use super::edges::{Edges, halve};
use super::reference::Reference;

/// Greatest displacement that is looked for, share of the picture's width ...
const REACH_OF_WIDTH: f64 = 0.2;

/// ... and of its height.
const REACH_OF_HEIGHT: f64 = 0.4;

/// A displacement leaves a part of the place beyond the picture. So many more of the place's edges count as looked
/// for and not found, or a few of them at a corner could fit better than all of them nearly do.
const PENALTY: f64 = 0.1;

/// Displacements around the best of the half-size search that are tried, cells each way.
const FINE_REACH: i32 = 2;

/// How the place's edges fit a look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    /// Cells to the right and down, whole.
    pub(super) shift: [i32; 2],
    /// Share of the edges within the picture that were found, about: noise and passers-by add to both sides of 0.
    pub(super) found: f64,
    /// Share of the textured blocks of which the better part was found.
    pub(super) intact_share: f64,
    /// Textured blocks that could be judged: those within the picture for the greater part.
    pub(super) n_judged: usize,
}

/// Edges found of a block, as a share, for the block to be intact.
const INTACT: f64 = 0.5;

impl Fit {
    /// Compares at one displacement.
    pub(super) fn at(reference: &Reference, look: &Edges, shift: [i32; 2]) -> Self {
        let (width, height) = (look.width, look.height);
        let (mut product, mut energy, mut n_judged, mut n_intact) = (0, 0, 0, 0);
        for block in reference.blocks.iter().filter(|block| block.is_textured) {
            let cells = block.cells.displaced_within(shift, width, height);
            let here = reference.edges.product(cells, look, shift);
            let whole = if cells == block.cells {
                block.energy
            } else {
                reference.edges.product(cells, &reference.edges, [0, 0])
            };
            product += here;
            energy += whole;
            if 2 * whole >= block.energy {
                n_judged += 1;
                n_intact += usize::from(here as f64 >= INTACT * whole as f64);
            }
        }
        Self {
            shift,
            found: product as f64 / (energy as f64).max(1.0),
            intact_share: f64::from(n_intact as u32) / f64::from(n_judged.max(1) as u32),
            n_judged,
        }
    }
}

/// Products of the place's edges with a look's at the nine displacements around `shift`, row by row from the top.
pub(super) fn around(reference: &Reference, look: &Edges, shift: [i32; 2]) -> [i64; 9] {
    let mut products = [0; 9];
    for (product, by) in products.iter_mut().zip((-1..=1).flat_map(|y| (-1..=1).map(move |x| [x, y]))) {
        let shift = [shift[0] + by[0], shift[1] + by[1]];
        let cells = look.cells().displaced_within(shift, look.width, look.height);
        *product = reference.edges.product(cells, look, shift);
    }
    products
}

/// The displacement below whole cells, by parabolas through the middle of [`around`] and its neighbours: -1/2 to 1/2
/// each way.
pub(super) fn below_whole_cells(around: &[i64; 9]) -> [f64; 2] {
    let vertex = |before: i64, at: i64, after: i64| {
        let curvature = (2 * at - before - after) as f64;
        if curvature > 0.0 { (0.5 * (after - before) as f64 / curvature).clamp(-0.5, 0.5) } else { 0.0 }
    };
    [vertex(around[3], around[4], around[5]), vertex(around[1], around[4], around[7])]
}

/// Scratch of the search.
#[derive(Debug)]
pub(super) struct Search {
    half_luma: Vec<f32>,
    half: Edges,
}

impl Search {
    pub(super) fn new(width: usize, height: usize) -> Self {
        let (width, height) = (width / 2, height / 2);
        Self { half_luma: vec![0.0; width * height], half: Edges::new(width, height) }
    }

    /// The displacement at which most of the place's edges are found in a look (`luma` and its `edges`).
    ///
    /// **Cost** some millions of products: not for every frame.
    pub(super) fn best(&mut self, reference: &Reference, luma: &[f32], edges: &Edges) -> [i32; 2] {
        halve(luma, edges.width, &mut self.half_luma);
        self.half.compute(&self.half_luma);
        let (width, height) = (self.half.width, self.half.height);
        let reach_x = (REACH_OF_WIDTH * width as f64).ceil() as i32;
        let reach_y = reach_x.min((REACH_OF_HEIGHT * height as f64).ceil() as i32);
        let half = &self.half;
        let all = half.cells();
        let least = PENALTY * reference.half_energy_in(all) as f64;
        let coarse = |shift: [i32; 2]| {
            let cells = all.displaced_within(shift, width, height);
            let energy = reference.half_energy_in(cells) as f64;
            reference.half.product(cells, half, shift) as f64 / (energy + least).max(1.0)
        };
        let shift = best_of([0, 0], [reach_x, reach_y], coarse);
        let fine = |shift: [i32; 2]| {
            let cells = edges.cells().displaced_within(shift, edges.width, edges.height);
            reference.edges.product(cells, edges, shift) as f64
        };
        best_of([2 * shift[0], 2 * shift[1]], [FINE_REACH, FINE_REACH], fine)
    }
}

/// The displacement of greatest score, at most `reach` from `middle`; of equals the first, `middle` before all.
fn best_of(middle: [i32; 2], reach: [i32; 2], score: impl Fn([i32; 2]) -> f64) -> [i32; 2] {
    let (mut best, mut best_score) = (middle, score(middle));
    for y in middle[1] - reach[1]..=middle[1] + reach[1] {
        for x in middle[0] - reach[0]..=middle[0] + reach[0] {
            let found = score([x, y]);
            if found > best_score {
                (best, best_score) = ([x, y], found);
            }
        }
    }
    best
}
