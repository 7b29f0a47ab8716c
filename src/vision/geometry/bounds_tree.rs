//! Which of many solids a ray may meet: a tree of boxes over them.
//!
//! The tree (`obvhs`) works in f32 and only chooses candidates; whether and where one is met is the caller's f64
//! answer, so what is found is what trying every solid finds, to the last bit. That holds because boxes are padded by
//! more than everything f32 can round: rays enter relative to the middle of all boxes and at their edge, so no number
//! in the tree exceeds their diagonal. Knows boxes and rays; knows nothing of what is in the boxes.

use super::Ray;
use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use obvhs::ray::{Ray as TreeRay, RayHit};

/// Low and high corner of a box along the world's axes, metres.
pub type Bounds = (DVec3, DVec3);

/// Padding of boxes relative to the diagonal of all: 32 roundings of f32. A ray's start, direction, reciprocal and
/// product with it round once each, a box's corner once, and directions below f32's epsilon are taken as that.
const PADDING: f64 = 32.0 / (1 << 24) as f64;
/// Padding for what f64 itself rounds, relative to the largest coordinate.
const PADDING_FAR: f64 = 64.0 * f64::EPSILON;
/// What is longer than this stands apart from the tree and is always tried, so that a meadow to the horizon does not
/// widen the padding of everything that stands on it, metres.
const LARGE_M: f64 = 2e4;

/// How much time goes into a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// Cast through for long: built with care.
    Lasting,
    /// Cast through for one frame.
    Passing,
}

/// A tree of boxes over solids that are numbered from 0.
#[derive(Clone)]
pub struct BoundsTree {
    tree: Bvh2,
    /// Middle and padded half extents of all boxes in the tree.
    center: DVec3,
    half_size: DVec3,
    padding_m: f64,
    large: Vec<u32>,
}

impl std::fmt::Debug for BoundsTree {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let n_solids = self.tree.primitive_indices.len() + self.large.len();
        formatter.debug_struct("BoundsTree").field("n_solids", &n_solids).finish_non_exhaustive()
    }
}

/// A ray as the tree sees it.
struct Entering {
    ray: TreeRay,
    /// How far along the ray it enters the tree's bounds, metres.
    from_m: f64,
    padding_m: f64,
}

impl Entering {
    /// A limit for the tree that is not below `distance_m` along the ray.
    fn limit(&self, distance_m: f64) -> f32 {
        ((distance_m - self.from_m) * (1.0 + 1e-6) + self.padding_m) as f32
    }
}

