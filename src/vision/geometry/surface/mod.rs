//! A scene's static surfaces as rays meet them: one list of shapes with one interface, under one tree of boxes.
//!
//! Polygons, boxes, cylinders and footprints are met exactly; height fields and models as the triangles that they are
//! made of, without a crack between them.

mod cylinder;
mod error;
mod footprint;
mod height_field;
mod mesh;
mod oriented_box;
mod polygon;
mod shape;
mod sheet;
#[cfg(test)]
mod tests;
mod triangle;

use super::Ray;
use super::bounds_tree::{Bounds, BoundsTree, Quality};
use glam::DVec3;

pub use cylinder::Cylinder;
pub use error::SurfaceError;
pub use footprint::ExtrudedFootprint;
pub use height_field::{HeightField, MAX_POSTS};
pub use mesh::{MAX_TRIANGLES, TriangleMesh};
pub use oriented_box::OrientedBox;
pub use polygon::GroundPolygon;
pub use shape::Shape;
pub use sheet::{Sheet, SheetKind};
pub use triangle::Triangle;

/// Which surface of a scene: its kind, and its place among those of its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SurfaceId {
    /// Ground polygon by index.
    Ground(u16),
    /// Box by index.
    Box(u16),
    /// Cylinder by index.
    Cylinder(u16),
    /// Extruded footprint by index.
    Footprint(u16),
    /// Height field by index.
    HeightField(u16),
    /// Model by index.
    Model(u16),
}

impl SurfaceId {
    const KINDS: [fn(u16) -> Self; N_KINDS] =
        [Self::Ground, Self::Box, Self::Cylinder, Self::Footprint, Self::HeightField, Self::Model];

    /// The kind's place in the order above, from 0, and the index.
    #[must_use]
    pub const fn kind_and_index(self) -> (u8, u16) {
        match self {
            Self::Ground(idx) => (0, idx),
            Self::Box(idx) => (1, idx),
            Self::Cylinder(idx) => (2, idx),
            Self::Footprint(idx) => (3, idx),
            Self::HeightField(idx) => (4, idx),
            Self::Model(idx) => (5, idx),
        }
    }

    /// The inverse of [`Self::kind_and_index`]; `None` for a kind that there is not.
    #[must_use]
    pub fn from_kind_and_index(kind: u8, idx: u16) -> Option<Self> {
        Self::KINDS.get(usize::from(kind)).map(|make| make(idx))
    }
}

/// How many kinds of surfaces there are.
const N_KINDS: usize = 6;

/// Which side of a surface was met, by the slope of its normal there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Face {
    /// What one can stand on: at most 45 degrees from level, seen from above.
    Top,
    /// A wall.
    Side,
    /// The under side.
    Bottom,
}

impl Face {
    /// The side with this unit normal.
    pub(super) fn of(normal: DVec3) -> Self {
        match normal.z {
            z if z >= std::f64::consts::FRAC_1_SQRT_2 => Self::Top,
            z if z <= -std::f64::consts::FRAC_1_SQRT_2 => Self::Bottom,
            _ => Self::Side,
        }
    }
}

const FARTHEST_M: f64 = 1e8;

fn is_near(value: f64) -> bool {
    value.abs() <= FARTHEST_M
}

fn is_near_point(point: DVec3) -> bool {
    point.to_array().into_iter().all(is_near)
}

/// Where a ray meets a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    /// Along the ray, metres; above 0.
    pub distance_m: f64,
    /// As [`Hit::normal_in_world`].
    pub normal: DVec3,
    pub face: Face,
    /// As [`Hit::part`].
    pub part: u32,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, metres; above 0.
    pub distance_m: f64,
    /// The point in the world.
    pub point_in_world: DVec3,
    /// Unit normal of the surface, on the ray's side (outward, for a ray that starts in a solid).
    pub normal_in_world: DVec3,
    /// Which surface.
    pub surface: SurfaceId,
    /// Which side of it.
    pub face: Face,
    /// Which level or curved part of the surface, by a number of its own: of ground 0; of a box twice the axis of the
    /// side, and one more for the side against it; of a cylinder 0 the upper cap, 1 the lower, 2 the round; of a
    /// footprint 0 the roof, 1 the under side, then its walls; of height fields and models the triangle.
    pub part: u32,
}

impl Hit {
    /// Angle between the ray and the surface, 0 (grazing) to pi/2 (square on): Video Fields' theta.
    #[must_use]
    pub fn angle_to_surface_rad(&self, ray: &Ray) -> f64 {
        ray.direction.dot(self.normal_in_world).abs().min(1.0).asin()
    }
}

/// Up to so many parts are tried one by one: a tree would take longer.
const MOST_WITHOUT_TREE: u32 = 8;

