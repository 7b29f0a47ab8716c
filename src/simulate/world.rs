//! A simulated world: what stands, what moves, what looks at it.
//!
//! Owns the world's parts and answers where its actors are. What numbers a world is made of stands in a document
//! (`world_file`); what a place looks like is `shade`'s, pictures are `cast`'s.

use super::SimulateError;
use super::actor::{Actor, ActorKind, WorldTime};
use super::calibration_error::CalibrationError;
use super::effects::{Effects, Entries};
use super::figure::Body;
use super::light::Light;
use super::material::Material;
use super::solids::Solids;
use super::world_file::ground_height;
use glam::{DVec2, DVec3};
use std::sync::Arc;
use videofields_picture::scene::OriginDocument;
use videofields_vision::frame::srgb_from_linear;
use videofields_vision::geometry::{Camera, Distortion, Pose, Surfaces};

/// Length of a clip of a world that does not repeat, seconds.
const CLIP_SECS: f64 = 20.0;

/// A world with exact truth about everything in it.
#[derive(Clone, Debug)]
pub struct World {
    pub(super) id: String,
    pub(super) name: String,
    pub(super) origin: Option<OriginDocument>,
    pub(super) period_secs: Option<f64>,
    /// What stands.
    pub(super) solids: Solids,
    /// In the order of `surfaces.ground`.
    pub(super) ground_paints: Vec<Arc<Material>>,
    /// In the order of `surfaces.boxes`.
    pub(super) box_paints: Vec<Arc<Material>>,
    /// In the order of `surfaces.boxes`.
    pub(super) box_ids: Vec<String>,
    /// What the terrain is painted with, where there is one.
    pub(super) terrain_paint: Option<Arc<Material>>,
    /// In the order of `surfaces.boxes`: turn from east towards north.
    pub(super) box_yaws_deg: Vec<f64>,
    /// In the order of their instances.
    pub(super) actors: Vec<Actor>,
    pub(super) light: Light,
    pub(super) effects: Effects,
    /// How often the effects' code was entered for this world and its clones.
    pub(super) entries: Arc<Entries>,
    pub(super) sky_srgb: [u8; 3],
    pub(super) sky: DVec3,
    pub(super) cameras: Vec<WorldCamera>,
    /// Places where no camera stands; the first is where the world's scene is seen from.
    pub(super) views: Vec<WorldView>,
}

/// A place to look from.
#[derive(Clone, Debug)]
pub(super) struct WorldView {
    pub(super) id: String,
    pub(super) eye_m: [f64; 3],
    pub(super) target_m: [f64; 3],
    pub(super) fov_deg: f64,
}

/// A camera of a world, for pictures of any size.
#[derive(Clone, Debug)]
pub(super) struct WorldCamera {
    pub(super) id: String,
    /// Name for people.
    pub(super) name: String,
    pub(super) pose: Pose,
    pub(super) focal: Focal,
    pub(super) distortion: Distortion,
    /// Columns and rows of its own pictures.
    pub(super) size_px: (u32, u32),
    pub(super) rate_hz: f64,
    /// Errors of what is written of it.
    pub(super) calibration_error: CalibrationError,
}

/// How long a lens is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Focal {
    /// Horizontal field of view: of the lens without its distortion, but a fisheye's own.
    FieldOfView { x_rad: f64 },
    /// Focal length in pixels of a picture so wide.
    Length { px: f64, at_width_px: u32 },
}

/// What a camera of a world is like.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSetting {
    /// Its id.
    pub id: String,
    /// Name for people.
    pub name: String,
    /// Columns and rows of its own pictures.
    pub size_px: (u32, u32),
    /// Its own frames a second.
    pub rate_hz: f64,
}

/// A place of a world from which to look where no camera stands.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewSetting {
    /// Its id.
    pub id: String,
    /// The viewer's place, metres.
    pub eye_in_world: DVec3,
    /// What the viewer looks at, metres.
    pub target_in_world: DVec3,
    /// Vertical field of view, radians.
    pub fov_y_rad: f64,
}

/// Where an actor is at an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct FigurePosition {
    /// Its value in instance masks, from 1.
    pub instance: u8,
    /// Its id in the world's document.
    pub name: String,
    /// What it is.
    pub kind: ActorKind,
    /// The ground below its middle (of someone on foot, below the hips; of someone who sits, halfway between hips and feet),
    /// metres.
    pub foot_in_world: DVec3,
    /// Direction of travel, from east towards north.
    pub heading_rad: f64,
    /// Highest point above the ground below its middle, metres.
    pub height_m: f64,
    /// Low and high corner of the tightest box along the world's axes, metres.
    pub box_in_world: (DVec3, DVec3),
}

