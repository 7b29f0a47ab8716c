//! Geodesic distances from vertices of a mesh, exact but for rounding: what cheaper forms are held to.
//!
//! `[XW09]` Xin and Wang 2009, Improving Chen and Han's algorithm on the discrete geodesic problem, ACM Transactions on Graphics 28(4).
//! Windows are pieces of an edge that a source is seen through, unfolded into the plane of the face beyond. The nearest goes on
//! first; of two that hold the same corner the farther has one child, and one that a vertex outdoes has none.

use super::topology::{NO_EDGE, Topology};
use glam::{DVec2, DVec3};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Windows that are shorter than this share of their edge see nothing.
const LEAST_WINDOW: f64 = 1e-12;

/// Rays that miss a window by less than this share of its edge go through it.
const ON_LINE: f64 = 1e-9;

/// By no more than this share of them distances are the same.
const SAME: f64 = 1e-12;

/// A piece of an edge that a source is seen through.
#[derive(Clone, Copy, Debug)]
struct Window {
    edge: u32,
    /// The face that it looks into.
    into: u32,
    /// From where to where, along the edge from its first end, metres.
    piece: [f64; 2],
    /// The source in the plane of that face: along the edge from its first end, and how far before it.
    source: DVec2,
    /// How far the source itself is.
    beyond_m: f64,
}

/// What is done next, and at what distance.
#[derive(Clone, Copy, Debug)]
struct Event {
    at_m: f64,
    what: What,
}

#[derive(Clone, Copy, Debug)]
enum What {
    /// Ways bend at a vertex, or begin there.
    Vertex(u32),
    Window(Window),
}

impl PartialEq for Event {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Event {}

impl PartialOrd for Event {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Event {
    /// The nearest is the greatest: a heap gives it first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.at_m.total_cmp(&self.at_m)
    }
}

/// The window that holds a corner of a face, coming through the edge opposite to it.
#[derive(Clone, Copy, Debug)]
struct Holder {
    distance_m: f64,
    /// Where its ray to the corner crosses the edge.
    crossing_m: f64,
}

struct Search<'a> {
    topology: &'a Topology,
    positions_m: &'a [DVec3],
    distances_m: Vec<f64>,
    events: BinaryHeap<Event>,
    /// By face, three a face.
    holders: Vec<Option<Holder>>,
}

/// Distances along the surface from the nearest of `sources` (vertices) to every vertex, metres; infinite where nothing leads there, and
/// where it is farther than `until_m`.
///
/// **Cost** about n^2 log n in the worst case, near n^1.5 on meshes as they are.
#[must_use]
pub fn exact(topology: &Topology, positions_m: &[DVec3], sources: &[u32], until_m: f64) -> Vec<f64> {
    let mut search = Search {
        topology,
        positions_m,
        distances_m: vec![f64::INFINITY; topology.n_vertices()],
        events: BinaryHeap::new(),
        holders: vec![None; 3 * topology.n_faces()],
    };
    for source in sources {
        search.distances_m[*source as usize] = 0.0;
        search.events.push(Event { at_m: 0.0, what: What::Vertex(*source) });
    }
    while let Some(Event { at_m, what }) = search.events.pop() {
        if at_m > until_m {
            break;
        }
        match what {
            // Found nearer since.
            What::Vertex(vertex) if at_m > search.distances_m[vertex as usize] => {}
            What::Vertex(vertex) => search.begin(vertex),
            What::Window(window) => search.go_on(&window),
        }
    }
    let mut distances_m = search.distances_m;
    distances_m
        .iter_mut()
        .filter(|distance| **distance > until_m)
        .for_each(|distance| *distance = f64::INFINITY);
    distances_m
}

