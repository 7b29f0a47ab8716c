//! A world into a folder: clips, exact truth, scene document, configuration.
//!
//! ```text
//! <out>/<world>.toml                        configuration that serves the clips
//! <out>/<world>.json                        scene document
//! <out>/calibration/<camera>.json           the cameras' calibrations alone
//! <out>/clips/<camera>.webm                 what the cameras saw
//! <out>/truth/positions.jsonl               figures, one line a frame
//! <out>/truth/<camera>/background.png       the still world
//! <out>/truth/<camera>/frame/000000.png     what the camera saw, without a codec's loss
//! <out>/truth/<camera>/instance/000000.png  8 bits: 0 the still world, else a figure's instance
//! <out>/truth/<camera>/depth/000000.png     16 bits: millimetres along the optical axis, 0 nothing, 65535 that far or further
//! ```
//!
//! Views where no camera stands lie under `truth/` as cameras do, with their calibrations. Files of frames are named
//! by the frame's number in the clip, from 0.

use super::cast::{Plate, Truth, check_samples};
use super::video::VideoWriter;
use super::world::World;
use super::{SimulateError, pinhole};
use crate::calibrate::CameraDocument;
use crate::frame::is_id;
use crate::geometry::Camera;
use glam::DVec3;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// What is to be simulated, and where it is written.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulateOptions {
    /// The folder; made if it is not there. Files of the same names are replaced.
    pub out_dir: PathBuf,
    /// Length of the clips, seconds, up to 86400. Default: the world's period, so that they loop without a seam.
    pub seconds: Option<f64>,
    /// Frames a second, 0.1 to 240. Default 10.
    pub rate_hz: f64,
    /// Columns and rows of the cameras' pictures, 16 to 16383 each (what VP8 can hold). Default 640 x 360.
    pub size_px: (u32, u32),
    /// Samples a pixel, each way, 1 to 16. Default 3.
    pub samples_per_side: u32,
    /// Truth is written for every n-th frame; 0 writes none. Default 1.
    pub truth_every_frames: u32,
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
            rate_hz: 10.0,
            size_px: (640, 360),
            samples_per_side: 3,
            truth_every_frames: 1,
            extra_views: Vec::new(),
            database: PathBuf::from("videofields.sqlite"),
        }
    }
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
    /// The configuration.
    pub config: PathBuf,
    /// The clips, one a camera.
    pub clips: Vec<PathBuf>,
    /// Frames of each clip.
    pub n_frames: u64,
}

/// A line of `positions.jsonl`.
#[derive(Serialize)]
struct PositionsDocument {
    frame: u64,
    time_secs: f64,
    figures: Vec<FigureDocument>,
}

#[derive(Serialize)]
struct FigureDocument {
    instance: u8,
    name: &'static str,
    foot_m: [f64; 3],
    heading_rad: f64,
    height_m: f64,
    box_low_m: [f64; 3],
    box_high_m: [f64; 3],
}

/// Simulates the world with this id into the folder that the options name, as [`write()`] does.
///
/// # Errors
/// When there is no such world, and as [`write()`].
pub fn run(world_id: &str, options: &SimulateOptions) -> Result<Written, SimulateError> {
    write(&World::named(world_id)?, options)
}

/// Simulates `world` into the folder that the options name.
///
/// **Cost** of the defaults: about a minute on two cores and 200 MB; 4 MB without truth.
///
/// # Errors
/// When an option is out of its range, GStreamer has no VP8 encoder or WebM muxer, or a file cannot be written.
pub fn write(world: &World, options: &SimulateOptions) -> Result<Written, SimulateError> {
    let n_frames = n_frames(world, options)?;
    let cameras = world.cameras(options.size_px)?;
    let views = views(world, options)?;
    let out = &options.out_dir;
    make_folder(&out.join("clips"))?;
    make_folder(&out.join("calibration"))?;
    let config = out.join(format!("{}.toml", world.id()));
    write_file(&config, &world.config_toml(&options.database)?)?;
    write_file(&out.join(format!("{}.json", world.id())), &world.scene_json(options.size_px)?)?;
    let named = cameras.iter().map(|(id, camera)| (*id, camera));
    for (id, camera) in named.chain(views.iter().map(|(id, camera)| (id.as_str(), camera))) {
        let text = serde_json::to_string_pretty(&CameraDocument::from_camera(camera))? + "\n";
        write_file(&out.join("calibration").join(format!("{id}.json")), &text)?;
    }
    if options.truth_every_frames > 0 {
        write_positions(world, options, n_frames)?;
    }
    let mut clips = Vec::new();
    for (id, camera) in &cameras {
        let clip = out.join("clips").join(format!("{id}.webm"));
        let mut video = VideoWriter::create(&clip, options.size_px, options.rate_hz)?;
        let plate = world.plate(camera, options.samples_per_side)?;
        let truth = TruthWriter::create(options, id, &plate)?;
        for frame in 0..n_frames {
            let seen = world.render_over(&plate, time_of(frame, options))?;
            video.push(&seen.rgb)?;
            truth.frame(frame, &seen)?;
        }
        video.finish()?;
        clips.push(clip);
    }
    for (id, camera) in &views {
        let plate = world.plate(camera, options.samples_per_side)?;
        let truth = TruthWriter::create(options, id, &plate)?;
        for frame in (0..n_frames).filter(|frame| truth.wants(*frame)) {
            truth.frame(frame, &world.render_over(&plate, time_of(frame, options))?)?;
        }
    }
    Ok(Written { config, clips, n_frames })
}

