//! `accuracy`: what each step of accuracy costs, as a report.

use crate::live::{LiveScope, judge_scene};
use crate::report::{Report, SubjectReport};
use crate::worlds::sweep;
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use videofields::accuracy::{self, Scope, Stage, Sweep};
use videofields::commands::{complain, say};
use videofields_picture::scene;
use videofields_recording::telemetry::{self, LogFormat};
use videofields_simulate::World;
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config;

/// Measures what each step of accuracy costs in time and memory, and what error it leaves.
///
/// Sweeps the settings of each stage one at a time around the defaults, then whole pipelines, and writes
/// report.json, one CSV a stage and index.html. Errors are against a simulated world's exact truth; for a scene of a
/// configuration, which has none, cameras are left out in turn and frames held back instead. Nothing else should run
/// on the machine meanwhile.
#[derive(Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("subject").required(true).args(["world", "scene"])))]
pub(crate) struct Accuracy {
    /// A simulated world: its name, such as plaza, or the path of its document.
    #[arg(long, value_name = "NAME|FILE")]
    world: Option<String>,
    /// A scene of the configuration by its id.
    #[arg(long, value_name = "ID", requires = "config")]
    scene: Option<String>,
    /// The configuration that has the scene.
    #[arg(long, value_name = "FILE", requires = "scene")]
    config: Option<PathBuf>,
    /// Stages of a world's sweep, with commas between: segmentation, map, surfaces, entities, pipeline; all if absent.
    #[arg(long, value_name = "STAGES", value_delimiter = ',', conflicts_with = "scene")]
    stages: Vec<Stage>,
    /// Looks at less: fewer frames, views and settings.
    #[arg(long)]
    quick: bool,
    /// The folder to write to; made if it is not there. Files of the same names are replaced.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Accuracy {
    pub(crate) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        match (&self.world, &self.scene, &self.config) {
            (Some(world), ..) => self.world(world),
            (None, Some(scene), Some(config)) => self.scene(scene, config),
            _ => bail!("--world or --scene with --config is needed"),
        }
    }

    fn world(&self, name: &str) -> Result<()> {
        let world = World::load(name)?;
        let scope = if self.quick { Scope::QUICK } else { Scope::FULL };
        let stages = if self.stages.is_empty() { Stage::ALL.to_vec() } else { self.stages.clone() };
        let clock = SystemClock::new();
        let started = clock.monotonic();
        let found = sweep(&world, &scope, &stages, &clock, &complain)?;
        let subject = SubjectReport {
            kind: "world".to_owned(),
            id: world.id().to_string(),
            truth: "the simulator's exact truth".to_owned(),
            scope: scope.told(),
        };
        let took_secs = clock.monotonic().saturating_sub(started).as_secs_f64();
        let machine = accuracy::machine(&found.adapter);
        let report = Report::new(subject, machine, &found, clock.now().to_string(), took_secs);
        self.write(&report, &found.examples)
    }

    fn write(&self, report: &Report, examples: &[accuracy::Example]) -> Result<()> {
        let written = report
            .write(&self.out, examples)
            .with_context(|| format!("cannot write the report to {}", self.out.display()))?;
        for path in written {
            say(&path.display().to_string())?;
        }
        Ok(())
    }

    fn scene(&self, id: &str, config_path: &Path) -> Result<()> {
        let config = config::load(config_path)?;
        let scenes = &config.settings().scene;
        let Some(settings) = scenes.iter().find(|scene| scene.id == id) else {
            let known: Vec<&str> = scenes.iter().map(|scene| scene.id.as_str()).collect();
            bail!("{} has no scene {id:?}; it has {known:?}", config_path.display());
        };
        let scene = scene::load_file(&settings.id, &settings.file, config.settings().media_folders())
            .with_context(|| format!("scene {}: {}", settings.id, settings.file.display()))?
            .scene;
        let scope = if self.quick { LiveScope::QUICK } else { LiveScope::FULL };
        let clock = SystemClock::new();
        let started = clock.monotonic();
        let (found, adapter) = judge_scene(&config, &Arc::new(scene), &scope, &complain)?;
        let subject = SubjectReport {
            kind: "scene".to_owned(),
            id: id.to_owned(),
            truth: "no truth: what other cameras show (each camera left out in turn) and frames held back from learning"
                .to_owned(),
            scope: format!("at most {} frames of each camera", scope.max_frames),
        };
        let took_secs = clock.monotonic().saturating_sub(started).as_secs_f64();
        let sweep = Sweep { is_complete: true, ..Sweep::default() };
        let mut report =
            Report::new(subject, accuracy::machine(&adapter), &sweep, clock.now().to_string(), took_secs);
        report.without_truth = Some(found);
        self.write(&report, &[])
    }
}
