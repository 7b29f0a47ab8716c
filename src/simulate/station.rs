//! One camera of a world, frame after frame: what falls on its sensor, and the picture that this gives.
//!
//! Joins `cast` (linear picture and truth) and `sensor`. Owns the camera's plate, where the still world is the same in
//! every frame, and its sensor's memory.

use super::SimulateError;
use super::cast::{CastOptions, Layers, Plate, Truth};
use super::effects::Draw;
use super::moment::Shot;
use super::sensor::{Exposed, Sensor};
use super::world::World;
use videofields_vision::frame::RgbImage;
use videofields_vision::geometry::Camera;

/// A camera of a world, or a view where none stands.
pub struct Station<'a> {
    world: &'a World,
    /// The camera's id; a view has none.
    device: Option<String>,
    plate: Plate,
    sensor: Option<Sensor<'a>>,
    samples_per_side: u32,
}

/// What is wanted of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// What the camera gives.
    Picture,
    /// That, and everything that is known about it.
    Truth,
}

/// One frame.
#[derive(Clone, Debug)]
pub struct Exposure {
    /// The clean picture and what is known about it.
    pub truth: Truth,
    /// What the sensor gave, if that is another picture.
    pub from_sensor: Option<RgbImage>,
}

impl Exposure {
    /// What the camera gave.
    #[must_use]
    pub fn picture(&self) -> &RgbImage {
        self.from_sensor.as_ref().unwrap_or(&self.truth.rgb)
    }
}

impl<'a> Station<'a> {
    /// The world's camera with this id, which takes `rate_hz` frames a second; `wanted` is the most that is wanted of
    /// any of them.
    ///
    /// # Errors
    /// As [`World::plate_with`].
    pub fn new(
        world: &'a World,
        id: &str,
        camera: &Camera,
        samples_per_side: u32,
        rate_hz: f64,
        wanted: Wanted,
    ) -> Result<Self, SimulateError> {
        let draw = Draw::of_camera(world.effects().seed, id);
        let sensor = Sensor::new(world.effects(), world.entries(), draw, 1.0 / rate_hz);
        let options =
            CastOptions { layers: layers(wanted, sensor.as_ref()), ..CastOptions::new(samples_per_side) };
        let plate = world.plate_with(camera, &options)?;
        Ok(Self { world, device: Some(id.to_owned()), plate, sensor, samples_per_side })
    }

    /// A view where no camera stands: it has no sensor, and truth is wanted of all its frames.
    pub(super) fn free(
        world: &'a World,
        camera: &Camera,
        samples_per_side: u32,
    ) -> Result<Self, SimulateError> {
        let options =
            CastOptions { layers: layers(Wanted::Truth, None), ..CastOptions::new(samples_per_side) };
        let plate = world.plate_with(camera, &options)?;
        Ok(Self { world, device: None, plate, sensor: None, samples_per_side })
    }

    pub(super) const fn camera(&self) -> &Camera {
        self.plate.camera()
    }

    /// The still world as the camera sees it.
    #[must_use]
    pub const fn plate(&self) -> &Plate {
        &self.plate
    }

    pub(super) const fn has_sensor(&self) -> bool {
        self.sensor.is_some()
    }

    /// Whether a frame hangs on the frames before it, so that none may be left out.
    pub(super) const fn remembers(&self) -> bool {
        self.sensor.is_some() && self.world.effects().exposure.is_some()
    }

    /// The frame at `time_secs`; with all layers of truth if they are wanted. Frames must come in their order.
    ///
    /// # Errors
    /// As [`World::cast`].
    pub fn shoot(&mut self, frame: u64, time_secs: f64, wanted: Wanted) -> Result<Exposure, SimulateError> {
        let device = self.device.as_deref();
        let mut truth = if self.world.plate_lasts(device) {
            self.world.cast_over(&self.plate, device, time_secs)?
        } else {
            let layers = layers(wanted, self.sensor.as_ref());
            let options = CastOptions { layers, ..CastOptions::new(self.samples_per_side) };
            self.world.cast(&Shot { camera: self.plate.camera(), device, time_secs }, &options)?
        };
        let from_sensor = self.sensor.as_mut().zip(truth.linear.take()).map(|(sensor, linear)| {
            let gains = self.world.effects().light_gains(time_secs, &self.world.entries().tally());
            let sky = self.world.sky * gains.sky;
            let exposed = Exposed { linear, depth_m: &truth.depth_m, frame, time_secs, sky };
            sensor.develop(self.plate.camera(), exposed)
        });
        Ok(Exposure { truth, from_sensor })
    }
}

/// What is cast of a frame beside its picture.
fn layers(wanted: Wanted, sensor: Option<&Sensor<'_>>) -> Layers {
    let is_truth = wanted == Wanted::Truth;
    Layers { normals: is_truth, shadow: is_truth, partial: is_truth, linear: sensor.is_some() }
}
