//! `simulate`: a world with known truth, as clips and truth files; or what it calls for and what that costs.

use anyhow::{Context as _, Result};
use std::path::PathBuf;
use videofields::commands::parse::{parse_point, parse_size};
use videofields::commands::progress::Progress;
use videofields::commands::say;
use videofields_simulate::{
    Beside, CalibrationError, EffectKind, Effects, ExplainOptions, Explanation, ExtraView, Parts,
    SimulateOptions, World, explain, write_with,
};
use videofields_vision::clock::SystemClock;

/// Draws a world with known truth: clips, masks, depth, normals, positions, a scene document and a configuration.
///
/// A world is simulated with the effects that it names (noise, rain, dropped frames, ...) and no other; --explain says
/// which these are and what each costs. What was written, and in which formats, stands in DIR/truth/truth.json.
#[derive(Debug, clap::Args)]
pub(crate) struct Simulate {
    /// Which world: a name (--list has them) or the path of a world's document (docs/worlds.md).
    #[arg(long, value_name = "NAME|FILE", default_value = "plaza")]
    world: String,
    /// The folder to write to; made if it is not there. Files of the same names are replaced.
    #[arg(long, value_name = "DIR", required_unless_present_any = ["list", "explain"])]
    out: Option<PathBuf>,
    /// Lists the worlds that are known by name, and writes nothing.
    #[arg(long, conflicts_with_all = ["out", "explain"])]
    list: bool,
    /// Says which effects the world calls for, why, and what each costs a frame here (measured), and writes nothing.
    #[arg(long, conflicts_with = "out")]
    explain: bool,
    /// With --explain: how often each time is taken, 1 to 100; the least counts.
    #[arg(long, value_name = "COUNT", default_value_t = 2, requires = "explain")]
    rounds: u32,
    /// With --explain: measures beside these every effect alone, and all together.
    #[arg(long, requires = "explain")]
    each: bool,
    /// With --explain or --list: as JSON.
    #[arg(long)]
    json: bool,
    /// Names one more effect, with its defaults, such as rain or light-drift; all names every one. May be given again.
    #[arg(long = "with", value_name = "EFFECT", value_parser = parse_effect)]
    with: Vec<Named>,
    /// Takes an effect away that the world names; all takes every one. May be given again; comes before --with.
    #[arg(long = "without", value_name = "EFFECT", value_parser = parse_effect)]
    without: Vec<Named>,
    /// What all randomness hangs on, in place of the world's own.
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,
    /// Errors of all cameras' written calibrations, in place of their own, such as
    /// `move_m=0.05,turn_deg=0.2,focal_percent=1,lens=0.01,clock_ms=40` (docs/worlds.md).
    #[arg(long, value_name = "KEY=VALUE,...", value_parser = parse_calibration_error)]
    calibration_error: Option<CalibrationError>,
    /// Length of the clips, seconds. Default: the world's period, so that they loop without a seam.
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<f64>,
    /// Frames a second of all cameras, 0.1 to 240. Default: each camera's own.
    #[arg(long, value_name = "RATE")]
    rate_hz: Option<f64>,
    /// Columns and rows of all cameras' pictures, 16 to 16383 each. Default: each camera's own.
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = parse_size)]
    size_px: Option<[u32; 2]>,
    /// Samples a pixel, each way, 1 to 16.
    #[arg(long, value_name = "COUNT", default_value_t = 3)]
    samples: u32,
    /// Writes truth for every n-th frame; 0 writes none.
    #[arg(long, value_name = "N", default_value_t = 1)]
    truth_every: u32,
    /// Writes truth for the frame at this time alone, seconds from the clips' start; may be given again.
    #[arg(long = "at-secs", value_name = "SECONDS")]
    at_secs: Vec<f64>,
    /// The database that the configuration names, relative to the folder.
    #[arg(long, value_name = "FILE", default_value = "videofields.sqlite")]
    database: PathBuf,
    /// A view where no camera stands, whose truth is written too, with masks of what the cameras see there and of
    /// its still part: its name, eye and target (metres) and vertical field of view (degrees), 960x540 if no size
    /// is given, such as square=0,-20,6:0,4,1:45; may be given again.
    #[arg(long = "view", value_name = "NAME=EYE:TARGET:FOV[:WIDTHxHEIGHT]", value_parser = parse_view)]
    views: Vec<ExtraView>,
    /// Writes the truth of the --view views and nothing else.
    #[arg(long, requires = "views")]
    only_views: bool,
}

