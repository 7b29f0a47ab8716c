//! Geodesic distances near vertices of a mesh, in rounds that every edge does on its own: what a device runs, in its precision.
//!
//! `[M19]` Du et al. 2019, `Montage4D`, section 4.4, after `[S05]` Surazhsky et al. 2005, Fast exact and approximate geodesics on meshes. An
//! edge keeps two windows a side and takes what the two other edges of the face before it hand on; a window that is left out costs
//! accuracy, and no distance is too short by more than what windows that were joined differ by: what is told are lengths of ways on the
//! surface, from sources that are where they are to within that.
//!
//! Windows carry the source that they see, in the plane of their face, and not distances to it: from two distances to the ends of a
//! window of 1e-5 of its edge, a source is found in f32 to no more than 0.12 of the edge, if at all.

use super::topology::{NO_EDGE, Topology};
use glam::{DVec3, Vec2};

/// Rounds, each of which goes on by a triangle.
pub const ROUNDS: u32 = 20;

/// Windows that are kept of an edge, a side.
const KEPT: usize = 2;

/// Windows that are shorter than this share of their edge are dropped.
const LEAST_WINDOW: f32 = 1e-2;

/// Windows of sources that are apart by less than this share of the mean edge are one.
const SAME: f32 = 1e-2;

/// Places of an edge, as shares of it, by which windows are compared.
const PLACES: [f32; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// A piece of an edge that a source is seen through.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Window {
    /// From where to where, along the edge from its first end, metres.
    piece: [f32; 2],
    /// The source in the plane of the face that is looked into: along the edge, and how far before it.
    source: Vec2,
    /// How far the source itself is.
    beyond_m: f32,
}

/// The windows of an edge that look into one of its faces.
type Kept = [Option<Window>; KEPT];

impl Window {
    /// How far a place of the edge is, by a way through the window.
    fn at(&self, along_m: f32) -> f32 {
        let through = along_m.clamp(self.piece[0], self.piece[1]);
        self.beyond_m + self.source.distance(Vec2::new(through, 0.0)) + (along_m - through).abs()
    }

    /// How far a place behind the edge is, by the shortest way through the window.
    fn beyond(&self, place: Vec2) -> f32 {
        let crossing = crossing(self.source, place).clamp(self.piece[0], self.piece[1]);
        let through = Vec2::new(crossing, 0.0);
        self.beyond_m + self.source.distance(through) + through.distance(place)
    }

    /// Both as one, where they see the same source and leave no gap.
    fn joined(&self, other: &Self, same_m: f32) -> Option<Self> {
        let is_same = self.source.distance(other.source) + (self.beyond_m - other.beyond_m).abs() <= same_m;
        let is_near = self.piece[0] <= other.piece[1] + same_m && other.piece[0] <= self.piece[1] + same_m;
        // Of the farther source, so that none is too short.
        let farther = if self.beyond_m >= other.beyond_m { self } else { other };
        let piece = [self.piece[0].min(other.piece[0]), self.piece[1].max(other.piece[1])];
        (is_same && is_near).then_some(Self { piece, ..*farther })
    }
}

/// Where the ray from a source before an edge to a place behind it crosses the edge.
fn crossing(source: Vec2, place: Vec2) -> f32 {
    let height = (source.y - place.y).max(f32::MIN_POSITIVE);
    source.x + (place.x - source.x) * (source.y / height)
}

/// A face as one of its edges has it: the corner across, in the edge's plane on its positive side.
struct Sides<'a> {
    topology: &'a Topology,
    /// Three a face.
    apexes: Vec<Vec2>,
    lengths_m: Vec<f32>,
    same_m: f32,
}

