//! The outline of a silhouette: closed polygons, and where a line of the picture crosses them.
//!
//! In: a mask. Out: polygons in pixels (`trace`) around what of the picture is **outside** the silhouette, and, once they are
//! brought into the camera's tangent plane, crossings with a line in time that grows with the logarithm of their length
//! ([`Outline`]). Holes are polygons as well: a place is surrounded where a line to it crosses them an odd number of times.
//!
//! What is outside, and not what is inside: a picture takes nothing away beyond its border, so the border of what it takes away is
//! both the silhouette's and its own.
//!
//! The line between two pixels of unlike kind runs half-way between their centres (marching squares of a binary picture), which
//! is the pixels' border where that is straight.

use crate::geometry::distance_to_stretch;
use glam::{DVec2, DVec3};

/// Edges of an outline beneath one leaf of its hierarchy: `LEAF_EDGES` of common/hull.wgsl.
pub const LEAF_EDGES: usize = 8;

/// The polygons around what of a mask of `width` columns is not inside, row by row, pixels; centres of pixels lie at +0.5. They end at
/// the mask's border. Pixels inside that meet at a corner alone are joined.
#[must_use]
pub(super) fn trace(width: usize, is_inside: &[bool]) -> Vec<Vec<DVec2>> {
    if width == 0 || is_inside.len() < width {
        return Vec::new();
    }
    let mut steps = Steps::of(width, is_inside).0;
    steps.sort_unstable();
    let mut is_used = vec![false; steps.len()];
    let mut polygons = Vec::new();
    for first in 0..steps.len() {
        let mut polygon = Vec::new();
        let mut at = first;
        while !std::mem::replace(&mut is_used[at], true) {
            let (from, to) = steps[at];
            polygon.push(place(width + 2, from));
            // Every crossing is left by one step and reached by one.
            at = steps.partition_point(|(known, _)| *known < to);
        }
        if polygon.len() >= 3 {
            polygons.push(straightened(&polygon));
        }
    }
    polygons
}

/// Steps of the outline from one crossing of the grid of centres to another. A crossing is told by the pixel before it (of the
/// padded picture), twice, and one more where the grid's line runs down.
struct Steps(Vec<(u32, u32)>);

impl Steps {
    fn of(width: usize, is_inside: &[bool]) -> Self {
        let height = is_inside.len() / width;
        let (columns, rows) = (width + 2, height + 2);
        // A pixel of padding, where nothing is outside.
        let is_in = |x: usize, y: usize| {
            let is_beyond = x == 0 || y == 0 || x + 1 >= columns || y + 1 >= rows;
            is_beyond || is_inside[(y - 1) * width + x - 1]
        };
        let mut steps = Vec::new();
        for y in 0..rows - 1 {
            let mut left = (is_in(0, y), is_in(0, y + 1));
            for x in 0..columns - 1 {
                let right = (is_in(x + 1, y), is_in(x + 1, y + 1));
                let corners = [left.0, right.0, right.1, left.1];
                left = right;
                let kind = corners.iter().enumerate().map(|(i, is_in)| u8::from(*is_in) << i).sum::<u8>();
                if kind == 0 || kind == 15 {
                    continue;
                }
                let at =
                    |x: usize, y: usize, is_down: bool| 2 * (y * columns + x) as u32 + u32::from(is_down);
                // Sides of the cell: above, right, below, left.
                let side = [at(x, y, false), at(x + 1, y, true), at(x, y + 1, false), at(x, y, true)];
                // With the inside on the right of each step.
                for (from, to) in steps_of(kind) {
                    steps.push((side[usize::from(*from)], side[usize::from(*to)]));
                }
            }
        }
        Self(steps)
    }
}

/// Steps through a cell from side to side, by which of its corners (upper left, upper right, lower right, lower left) are inside.
const fn steps_of(kind: u8) -> &'static [(u8, u8)] {
    match kind {
        1 => &[(0, 3)],
        2 => &[(1, 0)],
        3 => &[(1, 3)],
        4 => &[(2, 1)],
        // Two corners that face each other are joined.
        5 => &[(0, 1), (2, 3)],
        6 => &[(2, 0)],
        7 => &[(2, 3)],
        8 => &[(3, 2)],
        9 => &[(0, 2)],
        10 => &[(3, 0), (1, 2)],
        11 => &[(1, 2)],
        12 => &[(3, 1)],
        13 => &[(0, 1)],
        14 => &[(3, 0)],
        _ => &[],
    }
}

