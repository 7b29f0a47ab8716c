//! `segment`: what moves in a video, as masks, blobs and tracks, without a daemon.

use super::given::{Tables, camera, pipeline};
use anyhow::{Context, Result, bail};
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::PathBuf;
use std::sync::Arc;
use toml::Value;
use videofields_picture::scene;
use videofields_recording::ingest::{self, MediaRoots};
use videofields_recording::timeline::Event;
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config::{CameraSettings, SourceSettings, Timing};
use videofields_vision::encode;
use videofields_vision::frame::Frame;
use videofields_vision::observation::Observation;
use videofields_vision::segment::{ObjectSizes, PixelRect};

/// Finds what moves in a video: masks, blobs, tracks and events.
///
/// Without --masks, --blobs, --tracks and --events it only runs, for timing. Lines on standard error say which stages of detection
/// ran and why, and how many frames a second
/// were decoded, learned, segmented and tracked.
#[derive(Debug, clap::Args)]
pub(crate) struct Segment {
    /// A video file, or a pattern of numbered pictures such as in%06d.jpg.
    #[arg(long, value_name = "FILE|PATTERN")]
    input: PathBuf,
    /// Writes one 8-bit PNG a frame into this folder: 255 moving, 50 shadow, 0 background, named by the frame's
    /// number in the input from 0.
    #[arg(long, value_name = "DIR")]
    masks: Option<PathBuf>,
    /// Writes blobs as JSON lines: {"frame": number, "rect": [x, y, width, height], "area": pixels}.
    #[arg(long, value_name = "FILE")]
    blobs: Option<PathBuf>,
    /// Writes tracks as JSON lines: {"frame": number, "id": number, "rect": [x, y, width, height], "blob": index of
    /// the frame's blob that shows it, or null}.
    #[arg(long, value_name = "FILE")]
    tracks: Option<PathBuf>,
    /// Writes events as JSON lines: {"frame": number, "kind": its name, "rect": [x, y, width, height] or null,
    /// "track": id or null, "over": whether it is over}.
    #[arg(long, value_name = "FILE")]
    events: Option<PathBuf>,
    /// A clip (or pattern) of the empty place that is learned first.
    #[arg(long, value_name = "FILE|PATTERN")]
    background: Option<PathBuf>,
    /// Keeps the background as the clip left it.
    #[arg(long, requires = "background")]
    hold: bool,
    /// Times frames by their number at this rate, frames a second, instead of by the file's timestamps.
    /// Numbered pictures come at 25 if absent.
    #[arg(long, value_name = "RATE", allow_negative_numbers = true)]
    rate_hz: Option<f64>,
    /// Stops after this many frames.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..))]
    frames: Option<u64>,
    /// Blurred difference that is foreground, share of full scale, 0.001 to 1; 0.12 if absent.
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    delta: Option<f64>,
    /// Any other setting of a camera, as in its tables of a configuration file: --set background.modes=5. Repeatable;
    /// wins over the flags above.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Least area of a blob, pixels; a 1500th of the picture's if absent.
    #[arg(long, value_name = "PIXELS")]
    min_area_px: Option<u32>,
    /// A scene document with the camera's calibration, from which sizes of people are known, as in the daemon.
    #[arg(long, value_name = "FILE", requires = "camera")]
    scene: Option<PathBuf>,
    /// The camera's id in the scene.
    #[arg(long, value_name = "ID", requires = "scene")]
    camera: Option<String>,
}

impl Segment {
    pub(crate) fn run(&self) -> Result<()> {
        let settings = self.settings()?;
        let mut pipeline = pipeline(&settings);
        pipeline.set_object_sizes(self.object_sizes()?);
        let mut output = Output::open(self)?;
        if let Some(clip) = &self.background {
            let roots = MediaRoots::of_caller(clip)?;
            ingest::learn_clip(&mut pipeline, clip, self.rate_hz, &roots)?;
        }

        let roots = MediaRoots::of_caller(&self.input)?;
        let mut source = ingest::open(&settings.source, &roots)?;
        let clock = SystemClock::new();
        let started = clock.monotonic();
        let mut n_frames = 0_u64;
        while self.frames.is_none_or(|most| n_frames < most) {
            let Some(next) = source.next_frame()? else { break };
            let frame = Frame {
                camera: settings.id.clone(),
                timestamp: Timestamp::from_nanos(next.stream_nanos),
                number: next.number,
                image: Arc::clone(&next.image),
            };
            output.write(&pipeline.process(frame))?;
            output.write_events(next.number, &pipeline.take_events())?;
            n_frames += 1;
        }
        if n_frames == 0 {
            bail!("{} holds no frame", self.input.display());
        }
        output.finish()?;
        let secs = clock.monotonic().saturating_sub(started).as_secs_f64().max(1e-9);
        for state in pipeline.stages().into_iter().flatten() {
            super::complain(&state.to_string());
        }
        super::complain(&format!(
            "{n_frames} frames in {secs:.2} s, {:.1} frames a second",
            n_frames as f64 / secs
        ));
        Ok(())
    }

