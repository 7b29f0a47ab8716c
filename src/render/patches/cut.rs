//! Level faces cut along a grid without a crack: neighbours share every corner that lies on their common line, to the
//! last bit.
//!
//! A corner that one neighbour lacks would be rounded apart from the edge that runs past it (devices place corners on
//! 1/256 of a pixel), and the sky would shine through.

use crate::mesh::MeshVertex;
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// Lines of the grid each way, less one: cells are halved up to twelve times.
pub(super) const N_STEPS: u32 = 1 << 12;

/// Corners so near one another along a line are one: share of the face's extent.
const SAME: f64 = 1e-8;

/// A level face of a surface with its own axes.
#[derive(Debug)]
pub(super) struct Plane {
    /// A number of its own among the scene's faces.
    pub number: u32,
    pub origin: DVec3,
    pub right: DVec3,
    pub up: DVec3,
    pub normal: DVec3,
    /// Extent along both axes, metres.
    pub size_m: DVec2,
}

/// A rectangle of a face's grid: columns and rows from the first to before the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cell {
    pub low: [u32; 2],
    pub high: [u32; 2],
}

impl Cell {
    pub(super) const WHOLE: Self = Self { low: [0; 2], high: [N_STEPS; 2] };

    /// Its halves across the longer side; `None` where the grid ends.
    pub(super) fn halves(&self, plane: &Plane) -> Option<[Self; 2]> {
        let n = [0, 1].map(|axis| self.high[axis] - self.low[axis]);
        let side_m = [0, 1].map(|axis| f64::from(n[axis]) * plane.size_m[axis]);
        let longer = usize::from(side_m[1] > side_m[0]);
        let axis = if n[longer] > 1 { longer } else { 1 - longer };
        let middle = (n[axis] > 1).then(|| self.low[axis] + n[axis] / 2)?;
        let (mut first, mut second) = (*self, *self);
        first.high[axis] = middle;
        second.low[axis] = middle;
        Some([first, second])
    }

    /// Its corners in the world, one after the other around it.
    pub(super) fn corners_in_world(&self, plane: &Plane) -> [DVec3; 4] {
        let at = |column, row| plane.in_world(DVec2::new(plane.line(0, column), plane.line(1, row)));
        let ([left, bottom], [right, top]) = (self.low, self.high);
        [at(left, bottom), at(right, bottom), at(right, top), at(left, top)]
    }
}

impl Plane {
    /// The face that these triangles lie in, with its first axis along the first edge that has a length; `None` of
    /// triangles without an area.
    pub(super) fn of(number: u32, corners: &[MeshVertex]) -> Option<Self> {
        let normal = corners.first()?.normal.as_dvec3().try_normalize()?;
        let first = corners[0].position_in_world;
        let along = corners.iter().map(|corner| corner.position_in_world - first);
        let along = along.map(|edge| edge - normal * edge.dot(normal)).find(|edge| edge.length() > 1e-9)?;
        let right = along.normalize();
        let up = normal.cross(right);
        let places = || corners.iter().map(|corner| corner.position_in_world - first);
        let places = || places().map(|offset| DVec2::new(offset.dot(right), offset.dot(up)));
        let low = places().fold(DVec2::INFINITY, DVec2::min);
        let high = places().fold(DVec2::NEG_INFINITY, DVec2::max);
        let size_m = high - low;
        let origin = first + right * low.x + up * low.y;
        (size_m.min_element() > 0.0).then_some(Self { number, origin, right, up, normal, size_m })
    }

    fn in_plane(&self, point: DVec3) -> DVec2 {
        let offset = point - self.origin;
        DVec2::new(offset.dot(self.right), offset.dot(self.up))
    }

    fn in_world(&self, place: DVec2) -> DVec3 {
        self.origin + self.right * place.x + self.up * place.y
    }

    /// Where a line of the grid lies along its axis, metres.
    fn line(&self, axis: usize, step: u32) -> f64 {
        self.size_m[axis] * (f64::from(step) / f64::from(N_STEPS))
    }

    /// Whether a triangle covers some of a cell.
    pub(super) fn covers(&self, triangle: &[MeshVertex], cell: &Cell) -> bool {
        self.clip(&self.corners_of(triangle), cell).is_some()
    }

    fn corners_of(&self, triangle: &[MeshVertex]) -> [DVec2; 3] {
        [0, 1, 2].map(|idx| self.in_plane(triangle[idx].position_in_world))
    }

    /// What of a triangle lies in a cell: corners with the line that leads from each to the next.
    fn clip(&self, triangle: &[DVec2; 3], cell: &Cell) -> Option<Vec<(DVec2, Edge)>> {
        let mut polygon: Vec<_> = (0..3).map(|idx| (triangle[idx], Edge::Triangle(idx))).collect();
        for axis in 0..2 {
            polygon = self.beyond(&polygon, triangle, (axis, cell.low[axis]), 1.0);
            polygon = self.beyond(&polygon, triangle, (axis, cell.high[axis]), -1.0);
        }
        // Of corners in one place the last knows which line goes on from there.
        let n = polygon.len();
        let kept = (0..n).filter(|idx| polygon[*idx].0 != polygon[(idx + 1) % n].0).map(|idx| polygon[idx]);
        let polygon: Vec<_> = kept.collect();
        let origin = polygon.first()?.0;
        let doubled: f64 =
            polygon.windows(2).map(|pair| (pair[0].0 - origin).perp_dot(pair[1].0 - origin)).sum();
        (doubled > SAME * SAME * self.size_m.x * self.size_m.y).then_some(polygon)
    }

