//! Geodesic distances over all of a mesh by one front that marches from vertex to vertex: for comparison, and where windows are too dear.
//!
//! `[NK02]` Novotni and Klein 2002, Computing geodesic distances on triangular meshes: the distances of two corners of a face are taken for
//! those from one point in its plane. Errors add up, either way; obtuse faces go along their edges.

use super::topology::Topology;
use glam::{DVec2, DVec3};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A distance in a heap that gives the least first.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Near(f64);

impl Eq for Near {}

impl PartialOrd for Near {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Near {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// Distances along the surface from the nearest of `sources` (vertices) to every vertex, metres; infinite where nothing leads there, and
/// where it is farther than `until_m`.
///
/// **Cost** n log n.
#[must_use]
pub fn marching(topology: &Topology, positions_m: &[DVec3], sources: &[u32], until_m: f64) -> Vec<f64> {
    let mut distances_m = vec![f64::INFINITY; topology.n_vertices()];
    let mut is_settled = vec![false; topology.n_vertices()];
    let mut front = BinaryHeap::new();
    for source in sources {
        distances_m[*source as usize] = 0.0;
        front.push(Reverse((Near(0.0), *source)));
    }
    while let Some(Reverse((Near(at_m), vertex))) = front.pop() {
        if at_m > until_m {
            break;
        }
        if std::mem::replace(&mut is_settled[vertex as usize], true) {
            continue;
        }
        for edge in topology.edges_at(vertex) {
            let (other, distance_m) = (topology.across(*edge, vertex), at_m + topology.length_m(*edge));
            if distance_m < distances_m[other as usize] {
                distances_m[other as usize] = distance_m;
                front.push(Reverse((Near(distance_m), other)));
            }
        }
        for face in topology.faces_at(vertex) {
            let corners = topology.corners(*face);
            for corner in 0..3 {
                // The corner that is reached, and the two that it is reached from.
                let [own, a, b] = [0, 1, 2].map(|i| corners[(corner + i) % 3]);
                let other = if a == vertex { b } else { a };
                if is_settled[own as usize] || !is_settled[other as usize] {
                    continue;
                }
                let places = [a, b, own].map(|vertex| positions_m[vertex as usize]);
                let known = [distances_m[a as usize], distances_m[b as usize]];
                let distance_m = across(places, known).unwrap_or(f64::INFINITY);
                if distance_m < distances_m[own as usize] {
                    distances_m[own as usize] = distance_m;
                    front.push(Reverse((Near(distance_m), own)));
                }
            }
        }
    }
    distances_m
        .iter_mut()
        .filter(|distance| **distance > until_m)
        .for_each(|distance| *distance = f64::INFINITY);
    distances_m
}

/// How far the third corner is of a point in the plane that is so far from the other two and on their other side; none where the
/// straight way does not pass between them.
fn across([a, b, own]: [DVec3; 3], [from_a, from_b]: [f64; 2]) -> Option<f64> {
    let length_m = a.distance(b);
    let (along, way) = ((b - a) / length_m, own - a);
    let apex = DVec2::new(way.dot(along), way.cross(along).length());
    let x = (from_a * from_a - from_b * from_b + length_m * length_m) / (2.0 * length_m);
    let source = DVec2::new(x, -(from_a * from_a - x * x).max(0.0).sqrt());
    let height = apex.y - source.y;
    let crossing = source.x - (apex.x - source.x) * source.y / height.max(f64::MIN_POSITIVE);
    let passes = height > 0.0 && (0.0..=length_m).contains(&crossing);
    passes.then(|| source.distance(apex))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::exact;
    use crate::fields::testing::{fan, grid, sphere};

    #[test]
    fn they_are_near_the_exact_ones_on_planes_hills_and_spheres() {
        for (name, mesh, sources, most) in [
            ("plane", grid(41, 0.0, |_, _| 0.0), vec![20 * 41 + 20], 1e-6),
            ("uneven plane", grid(41, 0.35, |_, _| 0.0), vec![20 * 41 + 20], 0.35),
            ("hills", grid(41, 0.3, |x, y| 2.0 * (0.5 * x).sin() * (0.4 * y).cos()), vec![5, 800, 1500], 0.6),
            ("sphere", sphere(4), vec![0], 0.7),
        ] {
            let topology = Topology::of(&mesh.0, &mesh.1);
            let exact = exact(&topology, &mesh.0, &sources, f64::INFINITY);
            let found = marching(&topology, &mesh.0, &sources, f64::INFINITY);
            let off = found
                .iter()
                .zip(&exact)
                .map(|(found, exact)| (found - exact).abs() / topology.mean_length_m());
            let worst = off.fold(0.0, f64::max);
            assert!(worst <= most, "{name}: {worst}");
        }
    }

    #[test]
    fn what_is_farther_than_asked_for_or_hangs_together_with_nothing_is_infinite() {
        let (mut positions_m, triangles) = grid(9, 0.0, |_, _| 0.0);
        positions_m.push(DVec3::splat(3.0));
        let topology = Topology::of(&positions_m, &triangles);
        let found = marching(&topology, &positions_m, &[0], 4.0);
        assert!(found[81].is_infinite() && found[80].is_infinite() && (found[4] - 4.0).abs() < 1e-12);
        let thin = fan(1e-7);
        let found = marching(&Topology::of(&thin.0, &thin.1), &thin.0, &[0], f64::INFINITY);
        assert!(found.iter().all(|at| at.is_finite() && *at >= 0.0), "{found:?}");
    }
}
