//! From texture to world: which point of which surface a camera's texel shows.
//!
//! Video Fields (Du, Bista, Varshney 2016) eq. 8, H: t -> p, over the ground and every other surface. In: a
//! [`Camera`] and [`Surfaces`]. Out: [`locate`] for one texture coordinate, exactly; or a [`WorldMap`] for all
//! texels of a picture, made by either [`Builder`], with a [`digest()`] of everything it was made from, and bytes to
//! store it. Knows no frames, no database and no entities; heights never come from here alone, as what stands
//! upright usually ends above the horizon.

mod codec;
mod digest;
mod grid;
mod map;
mod ray;
mod side;

use crate::error::ErrorKind;
use crate::geometry::{Camera, Hit, Ray, SurfaceId, Surfaces};
use glam::{DVec2, DVec3};

pub use digest::digest;
pub use grid::{GridSettings, MAX_GRID_POINTS};
pub use map::{Coverage, WorldMap};

/// Angle between ray and surface below which a place is marked unreliable: half a degree, radians. There a tenth of
/// a pixel moves it by more than a hundredth of its distance.
pub const RELIABLE_THETA_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// Most texels of a map: a picture of 3840 x 2160 and a little more. A texel takes 24 bytes.
pub const MAX_TEXELS: u64 = 1 << 23;

/// Most columns or rows of a map.
pub const MAX_SIDE_PX: u32 = 1 << 14;

/// Where a texture coordinate lies in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Location {
    /// The point on the surface.
    pub point_in_world: DVec3,
    /// Angle between the ray and the surface, 0 (grazing) to pi/2 (square on).
    pub theta_rad: f64,
    /// Which surface.
    pub surface: SurfaceId,
    /// Whether the ray meets the surface steeply enough, [`RELIABLE_THETA_RAD`], for the point to be trusted.
    pub is_reliable: bool,
    /// The longest extent on the surface of one texel around here, metres: of the map's texels in a
    /// [`WorldMap`], of the calibrated picture's in [`locate`]. Infinite where the lens shows nothing beside it.
    pub footprint_m: f64,
}

/// How a map is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Builder {
    /// Casts every texel's ray: exact at the texels' centres.
    Ray,
    /// Projects a dense grid of surface points and keeps the nearest to each texel's centre, as the paper does.
    Grid(GridSettings),
}

/// Why there is no map.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MappingError {
    /// No texels, or too many.
    #[error(
        "a map has 1 to {MAX_SIDE_PX} columns and rows, at most {MAX_TEXELS} texels, got {width} x {height}"
    )]
    Size {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The grid's step is no length.
    #[error("the grid's step must lie in 0.001 m to 1000 m")]
    Step,
    /// The grid would have too many points.
    #[error("the grid would have {count} points, at most {MAX_GRID_POINTS} are allowed; widen its step")]
    GridPoints {
        /// How many.
        count: u64,
    },
    /// Stored bytes that are no map.
    #[error("the stored map is unusable, {what}")]
    Corrupt {
        /// What is wrong with them.
        what: &'static str,
    },
    /// The compressor failed.
    #[error("the map could not be compressed, {message}")]
    Compression {
        /// Its own words.
        message: String,
    },
}

impl MappingError {
    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Size { .. } | Self::GridPoints { .. } => ErrorKind::TooLarge,
            Self::Step => ErrorKind::Invalid,
            Self::Corrupt { .. } | Self::Compression { .. } => ErrorKind::Internal,
        }
    }
}

impl Builder {
    /// The map of `camera`'s picture, divided into `size_px` texels (columns, rows; any size, as texture
    /// coordinates are relative), onto `surfaces`.
    ///
    /// **Cost**: a ray against every surface for each texel or grid point, over all cores; 24 bytes a texel, while
    /// the grid is built 64.
    ///
    /// # Errors
    /// When the size or the grid is absurd.
    pub fn build(
        self,
        camera: &Camera,
        surfaces: &Surfaces,
        size_px: (u32, u32),
    ) -> Result<WorldMap, MappingError> {
        check_size(size_px)?;
        match self {
            Self::Ray => Ok(ray::build(camera, surfaces, size_px)),
            Self::Grid(settings) => grid::build(settings, camera, surfaces, size_px),
        }
    }
}

