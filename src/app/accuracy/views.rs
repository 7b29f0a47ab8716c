//! Views where no camera stands: drawn as the daemon draws them, judged against the truth.
//!
//! The unit of work that is timed is one view of one instant: fuse, plan, render (which takes new frames up to the
//! GPU first), until its pixels are back. Backgrounds are on the GPU already, as live, where frames of a second share
//! one picture.

use super::SweepError;
use super::gate::Stopwatch;
use super::segmentation::SegmentationRun;
use super::settings::{EntityForm, SurfaceForm};
use super::subject::{JudgedView, Subject, SubjectView};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;
use videofields_picture::fuse::{Billboard, HullMemory, Placing, PointRun, SceneState};
use videofields_picture::plan::{
    self, Colors, EntityStyle, Picture, Spread, StageTimes, Survey, Wishes, Work,
};
use videofields_render::gpu::Gpu;
use videofields_render::{RenderError, Renderer};
use videofields_vision::clock::Clock;
use videofields_vision::frame::{CameraId, Mask, RgbImage};
use videofields_vision::measures::{Comparison, compare};
use videofields_vision::measures::{MaskScore, Mean, Pooled, SeamEnergy, add_flicker, dilated, silhouette};
use videofields_vision::observation::Observation;

/// Pixels around people that count as theirs: what is drawn beside them is an error too.
const PEOPLE_MARGIN_PX: u32 = 4;

/// How surfaces are drawn, and how entities are.
pub type ViewForm = (SurfaceForm, EntityForm);

/// A renderer with depth maps of one size.
#[derive(Debug)]
pub struct Easel {
    renderer: Renderer,
    placing: Placing,
}

/// What a form's pictures are worth.
#[derive(Debug, Default)]
pub struct ViewsRun {
    /// Bytes of what stands for the entities, the mean over the pictures.
    entity_bytes: Mean,
    /// Bytes of the targets that are drawn into.
    target_bytes: u64,
    people: Pooled,
    still: Pooled,
    /// Whole pictures, with entities and without.
    whole: Pooled,
    bare: Pooled,
    silhouettes: MaskScore,
    seams: SeamEnergy,
    flicker: Mean,
    /// Pictures of the first view, with their frame, for showing.
    pub examples: Vec<(usize, RgbImage)>,
}

impl Easel {
    /// A renderer for forms with the depth maps of `form` on the adapter that the subject's settings name.
    ///
    /// # Errors
    /// When there is no such adapter, or it refuses.
    pub fn new(subject: &Subject, form: SurfaceForm) -> Result<Self, SweepError> {
        let settings = form.applied(&subject.render);
        let renderer = Renderer::new(Gpu::new(&settings.adapter)?, &settings)?;
        Ok(Self { renderer, placing: Placing::default() })
    }

    /// The adapter's name.
    #[must_use]
    pub fn adapter(&self) -> String {
        self.renderer.gpu().name().to_owned()
    }

    /// Draws a view of a subject at a frame.
    fn draw(
        &mut self,
        subject: &Subject,
        view: &SubjectView,
        moment: Moment,
        observations: &SegmentationRun,
        (surface, entities): ViewForm,
        clock: &dyn Clock,
    ) -> Result<Drawn, RenderError> {
        let started = clock.monotonic();
        let find = |id: &CameraId| {
            let background = Arc::clone(&observations.of_frame(moment.background_frame, id)?.background);
            Some(Observation { background, ..observations.of_frame(moment.frame, id)?.clone() })
        };
        let instant = subject.instant(moment.frame + subject.n_frames());
        let mut state = self.placing.assemble_alone(&subject.scene, instant, find);
        let picture = Picture::from(view.view);
        let settings = surface.with(entities);
        settings.place(&mut state, &mut HullMemory::default());
        let plan = plan::make(
            &state,
            &picture,
            Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() },
        );
        let survey = Survey::of(&state, &picture, &plan);
        let work = survey.work(&settings, self.renderer.pending(&state, &plan));
        let planned = clock.monotonic();
        let rendered = self.renderer.render(&state, &picture, &plan)?;
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let [before, drawing] =
            [planned.saturating_sub(started), clock.monotonic().saturating_sub(planned)].map(ms);
        let passes = rendered.timings.iter().map(|pass| (pass.pass, ms(pass.gpu)));
        Ok(Drawn { image: rendered.image, state, work, took: StageTimes::of(before, drawing, passes) })
    }

    /// Draws all of the subject's views and judges them.
    ///
    /// # Errors
    /// When a picture cannot be drawn, or the gate ends it.
    pub fn judge(
        &mut self,
        subject: &Subject,
        observations: &SegmentationRun,
        (surface, entities): ViewForm,
        watch: &Stopwatch<'_>,
    ) -> Result<ViewsRun, SweepError> {
        let mut run = ViewsRun::default();
        for (view_idx, view) in subject.views.iter().enumerate() {
            run.target_bytes = target_bytes(view, &surface);
            let mut pictures = Vec::new();
            for (frame, judged) in &view.frames {
                watch.enter()?;
                let moment = Moment { frame: *frame, background_frame: *frame };
                let drawn =
                    self.draw(subject, view, moment, observations, (surface, entities), watch.clock())?;
                let (picture, state) = (drawn.image, drawn.state);
                run.entity_bytes.add(entity_bytes(&state, entities.style) as f64);
                watch.enter()?;
                let bare = self
                    .draw(subject, view, moment, observations, (surface, EntityForm::NOTHING), watch.clock())?
                    .image;
                run.judge(view, judged, &picture, &bare)?;
                pictures.push((*frame, picture));
            }
            for (pair, truths) in pictures.chunks_exact(2).zip(view.frames.chunks_exact(2)) {
                run.judge_pair([&pair[0].1, &pair[1].1], truths);
            }
            if view_idx == 0 {
                run.examples = pictures;
            }
        }
        Ok(run)
    }
}