impl World {
    /// The id by which configurations and addresses name the world's scene.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Its name for people.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Length of a clip of the world, seconds: the time after which everything repeats, or 20 where nothing does.
    #[must_use]
    pub fn period_secs(&self) -> f64 {
        self.period_secs.unwrap_or(CLIP_SECS)
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
    pub fn cameras(&self, size_px: (u32, u32)) -> Result<Vec<(&str, Camera)>, SimulateError> {
        self.cameras.iter().map(|camera| Ok((camera.id.as_str(), camera.at_size(size_px)?))).collect()
    }

    /// As [`Self::cameras`], each with the size of its own pictures where none is given.
    ///
    /// # Errors
    /// When the size is none that a camera can have.
    pub fn cameras_at(&self, size_px: Option<(u32, u32)>) -> Result<Vec<(&str, Camera)>, SimulateError> {
        let at_size = |camera: &'_ WorldCamera| camera.at_size(size_px.unwrap_or(camera.size_px));
        self.cameras.iter().map(|camera| Ok((camera.id.as_str(), at_size(camera)?))).collect()
    }

    /// Returns the cameras of [`Self::cameras_at`] as they are thought to be: what is written of them is off by their calibration
    /// errors.
    ///
    /// # Errors
    /// When the size is none that a camera can have, or an error leaves no camera.
    pub fn calibrated_at(&self, size_px: Option<(u32, u32)>) -> Result<Vec<(&str, Camera)>, SimulateError> {
        let calibrated = |camera: &'_ WorldCamera| {
            let true_one = camera.at_size(size_px.unwrap_or(camera.size_px))?;
            camera.calibration_error.applied(&true_one, self.effects.seed, &camera.id)
        };
        self.cameras.iter().map(|camera| Ok((camera.id.as_str(), calibrated(camera)?))).collect()
    }

    /// Returns how much later than their times say a camera's frames are captured, seconds; 0 of an unknown camera.
    #[must_use]
    pub fn late_secs(&self, camera_id: &str) -> f64 {
        let camera = self.cameras.iter().find(|camera| camera.id == camera_id);
        camera.map_or(0.0, |camera| camera.calibration_error.late_secs(self.effects.seed, camera_id))
    }

    /// Returns the same world with this calibration error of all cameras in place of their own.
    #[must_use]
    pub fn with_calibration_error(&self, error: CalibrationError) -> Self {
        let mut world = self.clone();
        world.cameras.iter_mut().for_each(|camera| camera.calibration_error = error);
        world
    }

    /// What the world's cameras are like, in the order of [`Self::cameras`].
    pub fn camera_settings(&self) -> impl Iterator<Item = CameraSetting> + '_ {
        self.cameras.iter().map(|camera| CameraSetting {
            id: camera.id.clone(),
            name: camera.name.clone(),
            size_px: camera.size_px,
            rate_hz: camera.rate_hz,
        })
    }

    /// The world's own places to look from where no camera stands.
    pub fn views(&self) -> impl Iterator<Item = ViewSetting> + '_ {
        self.views.iter().map(|view| ViewSetting {
            id: view.id.clone(),
            eye_in_world: DVec3::from_array(view.eye_m),
            target_in_world: DVec3::from_array(view.target_m),
            fov_y_rad: view.fov_deg.to_radians(),
        })
    }

    /// Height of the topmost ground at a place, metres; 0 beside all ground.
    #[must_use]
    pub fn ground_height(&self, at: DVec2) -> f64 {
        ground_height(self.solids.surfaces().ground(), self.solids.terrain(), at)
    }

    /// Where every actor that is there at `time_secs` is, by instance.
    ///
    /// # Errors
    /// When the time is not a finite number.
    pub fn figures(&self, time_secs: f64) -> Result<Vec<FigurePosition>, SimulateError> {
        let bodies = self.bodies(time_secs)?;
        let actors = self.actors.iter().zip(bodies).zip(1..).filter(|((_, body), _)| body.is_present());
        let positions = actors.map(|((actor, body), instance)| {
            let (low, high) = body.bounds;
            FigurePosition {
                instance,
                name: actor.id.clone(),
                kind: actor.kind(),
                foot_in_world: body.foot,
                heading_rad: body.heading.to_angle(),
                height_m: high.z - body.foot.z,
                box_in_world: (low, high),
            }
        });
        Ok(positions.collect())
    }

    /// The body of every actor, by instance; of those that are not there, absent ones.
    pub(super) fn bodies(&self, time_secs: f64) -> Result<Vec<Body>, SimulateError> {
        if !time_secs.is_finite() {
            return Err(SimulateError::Time);
        }
        let time = WorldTime::new(time_secs, self.period_secs);
        let ground = |at: DVec2| self.ground_height(at);
        Ok(self.actors.iter().map(|actor| actor.body(time, &ground)).collect())
    }

    /// Everything that the world is painted with.
    #[cfg(test)]
    pub(super) fn materials(&self) -> impl Iterator<Item = &Material> {
        self.ground_paints.iter().chain(&self.box_paints).chain(&self.terrain_paint).map(AsRef::as_ref)
    }
}

/// The 8-bit sRGB code of a linear value; what is brighter than white becomes white.
pub(super) fn srgb_code(linear: f64) -> u8 {
    (srgb_from_linear(linear.clamp(0.0, 1.0) as f32) * 255.0 + 0.5) as u8
}

impl WorldCamera {
    /// The camera's calibration for pictures of this size.
    pub(super) fn at_size(&self, size_px: (u32, u32)) -> Result<Camera, SimulateError> {
        let size = DVec2::new(f64::from(size_px.0), f64::from(size_px.1));
        let focal_px = match (self.focal, self.distortion) {
            (Focal::Length { px, at_width_px }, _) => px * size.x / f64::from(at_width_px),
            (Focal::FieldOfView { x_rad }, Distortion::Fisheye { coefficients: [k1, k2, k3, k4] }) => {
                // The picture's edge is theta (1 + k1 theta^2 + ...) focal lengths from its middle.
                let theta = x_rad * 0.5;
                let square = theta * theta;
                let bent = theta * (1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4))));
                size.x * 0.5 / bent
            }
            (Focal::FieldOfView { x_rad }, _) => size.x * 0.5 / (x_rad * 0.5).tan(),
        };
        Ok(Camera::new(size_px, DVec2::splat(focal_px), size * 0.5, self.distortion, self.pose)?)
    }
}