fn time_of(frame: u64, options: &SimulateOptions) -> f64 {
    frame as f64 / options.rate_hz
}

/// How many frames the clips have, once all numbers are known to be in their ranges.
fn n_frames(world: &World, options: &SimulateOptions) -> Result<u64, SimulateError> {
    let out = |field, allowed| Err(SimulateError::View { field, allowed });
    if !(0.1..=240.0).contains(&options.rate_hz) {
        return out("rate", "0.1 to 240 frames a second");
    }
    let (width, height) = options.size_px;
    if !(16..=16_383).contains(&width) || !(16..=16_383).contains(&height) {
        return out("picture size", "16 to 16383 pixels each way");
    }
    check_samples(options.samples_per_side)?;
    let seconds = options.seconds.unwrap_or(world.period_secs());
    let n_frames = (seconds * options.rate_hz).round();
    if !(seconds <= 86_400.0 && n_frames >= 1.0) {
        return out("length", "at least one frame and at most 86400 s");
    }
    Ok(n_frames as u64)
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
        let camera = pinhole(view.eye_in_world, view.target_in_world, view.fov_y_rad, view.size_px)?;
        views.push((view.name.clone(), camera));
    }
    Ok(views)
}

fn write_positions(world: &World, options: &SimulateOptions, n_frames: u64) -> Result<(), SimulateError> {
    let folder = options.out_dir.join("truth");
    make_folder(&folder)?;
    let path = folder.join("positions.jsonl");
    let fault = |source| SimulateError::File { path: path.clone(), source };
    let mut file = std::io::BufWriter::new(std::fs::File::create(&path).map_err(fault)?);
    for frame in 0..n_frames {
        let time_secs = time_of(frame, options);
        let figures = world.figures(time_secs)?.into_iter().map(|figure| FigureDocument {
            instance: figure.instance,
            name: figure.name,
            foot_m: figure.foot_in_world.to_array(),
            heading_rad: figure.heading_rad,
            height_m: figure.height_m,
            box_low_m: figure.box_in_world.0.to_array(),
            box_high_m: figure.box_in_world.1.to_array(),
        });
        let line = PositionsDocument { frame, time_secs, figures: figures.collect() };
        writeln!(file, "{}", serde_json::to_string(&line)?).map_err(fault)?;
    }
    file.flush().map_err(fault)
}

/// Writes one camera's truth, or nothing where none is wanted.
struct TruthWriter {
    folder: PathBuf,
    every_frames: u64,
}

impl TruthWriter {
    fn create(options: &SimulateOptions, id: &str, plate: &Plate) -> Result<Self, SimulateError> {
        let folder = options.out_dir.join("truth").join(id);
        let writer = Self { folder, every_frames: u64::from(options.truth_every_frames) };
        if writer.every_frames > 0 {
            for kind in ["frame", "instance", "depth"] {
                make_folder(&writer.folder.join(kind))?;
            }
            let rgb = &plate.truth().rgb;
            let path = writer.folder.join("background.png");
            save(&path, &rgb.data, (rgb.width, rgb.height), image::ExtendedColorType::Rgb8)?;
        }
        Ok(writer)
    }

    fn wants(&self, frame: u64) -> bool {
        self.every_frames > 0 && frame.is_multiple_of(self.every_frames)
    }

    fn frame(&self, frame: u64, truth: &Truth) -> Result<(), SimulateError> {
        if !self.wants(frame) {
            return Ok(());
        }
        let Truth { rgb, instance, depth_m } = truth;
        let size = (rgb.width, rgb.height);
        let path = |kind: &str| self.folder.join(kind).join(format!("{frame:06}.png"));
        save(&path("frame"), &rgb.data, size, image::ExtendedColorType::Rgb8)?;
        save(&path("instance"), &instance.data, size, image::ExtendedColorType::L8)?;
        // A cast from float saturates; `image` takes 16-bit samples in the machine's own byte order.
        let depth_mm: Vec<u16> = depth_m.iter().map(|depth| (depth * 1000.0 + 0.5) as u16).collect();
        save(&path("depth"), bytemuck::cast_slice(&depth_mm), size, image::ExtendedColorType::L16)
    }
}

fn save(
    path: &Path,
    data: &[u8],
    size_px: (u32, u32),
    color: image::ExtendedColorType,
) -> Result<(), SimulateError> {
    image::save_buffer_with_format(path, data, size_px.0, size_px.1, color, image::ImageFormat::Png)
        .map_err(|source| SimulateError::Picture { path: path.to_owned(), source })
}

fn make_folder(path: &Path) -> Result<(), SimulateError> {
    std::fs::create_dir_all(path).map_err(|source| SimulateError::File { path: path.to_owned(), source })
}

fn write_file(path: &Path, text: &str) -> Result<(), SimulateError> {
    std::fs::write(path, text).map_err(|source| SimulateError::File { path: path.to_owned(), source })
}
