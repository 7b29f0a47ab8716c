//! How long a picture takes: a small linear model a stage, fitted to what pictures took.
//!
//! What a stage's time depends on is known ([`Feature`]); by how much is the machine's. It begins with a guess, is fitted to
//! the table of measured costs where this machine has one, and to the pictures that were drawn since. No clock, nothing random:
//! one history gives one model.

use super::fit::{dot, fit};
use super::stages::{N_STAGES, STAGES, StageForm, StageTimes, TimedStage};
use super::work::{Feature, N_FEATURES, Pending, Program, Survey, Variant, Work};
use super::{CostRow, CostTable, Settings, Spread};
use serde::Serialize;
use std::collections::{BTreeSet, VecDeque};
use videofields_vision::measures::quantile;

/// Samples that are kept, and most of them that are of one kind of picture, so that a wall that asks for the same again and
/// again does not drive out what is known of others.
const MAX_SAMPLES: usize = 192;
const MAX_OF_A_KIND: usize = 6;

/// Rows of a table that are taken.
const MAX_ANCHORS: usize = 64;

/// Pictures after which expectations are more than a guess.
const ENOUGH_PICTURES: usize = 16;

/// Pictures by which the present speed of the machine is told, and by which the spread.
const N_SPEED: usize = 9;
const N_SPREAD: usize = 64;

/// How much slower or faster than its model a machine may be at present.
const SPEEDS: [f64; 2] = [0.25, 4.0];

/// Programs that are remembered as made.
const MAX_PROGRAMS: usize = 1024;

/// Upper quartile over the median where little is known of the spread.
const FIRST_SPREAD: f64 = 1.5;

/// What making a scene ready takes before any was timed, milliseconds.
const FIRST_PREPARATION_MS: f64 = 200.0;

/// On what an expectation rests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Basis {
    /// On nothing that was measured here.
    Guess,
    /// On pictures that were drawn.
    Pictures,
    /// On the table of measured costs, and pictures that were drawn since.
    Table,
}

impl Basis {
    /// Its word in answers.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Guess => "guess",
            Self::Pictures => "pictures",
            Self::Table => "table",
        }
    }
}

/// How long a picture is expected to take, milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// As likely more as less.
    pub median_ms: f64,
    /// More with a chance of one in four.
    pub upper_ms: f64,
    /// What of `median_ms` goes before the drawing.
    pub fuse_ms: f64,
    /// On what it rests.
    pub basis: Basis,
}

impl Forecast {
    /// What of `upper_ms` goes for drawing alone.
    #[must_use]
    pub fn upper_drawing_ms(&self) -> f64 {
        let share = if self.median_ms > 0.0 { (1.0 - self.fuse_ms / self.median_ms).max(0.0) } else { 1.0 };
        self.upper_ms * share
    }
}

/// What was asked of the model for a picture, to be given back with what the picture took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// How much there was to do.
    pub work: Work,
    /// By which programs.
    pub variant: Variant,
    /// Whether its scene must be made ready first.
    pub is_unprepared: bool,
}

#[derive(Clone, Debug)]
struct Measured {
    work: Work,
    times: StageTimes,
    /// Pictures that are told apart no further share it: programs, size, and whether any of the programs was new.
    kind: (Option<Variant>, i32, bool),
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Model {
    /// By stage, in the order of its features.
    coefficients: [Vec<f64>; N_STAGES],
    /// Whether the device tells its passes' times; else all of them are fitted as one.
    has_passes: bool,
    anchors: Vec<Measured>,
    samples: VecDeque<Measured>,
    n_noted: usize,
    programs: BTreeSet<Program>,
    /// Measured over the model's of the last pictures.
    speeds: VecDeque<f64>,
    /// Measured over what was expected.
    ratios: VecDeque<f64>,
    /// What making a scene ready took, milliseconds.
    preparations_ms: VecDeque<f64>,
}

impl Default for Model {
    fn default() -> Self {
        Self {
            coefficients: STAGES.map(|(_, features)| features.iter().map(|(_, guess)| *guess).collect()),
            has_passes: true,
            anchors: Vec::new(),
            samples: VecDeque::new(),
            n_noted: 0,
            programs: BTreeSet::new(),
            speeds: VecDeque::new(),
            ratios: VecDeque::new(),
            preparations_ms: VecDeque::new(),
        }
    }
}

impl Model {
    /// Takes the rows of a table that say how much work they were as known for good, in place of another table's; without
    /// any, none are known.
    pub fn use_table(&mut self, table: Option<&CostTable>) {
        let rows = table.map_or(&[][..], |table| &table.rows);
        self.anchors = rows.iter().filter_map(anchor).take(MAX_ANCHORS).collect();
        self.refit();
    }

