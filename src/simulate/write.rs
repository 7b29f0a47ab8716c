//! A world into a folder: clips, exact truth, scene document, configuration.
//!
//! ```text
//! <out>/<world>.toml                    configuration that serves the clips
//! <out>/<world>.json                    scene document
//! <out>/calibration/<camera>.json       the cameras' calibrations alone, off by their errors as the scene's are
//! <out>/clips/<camera>.webm             what arrived of what the cameras saw
//! <out>/truth/truth.json                what lies beside it and what it means
//! <out>/truth/positions.jsonl           figures, one line a frame
//! <out>/truth/<camera>/delivery.jsonl   what arrived of each frame, and when
//! <out>/truth/<camera>/calibration.json the camera as it truly is
//! <out>/truth/<camera>/...              pictures of each frame, as `truth` lists them
//! ```
//!
//! Views where no camera stands lie under `truth/` as cameras do, with their calibrations, and have beside them what
//! judges a picture made from the cameras': `seen` (whether a camera of the world sees the surface, its figures left
//! out) and `static` (where seen, and no figure within 2 pixels), 255 or 0.
//!
//! Files of frames are named by the frame's number, from 0. Truth may be restricted to some frames, and what is written
//! to the views alone: a frame of a view then takes about a second.

use super::SimulateError;
use super::delivery::{Arrival, Delivery, Fate, deliver};
use super::effects::{Damage, Draw};
use super::options::{Device, Parts, SimulateOptions, Step, Wish, Written};
use super::seen::static_part;
use super::station::{Station, Wanted};
use super::truth::{
    JsonLines, Manifest, ManifestCamera, Of, TruthFolder, make_folder, save_mask, visible, write_file,
    write_manifest, write_positions,
};
use super::video::{Codec, VideoWriter};
use super::world::World;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::frame::{Mask, RgbImage};
use videofields_vision::geometry::Camera;

/// Simulates the world of this name, or in the file at this path, into the folder that the options name, as [`write()`]
/// does.
///
/// # Errors
/// When there is no such world, and as [`write()`].
pub fn run(world: &str, options: &SimulateOptions) -> Result<Written, SimulateError> {
    write(&World::load(world)?, options)
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
    let Wish { cameras, views, rate_hz, n_frames } = options.wish(world)?;
    let all: Vec<Camera> = cameras.iter().map(|device| device.camera.clone()).collect();
    let clips: &[Device] = if options.parts == Parts::Everything { &cameras } else { &[] };
    let n_parts = clips.len() + views.len();
    let mut job = Job { world, options, all: &all, n_parts, progress };
    let mut written = Written { config: None, clips: Vec::new(), views: Vec::new(), n_frames };
    if options.parts == Parts::Everything {
        written.config = Some(write_documents(world, options)?);
        make_folder(&options.out_dir.join("clips"))?;
    }
    let (mut camera_entries, mut view_entries) = (Vec::new(), Vec::new());
    for (part, device) in clips.iter().enumerate() {
        let (clip, entry) = job.camera(part, device)?;
        written.clips.push(clip);
        camera_entries.push(entry);
    }
    for (i, device) in views.iter().enumerate() {
        written.views.push(job.view(clips.len() + i, device)?);
        view_entries.push(entry(device, "frame"));
    }
    if clips.iter().chain(&views).any(|device| !device.wanted.is_empty()) {
        let folder = options.out_dir.join("truth");
        if options.parts == Parts::Everything {
            let time_of = |frame| frame as f64 / rate_hz;
            write_positions(folder.join("positions.jsonl"), world, &cameras, n_frames, time_of)?;
        }
        let manifest = Manifest {
            world: world.id(),
            rate_hz,
            n_frames,
            samples_per_side: options.samples_per_side,
            cameras: camera_entries,
            views: view_entries,
            effects: world.effects(),
        };
        write_manifest(&folder, &manifest)?;
    }
    Ok(written)
}