/// Distances along the surface from the nearest of `sources` (vertices) to every vertex that is within `rounds` triangles, metres;
/// infinite elsewhere. Right as far as windows came, some third of the rounds in edges; beyond, ways along
/// edges.
///
/// A device does every edge in every round; here a round does those whose neighbours changed in the last one, which comes to the same
/// to the bit.
///
/// **Cost** linear in the faces, and in the edges near sources a round.
#[must_use]
pub fn bounded(topology: &Topology, positions_m: &[DVec3], sources: &[u32], rounds: u32) -> Vec<f32> {
    let sides = Sides::of(topology, positions_m);
    let mut distances_m = vec![f32::INFINITY; topology.n_vertices()];
    let mut begins: Vec<bool> =
        (0..topology.n_vertices() as u32).map(|vertex| topology.may_bend(vertex)).collect();
    let mut changed = Changed::default();
    for source in sources {
        distances_m[*source as usize] = 0.0;
        begins[*source as usize] = true;
        changed.vertices.push(*source);
    }
    // Of each face three: those that look into it through the edge across a corner.
    let mut kept: Vec<Kept> = vec![[None; KEPT]; 3 * topology.n_faces()];
    let mut due = Due { sides: Marks::new(kept.len()), vertices: Marks::new(distances_m.len()) };
    for _ in 0..rounds {
        due.find_sides(topology, &changed);
        let gathered: Vec<(u32, Kept)> = due
            .sides
            .items
            .iter()
            .map(|side| (*side, sides.gathered(side / 3, *side as usize % 3, (&kept, &distances_m, &begins))))
            .filter(|(side, windows)| *windows != kept[*side as usize])
            .collect();
        changed.sides.clear();
        for (side, windows) in gathered {
            kept[side as usize] = windows;
            changed.sides.push(side);
        }
        due.find_vertices(topology, &changed);
        let reached: Vec<(u32, f32)> = due
            .vertices
            .items
            .iter()
            .map(|vertex| (*vertex, sides.reached(*vertex, &kept, &distances_m)))
            .filter(|(vertex, distance_m)| *distance_m != distances_m[*vertex as usize])
            .collect();
        changed.vertices.clear();
        for (vertex, distance_m) in reached {
            distances_m[vertex as usize] = distance_m;
            changed.vertices.push(vertex);
        }
        if changed.sides.is_empty() && changed.vertices.is_empty() {
            break;
        }
    }
    distances_m
}

/// What the last round changed.
#[derive(Debug, Default)]
struct Changed {
    /// Corners of faces, three a face: windows that look into it through the edge across.
    sides: Vec<u32>,
    vertices: Vec<u32>,
}

/// Items, each once.
struct Marks {
    is_in: Vec<bool>,
    items: Vec<u32>,
}

impl Marks {
    fn new(n: usize) -> Self {
        Self { is_in: vec![false; n], items: Vec::new() }
    }

    fn clear(&mut self) {
        for item in self.items.drain(..) {
            self.is_in[item as usize] = false;
        }
    }

    fn add(&mut self, item: u32) {
        if !std::mem::replace(&mut self.is_in[item as usize], true) {
            self.items.push(item);
        }
    }
}

/// What the next round has to do.
struct Due {
    sides: Marks,
    vertices: Marks,
}

impl Due {
    /// Windows that follow from windows and distances that changed: those through the two other edges of a face that they look into, and
    /// those through edges across vertices.
    fn find_sides(&mut self, topology: &Topology, changed: &Changed) {
        self.sides.clear();
        let mut beyond = |face: u32, corner: usize| {
            let edge = topology.edges_of(face)[corner];
            if edge == NO_EDGE {
                return;
            }
            for into in topology.faces_at_edge(edge).iter().filter(|into| **into != face) {
                if let Some(own) = topology.edges_of(*into).iter().position(|of| *of == edge) {
                    self.sides.add(3 * into + own as u32);
                }
            }
        };
        for side in &changed.sides {
            let (face, corner) = (side / 3, *side as usize % 3);
            (0..3).filter(|other| *other != corner).for_each(|other| beyond(face, other));
        }
        for vertex in &changed.vertices {
            for face in topology.faces_at(*vertex) {
                if let Some(corner) = topology.corners(*face).iter().position(|of| of == vertex) {
                    beyond(*face, corner);
                }
            }
        }
    }

    /// Vertices that follow from this round's windows and the last round's distances.
    fn find_vertices(&mut self, topology: &Topology, changed: &Changed) {
        self.vertices.clear();
        for side in &changed.sides {
            self.vertices.add(topology.corners(side / 3)[*side as usize % 3]);
        }
        for vertex in &changed.vertices {
            for edge in topology.edges_at(*vertex) {
                self.vertices.add(topology.across(*edge, *vertex));
            }
        }
    }
}