fn place(columns: usize, crossing: u32) -> DVec2 {
    let (pixel, is_down) = ((crossing / 2) as usize, crossing % 2 == 1);
    let centre = DVec2::new((pixel % columns) as f64, (pixel / columns) as f64) - 0.5;
    centre + if is_down { DVec2::new(0.0, 0.5) } else { DVec2::new(0.5, 0.0) }
}

/// Without corners that lie on the line of their neighbours.
fn straightened(polygon: &[DVec2]) -> Vec<DVec2> {
    let n = polygon.len();
    let is_corner = |i: &usize| {
        let (before, at, after) = (polygon[(i + n - 1) % n], polygon[*i], polygon[(i + 1) % n]);
        (at - before).perp_dot(after - at) != 0.0
    };
    (0..n).filter(is_corner).map(|i| polygon[i]).collect()
}

/// A closed polygon with fewer corners, nowhere further than `error_px` from those that are left out (Douglas and Peucker 1973); as
/// it is where nothing of it would be left.
#[must_use]
pub(super) fn simplified(polygon: &[DVec2], error_px: f64) -> Vec<DVec2> {
    let farthest = |from: DVec2| {
        let away = |i: &usize| polygon[*i].distance_squared(from);
        (0..polygon.len()).max_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0)
    };
    if error_px <= 0.0 || polygon.len() <= 4 {
        return polygon.to_vec();
    }
    // Two corners that surely stay: the ones that are farthest from each other.
    let first = farthest(polygon[0]);
    let mut turned = polygon.to_vec();
    turned.rotate_left(first);
    let second = (0..turned.len())
        .max_by(|a, b| {
            turned[*a].distance_squared(turned[0]).total_cmp(&turned[*b].distance_squared(turned[0]))
        })
        .unwrap_or(0);
    turned.push(turned[0]);
    let mut is_kept = vec![false; turned.len()];
    let mut open = vec![(0, second), (second, turned.len() - 1)];
    while let Some((from, to)) = open.pop() {
        (is_kept[from], is_kept[to]) = (true, true);
        let middle = (from + 1..to).map(|i| (distance_to_stretch(turned[i], [turned[from], turned[to]]), i));
        if let Some((distance, at)) = middle.max_by(|a, b| a.0.total_cmp(&b.0))
            && distance > error_px
        {
            open.extend([(from, at), (at, to)]);
        }
    }
    turned.pop();
    let kept: Vec<DVec2> = turned.iter().zip(&is_kept).filter(|(_, is)| **is).map(|(at, _)| *at).collect();
    if kept.len() >= 3 { kept } else { polygon.to_vec() }
}

/// A closed polygon with corners on its long sides: none is longer than `most_px`, so that a lens bends it as it bends the picture.
#[must_use]
pub(super) fn refined(polygon: &[DVec2], most_px: f64) -> Vec<DVec2> {
    let sides = (0..polygon.len()).map(|i| (polygon[i], polygon[(i + 1) % polygon.len()]));
    let parts = |(from, to): (DVec2, DVec2)| {
        let n = (from.distance(to) / most_px).ceil().max(1.0) as usize;
        (0..n).map(move |part| from.lerp(to, part as f64 / n as f64))
    };
    sides.flat_map(parts).collect()
}

/// Closed polygons in a camera's tangent plane (x / z, y / z), with boxes over stretches of them.
#[derive(Clone, Debug, Default)]
pub struct Outline {
    edges: Vec<[DVec2; 2]>,
    /// A full binary tree over `edges`, the root first; children of node i are 2 i + 1 and 2 i + 2.
    boxes: Vec<[DVec2; 2]>,
    n_leaves: usize,
}

impl Outline {
    pub(super) fn new(polygons: &[Vec<DVec2>]) -> Self {
        let edges: Vec<[DVec2; 2]> = polygons
            .iter()
            .flat_map(|polygon| (0..polygon.len()).map(|i| [polygon[i], polygon[(i + 1) % polygon.len()]]))
            .collect();
        let n_leaves = edges.len().div_ceil(LEAF_EDGES).max(1).next_power_of_two();
        let nothing = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        let joined = |a: [DVec2; 2], b: [DVec2; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let mut boxes = vec![nothing; 2 * n_leaves - 1];
        for (leaf, of) in edges.chunks(LEAF_EDGES).enumerate() {
            let ends = of.iter().flatten().map(|end| [*end, *end]);
            boxes[n_leaves - 1 + leaf] = ends.fold(nothing, joined);
        }
        for i in (0..n_leaves - 1).rev() {
            boxes[i] = joined(boxes[2 * i + 1], boxes[2 * i + 2]);
        }
        Self { edges, boxes, n_leaves }
    }

    /// Its edges, ends in the tangent plane; [`LEAF_EDGES`] of them a leaf of the tree, in order.
    #[must_use]
    pub fn edges(&self) -> &[[DVec2; 2]] {
        &self.edges
    }

    /// Lower and upper corners of the boxes of a full binary tree over the edges, the root first; the children of node i are
    /// 2 i + 1 and 2 i + 2, the last half are the leaves. A box around nothing is upside down and infinite.
    #[must_use]
    pub fn boxes(&self) -> &[[DVec2; 2]] {
        &self.boxes
    }

    /// Bytes of its edges and boxes.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        size_of_val(self.edges.as_slice()) + size_of_val(self.boxes.as_slice())
    }

