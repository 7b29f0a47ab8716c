//! The order of a sweep: every stage's knobs one at a time around the defaults, then whole pipelines.
//!
//! A place whose truth is exact goes in; rows of cost and error come out, as far as the gate lets it. What is left out is said.

use super::SweepError;
use super::front::{knee, pareto_front};
use super::gate::Stopwatch;
use super::map::MapRun;
use super::placing::PlacingRun;
use super::segmentation::SegmentationRun;
use super::settings::{EntityForm, SegmentationForm, SurfaceForm, map_forms, placing_efforts};
use super::subject::{Scope, Subject};
use super::views::{Easel, ViewForm, ViewTime, ViewsRun, view_times};
use std::collections::BTreeMap;
use videofields_picture::occupancy::Effort;
use videofields_picture::plan::{self, CostRow, EntityStyle, HullForm, MAX_ENTITY_SOURCES, Sampling, Spread};
use videofields_vision::error::one_of;
use videofields_vision::frame::RgbImage;
use videofields_vision::geometry::Shape;
use videofields_vision::mapping::{Builder, MappingError};
use videofields_vision::measures::AccuracyError;

/// A part of the way from frames to pictures that is judged by itself; in the order in which it is swept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Background and foreground of frames.
    Segmentation,
    /// From texels to world points.
    Map,
    /// From masks to people on the ground.
    Placing,
    /// Backgrounds projected on ground and boxes.
    Surfaces,
    /// What moves.
    Entities,
    /// All together.
    Pipeline,
}

impl Stage {
    /// Every stage.
    pub const ALL: [Self; 6] =
        [Self::Segmentation, Self::Map, Self::Placing, Self::Surfaces, Self::Entities, Self::Pipeline];

    /// Returns the stages that plans of pictures are made by: all but placing, which runs beside pictures.
    #[must_use]
    pub fn of_plans() -> Vec<Self> {
        Self::ALL.into_iter().filter(|stage| *stage != Self::Placing).collect()
    }

    /// Its name in commands, files and tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Segmentation => "segmentation",
            Self::Map => "map",
            Self::Placing => "placing",
            Self::Surfaces => "surfaces",
            Self::Entities => "entities",
            Self::Pipeline => "pipeline",
        }
    }

    /// What its main error is, with the unit.
    #[must_use]
    pub const fn error_name(self) -> &'static str {
        match self {
            Self::Segmentation => "1 - F-measure",
            Self::Map => "mean distance, m",
            Self::Placing => "1 - MODA",
            Self::Surfaces => "RMSE of the still part, 8-bit codes",
            Self::Entities => "RMSE at people, 8-bit codes",
            Self::Pipeline => "mean of both RMSE, 8-bit codes",
        }
    }

    /// What its time is of.
    #[must_use]
    pub const fn work(self) -> &'static str {
        match self {
            Self::Segmentation => "one frame of one camera",
            Self::Map => "the map of one camera",
            Self::Placing => "one instant of every camera",
            Self::Surfaces | Self::Entities => "one view",
            Self::Pipeline => "one frame of every camera and one view",
        }
    }
}

impl std::str::FromStr for Stage {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        one_of("stage", text, &Self::ALL, Self::name)
    }
}

/// A setting that was not measured, and why.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Skipped {
    /// The stage.
    pub stage: String,
    /// What was set.
    pub knob: String,
    /// To what.
    pub value: String,
    /// Why it was not measured.
    pub reason: String,
}

/// A picture, what it should have been, and what it shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// What it is of.
    pub title: String,
    /// As the daemon draws it.
    pub picture: RgbImage,
    /// As it is.
    pub truth: RgbImage,
}

/// What a sweep found.
#[derive(Clone, Debug, Default)]
pub struct Sweep {
    /// One row a setting.
    pub rows: Vec<CostRow>,
    /// Settings that were not measured.
    pub skipped: Vec<Skipped>,
    /// Rows of the stage `pipeline` that no other beats, by rising cost: indices into `rows`.
    pub front: Vec<usize>,
    /// The front's knee: an index into `rows`.
    pub knee: Option<usize>,
    /// Pictures to look at.
    pub examples: Vec<Example>,
    /// The adapter that drew; empty where nothing was drawn.
    pub adapter: String,
    /// Whether everything asked for was measured.
    pub is_complete: bool,
}