impl<'a> Sides<'a> {
    fn of(topology: &'a Topology, positions_m: &[DVec3]) -> Self {
        let apex = |face: u32, corner: usize| {
            let edge = topology.edges_of(face)[corner];
            if edge == NO_EDGE {
                return Vec2::ZERO;
            }
            let [from, to] = topology.ends(edge).map(|end| positions_m[end as usize]);
            let (along, way) =
                ((to - from).normalize(), positions_m[topology.corners(face)[corner] as usize] - from);
            Vec2::new(way.dot(along) as f32, way.cross(along).length() as f32)
        };
        let faces = 0..topology.n_faces() as u32;
        Self {
            topology,
            apexes: faces.flat_map(|face| [0, 1, 2].map(|corner| apex(face, corner))).collect(),
            lengths_m: (0..topology.n_edges() as u32).map(|edge| topology.length_m(edge) as f32).collect(),
            same_m: SAME * topology.mean_length_m() as f32,
        }
    }

    /// What looks into a face through the edge across a corner: what the faces before that edge hand on to it.
    fn gathered(
        &self,
        into: u32,
        corner: usize,
        (kept, distances_m, begins): (&[Kept], &[f32], &[bool]),
    ) -> Kept {
        let edge = self.topology.edges_of(into)[corner];
        if edge == NO_EDGE {
            return [None; KEPT];
        }
        let length_m = self.lengths_m[edge as usize];
        let mut best = Best { windows: [None; KEPT], length_m, same_m: self.same_m };
        for out_of in self.topology.faces_at_edge(edge).iter().filter(|face| **face != into) {
            let edges = self.topology.edges_of(*out_of);
            let Some(own) = edges.iter().position(|of| *of == edge) else { continue };
            let across = self.topology.corners(*out_of)[own] as usize;
            if begins[across] && distances_m[across].is_finite() {
                let source = self.apexes[3 * *out_of as usize + own];
                best.offer(Window { piece: [0.0, length_m], source, beyond_m: distances_m[across] });
            }
            for other in (0..3).filter(|other| *other != own) {
                let windows = kept[3 * *out_of as usize + other];
                windows
                    .iter()
                    .flatten()
                    .filter_map(|of| self.handed_on(of, *out_of, (other, own)))
                    .for_each(|of| best.offer(of));
            }
        }
        best.windows
    }

    /// What of a window through the edge across corner `from` of a face is seen on the edge across corner `to`.
    fn handed_on(&self, window: &Window, face: u32, (from, to): (usize, usize)) -> Option<Window> {
        let (corners, edges) = (self.topology.corners(face), self.topology.edges_of(face));
        let (first_edge, second_edge) = (edges[from], edges[to]);
        // Both edges share the corner that is across neither.
        let shared = corners[3 - from - to];
        let beside = self.apexes[3 * face as usize + from];
        let apex = Vec2::new(beside.x, -beside.y);
        let is_at_first = self.topology.ends(first_edge)[0] == shared;
        let end = if is_at_first { Vec2::ZERO } else { Vec2::new(self.lengths_m[first_edge as usize], 0.0) };
        // What passes between the shared corner and the ray to the one across.
        let crossing = crossing(window.source, apex);
        let [low, high] = window.piece;
        let piece = if is_at_first { [low, high.min(crossing)] } else { [low.max(crossing), high] };
        if piece[0] > piece[1] {
            return None;
        }
        let length_m = self.lengths_m[second_edge as usize];
        let way = (apex - end) / length_m;
        let met = |at: f32| {
            let ray = Vec2::new(at, 0.0) - window.source;
            let across = ray.perp_dot(way);
            let along = if across == 0.0 { 0.0 } else { (window.source - end).perp_dot(ray) / -across };
            along.clamp(0.0, length_m)
        };
        let ends = piece.map(met);
        let [low, high] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        if (high - low).is_nan() || high - low < LEAST_WINDOW * length_m {
            return None;
        }
        let from_end = window.source - end;
        let (along_m, before_m) = (from_end.dot(way), from_end.perp_dot(way).abs());
        let (piece, along_m) = if self.topology.ends(second_edge)[0] == shared {
            ([low, high], along_m)
        } else {
            ([length_m - high, length_m - low], length_m - along_m)
        };
        Some(Window { piece, source: Vec2::new(along_m, before_m), beyond_m: window.beyond_m })
    }

