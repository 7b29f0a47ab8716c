//! One interface of all shapes.

use super::{
    Cylinder, ExtrudedFootprint, GroundPolygon, HeightField, Met, OrientedBox, Triangle, TriangleMesh,
};
use crate::geometry::Ray;
use crate::geometry::bounds_tree::Bounds;

/// A surface of a scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Level ground.
    Ground(GroundPolygon),
    /// A box.
    Box(OrientedBox),
    /// A cylinder.
    Cylinder(Cylinder),
    /// A building's outline, drawn upwards.
    Footprint(ExtrudedFootprint),
    /// Uneven ground.
    HeightField(HeightField),
    /// A model.
    Model(TriangleMesh),
}

impl Shape {
    /// How many parts rays are tried on one by one: the triangles of what is made of triangles, else 1.
    #[must_use]
    pub const fn n_parts(&self) -> u32 {
        match self {
            Self::Ground(_) | Self::Box(_) | Self::Cylinder(_) | Self::Footprint(_) => 1,
            Self::HeightField(field) => field.n_triangles(),
            Self::Model(mesh) => mesh.n_triangles(),
        }
    }

    /// The box around a part: low and high corner.
    pub(super) fn part_bounds(&self, part: u32) -> Bounds {
        match self {
            Self::Ground(polygon) => polygon.bounds(),
            Self::Box(solid) => solid.bounds(),
            Self::Cylinder(cylinder) => cylinder.bounds(),
            Self::Footprint(footprint) => footprint.bounds(),
            Self::HeightField(field) => field.part_bounds(part),
            Self::Model(mesh) => mesh.part_bounds(part),
        }
    }

    /// The box around all of it: low and high corner, metres.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let first = self.part_bounds(0);
        (1..self.n_parts()).map(|part| self.part_bounds(part)).fold(first, super::joined)
    }

    /// Where the ray meets a part.
    pub(super) fn hit_part(&self, part: u32, ray: &Ray) -> Option<Met> {
        match self {
            Self::Ground(polygon) => polygon.hit(ray),
            Self::Box(solid) => solid.hit(ray),
            Self::Cylinder(cylinder) => cylinder.hit(ray),
            Self::Footprint(footprint) => footprint.hit(ray),
            Self::HeightField(field) => field.hit_part(part, ray),
            Self::Model(mesh) => mesh.hit_part(part, ray),
        }
    }

    /// Where a ray from outside enters a shape of one part, metres along it; `None` also of a ray that starts within.
    pub fn enters(&self, ray: &Ray) -> Option<f64> {
        let met = self.hit_part(0, ray)?;
        (met.normal.dot(ray.direction) < 0.0 && !self.contains(ray.origin)).then_some(met.distance_m)
    }

    /// Whether a point lies in a solid. Models, which need not be closed, hold nothing.
    pub(super) fn contains(&self, point: glam::DVec3) -> bool {
        match self {
            Self::Box(solid) => solid.contains(point),
            Self::Cylinder(cylinder) => cylinder.contains(point),
            Self::Footprint(footprint) => footprint.contains(point),
            Self::Ground(_) | Self::HeightField(_) | Self::Model(_) => false,
        }
    }

    /// Whether it can stand between two points: level ground hides nothing that stands on it.
    #[must_use]
    pub const fn hides(&self) -> bool {
        !matches!(self, Self::Ground(_))
    }

    /// Gives the triangles that are drawn for it. Of a cylinder they are a prism within it; else they are the shape.
    pub fn triangles(&self, add: &mut dyn FnMut(Triangle)) {
        match self {
            Self::Ground(polygon) => polygon.triangles(add),
            Self::Box(solid) => solid.triangles(add),
            Self::Cylinder(cylinder) => cylinder.triangles(add),
            Self::Footprint(footprint) => footprint.triangles(add),
            Self::HeightField(field) => field.triangles(add),
            Self::Model(mesh) => mesh.add_triangles(add),
        }
    }

    /// The place of its kind in the order of [`super::SurfaceId`].
    pub(super) const fn kind(&self) -> usize {
        match self {
            Self::Ground(_) => 0,
            Self::Box(_) => 1,
            Self::Cylinder(_) => 2,
            Self::Footprint(_) => 3,
            Self::HeightField(_) => 4,
            Self::Model(_) => 5,
        }
    }
}