/// Sweeps `stages` of the place that `prepare` makes ready, step by step as the stopwatch's gate lets it; what was measured before it
/// ended the sweep is kept. `progress` hears what is being done.
///
/// # Errors
/// When the place cannot be made ready or drawn.
pub fn sweep_gated(
    prepare: &dyn Fn() -> Result<Subject, SweepError>,
    scope: &Scope,
    stages: &[Stage],
    watch: &Stopwatch<'_>,
    progress: &dyn Fn(&str),
) -> Result<Sweep, SweepError> {
    let mut sweep = Sweep::default();
    let outcome = prepare().and_then(|subject| {
        Sweeper { subject: &subject, scope, watch, progress, sweep: &mut sweep }.run(stages)
    });
    match outcome {
        Ok(()) => sweep.is_complete = true,
        Err(SweepError::Stopped) => {}
        Err(error) => return Err(error),
    }
    Ok(sweep)
}

struct Sweeper<'a> {
    subject: &'a Subject,
    scope: &'a Scope,
    watch: &'a Stopwatch<'a>,
    progress: &'a dyn Fn(&str),
    sweep: &'a mut Sweep,
}

/// What a stage leaves for the pipelines: forms with their runs.
type Segmentations = Vec<(SegmentationForm, SegmentationRun)>;