    /// What of a polygon lies beyond a line of the grid (its axis and step), or with a `sign` of -1 before it.
    fn beyond(
        &self,
        polygon: &[(DVec2, Edge)],
        triangle: &[DVec2; 3],
        (axis, step): (usize, u32),
        sign: f64,
    ) -> Vec<(DVec2, Edge)> {
        if step == 0 || step == N_STEPS {
            // Nothing lies outside, but for rounding.
            return polygon.to_vec();
        }
        let limit = self.line(axis, step);
        let is_within = |at: DVec2| (at[axis] - limit) * sign >= 0.0;
        let mut kept: Vec<(DVec2, Edge)> = Vec::with_capacity(polygon.len() + 1);
        for (idx, &(at, edge)) in polygon.iter().enumerate() {
            let next = polygon[(idx + 1) % polygon.len()].0;
            if is_within(at) {
                kept.push((at, edge));
            }
            if is_within(at) != is_within(next) {
                let leads = if is_within(at) { Edge::Side(axis, step) } else { edge };
                kept.push((self.crossing(triangle, edge, axis, limit), leads));
            }
        }
        kept
    }

    /// Where an edge crosses a line of the grid: the same to the last bit from either end, and of any part of the edge.
    fn crossing(&self, triangle: &[DVec2; 3], edge: Edge, axis: usize, limit: f64) -> DVec2 {
        let mut crossing = DVec2::splat(limit);
        crossing[1 - axis] = match edge {
            Edge::Side(other, step) => self.line(other, step),
            Edge::Triangle(idx) => {
                let (a, b) = (triangle[idx], triangle[(idx + 1) % 3]);
                let (a, b) = if (a.x, a.y) <= (b.x, b.y) { (a, b) } else { (b, a) };
                let share = ((limit - a[axis]) / (b[axis] - a[axis])).clamp(0.0, 1.0);
                a[1 - axis] + (b[1 - axis] - a[1 - axis]) * share
            }
        };
        crossing
    }
}

/// What an edge of a cut triangle lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Edge {
    /// The triangle's own edge from this corner.
    Triangle(usize),
    /// A line of the grid: the axis that it fixes, and its step.
    Side(usize, u32),
}

/// A line that neighbours share.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Line {
    /// Of a face's grid.
    Grid { plane: u32, axis: usize, step: u32 },
    /// Between two points of the world, by the bits of their coordinates, the lesser first.
    Edge([[u64; 3]; 2]),
}

/// A corner on a line: how far along, and where in the world.
type OnLine = (f64, DVec3);

/// Cuts triangles; all are put in before any is given out.
#[derive(Debug, Default)]
pub(super) struct Cutter {
    lines: BTreeMap<Line, Vec<OnLine>>,
    pieces: Vec<Piece>,
}

/// What of one triangle lies in one cell.
#[derive(Debug)]
struct Piece {
    patch: usize,
    triangle: [MeshVertex; 3],
    corners: Vec<(DVec3, LineSpan)>,
}

/// The line from a corner to the next, and where on it both lie.
type LineSpan = (Line, [f64; 2]);

impl Cutter {
    /// Puts a triangle of a face in, as far as it lies in the cell of a patch.
    pub(super) fn put(&mut self, plane: &Plane, cell: &Cell, triangle: &[MeshVertex; 3], patch: usize) {
        let in_plane = plane.corners_of(triangle);
        let Some(polygon) = plane.clip(&in_plane, cell) else { return };
        let tolerance = SAME * plane.size_m.max_element();
        let ends = |edge: Edge| match edge {
            Edge::Side(axis, step) => Line::Grid { plane: plane.number, axis, step },
            Edge::Triangle(idx) => edge_between(triangle, idx),
        };
        let along = |edge: Edge, at: DVec2| match edge {
            Edge::Side(axis, _) => at[1 - axis],
            Edge::Triangle(idx) => {
                let (a, b) = (in_plane[idx], in_plane[(idx + 1) % 3]);
                let is_turned = is_turned(triangle, idx);
                let (a, b) = if is_turned { (b, a) } else { (a, b) };
                (at - a).dot((b - a).normalize_or_zero())
            }
        };
        let n = polygon.len();
        let mut positions: Vec<DVec3> = Vec::with_capacity(n);
        for idx in 0..n {
            let (at, edge) = polygon[idx];
            let before = polygon[(idx + n - 1) % n].1;
            let corner = (0..3).find(|corner| in_plane[*corner] == at);
            let wanted =
                corner.map_or_else(|| plane.in_world(at), |corner| triangle[corner].position_in_world);
            positions.push(self.shared(
                [before, edge].map(|edge| (ends(edge), along(edge, at))),
                wanted,
                tolerance,
            ));
        }
        let corners = (0..n).map(|idx| {
            let (at, edge) = polygon[idx];
            let span = [along(edge, at), along(edge, polygon[(idx + 1) % n].0)];
            (positions[idx], (ends(edge), span))
        });
        self.pieces.push(Piece { patch, triangle: *triangle, corners: corners.collect() });
    }

