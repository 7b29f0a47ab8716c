//! Level polygons of ground.

use super::{Face, Met, SurfaceError, Triangle, is_near};
use crate::geometry::Ray;
use crate::geometry::bounds_tree::Bounds;
use glam::{DVec2, DVec3};

/// A level polygon of ground.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundPolygon {
    corners: Vec<DVec2>,
    height_m: f64,
}

impl GroundPolygon {
    /// A polygon with `corners` (x, y in metres, either way round, first not repeated) at height z = `height_m`.
    ///
    /// # Errors
    /// When a number is not finite or too large, there are fewer than 3 or more than 4096 corners, the area is
    /// below 1e-6 m2, or two edges cross.
    pub fn new(corners: Vec<DVec2>, height_m: f64) -> Result<Self, SurfaceError> {
        check_outline(&corners)?;
        if !is_near(height_m) {
            return Err(SurfaceError::NotFinite { field: "the height" });
        }
        Ok(Self { corners, height_m })
    }

    /// The corners in the order given.
    #[must_use]
    pub fn corners(&self) -> &[DVec2] {
        &self.corners
    }

    /// Height of the polygon, metres.
    #[must_use]
    pub const fn height_m(&self) -> f64 {
        self.height_m
    }

    /// Whether the polygon covers (x, y), by the even-odd rule.
    #[must_use]
    pub fn covers(&self, point: DVec2) -> bool {
        covers(&self.corners, point)
    }

    /// Between which shares of the way from `start` to `end`, 0 to 1, lies all of it that the polygon covers; `None` where
    /// it covers nothing of the way. What lies between the first and the last need not be covered.
    #[must_use]
    pub fn covered_part(&self, start: DVec2, end: DVec2) -> Option<(f64, f64)> {
        let way = end - start;
        let crossing = |(a, b): (DVec2, DVec2)| {
            let edge = b - a;
            // 0 along the edge, where its neighbours are crossed.
            let turn = way.perp_dot(edge);
            let (share, along_edge) = ((a - start).perp_dot(edge) / turn, (a - start).perp_dot(way) / turn);
            let is_met = (0.0..=1.0).contains(&share) && (0.0..=1.0).contains(&along_edge);
            is_met.then_some(share)
        };
        let ends = [(start, 0.0), (end, 1.0)].into_iter();
        let shares = ends.filter(|(point, _)| self.covers(*point)).map(|(_, share)| share);
        shares.chain(edges(&self.corners).filter_map(crossing)).fold(None, |part, share| {
            let (first, last) = part.unwrap_or((share, share));
            Some((first.min(share), last.max(share)))
        })
    }

    pub(super) fn hit(&self, ray: &Ray) -> Option<Met> {
        let distance_m = ray.distance_to_plane(DVec3::new(0.0, 0.0, self.height_m), DVec3::Z)?;
        if !self.covers(ray.at(distance_m).truncate()) {
            return None;
        }
        let (normal, face) =
            if ray.direction.z < 0.0 { (DVec3::Z, Face::Top) } else { (-DVec3::Z, Face::Bottom) };
        Some(Met { distance_m, normal, face, part: 0 })
    }

    pub(super) fn bounds(&self) -> Bounds {
        let corners = || self.corners.iter().map(|corner| corner.extend(self.height_m));
        (corners().fold(DVec3::INFINITY, DVec3::min), corners().fold(DVec3::NEG_INFINITY, DVec3::max))
    }

    /// The upper side.
    pub(super) fn triangles(&self, add: &mut dyn FnMut(Triangle)) {
        ears(&self.corners, &mut |ear| {
            let corners = ear.map(|corner| corner.extend(self.height_m));
            add(Triangle { corners, normal: DVec3::Z, part: 0 });
        });
    }
}

/// A polygon in triangles, each anticlockwise.
pub(super) fn ears(corners: &[DVec2], add: &mut dyn FnMut([DVec2; 3])) {
    // Relative to a corner, so that the triangulation keeps its digits at map coordinates.
    let Some(&origin) = corners.first() else { return };
    let mut indices: Vec<u32> = Vec::new();
    let local = corners.iter().map(|corner| (*corner - origin).to_array());
    earcut::Earcut::new().earcut(local, &[], &mut indices);
    let (ears, _) = indices.as_chunks::<3>();
    for ear in ears {
        let [a, mut b, mut c] = ear.map(|idx| corners[idx as usize]);
        if (b - a).perp_dot(c - a) < 0.0 {
            std::mem::swap(&mut b, &mut c);
        }
        add([a, b, c]);
    }
}

pub(super) fn edges(corners: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
}

pub(super) fn signed_area(corners: &[DVec2]) -> f64 {
    // Relative to a corner, so that polygons far from the origin keep their digits.
    let origin = corners[0];
    0.5 * edges(corners).map(|(a, b)| (a - origin).perp_dot(b - origin)).sum::<f64>()
}

fn edges_cross(corners: &[DVec2]) -> bool {
    let edges: Vec<_> = edges(corners).collect();
    let side = |a: DVec2, b: DVec2, p: DVec2| (b - a).perp_dot(p - a);
    edges.iter().enumerate().any(|(i, &(a, b))| {
        edges[i + 1..]
            .iter()
            .any(|&(c, d)| side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0)
    })
}

/// That corners are an outline: 3 to 4096 of them, within 1e8 m, with an area, no edge crossing another.
pub(super) fn check_outline(corners: &[DVec2]) -> Result<(), SurfaceError> {
    if !(3..=4096).contains(&corners.len()) {
        return Err(SurfaceError::CornerCount { count: corners.len() });
    }
    if !corners.iter().all(|corner| is_near(corner.x) && is_near(corner.y)) {
        return Err(SurfaceError::NotFinite { field: "a corner" });
    }
    if signed_area(corners).abs() < 1e-6 || edges_cross(corners) {
        return Err(SurfaceError::NoArea);
    }
    Ok(())
}

/// Whether an outline covers (x, y), by the even-odd rule.
pub(super) fn covers(corners: &[DVec2], point: DVec2) -> bool {
    let mut is_inside = false;
    for (a, b) in edges(corners) {
        if (a.y > point.y) != (b.y > point.y) {
            let crossing_x = (point.y - a.y).mul_add((b.x - a.x) / (b.y - a.y), a.x);
            is_inside ^= point.x < crossing_x;
        }
    }
    is_inside
}
