//! `bench effects`: what each effect adds to a picture, pass by pass.

use super::playing::play;
use crate::worlds::prepare;
use anyhow::{Context as _, Result};
use std::io::Write as _;
use std::time::Duration;
use videofields::accuracy::{OpenGate, Scope, Stopwatch, Subject, machine};
use videofields_picture::fuse::{Placing, SceneState};
use videofields_picture::plan::{self, Colors, EntityStyle, Picture, Preset, Settings, View, Wishes};
use videofields_picture::scene::Sky;
use videofields_recording::telemetry::{self, LogFormat};
use videofields_render::Renderer;
use videofields_render::gpu::Gpu;
use videofields_simulate::World;
use videofields_vision::clock::{Clock as _, SystemClock};
use videofields_vision::effects::{EffectSettings, LightSource, Occlusion, Relight, Stipple, Sun};

/// Draws a simulated world without effects, with each alone and with all, and prints what that takes as tables.
///
/// The world is played for two seconds so that there are backgrounds and people; then one picture is drawn again and again. The
/// device's time of each pass and the whole picture's are medians.
#[derive(Debug, clap::Args)]
pub(super) struct Effects {
    /// A world: a name of the catalogue or the path of its document.
    #[arg(long, value_name = "NAME|FILE", default_value = "plaza")]
    world: String,
    /// Sizes of the picture.
    #[arg(long, value_name = "COLUMNSxROWS", default_values = ["640x360", "1280x720"])]
    size: Vec<String>,
    /// How often each picture is drawn.
    #[arg(long, value_name = "COUNT", default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..))]
    turns: u32,
}

/// A way to draw the picture: its name, its effects, and whether the sky is a gradient.
struct Way {
    name: &'static str,
    effects: EffectSettings,
    has_sky: bool,
}

fn ways() -> [Way; 6] {
    let none = EffectSettings::NONE;
    let relight = Some(Relight { sun: Some(Sun::default()), ..Relight::by(LightSource::Sky) });
    let (occlusion, stipple) = (Some(Occlusion::default()), Some(Stipple::default()));
    let alone = |name, effects| Way { name, effects, has_sky: false };
    [
        alone("none", none),
        Way { name: "sky", effects: none, has_sky: true },
        alone("relight", EffectSettings { relight, ..none }),
        alone("occlusion", EffectSettings { occlusion, ..none }),
        alone("stipple", EffectSettings { stipple, ..none }),
        Way { name: "all", effects: EffectSettings { relight, occlusion, stipple }, has_sky: true },
    ]
}

/// What is told of the passes.
const PASSES: [&str; 7] = ["surface", "billboard", "sky", "distance", "relight", "occlusion", "stipple"];