    /// Forgets which programs were made: the device is another.
    pub fn forget_programs(&mut self) {
        self.programs.clear();
    }

    /// What a picture is to the model, which programs are new among them.
    #[must_use]
    pub fn task(&self, survey: &Survey, settings: &Settings, pending: Pending) -> Task {
        let mut work = survey.work(settings, pending);
        let variant = survey.variant(settings);
        let mut n_new = [0_u32; 4];
        for program in variant.programs().filter(|program| !self.programs.contains(program)) {
            n_new[program.pass()] += 1;
        }
        let features = [
            Feature::SurfacePrograms,
            Feature::EntityPrograms,
            Feature::ResamplePrograms,
            Feature::EffectPrograms,
        ];
        for (feature, n_new) in features.into_iter().zip(n_new) {
            work.set(feature, f64::from(n_new));
        }
        Task { work, variant, is_unprepared: pending.is_unprepared }
    }

    /// How long a picture takes.
    #[must_use]
    pub fn forecast(&self, task: &Task) -> Forecast {
        let mut times = self.modelled(&task.work);
        let speed = self.speed();
        times.0.iter_mut().for_each(|ms| *ms *= speed);
        let median_ms = times.sum() + if task.is_unprepared { self.preparation_ms() } else { 0.0 };
        let spread = if self.ratios.len() < ENOUGH_PICTURES { FIRST_SPREAD } else { self.spread() };
        let basis = match (self.anchors.is_empty(), self.n_noted >= ENOUGH_PICTURES) {
            (false, _) => Basis::Table,
            (true, true) => Basis::Pictures,
            (true, false) => Basis::Guess,
        };
        let fuse_ms = times.stage(TimedStage::Fuse);
        Forecast { median_ms, upper_ms: median_ms * spread, fuse_ms, basis }
    }

    /// Notes what making a scene ready took. What is no time changes nothing.
    pub fn note_preparation(&mut self, took_ms: f64) {
        if took_ms.is_finite() && took_ms >= 0.0 {
            push(&mut self.preparations_ms, took_ms, N_SPEED);
        }
    }

    /// Notes what a picture took without making its scene ready, where `expected_ms` was expected of it as a whole. What is no
    /// time changes nothing.
    pub fn note(&mut self, task: &Task, expected_ms: f64, times: StageTimes) {
        let took_ms = times.sum();
        if !times.is_good() || took_ms <= 0.0 {
            return;
        }
        let n_known = self.programs.len();
        self.programs.extend(task.variant.programs().take(MAX_PROGRAMS.saturating_sub(n_known)));
        let has_new = self.programs.len() > n_known;
        let is_usual = !has_new && !task.is_unprepared;
        if is_usual && expected_ms.is_finite() && expected_ms > 0.0 {
            push(&mut self.ratios, took_ms / expected_ms, N_SPREAD);
        }
        let has_passes = times.0[TimedStage::Surface as usize] > 0.0;
        if has_passes != self.has_passes {
            // Another device: what is known of the first is of no use.
            self.has_passes = has_passes;
            self.samples.clear();
        }
        let megapixels = task.work.of(Feature::Drawn).max(1e-4);
        let kind = (Some(task.variant), (2.0 * megapixels.log2()).round() as i32, has_new);
        self.keep(Measured { work: task.work, times, kind });
        self.n_noted += 1;
        if self.n_noted < 2 * ENOUGH_PICTURES || self.n_noted.is_multiple_of(4) {
            self.refit();
        }
        let of_model = self.modelled(&task.work).sum();
        // What a program takes to be made says little of the next: no speed is told by it.
        if is_usual && of_model > 0.0 {
            push(&mut self.speeds, took_ms / of_model, N_SPEED);
        }
    }

    /// Share of pictures' times in what was expected of them: median and quartiles; `None` of none.
    #[must_use]
    pub fn ratios(&self) -> Option<Spread> {
        Spread::of(&self.ratios.iter().copied().collect::<Vec<_>>())
    }

    fn keep(&mut self, measured: Measured) {
        let same = |other: &&Measured| other.kind == measured.kind;
        let is_full_of_it = self.samples.iter().filter(same).count() >= MAX_OF_A_KIND;
        if is_full_of_it && let Some(idx) = self.samples.iter().position(|other| other.kind == measured.kind)
        {
            self.samples.remove(idx);
        } else if self.samples.len() >= MAX_SAMPLES {
            self.samples.pop_front();
        }
        self.samples.push_back(measured);
    }