/// Bytes of what a view is drawn on.
fn target_bytes(view: &SubjectView, form: &SurfaceForm) -> u64 {
    let times = u64::from(form.sampling.supersampling);
    let drawn = view.view.coarse(form.resolution.step_px(), 0);
    let pixels = u64::from(drawn.width_px) * u64::from(drawn.height_px) * times * times;
    let samples = u64::from(form.sampling.samples);
    // Colour and depth, 4 bytes each, by sample; and the resolved picture, if there is more than one.
    pixels * (8 * samples + if samples > 1 { 4 } else { 0 })
}

/// Which of the period's frames is drawn, over the backgrounds of which.
#[derive(Clone, Copy)]
struct Moment {
    frame: usize,
    background_frame: usize,
}

/// Times of a form that are enough to be told.
const LEAST_TIMES: usize = 3;

/// Draws the subject's views with every combination of an easel (by its place) and a form, one picture of
/// each in turns, so that what else the machine does falls on all alike; their times. What the gate ends early is told
/// as far as it went, once every combination was timed some times.
///
/// # Errors
/// When a picture cannot be drawn, or the gate ends it before.
pub fn view_times(
    subject: &Subject,
    observations: &SegmentationRun,
    easels: &mut [Easel],
    combinations: &[(usize, ViewForm)],
    watch: &Stopwatch<'_>,
) -> Result<Vec<ViewTime>, SweepError> {
    let mut times_ms: Vec<Vec<f64>> = vec![Vec::new(); combinations.len()];
    let mut works: Vec<Vec<(Work, StageTimes)>> = vec![Vec::new(); combinations.len()];
    // The first round is not counted: pipelines and targets are made at the first picture.
    let pairs: Vec<_> = subject.views.iter().flat_map(frame_pairs).collect();
    let rounds = pairs.first().into_iter().chain(&pairs);
    'rounds: for (round, &(view, [before, frame])) in rounds.enumerate() {
        for (idx, (easel, form)) in combinations.iter().enumerate() {
            let draw = |easel: &mut Easel, frame| {
                let moment = Moment { frame, background_frame: before };
                easel.draw(subject, view, moment, observations, *form, watch.clock())
            };
            // The frame before brings the backgrounds, untimed, so that every combination begins alike; were it to
            // fail, so would the next.
            let prepare = |easel: &mut Easel| drop(draw(easel, before));
            let (drawn, time_ms) =
                match watch.again_after(&mut easels[*easel], prepare, |easel| draw(easel, frame)) {
                    Err(_stopped) if times_ms.iter().all(|times| times.len() >= LEAST_TIMES) => break 'rounds,
                    timed => timed?,
                };
            let drawn = drawn?;
            if round > 0 {
                times_ms[idx].push(time_ms);
                works[idx].push((drawn.work, drawn.took));
            }
        }
    }
    let told = |(times, works): (&Vec<f64>, Vec<(Work, StageTimes)>)| {
        let time_ms = Spread::of(times).ok_or(SweepError::Untimed)?;
        Ok(ViewTime { time_ms, middle: middle(works) })
    };
    times_ms.iter().zip(works).map(told).collect()
}

/// What a form's views take.
#[derive(Clone, Copy, Debug)]
pub struct ViewTime {
    /// All of it, milliseconds.
    pub time_ms: Spread,
    /// Of the picture that took the middle time: how much work it was, and what each stage took.
    pub middle: Option<(Work, StageTimes)>,
}

fn middle(mut works: Vec<(Work, StageTimes)>) -> Option<(Work, StageTimes)> {
    works.sort_by(|a, b| a.1.sum().total_cmp(&b.1.sum()));
    works.get(works.len() / 2).copied()
}

/// A picture with what it was put together from.
struct Drawn {
    image: RgbImage,
    state: SceneState,
    work: Work,
    took: StageTimes,
}

