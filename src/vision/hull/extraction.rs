//! The surface of a hull on a grid, by the method that is asked for.

use super::bounds::Bounds;
use super::net::{Crossings, Halfway, surface};
use super::occupancy::Occupancy;
use super::octree;
use super::silhouettes::{Hull, Scratch};
use super::view::HullError;
use crate::error::one_of;
use crate::geometry::Ray;
use crate::mesh::{Mesh, MeshError};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Places along the longest side of the bounds.
pub const RESOLUTION: RangeInclusive<u32> = 8..=1024;

/// How a hull's surface is found. Methods that only draw a hull have no surface to give.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Every line of the grid is cut by the outlines: the surface lies where they say, to the texel.
    #[default]
    ImageBased,
    /// Voxels whose middles all cameras see inside: the surface lies half-way between two of them.
    Voxels,
}

impl Method {
    /// All there are.
    pub const ALL: [Self; 2] = [Self::ImageBased, Self::Voxels];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ImageBased => "image-based",
            Self::Voxels => "voxels",
        }
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        one_of("method that gives a surface", text, &Self::ALL, Self::name)
    }
}

/// The surface of a hull within `bounds`, on a grid of `resolution` places along their longest side.
///
/// **Cost** of image-based extraction three rays for every two places of the grid's sides, each logarithmic in the outlines'
/// corners; of voxels as [`super::Shell::carve`].
///
/// # Errors
/// Where there is nothing within the bounds, or the resolution is out of range.
pub fn extract(hull: &Hull, bounds: &Bounds, (method, resolution): (Method, u32)) -> Result<Mesh, HullError> {
    if !RESOLUTION.contains(&resolution) {
        let (least, most) = (*RESOLUTION.start(), *RESOLUTION.end());
        return Err(HullError::Resolution { n: resolution, least, most });
    }
    let step_m = bounds.size().max_element() / f64::from(resolution - 1);
    // As many as fit, in the middle of the bounds.
    let size = bounds.size().to_array().map(|side| (side / step_m + 1e-9).floor() as u32 + 1);
    let extent = DVec3::from(size.map(|n| f64::from(n - 1))) * step_m;
    let origin = bounds.low + (bounds.size() - extent) / 2.0;
    let grid = Occupancy::new(size, origin, step_m).map_err(HullError::Mesh)?;
    let mesh = match method {
        Method::ImageBased => {
            let lines = [0, 1, 2].map(|axis| Lines::cut(hull, &grid, axis));
            let mut occupancy = grid;
            lines[2].fill(&mut occupancy);
            surface(&mut occupancy, &lines)
        }
        Method::Voxels => surface(&mut octree::carve(hull, &grid)?, &Halfway),
    };
    mesh.map_err(|error| match error {
        MeshError::Empty => HullError::Empty,
        other => HullError::Mesh(other),
    })
}

/// Where the lines of a grid along one axis are within the hull, distances from their first places in steps.
struct Lines {
    axis: usize,
    /// Lines side by side along the axis after this one.
    n_beside: usize,
    intervals: Vec<Vec<[f64; 2]>>,
}