    /// Lower and upper corner of what it surrounds; none where that is nothing.
    pub(super) fn bounds(&self) -> Option<[DVec2; 2]> {
        self.boxes.first().copied().filter(|_| !self.edges.is_empty())
    }

    /// Where the line of all places (x, y) with `line` . (x, y, 1) = 0 crosses it: places along `along`, a unit vector in the line's
    /// direction; an even number of them, in order.
    ///
    /// An edge is crossed where its ends are on different sides, those on the line itself counting to one of them: corners are
    /// crossed once or not at all, and the number is even whatever is rounded.
    pub(super) fn crossings(&self, line: DVec3, along: DVec2, found: &mut Vec<f64>) {
        found.clear();
        let mut open = [0_usize; 64];
        let mut n_open = usize::from(!self.edges.is_empty());
        while n_open > 0 {
            n_open -= 1;
            let node = open[n_open];
            if !meets(line, self.boxes[node]) {
                continue;
            }
            if node + 1 < self.n_leaves {
                open[n_open] = 2 * node + 1;
                open[n_open + 1] = 2 * node + 2;
                n_open += 2;
                continue;
            }
            let first = (node + 1 - self.n_leaves) * LEAF_EDGES;
            let last = (first + LEAF_EDGES).min(self.edges.len());
            for [from, to] in &self.edges[first.min(last)..last] {
                let [a, b] = [side(line, *from), side(line, *to)];
                if (a >= 0.0) != (b >= 0.0) {
                    found.push(along.dot(*from + (*to - *from) * (a / (a - b))));
                }
            }
        }
        found.sort_unstable_by(f64::total_cmp);
    }

    /// Whether a place is inside.
    pub(super) fn contains(&self, place: DVec2, scratch: &mut Vec<f64>) -> bool {
        self.crossings(DVec3::new(1.0, 0.0, -place.x), DVec2::Y, scratch);
        scratch.partition_point(|crossing| *crossing < place.y) % 2 == 1
    }
}

fn side(line: DVec3, at: DVec2) -> f64 {
    line.x * at.x + line.y * at.y + line.z
}

