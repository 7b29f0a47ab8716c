//! `bench placing`: whether everybody is found, once, where they stand and under one id, and how long that takes.

mod calibration;
mod costs;
mod identity;
mod judge;
mod recording;
mod score;
mod table;
mod true_masks;
mod truth;
mod world;

use anyhow::{Context as _, Result, ensure};
use calibration::disturbed;
use judge::{Judge, Method};
use recording::Recording;
use std::path::PathBuf;
use table::{Outcome, write_tables};
use videofields_picture::scene::Scene;
use videofields_recording::telemetry::{self, LogFormat};
use videofields_simulate::World;
use videofields_vision::clock::SystemClock;

/// Judges where entities stand against where everybody is in truth, and prints a table.
///
/// A world is played for one period to learn and for the same period to be judged, as its cameras' sensors see it. At every
/// instant entities are matched with people one to one, up to --gate-m apart on the ground; a match of the instant before is
/// kept while it is within that. Somebody counts while a camera shows 40 pixels of them or more (of recordings: while their
/// truth says so); of others nothing is expected. MODA is 1 less the share of missed and false ones, MODP how near the matches are (1 where they stand exactly, 0
/// at the gate), IDF1 how much of everybody's time belongs to one id.
#[derive(Debug, clap::Args)]
pub(super) struct Placing {
    /// A world: a name of the catalogue or the path of its document. Repeatable.
    #[arg(long, value_name = "NAME|FILE", required_unless_present_any = ["recording", "costs"])]
    world: Vec<String>,
    /// A folder with clips, one configuration (*.toml) that names them and a scene, and positions.jsonl, as
    /// `videofields-lab simulate` writes it (docs/truth.md). Its clips are played twice, and judged the second time.
    /// Repeatable.
    #[arg(long, value_name = "DIR")]
    recording: Vec<PathBuf>,
    /// Distance on the ground within which an entity is somebody, metres, 0.01 to 100. Cars and cyclists are met
    /// anywhere over the ground that they cover.
    #[arg(long, value_name = "METRES", default_value_t = 0.5)]
    gate_m: f64,
    /// Instants a second, 0.1 to 240: of worlds, their cameras' frames (default 10); of recordings, of their truth at most
    /// (default all).
    #[arg(long, value_name = "RATE")]
    rate_hz: Option<f64>,
    /// Masks that blobs are made of: those of segmentation, or true ones, which show everybody and nothing else; of worlds alone.
    #[arg(long, value_enum, default_value_t = Masks::Ours, conflicts_with = "recording")]
    masks: Masks,
    /// Segments recordings as cameras are segmented by default, whatever their configurations say.
    #[arg(long, requires = "recording")]
    default_segmentation: bool,
    /// Selects how people are placed. Occupancy gives everybody a new id at every instant, so that IDF1 and switches mean nothing, and its table
    /// of pixels is association's.
    #[arg(long, value_enum, default_value_t = Method::Both)]
    by: Method,
    /// Puts every camera's pose off before cameras are associated, until the ground that it shows is shifted by so many pixels of its
    /// picture (root mean square), 0 to 100.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    calibration_error_px: f64,
    /// Number that the direction of calibration errors hangs on.
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    seed: u64,
    /// Corrects calibrations by people whom several cameras saw in the time that is learned, and prints the corrections.
    #[arg(long)]
    corrected: bool,
    /// Measures how the time of an instant grows with cameras and with people, on a square of its own, and prints a table.
    #[arg(long, conflicts_with_all = ["world", "recording", "json", "corrected", "rate_hz", "gate_m", "masks", "by", "calibration_error_px", "seed", "default_segmentation"])]
    costs: bool,
    /// Draws the times of --costs, as SVG.
    #[arg(long, value_name = "FILE", requires = "costs")]
    plot: Option<PathBuf>,
    /// Writes all figures as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Source of the masks that blobs are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "snake_case")]
enum Masks {
    Ours,
    True,
}

impl Placing {
    pub(super) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        if self.costs {
            return costs::run(self.plot.as_deref());
        }
        ensure!((0.01..=100.0).contains(&self.gate_m), "--gate-m: expected 0.01 to 100, got {}", self.gate_m);
        let error_px = self.calibration_error_px;
        ensure!(
            (0.0..=100.0).contains(&error_px),
            "--calibration-error-px: expected 0 to 100, got {error_px}"
        );
        if let Some(rate_hz) = self.rate_hz {
            ensure!((0.1..=240.0).contains(&rate_hz), "--rate-hz: expected 0.1 to 240, got {rate_hz}");
        }
        let worlds: Vec<World> = self.world.iter().map(|name| World::load(name)).collect::<Result<_, _>>()?;
        let open = |folder: &PathBuf| {
            let recording = Recording::open(folder, self.rate_hz)?;
            anyhow::Ok(if self.default_segmentation { recording.segmented_by_default() } else { recording })
        };
        let recordings: Vec<Recording> = self.recording.iter().map(open).collect::<Result<_>>()?;
        let mut outcomes = Vec::new();
        for (name, world) in self.world.iter().zip(&worlds) {
            outcomes.push(self.judge_world(name, world).with_context(|| format!("world {name}"))?);
        }
        for (folder, recording) in self.recording.iter().zip(&recordings) {
            let name = folder.display().to_string();
            outcomes.push(self.judge_recording(&name, recording).with_context(|| name.clone())?);
        }
        write_tables(&mut std::io::stdout().lock(), &outcomes)?;
        if let Some(path) = &self.json {
            let document = serde_json::json!({
                "gate_m": self.gate_m,
                "masks": self.masks,
                "by": self.by,
                "calibration_error_px": error_px,
                "seed": self.seed,
                "outcomes": outcomes,
            });
            let text = serde_json::to_string_pretty(&document)? + "\n";
            std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))?;
        }
        Ok(())
    }

    fn judge_world(&self, name: &str, world: &World) -> Result<Outcome> {
        let clock = SystemClock::new();
        let mut judge = self.judge(&clock);
        let rate_hz = self.rate_hz.unwrap_or(10.0);
        let (n_cameras, entities) =
            world::judge_world(world, (rate_hz, self.masks), &mut judge, &clock, |scene| {
                self.scene_of(scene)
            })?;
        Ok(Outcome::of(name, n_cameras, &judge, Some(entities)))
    }

    fn judge<'a>(&self, clock: &'a SystemClock) -> Judge<'a> {
        let judge = Judge::new(clock, self.gate_m, self.by);
        if self.corrected { judge.correcting() } else { judge }
    }

    /// The scene as it is associated in.
    fn scene_of(&self, scene: &Scene) -> Result<Scene> {
        disturbed(scene, self.calibration_error_px, self.seed)
    }

    fn judge_recording(&self, name: &str, recording: &Recording) -> Result<Outcome> {
        let clock = SystemClock::new();
        let mut judge = self.judge(&clock);
        recording.judge(&mut judge, |scene| self.scene_of(scene))?;
        Ok(Outcome::of(name, recording.n_cameras(), &judge, None))
    }
}