impl BoundsTree {
    /// The tree over solids with these bounds, by their numbers.
    pub fn new(bounds: &[Bounds], quality: Quality) -> Self {
        let is_large = |(low, high): &Bounds| (*high - *low).max_element() > LARGE_M;
        let numbered = || (0_u32..).zip(bounds);
        let large = numbered().filter(|(_, bounds)| is_large(bounds)).map(|(idx, _)| idx).collect();
        let small: Vec<u32> =
            numbered().filter(|(_, bounds)| !is_large(bounds)).map(|(idx, _)| idx).collect();
        let (low, high) = small
            .iter()
            .map(|idx| bounds[*idx as usize])
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), (a, b)| (low.min(a), high.max(b)));
        if small.is_empty() {
            let tree = Bvh2::default();
            return Self { tree, center: DVec3::ZERO, half_size: DVec3::ZERO, padding_m: 0.0, large };
        }
        let center = (low + high) * 0.5;
        let farthest = low.abs().max(high.abs()).max_element();
        let padding_m = (high - low).length() * PADDING + farthest * PADDING_FAR + 1e-9;
        let boxes: Vec<Aabb> = small
            .iter()
            .map(|idx| {
                let (low, high) = bounds[*idx as usize];
                let corner = |corner: DVec3| Vec3A::from((corner - center).as_vec3());
                Aabb::new(corner(low - padding_m), corner(high + padding_m))
            })
            .collect();
        let mut tree = build(&boxes, quality);
        for idx in &mut tree.primitive_indices {
            *idx = small[*idx as usize];
        }
        // Twice the padding, so that the padded boxes' own rounding lies within.
        let half_size = (high - low) * 0.5 + 2.0 * padding_m;
        Self { tree, center, half_size, padding_m, large }
    }

    /// The nearest solid that the ray meets and what `meet` says of it; of two at one distance the one with the
    /// lower number. `meet` gets a solid's number and gives the distance, metres, above 0, with whatever belongs to
    /// it.
    pub fn nearest<T>(&self, ray: &Ray, meet: impl Fn(u32) -> Option<(f64, T)>) -> Option<(f64, T)> {
        let mut best: Option<(f64, u32, T)> = None;
        let mut try_solid = |idx: u32| {
            let (distance, met) = meet(idx)?;
            let is_nearer = best.as_ref().is_none_or(|(best_distance, best_idx, _)| {
                distance < *best_distance || (distance == *best_distance && idx < *best_idx)
            });
            is_nearer.then(|| {
                best = Some((distance, idx, met));
                distance
            })
        };
        let mut limit_m = f64::INFINITY;
        for idx in &self.large {
            limit_m = try_solid(*idx).unwrap_or(limit_m);
        }
        if let Some(entering) = self.enter(ray, limit_m) {
            self.tree.ray_traverse(entering.ray, &mut RayHit::none(), |_, leaf| {
                try_solid(self.tree.primitive_indices[leaf])
                    .map_or(f32::INFINITY, |distance| entering.limit(distance))
            });
        }
        best.map(|(distance, _, met)| (distance, met))
    }

    /// Whether the ray meets any solid for which `is_met`, which must be no further than `max_distance_m`.
    pub fn any(&self, ray: &Ray, max_distance_m: f64, is_met: impl Fn(u32) -> bool) -> bool {
        if self.large.iter().any(|idx| is_met(*idx)) {
            return true;
        }
        let Some(entering) = self.enter(ray, max_distance_m) else { return false };
        !self.tree.ray_traverse_miss(entering.ray, |_, leaf| {
            if is_met(self.tree.primitive_indices[leaf]) { f32::NEG_INFINITY } else { f32::INFINITY }
        })
    }

    /// The ray from where it enters the tree's bounds, or `None` if it passes them or enters beyond the limit.
    fn enter(&self, ray: &Ray, max_distance_m: f64) -> Option<Entering> {
        let origin = ray.origin - self.center;
        // [0, inf) cut by the three slabs. A direction of 0 gives infinities of the right sign; where the start lies
        // on a slab's face as well it gives a NaN and may miss, but nothing stands that near the bounds.
        let (to_low, to_high) =
            ((-self.half_size - origin) / ray.direction, (self.half_size - origin) / ray.direction);
        let from_m = to_low.min(to_high).to_array().into_iter().fold(0.0, f64::max);
        let to_m = to_low.max(to_high).to_array().into_iter().fold(f64::INFINITY, f64::min);
        // What the quotients round: less than the padding, by which the bounds are wider than needed.
        let is_met = self.half_size.x > 0.0 && from_m <= to_m && from_m <= max_distance_m;
        let start = origin + ray.direction * from_m;
        if !is_met || !start.is_finite() || !ray.direction.is_finite() {
            return None;
        }
        let vector = |v: DVec3| Vec3A::from(v.as_vec3());
        let mut entering = Entering {
            ray: TreeRay::new(vector(start), vector(ray.direction), 0.0, f32::INFINITY),
            from_m,
            padding_m: self.padding_m,
        };
        entering.ray.tmax = entering.limit(max_distance_m);
        Some(entering)
    }
}

/// The tree over boxes; every box of the result's `primitive_indices` is a place in `boxes`.
fn build(boxes: &[Aabb], quality: Quality) -> Bvh2 {
    let indices = (0..).take(boxes.len()).collect();
    let mut builder = PlocBuilder::with_capacity(boxes.len());
    match quality {
        Quality::Lasting => {
            let mut tree = builder.build(PlocSearchDistance::Medium, boxes, indices, SortPrecision::U64, 3);
            let mut optimizer = ReinsertionOptimizer::default();
            optimizer.run(&mut tree, 0.05, None);
            // Meeting a solid costs as much as about three boxes.
            collapse(&mut tree, 4, 1.0);
            optimizer.run(&mut tree, 0.1, None);
            tree
        }
        Quality::Passing => builder.build(PlocSearchDistance::Minimum, boxes, indices, SortPrecision::U64, 0),
    }
}