/// All static surfaces of a scene. Immutable.
#[derive(Clone, Debug, Default)]
pub struct Surfaces {
    /// Kind by kind, in the order of [`SurfaceId`].
    shapes: Vec<Shape>,
    /// Where each kind begins, and the number of shapes.
    first_of_kind: [usize; N_KINDS + 1],
    /// How many shapes of one part come first: their parts' numbers are their own.
    n_single: u32,
    /// The first part of each shape behind those, and the number of parts.
    first_parts: Vec<u32>,
    /// Over all parts; none over few.
    tree: Option<BoundsTree>,
    /// Around each shape.
    shape_bounds: Vec<Bounds>,
    bounds: Option<[DVec3; 2]>,
    ground_bounds: Option<[DVec3; 2]>,
}

impl PartialEq for Surfaces {
    fn eq(&self, other: &Self) -> bool {
        // All else follows from them.
        self.shapes == other.shapes
    }
}

impl Surfaces {
    /// These shapes, brought into the order of [`SurfaceId`]; of one kind they keep theirs.
    ///
    /// At most 65536 of a kind and 2^30 parts can be numbered: shapes beyond are left out. Documents allow far fewer.
    #[must_use]
    pub fn new(mut shapes: Vec<Shape>) -> Self {
        shapes.sort_by_key(Shape::kind);
        let mut counts = [0_usize; N_KINDS];
        let mut n_parts = 0_u32;
        shapes.retain(|shape| {
            let count = &mut counts[shape.kind()];
            let is_countable = *count <= usize::from(u16::MAX) && n_parts + shape.n_parts() <= 1 << 30;
            if is_countable {
                *count += 1;
                n_parts += shape.n_parts();
            }
            is_countable
        });
        let mut first_of_kind = [0; N_KINDS + 1];
        for (kind, count) in counts.into_iter().enumerate() {
            first_of_kind[kind + 1] = first_of_kind[kind] + count;
        }
        let is_single = |shape: &Shape| !matches!(shape, Shape::HeightField(_) | Shape::Model(_));
        let n_single = shapes.partition_point(is_single) as u32;
        let mut first_parts = vec![n_single];
        for shape in &shapes[n_single as usize..] {
            first_parts.push(first_parts[first_parts.len() - 1] + shape.n_parts());
        }
        let shape_bounds: Vec<Bounds> = shapes.iter().map(Shape::bounds).collect();
        let around = |bounds: &[Bounds]| bounds.iter().copied().reduce(joined).map(|(low, high)| [low, high]);
        let is_ground = |shape: &Shape| matches!(shape, Shape::Ground(_) | Shape::HeightField(_));
        let ground: Vec<Bounds> = shapes
            .iter()
            .zip(&shape_bounds)
            .filter(|(shape, _)| is_ground(shape))
            .map(|(_, bounds)| *bounds)
            .collect();
        let tree = (n_parts > MOST_WITHOUT_TREE).then(|| {
            let parts =
                shapes.iter().flat_map(|shape| (0..shape.n_parts()).map(|part| shape.part_bounds(part)));
            BoundsTree::new(&parts.collect::<Vec<Bounds>>(), Quality::Lasting)
        });
        let (bounds, ground_bounds) = (around(&shape_bounds), around(&ground));
        Self { shapes, first_of_kind, n_single, first_parts, tree, shape_bounds, bounds, ground_bounds }
    }

    /// Level ground and boxes.
    #[must_use]
    pub fn of_ground_and_boxes(ground: Vec<GroundPolygon>, boxes: Vec<OrientedBox>) -> Self {
        let ground = ground.into_iter().map(Shape::Ground);
        Self::new(ground.chain(boxes.into_iter().map(Shape::Box)).collect())
    }

    /// All shapes in the order of their ids.
    #[must_use]
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// All shapes with their ids.
    pub fn named(&self) -> impl Iterator<Item = (SurfaceId, &Shape)> {
        (0..).zip(&self.shapes).map(|(idx, shape)| (self.id_of(idx), shape))
    }

    /// The boxes (low and high corner) around all shapes that can stand between two points.
    pub fn hiding_bounds(&self) -> impl Iterator<Item = [DVec3; 2]> {
        let all = self.shapes.iter().zip(&self.shape_bounds);
        all.filter(|(shape, _)| shape.hides()).map(|(_, (low, high))| [*low, *high])
    }

    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// The place of a shape in [`Self::shapes`]; `None` if there is none of this id.
    #[must_use]
    pub fn place_of(&self, surface: SurfaceId) -> Option<usize> {
        let (kind, idx) = surface.kind_and_index();
        let place = self.first_of_kind[usize::from(kind)] + usize::from(idx);
        (place < self.first_of_kind[usize::from(kind) + 1]).then_some(place)
    }

