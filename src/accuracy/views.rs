//! Views where no camera stands: drawn as the daemon draws them, judged against the truth.
//!
//! The unit of work that is timed is one view of one instant: fuse, plan, render (which takes new frames up to the
//! GPU first), until its pixels are back.

use super::SweepError;
use super::comparison::{Comparison, compare};
use super::gate::Stopwatch;
use super::measures::{MaskScore, Mean, Pooled, add_flicker, add_seam_energy, dilated, silhouette};
use super::segmentation::SegmentationRun;
use super::settings::{EntityForm, SurfaceForm};
use super::subject::{Subject, SubjectView};
use crate::frame::{CameraId, Mask, RgbImage};
use crate::fuse::{self, Billboard, EntityPoint, SceneState};
use crate::gpu::Gpu;
use crate::plan::{self, EntityStyle, Spread};
use crate::render::{RenderError, Renderer};
use std::collections::BTreeMap;

/// Pixels around people that count as theirs: what is drawn beside them is an error too.
const PEOPLE_MARGIN_PX: u32 = 4;

/// A renderer with the surfaces' form that it draws with.
#[derive(Debug)]
pub struct Easel {
    renderer: Renderer,
    form: SurfaceForm,
}

/// What a form's pictures are worth.
#[derive(Debug, Default)]
pub struct ViewsRun {
    /// Of one picture.
    times_ms: Vec<f64>,
    /// Bytes of what stands for the entities, the mean over the pictures.
    entity_bytes: Mean,
    /// Bytes of the targets that are drawn into.
    target_bytes: u64,
    people: Pooled,
    still: Pooled,
    silhouettes: MaskScore,
    seams: Mean,
    flicker: Mean,
    /// Pictures of the first view, with their frame, for showing.
    pub examples: Vec<(usize, RgbImage)>,
}

impl Easel {
    /// A renderer for `form` on the adapter that the subject's settings name.
    ///
    /// # Errors
    /// When there is no such adapter, or it refuses.
    pub fn new(subject: &Subject, form: SurfaceForm) -> Result<Self, SweepError> {
        let settings = form.applied(&subject.render);
        let renderer = Renderer::new(Gpu::new(&settings.adapter)?, &settings)?;
        Ok(Self { renderer, form })
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
        frame: usize,
        observations: &SegmentationRun,
        entities: EntityForm,
    ) -> Result<(RgbImage, SceneState), RenderError> {
        let stride = (entities.style == EntityStyle::Points).then_some(entities.stride);
        let seen = observations.observations.get(&frame);
        let find =
            |id: &CameraId| seen?.iter().find(|(of, _)| of == id).map(|(_, observation)| observation.clone());
        let instant = subject.instant(frame + subject.n_frames());
        let state = fuse::assemble(&subject.scene, instant, find, stride);
        let mut plan = plan::make(&state, &view.view, entities.style);
        if self.form.depth_map_side_px.is_none() {
            plan.depth_map_cameras.clear();
        }
        let rendered = self.renderer.render(&state, &view.view, &plan)?;
        Ok((rendered.image, state))
    }

    /// Draws all of the subject's views and judges them.
    ///
    /// # Errors
    /// When a picture cannot be drawn, or the gate ends it.
    pub fn judge(
        &mut self,
        subject: &Subject,
        observations: &SegmentationRun,
        entities: EntityForm,
        watch: &Stopwatch<'_>,
    ) -> Result<ViewsRun, SweepError> {
        let mut run = ViewsRun::default();
        let nothing = EntityForm { style: EntityStyle::None, stride: 1 };
        for (view_idx, view) in subject.views.iter().enumerate() {
            // Once untimed: pipelines and targets are made at the first picture.
            if let Some((frame, _)) = view.frames.first() {
                watch.enter()?;
                drop(self.draw(subject, view, *frame, observations, entities)?);
            }
            let (width, height) = (u64::from(view.view.width_px), u64::from(view.view.height_px));
            let samples = u64::from(self.form.samples);
            // Colour and depth, 4 bytes each, by sample; and the resolved picture, if there is more than one.
            run.target_bytes = width * height * (8 * samples + if samples > 1 { 4 } else { 0 });
            let mut pictures = Vec::new();
            for (frame, judged) in &view.frames {
                let draw = || self.draw(subject, view, *frame, observations, entities);
                let (drawn, time_ms) = watch.again(draw)?;
                let (picture, state) = drawn?;
                run.times_ms.push(time_ms);
                run.entity_bytes.add(entity_bytes(&state, entities.style) as f64);
                let (bare, _) = self.draw(subject, view, *frame, observations, nothing)?;
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

fn entity_bytes(state: &SceneState, style: EntityStyle) -> usize {
    match style {
        EntityStyle::Points => state.points.len() * size_of::<EntityPoint>(),
        EntityStyle::Billboards => {
            state.entities.iter().map(|entity| entity.sources.len() * size_of::<Billboard>()).sum()
        }
        EntityStyle::None => 0,
    }
}

impl ViewsRun {
    fn judge(
        &mut self,
        view: &SubjectView,
        judged: &crate::simulate::JudgedView,
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
        let shown = silhouette(picture, bare);
        self.silhouettes.add(&shown, &truth.instance, |value| value > 0, |value| value > 0);
        add_seam_energy(&mut self.seams, picture, &truth.rgb, &view.owners, &judged.still);
        Ok(())
    }

    fn judge_pair(&mut self, pictures: [&RgbImage; 2], truths: &[(usize, crate::simulate::JudgedView)]) {
        let [(first_frame, first), (second_frame, second)] = truths else { return };
        if first_frame == second_frame {
            return;
        }
        let both = first.still.data.iter().zip(&second.still.data).map(|(a, b)| *a & *b).collect();
        let part = Mask { width: first.still.width, height: first.still.height, data: both };
        add_flicker(&mut self.flicker, pictures, [&first.truth.rgb, &second.truth.rgb], &part);
    }

    /// Of one picture.
    ///
    /// # Errors
    /// Without any picture.
    pub fn time_ms(&self) -> Result<Spread, SweepError> {
        Spread::of(&self.times_ms).ok_or(SweepError::Untimed)
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
            ("seam_energy", self.seams.value()),
            ("flicker", self.flicker.value()),
            ("balanced_rmse", self.balanced_rmse()),
        ])
    }
}
