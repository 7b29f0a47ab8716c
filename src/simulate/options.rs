//! What is to be simulated: its options, held to their ranges before anything is written.
//!
//! Owns the options and what they mean for a world's cameras; writing is `write`'s.

use super::SimulateError;
use super::cast::check_samples;
use super::world::World;
use glam::DVec3;
use std::path::PathBuf;
use videofields_vision::frame::is_id;
use videofields_vision::geometry::Camera;

/// What is to be simulated, and where it is written.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulateOptions {
    /// The folder; made if it is not there. Files of the same names are replaced.
    pub out_dir: PathBuf,
    /// Length of the clips, seconds, up to 86400. Default: the world's period, so that they loop without a seam.
    pub seconds: Option<f64>,
    /// Frames a second of all cameras, 0.1 to 240. Default: each camera's own.
    pub rate_hz: Option<f64>,
    /// Columns and rows of all cameras' pictures, 16 to 16383 each (what VP8 can hold). Default: each camera's own.
    pub size_px: Option<(u32, u32)>,
    /// Samples a pixel, each way, 1 to 16. Default 3.
    pub samples_per_side: u32,
    /// Truth is written for every n-th frame; 0 writes none. Default 1.
    pub truth_every_frames: u32,
    /// Truth is written for these frames alone, given by their times, seconds from the clips' start; each must be
    /// the time of a frame of a camera. Default: empty, which leaves it to `truth_every_frames`.
    pub truth_at_secs: Vec<f64>,
    /// What is written. Default: everything.
    pub parts: Parts,
    /// Views where no camera of the world stands. Default: none.
    pub extra_views: Vec<ExtraView>,
    /// The database that the configuration names, relative to the folder. Default `videofields.sqlite`.
    pub database: PathBuf,
}

impl SimulateOptions {
    /// The defaults, written to `out_dir`.
    #[must_use]
    pub fn new(out_dir: impl Into<PathBuf>) -> Self {
        Self {
            out_dir: out_dir.into(),
            seconds: None,
            rate_hz: None,
            size_px: None,
            samples_per_side: 3,
            truth_every_frames: 1,
            truth_at_secs: Vec::new(),
            parts: Parts::Everything,
            extra_views: Vec::new(),
            database: PathBuf::from("videofields.sqlite"),
        }
    }
}

/// What of a world is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Parts {
    /// Clips, truth, positions, documents.
    #[default]
    Everything,
    /// The extra views' truth and calibrations.
    Views,
}

/// A view where no camera of the world stands.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtraView {
    /// Name of its folder: an id that no camera of the world has.
    pub name: String,
    /// Where it stands, metres.
    pub eye_in_world: DVec3,
    /// What it looks at, metres.
    pub target_in_world: DVec3,
    /// Vertical field of view, radians, 0.01 to 3.0.
    pub fov_y_rad: f64,
    /// Columns and rows.
    pub size_px: (u32, u32),
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The configuration, unless views alone were asked for.
    pub config: Option<PathBuf>,
    /// The clips, one a camera; none where views alone were asked for.
    pub clips: Vec<PathBuf>,
    /// The extra views' folders, in their order.
    pub views: Vec<PathBuf>,
    /// Frames of each clip; of the longest, where cameras have different rates.
    pub n_frames: u64,
}

/// How far the writing has come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// What is being written: `camera west`, `view square`.
    pub what: String,
    /// Frames of it that are done.
    pub n_done: u64,
    /// Frames that it has.
    pub n_frames: u64,
    /// Which of the cameras and views it is, from 1, and how many there are.
    pub part: (usize, usize),
}

/// A camera or view of which frames are written.
#[derive(Clone, Debug)]
pub(super) struct Device {
    pub(super) id: String,
    pub(super) camera: Camera,
    pub(super) rate_hz: f64,
    pub(super) n_frames: u64,
    /// The frames whose truth is written, in order.
    pub(super) wanted: Vec<u64>,
}

impl Device {
    /// When a frame is captured, seconds.
    pub(super) fn time_of(&self, frame: u64) -> f64 {
        frame as f64 / self.rate_hz
    }
}

/// What the options ask of a world, once all numbers are known to be in their ranges.
pub(super) struct Wish {
    /// The world's cameras, whether their clips are asked for or not.
    pub(super) cameras: Vec<Device>,
    pub(super) views: Vec<Device>,
    /// The fastest camera's rate, which views have too.
    pub(super) rate_hz: f64,
    pub(super) n_frames: u64,
}