impl Sweeper<'_> {
    fn run(&mut self, stages: &[Stage]) -> Result<(), SweepError> {
        let wants = |stage: Stage| stages.contains(&stage);
        let draws = [Stage::Surfaces, Stage::Entities, Stage::Pipeline].into_iter().any(wants);
        let default_form = self.default_form()?;
        let mut segmentations = Vec::new();
        if wants(Stage::Segmentation) || wants(Stage::Pipeline) {
            segmentations = self.segmentation(default_form)?;
        } else if draws {
            segmentations.push((default_form, SegmentationRun::of(self.subject, &default_form, self.watch)?));
        }
        if wants(Stage::Map) {
            self.map()?;
        }
        if wants(Stage::Placing) {
            self.placing(default_form)?;
        }
        if !draws {
            return Ok(());
        }
        let observed = segmentations.iter().position(|(form, _)| *form == default_form).unwrap_or(0);
        let mut studio = self.studio(&segmentations[observed].1, stages)?;
        if wants(Stage::Surfaces) {
            self.surfaces(&mut studio, &segmentations[observed].1)?;
        }
        if wants(Stage::Entities) || wants(Stage::Pipeline) {
            self.entities(&mut studio, &segmentations[observed].1)?;
        }
        if wants(Stage::Pipeline) {
            self.pipelines(&mut studio, &segmentations, default_form)?;
        }
        Ok(())
    }

    /// Every easel that the stages need, and what a view takes on each.
    fn studio(&mut self, observed: &SegmentationRun, stages: &[Stage]) -> Result<Studio, SweepError> {
        let default = SurfaceForm::of(&self.subject.render);
        let mut wanted: Vec<ViewForm> = Vec::new();
        if stages.contains(&Stage::Surfaces) {
            wanted.extend(
                default.sweep(self.n_cameras()).into_iter().map(|(.., form)| (form, EntityForm::NOTHING)),
            );
        }
        if stages.contains(&Stage::Entities) || stages.contains(&Stage::Pipeline) {
            wanted.extend(EntityForm::ALL.map(|entities| (default, entities)));
        }
        if stages.contains(&Stage::Pipeline) {
            for surface in pipeline_surfaces(default) {
                wanted.extend(EntityForm::ALL.into_iter().skip(1).map(|entities| (surface, entities)));
            }
        }
        let mut combinations: Vec<ViewForm> = Vec::new();
        let mut easels: Vec<(u32, Easel)> = Vec::new();
        for pair in wanted {
            if !combinations.contains(&pair) {
                combinations.push(pair);
            }
            let side_px = self.side_px(&pair.0);
            if !easels.iter().any(|(of, _)| *of == side_px) {
                easels.push((side_px, self.easel(pair.0)?));
            }
        }
        (self.progress)(&format!("views: the time of {} ways to draw them, in turns", combinations.len()));
        let (sides, mut easels): (Vec<u32>, Vec<Easel>) = easels.into_iter().unzip();
        let place_of =
            |form: &SurfaceForm| sides.iter().position(|of| *of == self.side_px(form)).unwrap_or(0);
        let places: Vec<(usize, ViewForm)> =
            combinations.iter().map(|form| (place_of(&form.0), *form)).collect();
        let times = view_times(self.subject, observed, &mut easels, &places, self.watch)?;
        let times = combinations.into_iter().zip(times).collect();
        Ok(Studio {
            default_px: self.subject.render.depth_map_side_px,
            easels: sides.into_iter().zip(easels).collect(),
            times,
        })
    }

    /// Of which side the depth maps of the form's easel are.
    fn side_px(&self, form: &SurfaceForm) -> u32 {
        form.depth_map_side_px.unwrap_or(self.subject.render.depth_map_side_px)
    }

    fn n_cameras(&self) -> usize {
        self.subject.cameras.len()
    }

    fn default_form(&self) -> Result<SegmentationForm, SweepError> {
        let first = self.subject.cameras.first().ok_or(SweepError::NoCamera)?;
        Ok(SegmentationForm::of(&first.settings, first.size_px()))
    }

    fn push(&mut self, stage: Stage, knob: &str, value: &str, place: Place, cost: Cost) {
        self.sweep.rows.push(CostRow {
            stage: stage.name().to_owned(),
            knob: knob.to_owned(),
            value: value.to_owned(),
            is_default: place == Place::Default,
            time_ms: cost.time_ms,
            memory_bytes: cost.memory_bytes,
            error: cost.error,
            measures: cost.measures,
        });
    }

    fn skip(&mut self, stage: Stage, knob: &str, value: &str, reason: String) {
        let (stage, knob, value) = (stage.name().to_owned(), knob.to_owned(), value.to_owned());
        self.sweep.skipped.push(Skipped { stage, knob, value, reason });
    }

    fn segmentation(&mut self, default: SegmentationForm) -> Result<Segmentations, SweepError> {
        let sweep = default.sweep();
        let mut forms: Vec<SegmentationForm> = Vec::new();
        for (.., form) in &sweep {
            if !forms.contains(form) {
                forms.push(*form);
            }
        }
        (self.progress)(&format!("segmentation: {} forms in turns", forms.len()));
        let (runs, outcome) = SegmentationRun::all(self.subject, &forms, self.watch)?;
        let runs: Segmentations = forms.into_iter().zip(runs).collect();
        for (knob, value, form) in sweep {
            let Some((_, run)) = runs.iter().find(|(of, _)| *of == form) else { continue };
            let (error, measures) = run.measures();
            let cost =
                Cost { time_ms: run.time_ms, memory_bytes: run.memory_bytes, error: Some(error), measures };
            self.push(Stage::Segmentation, knob, &value, Place::from(form == default), cost);
        }
        outcome?;
        Ok(runs)
    }

    fn map(&mut self) -> Result<(), SweepError> {
        let mut runs: Vec<(String, Builder, MapRun)> = Vec::new();
        for (value, builder) in map_forms() {
            match self.beyond_scope(builder) {
                Some(reason) => self.skip(Stage::Map, "builder", &value, reason),
                None => runs.push((value, builder, MapRun::default())),
            }
        }
        // In turns, so that what else the machine does falls on all alike.
        for round in 0..self.scope.n_map_builds.max(1) {
            let mut refused = Vec::new();
            for (idx, (value, builder, run)) in runs.iter_mut().enumerate() {
                (self.progress)(&format!("map: {value}, round {}", round + 1));
                match run.build(self.subject, *builder, self.watch) {
                    Err(SweepError::Mapping(error @ MappingError::GridPoints { .. })) => {
                        refused.push((idx, error.to_string()));
                    }
                    outcome => outcome?,
                }
            }
            for (idx, reason) in refused.into_iter().rev() {
                let (value, ..) = runs.remove(idx);
                self.skip(Stage::Map, "builder", &value, reason);
            }
        }
        for (value, builder, run) in runs {
            let (error, measures) = run.measures();
            let time_ms = run.time_ms().ok_or(SweepError::Untimed)?;
            let cost = Cost { time_ms, memory_bytes: run.memory_bytes(), error, measures };
            self.push(Stage::Map, "builder", &value, Place::from(builder == Builder::Ray), cost);
        }
        Ok(())
    }

    fn placing(&mut self, form: SegmentationForm) -> Result<(), SweepError> {
        let sweep = placing_efforts();
        let mut efforts: Vec<Effort> = Vec::new();
        for (.., effort) in &sweep {
            if !efforts.contains(effort) {
                efforts.push(*effort);
            }
        }
        (self.progress)(&format!("placing: {} efforts in turns", efforts.len()));
        let runs = PlacingRun::all(self.subject, &form, &efforts, self.watch)?;
        for (knob, value, effort) in sweep {
            let Some(run) = efforts.iter().position(|of| *of == effort).map(|idx| &runs[idx]) else {
                continue;
            };
            let (error, measures) = run.measures();
            let time_ms = run.time_ms().ok_or(SweepError::Untimed)?;
            let cost = Cost { time_ms, memory_bytes: run.memory_bytes(), error, measures };
            self.push(Stage::Placing, knob, &value, Place::from(effort == Effort::default()), cost);
        }
        Ok(())
    }

    /// Why a grid is left out, if it is: more points over the ground alone than the scope allows.
    fn beyond_scope(&self, builder: Builder) -> Option<String> {
        let Builder::Grid(settings) = builder else { return None };
        let most = self.scope.max_grid_points;
        let points: f64 = self
            .subject
            .scene
            .surfaces
            .shapes()
            .iter()
            .filter(|shape| matches!(shape, Shape::Ground(_) | Shape::HeightField(_)))
            .map(|ground| {
                let (low, high) = ground.bounds();
                ((high - low).truncate() / settings.step_m).element_product()
            })
            .sum();
        (points > most as f64)
            .then(|| format!("{points:.0} points over the ground alone, more than the {most} of this run"))
    }

    fn surfaces(&mut self, studio: &mut Studio, observed: &SegmentationRun) -> Result<(), SweepError> {
        let default = SurfaceForm::of(&self.subject.render);
        let mut runs: Vec<(SurfaceForm, ViewsRun)> = Vec::new();
        for (knob, value, form) in default.sweep(self.n_cameras()) {
            let known = runs.iter().position(|(of, _)| *of == form);
            let idx = match known {
                Some(idx) => idx,
                None => {
                    (self.progress)(&format!("surfaces: {knob} {value}"));
                    let easel = studio.easel(form)?;
                    let form_of = (form, EntityForm::NOTHING);
                    runs.push((form, easel.judge(self.subject, observed, form_of, self.watch)?));
                    runs.len() - 1
                }
            };
            let run = &runs[idx].1;
            let mut measures = run.measures();
            measures.retain(|name, _| {
                !name.starts_with("people") && name != "silhouette_iou" && name != "balanced_rmse"
            });
            measures.extend(studio.work(form, EntityForm::NOTHING)?);
            let cost = Cost {
                time_ms: studio.time_ms(form, EntityForm::NOTHING)?,
                memory_bytes: run.target_bytes(),
                error: run.still_rmse(),
                measures,
            };
            self.push(Stage::Surfaces, knob, &value, Place::from(form == default), cost);
        }
        Ok(())
    }

    fn easel(&mut self, form: SurfaceForm) -> Result<Easel, SweepError> {
        let easel = Easel::new(self.subject, form)?;
        self.sweep.adapter = easel.adapter();
        Ok(easel)
    }

    fn entities(&mut self, studio: &mut Studio, observed: &SegmentationRun) -> Result<(), SweepError> {
        let surface = SurfaceForm::of(&self.subject.render);
        for form in EntityForm::ALL {
            (self.progress)(&format!("entities: {}", form.label()));
            let run = studio.easel(surface)?.judge(self.subject, observed, (surface, form), self.watch)?;
            let mut measures = run.measures();
            measures.extend(studio.work(surface, form)?);
            let cost = Cost {
                time_ms: studio.time_ms(surface, form)?,
                memory_bytes: run.entity_bytes(),
                error: run.people_rmse(),
                measures,
            };
            self.push(
                Stage::Entities,
                "style",
                &form.label(),
                Place::from(form == EntityForm::DEFAULT),
                cost,
            );
            self.keep_example(&run, form);
        }
        Ok(())
    }

    /// Keeps the first picture of what a person should see: the default, the other style, nothing.
    fn keep_example(&mut self, run: &ViewsRun, form: EntityForm) {
        let is_shown = match form.style {
            EntityStyle::Points => form.stride == 1,
            EntityStyle::Billboards => form.sources == MAX_ENTITY_SOURCES,
            EntityStyle::Hulls => form.hull == HullForm::EXACT,
            EntityStyle::None | EntityStyle::Auto => true,
        };
        let (Some((frame, picture)), Some(view)) = (run.examples.first(), self.subject.views.first()) else {
            return;
        };
        let Some((_, judged)) = view.frames.iter().find(|(of, _)| of == frame) else { return };
        if is_shown {
            let example =
                Example { title: form.label(), picture: picture.clone(), truth: judged.truth.rgb.clone() };
            self.sweep.examples.insert(0, example);
        }
    }

    /// The cross of what is worth having of each stage, bounded in number and time.
    fn pipelines(
        &mut self,
        studio: &mut Studio,
        segmentations: &Segmentations,
        default: SegmentationForm,
    ) -> Result<(), SweepError> {
        let chosen = chosen(segmentations, default);
        let entities = self.entity_forms();
        let surface_default = SurfaceForm::of(&self.subject.render);
        let surfaces = pipeline_surfaces(surface_default);
        let mut combinations: Vec<(usize, SurfaceForm, EntityForm)> = Vec::new();
        for entity in &entities {
            for surface in surfaces {
                combinations.extend(chosen.iter().map(|idx| (*idx, surface, *entity)));
            }
        }
        // The default first, so that a bound cuts it last.
        let is_default = |(idx, surface, entity): &(usize, SurfaceForm, EntityForm)| {
            segmentations[*idx].0 == default && *surface == surface_default && *entity == EntityForm::DEFAULT
        };
        combinations.sort_by_key(|of| !is_default(of));
        let clock = self.watch.clock();
        let started = clock.monotonic();
        let first_row = self.sweep.rows.len();
        for (count, combination) in combinations.iter().enumerate() {
            let (idx, surface, entity) = *combination;
            let (form, run) = &segmentations[idx];
            let label = format!("{}; samples {}; {}", form.label(), surface.sampling.samples, entity.label());
            let spent_secs = clock.monotonic().saturating_sub(started).as_secs_f64();
            if count >= self.scope.max_pipelines || spent_secs > self.scope.max_pipelines_secs {
                let reason = format!(
                    "beyond the bound of {} pipelines or {} s",
                    self.scope.max_pipelines, self.scope.max_pipelines_secs
                );
                self.skip(Stage::Pipeline, "whole", &label, reason);
                continue;
            }
            (self.progress)(&format!("pipeline: {label}"));
            let views = studio.easel(surface)?.judge(self.subject, run, (surface, entity), self.watch)?;
            let n_cameras = self.subject.cameras.len() as f64;
            let time_ms = studio.time_ms(surface, entity)?.plus(run.time_ms, n_cameras);
            let mut measures = views.measures();
            measures.extend(run.measures().1);
            let memory_bytes = run.memory_bytes * self.subject.cameras.len() as u64
                + views.target_bytes()
                + views.entity_bytes();
            let cost = Cost { time_ms, memory_bytes, error: views.balanced_rmse(), measures };
            self.push(Stage::Pipeline, "whole", &label, Place::from(is_default(combination)), cost);
        }
        self.find_front(first_row);
        Ok(())
    }

    fn find_front(&mut self, first_row: usize) {
        let rows = &self.sweep.rows[first_row..];
        let points: Vec<(f64, f64)> =
            rows.iter().map(|row| (row.time_ms.median, row.error.unwrap_or(f64::NAN))).collect();
        let front = pareto_front(&points);
        self.sweep.knee = knee(&points, &front).map(|idx| idx + first_row);
        self.sweep.front = front.into_iter().map(|idx| idx + first_row).collect();
    }

    /// The entities' forms on their own front, cheap to exact, and the default; a pipeline that draws nobody is none.
    fn entity_forms(&self) -> Vec<EntityForm> {
        let nothing = EntityForm::NOTHING.label();
        let of_entities = |row: &&CostRow| row.stage == Stage::Entities.name() && row.value != nothing;
        let rows: Vec<&CostRow> = self.sweep.rows.iter().filter(of_entities).collect();
        let points: Vec<(f64, f64)> =
            rows.iter().map(|row| (row.time_ms.median, row.error.unwrap_or(f64::NAN))).collect();
        let form_of = |idx: usize| EntityForm::ALL.into_iter().find(|form| form.label() == rows[idx].value);
        let mut forms: Vec<EntityForm> = pareto_front(&points).into_iter().filter_map(form_of).collect();
        if !forms.contains(&EntityForm::DEFAULT) {
            forms.push(EntityForm::DEFAULT);
        }
        forms
    }
}

