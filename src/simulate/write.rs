//! A world into a folder: clips, exact truth, scene document, configuration.
//!
//! ```text
//! <out>/<world>.toml                    configuration that serves the clips
//! <out>/<world>.json                    scene document
//! <out>/calibration/<camera>.json       the cameras' calibrations alone
//! <out>/clips/<camera>.webm             what arrived of what the cameras saw
//! <out>/truth/truth.json                what lies beside it and what it means
//! <out>/truth/positions.jsonl           figures, one line a frame
//! <out>/truth/<camera>/delivery.jsonl   what arrived of each frame, and when
//! <out>/truth/<camera>/...              pictures of each frame, as `truth` lists them
//! ```
//!
//! Views where no camera stands lie under `truth/` as cameras do, with their calibrations, and have beside them what
//! judges a picture made from the cameras': `seen` (whether a camera of the world sees the surface, its figures left
//! out) and `static` (where seen, and no figure within 2 pixels), 255 or 0.
//!
//! Files of frames are named by the frame's number, from 0. Truth may be restricted to some frames, and what is written
//! to the views alone: a frame of a view then takes about a second.

use super::cast::check_samples;
use super::delivery::{Arrival, Delivery, Fate, damaged, deliver};
use super::effects::{Damage, Draw};
use super::seen::static_part;
use super::station::Station;
use super::truth::{
    JsonLines, Manifest, ManifestCamera, Of, TruthFolder, make_folder, save_mask, visible, write_file,
    write_manifest, write_positions,
};
use super::video::{Codec, Damager, VideoWriter};
use super::world::World;
use super::{SimulateError, pinhole};
use crate::calibrate::CameraDocument;
use crate::frame::{Mask, is_id};
use crate::geometry::Camera;
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

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

/// Simulates the world with this id into the folder that the options name, as [`write()`] does.
///
/// # Errors
/// When there is no such world, and as [`write()`].
pub fn run(world_id: &str, options: &SimulateOptions) -> Result<Written, SimulateError> {
    write(&World::named(world_id)?, options)
}

/// Simulates `world` into the folder that the options name.
///
/// **Cost** of the defaults: about two minutes on two cores and 300 MB; 4 MB without truth.
///
/// # Errors
/// When an option is out of its range, GStreamer has no VP8 encoder or WebM muxer, a file cannot be written, or no
/// frame of a camera arrives.
pub fn write(world: &World, options: &SimulateOptions) -> Result<Written, SimulateError> {
    write_with(world, options, &mut |_step| ())
}

/// As [`write()`], and tells `progress` after every frame.
///
/// # Errors
/// As [`write()`].
pub fn write_with(
    world: &World,
    options: &SimulateOptions,
    progress: &mut dyn FnMut(&Step),
) -> Result<Written, SimulateError> {
    let n_frames = n_frames(world, options)?;
    let wanted = wanted_frames(options, n_frames)?;
    let views = views(world, options)?;
    let cameras = match options.parts {
        Parts::Everything => world.cameras(options.size_px)?,
        Parts::Views => Vec::new(),
    };
    let all: Vec<Camera> = world.cameras(options.size_px)?.into_iter().map(|(_, camera)| camera).collect();
    let mut job = Job { world, options, n_frames, wanted, n_parts: cameras.len() + views.len(), progress };
    let mut written = Written { config: None, clips: Vec::new(), views: Vec::new(), n_frames };
    let mut manifest = Vec::new();
    if options.parts == Parts::Everything {
        written.config = Some(write_documents(world, options, &cameras)?);
        make_folder(&options.out_dir.join("clips"))?;
    }
    for (i, (id, camera)) in cameras.iter().enumerate() {
        let (clip, entry) = job.camera(i, id, camera, &all)?;
        written.clips.push(clip);
        manifest.push(entry);
    }
    let mut manifest_views = Vec::new();
    for (i, (id, camera)) in views.iter().enumerate() {
        written.views.push(job.view(cameras.len() + i, id, camera, &all)?);
        manifest_views.push(entry(id, camera, "frame"));
    }
    if !job.wanted.is_empty() {
        let folder = options.out_dir.join("truth");
        if options.parts == Parts::Everything {
            let path = folder.join("positions.jsonl");
            write_positions(path, world, &cameras, n_frames, |frame| time_of(frame, options))?;
        }
        let manifest = Manifest {
            world: world.id(),
            rate_hz: options.rate_hz,
            n_frames,
            samples_per_side: options.samples_per_side,
            frames: &job.wanted,
            cameras: manifest,
            views: manifest_views,
            effects: world.effects(),
        };
        write_manifest(&folder, &manifest)?;
    }
    Ok(written)
}