    /// The shape of this id.
    #[must_use]
    pub fn shape(&self, surface: SurfaceId) -> Option<&Shape> {
        self.place_of(surface).map(|place| &self.shapes[place])
    }

    /// The id of the shape at a place.
    fn id_of(&self, place: usize) -> SurfaceId {
        let kind = self.shapes[place].kind();
        SurfaceId::KINDS[kind]((place - self.first_of_kind[kind]) as u16)
    }

    /// The level polygons of ground.
    pub fn ground(&self) -> impl ExactSizeIterator<Item = &GroundPolygon> {
        self.shapes[..self.first_of_kind[1]].iter().map(|shape| match shape {
            Shape::Ground(polygon) => polygon,
            _ => unreachable!("shapes stand kind by kind"),
        })
    }

    /// The boxes.
    pub fn boxes(&self) -> impl ExactSizeIterator<Item = &OrientedBox> {
        self.shapes[self.first_of_kind[1]..self.first_of_kind[2]].iter().map(|shape| match shape {
            Shape::Box(solid) => solid,
            _ => unreachable!("shapes stand kind by kind"),
        })
    }

    /// How many parts all shapes have together.
    pub fn n_parts(&self) -> u32 {
        self.first_parts.last().copied().unwrap_or(0)
    }

    /// The shape to which a part belongs, and its number in that shape.
    fn place_of_part(&self, part: u32) -> (usize, u32) {
        if part < self.n_single {
            return (part as usize, 0);
        }
        let behind = self.first_parts.partition_point(|first| *first <= part) - 1;
        (self.n_single as usize + behind, part - self.first_parts[behind])
    }

    /// The box around a part, by its number among all: low and high corner.
    pub fn part_bounds(&self, part: u32) -> Bounds {
        let (place, part) = self.place_of_part(part);
        self.shapes[place].part_bounds(part)
    }

    /// Where the ray meets a part, by its number among all.
    pub fn hit_part(&self, part: u32, ray: &Ray) -> Option<(SurfaceId, Met)> {
        let (place, part) = self.place_of_part(part);
        self.shapes[place].hit_part(part, ray).map(|met| (self.id_of(place), met))
    }

    /// The nearest surface that the ray meets, further than `min_distance_m` from its start; of two at one distance the
    /// one that comes first.
    #[must_use]
    pub fn hit(&self, ray: &Ray, min_distance_m: f64) -> Option<Hit> {
        let meet = |part: u32| {
            let (place, part) = self.place_of_part(part);
            let met = self.shapes[place].hit_part(part, ray)?;
            (met.distance_m > min_distance_m).then_some((met.distance_m, (place, met)))
        };
        let (distance_m, (place, met)) = match &self.tree {
            Some(tree) => tree.nearest(ray, meet)?,
            None => (0..self.n_parts()).filter_map(meet).min_by(|(a, _), (b, _)| a.total_cmp(b))?,
        };
        Some(Hit {
            distance_m,
            point_in_world: ray.at(distance_m),
            normal_in_world: met.normal,
            surface: self.id_of(place),
            face: met.face,
            part: met.part,
        })
    }

    /// Least and greatest coordinates of the ground: level polygons and height fields, where there is neither of all
    /// surfaces; `None` without any.
    #[must_use]
    pub fn ground_bounds(&self) -> Option<[DVec3; 2]> {
        self.ground_bounds.or(self.bounds)
    }

    /// Least and greatest coordinates of all surfaces; `None` without any.
    #[must_use]
    pub const fn bounds(&self) -> Option<[DVec3; 2]> {
        self.bounds
    }

    /// Whether a point lies in a box, cylinder or footprint.
    #[must_use]
    pub fn is_within_solid(&self, point: DVec3) -> bool {
        self.shapes.iter().any(|shape| shape.contains(point))
    }

    /// Whether something stands between two points (level ground hides nothing that stands on it); the last 1 cm
    /// before `to` does not count.
    #[must_use]
    pub fn is_hidden(&self, from: DVec3, to: DVec3) -> bool {
        let Some(direction) = (to - from).try_normalize() else { return false };
        let ray = Ray { origin: from, direction };
        let limit_m = (to - from).length() - 0.01;
        let hides = |part: u32| {
            let (place, part) = self.place_of_part(part);
            let shape = &self.shapes[place];
            shape.hides() && shape.hit_part(part, &ray).is_some_and(|met| met.distance_m < limit_m)
        };
        match &self.tree {
            Some(tree) => tree.any(&ray, limit_m, hides),
            None => (0..self.n_parts()).any(hides),
        }
    }
}

/// The box around two.
fn joined((low, high): Bounds, (other_low, other_high): Bounds) -> Bounds {
    (low.min(other_low), high.max(other_high))
}
