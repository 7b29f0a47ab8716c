//! `bench deadlines`: whether pictures come in time, what is given up for it, and how well their time was foretold.

use anyhow::{Context as _, Result, bail};
use glam::DVec3;
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::runtime::Runtime;
use videofields::accuracy::{Keeper, KeeperSettings, Scope, Stage};
use videofields_picture::plan::{Aim, Colors, Deadline, Effort, EntityStyle, Named, Preset, Spread};
use videofields_picture::scene::{self, Scene};
use videofields_recording::store::Store;
use videofields_recording::telemetry::{self, LogFormat, Metrics};
use videofields_service::engine::{
    AccuracyState, At, Engine, EngineError, Handle, Origin, ViewAnswer, ViewKind, ViewRequest,
};
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config::{self, Config};
use videofields_vision::encode;

/// Deadlines that are asked for, milliseconds.
const DEADLINES_MS: [u64; 8] = [20, 35, 60, 100, 150, 220, 320, 500];

/// Sizes that are asked for.
const SIZES_PX: [(u32, u32); 6] = [(320, 180), (480, 270), (640, 360), (800, 600), (960, 540), (1280, 720)];

/// Quality of the JPEG files, as the daemon's.
const JPEG_QUALITY: u8 = 88;

/// Longest that cameras are waited for.
const CAMERA_TIME: Duration = Duration::from_secs(60);

/// Longest that measuring costs is waited for.
const MEASURING_TIME: Duration = Duration::from_secs(180);

/// Asks a running engine for random views with deadlines, and says how many came in time.
///
/// The engine runs in this process over the configuration's cameras, without a network. Views, sizes, instants in memory and
/// deadlines are random, from a seed. A picture is in time if it is encoded as JPEG by its deadline, from its request on.
#[derive(Debug, clap::Args)]
pub(super) struct Deadlines {
    /// The configuration (TOML), such as one that `videofields-lab simulate` wrote.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Requests that are counted.
    #[arg(long, value_name = "COUNT", default_value_t = 200)]
    requests: usize,
    /// Requests before them, of presets in turns, from which the engine learns.
    #[arg(long, value_name = "COUNT", default_value_t = 60)]
    warm: usize,
    /// What all randomness hangs on.
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    seed: u64,
    /// Seconds of pictures that every camera must have in memory first.
    #[arg(long, value_name = "SECONDS", default_value_t = 4.0)]
    memory: f64,
    /// Measures the machine's costs first, as the daemon does after its first start.
    #[arg(long)]
    measure: bool,
}

/// `SplitMix64` (Steele, Lea, Flood 2014, Fast splittable pseudorandom number generators).
struct Random(u64);

impl Random {
    const fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Between 0 and 1.
    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        (high - low).mul_add(self.share(), low)
    }

    const fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[(self.next() % of.len() as u64) as usize]
    }
}

/// What came of one deadline's requests.
#[derive(Default)]
struct Outcome {
    n_met: usize,
    n_late: usize,
    n_refused: usize,
    errors: Vec<f64>,
    settings: BTreeMap<String, usize>,
}