impl Simulate {
    pub(crate) fn run(&self) -> Result<()> {
        if self.list {
            return self.list();
        }
        let world = World::load(&self.world)?;
        let world = world.with_effects(self.effects(world.effects().clone()));
        let world = match self.calibration_error {
            Some(error) => world.with_calibration_error(error),
            None => world,
        };
        if self.explain {
            return self.explain(&world);
        }
        let out = self.out.as_ref().context("--out names no folder")?;
        let mut options = SimulateOptions::new(out);
        options.seconds = self.seconds;
        options.rate_hz = self.rate_hz;
        options.size_px = self.size_px.map(|[width, height]| (width, height));
        options.samples_per_side = self.samples;
        options.truth_every_frames = self.truth_every;
        options.database.clone_from(&self.database);
        options.truth_at_secs.clone_from(&self.at_secs);
        options.extra_views.clone_from(&self.views);
        options.parts = if self.only_views { Parts::Views } else { Parts::Everything };
        let mut progress = Progress::new();
        let written = write_with(&world, &options, &mut |step| {
            let (part, n_parts) = step.part;
            progress.show(|| {
                format!("{} ({part} of {n_parts}): frame {} of {}", step.what, step.n_done, step.n_frames)
            });
        })?;
        progress.finish();
        if !written.clips.is_empty() {
            say(&format!("{} frames a clip", written.n_frames))?;
        }
        for path in written.clips.iter().chain(&written.views).chain(&written.config) {
            say(&path.display().to_string())?;
        }
        Ok(())
    }

    /// The world's effects as the flags change them.
    fn effects(&self, mut effects: Effects) -> Effects {
        let kinds = |named: &[Named]| -> Vec<EffectKind> {
            let of = |named: &Named| named.0.map_or(EffectKind::ALL.to_vec(), |kind| vec![kind]);
            named.iter().flat_map(of).collect()
        };
        effects = kinds(&self.without).into_iter().fold(effects, Effects::without);
        effects = kinds(&self.with).into_iter().fold(effects, Effects::with);
        effects.seed = self.seed.unwrap_or(effects.seed);
        effects
    }

    fn list(&self) -> Result<()> {
        for (id, line) in World::catalogue() {
            if self.json {
                say(&serde_json::json!({"id": id, "about": line}).to_string())?;
            } else {
                say(&format!("{id:<20} {line}"))?;
            }
        }
        Ok(())
    }

    fn explain(&self, world: &World) -> Result<()> {
        let options = ExplainOptions {
            size_px: self.size_px.map(|[width, height]| (width, height)),
            samples_per_side: self.samples,
            rate_hz: self.rate_hz,
            n_rounds: self.rounds,
            beside: if self.each { Beside::Everything } else { Beside::Nothing },
            ..ExplainOptions::default()
        };
        let mut progress = Progress::new();
        let told = explain(world, &options, &SystemClock::new(), &mut |n_done, n_steps| {
            progress.show(|| format!("measured {n_done} of {n_steps}"));
        })?;
        progress.finish();
        if self.json {
            return say(&serde_json::to_string_pretty(&told)?);
        }
        say(&table(&told))
    }
}

/// An effect, or all of them.
#[derive(Clone, Copy, Debug)]
struct Named(Option<EffectKind>);

fn parse_effect(text: &str) -> Result<Named, String> {
    if text == "all" {
        return Ok(Named(None));
    }
    EffectKind::with_id(text).map(|kind| Named(Some(kind))).ok_or_else(|| {
        let known: Vec<&str> = EffectKind::ALL.into_iter().map(EffectKind::id).chain(["all"]).collect();
        videofields_vision::error::unknown("effect", text, &known)
    })
}

