//! Weights that follow what they should be smoothly, at the same rate whatever the rate of pictures; over meshes that change too.
//!
//! `[M19]` section 4.5, whose 0.05 a picture at some 120 pictures a second is a time constant of 0.16 s: 95 % of the way in half a second.

use super::{Field, Sight, Weights};
use crate::mesh::Mesh;
use glam::{DVec3, IVec3};
use std::collections::HashMap;

/// Time in which a share of 1 - 1/e of a change is done, seconds.
pub const FOLLOW_SECS: f64 = 0.16;

impl Weights {
    /// Goes towards `target` for so much scene time; times that are not above 0 change nothing, and where nobody sees a vertex, or did
    /// before, it is there at once.
    ///
    /// # Panics
    /// Where both are not of the same mesh and views.
    pub fn follow(&mut self, target: &Self, secs: f64) {
        assert_eq!((self.n_views, self.shares.len()), (target.n_views, target.shares.len()), "of one mesh");
        let share = if secs > 0.0 { -(-secs / FOLLOW_SECS).exp_m1() } else { 0.0 } as f32;
        let rows = self.shares.chunks_mut(self.n_views).zip(target.shares.chunks(self.n_views));
        for (row, target) in rows {
            let is_new = row.iter().all(|own| *own <= 0.0) || target.iter().all(|own| *own <= 0.0);
            let share = if is_new { 1.0 } else { share };
            row.iter_mut().zip(target).for_each(|(own, target)| *own += share * (*target - *own));
        }
    }

    /// Lets go of what views lend to vertices that they do not see, unless `target` has them lend there too; what is left is shared out
    /// among the others as before.
    ///
    /// # Panics
    /// Where all are not of the same mesh and views.
    pub fn let_go_of_unseen(&mut self, target: &Self, field: &Field) {
        assert_eq!((self.n_views, self.shares.len()), (target.n_views, target.shares.len()), "of one mesh");
        let rows = self.shares.chunks_mut(self.n_views).zip(target.shares.chunks(self.n_views));
        for (vertex, (row, target)) in (0..).zip(rows) {
            for (view, own) in row.iter_mut().enumerate() {
                if target[view] <= 0.0 && field.sight(vertex, view) != Sight::Seen {
                    *own = 0.0;
                }
            }
            let sum: f32 = row.iter().sum();
            if sum > 0.0 {
                row.iter_mut().for_each(|own| *own /= sum);
            }
        }
    }

    /// The weights of `before` at the nearest places of its surface, for the vertices of `mesh`: what they follow on from when a mesh
    /// changes. What is farther than `within_m` from all of it has none yet.
    ///
    /// **Cost** linear in both meshes, where triangles are not much larger than `within_m`.
    ///
    /// # Panics
    /// Where weights and `before` do not belong together.
    #[must_use]
    pub fn carried(&self, before: &Mesh, mesh: &Mesh, within_m: f64) -> Self {
        let n_views = self.n_views;
        assert_eq!(self.shares.len(), before.positions_m.len() * n_views, "weights of the mesh before");
        let grid = Grid::of(before, within_m.max(f64::MIN_POSITIVE));
        let mut shares = vec![0.0; mesh.positions_m.len() * n_views];
        for (place, row) in mesh.positions_m.iter().zip(shares.chunks_mut(n_views)) {
            let Some((triangle, corners)) = grid.nearest(before, *place) else { continue };
            for (vertex, corner) in before.triangles[triangle].iter().zip(corners) {
                row.iter_mut().zip(self.of(*vertex)).for_each(|(own, of)| *own += corner as f32 * *of);
            }
            // Partly from where nobody saw anything.
            let sum: f32 = row.iter().sum();
            if sum > 0.0 {
                row.iter_mut().for_each(|own| *own /= sum);
            }
        }
        Self { n_views, shares }
    }
}

/// Cells that triangles reach into; each as wide as the search goes far.
struct Grid {
    cell_m: f64,
    origin: DVec3,
    cells: HashMap<IVec3, Vec<u32>>,
}

/// Most cells that one triangle is entered into: what is larger is found by its corners' alone.
const MOST_CELLS: i64 = 512;