/// The manifest's entry of a camera or view.
fn entry(id: &str, camera: &Camera, clean: &'static str) -> ManifestCamera {
    ManifestCamera {
        id: id.to_owned(),
        size_px: camera.size_px(),
        calibration: format!("../calibration/{id}.json"),
        clip: None,
        clock: None,
        clean,
    }
}

/// One call's work.
struct Job<'a> {
    world: &'a World,
    options: &'a SimulateOptions,
    n_frames: u64,
    wanted: Vec<u64>,
    n_parts: usize,
    progress: &'a mut dyn FnMut(&Step),
}

impl Job<'_> {
    fn folder(&self, id: &str) -> PathBuf {
        self.options.out_dir.join("truth").join(id)
    }

    fn tell(&mut self, part: usize, what: String, n_done: u64, n_frames: u64) {
        (self.progress)(&Step { what, n_done, n_frames, part: (part + 1, self.n_parts) });
    }

    /// What a camera saw, as video and as truth; the clip and the manifest's entry.
    fn camera(
        &mut self,
        part: usize,
        id: &str,
        camera: &Camera,
        all: &[Camera],
    ) -> Result<(PathBuf, ManifestCamera), SimulateError> {
        let (world, options) = (self.world, self.options);
        let (effects, entries) = (world.effects(), world.entries());
        let draw = Draw::of_camera(effects.seed, id);
        let Delivery { clock, arrivals } = deliver(effects, draw, self.n_frames, options.rate_hz, entries);
        let by_frame = by_frame(&arrivals);
        if by_frame.is_empty() {
            return Err(SimulateError::NothingArrives { camera: id.to_owned() });
        }
        let clip = options.out_dir.join("clips").join(format!("{id}.webm"));
        let codec = Codec::of(effects, entries);
        let mut video = VideoWriter::create(&clip, options.size_px, options.rate_hz, &codec)?;
        let mut station = Station::new(
            world,
            id,
            camera,
            options.samples_per_side,
            options.rate_hz,
            !self.wanted.is_empty(),
        )?;
        let truth = self.camera_truth(id, &station, &arrivals, all)?;
        let mut seen_figures = match &truth {
            Some(truth) => Some(JsonLines::create(truth.folder.join("visible.jsonl"))?),
            None => None,
        };
        for frame in 0..self.n_frames {
            let is_wanted = self.wanted.binary_search(&frame).is_ok();
            let arriving = by_frame.get(&frame);
            let time_secs = time_of(frame, options);
            if is_wanted || arriving.is_some() || station.remembers() {
                let shot = station.shoot(frame, time_secs, is_wanted)?;
                for arrival in arriving.into_iter().flatten() {
                    self.push(&mut video, draw, arrival, shot.picture())?;
                }
                if let (true, Some(truth), Some(seen)) = (is_wanted, &truth, &mut seen_figures) {
                    truth.frame(frame, &shot.truth, shot.from_sensor.as_ref())?;
                    seen.write(&visible(frame, time_secs, &shot.truth.instance))?;
                }
            }
            self.tell(part, format!("camera {id}"), frame + 1, self.n_frames);
        }
        video.finish()?;
        if let Some(seen) = seen_figures {
            seen.finish()?;
        }
        let clean = if station.has_sensor() { "clean" } else { "frame" };
        let entry = ManifestCamera {
            clip: Some(format!("../clips/{id}.webm")),
            clock: Some(clock),
            ..entry(id, camera, clean)
        };
        Ok((clip, entry))
    }

    /// The folder of a camera's truth, if any is wanted, with what is known before its frames.
    fn camera_truth(
        &self,
        id: &str,
        station: &Station<'_>,
        arrivals: &[Arrival],
        all: &[Camera],
    ) -> Result<Option<TruthFolder>, SimulateError> {
        if self.wanted.is_empty() {
            return Ok(None);
        }
        let of = if station.has_sensor() { Of::CameraWithSensor } else { Of::Camera };
        let camera = station.camera();
        let plate = station.plate();
        let truth = TruthFolder::create(self.folder(id), camera, &plate.truth().rgb, of)?;
        let mut lines = JsonLines::create(truth.folder.join("delivery.jsonl"))?;
        arrivals.iter().try_for_each(|arrival| lines.write(arrival))?;
        lines.finish()?;
        let (width, height) = camera.size_px();
        let mut seen_by = Mask::filled(width, height, 0);
        for other in all.iter().filter(|other| *other != camera) {
            let seen = self.world.seen_by(plate, std::slice::from_ref(other));
            for (count, seen) in seen_by.data.iter_mut().zip(&seen.data) {
                *count = count.saturating_add(u8::from(*seen > 0));
            }
        }
        save_mask(&truth.folder.join("seen_by.png"), &seen_by)?;
        Ok(Some(truth))
    }

    /// Hands an arriving picture to the video, damaged if it arrives so.
    fn push(
        &self,
        video: &mut VideoWriter,
        draw: Draw,
        arrival: &Arrival,
        picture: &crate::frame::RgbImage,
    ) -> Result<(), SimulateError> {
        let Some(start_secs) = arrival.clip_secs else { return Ok(()) };
        let effects = self.world.effects();
        let is_damaged = arrival.has(Fate::Corrupted);
        let with_blocks = if is_damaged {
            damaged(effects, draw, arrival.frame, picture, self.world.entries())
        } else {
            None
        };
        let corrupt = effects.corrupt.filter(|corrupt| is_damaged && corrupt.damage == Damage::Bytes);
        let bytes = corrupt.map(|corrupt| {
            let (entries, draw) = (Arc::clone(&self.world.entries), draw.at_frame(arrival.frame));
            Box::new(move |bytes: &mut [u8]| corrupt.damage_bytes(bytes, draw, &entries.tally())) as Damager
        });
        let share = if arrival.has(Fate::Duplicated) { 0.5 } else { 1.0 };
        let duration_secs = share / self.options.rate_hz;
        video.push(with_blocks.as_ref().unwrap_or(picture), start_secs, duration_secs, bytes)
    }

    /// The truth of a view; its folder.
    fn view(
        &mut self,
        part: usize,
        id: &str,
        camera: &Camera,
        all: &[Camera],
    ) -> Result<PathBuf, SimulateError> {
        let (world, options) = (self.world, self.options);
        write_calibration(options, id, camera)?;
        let mut station = Station::free(world, camera, options.samples_per_side)?;
        if self.wanted.is_empty() {
            return Ok(self.folder(id));
        }
        let background = &station.plate().truth().rgb;
        let truth = TruthFolder::create(self.folder(id), camera, background, Of::View)?;
        let seen = world.seen_by(station.plate(), all);
        let frames = self.wanted.clone();
        for (n_done, frame) in (1..).zip(&frames) {
            let shot = station.shoot(*frame, time_of(*frame, options), true)?;
            truth.frame(*frame, &shot.truth, None)?;
            truth.mask("seen", *frame, &seen)?;
            truth.mask("static", *frame, &static_part(&shot.truth, &seen))?;
            self.tell(part, format!("view {id}"), n_done, frames.len() as u64);
        }
        Ok(truth.folder)
    }
}

/// What arrives of each frame, in the order of its places in the clip.
fn by_frame(arrivals: &[Arrival]) -> BTreeMap<u64, Vec<&Arrival>> {
    let mut by_frame: BTreeMap<u64, Vec<&Arrival>> = BTreeMap::new();
    for arrival in arrivals.iter().filter(|arrival| arrival.clip_secs.is_some()) {
        by_frame.entry(arrival.frame).or_default().push(arrival);
    }
    by_frame.values_mut().for_each(|copies| copies.sort_by_key(|arrival| arrival.copy));
    by_frame
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