fn parse_calibration_error(text: &str) -> Result<CalibrationError, String> {
    let mut fields = serde_json::Map::new();
    for part in text.split(',') {
        let (key, value) = part.split_once('=').ok_or_else(|| format!("{part:?}: expected KEY=VALUE"))?;
        let number: f64 = value.parse().map_err(|_not_a_number| format!("{value:?} is no number"))?;
        fields.insert(key.to_owned(), number.into());
    }
    let error: CalibrationError = serde_json::from_value(fields.into()).map_err(|error| error.to_string())?;
    let faults: Vec<String> =
        error.validate().iter().map(|fault| format!("{}: {}", &fault.place[1..], fault.message)).collect();
    if faults.is_empty() { Ok(error) } else { Err(faults.join("; ")) }
}

/// The explanation as a Markdown table between two sentences.
fn table(told: &Explanation) -> String {
    let cost = |cost_ms: Option<f64>| cost_ms.map_or(String::new(), |cost_ms| format!("{cost_ms:.1}"));
    let on = |is_on: bool| if is_on { "on" } else { "off" };
    let row = |cells: [&str; 6]| {
        let [id, stage, is_on, cost, alone, why] = cells;
        format!("| {id:<15} | {stage:<8} | {is_on:<3} | {cost:>8} | {alone:>8} | {why} |\n")
    };
    let (width, height) = told.size_px;
    let n = told.samples_per_side;
    let often = if told.still_world.is_cast_once { "once for all frames" } else { "for every frame" };
    let mut text = format!(
        "World {}, camera {}, {width} x {height}, {n} x {n} samples a pixel, {} threads.\n\
         The still world is cast {often} ({}); it takes {:.0} ms.\n\n",
        told.world, told.camera, told.n_threads, told.still_world.reason, told.still_world.cost_ms,
    );
    text += &row(["effect", "stage", "is", "ms/frame", "alone", "why and how"]);
    text += "| --------------- | -------- | --- | -------: | -------: | ----------- |\n";
    for line in &told.effects {
        let stage = format!("{:?}", line.stage).to_lowercase();
        let settings = line.settings.as_ref().map_or(String::new(), |settings| format!(": `{settings}`"));
        let why = format!("{}{settings}", line.reason);
        text += &row([line.id, &stage, on(line.is_on), &cost(line.cost_ms), &cost(line.cost_alone_ms), &why]);
    }
    let lens = &told.lens_distortion;
    let why = if lens.is_on {
        format!("calibration of {}; milliseconds of one still world", lens.cameras.join(", "))
    } else {
        "no camera's calibration has one".to_owned()
    };
    text += &row(["lens distortion", "camera", on(lens.is_on), &cost(lens.cost_ms), "", &why]);
    text += &format!(
        "\nA frame, from the world to the encoded picture: {:.1} ms with what is named, {:.1} ms with no effect.",
        told.frame_ms, told.bare_frame_ms,
    );
    if let Some(full_ms) = told.full_frame_ms {
        text += &format!(" With every effect: {full_ms:.1} ms.");
    }
    text
}

fn parse_view(text: &str) -> Result<ExtraView, String> {
    let expected = || {
        "expected NAME=EYE:TARGET:FOV or NAME=EYE:TARGET:FOV:WIDTHxHEIGHT, such as \
         square=0,-20,6:0,4,1:45:960x540"
            .to_owned()
    };
    let (name, rest) = text.split_once('=').ok_or_else(expected)?;
    let parts: Vec<&str> = rest.split(':').collect();
    let (eye, target, fov, [width, height]) = match parts[..] {
        [eye, target, fov] => (eye, target, fov, [960, 540]),
        [eye, target, fov, size] => (eye, target, fov, parse_size(size)?),
        _ => return Err(expected()),
    };
    let fov_deg: f64 = fov.parse().map_err(|_not_a_number| format!("{fov:?} is no number of degrees"))?;
    Ok(ExtraView {
        name: name.to_owned(),
        eye_in_world: parse_point(eye)?,
        target_in_world: parse_point(target)?,
        fov_y_rad: fov_deg.to_radians(),
        size_px: (width, height),
    })
}