impl Deadlines {
    pub(super) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        let config = config::load(&self.config)?;
        let scenes = scenes(&config)?;
        let runtime = Runtime::new()?;
        let folder = tempfile::tempdir()?;
        let store = runtime.block_on(Store::open(&folder.path().join("bench.sqlite")))?;
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let engine = {
            let _entered = runtime.enter();
            let metrics = Arc::new(Metrics::new());
            Engine::start(&config, scenes.clone(), store.clone(), metrics, Arc::clone(&clock))?
        };
        let handle = engine.handle();
        let bench = Bench { runtime: &runtime, handle: &handle, clock: &*clock };
        let ran = self.measured(&config, &engine, &store, &bench).and_then(|()| self.ask(&bench, &scenes));
        engine.stop();
        runtime.block_on(store.close())?;
        ran
    }

    /// Measures the machine, where that is asked for.
    fn measured(&self, config: &Config, engine: &Engine, store: &Store, bench: &Bench<'_>) -> Result<()> {
        if !self.measure {
            return Ok(());
        }
        let settings = KeeperSettings {
            scope: Scope::DAEMON,
            stages: Stage::of_plans(),
            render: config.settings().render.clone(),
            measures_at_start: true,
        };
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let runtime = bench.runtime.handle().clone();
        let keeper = Keeper::start(settings, engine.accuracy_board(), store.clone(), runtime, clock)?;
        let until = bench.clock.monotonic() + MEASURING_TIME;
        let outcome = loop {
            let status = bench.handle.accuracy();
            match status.state {
                AccuracyState::Measured => break Ok(()),
                AccuracyState::Failed => bail!("costs were not measured: {:?}", status.reason),
                _ if bench.clock.monotonic() > until => bail!("costs were not measured in time"),
                _ => bench.clock.sleep(Duration::from_millis(100)),
            }
        };
        keeper.stop(bench.clock, Duration::from_secs(5));
        outcome
    }

    fn ask(&self, bench: &Bench<'_>, scenes: &[Arc<Scene>]) -> Result<()> {
        let mut random = Random(self.seed);
        let request = |random: &mut Random, effort: Effort| {
            let at = (random.next() % scenes.len() as u64) as usize;
            // Memory moves on.
            let span = bench.remembered(&scenes[at], self.memory)?;
            Ok::<_, anyhow::Error>(view(random, &scenes[at], span, effort))
        };
        let mut encoding = Encoding::default();
        for idx in 0..self.warm {
            let aim = Aim::Preset(Preset::ALL[idx % Preset::ALL.len()].1);
            let request = request(&mut random, Effort { aim, named: Named::default() })?;
            bench.picture(request, &mut encoding)?.ok();
        }
        let mut outcomes: BTreeMap<u64, Outcome> = BTreeMap::new();
        let mut ratios = Vec::new();
        for _ in 0..self.requests {
            let deadline_ms = random.one_of(&DEADLINES_MS);
            let total = Duration::from_millis(deadline_ms);
            let mut request = request(&mut random, Effort::default())?;
            let reserve = encoding.expected(request.width_px, request.height_px);
            request.effort.aim = Aim::Within(Deadline { total, reserve });
            let outcome = outcomes.entry(deadline_ms).or_default();
            let started = bench.clock.monotonic();
            match bench.picture(request, &mut encoding)? {
                Ok(answer) => {
                    let took = bench.clock.monotonic().saturating_sub(started);
                    if took <= total {
                        outcome.n_met += 1;
                    } else {
                        outcome.n_late += 1;
                    }
                    let knobs = answer.settings.knobs().into_iter();
                    let text: Vec<String> = knobs.map(|(name, value)| format!("{name}={value}")).collect();
                    *outcome.settings.entry(text.join(" ")).or_default() += 1;
                    outcome.errors.extend(answer.expected.and_then(|expected| expected.error));
                    ratios.extend(ratio(&answer));
                }
                Err(_refused) => outcome.n_refused += 1,
            }
        }
        told(&outcomes, &ratios)
    }
}

/// What a drawn picture took over what was expected.
fn ratio(answer: &ViewAnswer) -> Option<f64> {
    let expected_ms = answer.expected?.forecast.median_ms;
    let stages = answer.timings.iter().filter(|(stage, _)| ["fuse", "plan", "render"].contains(stage));
    let took_ms: f64 = stages.map(|(_, time)| time.as_secs_f64() * 1e3).sum();
    (answer.origin == Origin::Drawn).then_some(took_ms / expected_ms)
}

struct Bench<'a> {
    runtime: &'a Runtime,
    handle: &'a Handle,
    clock: &'a dyn Clock,
}

/// The milliseconds a megapixel of the last encodings.
#[derive(Default)]
struct Encoding(Vec<f64>);

impl Encoding {
    fn expected(&self, width_px: u32, height_px: u32) -> Duration {
        let spread = Spread::of(&self.0[self.0.len().saturating_sub(33)..]);
        let rate_ms = spread.map_or(15.0, |spread| spread.upper_quartile);
        let megapixels = f64::from(width_px) * f64::from(height_px) * 1e-6;
        Duration::try_from_secs_f64(rate_ms * megapixels * 1e-3).unwrap_or_default()
    }
}

impl Bench<'_> {
    /// Asks for a picture and encodes it; an inner failure is a refusal.
    fn picture(
        &self,
        request: ViewRequest,
        encoding: &mut Encoding,
    ) -> Result<Result<ViewAnswer, EngineError>> {
        let megapixels = f64::from(request.width_px) * f64::from(request.height_px) * 1e-6;
        let answer = match self.runtime.block_on(self.handle.view(request)) {
            Ok(answer) => answer,
            Err(
                error @ (EngineError::TooLarge(_) | EngineError::Crowded { .. } | EngineError::Late { .. }),
            ) => {
                return Ok(Err(error));
            }
            Err(error) => return Err(error.into()),
        };
        let started = self.clock.monotonic();
        encode::jpeg(&answer.image, JPEG_QUALITY)?;
        let took_ms = self.clock.monotonic().saturating_sub(started).as_secs_f64() * 1e3;
        encoding.0.push(took_ms / megapixels);
        Ok(Ok(answer))
    }

    /// From when to when all cameras of a scene have pictures, once that is `secs` long.
    fn remembered(&self, scene: &Scene, secs: f64) -> Result<(Timestamp, Timestamp)> {
        let until = self.clock.monotonic() + CAMERA_TIME;
        loop {
            let cameras = self.handle.cameras();
            let of_scene =
                cameras.iter().filter(|camera| scene.cameras.iter().any(|member| member.id == camera.id));
            let spans: Option<Vec<(Timestamp, Timestamp)>> = of_scene
                .map(|camera| {
                    let [first, last] = [&camera.first, &camera.last].map(|at| at.as_deref()?.parse().ok());
                    first.zip(last)
                })
                .collect();
            let common = spans.and_then(|spans| {
                let first = spans.iter().map(|(first, _)| *first).max()?;
                Some((first, spans.iter().map(|(_, last)| *last).min()?))
            });
            match common {
                Some((first, last)) if last.secs_since(first) >= secs => return Ok((first, last)),
                _ if self.clock.monotonic() > until => {
                    bail!("the cameras of {} have no {secs} s in common", scene.id)
                }
                _ => self.clock.sleep(Duration::from_millis(100)),
            }
        }
    }
}