/// A view's pairs of frames that follow each other, each pair both ways round.
fn frame_pairs(view: &SubjectView) -> impl Iterator<Item = (&SubjectView, [usize; 2])> {
    view.frames.chunks_exact(2).flat_map(move |pair| {
        let [first, second] = [pair[0].0, pair[1].0];
        [[first, second], [second, first]].map(|pair| (view, pair))
    })
}

fn entity_bytes(state: &SceneState, style: EntityStyle) -> usize {
    match style {
        EntityStyle::Points => state.points.len() * size_of::<PointRun>(),
        EntityStyle::Billboards => {
            state.entities.iter().map(|entity| entity.sources.len() * size_of::<Billboard>()).sum()
        }
        EntityStyle::Hulls | EntityStyle::Auto => {
            let distances = state.hulls.iter().flat_map(|hull| &hull.distances);
            distances.map(|mask| mask.data.len()).sum()
        }
        EntityStyle::None => 0,
    }
}

impl ViewsRun {
    /// Judges a picture of a view: `picture` with its entities, `bare` without.
    ///
    /// # Errors
    /// When a picture is not of the view's size.
    ///
    /// # Panics
    /// When a mask is not of the view's size.
    pub fn judge(
        &mut self,
        view: &SubjectView,
        judged: &JudgedView,
        picture: &RgbImage,
        bare: &RgbImage,
    ) -> Result<(), SweepError> {
        let truth = &judged.truth;
        let people = dilated(&truth.instance, PEOPLE_MARGIN_PX);
        let over = |mask: &Mask| -> Result<Option<Comparison>, SweepError> {
            let is_empty = mask.data.iter().all(|value| *value == 0);
            Ok(if is_empty { None } else { Some(compare(&truth.rgb, picture, Some(mask))?) })
        };
        if let Some(comparison) = over(&people)? {
            self.people.add(&comparison);
        }
        if let Some(comparison) = over(&judged.still)? {
            self.still.add(&comparison);
        }
        self.whole.add(&compare(&truth.rgb, picture, None)?);
        self.bare.add(&compare(&truth.rgb, bare, None)?);
        let shown = silhouette(picture, bare);
        self.silhouettes.add(&shown, &truth.instance, |value| value > 0, |value| value > 0);
        self.seams.add(picture, &truth.rgb, &view.owners, &judged.still);
        Ok(())
    }

    fn judge_pair(&mut self, pictures: [&RgbImage; 2], truths: &[(usize, JudgedView)]) {
        let [(first_frame, first), (second_frame, second)] = truths else { return };
        if first_frame == second_frame {
            return;
        }
        let both = first.still.data.iter().zip(&second.still.data).map(|(a, b)| *a & *b).collect();
        let part = Mask { width: first.still.width, height: first.still.height, data: both };
        add_flicker(&mut self.flicker, pictures, [&first.truth.rgb, &second.truth.rgb], &part);
    }

    /// Bytes of what stands for the entities.
    #[must_use]
    pub fn entity_bytes(&self) -> u64 {
        self.entity_bytes.value().unwrap_or(0.0) as u64
    }

    /// Bytes of what is drawn into.
    #[must_use]
    pub const fn target_bytes(&self) -> u64 {
        self.target_bytes
    }

    /// RMSE at people's pixels and 4 around, 8-bit codes.
    #[must_use]
    pub fn people_rmse(&self) -> Option<f64> {
        self.people.rmse()
    }

    /// Returns by how much whole pictures with entities are nearer to the truth than without: the difference of PSNRs, dB, below 0 where
    /// they are further.
    #[must_use]
    pub fn entity_gain_db(&self) -> Option<f64> {
        Some(self.whole.psnr_db()? - self.bare.psnr_db()?)
    }

    /// RMSE of the still part that a camera sees, 8-bit codes.
    #[must_use]
    pub fn still_rmse(&self) -> Option<f64> {
        self.still.rmse()
    }

    /// The mean of both, so that the few people count as much as all the place; one of them where there is one alone.
    #[must_use]
    pub fn balanced_rmse(&self) -> Option<f64> {
        match (self.people_rmse(), self.still_rmse()) {
            (Some(people), Some(still)) => Some(0.5 * (people + still)),
            (people, still) => people.or(still),
        }
    }

    /// Every measure by name.
    #[must_use]
    pub fn measures(&self) -> BTreeMap<String, f64> {
        super::named([
            ("people_rmse", self.people_rmse()),
            ("people_psnr_db", self.people.psnr_db()),
            ("people_ssim", self.people.ssim()),
            ("silhouette_iou", Some(self.silhouettes.intersection_over_union())),
            ("still_rmse", self.still_rmse()),
            ("still_psnr_db", self.still.psnr_db()),
            ("still_ssim", self.still.ssim()),
            ("seam_energy", self.seams.across.value()),
            ("seam_ratio", self.seams.ratio()),
            ("flicker", self.flicker.value()),
            ("balanced_rmse", self.balanced_rmse()),
        ])
    }
}
