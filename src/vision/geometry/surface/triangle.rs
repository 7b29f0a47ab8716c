//! Where rays meet triangles.
//!
//! `[WBW13]` Woop, Benthin, Wald 2013, Watertight Ray/Triangle Intersection, JCGT 2(1).

use crate::geometry::Ray;
use glam::DVec3;

/// A triangle of a surface, counter-clockwise seen from outside or above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Its corners in the world, metres.
    pub corners: [DVec3; 3],
    /// Unit vector, outwards or upwards.
    pub normal: DVec3,
    /// Which part of its surface it belongs to, as [`super::Hit::part`].
    pub part: u32,
}

/// How long the cross product of two edges must be, relative to the longest edge's square, for them to span a
/// triangle: below, its normal is what rounding made.
const LEAST_SINE: f64 = 1e-12;

/// Unit normal of a triangle, on the side from which it is counter-clockwise; `None` of one without an area.
pub(super) fn normal_of([a, b, c]: &[DVec3; 3]) -> Option<DVec3> {
    let cross = (*b - *a).cross(*c - *a);
    let longest = (*b - *a).length_squared().max((*c - *a).length_squared()).max((*c - *b).length_squared());
    if cross.length() > LEAST_SINE * longest { cross.try_normalize() } else { None }
}

/// Distance along the ray to a triangle, metres, above 0, after `[WBW13]` in f64: a ray through an edge that two
/// triangles share meets at least one of them.
pub(super) fn distance_to(corners: &[DVec3; 3], ray: &Ray) -> Option<f64> {
    let size = ray.direction.abs();
    // The ray's main axis becomes z, the others follow in a right-handed turn.
    let z = if size.x > size.y && size.x > size.z {
        0
    } else if size.y > size.z {
        1
    } else {
        2
    };
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    let along = 1.0 / ray.direction[z];
    let (shear_x, shear_y) = (ray.direction[x] * along, ray.direction[y] * along);
    let [a, b, c] = corners.map(|corner| {
        let local = corner - ray.origin;
        DVec3::new(local[x] - shear_x * local[z], local[y] - shear_y * local[z], local[z])
    });
    let weights = DVec3::new(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
    let is_outside = weights.min_element() < 0.0 && weights.max_element() > 0.0;
    let total = weights.element_sum();
    if is_outside || total == 0.0 {
        return None;
    }
    let distance = weights.dot(DVec3::new(a.z, b.z, c.z)) * along / total;
    (distance > 0.0 && distance.is_finite()).then_some(distance)
}