    /// Where a corner of two lines lies, as whoever came first said, and noted on both.
    fn shared(&mut self, lines: [(Line, f64); 2], wanted: DVec3, tolerance: f64) -> DVec3 {
        let is_same = |along: f64| move |known: &&OnLine| (known.0 - along).abs() <= tolerance;
        let known = lines.iter().find_map(|(line, along)| self.lines.get(line)?.iter().find(is_same(*along)));
        let position = known.map_or(wanted, |(_, position)| *position);
        for (line, along) in lines {
            let on_line = self.lines.entry(line).or_default();
            if !on_line.iter().any(|known| is_same(along)(&known)) {
                on_line.push((along, position));
            }
        }
        position
    }

    /// Gives out all triangles with their patches, in the order in which they were put in.
    pub(super) fn finish(mut self, mut add: impl FnMut(usize, [MeshVertex; 3])) {
        for on_line in self.lines.values_mut() {
            on_line.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        }
        let mut outline: Vec<DVec3> = Vec::new();
        for Piece { patch, triangle, corners } in &self.pieces {
            outline.clear();
            for (position, (line, [from, to])) in corners {
                outline.push(*position);
                let on_line = self.lines.get(line).map_or(&[][..], Vec::as_slice);
                let (low, high) = (from.min(*to), from.max(*to));
                let between = on_line.iter().filter(|(along, _)| (low..=high).contains(along));
                let first = outline.len();
                outline.extend(between.map(|(_, position)| *position));
                if from > to {
                    outline[first..].reverse();
                }
            }
            outline.dedup();
            while outline.len() > 1 && outline.first() == outline.last() {
                outline.pop();
            }
            fan(triangle, &outline, &mut |corners| add(*patch, corners));
        }
    }
}

fn bits(point: DVec3) -> [u64; 3] {
    // Of zeros both are one.
    point.to_array().map(|coordinate| (coordinate + 0.0).to_bits())
}

fn is_turned(triangle: &[MeshVertex; 3], idx: usize) -> bool {
    bits(triangle[idx].position_in_world) > bits(triangle[(idx + 1) % 3].position_in_world)
}

fn edge_between(triangle: &[MeshVertex; 3], idx: usize) -> Line {
    let ends = [triangle[idx], triangle[(idx + 1) % 3]].map(|corner| bits(corner.position_in_world));
    Line::Edge(if is_turned(triangle, idx) { [ends[1], ends[0]] } else { ends })
}

/// A convex outline in triangles of which none is without an area.
fn fan(triangle: &[MeshVertex; 3], outline: &[DVec3], add: &mut dyn FnMut([MeshVertex; 3])) {
    let normal = triangle[0].normal.as_dvec3();
    let n = outline.len();
    if n < 3 {
        return;
    }
    let area = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - a).dot(normal);
    let whole: f64 = (1..n - 1).map(|idx| area(outline[0], outline[idx], outline[idx + 1])).sum();
    let is_full = |first: usize| {
        let at = |idx: usize| outline[(first + idx) % n];
        (1..n - 1).all(|idx| area(at(0), at(idx), at(idx + 1)) > 1e-9 * whole)
    };
    let mut give = |corners: [DVec3; 3]| add(corners.map(|position| within(triangle, position)));
    if let Some(first) = (0..n).find(|first| is_full(*first)) {
        let at = |idx: usize| outline[(first + idx) % n];
        (1..n - 1).for_each(|idx| give([at(0), at(idx), at(idx + 1)]));
        return;
    }
    // Every corner has a neighbour on its own line: a point within sees all edges squarely.
    let middle = outline[0] + outline.iter().map(|corner| *corner - outline[0]).sum::<DVec3>() / n as f64;
    (0..n).for_each(|idx| give([middle, outline[idx], outline[(idx + 1) % n]]));
}

/// The corner of a part of a triangle: what is linear over it follows from the areas against its corners.
pub(crate) fn within(triangle: &[MeshVertex; 3], position_in_world: DVec3) -> MeshVertex {
    let normal = triangle[0].normal.as_dvec3();
    let [a, b, c] = triangle.map(|corner| corner.position_in_world);
    let area = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - a).dot(normal);
    let whole = area(a, b, c);
    let (of_b, of_c) = (area(a, position_in_world, c) / whole, area(a, b, position_in_world) / whole);
    let [at_a, at_b, at_c] = triangle.map(|corner| corner.texture.as_dvec4());
    let texture = at_a + (at_b - at_a) * of_b + (at_c - at_a) * of_c;
    let texture = if texture.is_finite() { texture.as_vec4() } else { triangle[0].texture };
    MeshVertex { position_in_world, texture, ..triangle[0] }
}