/// Whether a line meets a box.
fn meets(line: DVec3, [low, high]: [DVec2; 2]) -> bool {
    let reach =
        |at: f64, low: f64, high: f64| if at >= 0.0 { (at * low, at * high) } else { (at * high, at * low) };
    let ((x0, x1), (y0, y1)) = (reach(line.x, low.x, high.x), reach(line.y, low.y, high.y));
    // As sums are rounded: what touches counts.
    let slack = 1e-12 * (x0.abs() + x1.abs() + y0.abs() + y1.abs() + line.z.abs());
    low.x <= high.x && x0 + y0 + line.z <= slack && x1 + y1 + line.z >= -slack
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(picture: &[&str]) -> (usize, Vec<bool>) {
        (picture[0].len(), picture.iter().flat_map(|row| row.bytes().map(|at| at == b'#')).collect())
    }

    fn area(polygon: &[DVec2]) -> f64 {
        (0..polygon.len()).map(|i| polygon[i].perp_dot(polygon[(i + 1) % polygon.len()])).sum::<f64>() / 2.0
    }

    #[test]
    fn a_square_is_left_out_along_its_pixels_borders() {
        let (width, mask) = drawn(&["......", ".####.", ".####.", ".####.", "......"]);
        let polygons = trace(width, &mask);
        assert_eq!(polygons.len(), 2, "the picture's border, and the square");
        let bounds = |polygon: &[DVec2]| {
            let nothing = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            polygon.iter().fold(nothing, |(low, high), at| (low.min(*at), high.max(*at)))
        };
        assert_eq!(bounds(&polygons[0]), (DVec2::ZERO, DVec2::new(6.0, 5.0)));
        assert_eq!(bounds(&polygons[1]), (DVec2::new(1.0, 1.0), DVec2::new(5.0, 4.0)));
        // Four corners are cut by an eighth of a pixel each.
        assert!((area(&polygons[0]).abs() - 29.5).abs() < 1e-12, "{}", area(&polygons[0]));
        assert!((area(&polygons[1]).abs() - 11.5).abs() < 1e-12, "{}", area(&polygons[1]));
        assert!(polygons.iter().all(|polygon| polygon.len() == 8));
        assert!(area(&polygons[0]) * area(&polygons[1]) < 0.0);
    }

    #[test]
    fn a_hole_is_outside_and_what_touches_the_border_is_not_cut_there() {
        let (width, mask) = drawn(&["#####", "#...#", "#...#", "#####"]);
        let polygons = trace(width, &mask);
        assert_eq!(polygons.len(), 1);
        let outline = Outline::new(&polygons);
        let mut scratch = Vec::new();
        assert!(!outline.contains(DVec2::new(0.5, 0.5), &mut scratch));
        assert!(outline.contains(DVec2::new(2.5, 1.5), &mut scratch), "the hole");
        // Beyond the border nothing is taken away.
        for beyond in [DVec2::new(-0.1, 2.0), DVec2::new(-1e3, 2.0), DVec2::new(2.0, 4.1)] {
            assert!(!outline.contains(beyond, &mut scratch), "{beyond}");
        }
        let empty = Outline::new(&trace(3, &[false; 9]));
        assert!(empty.contains(DVec2::new(0.3, 0.9), &mut scratch));
        assert!(!empty.contains(DVec2::new(-0.1, 0.9), &mut scratch));
    }

    #[test]
    fn long_sides_are_parted_and_nothing_else_changes() {
        let square = [DVec2::ZERO, DVec2::X * 9.0, DVec2::splat(9.0), DVec2::Y * 9.0];
        let found = refined(&square, 3.0);
        assert_eq!(found.len(), 12);
        assert!((area(&found) - 81.0).abs() < 1e-12);
        assert_eq!(refined(&square, 100.0), square);
    }

    #[test]
    fn every_pixel_is_inside_or_outside_as_the_mask_has_it() {
        let mut state = 7_u64;
        for size in [1, 2, 5, 17, 40] {
            let mask: Vec<bool> = (0..size * size)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    state >> 40 & 3 != 0
                })
                .collect();
            let outline = Outline::new(&trace(size, &mask));
            let mut scratch = Vec::new();
            for (i, is_inside) in mask.iter().enumerate() {
                let centre = DVec2::new((i % size) as f64 + 0.5, (i / size) as f64 + 0.5);
                assert_eq!(outline.contains(centre, &mut scratch), !*is_inside, "{size} {centre}");
            }
        }
        assert!(trace(3, &[true; 9]).is_empty());
        assert!(trace(0, &[]).is_empty());
    }

    #[test]
    fn any_line_crosses_an_even_number_of_times_through_corners_too() {
        let (width, mask) =
            drawn(&[".......", "...#...", "..###..", ".#####.", "..###..", "...#...", "......."]);
        let outline = Outline::new(&trace(width, &mask));
        let mut found = Vec::new();
        for i in 0..360 {
            let normal = DVec2::from_angle(f64::from(i).to_radians());
            for offset in [0.0, 0.5, 1.0, 1.5, 2.0] {
                let line = normal.extend(-normal.dot(DVec2::splat(3.5)) + offset);
                outline.crossings(line, normal.perp(), &mut found);
                assert_eq!(found.len() % 2, 0, "{i} {offset}");
                assert!(found.is_sorted());
            }
        }
        outline.crossings(DVec3::new(0.0, 1.0, -3.5), DVec2::X, &mut found);
        assert_eq!(found, [0.0, 1.0, 6.0, 7.0]);
    }

    #[test]
    fn a_simplified_outline_stays_within_its_error_and_its_inside() {
        let (width, height) = (200, 200);
        let disc: Vec<bool> = (0..width * height)
            .map(|i| (DVec2::new((i % width) as f64, (i / width) as f64) - 99.5).length() < 80.0)
            .collect();
        let polygons = trace(width, &disc);
        let disc = &polygons[1];
        let fewer = simplified(disc, 0.75);
        assert!(fewer.len() * 4 < disc.len(), "{} of {}", fewer.len(), disc.len());
        for at in disc {
            let nearest =
                (0..fewer.len()).map(|i| distance_to_stretch(*at, [fewer[i], fewer[(i + 1) % fewer.len()]]));
            assert!(nearest.fold(f64::INFINITY, f64::min) <= 0.75 + 1e-9, "{at}");
        }
        assert_eq!(simplified(disc, 0.0), *disc);
        assert!(simplified(disc, 1e9).len() >= 3);
    }
}