    /// How far a vertex is by what is kept around it.
    fn reached(&self, vertex: u32, kept: &[Kept], distances_m: &[f32]) -> f32 {
        let along = |edge: &u32| {
            distances_m[self.topology.across(*edge, vertex) as usize] + self.lengths_m[*edge as usize]
        };
        let through = |face: &u32| {
            let corner = self.topology.corners(*face).iter().position(|of| *of == vertex);
            corner.map_or(f32::INFINITY, |corner| {
                let place = 3 * *face as usize + corner;
                let apex = Vec2::new(self.apexes[place].x, -self.apexes[place].y);
                kept[place].iter().flatten().map(|window| window.beyond(apex)).fold(f32::INFINITY, f32::min)
            })
        };
        let edges = self.topology.edges_at(vertex).iter().map(along);
        let faces = self.topology.faces_at(vertex).iter().map(through);
        edges.chain(faces).fold(distances_m[vertex as usize], f32::min)
    }
}

/// The windows of an edge that together tell the least distances along it.
struct Best {
    windows: Kept,
    length_m: f32,
    same_m: f32,
}

impl Best {
    fn offer(&mut self, mut new: Window) {
        for slot in &mut self.windows {
            if let Some(joined) = slot.and_then(|kept| kept.joined(&new, self.same_m)) {
                *slot = None;
                new = joined;
            }
        }
        match self.windows.iter_mut().find(|slot| slot.is_none()) {
            Some(slot) => *slot = Some(new),
            None => self.choose(new),
        }
    }

