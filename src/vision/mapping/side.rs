//! Which level or upright side of which surface, in 32 bits: what a map keeps for each texel.
//!
//! Points may be interpolated within one side, never across an edge.

use crate::geometry::{Face, Hit, Shape, SurfaceId, Surfaces};
use glam::DVec3;

/// Bits 0 to 15: the surface's index. Of boxes bit 31 is set, of other kinds than ground bits 28 to 30 are the kind.
/// Of ground and boxes bits 16 to 18 are the side, 0 top, 1 bottom, 2 to 5 the walls; of other kinds bits 16 to 27 are
/// told from the part: its number, or of triangles what it hashes to, so that two that touch hardly share them.
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
            other => return Self::of_part(other, hit.part),
        };
        let side = match hit.face {
            Face::Top => 0,
            Face::Bottom => 1,
            Face::Side => Self::wall(surfaces, idx, hit.normal_in_world),
        };
        Self(kind | side << 16 | u32::from(idx))
    }

    fn of_part(surface: SurfaceId, part: u32) -> Self {
        let (kind, idx) = surface.kind_and_index();
        let part = match surface {
            // Knuth's multiplicative hash: neighbours in a grid or a strip are far apart.
            SurfaceId::HeightField(_) | SurfaceId::Model(_) => part.wrapping_mul(0x9e37_79b1) >> 20,
            _ => part & 0xfff,
        };
        Self(u32::from(kind) << 28 | part << 16 | u32::from(idx))
    }

    /// A box's wall by its outward normal: +x, -x, +y, -y in the box's own axes.
    fn wall(surfaces: &Surfaces, idx: u16, normal: DVec3) -> u32 {
        let Some(Shape::Box(shape)) = surfaces.shape(SurfaceId::Box(idx)) else { return 2 };
        let axis = |local: DVec3| (shape.world_from_box_point(local) - shape.center()).dot(normal);
        let (x, y) = (axis(DVec3::X), axis(DVec3::Y));
        match (x.abs() > y.abs(), x > 0.0, y > 0.0) {
            (true, true, _) => 2,
            (true, false, _) => 3,
            (false, _, true) => 4,
            (false, _, false) => 5,
        }
    }

    pub(crate) fn surface(self) -> Option<SurfaceId> {
        if self.0 == Self::NONE.0 {
            return None;
        }
        let idx = (self.0 & 0xffff) as u16;
        if self.0 & BOX != 0 {
            return Some(SurfaceId::Box(idx));
        }
        SurfaceId::from_kind_and_index((self.0 >> 28) as u8, idx)
    }

    pub(super) const fn bits(self) -> u32 {
        self.0
    }

    /// `None` for bits that no side has.
    pub(super) const fn from_bits(bits: u32) -> Option<Self> {
        let side = bits >> 16 & 0x7fff;
        let is_side = match bits >> 28 {
            0 => side < 2,
            // Boxes have a bit of their own.
            2..=5 => true,
            kind => kind & 8 != 0 && side < 6,
        };
        if bits == u32::MAX || is_side { Some(Self(bits)) } else { None }
    }
}
