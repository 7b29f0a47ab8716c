//! One camera of a world, frame after frame: what falls on its sensor, and the picture that this gives.
//!
//! Joins `cast` (linear picture and truth) and `sensor`. Owns the camera's plate, where the still world is the same in
//! every frame, and its sensor's memory.

use super::SimulateError;
use super::cast::{Plate, Truth};
use super::effects::Draw;
use super::sensor::{Exposed, Sensor};
use super::world::World;
use crate::frame::RgbImage;
use crate::geometry::Camera;

/// A camera of a world, or a view where none stands.
pub(super) struct Station<'a> {
    world: &'a World,
    plate: Plate,
    sensor: Option<Sensor<'a>>,
}

/// One frame.
pub(super) struct Shot {
    /// The clean picture and what is known about it.
    pub(super) truth: Truth,
    /// What the sensor gave, if that is another picture.
    pub(super) from_sensor: Option<RgbImage>,
}

impl Shot {
    /// What the camera gave.
    pub(super) fn picture(&self) -> &RgbImage {
        self.from_sensor.as_ref().unwrap_or(&self.truth.rgb)
    }
}

impl<'a> Station<'a> {
    /// The world's camera with this id, which takes `rate_hz` frames a second.
    pub(super) fn new(
        world: &'a World,
        id: &str,
        camera: &Camera,
        samples_per_side: u32,
        rate_hz: f64,
    ) -> Result<Self, SimulateError> {
        let draw = Draw::of_camera(world.effects().seed, id);
        let sensor = Sensor::new(world.effects(), world.entries(), draw, 1.0 / rate_hz);
        Ok(Self { world, plate: world.plate(camera, samples_per_side)?, sensor })
    }

    /// A view where no camera stands: it has no sensor.
    pub(super) fn free(
        world: &'a World,
        camera: &Camera,
        samples_per_side: u32,
    ) -> Result<Self, SimulateError> {
        Ok(Self { world, plate: world.plate(camera, samples_per_side)?, sensor: None })
    }

    pub(super) const fn camera(&self) -> &Camera {
        self.plate.camera()
    }

    pub(super) const fn plate(&self) -> &Plate {
        &self.plate
    }

    pub(super) const fn has_sensor(&self) -> bool {
        self.sensor.is_some()
    }

    /// Whether a frame hangs on the frames before it, so that none may be left out.
    pub(super) const fn remembers(&self) -> bool {
        self.world.effects().exposure.is_some() && self.sensor.is_some()
    }

    /// The frame at `time_secs`; with all layers of truth if `is_truth_wanted`.
    pub(super) fn shoot(
        &mut self,
        frame: u64,
        time_secs: f64,
        is_truth_wanted: bool,
    ) -> Result<Shot, SimulateError> {
        let _ = is_truth_wanted;
        let mut truth = self.world.render_over(&self.plate, time_secs)?;
        let from_sensor = self.sensor.as_mut().map(|sensor| {
            let gains = self.world.effects().light_gains(time_secs, &self.world.entries().tally());
            let sky = self.world.sky * gains.sky;
            let linear = truth.linear.take().unwrap_or_default();
            let exposed = Exposed { linear, depth_m: &truth.depth_m, frame, time_secs, sky };
            sensor.develop(self.plate.camera(), exposed)
        });
        Ok(Shot { truth, from_sensor })
    }
}
