//! Pictures of few cells: a luma plane as box means, and the mean of the last few.
//!
//! A plane flows in, cells flow out. Knows nothing of edges.

use crate::frame::Plane;

/// Cells of a look, about: 160 x 90.
const N_CELLS: f64 = 14_400.0;

/// Fewest cells along a side of which anything can be told.
const MIN_SIDE: usize = 32;

/// Looks that are held: their mean loses who walks by, noise and shake.
pub(super) const N_LOOKS: usize = 4;

/// Cells are kept in sixteenths of a level.
pub(super) const STEPS: f32 = 16.0;

/// How planes are cut into square cells. What is left over at the right and lower edge belongs to no cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    /// Cells in a row.
    pub(super) width: usize,
    /// Cells in a column.
    pub(super) height: usize,
    /// Side of a cell in the frame, pixels.
    pub(super) frame_cell_px: usize,
    /// Side of a cell in the background, pixels: less, if the background is of a reduced size.
    pub(super) background_cell_px: usize,
}

impl Grid {
    /// A grid for frames and backgrounds of these sizes; none where the picture is too small or the two cannot be of
    /// one picture.
    pub(super) fn new(frame: (u32, u32), background: (u32, u32)) -> Option<Self> {
        let ratio = (f64::from(frame.0) / f64::from(background.0)).round() as u32;
        if ratio == 0 || background != (frame.0.div_ceil(ratio), frame.1.div_ceil(ratio)) {
            return None;
        }
        let area = f64::from(background.0) * f64::from(background.1);
        let background_cell_px = ((area / N_CELLS).sqrt().round() as usize).max(1);
        let frame_cell_px = background_cell_px * ratio as usize;
        let width = (background.0 as usize / background_cell_px).min(frame.0 as usize / frame_cell_px);
        let height = (background.1 as usize / background_cell_px).min(frame.1 as usize / frame_cell_px);
        let is_enough = width >= MIN_SIDE && height >= MIN_SIDE;
        is_enough.then_some(Self { width, height, frame_cell_px, background_cell_px })
    }

    pub(super) const fn n_cells(&self) -> usize {
        self.width * self.height
    }
}

/// The last looks at the frames, and scratch.
#[derive(Debug)]
pub(super) struct Looks {
    grid: Grid,
    /// [`N_LOOKS`] pictures, each row-major, in steps.
    ring: Vec<u16>,
    /// Looks taken since the start.
    n_taken: usize,
    /// Sums along the columns of one row of cells.
    sums: Vec<u16>,
}

impl Looks {
    pub(super) fn new(grid: Grid) -> Self {
        let side_px = grid.frame_cell_px.max(grid.background_cell_px);
        let sums = vec![0; grid.width * side_px];
        Self { grid, ring: vec![0; N_LOOKS * grid.n_cells()], n_taken: 0, sums }
    }

    /// Takes a look at a frame, which replaces the oldest.
    pub(super) fn take(&mut self, luma: Plane<'_>) {
        let n_cells = self.grid.n_cells();
        let start = (self.n_taken % N_LOOKS) * n_cells;
        let out = &mut self.ring[start..start + n_cells];
        means(luma, self.grid.frame_cell_px, self.grid.width, &mut self.sums, out);
        if self.n_taken == 0 {
            // Until there are others, the first stands for all.
            let (first, others) = self.ring.split_at_mut(n_cells);
            others.chunks_exact_mut(n_cells).for_each(|other| other.copy_from_slice(first));
        }
        self.n_taken += 1;
    }

    /// Looks at a background.
    pub(super) fn background(&mut self, luma: Plane<'_>, out: &mut [u16]) {
        means(luma, self.grid.background_cell_px, self.grid.width, &mut self.sums, out);
    }

    /// Whether every look that is held has been taken.
    pub(super) const fn is_full(&self) -> bool {
        self.n_taken >= N_LOOKS
    }

    /// The mean of every `step`th look from `first` on, in levels.
    pub(super) fn mean(&self, first: usize, step: usize, out: &mut [f32]) {
        out.fill(0.0);
        let looks = self.ring.chunks_exact(self.grid.n_cells()).skip(first).step_by(step);
        let gain = 1.0 / (STEPS * looks.len() as f32);
        for look in looks {
            for (out, cell) in out.iter_mut().zip(look) {
                *out += gain * f32::from(*cell);
            }
        }
    }
}

/// Box means of `cell_px` x `cell_px` pixels, in steps.
fn means(luma: Plane<'_>, cell_px: usize, width: usize, sums: &mut [u16], out: &mut [u16]) {
    let sums = &mut sums[..width * cell_px];
    let gain = STEPS / (cell_px * cell_px) as f32;
    for (y, out) in out.chunks_exact_mut(width).enumerate() {
        sums.fill(0);
        // 257 rows of 255 fit 16 bits; what is larger than 30 thousand pixels loses the rows beyond.
        for row in (y * cell_px..(y + 1) * cell_px).take(257) {
            for (sum, value) in sums.iter_mut().zip(luma.row(row as u32)) {
                *sum += u16::from(*value);
            }
        }
        for (out, sums) in out.iter_mut().zip(sums.chunks_exact(cell_px)) {
            let sum: u32 = sums.iter().map(|sum| u32::from(*sum)).sum();
            *out = (sum as f32 * gain + 0.5) as u16;
        }
    }
}
