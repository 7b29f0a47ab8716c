//! Boxes that stand upright.

use super::{Face, Met, SurfaceError, Triangle, is_near_point};
use crate::geometry::Ray;
use crate::geometry::bounds_tree::Bounds;
use glam::{DMat2, DVec3};

/// A box that stands upright, turned about the vertical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    center: DVec3,
    half_size: DVec3,
    world_from_box: DMat2,
}

impl OrientedBox {
    /// A box around `center` with full extents `size_m` along its own x, y and z, turned by `yaw_rad` (from
    /// east towards north).
    ///
    /// # Errors
    /// When a number is not finite or a size lies outside 0.001 m to 100 km.
    pub fn new(center: DVec3, size_m: DVec3, yaw_rad: f64) -> Result<Self, SurfaceError> {
        if !is_near_point(center) {
            return Err(SurfaceError::NotFinite { field: "the center" });
        }
        if !yaw_rad.is_finite() {
            return Err(SurfaceError::NotFinite { field: "the yaw" });
        }
        if !(size_m.is_finite() && size_m.min_element() >= 1e-3 && size_m.max_element() <= 1e5) {
            return Err(SurfaceError::BoxSize);
        }
        Ok(Self { center, half_size: size_m * 0.5, world_from_box: DMat2::from_angle(yaw_rad) })
    }

    /// The middle of the box in the world.
    #[must_use]
    pub const fn center(&self) -> DVec3 {
        self.center
    }

    /// Half the extents along the box's own axes, metres.
    #[must_use]
    pub const fn half_size(&self) -> DVec3 {
        self.half_size
    }

    /// A point given in the box's own axes (from its middle) in the world.
    #[must_use]
    pub fn world_from_box_point(&self, point: DVec3) -> DVec3 {
        (self.world_from_box * point.truncate()).extend(point.z) + self.center
    }

    fn box_from_world_direction(&self, direction: DVec3) -> DVec3 {
        (self.world_from_box.transpose() * direction.truncate()).extend(direction.z)
    }

    /// Where the ray enters the box (leaves it, when it starts inside): distance, outward normal, face.
    pub(super) fn hit(&self, ray: &Ray) -> Option<Met> {
        let origin = self.box_from_world_direction(ray.origin - self.center);
        let direction = self.box_from_world_direction(ray.direction);
        let (mut enter, mut enter_axis) = (f64::NEG_INFINITY, 0);
        let (mut leave, mut leave_axis) = (f64::INFINITY, 0);
        for axis in 0..3 {
            let (o, d, h) = (origin[axis], direction[axis], self.half_size[axis]);
            if d.abs() < 1e-15 {
                if o.abs() > h {
                    return None;
                }
                continue;
            }
            let (t0, t1) = ((-h - o) / d, (h - o) / d);
            let (near, far) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
            if near > enter {
                (enter, enter_axis) = (near, axis);
            }
            if far < leave {
                (leave, leave_axis) = (far, axis);
            }
        }
        if enter > leave || leave <= 0.0 {
            return None;
        }
        let (distance_m, axis, sign) =
            if enter > 0.0 { (enter, enter_axis, -1.0) } else { (leave, leave_axis, 1.0) };
        let mut normal = DVec3::ZERO;
        normal[axis] = sign * direction[axis].signum();
        let face = match (axis, normal.z > 0.0) {
            (2, true) => Face::Top,
            (2, false) => Face::Bottom,
            _ => Face::Side,
        };
        let part = 2 * axis as u32 + u32::from(normal[axis] < 0.0);
        let normal = (self.world_from_box * normal.truncate()).extend(normal.z);
        distance_m.is_finite().then_some(Met { distance_m, normal, face, part })
    }

    /// Whether a point lies in the box or on it.
    pub(super) fn contains(&self, point: DVec3) -> bool {
        self.box_from_world_direction(point - self.center).abs().cmple(self.half_size).all()
    }

    pub(super) fn bounds(&self) -> Bounds {
        let axis = |axis: DVec3| self.world_from_box_point(axis) - self.center;
        let axes = DVec3::AXES.map(|unit| axis(unit * self.half_size));
        let reach = axes.into_iter().map(DVec3::abs).sum::<DVec3>();
        (self.center - reach, self.center + reach)
    }

    /// Its six sides, numbered as `hit` numbers them: 2 an axis, the one towards it first.
    pub(super) fn triangles(&self, add: &mut dyn FnMut(Triangle)) {
        for axis in 0..3 {
            for (side, part) in [(-1.0, 2 * axis as u32 + 1), (1.0, 2 * axis as u32)] {
                let mut outward = DVec3::ZERO;
                outward[axis] = side;
                // Two directions along the face whose cross product points outwards.
                let mut along = DVec3::ZERO;
                along[(axis + 1) % 3] = 1.0;
                let across = outward.cross(along);
                let corner = |u: f64, v: f64| {
                    self.world_from_box_point((outward + along * u + across * v) * self.half_size)
                };
                let normal = (self.world_from_box * outward.truncate()).extend(outward.z);
                let quad = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
                for corners in [[0, 1, 2], [0, 2, 3]] {
                    add(Triangle { corners: corners.map(|idx| quad[idx]), normal, part });
                }
            }
        }
    }
}