/// Renderers, and what a view takes in each form.
struct Studio {
    /// The side of depth maps where a form names none.
    default_px: u32,
    /// By the side of their depth maps.
    easels: Vec<(u32, Easel)>,
    times: Vec<(ViewForm, ViewTime)>,
}

impl Studio {
    fn easel(&mut self, form: SurfaceForm) -> Result<&mut Easel, SweepError> {
        let side_px = form.depth_map_side_px.unwrap_or(self.default_px);
        let found = self.easels.iter_mut().find(|(of, _)| *of == side_px);
        found.map(|(_, easel)| easel).ok_or(SweepError::Untimed)
    }

    fn time(&self, surface: SurfaceForm, entities: EntityForm) -> Result<&ViewTime, SweepError> {
        let found = self.times.iter().find(|(of, _)| *of == (surface, entities));
        found.map(|(_, time)| time).ok_or(SweepError::Untimed)
    }

    fn time_ms(&self, surface: SurfaceForm, entities: EntityForm) -> Result<Spread, SweepError> {
        Ok(self.time(surface, entities)?.time_ms)
    }

    /// How much work a form's views are and what each stage takes of it, as measures.
    fn work(&self, surface: SurfaceForm, entities: EntityForm) -> Result<BTreeMap<String, f64>, SweepError> {
        let middle = self.time(surface, entities)?.middle;
        Ok(middle.map(|(work, took)| plan::told(&work, &took).collect()).unwrap_or_default())
    }
}