impl Grid {
    fn of(mesh: &Mesh, cell_m: f64) -> Self {
        let origin = mesh.bounds().map_or(DVec3::ZERO, |[low, _]| low);
        let mut grid = Self { cell_m, origin, cells: HashMap::new() };
        for (triangle, corners) in (0..).zip(&mesh.triangles) {
            let places = corners.map(|corner| mesh.positions_m[corner as usize]);
            let [low, high] = [
                grid.cell(places[0].min(places[1]).min(places[2])),
                grid.cell(places[0].max(places[1]).max(places[2])),
            ];
            let size = (high - low + IVec3::ONE).as_i64vec3();
            let mut enter = |cell: IVec3| {
                let of = grid.cells.entry(cell).or_default();
                if of.last() != Some(&triangle) {
                    of.push(triangle);
                }
            };
            if size.x.saturating_mul(size.y).saturating_mul(size.z) > MOST_CELLS {
                let cells = places.map(|place| ((place - origin) / cell_m).floor().as_ivec3());
                cells.into_iter().for_each(enter);
                continue;
            }
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    (low.x..=high.x).for_each(|x| enter(IVec3::new(x, y, z)));
                }
            }
        }
        grid
    }

    fn cell(&self, place: DVec3) -> IVec3 {
        ((place - self.origin) / self.cell_m).floor().as_ivec3()
    }

    /// The triangle with the nearest place within a cell's width, and that place as shares of its corners.
    fn nearest(&self, mesh: &Mesh, place: DVec3) -> Option<(usize, [f64; 3])> {
        let middle = self.cell(place);
        let mut nearest: Option<(f64, usize, [f64; 3])> = None;
        for over in 0..27 {
            let cell = middle.saturating_add(IVec3::new(over % 3 - 1, over / 3 % 3 - 1, over / 9 - 1));
            for triangle in self.cells.get(&cell).into_iter().flatten() {
                let triangle = *triangle as usize;
                let corners = mesh.triangles[triangle].map(|corner| mesh.positions_m[corner as usize]);
                let shares = nearest_on(corners, place);
                let at: DVec3 = corners.iter().zip(shares).map(|(corner, share)| *corner * share).sum();
                let off_m = at.distance(place);
                if off_m <= self.cell_m && nearest.is_none_or(|(least, ..)| off_m < least) {
                    nearest = Some((off_m, triangle, shares));
                }
            }
        }
        nearest.map(|(_, triangle, shares)| (triangle, shares))
    }
}

/// The place of a triangle that is nearest to another, as shares of its corners, which are not negative and add up to 1; also of
/// triangles without an area (Ericson, Real-Time Collision Detection, section 5.1.5).
fn nearest_on([a, b, c]: [DVec3; 3], place: DVec3) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let along = |from: DVec3| ((place - from).dot(ab), (place - from).dot(ac));
    let ((d1, d2), (d3, d4), (d5, d6)) = (along(a), along(b), along(c));
    let share = |part: f64, whole: f64| if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.0 };
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let of_c = d1 * d4 - d3 * d2;
    if of_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let share = share(d1, d1 - d3);
        return [1.0 - share, share, 0.0];
    }
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let of_b = d5 * d2 - d1 * d6;
    if of_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let share = share(d2, d2 - d6);
        return [1.0 - share, 0.0, share];
    }
    let of_a = d3 * d6 - d5 * d4;
    if of_a <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let share = share(d4 - d3, (d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - share, share];
    }
    let (of_b, of_c) = (share(of_b, of_a + of_b + of_c), share(of_c, of_a + of_b + of_c));
    [(1.0 - of_b - of_c).max(0.0), of_b, of_c]
}

#[cfg(test)]
mod tests {
    use super::super::testing::{grid, sphere};
    use super::*;

    fn one_of(n_views: usize, of: impl Iterator<Item = usize>) -> Weights {
        let shares = of.flat_map(|view| (0..n_views).map(move |i| f32::from(u8::from(i == view)))).collect();
        Weights { n_views, shares }
    }