impl SimulateOptions {
    pub(super) fn wish(&self, world: &World) -> Result<Wish, SimulateError> {
        let out = |field, allowed| Err(SimulateError::View { field, allowed });
        if self.rate_hz.is_some_and(|rate_hz| !(0.1..=240.0).contains(&rate_hz)) {
            return out("rate", "0.1 to 240 frames a second");
        }
        let fits = |length: u32| (16..=16_383).contains(&length);
        if self.size_px.is_some_and(|(width, height)| !fits(width) || !fits(height)) {
            return out("picture size", "16 to 16383 pixels each way");
        }
        check_samples(self.samples_per_side)?;
        let seconds = self.seconds.unwrap_or(world.period_secs());
        let device = |id: &str, camera: Camera, rate_hz: f64| -> Result<Device, SimulateError> {
            let n_frames = (seconds * rate_hz).round();
            if !(seconds <= 86_400.0 && n_frames >= 1.0) {
                let allowed = "at least one frame and at most 86400 s";
                return Err(SimulateError::View { field: "length", allowed });
            }
            let n_frames = n_frames as u64;
            let wanted = self.wanted_frames(rate_hz, n_frames);
            Ok(Device { id: id.to_owned(), camera, rate_hz, n_frames, wanted })
        };
        let cameras = world.cameras_at(self.size_px)?;
        let settings = world.camera_settings();
        let cameras = cameras
            .into_iter()
            .zip(settings)
            .map(|((id, camera), setting)| device(id, camera, self.rate_hz.unwrap_or(setting.rate_hz)))
            .collect::<Result<Vec<_>, _>>()?;
        let fastest = cameras.iter().map(|camera| camera.rate_hz).fold(0.1, f64::max);
        let views = views(world, self)?
            .into_iter()
            .map(|(id, camera)| device(&id, camera, fastest))
            .collect::<Result<Vec<_>, _>>()?;
        for seconds in &self.truth_at_secs {
            let has_it = |device: &Device| frame_at(*seconds, device.rate_hz, device.n_frames).is_some();
            if !cameras.iter().chain(&views).any(has_it) {
                let allowed = "the time of a frame of the clips: a multiple of 1/rate within their length";
                return out("time of truth", allowed);
            }
        }
        let n_frames = cameras.iter().map(|camera| camera.n_frames).max().unwrap_or(0);
        Ok(Wish { cameras, views, rate_hz: fastest, n_frames })
    }

    /// The frames whose truth is written, in order, of a camera with this rate and so many frames.
    fn wanted_frames(&self, rate_hz: f64, n_frames: u64) -> Vec<u64> {
        if self.truth_at_secs.is_empty() {
            let step = self.truth_every_frames as usize;
            return if step == 0 { Vec::new() } else { (0..n_frames).step_by(step).collect() };
        }
        let times = self.truth_at_secs.iter();
        let mut frames: Vec<u64> =
            times.filter_map(|seconds| frame_at(*seconds, rate_hz, n_frames)).collect();
        frames.sort_unstable();
        frames.dedup();
        frames
    }
}

/// The frame at a time, if there is one.
fn frame_at(seconds: f64, rate_hz: f64, n_frames: u64) -> Option<u64> {
    let place = seconds * rate_hz;
    let is_frame = (place - place.round()).abs() < 1e-6 && place > -0.5 && place.round() < n_frames as f64;
    is_frame.then_some(place.round() as u64)
}

fn views(world: &World, options: &SimulateOptions) -> Result<Vec<(String, Camera)>, SimulateError> {
    let mut views: Vec<(String, Camera)> = Vec::new();
    for view in &options.extra_views {
        let is_taken = world.cameras.iter().any(|camera| camera.id == view.name)
            || views.iter().any(|(name, _)| *name == view.name);
        if !is_id(&view.name) || is_taken {
            let allowed = "1 to 64 of a-z, 0-9, - and _, and no other view's or camera's";
            return Err(SimulateError::View { field: "name of a view", allowed });
        }
        let camera = Camera::pinhole(view.eye_in_world, view.target_in_world, view.fov_y_rad, view.size_px)?;
        views.push((view.name.clone(), camera));
    }
    Ok(views)
}
