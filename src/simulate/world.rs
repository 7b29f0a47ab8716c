//! A simulated world: what stands, what moves, what looks at it.
//!
//! Owns the world's parts and answers where its figures are. What numbers a world is made of stands in a file of its
//! own (`plaza`); what a place looks like is `shade`'s, pictures are `cast`'s.

use super::SimulateError;
use super::effects::{Effects, Entries};
use super::figure::{Body, Figure};
use super::light::Light;
use super::paint::{BoxPaint, GroundPaint};
use super::solids::Solids;
use crate::frame::srgb_from_linear;
use crate::geometry::{Camera, Distortion, Pose, Surfaces};
use glam::{DVec2, DVec3};
use std::sync::Arc;

/// A world with exact truth about everything in it.
#[derive(Clone, Debug)]
pub struct World {
    pub(super) id: &'static str,
    pub(super) name: &'static str,
    pub(super) period_secs: f64,
    /// What stands.
    pub(super) solids: Solids,
    /// In the order of `surfaces.ground`.
    pub(super) ground_paints: Vec<GroundPaint>,
    /// In the order of `surfaces.boxes`.
    pub(super) box_paints: Vec<BoxPaint>,
    /// In the order of `surfaces.boxes`.
    pub(super) box_ids: Vec<&'static str>,
    /// What the terrain is painted with, where there is one.
    pub(super) terrain_paint: Option<GroundPaint>,
    /// In the order of `surfaces.boxes`: turn from east towards north.
    pub(super) box_yaws_deg: Vec<f64>,
    pub(super) figures: Vec<Figure>,
    pub(super) light: Light,
    pub(super) effects: Effects,
    /// How often the effects' code was entered for this world and its clones.
    pub(super) entries: Arc<Entries>,
    pub(super) sky_srgb: [u8; 3],
    pub(super) sky: DVec3,
    pub(super) cameras: Vec<WorldCamera>,
    /// Where the world's scene is seen from, where a request names no place.
    pub(super) view: WorldView,
}

/// A place to look from, written into the scene document.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub(super) struct WorldView {
    pub(super) eye_m: [f64; 3],
    pub(super) target_m: [f64; 3],
    pub(super) fov_deg: f64,
}

/// A camera of a world, for pictures of any size.
#[derive(Clone, Debug)]
pub(super) struct WorldCamera {
    pub(super) id: &'static str,
    /// Name for people.
    pub(super) name: &'static str,
    pub(super) eye: DVec3,
    pub(super) target: DVec3,
    /// Horizontal field of view of the lens without its distortion.
    pub(super) fov_x_rad: f64,
    pub(super) distortion: Distortion,
}

/// Where a figure is at an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct FigurePosition {
    /// Its value in instance masks, from 1.
    pub instance: u8,
    /// Name for people.
    pub name: &'static str,
    /// The ground below its hips, metres.
    pub foot_in_world: DVec3,
    /// Direction walked, from east towards north.
    pub heading_rad: f64,
    /// Highest point above the ground, metres.
    pub height_m: f64,
    /// Low and high corner of the tightest box along the world's axes, metres.
    pub box_in_world: (DVec3, DVec3),
}

impl World {
    /// The world with this id: so far only `plaza`.
    ///
    /// # Errors
    /// When there is no such world.
    pub fn named(id: &str) -> Result<Self, SimulateError> {
        match id {
            "plaza" => Ok(Self::plaza()),
            _ => Err(SimulateError::UnknownWorld { id: id.to_owned() }),
        }
    }