fn check_size((width, height): (u32, u32)) -> Result<(), MappingError> {
    let are_sides_sound = [width, height].into_iter().all(|side| (1..=MAX_SIDE_PX).contains(&side));
    if are_sides_sound && u64::from(width) * u64::from(height) <= MAX_TEXELS {
        return Ok(());
    }
    Err(MappingError::Size { width, height })
}

/// Where a texture coordinate lies in the world, by its own ray: exact.
///
/// `None` outside [0, 1]^2, where the lens shows nothing, and where the ray meets no surface (above the horizon,
/// beside the ground).
#[must_use]
pub fn locate(camera: &Camera, surfaces: &Surfaces, texture: DVec2) -> Option<Location> {
    let (width, height) = camera.size_px();
    let texel = DVec2::new(f64::from(width), f64::from(height)).recip();
    locate_hit(camera, surfaces, texture, texel).map(|(location, _)| location)
}

/// Where a texture coordinate lies in the world, by its own ray, metres, where that can be trusted: as
/// [`Location::point_in_world`] of what [`locate`] answers, if it is reliable. A fifth of the cost.
#[must_use]
pub fn place(camera: &Camera, surfaces: &Surfaces, texture: DVec2) -> Option<DVec3> {
    let (ray, hit) = meet(camera, surfaces, texture)?;
    let is_reliable = hit.angle_to_surface_rad(&ray) >= RELIABLE_THETA_RAD;
    (is_reliable && hit.point_in_world.is_finite()).then_some(hit.point_in_world)
}

/// The ray of a texture coordinate, and what it hits.
fn meet(camera: &Camera, surfaces: &Surfaces, texture: DVec2) -> Option<(Ray, Hit)> {
    if !(texture.cmpge(DVec2::ZERO).all() && texture.cmple(DVec2::ONE).all()) {
        return None;
    }
    let ray = camera.ray(texture)?;
    let hit = surfaces.hit(&ray, 0.0)?;
    Some((ray, hit))
}

/// As [`locate`], with the footprint of a texel of the given size in texture coordinates, and what was hit.
fn locate_hit(camera: &Camera, surfaces: &Surfaces, texture: DVec2, texel: DVec2) -> Option<(Location, Hit)> {
    let (ray, hit) = meet(camera, surfaces, texture)?;
    let theta_rad = hit.angle_to_surface_rad(&ray);
    let location = Location {
        point_in_world: hit.point_in_world,
        theta_rad,
        surface: hit.surface,
        is_reliable: theta_rad >= RELIABLE_THETA_RAD,
        footprint_m: footprint_m(camera, &ray, hit.normal_in_world, hit.distance_m, texture, texel),
    };
    Some((location, hit))
}

/// The longer axis of the ellipse that a texel's inscribed circle covers on the plane that `ray` meets at
/// `distance_m`, as long as a texel: its size as the picture's scale there has it, not cut by the surface's edge.
fn footprint_m(
    camera: &Camera,
    ray: &Ray,
    normal: DVec3,
    distance_m: f64,
    texture: DVec2,
    texel: DVec2,
) -> f64 {
    let approach = ray.direction.dot(normal);
    let along = |axis: DVec2| {
        // One-sided where the lens ends.
        let step = axis * texel * 0.25;
        let sides = (camera.ray(texture + step), camera.ray(texture - step));
        let turn = match sides {
            (Some(after), Some(before)) => (after.direction - before.direction) * 2.0,
            (Some(after), None) => (after.direction - ray.direction) * 4.0,
            (None, Some(before)) => (ray.direction - before.direction) * 4.0,
            (None, None) => return None,
        };
        // The derivative of the point in which the turning ray meets the plane.
        Some((turn - ray.direction * (turn.dot(normal) / approach)) * distance_m)
    };
    let (Some(across), Some(down)) = (along(DVec2::X), along(DVec2::Y)) else { return f64::INFINITY };
    // The larger singular value of [across, down], from its 2 x 2 Gram matrix.
    let (a, b, c) = (across.length_squared(), across.dot(down), down.length_squared());
    let spread = (0.5 * (a - c)).hypot(b);
    let longest = (0.5 * (a + c) + spread).sqrt();
    if longest.is_finite() { longest } else { f64::INFINITY }
}

#[cfg(test)]
mod tests;
