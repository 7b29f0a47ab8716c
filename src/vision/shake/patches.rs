//! Corners of a place, where they are found in a frame, and the shift that most of them agree on.

use super::{GREATEST_PX, Shift};
use crate::frame::Plane;
use fearless_simd::{Level, Simd, dispatch};

/// Most cells of the picture, in each of which one corner is chosen, and their least side in pixels: corners that share pixels are no
/// two votes.
const MOST_COLUMNS: usize = 9;
const MOST_ROWS: usize = 7;
const LEAST_CELL_PX: usize = 24;

/// Pictures with fewer cells have too few votes.
const LEAST_CELLS: usize = 12;

/// Sides of a corner's surroundings, pixels; half of that where pictures are halved.
const SIDE_PX: usize = 16;
const HALF_SIDE: usize = SIDE_PX / 2;

/// Shifts that are tried in halved pictures, each way.
const REACH: usize = GREATEST_PX as usize / 2;
const WINDOW: usize = HALF_SIDE + 2 * REACH;

/// Shifts along a row that are tried at once: those up to twice the reach, and more that are left out, for whole vectors.
const LANES: usize = (2 * REACH + 1).next_multiple_of(16);

/// Columns of the window with those that only vectors read.
const PADDED: usize = HALF_SIDE + LANES;

/// Most corners that vote: the strongest.
const MOST_CORNERS: usize = 63;

/// Least strength of a corner: the smaller eigenvalue of its gradients' mean products, codes squared.
const LEAST_STRENGTH: f32 = 12.0;

/// Shifts that differ by no more than this agree, pixels.
const AGREEING_PX: i32 = 1;

/// Least number of corners that must agree, and least share of them.
const LEAST_AGREEING: usize = 6;
const LEAST_SHARE: f64 = 0.25;

/// Those who agree must lie as far apart as this share of the picture's columns and of its rows: a lorry's corners agree too.
const LEAST_SPREAD: f64 = 0.5;

/// There is no shift where as many as this share of those who agree on one see none: a lorry that fills the picture agrees too.
const UNSHIFTED_SHARE: f64 = 0.5;

/// Share of its difference that may be left once a frame is shifted back.
const GREATEST_LEFT: f64 = 0.85;

/// One corner's surroundings.
#[derive(Clone, Debug)]
struct Patch {
    strength: f32,
    /// First column and row, even.
    x: usize,
    y: usize,
    full: [[u8; SIDE_PX]; SIDE_PX],
    half: [[u8; HALF_SIDE]; HALF_SIDE],
}

/// The corners of a place.
#[derive(Clone, Debug)]
pub(super) struct Patches {
    level: Level,
    patches: Vec<Patch>,
    votes: Vec<(Shift, f64, f64)>,
}

impl Default for Patches {
    fn default() -> Self {
        Self { level: Level::new(), patches: Vec::new(), votes: Vec::new() }
    }
}

/// The mean of 2 x 2 pixels; the last column and row go on beyond the border.
fn halved(plane: &Plane<'_>, x: isize, y: isize) -> u8 {
    let (right, bottom) = (plane.width as isize - 1, plane.height as isize - 1);
    let at = |x: isize, y: isize| u16::from(plane.row(y.clamp(0, bottom) as u32)[x.clamp(0, right) as usize]);
    let (x, y) = (2 * x, 2 * y);
    ((at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1) + 2) / 4) as u8
}

/// Fills a row with means of 2 x 2 pixels from a place of the halved picture on.
#[inline(always)]
fn fill_halved(plane: &Plane<'_>, (x, y): (isize, isize), out: &mut [u8]) {
    let (width, height) = (plane.width as isize, plane.height as isize);
    let is_inside = x >= 0 && y >= 0 && 2 * (x + out.len() as isize) <= width && 2 * y + 1 < height;
    if !is_inside {
        for (column, code) in out.iter_mut().enumerate() {
            *code = halved(plane, x + column as isize, y);
        }
        return;
    }
    let place = 2 * x as usize..2 * (x as usize + out.len());
    let [upper, lower] = [2 * y, 2 * y + 1].map(|y| &plane.row(y as u32)[place.clone()]);
    for ((code, upper), lower) in out.iter_mut().zip(upper.chunks_exact(2)).zip(lower.chunks_exact(2)) {
        let sum = [upper[0], upper[1], lower[0], lower[1]].map(u16::from).iter().sum::<u16>();
        *code = ((sum + 2) / 4) as u8;
    }
}

