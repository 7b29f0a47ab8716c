//! Outlines of buildings, drawn upwards: walls, a level roof, a level under side.

use super::cylinder::{UPRIGHT_SQUARED, caps};
use super::polygon::{check_outline, covers, ears, edges, signed_area};
use super::{Face, Met, SurfaceError, Triangle, is_near};
use crate::geometry::Ray;
use crate::geometry::bounds_tree::Bounds;
use glam::{DVec2, DVec3};

/// A polygon drawn upwards from one height to another. It is met exactly, not as triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtrudedFootprint {
    /// Anticlockwise seen from above.
    corners: Vec<DVec2>,
    base_m: f64,
    top_m: f64,
}

/// The walls' numbers follow those of roof and under side: [`super::Hit::part`].
const FIRST_WALL: u32 = 2;

impl ExtrudedFootprint {
    /// What stands on the outline `corners` (x, y in metres, either way round, first not repeated) from z = `base_m` to
    /// z = `top_m`.
    ///
    /// # Errors
    /// When a number is not finite or too large, the outline is none that a ground polygon can have, or the top lies
    /// less than 0.001 m or more than 100 km above the base.
    pub fn new(mut corners: Vec<DVec2>, base_m: f64, top_m: f64) -> Result<Self, SurfaceError> {
        check_outline(&corners)?;
        if !(is_near(base_m) && is_near(top_m)) {
            return Err(SurfaceError::NotFinite { field: "the height" });
        }
        if !(1e-3..=1e5).contains(&(top_m - base_m)) {
            return Err(SurfaceError::FootprintHeight);
        }
        if signed_area(&corners) < 0.0 {
            corners.reverse();
        }
        Ok(Self { corners, base_m, top_m })
    }

    /// The outline, anticlockwise seen from above; wall i stands on the edge from corner i to the next.
    #[must_use]
    pub fn corners(&self) -> &[DVec2] {
        &self.corners
    }

    /// Heights of the under side and the roof, metres.
    #[must_use]
    pub const fn base_and_top_m(&self) -> [f64; 2] {
        [self.base_m, self.top_m]
    }

    /// Where the ray enters (leaves, when it starts inside), with the outward normal.
    ///
    /// Whether roof or wall is met follows from the same crossings of the outline, each corner's side of the ray being
    /// computed once for both its edges' sake: no ray slips through between them.
    pub(super) fn hit(&self, ray: &Ray) -> Option<Met> {
        let (enter, leave) = caps(self.base_m, self.top_m, ray)?;
        let start_m = enter.0.max(0.0);
        let way = ray.direction.truncate();
        let (is_inside, next) = if way.length_squared() < UPRIGHT_SQUARED {
            (covers(&self.corners, ray.origin.truncate()), None)
        } else {
            self.crossings_beyond(start_m, ray)
        };
        let wall = next.map(|(distance_m, idx)| (distance_m, FIRST_WALL + idx));
        let (distance_m, part) = match (is_inside, wall) {
            (true, _) if enter.0 > 0.0 => enter,
            (true, Some(wall)) if wall.0 < leave.0 => wall,
            (true, _) => leave,
            (false, Some(wall)) if wall.0 <= leave.0 => wall,
            (false, _) => return None,
        };
        let (normal, face) = match part {
            0 => (DVec3::Z, Face::Top),
            1 => (-DVec3::Z, Face::Bottom),
            wall => (self.wall_normal((wall - FIRST_WALL) as usize), Face::Side),
        };
        (distance_m > 0.0 && distance_m.is_finite()).then_some(Met { distance_m, normal, face, part })
    }

    /// Whether the ray is over the outline at `start_m`, and where it crosses the outline next: distance, edge.
    fn crossings_beyond(&self, start_m: f64, ray: &Ray) -> (bool, Option<(f64, u32)>) {
        let (from, way) = (ray.origin.truncate(), ray.direction.truncate());
        let squared = way.length_squared();
        let (mut is_inside, mut next) = (false, None::<(f64, u32)>);
        for ((a, b), idx) in edges(&self.corners).zip(0..) {
            let (a, b) = (a - from, b - from);
            let (side_of_a, side_of_b) = (way.perp_dot(a), way.perp_dot(b));
            if (side_of_a > 0.0) == (side_of_b > 0.0) {
                continue;
            }
            let crossing = a.lerp(b, side_of_a / (side_of_a - side_of_b));
            let distance_m = crossing.dot(way) / squared;
            if distance_m > start_m {
                is_inside = !is_inside;
                if next.is_none_or(|(nearest_m, _)| distance_m < nearest_m) {
                    next = Some((distance_m, idx));
                }
            }
        }
        (is_inside, next)
    }

    fn wall_normal(&self, idx: usize) -> DVec3 {
        let along = self.corners[(idx + 1) % self.corners.len()] - self.corners[idx];
        DVec2::new(along.y, -along.x).normalize_or_zero().extend(0.0)
    }

    /// Whether a point lies within.
    pub(super) fn contains(&self, point: DVec3) -> bool {
        (self.base_m..=self.top_m).contains(&point.z) && covers(&self.corners, point.truncate())
    }

    pub(super) fn bounds(&self) -> Bounds {
        let corners = || self.corners.iter().copied();
        let low = corners().fold(DVec2::INFINITY, DVec2::min);
        let high = corners().fold(DVec2::NEG_INFINITY, DVec2::max);
        (low.extend(self.base_m), high.extend(self.top_m))
    }

    pub(super) fn triangles(&self, add: &mut dyn FnMut(Triangle)) {
        ears(&self.corners, &mut |ear| {
            let roof = ear.map(|corner| corner.extend(self.top_m));
            add(Triangle { corners: roof, normal: DVec3::Z, part: 0 });
            let [a, b, c] = ear.map(|corner| corner.extend(self.base_m));
            add(Triangle { corners: [a, c, b], normal: -DVec3::Z, part: 1 });
        });
        for ((a, b), idx) in edges(&self.corners).zip(0..) {
            let normal = self.wall_normal(idx as usize);
            let low = |corner: DVec2| corner.extend(self.base_m);
            let high = |corner: DVec2| corner.extend(self.top_m);
            for corners in [[low(a), low(b), high(b)], [low(a), high(b), high(a)]] {
                if normal != DVec3::ZERO {
                    add(Triangle { corners, normal, part: FIRST_WALL + idx });
                }
            }
        }
    }
}