/// The manifest's entry of a camera or view.
fn entry(device: &Device, clean: &'static str) -> ManifestCamera {
    ManifestCamera {
        id: device.id.clone(),
        size_px: device.camera.size_px(),
        rate_hz: device.rate_hz,
        n_frames: device.n_frames,
        frames: device.wanted.clone(),
        calibration: format!("../calibration/{}.json", device.id),
        clip: None,
        clock: None,
        clean,
    }
}

/// One call's work.
struct Job<'a> {
    world: &'a World,
    options: &'a SimulateOptions,
    /// The world's cameras, in its order.
    all: &'a [Camera],
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

    /// What the world's camera of this number saw, as video and as truth; the clip and the manifest's entry.
    fn camera(&mut self, part: usize, device: &Device) -> Result<(PathBuf, ManifestCamera), SimulateError> {
        let (world, options) = (self.world, self.options);
        let (effects, entries) = (world.effects(), world.entries());
        let Device { id, camera, rate_hz, n_frames, .. } = device;
        let draw = Draw::of_camera(effects.seed, id);
        let late_secs = world.late_secs(id);
        let Delivery { clock, mut arrivals } = deliver(effects, draw, *n_frames, *rate_hz, entries);
        arrivals.iter_mut().for_each(|arrival| arrival.shift(late_secs));
        let by_frame = by_frame(&arrivals);
        if by_frame.is_empty() {
            return Err(SimulateError::NothingArrives { camera: id.clone() });
        }
        let clip = options.out_dir.join("clips").join(format!("{id}.webm"));
        let mut video = VideoWriter::create(&clip, camera.size_px(), *rate_hz, &Codec::of(effects, entries))?;
        let most = if device.wanted.is_empty() { Wanted::Picture } else { Wanted::Truth };
        let mut station = Station::new(world, id, camera, options.samples_per_side, *rate_hz, most)?;
        let mut truth = match most {
            Wanted::Picture => None,
            Wanted::Truth => Some(self.camera_truth(part, id, &station, &arrivals)?),
        };
        for frame in 0..*n_frames {
            let is_wanted = device.wanted.binary_search(&frame).is_ok();
            let wanted = if is_wanted { Wanted::Truth } else { Wanted::Picture };
            let arriving = by_frame.get(&frame);
            if is_wanted || arriving.is_some() || station.remembers() {
                let time_secs = device.time_of(frame) + late_secs;
                let shot = station.shoot(frame, time_secs, wanted)?;
                for arrival in arriving.into_iter().flatten() {
                    send(world, &mut video, draw, arrival, shot.picture(), *rate_hz)?;
                }
                if let (Wanted::Truth, Some((truth, figures))) = (wanted, &mut truth) {
                    truth.frame(frame, &shot.truth, shot.from_sensor.as_ref())?;
                    figures.write(&visible(frame, time_secs, &shot.truth.instance))?;
                }
            }
            self.tell(part, format!("camera {id}"), frame + 1, *n_frames);
        }
        video.finish()?;
        if let Some((_, figures)) = truth {
            figures.finish()?;
        }
        let clean = if station.has_sensor() { "clean" } else { "frame" };
        let clip_of = Some(format!("../clips/{id}.webm"));
        let entry = ManifestCamera { clip: clip_of, clock: Some(clock), ..entry(device, clean) };
        let calibration = match most {
            Wanted::Picture => entry.calibration,
            Wanted::Truth => format!("{id}/calibration.json"),
        };
        Ok((clip, ManifestCamera { calibration, ..entry }))
    }

    /// The folder of a camera's truth with what is known before its frames, and the file of what they show.
    fn camera_truth(
        &self,
        number: usize,
        id: &str,
        station: &Station<'_>,
        arrivals: &[Arrival],
    ) -> Result<(TruthFolder, JsonLines), SimulateError> {
        let of = if station.has_sensor() { Of::CameraWithSensor } else { Of::Camera };
        let (camera, plate) = (station.camera(), station.plate());
        let truth = TruthFolder::create(self.folder(id), camera, &plate.truth().rgb, of)?;
        write_file(&truth.folder.join("calibration.json"), &calibration_text(camera)?)?;
        let mut lines = JsonLines::create(truth.folder.join("delivery.jsonl"))?;
        arrivals.iter().try_for_each(|arrival| lines.write(arrival))?;
        lines.finish()?;
        let (width, height) = camera.size_px();
        let mut seen_by = Mask::filled(width, height, 0);
        for (_, other) in self.all.iter().enumerate().filter(|(other, _)| *other != number) {
            let seen = self.world.seen_by(plate, std::slice::from_ref(other));
            for (count, seen) in seen_by.data.iter_mut().zip(&seen.data) {
                *count = count.saturating_add(u8::from(*seen > 0));
            }
        }
        save_mask(&truth.folder.join("seen_by.png"), &seen_by)?;
        let figures = JsonLines::create(truth.folder.join("visible.jsonl"))?;
        Ok((truth, figures))
    }

    /// The truth of a view; its folder.
    fn view(&mut self, part: usize, device: &Device) -> Result<PathBuf, SimulateError> {
        let (world, options) = (self.world, self.options);
        let Device { id, camera, wanted, .. } = device;
        write_calibration(options, id, camera)?;
        if wanted.is_empty() {
            return Ok(self.folder(id));
        }
        let mut station = Station::free(world, camera, options.samples_per_side)?;
        let background = &station.plate().truth().rgb;
        let truth = TruthFolder::create(self.folder(id), camera, background, Of::View)?;
        let seen = world.seen_by(station.plate(), self.all);
        for (n_done, frame) in (1..).zip(wanted) {
            let shot = station.shoot(*frame, device.time_of(*frame), Wanted::Truth)?;
            truth.frame(*frame, &shot.truth, None)?;
            truth.mask("seen", *frame, &seen)?;
            truth.mask("static", *frame, &static_part(&shot.truth, &seen))?;
            self.tell(part, format!("view {id}"), n_done, wanted.len() as u64);
        }
        Ok(truth.folder)
    }
}