impl Patches {
    /// Chooses the strongest corner of each cell of a picture, where it has any.
    pub(super) fn choose(&mut self, plane: Plane<'_>) {
        self.patches.clear();
        let (width, height) = (plane.width as usize, plane.height as usize);
        let (columns, rows) =
            ((width / LEAST_CELL_PX).min(MOST_COLUMNS), (height / LEAST_CELL_PX).min(MOST_ROWS));
        if columns * rows < LEAST_CELLS || width.min(height) < 2 * SIDE_PX {
            return;
        }
        for cell in 0..columns * rows {
            let (column, row) = (cell % columns, cell / columns);
            let within = |idx: usize, of: usize, length: usize| {
                let (first, end) = (length * idx / of, length * (idx + 1) / of);
                first.max(SIDE_PX / 2)..end.min(length - SIDE_PX - SIDE_PX / 2)
            };
            let lines = within(row, rows, height).step_by(6);
            let places =
                lines.flat_map(|y| within(column, columns, width).step_by(6).map(move |x| (x & !1, y & !1)));
            let strengths = places.map(|at| (at, strength(&plane, at)));
            let best = strengths.max_by(|a, b| a.1.total_cmp(&b.1));
            let best = best.filter(|(_, strength)| *strength > LEAST_STRENGTH);
            let Some(((x, y), strength)) = best else { continue };
            let full = std::array::from_fn(|row| {
                let mut codes = [0; SIDE_PX];
                codes.copy_from_slice(&plane.row((y + row) as u32)[x..x + SIDE_PX]);
                codes
            });
            let half = std::array::from_fn(|row| {
                std::array::from_fn(|column| {
                    halved(&plane, (x / 2 + column) as isize, (y / 2 + row) as isize)
                })
            });
            self.patches.push(Patch { strength, x, y, full, half });
        }
        self.patches.sort_by(|a, b| b.strength.total_cmp(&a.strength));
        self.patches.truncate(MOST_CORNERS);
    }

    /// Returns the shift that most corners agree on; none where too few do, or where it leaves the difference as large as it is.
    pub(super) fn shift(&mut self, plane: Plane<'_>) -> Option<Shift> {
        self.votes.clear();
        let level = self.level;
        for patch in &self.patches {
            self.votes.push(dispatch!(level, simd => patch.vote(simd, &plane)));
        }
        let agrees =
            |a: Shift, b: Shift| (a.x - b.x).abs() <= AGREEING_PX && (a.y - b.y).abs() <= AGREEING_PX;
        let count = |of: Shift| self.votes.iter().filter(|(vote, ..)| agrees(of, *vote)).count();
        let (most, n_agreeing) =
            self.votes.iter().map(|(vote, ..)| (*vote, count(*vote))).max_by_key(|(_, n)| *n)?;
        let is_far = most.x.abs() > 2 * AGREEING_PX || most.y.abs() > 2 * AGREEING_PX;
        if is_far && count(Shift::default()) as f64 >= UNSHIFTED_SHARE * n_agreeing as f64 {
            return Some(Shift::default());
        }
        if n_agreeing < LEAST_AGREEING || (n_agreeing as f64) < LEAST_SHARE * self.votes.len() as f64 {
            return None;
        }
        let agreeing = || self.votes.iter().filter(|(vote, ..)| agrees(most, *vote));
        let voters = self.patches.iter().zip(&self.votes).filter(|(_, (vote, ..))| agrees(most, *vote));
        let mut corners = [(usize::MAX, 0); 2];
        for (patch, _) in voters {
            for (range, at) in corners.iter_mut().zip([patch.x, patch.y]) {
                *range = (range.0.min(at), range.1.max(at));
            }
        }
        let is_spread = corners
            .iter()
            .zip([plane.width, plane.height])
            .all(|((first, last), length)| (last - first) as f64 >= LEAST_SPREAD * f64::from(length));
        if !is_spread {
            return None;
        }
        let mean = |of: fn(&Shift) -> i32| {
            let sum: i32 = agreeing().map(|(vote, ..)| of(vote)).sum();
            (f64::from(sum) / n_agreeing as f64).round() as i32
        };
        let shift = Shift { x: mean(|of| of.x), y: mean(|of| of.y) };
        let left: f64 = agreeing().map(|(_, left, _)| left).sum();
        let unshifted: f64 = agreeing().map(|(_, _, unshifted)| unshifted).sum();
        (shift.is_none() || left < GREATEST_LEFT * unshifted).then_some(shift)
    }
}