    /// Returns the sizes of objects by the scene; none where no scene is named.
    fn object_sizes(&self) -> Result<Option<Arc<ObjectSizes>>> {
        let (Some(file), Some(id)) = (&self.scene, &self.camera) else { return Ok(None) };
        let scene = super::scene::load(file)?.scene;
        let member = scene.cameras.iter().find(|member| member.id.as_str() == id).with_context(|| {
            let known = scene.cameras.iter().map(|member| member.id.as_str()).collect::<Vec<_>>().join(", ");
            format!("--camera {id}: {} has no such camera; it has {known}", file.display())
        })?;
        Ok(Some(Arc::new(scene::object_sizes(&scene, member))))
    }

    /// The flags as a camera's settings, held to the same ranges.
    fn settings(&self) -> Result<CameraSettings> {
        let source = SourceSettings {
            timing: self.rate_hz.map(|_| Timing::Index),
            rate_hz: self.rate_hz.unwrap_or(25.0),
            ..SourceSettings::of_path(&self.input)
        };
        let mut given = Tables::of_flags(self.set.iter().map(String::as_str))?;
        for (section, key, value) in [
            ("background", "clip", self.background.as_ref().map(|clip| clip.display().to_string().into())),
            ("background", "learning", self.hold.then(|| "hold".into())),
            ("segment", "delta", self.delta.map(Value::from)),
            ("segment", "min_area_px", self.min_area_px.map(|px| i64::from(px).into())),
        ] {
            if let Some(value) = value {
                given.give(section, key, value);
            }
        }
        camera(given, source)
    }
}

/// A rectangle as it is written: x, y, width, height.
const fn sides(rect: PixelRect) -> [u32; 4] {
    [rect.x, rect.y, rect.width, rect.height]
}

/// Where results go.
struct Output {
    masks: Option<PathBuf>,
    blobs: Option<BufWriter<File>>,
    tracks: Option<BufWriter<File>>,
    events: Option<BufWriter<File>>,
}

impl Output {
    fn open(flags: &Segment) -> Result<Self> {
        if let Some(folder) = &flags.masks {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        }
        let open = |path: &PathBuf| {
            let file = File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
            anyhow::Ok(BufWriter::new(file))
        };
        Ok(Self {
            masks: flags.masks.clone(),
            blobs: flags.blobs.as_ref().map(open).transpose()?,
            tracks: flags.tracks.as_ref().map(open).transpose()?,
            events: flags.events.as_ref().map(open).transpose()?,
        })
    }

    fn write_events(&mut self, number: u64, happened: &[Event]) -> Result<()> {
        let Some(events) = &mut self.events else { return Ok(()) };
        for event in happened {
            let line = serde_json::json!({
                "frame": number, "kind": event.kind, "rect": event.rect.map(sides), "track": event.track,
                "over": event.is_end,
            });
            writeln!(events, "{line}")?;
        }
        Ok(())
    }

    fn write(&mut self, observation: &Observation) -> Result<()> {
        let number = observation.frame.number;
        if let Some(folder) = &self.masks {
            let path = folder.join(format!("{number:06}.png"));
            let png = encode::png_gray(&observation.labels)?;
            std::fs::write(&path, png).with_context(|| format!("cannot write {}", path.display()))?;
        }
        if let Some(blobs) = &mut self.blobs {
            for blob in observation.blobs.iter() {
                let line =
                    serde_json::json!({ "frame": number, "rect": sides(blob.rect), "area": blob.area_px });
                writeln!(blobs, "{line}")?;
            }
        }
        if let Some(tracks) = &mut self.tracks {
            for track in observation.tracks.iter() {
                let line = serde_json::json!({
                    "frame": number, "id": track.id, "rect": sides(track.rect), "blob": track.blob_idx,
                });
                writeln!(tracks, "{line}")?;
            }
        }
        Ok(())
    }

    fn finish(self) -> Result<()> {
        if let Some(mut blobs) = self.blobs {
            blobs.flush().context("cannot write the blobs")?;
        }
        if let Some(mut tracks) = self.tracks {
            tracks.flush().context("cannot write the tracks")?;
        }
        if let Some(mut events) = self.events {
            events.flush().context("cannot write the events")?;
        }
        Ok(())
    }
}