    /// The id by which configurations and addresses name the world's scene.
    #[must_use]
    pub const fn id(&self) -> &'static str {
        self.id
    }

    /// Seconds after which everything repeats.
    #[must_use]
    pub const fn period_secs(&self) -> f64 {
        self.period_secs
    }

    /// Ground and boxes, as rays meet them.
    #[must_use]
    pub const fn surfaces(&self) -> &Surfaces {
        self.solids.surfaces()
    }

    /// Everything that stands, as rays meet it.
    #[must_use]
    pub const fn solids(&self) -> &Solids {
        &self.solids
    }

    /// Which effects beyond plain shading the world simulates.
    #[must_use]
    pub const fn effects(&self) -> &Effects {
        &self.effects
    }

    /// The same world with other effects, whose entries are counted anew.
    #[must_use]
    pub fn with_effects(&self, effects: Effects) -> Self {
        Self { effects, entries: Arc::new(Entries::default()), ..self.clone() }
    }

    /// The worlds that are known by name: their ids and what each is, in a line.
    #[must_use]
    pub fn catalogue() -> Vec<(String, String)> {
        let plaza =
            "40 m x 30 m of paving between a hall and a cafe, three figures on their rounds, three cameras";
        vec![("plaza".to_owned(), plaza.to_owned())]
    }

    /// How often the effects' code was entered for this world and its clones.
    #[must_use]
    pub fn entries(&self) -> &Entries {
        &self.entries
    }

    /// Colour of the sky, 8-bit sRGB.
    #[must_use]
    pub const fn sky_srgb(&self) -> [u8; 3] {
        self.sky_srgb
    }

    /// Ids and calibrations of the world's cameras, for pictures of `size_px` columns and rows.
    ///
    /// # Errors
    /// When the size is none that a camera can have.
    pub fn cameras(&self, size_px: (u32, u32)) -> Result<Vec<(&'static str, Camera)>, SimulateError> {
        self.cameras.iter().map(|camera| Ok((camera.id, camera.at_size(size_px)?))).collect()
    }

    /// Where every figure is at `time_secs`, by instance.
    ///
    /// # Errors
    /// When the time is not a finite number.
    pub fn figures(&self, time_secs: f64) -> Result<Vec<FigurePosition>, SimulateError> {
        let bodies = self.bodies(time_secs)?;
        let positions = self.figures.iter().zip(bodies).zip(1..).map(|((figure, body), instance)| {
            let (low, high) = body.bounds;
            FigurePosition {
                instance,
                name: figure.name,
                foot_in_world: body.foot,
                heading_rad: body.heading.to_angle(),
                height_m: high.z,
                box_in_world: (low, high),
            }
        });
        Ok(positions.collect())
    }

    pub(super) fn bodies(&self, time_secs: f64) -> Result<Vec<Body>, SimulateError> {
        if !time_secs.is_finite() {
            return Err(SimulateError::Time);
        }
        let phase = (time_secs / self.period_secs).rem_euclid(1.0);
        Ok(self.figures.iter().map(|figure| figure.body(phase)).collect())
    }
}

/// The 8-bit sRGB code of a linear value; what is brighter than white becomes white.
pub(super) fn srgb_code(linear: f64) -> u8 {
    (srgb_from_linear(linear.clamp(0.0, 1.0) as f32) * 255.0 + 0.5) as u8
}

impl WorldCamera {
    fn at_size(&self, size_px: (u32, u32)) -> Result<Camera, SimulateError> {
        let size = DVec2::new(f64::from(size_px.0), f64::from(size_px.1));
        let focal_px = size.x * 0.5 / (self.fov_x_rad * 0.5).tan();
        let pose = Pose::looking_at(self.eye, self.target).ok_or(SimulateError::View {
            field: "camera",
            allowed: "somewhere else than what it looks at",
        })?;
        Ok(Camera::new(size_px, DVec2::splat(focal_px), size * 0.5, self.distortion, pose)?)
    }
}

/// A pinhole camera at `eye` that looks at `target`, for views where no camera of the world stands.
///
/// `fov_y_rad` is the vertical field of view, 0.01 to 3.0; `size_px` are columns and rows.
///
/// # Errors
/// When a number is out of its range or not finite, or eye and target coincide.
pub fn pinhole(
    eye: DVec3,
    target: DVec3,
    fov_y_rad: f64,
    size_px: (u32, u32),
) -> Result<Camera, SimulateError> {
    if !(0.01..=3.0).contains(&fov_y_rad) {
        return Err(SimulateError::View { field: "field of view", allowed: "0.01 to 3.0 rad" });
    }
    let pose = Pose::looking_at(eye, target)
        .ok_or(SimulateError::View { field: "eye", allowed: "finite and somewhere else than the target" })?;
    let size = DVec2::new(f64::from(size_px.0), f64::from(size_px.1));
    let focal_px = size.y * 0.5 / (fov_y_rad * 0.5).tan();
    Ok(Camera::new(size_px, DVec2::splat(focal_px), size * 0.5, Distortion::None, pose)?)
}