/// Hands an arriving picture to the video, damaged if it arrives so.
pub(super) fn send(
    world: &World,
    video: &mut VideoWriter,
    draw: Draw,
    arrival: &Arrival,
    picture: &RgbImage,
    rate_hz: f64,
) -> Result<(), SimulateError> {
    let Some(start_secs) = arrival.clip_secs else { return Ok(()) };
    let share = if arrival.has(Fate::Duplicated) { 0.5 } else { 1.0 };
    let duration_secs = share / rate_hz;
    let corrupt = world.effects().corrupt.filter(|_| arrival.has(Fate::Corrupted));
    match corrupt {
        None => video.push(picture, start_secs, duration_secs, None),
        Some(corrupt) if corrupt.damage == Damage::Blocks => {
            let mut broken = picture.clone();
            let tally = world.entries().tally();
            corrupt.damage_blocks(&mut broken, draw.at_frame(arrival.frame), &tally);
            video.push(&broken, start_secs, duration_secs, None)
        }
        Some(corrupt) => {
            let (entries, draw) = (Arc::clone(&world.entries), draw.at_frame(arrival.frame));
            let damage = move |bytes: &mut [u8]| corrupt.damage_bytes(bytes, draw, &entries.tally());
            video.push(picture, start_secs, duration_secs, Some(Box::new(damage)))
        }
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
fn write_documents(world: &World, options: &SimulateOptions) -> Result<PathBuf, SimulateError> {
    let out = &options.out_dir;
    make_folder(out)?;
    let config = out.join(format!("{}.toml", world.id()));
    write_file(&config, &world.config_toml(&options.database)?)?;
    write_file(&out.join(format!("{}.json", world.id())), &world.scene_json(options.size_px)?)?;
    for (id, camera) in world.calibrated_at(options.size_px)? {
        write_calibration(options, id, &camera)?;
    }
    Ok(config)
}

fn write_calibration(options: &SimulateOptions, id: &str, camera: &Camera) -> Result<(), SimulateError> {
    let folder = options.out_dir.join("calibration");
    make_folder(&folder)?;
    write_file(&folder.join(format!("{id}.json")), &calibration_text(camera)?)
}

fn calibration_text(camera: &Camera) -> Result<String, SimulateError> {
    Ok(serde_json::to_string_pretty(&CameraDocument::from_camera(camera))? + "\n")
}