/// Returns the smaller eigenvalue of the mean products of gradients around a place.
fn strength(plane: &Plane<'_>, (x, y): (usize, usize)) -> f32 {
    let (mut xx, mut yy, mut xy) = (0_i32, 0_i32, 0_i32);
    let mut n = 0;
    for row in (y + 1..y + SIDE_PX - 1).step_by(2) {
        let rows = [row - 1, row, row + 1].map(|row| plane.row(row as u32));
        for column in (x + 1..x + SIDE_PX - 1).step_by(2) {
            let across = i32::from(rows[1][column + 1]) - i32::from(rows[1][column - 1]);
            let down = i32::from(rows[2][column]) - i32::from(rows[0][column]);
            xx += across * across;
            yy += down * down;
            xy += across * down;
            n += 1;
        }
    }
    let [xx, yy, xy] = [xx, yy, xy].map(|sum| sum as f32 / n as f32);
    let middle = 0.5 * (xx + yy);
    middle - (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt()
}

impl Patch {
    /// Returns where the corner is found, and its mean difference there and where it belongs.
    #[inline(always)]
    fn vote<S: Simd>(&self, _simd: S, plane: &Plane<'_>) -> (Shift, f64, f64) {
        let mut window = [[0_u8; PADDED]; WINDOW];
        let (left, top) = (self.x as isize / 2 - REACH as isize, self.y as isize / 2 - REACH as isize);
        for (row, codes) in window.iter_mut().enumerate() {
            fill_halved(plane, (left, top + row as isize), &mut codes[..WINDOW]);
        }
        let mut best = (u16::MAX, (0, 0));
        for y in 0..=2 * REACH {
            let sums = self.sums(&window[y..y + HALF_SIDE]);
            for (x, sum) in sums[..=2 * REACH].iter().enumerate() {
                best = best.min((*sum, (x, y)));
            }
        }
        let (_, (x, y)) = best;
        let coarse = (2 * (x as i32 - REACH as i32), 2 * (y as i32 - REACH as i32));
        let mut found = (u32::MAX, Shift::default());
        for dy in -1..=1 {
            for dx in -1..=1 {
                let shift = Shift { x: coarse.0 + dx, y: coarse.1 + dy };
                let sum = self.difference(plane, shift);
                if sum < found.0 {
                    found = (sum, shift);
                }
            }
        }
        (found.1, f64::from(found.0), f64::from(self.difference(plane, Shift::default())))
    }

    /// Returns the sums of absolute differences of the halved corner to so many rows of a window, from each column on.
    #[inline(always)]
    fn sums(&self, rows: &[[u8; PADDED]]) -> [u16; LANES] {
        // 64 differences of at most 255 fit.
        let mut sums = [0_u16; LANES];
        for (codes, seen) in self.half.iter().zip(rows) {
            for (column, code) in codes.iter().enumerate() {
                let seen = &seen[column..column + LANES];
                for i in 0..LANES {
                    sums[i] += u16::from(seen[i].abs_diff(*code));
                }
            }
        }
        sums
    }

    /// Returns the sum of absolute differences to a frame, where the corner is looked for at a shift.
    #[inline(always)]
    fn difference(&self, plane: &Plane<'_>, shift: Shift) -> u32 {
        let (right, bottom) = (plane.width as i32 - 1, plane.height as i32 - 1);
        let mut sum = 0;
        for (row, codes) in self.full.iter().enumerate() {
            let seen = plane.row((self.y as i32 + row as i32 + shift.y).clamp(0, bottom) as u32);
            let first = self.x as i32 + shift.x;
            if first >= 0 && first + SIDE_PX as i32 <= plane.width as i32 {
                let seen = &seen[first as usize..first as usize + SIDE_PX];
                sum += codes.iter().zip(seen).map(|(a, b)| u32::from(a.abs_diff(*b))).sum::<u32>();
            } else {
                for (column, code) in codes.iter().enumerate() {
                    let at = (first + column as i32).clamp(0, right) as usize;
                    sum += u32::from(code.abs_diff(seen[at]));
                }
            }
        }
        sum
    }
}
