//! Hulls of voxels by cubes: one of which all cameras say the same is decided at once, any other is cut into eight. So time follows
//! the hull's surface, not its volume. What comes out are the voxels of `voxels`, to the last one.
//!
//! `[S93]` Szeliski 1993, Rapid octree construction from image sequences, CVGIP: Image Understanding 58(1).

use super::occupancy::Occupancy;
use super::silhouettes::Hull;
use super::table::{Said, Table};
use super::view::HullError;
use glam::DVec3;
use rayon::prelude::*;

/// Voxels along a side of the cubes that are begun with.
const FIRST_SIDE: u32 = 32;

/// Voxels along a side of cubes whose voxels are asked for one by one, as they would be soon.
const LAST_SIDE: u32 = 2;

/// A cube of voxels that are all inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cube {
    at: [u32; 3],
    side: u32,
}

struct Carving<'a> {
    hull: &'a Hull,
    tables: &'a [Table],
    grid: &'a Occupancy,
}

/// What of the views is still to be asked of a cube, by their indices, and how many of the others see it.
struct Open {
    views: Vec<u16>,
    n_seen: usize,
}

/// Carves a grid.
///
/// **Cost** a look at a table a camera and cube that the surface passes through, a projection a camera and voxel at it.
///
/// # Errors
/// Where nothing is left.
pub(super) fn carve(hull: &Hull, grid: &Occupancy) -> Result<Occupancy, HullError> {
    let tables: Vec<Table> = hull.views().par_iter().map(Table::of).collect();
    let carving = Carving { hull, tables: &tables, grid };
    let n_cubes = grid.size().map(|side| side.div_ceil(FIRST_SIDE));
    let first = |i: u32| {
        let [x, y] = [i % n_cubes[0], i / n_cubes[0] % n_cubes[1]];
        [x, y, i / (n_cubes[0] * n_cubes[1])].map(|at| at * FIRST_SIDE)
    };
    let left = |i: u32| {
        // A list a level, of the views that are still to be asked.
        let mut open: Vec<Open> = Vec::new();
        open.push(Open { views: (0..hull.views().len() as u16).collect(), n_seen: 0 });
        let mut cubes = Vec::new();
        carving.cut(Cube { at: first(i), side: FIRST_SIDE }, &mut open, 0, &mut cubes);
        cubes
    };
    let cubes: Vec<Cube> = (0..n_cubes.iter().product()).into_par_iter().flat_map_iter(left).collect();
    let mut carved = Occupancy::new(grid.size(), grid.origin(), grid.step_m()).map_err(HullError::Mesh)?;
    let [_, height, depth] = grid.size();
    for Cube { at: [x, y, z], side } in cubes {
        for z in z..(z + side).min(depth) {
            for y in y..(y + side).min(height) {
                carved.set_run(x..x + side, y, z);
            }
        }
    }
    if carved.n_inside() == 0 { Err(HullError::Empty) } else { Ok(carved) }
}