    fn refit(&mut self) {
        let known: Vec<&Measured> = self.anchors.iter().chain(&self.samples).collect();
        for (stage, (_, features)) in STAGES.iter().enumerate() {
            let prior: Vec<f64> = features.iter().map(|(_, guess)| *guess).collect();
            let amounts: Vec<Vec<f64>> = known
                .iter()
                .map(|measured| features.iter().map(|(feature, _)| measured.work.of(*feature)).collect())
                .collect();
            let is_whole = !self.has_passes && stage != TimedStage::Fuse as usize;
            let time = |(measured, amounts): (&&Measured, &Vec<f64>)| {
                if !is_whole {
                    return measured.times.0[stage];
                }
                // Each stage has the share of the whole that it is expected to have.
                let modelled = self.modelled(&measured.work);
                let whole: f64 = modelled.0[1..].iter().sum();
                let took: f64 = measured.times.0[1..].iter().sum();
                took * dot(amounts, &self.coefficients[stage]) / whole.max(1e-9)
            };
            let times: Vec<f64> = known.iter().zip(&amounts).map(time).collect();
            let samples = amounts.iter().map(Vec::as_slice).zip(times);
            // A stage that did not run says nothing of it.
            let samples = samples.filter(|(amounts, _)| amounts.iter().any(|amount| *amount > 0.0));
            let mut coefficients = self.coefficients[stage].clone();
            fit(&mut coefficients, &prior, samples);
            self.coefficients[stage] = coefficients;
        }
    }

    fn modelled(&self, work: &Work) -> StageTimes {
        let time = |((_, features), coefficients): (&StageForm, &Vec<f64>)| {
            features.iter().zip(coefficients).map(|((feature, _), by)| work.of(*feature) * by).sum()
        };
        let mut times = StageTimes::default();
        for (ms, stage) in times.0.iter_mut().zip(STAGES.iter().zip(&self.coefficients)) {
            *ms = time(stage);
        }
        times
    }

    fn speed(&self) -> f64 {
        if self.speeds.len() < 3 { 1.0 } else { median(&self.speeds).clamp(SPEEDS[0], SPEEDS[1]) }
    }

    fn preparation_ms(&self) -> f64 {
        if self.preparations_ms.is_empty() { FIRST_PREPARATION_MS } else { median(&self.preparations_ms) }
    }

    fn spread(&self) -> f64 {
        quantile(&sorted(&self.ratios), 0.75).max(1.0)
    }
}

fn push(values: &mut VecDeque<f64>, value: f64, most: usize) {
    if values.len() >= most {
        values.pop_front();
    }
    values.push_back(value);
}

fn sorted(values: &VecDeque<f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().collect();
    sorted.sort_by(f64::total_cmp);
    sorted
}

fn median(values: &VecDeque<f64>) -> f64 {
    quantile(&sorted(values), 0.5)
}

/// Beginning of the names of a row's measures that say how much work its time was of, and what each stage took of it.
const WORK: &str = "work_";
const TOOK: &str = "took_ms_";

/// The measures of a row of which the work and its times are known, by name.
pub fn told<'a>(work: &'a Work, times: &'a StageTimes) -> impl Iterator<Item = (String, f64)> + 'a {
    let amounts = Feature::ALL.iter().map(|(name, feature)| (format!("{WORK}{name}"), work.of(*feature)));
    let took = times.named().map(|(name, ms)| (format!("{TOOK}{name}"), ms));
    amounts.filter(|(_, amount)| *amount > 0.0).chain(took)
}

/// What a row says of work and times, if it does.
fn anchor(row: &CostRow) -> Option<Measured> {
    let mut work = Work::default();
    let mut times = StageTimes::default();
    let named = |name: String| row.measures.get(&name).copied();
    for (name, feature) in Feature::ALL {
        work.set(feature, named(format!("{WORK}{name}")).unwrap_or(0.0));
    }
    for (at, (name, _)) in STAGES.iter().enumerate() {
        times.0[at] = named(format!("{TOOK}{name}"))?;
    }
    (times.is_good() && work.of(Feature::One) > 0.0).then_some(Measured {
        work,
        times,
        kind: (None, 0, false),
    })
}

const _: () = assert!(N_FEATURES <= 32, "names of features are looked up one by one");