    /// Of three the two by which the edge is nearest, in the mean of its places.
    fn choose(&mut self, new: Window) {
        let [Some(a), Some(b)] = self.windows else { return };
        let all = [a, b, new];
        let least = |pair: [usize; 2]| -> f32 {
            let at = |share: &f32| {
                pair.map(|of| all[of].at(share * self.length_m)).into_iter().fold(f32::INFINITY, f32::min)
            };
            PLACES.iter().map(at).sum()
        };
        let sums = [[0, 1], [0, 2], [1, 2]].map(|pair| (least(pair), pair));
        let mut best = sums[0];
        for other in &sums[1..] {
            if other.0 < best.0 {
                best = *other;
            }
        }
        self.windows = best.1.map(|of| Some(all[of]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::exact;
    use crate::fields::testing::{fan, grid, sphere};

    /// Greatest and mean error against the exact distances, in mean edges, of what is within so many rounds; and the least.
    fn errors(mesh: &(Vec<DVec3>, Vec<[u32; 3]>), sources: &[u32], (rounds, within): (u32, f64)) -> [f64; 3] {
        let topology = Topology::of(&mesh.0, &mesh.1);
        let exact = exact(&topology, &mesh.0, sources, f64::INFINITY);
        let found = bounded(&topology, &mesh.0, sources, rounds);
        let off = |(found, exact): (&f32, &f64)| (f64::from(*found) - exact) / topology.mean_length_m();
        let near = found.iter().zip(&exact).filter(|(_, exact)| **exact <= within * topology.mean_length_m());
        let off: Vec<f64> = near.map(off).collect();
        let worst = off.iter().copied().fold(0.0, f64::max);
        let least = off.iter().copied().fold(0.0, f64::min);
        [worst, off.iter().sum::<f64>() / off.len() as f64, least]
    }

    /// Every edge in every round, as a device does it.
    fn everywhere(topology: &Topology, positions_m: &[DVec3], sources: &[u32], rounds: u32) -> Vec<f32> {
        let sides = Sides::of(topology, positions_m);
        let mut distances_m = vec![f32::INFINITY; topology.n_vertices()];
        let vertices = 0..topology.n_vertices() as u32;
        let mut begins: Vec<bool> = vertices.clone().map(|vertex| topology.may_bend(vertex)).collect();
        for source in sources {
            distances_m[*source as usize] = 0.0;
            begins[*source as usize] = true;
        }
        let mut kept: Vec<Kept> = vec![[None; KEPT]; 3 * topology.n_faces()];
        for _ in 0..rounds {
            let side =
                |side: usize| sides.gathered(side as u32 / 3, side % 3, (&kept, &distances_m, &begins));
            let next: Vec<Kept> = (0..kept.len()).map(side).collect();
            distances_m = vertices.clone().map(|vertex| sides.reached(vertex, &next, &distances_m)).collect();
            kept = next;
        }
        distances_m
    }

    #[test]
    fn rounds_of_what_changed_are_those_of_every_edge_to_the_bit() {
        let hills = grid(31, 0.3, |x, y| 2.0 * (0.5 * x).sin() * (0.4 * y).cos());
        for (mesh, sources) in [
            (hills, vec![5, 400, 401, 900]),
            (sphere(3), vec![0, 9]),
            (fan(1e-5), vec![3]),
            (grid(6, 0.2, |_, _| 0.0), vec![]),
        ] {
            let topology = Topology::of(&mesh.0, &mesh.1);
            for rounds in [1, 2, 7, ROUNDS] {
                let bits = |of: Vec<f32>| of.into_iter().map(f32::to_bits).collect::<Vec<u32>>();
                assert_eq!(
                    bits(bounded(&topology, &mesh.0, &sources, rounds)),
                    bits(everywhere(&topology, &mesh.0, &sources, rounds)),
                    "{rounds} rounds from {sources:?}"
                );
            }
        }
    }

    #[test]
    fn they_are_near_the_exact_ones_and_hardly_ever_shorter() {
        for (name, mesh, sources, most) in [
            ("plane", grid(41, 0.0, |_, _| 0.0), vec![20 * 41 + 20], [1e-4, 1e-5]),
            ("uneven plane", grid(41, 0.35, |_, _| 0.0), vec![20 * 41 + 20], [0.02, 0.002]),
            (
                "hills",
                grid(41, 0.3, |x, y| 2.0 * (0.5 * x).sin() * (0.4 * y).cos()),
                vec![5, 800, 801, 1500],
                [0.05, 0.005],
            ),
            ("sphere", sphere(4), vec![0], [0.05, 0.005]),
        ] {
            let [worst, mean, least] = errors(&mesh, &sources, (ROUNDS, 6.0));
            assert!(worst <= most[0] && mean <= most[1], "{name}: {worst} {mean}");
            assert!(least > -f64::from(SAME), "{name}: shorter than the shortest by {least}");
        }
    }

    #[test]
    fn so_many_rounds_go_so_far_and_no_sources_nowhere() {
        let mesh = grid(41, 0.0, |_, _| 0.0);
        let topology = Topology::of(&mesh.0, &mesh.1);
        for rounds in [1, 5, 15] {
            let found = bounded(&topology, &mesh.0, &[0], rounds);
            let farthest = found.iter().filter(|at| at.is_finite()).copied().fold(0.0, f32::max);
            assert!(
                farthest >= rounds as f32 && farthest < 2.9 * rounds as f32 + 1.0,
                "{rounds}: {farthest}"
            );
        }
        assert!(bounded(&topology, &mesh.0, &[], ROUNDS).iter().all(|at| at.is_infinite()));
        let all: Vec<u32> = (0..topology.n_vertices() as u32).collect();
        assert!(bounded(&topology, &mesh.0, &all, ROUNDS).iter().all(|at| *at == 0.0));
    }

    #[test]
    fn slivers_and_needles_leave_no_number_that_is_none() {
        for thin in [1e-3, 1e-5, 1e-7] {
            let mesh = fan(thin);
            let topology = Topology::of(&mesh.0, &mesh.1);
            for source in 0..14 {
                let found = bounded(&topology, &mesh.0, &[source], ROUNDS);
                let exact = exact(&topology, &mesh.0, &[source], f64::INFINITY);
                for (found, exact) in found.iter().zip(&exact) {
                    let off = f64::from(*found) - exact;
                    assert!(off.abs() < 0.05 * (1.0 + exact), "{thin} from {source}: {found} {exact}");
                }
            }
        }
    }
}