impl Carving<'_> {
    /// Adds what is inside of a cube; `open[level]` are the views to ask.
    fn cut(&self, cube: Cube, open: &mut Vec<Open>, level: usize, found: &mut Vec<Cube>) {
        let Cube { at, side } = cube;
        if !self.grid.has(at) {
            return;
        }
        if side <= LAST_SIDE {
            return self.ask_each(cube, &open[level], found);
        }
        if open.len() == level + 1 {
            open.push(Open { views: Vec::new(), n_seen: 0 });
        }
        let (above, beneath) = open.split_at_mut(level + 1);
        let (above, beneath) = (&above[level], &mut beneath[0]);
        let half = f64::from(side - 1) / 2.0;
        let centre = self.grid.place(at) + self.grid.step_m() * half;
        let radius_m = self.grid.step_m() * half * 3.0_f64.sqrt();
        beneath.views.clear();
        beneath.n_seen = above.n_seen;
        for idx in &above.views {
            let view = &self.hull.views()[usize::from(*idx)];
            match self.tables[usize::from(*idx)].said(view, centre, radius_m) {
                Said::Outside => return,
                Said::Inside => beneath.n_seen += 1,
                Said::Unseen => {}
                Said::Beside | Said::Mixed => beneath.views.push(*idx),
            }
        }
        if beneath.views.is_empty() {
            if beneath.n_seen >= self.hull.least_seen() {
                found.push(cube);
            }
            return;
        }
        let half = side / 2;
        for i in 0..8 {
            let at = [at[0] + half * (i & 1), at[1] + half * (i >> 1 & 1), at[2] + half * (i >> 2)];
            self.cut(Cube { at, side: half }, open, level + 1, found);
        }
    }

    fn ask_each(&self, Cube { at, side }: Cube, open: &Open, found: &mut Vec<Cube>) {
        for i in 0..side.pow(3) {
            let at = [at[0] + i % side, at[1] + i / side % side, at[2] + i / (side * side)];
            if self.grid.has(at) && self.is_left(self.grid.place(at), open) {
                found.push(Cube { at, side: 1 });
            }
        }
    }

    fn is_left(&self, place: DVec3, open: &Open) -> bool {
        let mut n_seen = open.n_seen;
        for idx in &open.views {
            let view = &self.hull.views()[usize::from(*idx)];
            match view.camera().project(place).and_then(|seen| view.at(seen.texture)) {
                Some(false) => return false,
                Some(true) => n_seen += 1,
                None => {}
            }
        }
        n_seen >= self.hull.least_seen()
    }
}

#[cfg(test)]
mod tests {
    use super::super::view::{View, Window};
    use super::super::voxels;
    use super::*;
    use crate::geometry::{Camera, Distortion, Pose};
    use glam::DVec2;

    /// A ball and a bar, as a camera with that lens has them in a window of its picture.
    fn seen(turn: f64, distortion: Distortion) -> View {
        let eye = DVec3::new(4.0 * turn.cos(), 4.0 * turn.sin(), 1.0 + turn.sin());
        let pose = Pose::looking_at(eye, DVec3::ZERO).expect("a pose");
        let camera = Camera::new((320, 240), DVec2::splat(260.0), DVec2::new(160.0, 120.0), distortion, pose)
            .expect("a camera");
        let (left_top, width, height) = ([40, 20], 250, 200);
        let is_in = |i: usize| {
            let at = DVec2::new((40 + i % width) as f64 + 0.5, (20 + i / width) as f64 + 0.5);
            let Some(ray) = camera.ray(at / DVec2::new(320.0, 240.0)) else { return false };
            let meets = |centre: DVec3, radius: f64| {
                let along = (centre - ray.origin).dot(ray.direction);
                (centre - ray.origin).length_squared() - along * along < radius * radius
            };
            meets(DVec3::ZERO, 0.5) || (0..12).any(|i| meets(DVec3::new(0.0, 0.1 * f64::from(i), 0.4), 0.06))
        };
        let is_inside = (0..width * height).map(is_in).collect();
        View::within(camera, Window { picture_px: [320, 240], left_top, width, is_inside }, 0.0)
            .expect("a view")
    }

    #[test]
    fn cubes_leave_the_voxels_that_runs_leave() {
        let coefficients = [0.25, -0.05, 0.002, -0.001, 0.0, 0.0, 0.0, 0.0];
        let bent = Distortion::BrownConrady { coefficients };
        for (n, distortion, least_seen) in
            [(2, Distortion::None, 0), (5, Distortion::None, 2), (9, bent, 7), (3, bent, 1)]
        {
            let views = (0..n).map(|i| seen(f64::from(i) * 6.2 / f64::from(n), distortion)).collect();
            let hull = Hull::new(views, least_seen).expect("a hull");
            // One that the cameras see but a part of, of which sides are not whole cubes.
            for (size, low, step_m) in [([70, 50, 45], -0.9, 0.03), ([40, 65, 33], -3.0, 0.11)] {
                let grid = Occupancy::new(size, DVec3::splat(low), step_m).expect("a grid");
                let (runs, cubes) = (voxels::carve(&hull, &grid), carve(&hull, &grid));
                let n_inside = runs.as_ref().map_or(0, Occupancy::n_inside);
                assert!(n_inside > 100, "{n}: {n_inside}");
                assert!(runs == cubes, "{n} cameras, {size:?}");
            }
        }
    }
}