impl Effects {
    pub(super) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        let sizes = self.size.iter().map(|text| size_of(text)).collect::<Result<Vec<_>>>()?;
        let world = World::load(&self.world)?;
        let clock = SystemClock::new();
        let watch = Stopwatch::new(&clock, &OpenGate);
        let scope = Scope { n_frames: 20, samples_per_side: 2, n_views: 1, n_moments: 1, ..Scope::FULL };
        let subject = prepare(&world, &scope, &watch, &videofields::commands::complain)?;
        let seen_from = subject.views.first().context("the world has no view")?.view;
        let plain = last_state(&subject)?;
        let mut under_sky = plain.clone();
        let mut scene = (*plain.scene).clone();
        scene.sky = Sky::Gradient {
            zenith_srgb: [58, 111, 176],
            horizon_srgb: [207, 221, 232],
            ground_srgb: [107, 102, 92],
        };
        under_sky.scene = std::sync::Arc::new(scene);
        let mut renderer = Renderer::new(Gpu::new(&subject.render.adapter)?, &subject.render)?;
        let adapter = renderer.gpu().name().to_owned();
        let machine = machine(&adapter);
        let mut out = std::io::stdout().lock();
        writeln!(out, "{}, {} processors, {}", machine.processor, machine.n_processors, machine.adapter)?;
        for (width_px, height_px) in sizes {
            writeln!(out, "\n{} x {}, one sample a pixel, medians of {}\n", width_px, height_px, self.turns)?;
            writeln!(out, "| effects | pixels drawn | {} | whole, ms | adds, ms |", PASSES.join(" | "))?;
            writeln!(out, "| --- | ---: |{} ---: | ---: |", " ---: |".repeat(PASSES.len()))?;
            let picture = Picture::from(of_size(&seen_from, (width_px, height_px)));
            let mut without_ms = None;
            for way in ways() {
                let state = if way.has_sky { &under_sky } else { &plain };
                let measured = self.measured(&mut renderer, &clock, (state, &picture), &way)?;
                let first = *without_ms.get_or_insert(measured.whole_ms);
                let passes = measured.passes_ms.map(|ms| ms.map_or("-".to_owned(), |ms| format!("{ms:.1}")));
                writeln!(
                    out,
                    "| {} | {:.2} | {} | {:.1} | {:.1} |",
                    way.name,
                    measured.drawn_share,
                    passes.join(" | "),
                    measured.whole_ms,
                    measured.whole_ms - first
                )?;
            }
        }
        Ok(())
    }

    fn measured(
        &self,
        renderer: &mut Renderer,
        clock: &SystemClock,
        (state, picture): (&SceneState, &Picture),
        way: &Way,
    ) -> Result<Measured> {
        let settings = Settings { entities: EntityStyle::Billboards, ..Preset::Balanced.settings(1) };
        let wishes = Wishes { settings, see_through: false, colors: Colors::Raw, effects: way.effects };
        let plan = plan::make(state, picture, wishes);
        // Programs are made, and pictures uploaded, by the first.
        renderer.render(state, picture, &plan)?;
        let (mut whole, mut passes) = (Vec::new(), PASSES.map(|_| Vec::new()));
        for _ in 0..self.turns {
            let started = clock.monotonic();
            let rendered = renderer.render(state, picture, &plan)?;
            whole.push(clock.monotonic().saturating_sub(started));
            for time in &rendered.timings {
                if let Some(place) = PASSES.iter().position(|pass| *pass == time.pass) {
                    passes[place].push(time.gpu);
                }
            }
        }
        Ok(Measured {
            drawn_share: plan.effects.drawn_share(picture),
            passes_ms: passes.map(median_ms),
            whole_ms: median_ms(whole).unwrap_or_default(),
        })
    }
}

struct Measured {
    drawn_share: f64,
    passes_ms: [Option<f64>; PASSES.len()],
    whole_ms: f64,
}

fn median_ms(mut times: Vec<Duration>) -> Option<f64> {
    times.sort_unstable();
    times.get(times.len() / 2).map(|time| time.as_secs_f64() * 1e3)
}

/// What stands where at the end of the second lap.
fn last_state(subject: &Subject) -> Result<SceneState> {
    let mut placing = Placing::default();
    let mut last = None;
    play(subject, |_, number, seen| {
        let find =
            |id: &videofields_vision::frame::CameraId| seen.iter().find(|of| of.frame.camera == *id).cloned();
        last = Some(placing.assemble(&subject.scene, subject.instant(number), find));
        Ok(())
    })?;
    last.context("the world was played for no frame")
}

fn of_size(view: &View, (width_px, height_px): (u32, u32)) -> View {
    let mut frustum = view.frustum;
    let aspect = f64::from(width_px) / f64::from(height_px);
    let half = 0.5 * (frustum.y[1] - frustum.y[0]);
    frustum.x = [-half * aspect, half * aspect];
    View { frustum, width_px, height_px, ..*view }
}

fn size_of(text: &str) -> Result<(u32, u32)> {
    let sides =
        text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    let is_size = |(width, height): &(u32, u32)| (1..=8192).contains(width) && (1..=8192).contains(height);
    sides
        .filter(is_size)
        .with_context(|| format!("--size: expected such as 640x360, each 1 to 8192, got {text:?}"))
}