    #[test]
    fn an_abrupt_turn_is_followed_in_half_a_second_at_any_rate() {
        let (from, to) = (one_of(3, [0, 0].into_iter()), one_of(3, [2, 1].into_iter()));
        for rate in [10, 30, 120] {
            let mut weights = from.clone();
            let (mut last, mut way) = (0.0, Vec::new());
            for _ in 0..rate / 2 {
                weights.follow(&to, 1.0 / f64::from(rate));
                let is = weights.of(0)[2];
                assert!(is > last && (weights.of(0).iter().sum::<f32>() - 1.0).abs() < 1e-6);
                last = is;
                way.push(is);
            }
            assert!((0.95..0.96).contains(&last), "{rate}: {last}");
        }
        let mut weights = from.clone();
        for secs in [0.0, -1.0, f64::NAN] {
            weights.follow(&to, secs);
            assert_eq!(weights, from);
        }
        weights.follow(&to, 1e9);
        assert_eq!(weights, to);
    }

    #[test]
    fn what_nobody_saw_is_there_at_once() {
        let mut weights = Weights { n_views: 2, shares: vec![0.0, 0.0, 1.0, 0.0] };
        weights.follow(&Weights { n_views: 2, shares: vec![0.25, 0.75, 0.0, 0.0] }, 0.01);
        assert_eq!(weights.shares, [0.25, 0.75, 0.0, 0.0]);
    }

    #[test]
    fn weights_are_carried_over_to_a_mesh_of_other_triangles() {
        let mesh_of = |(positions, triangles)| Mesh::new(positions, triangles);
        let before = mesh_of(sphere(4));
        // Smooth over the surface, so that places between vertices have values between.
        let smooth = |at: &DVec3| [0.5 + 0.5 * at.x, 0.5 - 0.5 * at.x].map(|share| share as f32);
        let weights = Weights { n_views: 2, shares: before.positions_m.iter().flat_map(smooth).collect() };
        let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.3);
        let mut turned = mesh_of(sphere(3));
        turned.positions_m.iter_mut().for_each(|at| *at = turn * *at);
        let carried = weights.carried(&before, &turned, 0.1);
        for (vertex, at) in (0..).zip(&turned.positions_m) {
            assert!((carried.of(vertex)[0] - smooth(at)[0]).abs() < 0.01, "{at}");
        }
        // What is new has nothing to follow on from.
        turned.positions_m.push(DVec3::splat(7.0));
        assert_eq!(weights.carried(&before, &turned, 0.1).of(turned.positions_m.len() as u32 - 1), [0.0; 2]);
    }

    #[test]
    fn nearest_places_are_those_of_a_search() {
        let (positions, _) = grid(12, 0.4, |x, y| (x * 1.3).sin() + (y * 0.7).cos());
        let corners_of = |i: usize| [0, 5, 17].map(|over| positions[(i + over * 7) % positions.len()]);
        for i in 0..100 {
            let corners = corners_of(i);
            let place = positions[(i * 31) % positions.len()] + DVec3::new(0.3, -0.2, 1.0);
            let shares = nearest_on(corners, place);
            assert!(
                shares.iter().all(|share| *share >= 0.0) && (shares.iter().sum::<f64>() - 1.0).abs() < 1e-12
            );
            let at =
                |shares: [f64; 3]| corners.iter().zip(shares).map(|(of, share)| *of * share).sum::<DVec3>();
            let found = at(shares).distance(place);
            for step in 0..21 * 21 {
                let [u, v] = [f64::from(step % 21) / 20.0, f64::from(step / 21) / 20.0];
                if u + v <= 1.0 {
                    assert!(found <= at([1.0 - u - v, u, v]).distance(place) + 1e-9);
                }
            }
        }
        // A needle and a point.
        for corners in [[DVec3::ZERO, DVec3::X, DVec3::X * 0.5], [DVec3::ONE; 3]] {
            let shares = nearest_on(corners, DVec3::new(0.25, 1.0, 0.0));
            assert!(
                (shares.iter().sum::<f64>() - 1.0).abs() < 1e-12 && shares.iter().all(|share| *share >= 0.0)
            );
        }
    }
}
