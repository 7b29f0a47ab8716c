//! How large a hull is, where nobody says.

use super::silhouettes::Hull;
use super::view::HullError;
use crate::geometry::Projection;
use glam::{DMat3, DVec2, DVec3};
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

    /// What holds the hull, but for pieces of less than a thousandth of its largest, where cones cross by chance; and not much more: a cube that holds all cameras is cut into cells, those that may hold some of
    /// the hull into eight, and so on.
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
        match table.may_hold(view, middle, radius) {
            Some(true) => n_seen += 1,
            Some(false) => return false,
            None => {}
        }
    }
    n_seen >= hull.least_seen()
}

fn each(a: [i32; 3], b: [i32; 3], of: fn(i32, i32) -> i32) -> [i32; 3] {
    [of(a[0], b[0]), of(a[1], b[1]), of(a[2], b[2])]
}

/// How many pixels of a silhouette lie above and to the left of each of its pixels (Crow 1984): how many are in any rectangle follows
/// from four of them.
struct Table {
    width: usize,
    sums: Vec<u32>,
}

impl Table {
    fn of(view: &super::view::View) -> Self {
        let [columns, rows] = view.size_px();
        let width = columns + 1;
        let mut sums = vec![0; width * (rows + 1)];
        for y in 0..rows {
            let mut row = 0;
            for x in 0..columns {
                row += u32::from(view.is_inside_at(x, y));
                sums[(y + 1) * width + x + 1] = sums[y * width + x + 1] + row;
            }
        }
        Self { width, sums }
    }

    /// Whether a ball may hold some of what the camera sees inside; none where the camera surely sees nothing of it.
    fn may_hold(&self, view: &super::view::View, centre: DVec3, radius: f64) -> Option<bool> {
        let local = view.camera().pose().local_from_world_point(centre);
        // Behind the camera, or beside all that its picture shows.
        if local.z + radius <= 0.0 || local.truncate().length() - radius > view.widest() * (local.z + radius)
        {
            return None;
        }
        // What is as near as it is large may be anywhere in the picture.
        if local.z <= 1.5 * radius {
            return Some(true);
        }
        let Some(Projection { texture, depth_m }) = view.camera().project(centre) else { return Some(true) };
        let [width, height] = view.size_px().map(|side| side as f64);
        let (calibrated, focal) = (view.camera().size_px(), view.camera().focal_px());
        let scale = DVec2::new(width / f64::from(calibrated.0), height / f64::from(calibrated.1)) * focal;
        // Off the axis a ball is seen larger.
        let aslant = local.length_squared() / (local.z * local.z);
        let reach = scale * (radius / (depth_m - radius) * aslant) + 1.0;
        let at = texture * DVec2::new(width, height);
        let (low, high) = (at - reach, at + reach);
        let is_beside = low.x < 0.0 || low.y < 0.0 || high.x > width || high.y > height;
        if high.x < 0.0 || high.y < 0.0 || low.x > width || low.y > height {
            return None;
        }
        // Negative numbers are 0 as these.
        let [x0, y0] = [low.x as usize, low.y as usize];
        let [x1, y1] = [(high.x.ceil() as usize).min(self.width - 1), high.y.ceil() as usize];
        let y1 = y1.min(self.sums.len() / self.width - 1);
        let sum = |x: usize, y: usize| i64::from(self.sums[y * self.width + x]);
        match sum(x1, y1) - sum(x0, y1) - sum(x1, y0) + sum(x0, y0) > 0 {
            true => Some(true),
            // What lies beside the picture stays, and is not seen; what lies in it is taken away.
            false if is_beside => None,
            false => Some(false),
        }
    }
}