/// The surfaces' forms of whole pipelines: what a view's edges cost.
fn pipeline_surfaces(default: SurfaceForm) -> [SurfaceForm; 2] {
    [1, 4].map(|samples| SurfaceForm { sampling: Sampling { samples, supersampling: 1 }, ..default })
}

/// The segmentations on their own front, and the default.
fn chosen(segmentations: &Segmentations, default: SegmentationForm) -> Vec<usize> {
    let points: Vec<(f64, f64)> =
        segmentations.iter().map(|(_, run)| (run.time_ms.median, run.measures().0)).collect();
    let mut chosen = pareto_front(&points);
    let of_default = segmentations.iter().position(|(form, _)| *form == default);
    chosen.extend(of_default.filter(|idx| !chosen.contains(idx)));
    chosen
}

/// Where a setting stands among those of its stage.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    Default,
    Other,
}

impl From<bool> for Place {
    fn from(is_default: bool) -> Self {
        if is_default { Self::Default } else { Self::Other }
    }
}

struct Cost {
    time_ms: Spread,
    memory_bytes: u64,
    error: Option<f64>,
    measures: BTreeMap<String, f64>,
}

impl From<AccuracyError> for SweepError {
    fn from(error: AccuracyError) -> Self {
        Self::Picture(error.to_string())
    }
}
