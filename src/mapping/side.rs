//! Which level or upright side of which surface, in 32 bits: what a map keeps for each texel.
//!
//! Points may be interpolated within one side, never across an edge.

use crate::geometry::{Face, Hit, SurfaceId, Surfaces};
use glam::DVec3;

/// Bit 31: box. Bits 16 to 18: the side, 0 top, 1 bottom, 2 to 5 the walls. Bits 0 to 15: the surface's index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Side(u32);

const BOX: u32 = 1 << 31;

impl Side {
    /// No surface.
    pub(super) const NONE: Self = Self(u32::MAX);

    pub(super) fn of(surfaces: &Surfaces, hit: &Hit) -> Self {
        let (kind, idx) = match hit.surface {
            SurfaceId::Ground(idx) => (0, idx),
            SurfaceId::Box(idx) => (BOX, idx),
        };
        let side = match hit.face {
            Face::Top => 0,
            Face::Bottom => 1,
            Face::Side => Self::wall(surfaces, idx, hit.normal_in_world),
        };
        Self(kind | side << 16 | u32::from(idx))
    }

    /// A box's wall by its outward normal: +x, -x, +y, -y in the box's own axes.
    fn wall(surfaces: &Surfaces, idx: u16, normal: DVec3) -> u32 {
        let Some(shape) = surfaces.boxes.get(usize::from(idx)) else { return 2 };
        let axis = |local: DVec3| (shape.world_from_box_point(local) - shape.center()).dot(normal);
        let (x, y) = (axis(DVec3::X), axis(DVec3::Y));
        match (x.abs() > y.abs(), x > 0.0, y > 0.0) {
            (true, true, _) => 2,
            (true, false, _) => 3,
            (false, _, true) => 4,
            (false, _, false) => 5,
        }
    }

    pub(super) const fn surface(self) -> Option<SurfaceId> {
        if self.0 == Self::NONE.0 {
            return None;
        }
        let idx = (self.0 & 0xffff) as u16;
        Some(if self.0 & BOX == 0 { SurfaceId::Ground(idx) } else { SurfaceId::Box(idx) })
    }

    pub(super) const fn bits(self) -> u32 {
        self.0
    }

    /// `None` for bits that no side has.
    pub(super) const fn from_bits(bits: u32) -> Option<Self> {
        let side = bits >> 16 & 0x7fff;
        let n_sides = if bits & BOX == 0 { 2 } else { 6 };
        if bits == u32::MAX || side < n_sides { Some(Self(bits)) } else { None }
    }
}
