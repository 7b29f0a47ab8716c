//! `bench views`: how true pictures are by preset, and whether everybody is one entity in their place.

use super::playing::play;
use crate::entities::EntityScore;
use crate::report::Report;
use crate::worlds::{left_out_view, prepare};
use anyhow::{Context as _, Result};
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use videofields::accuracy::{OpenGate, Scope, Stopwatch, Subject, SubjectView, ViewsRun, machine};
use videofields_picture::fuse::{HullMemory, Placing, SceneState};
use videofields_picture::plan::{self, Colors, EntityStyle, Errors, Picture, Preset, Settings, Wishes};
use videofields_recording::telemetry::{self, LogFormat};
use videofields_render::Renderer;
use videofields_render::gpu::Gpu;
use videofields_simulate::World;
use videofields_vision::clock::SystemClock;
use videofields_vision::frame::{CameraId, Mask, RgbImage};
use videofields_vision::observation::Observation;

/// Judges pictures and entities of simulated worlds against their truth, and prints tables.
///
/// A world is played for one period to learn and for the same period to be judged, as its cameras' sensors see it. Drawn
/// are views where no camera stands, and from every camera's place what the others give without it, by each preset.
/// Entities are counted at every frame, with all cameras and without each.
#[derive(Debug, clap::Args)]
pub(super) struct Views {
    /// A world: a name of the catalogue or the path of its document. Repeatable.
    #[arg(long, value_name = "NAME|FILE", required = true)]
    world: Vec<String>,
    /// Frames a second.
    #[arg(long, value_name = "RATE", default_value_t = 10.0)]
    rate_hz: f64,
    /// Views where no camera stands.
    #[arg(long, value_name = "COUNT", default_value_t = 3)]
    views: usize,
    /// Moments at which every view is drawn, two frames at each.
    #[arg(long, value_name = "COUNT", default_value_t = 3)]
    moments: u32,
    /// How entities are drawn.
    #[arg(long, value_enum, default_value_t = Entities::Billboards)]
    entities: Entities,
    /// A report of `videofields-lab accuracy` (report.json): what its table expects of each preset is told beside what came of it.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// How entities are drawn.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Entities {
    Billboards,
    Points,
    Hulls,
}

impl Entities {
    const fn style(self) -> EntityStyle {
        match self {
            Self::Billboards => EntityStyle::Billboards,
            Self::Points => EntityStyle::Points,
            Self::Hulls => EntityStyle::Hulls,
        }
    }
}

/// The cameras that are used: all but one, or all.
struct Lineup {
    name: String,
    left_out: Option<CameraId>,
    views: Vec<SubjectView>,
    placing: Placing,
    entities: EntityScore,
    /// Samples a pixel, as settings of these cameras have them.
    samples: u32,
    /// By preset.
    runs: [ViewsRun; Preset::ALL.len()],
}

impl Views {
    pub(super) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        let errors = self.errors()?;
        let mut judged = Vec::new();
        for name in &self.world {
            let world = World::load(name)?;
            judged.push((name, self.judge(&world).with_context(|| format!("world {name}"))?));
        }
        let mut out = std::io::stdout().lock();
        let adapter = judged.first().map_or("", |(_, (adapter, _))| adapter.as_str());
        let machine = machine(adapter);
        writeln!(out, "{}, {} processors, {}\n", machine.processor, machine.n_processors, machine.adapter)?;
        write_pictures(
            &mut out,
            (errors.as_ref(), self.entities.style()),
            judged.iter().map(|(name, (_, lineups))| (name.as_str(), &**lineups)),
        )?;
        writeln!(out)?;
        write_entities(&mut out, judged.iter().map(|(name, (_, lineups))| (name.as_str(), &**lineups)))
    }

    fn errors(&self) -> Result<Option<Errors>> {
        let Some(path) = &self.report else { return Ok(None) };
        let name = || path.display().to_string();
        let text = std::fs::read_to_string(path).with_context(name)?;
        let report: Report = serde_json::from_str(&text).with_context(name)?;
        let errors = Errors::of(&report.into_table());
        Ok(Some(errors.with_context(|| format!("{}: no errors of surfaces and entities", path.display()))?))
    }

    fn scope(&self, world: &World) -> Scope {
        Scope {
            n_frames: (world.period_secs() * self.rate_hz).round() as u32,
            samples_per_side: 2,
            n_views: self.views,
            n_moments: self.moments,
            ..Scope::FULL
        }
    }

    /// The adapter's name, and what was found with all cameras and without each.
    fn judge(&self, world: &World) -> Result<(String, Vec<Lineup>)> {
        let clock = SystemClock::new();
        let watch = Stopwatch::new(&clock, &OpenGate);
        let scope = self.scope(world);
        let mut subject = prepare(world, &scope, &watch, &videofields::commands::complain)?;
        let mut lineups = vec![Lineup::new("all, free views", None, std::mem::take(&mut subject.views))];
        let samples = subject.render.samples;
        for (idx, camera) in subject.cameras.iter().enumerate() {
            let view = left_out_view(&subject, world, &scope, idx, &watch)?;
            let name = format!("without {}, from its place", camera.id);
            lineups.push(Lineup::new(&name, Some(camera.id.clone()), vec![view]));
        }
        lineups.iter_mut().for_each(|lineup| lineup.samples = samples);
        let mut renderer = Renderer::new(Gpu::new(&subject.render.adapter)?, &subject.render)?;
        play(&subject, |frame, number, seen| {
            let figures = world.figures(frame as f64 * subject.interval_secs)?;
            for lineup in &mut lineups {
                let state = lineup.assemble(&subject, number, seen);
                let truths = lineup.truths(&subject, frame);
                lineup.entities.add(&state, &truths, &figures);
                lineup.draw(frame, &state, &mut renderer, self.entities.style())?;
            }
            Ok(())
        })?;
        Ok((renderer.gpu().name().to_owned(), lineups))
    }
}

