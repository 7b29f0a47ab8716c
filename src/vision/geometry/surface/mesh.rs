//! Surfaces that are given as triangles: models.

use super::triangle::{distance_to, normal_of};
use super::{Face, Met, SurfaceError, Triangle, is_near_point};
use crate::geometry::Ray;
use crate::geometry::bounds_tree::Bounds;
use glam::DVec3;

/// Most triangles of a mesh.
pub const MAX_TRIANGLES: usize = 1 << 21;

/// Triangles between points.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// Triangles between `points` (metres, in the world), counter-clockwise seen from outside. Triangles without an
    /// area keep their number and are never met.
    ///
    /// # Errors
    /// When a point is not finite or too far away, a triangle names a point that is not there, none has an area, or
    /// there are more than [`MAX_TRIANGLES`].
    pub fn new(points: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self, SurfaceError> {
        let count = triangles.len();
        if count > MAX_TRIANGLES {
            return Err(SurfaceError::Triangles { count });
        }
        if !points.iter().all(|point| is_near_point(*point)) {
            return Err(SurfaceError::NotFinite { field: "a point" });
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&point) = corners.iter().find(|point| **point as usize >= points.len()) {
                return Err(SurfaceError::NoSuchPoint { triangle, point, count: points.len() });
            }
        }
        let made = Self { points, triangles };
        if (0..made.n_triangles()).all(|idx| normal_of(&made.corners(idx)).is_none()) {
            return Err(SurfaceError::Triangles { count });
        }
        Ok(made)
    }

    /// The points, metres.
    #[must_use]
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// The triangles: three indices of points each.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// How many triangles there are.
    #[must_use]
    pub const fn n_triangles(&self) -> u32 {
        self.triangles.len() as u32
    }

    fn corners(&self, idx: u32) -> [DVec3; 3] {
        self.triangles[idx as usize].map(|point| self.points[point as usize])
    }

    pub(super) fn part_bounds(&self, idx: u32) -> Bounds {
        let [a, b, c] = self.corners(idx);
        (a.min(b).min(c), a.max(b).max(c))
    }

    /// Where a ray meets a triangle; the normal is on the ray's side, as meshes need not be closed.
    pub(super) fn hit_part(&self, idx: u32, ray: &Ray) -> Option<Met> {
        let corners = self.corners(idx);
        let distance_m = distance_to(&corners, ray)?;
        let outward = normal_of(&corners)?;
        let normal = if outward.dot(ray.direction) < 0.0 { outward } else { -outward };
        Some(Met { distance_m, normal, face: Face::of(normal), part: idx })
    }

    pub(super) fn add_triangles(&self, add: &mut dyn FnMut(Triangle)) {
        for part in 0..self.n_triangles() {
            let corners = self.corners(part);
            if let Some(normal) = normal_of(&corners) {
                add(Triangle { corners, normal, part });
            }
        }
    }
}
