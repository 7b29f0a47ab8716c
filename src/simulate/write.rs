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
//! Views where no camera stands lie under `truth/` as cameras do, with their calibrations, and have beside them what
//! judges a picture made from the cameras' (8 bits each, 255 or 0):
//!
//! ```text
//! <out>/truth/<view>/seen/000000.png        whether a camera of the world sees the surface, its figures left out
//! <out>/truth/<view>/static/000000.png      where seen, and no figure within 2 pixels
//! ```
//!
//! Files of frames are named by the frame's number in the clip, from 0. Truth may be restricted to some frames, and
//! what is written to the views alone: a frame of a view then takes about a second.

use super::cast::{Plate, Truth, check_samples};
use super::seen::static_part;
use super::video::VideoWriter;
use super::world::World;
use super::{SimulateError, pinhole};
use crate::calibrate::CameraDocument;
use crate::frame::{Mask, is_id};
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
    /// Truth is written for these frames alone, given by their times, seconds from the clips' start; each must be
    /// the time of a frame. Default: empty, which leaves it to `truth_every_frames`.
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
            rate_hz: 10.0,
            size_px: (640, 360),
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
    let wanted = wanted_frames(options, n_frames)?;
    let views = views(world, options)?;
    let cameras = world.cameras(options.size_px)?;
    let (config, clips) = match options.parts {
        Parts::Everything => {
            let config = write_documents(world, options, &cameras)?;
            if !wanted.is_empty() {
                write_positions(world, options, n_frames)?;
            }
            (Some(config), write_clips(world, options, &cameras, n_frames, &wanted)?)
        }
        Parts::Views => (None, Vec::new()),
    };
    let cameras: Vec<Camera> = cameras.into_iter().map(|(_, camera)| camera).collect();
    let mut view_folders = Vec::new();
    for (id, camera) in &views {
        write_calibration(options, id, camera)?;
        let plate = world.plate(camera, options.samples_per_side)?;
        let truth = TruthWriter::create(options, id, &plate, &wanted, &VIEW_KINDS)?;
        let seen = world.seen_by(&plate, &cameras);
        for frame in &wanted {
            truth.judged_frame(*frame, &world.render_over(&plate, time_of(*frame, options))?, &seen)?;
        }
        view_folders.push(truth.folder);
    }
    Ok(Written { config, clips, views: view_folders, n_frames })
}

/// Scene document, configuration, calibrations; the configuration's path.
fn write_documents(
    world: &World,
    options: &SimulateOptions,
    cameras: &[(&str, Camera)],
) -> Result<PathBuf, SimulateError> {
    let out = &options.out_dir;
    make_folder(out)?;
    let config = out.join(format!("{}.toml", world.id()));
    write_file(&config, &world.config_toml(&options.database)?)?;
    write_file(&out.join(format!("{}.json", world.id())), &world.scene_json(options.size_px)?)?;
    for (id, camera) in cameras {
        write_calibration(options, id, camera)?;
    }
    Ok(config)
}

fn write_calibration(options: &SimulateOptions, id: &str, camera: &Camera) -> Result<(), SimulateError> {
    let folder = options.out_dir.join("calibration");
    make_folder(&folder)?;
    let text = serde_json::to_string_pretty(&CameraDocument::from_camera(camera))? + "\n";
    write_file(&folder.join(format!("{id}.json")), &text)
}

