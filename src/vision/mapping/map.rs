//! The map itself: for every texel what it shows, and how a place between texel centres is read from it.

use super::side::Side;
use super::{Builder, Location, RELIABLE_THETA_RAD};
use glam::{DVec2, DVec3, Vec3};

/// Where every texel of a picture lies in the world. Immutable.
///
/// **Shape**: width x height texels, row-major from the top left. **Units and space**: points are f32 offsets in
/// metres from the camera's position (f64), so that a scene far from its origin keeps its digits.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldMap {
    pub(super) size_px: (u32, u32),
    pub(super) origin_in_world: DVec3,
    pub(super) builder: Builder,
    pub(super) coverage: Coverage,
    pub(super) texels: Vec<Texel>,
}

/// What share of a map's texels has an entry, 0 to 1 each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coverage {
    /// Entries that the builder found itself: by a ray, or by a grid point in the texel.
    pub direct: f64,
    /// Entries interpolated from texels around.
    pub interpolated: f64,
}

/// One texel's entry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Texel {
    /// From the map's origin, metres.
    pub(super) offset: Vec3,
    pub(super) theta_rad: f32,
    pub(super) footprint_m: f32,
    pub(super) side: Side,
}

impl Texel {
    pub(super) const NONE: Self =
        Self { offset: Vec3::ZERO, theta_rad: 0.0, footprint_m: 0.0, side: Side::NONE };

    pub(super) fn new(location: &Location, origin: DVec3, side: Side) -> Self {
        Self {
            offset: (location.point_in_world - origin).as_vec3(),
            theta_rad: location.theta_rad as f32,
            footprint_m: location.footprint_m as f32,
            side,
        }
    }
}

impl WorldMap {
    /// Columns and rows.
    #[must_use]
    pub const fn size_px(&self) -> (u32, u32) {
        self.size_px
    }

    /// Bytes that its texels take.
    #[must_use]
    pub const fn len_bytes(&self) -> usize {
        self.texels.len() * size_of::<Texel>()
    }

    /// What it was made by.
    #[must_use]
    pub const fn builder(&self) -> Builder {
        self.builder
    }

    /// What share of the texels has an entry.
    #[must_use]
    pub const fn coverage(&self) -> Coverage {
        self.coverage
    }

    /// The entry of one texel; `None` outside the map, above the horizon and where no surface is.
    #[must_use]
    pub fn texel(&self, column: u32, row: u32) -> Option<Location> {
        let (width, height) = self.size_px;
        if column >= width || row >= height {
            return None;
        }
        self.location(&self.texels[row as usize * width as usize + column as usize])
    }

    /// Where a texture coordinate lies: interpolated between the four texel centres around it where they lie on one
    /// side of one surface, else the entry of the texel that it lies in.
    ///
    /// `None` outside [0, 1]^2 and where that texel has no entry.
    #[must_use]
    pub fn locate(&self, texture: DVec2) -> Option<Location> {
        if !(texture.cmpge(DVec2::ZERO).all() && texture.cmple(DVec2::ONE).all()) {
            return None;
        }
        let (width, height) = self.size_px;
        let size = DVec2::new(f64::from(width), f64::from(height));
        let own = (texture * size).floor().min(size - 1.0);
        let own = self.texel(own.x as u32, own.y as u32)?;
        Some(self.interpolated(texture * size - 0.5).unwrap_or(own))
    }

    /// How far the entry of a texel may lie from what its centre truly shows, metres along the surface, if it is
    /// reliable: for the grid the larger of step / sqrt 2 and the texel's footprint; for rays what f32 rounds away.
    #[must_use]
    pub fn error_bound_m(&self, location: &Location) -> f64 {
        match self.builder {
            Builder::Ray => {
                (location.point_in_world - self.origin_in_world).length() * f64::from(f32::EPSILON)
            }
            Builder::Grid(settings) => (settings.step_m / std::f64::consts::SQRT_2).max(location.footprint_m),
        }
    }

    fn location(&self, texel: &Texel) -> Option<Location> {
        let surface = texel.side.surface()?;
        let theta_rad = f64::from(texel.theta_rad);
        Some(Location {
            point_in_world: self.origin_in_world + texel.offset.as_dvec3(),
            theta_rad,
            surface,
            is_reliable: theta_rad >= RELIABLE_THETA_RAD,
            footprint_m: f64::from(texel.footprint_m),
        })
    }

    /// `place` in texels, 0 at the first one's centre. Beyond the outermost centres the outermost four are
    /// carried on.
    fn interpolated(&self, place: DVec2) -> Option<Location> {
        let (width, height) = self.size_px;
        if width < 2 || height < 2 {
            return None;
        }
        let last = DVec2::new(f64::from(width - 2), f64::from(height - 2));
        let corner = place.floor().clamp(DVec2::ZERO, last);
        let part = place - corner;
        let first = corner.y as usize * width as usize + corner.x as usize;
        let below = first + width as usize;
        let corners = [first, first + 1, below, below + 1].map(|idx| &self.texels[idx]);
        let side = corners[0].side;
        if side == Side::NONE || corners.iter().any(|texel| texel.side != side) {
            return None;
        }
        let (u, v) = (part.x, part.y);
        let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        let offset = blend(corners.map(|texel| texel.offset.as_dvec3()).into_iter().zip(weights))?;
        let theta_rad: f64 =
            corners.iter().zip(weights).map(|(texel, weight)| f64::from(texel.theta_rad) * weight).sum();
        let theta_rad = theta_rad.clamp(0.0, std::f64::consts::FRAC_PI_2);
        let largest = corners.iter().map(|texel| texel.footprint_m).fold(0.0, f32::max);
        Some(Location {
            point_in_world: self.origin_in_world + offset,
            theta_rad,
            surface: side.surface()?,
            is_reliable: theta_rad >= RELIABLE_THETA_RAD,
            footprint_m: f64::from(largest),
        })
    }
}

/// The point between offsets from the camera, with weights of the picture that sum to 1.
///
/// On a plane 1/d is linear in the ray's direction (d the distance), so both 1/d and offset/d, the direction, are
/// interpolated and divided: exact on a plane as far as the direction is linear in the picture, where
/// interpolating the points themselves is wrong by the perspective (Video Fields figure 6a). `None` where the
/// weights reach beyond the plane's horizon.
pub(super) fn blend(parts: impl Iterator<Item = (DVec3, f64)>) -> Option<DVec3> {
    let mut direction = DVec3::ZERO;
    let mut inverse_distance = 0.0;
    for (offset, weight) in parts {
        let inverse = offset.length().recip();
        direction += offset * (inverse * weight);
        inverse_distance += inverse * weight;
    }
    let point = direction / inverse_distance;
    (inverse_distance > 0.0 && point.is_finite()).then_some(point)
}
