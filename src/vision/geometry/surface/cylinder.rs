//! Upright cylinders with caps: columns, tanks, silos, trunks.

use super::{Face, Met, SurfaceError, Triangle, is_near_point};
use crate::geometry::Ray;
use crate::geometry::bounds_tree::Bounds;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// A cylinder that stands upright.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// Middle of the lower cap.
    base: DVec3,
    radius_m: f64,
    height_m: f64,
}

/// Parts of a cylinder, as [`super::Hit::part`] numbers them.
const TOP: u32 = 0;
const BOTTOM: u32 = 1;
const SIDE: u32 = 2;

/// Sides of the prism that is drawn for a cylinder: what it leaves out is 0.03 % of the radius wide, and its sides
/// differ from the round in direction by at most 1.4 degrees.
const N_SIDES: u32 = 128;

/// Shorter than this, squared, a direction's part across the ground is none: over 1e8 m it leads 1e-7 m aside.
pub(super) const UPRIGHT_SQUARED: f64 = 1e-30;

impl Cylinder {
    /// A cylinder on `base`, the middle of its lower cap.
    ///
    /// # Errors
    /// When a number is not finite or too large, or radius or height lie outside 0.001 m to 100 km.
    pub fn new(base: DVec3, radius_m: f64, height_m: f64) -> Result<Self, SurfaceError> {
        if !is_near_point(base) {
            return Err(SurfaceError::NotFinite { field: "the base" });
        }
        let is_extent = |extent: f64| (1e-3..=1e5).contains(&extent);
        if !(is_extent(radius_m) && is_extent(height_m)) {
            return Err(SurfaceError::CylinderSize);
        }
        Ok(Self { base, radius_m, height_m })
    }

    /// Middle of the lower cap in the world.
    #[must_use]
    pub const fn base(&self) -> DVec3 {
        self.base
    }

    /// Radius, metres.
    #[must_use]
    pub const fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Height, metres.
    #[must_use]
    pub const fn height_m(&self) -> f64 {
        self.height_m
    }

    /// Where the ray enters (leaves, when it starts inside), with the outward normal.
    pub(super) fn hit(&self, ray: &Ray) -> Option<Met> {
        let (mut enter, mut leave) = caps(self.base.z, self.base.z + self.height_m, ray)?;
        let (across, way) = ((ray.origin - self.base).truncate(), ray.direction.truncate());
        let squared = way.length_squared();
        if squared < UPRIGHT_SQUARED {
            if across.length_squared() > self.radius_m * self.radius_m {
                return None;
            }
        } else {
            // By the distance at which the ray passes the axis, so that nothing large is subtracted from itself.
            let passing = way.perp_dot(across) / squared.sqrt();
            let half_squared = (self.radius_m - passing) * (self.radius_m + passing) / squared;
            // So written that what is no number meets nothing.
            if half_squared.is_nan() || half_squared < 0.0 {
                return None;
            }
            let (middle, half) = (-across.dot(way) / squared, half_squared.sqrt());
            if middle - half > enter.0 {
                enter = (middle - half, SIDE);
            }
            if middle + half < leave.0 {
                leave = (middle + half, SIDE);
            }
        }
        if enter.0 > leave.0 || leave.0 <= 0.0 {
            return None;
        }
        let (distance_m, part) = if enter.0 > 0.0 { enter } else { leave };
        let outward = || (across + way * distance_m).normalize_or_zero().extend(0.0);
        let (normal, face) = match part {
            TOP => (DVec3::Z, Face::Top),
            BOTTOM => (-DVec3::Z, Face::Bottom),
            _ => (outward(), Face::Side),
        };
        distance_m.is_finite().then_some(Met { distance_m, normal, face, part })
    }

    /// Whether a point lies in the cylinder or on it.
    pub(super) fn contains(&self, point: DVec3) -> bool {
        let local = point - self.base;
        local.truncate().length() <= self.radius_m && (0.0..=self.height_m).contains(&local.z)
    }

    pub(super) fn bounds(&self) -> Bounds {
        let reach = DVec2::splat(self.radius_m);
        (self.base - reach.extend(0.0), self.base + reach.extend(self.height_m))
    }

    /// A prism whose edges lie on the cylinder.
    pub(super) fn triangles(&self, add: &mut dyn FnMut(Triangle)) {
        let spoke = |idx: u32| DVec2::from_angle(TAU * f64::from(idx % N_SIDES) / f64::from(N_SIDES));
        let at = |spoke: DVec2, height_m: f64| self.base + (spoke * self.radius_m).extend(height_m);
        for idx in 0..N_SIDES {
            let (a, b) = (spoke(idx), spoke(idx + 1));
            let quad = [at(a, 0.0), at(b, 0.0), at(b, self.height_m), at(a, self.height_m)];
            let normal = (a + b).normalize_or_zero().extend(0.0);
            for corners in [[0, 1, 2], [0, 2, 3]] {
                add(Triangle { corners: corners.map(|idx| quad[idx]), normal, part: SIDE });
            }
            let hub = |height_m: f64| at(DVec2::ZERO, height_m);
            add(Triangle { corners: [hub(self.height_m), quad[3], quad[2]], normal: DVec3::Z, part: TOP });
            add(Triangle { corners: [hub(0.0), quad[1], quad[0]], normal: -DVec3::Z, part: BOTTOM });
        }
    }
}

/// Between which distances the ray runs between two levels, each with the cap that it passes there; `None` where it
/// never does. The first may lie below 0.
pub(super) fn caps(low_z: f64, high_z: f64, ray: &Ray) -> Option<((f64, u32), (f64, u32))> {
    let (z, rise) = (ray.origin.z, ray.direction.z);
    if rise.abs() < 1e-15 {
        let is_between = (low_z..=high_z).contains(&z);
        return is_between.then_some(((f64::NEG_INFINITY, BOTTOM), (f64::INFINITY, TOP)));
    }
    let (bottom, top) = (((low_z - z) / rise, BOTTOM), ((high_z - z) / rise, TOP));
    let (enter, leave) = if rise > 0.0 { (bottom, top) } else { (top, bottom) };
    (leave.0 > 0.0).then_some((enter, leave))
}