impl Search<'_> {
    /// A vertex is so far away, by a straight way.
    fn reach(&mut self, vertex: u32, distance_m: f64) {
        let known = &mut self.distances_m[vertex as usize];
        if distance_m < *known * (1.0 - SAME) {
            *known = distance_m;
            if self.topology.may_bend(vertex) {
                self.events.push(Event { at_m: distance_m, what: What::Vertex(vertex) });
            }
        }
    }

    /// Ways begin at a vertex: along its edges, and through the edges across its faces.
    fn begin(&mut self, vertex: u32) {
        let (topology, beyond_m) = (self.topology, self.distances_m[vertex as usize]);
        for edge in topology.edges_at(vertex) {
            self.reach(topology.across(*edge, vertex), beyond_m + topology.length_m(*edge));
        }
        for face in topology.faces_at(vertex) {
            let Some(corner) = topology.corners(*face).iter().position(|of| *of == vertex) else { continue };
            let edge = topology.edges_of(*face)[corner];
            let source = self.beside(edge, vertex);
            self.look_on(*face, edge, [0.0, topology.length_m(edge)], source, beyond_m);
        }
    }

    /// A vertex in the plane of an edge, on its positive side.
    fn beside(&self, edge: u32, vertex: u32) -> DVec2 {
        let [from, to] = self.topology.ends(edge).map(|end| self.positions_m[end as usize]);
        let (along, way) = ((to - from).normalize(), self.positions_m[vertex as usize] - from);
        DVec2::new(way.dot(along), way.cross(along).length())
    }

    /// Adds windows that look through a piece of an edge into the faces behind it, unless an end of the edge outdoes them.
    fn look_on(&mut self, out_of: u32, edge: u32, piece: [f64; 2], source: DVec2, beyond_m: f64) {
        let (topology, [from, to]) = (self.topology, piece);
        let length_m = topology.length_m(edge);
        if to - from <= LEAST_WINDOW * length_m {
            return;
        }
        let away = |at: f64| beyond_m + source.distance(DVec2::new(at, 0.0));
        let is_outdone = |own: f64, other: f64| own > other * (1.0 + SAME);
        let [first, last] = topology.ends(edge).map(|end| self.distances_m[end as usize]);
        if is_outdone(away(to), first + to) || is_outdone(away(from), last + length_m - from) {
            return;
        }
        let at_m = away(source.x.clamp(from, to));
        for into in topology.faces_at_edge(edge).iter().filter(|face| **face != out_of) {
            let window = Window { edge, into: *into, piece, source, beyond_m };
            self.events.push(Event { at_m, what: What::Window(window) });
        }
    }

    /// What is seen through a window, on the two edges behind.
    fn go_on(&mut self, window: &Window) {
        let Window { edge, into, piece: [from, to], source, beyond_m } = *window;
        let topology = self.topology;
        let edges = topology.edges_of(into);
        let Some(corner) = edges.iter().position(|of| *of == edge) else { return };
        let opposite = topology.corners(into)[corner];
        let beside = self.beside(edge, opposite);
        let apex = DVec2::new(beside.x, -beside.y);
        // Where the ray to the opposite corner crosses the edge.
        let crossing_m =
            source.x + (apex.x - source.x) * source.y / (source.y - apex.y).max(f64::MIN_POSITIVE);
        let (mut sees_first, mut sees_last) = (from < crossing_m, to > crossing_m);
        let distance_m = beyond_m + source.distance(apex);
        // A corner on the line between two windows is seen through both.
        let slack_m = ON_LINE * topology.length_m(edge);
        if from <= crossing_m + slack_m && to >= crossing_m - slack_m {
            self.reach(opposite, distance_m);
        }
        if sees_first && sees_last {
            let holder = &mut self.holders[3 * into as usize + corner];
            match holder {
                // Two pieces of one source may both hold a corner that lies on the line between them: of equals both go on.
                Some(holder) if holder.distance_m < distance_m * (1.0 - SAME) => {
                    sees_first = crossing_m < holder.crossing_m;
                    sees_last = !sees_first;
                }
                _ => *holder = Some(Holder { distance_m, crossing_m }),
            }
        }
        let length_m = topology.length_m(edge);
        let [first, last] = topology.ends(edge);
        for (is_seen, end, end_vertex, piece) in [
            (sees_first, DVec2::ZERO, first, [from, to.min(crossing_m)]),
            (sees_last, DVec2::new(length_m, 0.0), last, [from.max(crossing_m), to]),
        ] {
            if !is_seen {
                continue;
            }
            // The edge between this end and the opposite corner is the one across the other end.
            let Some(other) =
                topology.corners(into).iter().position(|of| *of != opposite && *of != end_vertex)
            else {
                continue;
            };
            let beyond = edges[other];
            if beyond == NO_EDGE {
                continue;
            }
            let way = apex - end;
            let beyond_length_m = topology.length_m(beyond);
            // Along the edge from this end, where a ray through the window's end meets it.
            let met = |at: f64| {
                let ray = DVec2::new(at, 0.0) - source;
                let across = ray.perp_dot(way);
                let share = if across == 0.0 { 0.0 } else { (source - end).perp_dot(ray) / -across };
                share.clamp(0.0, 1.0) * beyond_length_m
            };
            let ends = piece.map(met);
            let [low, high] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
            // In the plane of that edge: along it, and before it.
            let direction = way / beyond_length_m;
            let (along_m, before_m) =
                ((source - end).dot(direction), (source - end).perp_dot(direction).abs());
            let is_first = topology.ends(beyond)[0] == end_vertex;
            let (piece, along_m) = if is_first {
                ([low, high], along_m)
            } else {
                ([beyond_length_m - high, beyond_length_m - low], beyond_length_m - along_m)
            };
            self.look_on(into, beyond, piece, DVec2::new(along_m, before_m), beyond_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::testing::{fan, grid, sphere};

    fn distances(mesh: &(Vec<DVec3>, Vec<[u32; 3]>), sources: &[u32]) -> Vec<f64> {
        exact(&Topology::of(&mesh.0, &mesh.1), &mesh.0, sources, f64::INFINITY)
    }

    #[test]
    fn on_a_plane_they_are_straight_lines_whatever_the_triangles() {
        // In even triangles most rays go through corners, in the longest way through forty of them.
        for (n, jitter, source) in [(17, 0.0, 0), (17, 0.3, 140), (41, 0.0, 860), (41, 0.3, 860)] {
            let mesh = grid(n, jitter, |_, _| 0.0);
            for (source, found) in [(source, distances(&mesh, &[source as u32]))] {
                for (at, found) in mesh.0.iter().zip(&found) {
                    let expected = at.distance(mesh.0[source]);
                    assert!(
                        (found - expected).abs() < 1e-9 * (1.0 + expected),
                        "{jitter}: {found} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn over_a_folded_plane_they_are_those_of_the_plane_unfolded() {
        // A sheet that is folded up at x = 8 by a right angle.
        let flat = grid(17, 0.25, |_, _| 0.0);
        let folded = |at: &DVec3| if at.x > 8.0 { DVec3::new(8.0, at.y, at.x - 8.0) } else { *at };
        // No triangle lies across the fold.
        let straight: Vec<DVec3> = flat
            .0
            .iter()
            .enumerate()
            .map(|(i, at)| if i % 17 == 8 { DVec3::new(8.0, at.y, 0.0) } else { *at })
            .collect();
        let mesh = (straight.iter().map(folded).collect::<Vec<_>>(), flat.1);
        let found = distances(&mesh, &[20]);
        for (at, found) in straight.iter().zip(&found) {
            assert!((found - at.distance(straight[20])).abs() < 1e-9, "{found}");
        }
    }

    #[test]
    fn round_a_corner_ways_bend_and_from_several_sources_the_nearest_counts() {
        // An L: the square beyond the inner corner is not there.
        let (positions_m, triangles) = grid(11, 0.0, |_, _| 0.0);
        let is_left = |triangle: &[u32; 3]| {
            let middle = triangle.iter().map(|i| positions_m[*i as usize]).sum::<DVec3>() / 3.0;
            !(middle.x > 5.0 && middle.y > 5.0)
        };
        let mesh = (positions_m.clone(), triangles.into_iter().filter(is_left).collect::<Vec<_>>());
        let found = distances(&mesh, &[10]);
        let inner = DVec3::new(5.0, 5.0, 0.0);
        let end = DVec3::new(0.0, 10.0, 0.0);
        let expected = positions_m[10].distance(inner) + inner.distance(end);
        assert!((found[110] - expected).abs() < 1e-9, "{} {expected}", found[110]);
        // What hangs together with nothing is never reached.
        assert!(found[120].is_infinite());
        let both = distances(&mesh, &[10, 110]);
        assert!(both.iter().zip(&found).all(|(both, one)| *both <= one + 1e-9) && both[110] == 0.0);
    }

    #[test]
    fn on_a_sphere_they_come_nearer_to_great_circles_the_finer_it_is() {
        let mut last = f64::INFINITY;
        for level in [2, 3, 4] {
            let mesh = sphere(level);
            let found = distances(&mesh, &[0]);
            let of = |(at, found): (&DVec3, &f64)| (found - at.angle_between(mesh.0[0])).abs();
            let worst = mesh.0.iter().zip(&found).map(of).fold(0.0, f64::max);
            assert!(worst < 0.35 * last, "{level}: {worst}");
            last = worst;
        }
        assert!(last < 0.01, "{last}");
    }

    #[test]
    fn slivers_needles_doubled_corners_and_edges_of_three_faces_give_finite_distances() {
        let mesh = fan(1e-7);
        let found = distances(&mesh, &[0]);
        assert!(found.iter().all(|at| at.is_finite() && *at >= 0.0), "{found:?}");
        for (at, found) in mesh.0.iter().zip(&found) {
            assert!(*found >= at.distance(mesh.0[0]) - 1e-9, "shorter than through the air");
        }
        let mut broken = grid(5, 0.0, |_, _| 0.0);
        broken.1.push([0, 0, 1]);
        broken.1.push([0, 1, 2]);
        // A flap on an edge of two faces.
        broken.0.push(DVec3::new(1.5, 1.0, 1.0));
        broken.1.push([6, 7, 25]);
        let found = distances(&broken, &[0]);
        assert!(found.iter().all(|at| at.is_finite()), "{found:?}");
        let flap = found[25];
        let expected =
            (6..=7).map(|i| found[i] + broken.0[i].distance(broken.0[25])).fold(f64::INFINITY, f64::min);
        assert!(flap <= expected + 1e-9 && flap > 1.0, "{flap} {expected}");
    }
}