fn scenes(config: &Config) -> Result<Vec<Arc<Scene>>> {
    let settings = config.settings();
    let load = |of: &config::SceneSettings| {
        let read = scene::load_file(&of.id, &of.file, settings.media_folders());
        Ok(Arc::new(read.with_context(|| format!("scene {}: {}", of.id, of.file.display()))?.scene))
    };
    let scenes = settings.scene.iter().map(load).collect::<Result<Vec<_>>>()?;
    if scenes.is_empty() {
        bail!("the configuration has no scene");
    }
    Ok(scenes)
}

/// A random view of a scene at an instant within a span.
fn view(
    random: &mut Random,
    scene: &Scene,
    (first, last): (Timestamp, Timestamp),
    effort: Effort,
) -> ViewRequest {
    let [low, high] = scene.surfaces.ground_bounds().unwrap_or([DVec3::splat(-10.0), DVec3::splat(10.0)]);
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let mut place = |reach: f64, heights: [f64; 2]| {
        let [x, y] = [half.x, half.y].map(|half| random.within(-reach, reach) * half);
        DVec3::new(middle.x + x, middle.y + y, middle.z + random.within(heights[0], heights[1]))
    };
    let (eye, target) = (place(1.2, [2.0, 15.0]), place(0.6, [0.0, 1.5]));
    let (width_px, height_px) = random.one_of(&SIZES_PX);
    // The oldest is forgotten while it is asked for.
    let nanos = (last.nanos_since(first) as f64 * random.within(0.5, 1.0)) as i64;
    ViewRequest {
        scene: scene.id.clone(),
        kind: ViewKind::Perspective,
        eye: Some(eye),
        target: Some(target),
        fov_y_rad: Some(random.within(30.0, 75.0).to_radians()),
        width_px,
        height_px,
        at: At::Time(first.saturating_add_nanos(nanos)),
        style: EntityStyle::Billboards,
        colors: Colors::Even,
        see_through: true,
        session: None,
        effort,
        effects: Default::default(),
        horizon: None,
        blur_people: None,
        scope: videofields_vision::access::Scope::all(),
    }
}

fn told(outcomes: &BTreeMap<u64, Outcome>, ratios: &[f64]) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "| deadline, ms | in time | late | refused | error, codes | most often |")?;
    writeln!(out, "| ---: | ---: | ---: | ---: | ---: | --- |")?;
    let (mut n_met, mut n_late, mut n_refused) = (0, 0, 0);
    for (deadline_ms, outcome) in outcomes {
        let error =
            Spread::of(&outcome.errors).map_or_else(|| "–".to_owned(), |of| format!("{:.1}", of.median));
        let most = outcome.settings.iter().max_by_key(|(_, count)| **count).map_or("", |(text, _)| text);
        let Outcome { n_met: met, n_late: late, n_refused: refused, .. } = outcome;
        writeln!(out, "| {deadline_ms} | {met} | {late} | {refused} | {error} | {most} |")?;
        n_met += met;
        n_late += late;
        n_refused += refused;
    }
    let n_accepted = n_met + n_late;
    let share = 100.0 * n_met as f64 / n_accepted.max(1) as f64;
    writeln!(
        out,
        "\n{n_met} of {n_accepted} accepted came in time ({share:.1} %); {n_refused} were refused."
    )?;
    let off: Vec<f64> = ratios.iter().map(|ratio| (ratio - 1.0).abs()).collect();
    if let Some((off, ratio)) = Spread::of(&off).zip(Spread::of(ratios)) {
        writeln!(
            out,
            "Times of {} drawn pictures were off by {:.1} % in the median (quartiles {:.1} and {:.1} %); measured over \
             expected {:.2} (quartiles {:.2} and {:.2}).",
            off.count,
            100.0 * off.median,
            100.0 * off.lower_quartile,
            100.0 * off.upper_quartile,
            ratio.median,
            ratio.lower_quartile,
            ratio.upper_quartile
        )?;
    }
    Ok(())
}
