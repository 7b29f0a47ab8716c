//! One camera with its picture, as texture fields take it.

use crate::frame::{Levels, Mask, RgbImage};
use crate::geometry::Camera;
use glam::{DVec2, DVec3, Vec3};
use std::f64::consts::FRAC_PI_4;

/// Most views of one field.
pub const MAX_VIEWS: usize = 64;

/// So near the border of what is of the mesh, in pixels of its mask, colours are mixed with what lies behind.
pub const BORDER_PX: f64 = 1.5;

/// A camera with what it shows.
#[derive(Clone, Debug)]
pub struct View {
    camera: Camera,
    picture: Levels,
    /// Columns of the picture, were it there.
    width_px: u32,
    /// What of the picture is of the mesh, where that is known: 0 is not.
    foreground: Option<Mask>,
    /// What its light is multiplied by, a channel, so that it agrees with the others'.
    pub gain: Vec3,
}

impl View {
    /// Of a camera and its picture, of whatever size; `foreground`, of any size too, is 0 where the picture shows something else than
    /// the mesh.
    #[must_use]
    pub fn new(camera: Camera, picture: RgbImage, foreground: Option<Mask>) -> Self {
        let width_px = picture.width;
        Self { camera, picture: Levels::of(picture), width_px, foreground, gain: Vec3::ONE }
    }

    /// Of a camera whose picture is not at hand but as large as it was calibrated: for what does not depend on colours. It is grey.
    #[must_use]
    pub fn without_picture(camera: Camera) -> Self {
        let width_px = camera.size_px().0;
        let grey = RgbImage { width: 1, height: 1, data: vec![128; 3] };
        Self { camera, picture: Levels::of(grey), width_px, foreground: None, gain: Vec3::ONE }
    }

    /// Its camera.
    #[must_use]
    pub const fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Its picture.
    #[must_use]
    pub fn picture(&self) -> &RgbImage {
        self.picture.finest()
    }

    /// What of the picture is of the mesh, where that is known: 0 is not.
    #[must_use]
    pub const fn foreground(&self) -> Option<&Mask> {
        self.foreground.as_ref()
    }

    /// Where it stands.
    #[must_use]
    pub const fn eye(&self) -> DVec3 {
        self.camera.pose().position_in_world
    }

    /// Where in the picture a place is, if it is seen there; how deep it lies is told with it, metres.
    #[must_use]
    pub fn project(&self, place: DVec3) -> Option<(DVec2, f64)> {
        self.camera.project(place).filter(|seen| seen.is_inside()).map(|seen| (seen.texture, seen.depth_m))
    }

    /// Whether a place of the picture, and what is within [`BORDER_PX`] of it, is of the mesh.
    #[must_use]
    pub fn is_foreground(&self, texture: DVec2) -> bool {
        let Some(mask) = &self.foreground else { return true };
        let size = DVec2::new(f64::from(mask.width), f64::from(mask.height));
        let is_inside = |at: DVec2| {
            let at = at.clamp(DVec2::ZERO, (size - 1.0).max(DVec2::ZERO));
            mask.data.get(at.y as usize * mask.width as usize + at.x as usize).is_some_and(|value| *value > 0)
        };
        let at = texture * size;
        is_inside(at)
            && (0..8).all(|i| is_inside(at + DVec2::from_angle(f64::from(i) * FRAC_PI_4) * BORDER_PX))
    }

    /// The evened colour at a place of the picture, in linear light, in a level of detail.
    #[must_use]
    pub fn light_at(&self, texture: DVec2, level: f32) -> Vec3 {
        self.gain * self.picture.light_at(texture, level)
    }

    /// Pixels of the picture a metre across the line of sight, at a depth above 0.
    #[must_use]
    pub fn px_per_m(&self, depth_m: f64) -> f64 {
        // Of the picture as it is, whatever size was calibrated.
        let scale = f64::from(self.width_px) / f64::from(self.camera.size_px().0);
        self.camera.focal_px().x * scale / depth_m.max(1e-9)
    }
}