/// What the cameras saw, as video and as truth.
fn write_clips(
    world: &World,
    options: &SimulateOptions,
    cameras: &[(&str, Camera)],
    n_frames: u64,
    wanted: &[u64],
) -> Result<Vec<PathBuf>, SimulateError> {
    let folder = options.out_dir.join("clips");
    make_folder(&folder)?;
    let mut clips = Vec::new();
    for (id, camera) in cameras {
        let clip = folder.join(format!("{id}.webm"));
        let mut video = VideoWriter::create(&clip, options.size_px, options.rate_hz)?;
        let plate = world.plate(camera, options.samples_per_side)?;
        let truth = TruthWriter::create(options, id, &plate, wanted, &CAMERA_KINDS)?;
        for frame in 0..n_frames {
            let seen = world.render_over(&plate, time_of(frame, options))?;
            video.push(&seen.rgb)?;
            if wanted.contains(&frame) {
                truth.frame(frame, &seen)?;
            }
        }
        video.finish()?;
        clips.push(clip);
    }
    Ok(clips)
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

/// The frames whose truth is written, in order.
fn wanted_frames(options: &SimulateOptions, n_frames: u64) -> Result<Vec<u64>, SimulateError> {
    if options.truth_at_secs.is_empty() {
        let step = options.truth_every_frames as usize;
        return Ok(if step == 0 { Vec::new() } else { (0..n_frames).step_by(step).collect() });
    }
    let frame_at = |seconds: &f64| {
        let place = seconds * options.rate_hz;
        let is_frame =
            (place - place.round()).abs() < 1e-6 && place > -0.5 && place.round() < n_frames as f64;
        let allowed = "the time of a frame of the clips: a multiple of 1/rate within their length";
        is_frame
            .then_some(place.round() as u64)
            .ok_or(SimulateError::View { field: "time of truth", allowed })
    };
    let mut frames = options.truth_at_secs.iter().map(frame_at).collect::<Result<Vec<_>, _>>()?;
    frames.sort_unstable();
    frames.dedup();
    Ok(frames)
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

/// Folders of a camera's truth, and of a view's where no camera stands.
const CAMERA_KINDS: [&str; 3] = ["frame", "instance", "depth"];
const VIEW_KINDS: [&str; 5] = ["frame", "instance", "depth", "seen", "static"];

/// Writes one camera's truth.
struct TruthWriter {
    folder: PathBuf,
}

impl TruthWriter {
    /// Makes the folders and writes the still world, where any frame is wanted.
    fn create(
        options: &SimulateOptions,
        id: &str,
        plate: &Plate,
        wanted: &[u64],
        kinds: &[&str],
    ) -> Result<Self, SimulateError> {
        let folder = options.out_dir.join("truth").join(id);
        if !wanted.is_empty() {
            for kind in kinds {
                make_folder(&folder.join(kind))?;
            }
            let rgb = &plate.truth().rgb;
            let path = folder.join("background.png");
            save(&path, &rgb.data, (rgb.width, rgb.height), image::ExtendedColorType::Rgb8)?;
        }
        Ok(Self { folder })
    }

    fn path(&self, kind: &str, frame: u64) -> PathBuf {
        self.folder.join(kind).join(format!("{frame:06}.png"))
    }

    fn frame(&self, frame: u64, truth: &Truth) -> Result<(), SimulateError> {
        let Truth { rgb, instance, depth_m, .. } = truth;
        let size = (rgb.width, rgb.height);
        save(&self.path("frame", frame), &rgb.data, size, image::ExtendedColorType::Rgb8)?;
        save(&self.path("instance", frame), &instance.data, size, image::ExtendedColorType::L8)?;
        // A cast from float saturates; `image` takes 16-bit samples in the machine's own byte order.
        let depth_mm: Vec<u16> = depth_m.iter().map(|depth| (depth * 1000.0 + 0.5) as u16).collect();
        let bytes = bytemuck::cast_slice(&depth_mm);
        save(&self.path("depth", frame), bytes, size, image::ExtendedColorType::L16)
    }

    fn judged_frame(&self, frame: u64, truth: &Truth, seen: &Mask) -> Result<(), SimulateError> {
        self.frame(frame, truth)?;
        for (kind, mask) in [("seen", seen), ("static", &static_part(truth, seen))] {
            let size = (mask.width, mask.height);
            save(&self.path(kind, frame), &mask.data, size, image::ExtendedColorType::L8)?;
        }
        Ok(())
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