/// The axes beside one: the one that lines lie side by side along, and the one after it.
const fn beside(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

impl Lines {
    fn cut(hull: &Hull, grid: &Occupancy, axis: usize) -> Self {
        let [first, second] = beside(axis);
        let (n_beside, n_over) = (grid.size()[first] as usize, grid.size()[second] as usize);
        let n_steps = f64::from(grid.size()[axis] - 1);
        let direction = DVec3::AXES[axis];
        let row = |over: usize| {
            let mut scratch = Scratch::default();
            let line = |at: usize| {
                let mut place = [0; 3];
                (place[first], place[second]) = (at as u32, over as u32);
                let ray = Ray { origin: grid.place(place), direction };
                hull.cut(&ray, [0.0, n_steps * grid.step_m()], &mut scratch);
                scratch.intervals.iter().map(|ends| ends.map(|at| at / grid.step_m())).collect()
            };
            (0..n_beside).map(line).collect::<Vec<Vec<[f64; 2]>>>()
        };
        Self { axis, n_beside, intervals: (0..n_over).into_par_iter().flat_map_iter(row).collect() }
    }

    /// Sets the places that lie within.
    fn fill(&self, grid: &mut Occupancy) {
        let [first, second] = beside(self.axis);
        for (i, intervals) in self.intervals.iter().enumerate() {
            for [from, to] in intervals {
                for at in from.ceil() as u32..=to.floor() as u32 {
                    let mut place = [0; 3];
                    place[self.axis] = at;
                    (place[first], place[second]) = ((i % self.n_beside) as u32, (i / self.n_beside) as u32);
                    grid.set(place);
                }
            }
        }
    }
}

impl Crossings for [Lines; 3] {
    fn share(&self, axis: usize, lower: [u32; 3], _grid: &Occupancy) -> Option<f64> {
        let lines = &self[axis];
        let [first, second] = beside(axis);
        let intervals =
            lines.intervals.get(lower[first] as usize + lower[second] as usize * lines.n_beside)?;
        let at = f64::from(lower[axis]);
        let within = intervals.iter().flatten().find(|end| (at..=at + 1.0).contains(*end));
        within.map(|end| end - at)
    }
}

#[cfg(test)]
mod tests {
    use super::super::silhouettes::tests::{ball, camera, eyes, meets_ball, seen};
    use super::*;
    use crate::hull::Agreement;

    fn around(half: f64) -> Bounds {
        Bounds::new(DVec3::splat(-half), DVec3::splat(half)).expect("a box")
    }

    #[test]
    fn both_methods_give_a_closed_ball_and_the_one_by_outlines_is_nearer() {
        let hull = ball(16);
        let true_m3 = 4.0 / 3.0 * std::f64::consts::PI;
        for method in Method::ALL {
            let mesh = extract(&hull, &around(1.6), (method, 48)).expect("a ball");
            mesh.check().expect("closed");
            // A hull is no smaller than what it is of, but for half a pixel (1 / 60) and what a net rounds off.
            let share = mesh.volume_m3() / true_m3;
            assert!((0.97..1.3).contains(&share), "{method:?}: {share}");
            for view in hull.views() {
                let seen = Agreement::of(&mesh, view);
                let least = if method == Method::ImageBased { 0.985 } else { 0.955 };
                assert!(seen.overlap() > least, "{method:?}: {seen:?}");
            }
        }
    }

    #[test]
    fn bounds_are_found_and_hold_it_closely() {
        let hull = Hull::new(ball(9).views().to_vec(), 6).expect("a hull");
        let bounds = Bounds::of(&hull).expect("a ball");
        assert!(bounds.low.max_element() < -1.0 && bounds.high.min_element() > 1.0, "{bounds:?}");
        assert!(bounds.size().max_element() < 4.0, "{bounds:?}");
        // What two neighbours alone see behind the ball goes on beyond all cameras, which stand 5 m from it, and ends.
        let hull = ball(9);
        let bounds = Bounds::of(&hull).expect("cones that part");
        assert!(bounds.size().max_element() > 11.0, "{bounds:?}");
        let mut scratch = Vec::new();
        let at = |i: i32| f64::from(i) * 0.25;
        for (x, y, z) in
            (-40..=40).flat_map(|x| (-40..=40).flat_map(move |y| (-20..=20).map(move |z| (x, y, z))))
        {
            let place = DVec3::new(at(x), at(y), at(z));
            let is_in = place.cmpge(bounds.low).all() && place.cmple(bounds.high).all();
            assert!(is_in || !hull.contains(place, &mut scratch), "{place} beyond {bounds:?}");
        }
        // What two cameras see from the same side does not end.
        let beside = [DVec3::new(5.0, 0.0, 0.0), DVec3::new(5.0, 0.9, 0.0)];
        let views = beside.map(|eye| seen(camera(eye), |ray| meets_ball(ray, DVec3::ZERO)));
        let hull = Hull::new(views.to_vec(), 2).expect("a hull");
        assert_eq!(Bounds::of(&hull).err(), Some(HullError::Unbounded));
    }

    #[test]
    fn two_things_apart_and_a_ring_keep_their_shape() {
        let apart = [DVec3::new(-1.3, 0.0, 0.0), DVec3::new(1.3, 0.3, 0.4)];
        // Few cameras see ghosts: two balls seen from many sides are two.
        let views = eyes(24)
            .map(|eye| seen(camera(eye * 1.6), |ray| apart.iter().any(|centre| meets_ball(ray, *centre))));
        let hull = Hull::new(views.collect(), 2).expect("a hull");
        let mesh = extract(&hull, &around(3.0), (Method::ImageBased, 64)).expect("two balls");
        mesh.check().expect("closed");
        // Euler: 2 for each closed surface without a hole.
        let n = |count: usize| count as i64;
        let characteristic =
            n(mesh.positions_m.len()) - n(mesh.triangles.len() * 3 / 2) + n(mesh.triangles.len());
        assert_eq!(characteristic % 2, 0);
        assert!(characteristic >= 4, "{characteristic}");
    }

    #[test]
    fn nothing_and_absurd_grids_are_refused() {
        let hull = ball(5);
        let away = Bounds::new(DVec3::splat(50.0), DVec3::splat(51.0)).expect("a box");
        for method in Method::ALL {
            assert_eq!(extract(&hull, &away, (method, 16)).err(), Some(HullError::Empty), "{method:?}");
        }
        let fault = extract(&hull, &around(1.0), (Method::Voxels, 4000)).err();
        assert_eq!(fault, Some(HullError::Resolution { n: 4000, least: 8, most: 1024 }));
    }
}