impl Lineup {
    fn new(name: &str, left_out: Option<CameraId>, views: Vec<SubjectView>) -> Self {
        Self {
            name: name.to_owned(),
            left_out,
            views,
            placing: Placing::default(),
            entities: EntityScore::default(),
            samples: 1,
            runs: Default::default(),
        }
    }

    fn uses(&self, camera: &CameraId) -> bool {
        self.left_out.as_ref() != Some(camera)
    }

    fn assemble(&mut self, subject: &Subject, number: usize, seen: &[Observation]) -> SceneState {
        let left_out = self.left_out.clone();
        let find = |id: &CameraId| {
            let is_used = left_out.as_ref() != Some(id);
            seen.iter().find(|of| is_used && of.frame.camera == *id).cloned()
        };
        let scene = Arc::clone(&subject.scene);
        self.placing.assemble(&scene, subject.instant(number), find)
    }

    /// Whom each pixel shows, of the cameras that are used, in the scene's order.
    fn truths<'a>(&self, subject: &'a Subject, frame: usize) -> Vec<&'a Mask> {
        let members = subject.scene.cameras.iter().filter(|member| self.uses(&member.id));
        let camera = |id: &CameraId| subject.cameras.iter().find(|camera| camera.id == *id);
        members.filter_map(|member| Some(&camera(&member.id)?.instances[frame])).collect()
    }

    /// Draws what is judged at a frame by every preset.
    fn draw(
        &mut self,
        frame: usize,
        state: &SceneState,
        renderer: &mut Renderer,
        style: EntityStyle,
    ) -> Result<()> {
        for view in &self.views {
            for (_, judged) in view.frames.iter().filter(|(of, _)| *of == frame) {
                for ((_, preset), run) in Preset::ALL.iter().zip(&mut self.runs) {
                    let settings = Settings { entities: style, ..preset.settings(self.samples) };
                    let mut draw = |settings| drawn(renderer, state, view, settings);
                    let picture = draw(settings)?;
                    let bare = draw(Settings { entities: EntityStyle::None, ..settings })?;
                    run.judge(view, judged, &picture, &bare)?;
                }
            }
        }
        Ok(())
    }
}

/// A picture as the daemon draws it, but for open buildings and evened colours, which truth does not have.
fn drawn(
    renderer: &mut Renderer,
    state: &SceneState,
    view: &SubjectView,
    settings: Settings,
) -> Result<RgbImage> {
    let picture = Picture::from(view.view);
    let mut state = state.clone();
    settings.place(&mut state, &mut HullMemory::default());
    let state = &state;
    let plan = plan::make(
        state,
        &picture,
        Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() },
    );
    Ok(renderer.render(state, &picture, &plan)?.image)
}

fn write_pictures<'a>(
    out: &mut impl std::io::Write,
    (errors, style): (Option<&Errors>, EntityStyle),
    worlds: impl Iterator<Item = (&'a str, &'a [Lineup])>,
) -> Result<()> {
    writeln!(
        out,
        "| world | cameras | preset | still: PSNR, dB | SSIM | people: PSNR, dB | SSIM | silhouettes: IoU | gain, dB | error, codes | expected |"
    )?;
    writeln!(out, "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")?;
    for (world, lineups) in worlds {
        for lineup in lineups {
            for ((name, preset), run) in Preset::ALL.iter().zip(&lineup.runs) {
                let settings = Settings { entities: style, ..preset.settings(lineup.samples) };
                let expected = errors.map(|errors| errors.expected(&settings));
                let expected = expected.map_or_else(|| "-".to_owned(), |error| format!("{error:.1}"));
                let measures = run.measures();
                let cell = |name: &str, digits: usize| {
                    measures.get(name).map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
                };
                let cells = [
                    cell("still_psnr_db", 2),
                    cell("still_ssim", 3),
                    cell("people_psnr_db", 2),
                    cell("people_ssim", 3),
                    cell("silhouette_iou", 3),
                    run.entity_gain_db().map_or_else(|| "-".to_owned(), |gain| format!("{gain:+.2}")),
                    cell("balanced_rmse", 1),
                    expected,
                ];
                writeln!(out, "| {world} | {} | {name} | {} |", lineup.name, cells.join(" | "))?;
            }
        }
    }
    Ok(())
}

fn write_entities<'a>(
    out: &mut impl std::io::Write,
    worlds: impl Iterator<Item = (&'a str, &'a [Lineup])>,
) -> Result<()> {
    writeln!(out, "| world | cameras | {} |", EntityScore::HEADS.join(" | "))?;
    writeln!(out, "| --- | --- |{}", " ---: |".repeat(EntityScore::HEADS.len()))?;
    for (world, lineups) in worlds {
        for lineup in lineups {
            let cameras =
                lineup.left_out.as_ref().map_or_else(|| "all".to_owned(), |id| format!("without {id}"));
            writeln!(out, "| {world} | {cameras} | {} |", lineup.entities.cells().join(" | "))?;
        }
    }
    Ok(())
}
