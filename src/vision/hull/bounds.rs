//! How large a hull is, where nobody says.

use super::silhouettes::Hull;
use super::table::{Said, Table};
use super::view::HullError;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::collections::HashSet;

/// Low and high corner of a box, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The corner where all coordinates are the least.
    pub low: DVec3,
    /// And the other one.
    pub high: DVec3,
}

/// Cells along a side of the first cube.
const CELLS: i32 = 16;

/// How often what is left is cut into eight at most, and the most cells that this is done with.
const MAX_LEVELS: u32 = 8;
const MAX_CELLS: usize = 3_000_000;

/// Cells along the longest side of what is left that tell it closely enough, if there are also so many of them: few are left over
/// far from the hull, each of which may hold some of it until it is cut.
const CLOSE: f64 = 64.0;
const MANY_CELLS: usize = 30_000;

/// Smaller than this share of the largest, a piece is chance.
const LEAST_PIECE: f64 = 1e-3;

/// Half the side of the first cube, in distances from its middle to the farthest camera.
const SPARE: f64 = 1.25;

impl Bounds {
    /// A box, if its corners are finite and apart.
    #[must_use]
    pub fn new(low: DVec3, high: DVec3) -> Option<Self> {
        (low.is_finite() && high.is_finite() && (high - low).min_element() > 0.0)
            .then_some(Self { low, high })
    }

    /// Extents, metres.
    #[must_use]
    pub fn size(&self) -> DVec3 {
        self.high - self.low
    }

    /// What holds the hull, but for pieces of less than a thousandth of its largest, where cones cross by chance; and not much more: a
    /// cube that holds all cameras is cut into cells, those that may hold some of the hull into eight, and so on.
    ///
    /// # Errors
    /// Where the silhouettes have nothing in common, or leave it open.
    pub fn of(hull: &Hull) -> Result<Self, HullError> {
        let (centre, half) = first(hull).ok_or(HullError::Empty)?;
        let whole = Self { low: centre - half, high: centre + half };
        let tables: Vec<Table> = hull.views().par_iter().map(Table::of).collect();
        let mut side = 2.0 * half / f64::from(CELLS);
        let all = (0..CELLS).flat_map(|z| (0..CELLS).flat_map(move |y| (0..CELLS).map(move |x| [x, y, z])));
        let middle = |at: [i32; 3], side: f64| whole.low + side * (DVec3::from(at.map(f64::from)) + 0.5);
        let may_hold = |at: &[i32; 3], side: f64| is_left(hull, &tables, middle(*at, side), side);
        let mut left: Vec<[i32; 3]> = all.filter(|at| may_hold(at, side)).collect();
        for _ in 0..MAX_LEVELS {
            let found = Self::around(&left, &whole, side).ok_or(HullError::Empty)?;
            let longest = found.size().max_element();
            let is_close = longest >= CLOSE * side && left.len() >= MANY_CELLS && !found.reaches(&whole);
            if is_close || left.len() > MAX_CELLS / 8 {
                break;
            }
            side /= 2.0;
            let eighths = |at: &[i32; 3]| {
                let [x, y, z] = at.map(|i| 2 * i);
                (0..8).map(move |i| [x + (i & 1), y + (i >> 1 & 1), z + (i >> 2)])
            };
            left = left.par_iter().flat_map_iter(eighths).filter(|at| may_hold(at, side)).collect();
        }
        let found = Self::around(&pieces(left), &whole, side).ok_or(HullError::Empty)?;
        if found.reaches(&whole) { Err(HullError::Unbounded) } else { Ok(found) }
    }

    /// Whether it reaches a side of a box that it is within.
    fn reaches(&self, whole: &Self) -> bool {
        self.low.cmple(whole.low).any() || self.high.cmpge(whole.high).any()
    }

    /// Around cells of that side, with half of one to spare.
    fn around(cells: &[[i32; 3]], whole: &Self, side: f64) -> Option<Self> {
        let first = *cells.first()?;
        let (low, high) = cells
            .iter()
            .fold((first, first), |(low, high), at| (each(low, *at, i32::min), each(high, *at, i32::max)));
        let place = |at: [i32; 3], by: f64| whole.low + side * (DVec3::from(at.map(f64::from)) + by);
        Some(Self { low: place(low, -0.5), high: place(high, 1.5) })
    }
}

/// Cells without those of pieces that are less than [`LEAST_PIECE`] of the largest: cells that touch are of one piece.
fn pieces(cells: Vec<[i32; 3]>) -> Vec<[i32; 3]> {
    let mut open: HashSet<[i32; 3]> = cells.iter().copied().collect();
    let mut found: Vec<Vec<[i32; 3]>> = Vec::new();
    for first in cells {
        if !open.remove(&first) {
            continue;
        }
        let mut piece = vec![first];
        let mut next = 0;
        while let Some([x, y, z]) = piece.get(next).copied() {
            next += 1;
            let around = (0..27).map(|i| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
            piece.extend(around.filter(|at| open.remove(at)));
        }
        found.push(piece);
    }
    let largest = found.iter().map(Vec::len).max().unwrap_or(0);
    found.retain(|piece| piece.len() as f64 >= LEAST_PIECE * largest as f64);
    found.concat()
}

/// The place that is nearest to all rays through the silhouettes' middles, and a cube around it that holds all cameras.
fn first(hull: &Hull) -> Option<(DVec3, f64)> {
    let rays: Vec<_> = hull.views().iter().filter_map(super::view::View::middle).collect();
    let (matrix, right) = rays.iter().fold((DMat3::ZERO, DVec3::ZERO), |(matrix, right), ray| {
        let across = DMat3::IDENTITY - outer(ray.direction);
        (matrix + across, right + across * ray.origin)
    });
    // Parallel rays say nothing of how far along them it is: then nearest to the cameras' common middle.
    let regularised = matrix + DMat3::IDENTITY * (1e-6 * rays.len() as f64);
    let middle = rays.iter().map(|ray| ray.origin).sum::<DVec3>() / rays.len().max(1) as f64;
    let centre = regularised.inverse() * (right + middle * (1e-6 * rays.len() as f64));
    let distance = |view: &super::view::View| view.camera().pose().position_in_world.distance(centre);
    let half = SPARE * hull.views().iter().map(distance).fold(0.0, f64::max);
    (centre.is_finite() && half.is_finite() && half > 0.0).then_some((centre, half))
}

fn outer(of: DVec3) -> DMat3 {
    DMat3::from_cols(of * of.x, of * of.y, of * of.z)
}

/// Whether a cell may hold some of the hull: the circle around its picture has a pixel of the silhouette in it, so that nothing thin
/// is lost.
fn is_left(hull: &Hull, tables: &[Table], middle: DVec3, side: f64) -> bool {
    let radius = side * 3.0_f64.sqrt() / 2.0;
    let mut n_seen = 0;
    for (view, table) in hull.views().iter().zip(tables) {
        match table.said(view, middle, radius) {
            Said::Inside | Said::Mixed => n_seen += 1,
            Said::Outside => return false,
            // What lies beside the picture stays, and is not seen.
            Said::Unseen | Said::Beside => {}
        }
    }
    n_seen >= hull.least_seen()
}

fn each(a: [i32; 3], b: [i32; 3], of: fn(i32, i32) -> i32) -> [i32; 3] {
    [of(a[0], b[0]), of(a[1], b[1]), of(a[2], b[2])]
}
