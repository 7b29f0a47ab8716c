//! The stage `segmentation`: background and foreground of every frame, judged pixel by pixel against instance masks.
//!
//! A period is played to learn and played again to judge, as a looped clip would be. The unit of work that is timed is
//! one frame of one camera: reduction, background and segmentation together.

use super::SweepError;
use super::gate::Stopwatch;
use super::measures::MaskScore;
use super::settings::SegmentationForm;
use super::subject::{Subject, SubjectCamera};
use crate::frame::CameraId;
use crate::ingest::Pipeline;
use crate::plan::Spread;
use crate::segment::MOVING;
use crate::timeline::Observation;
use std::collections::BTreeMap;

/// What one form finds.
#[derive(Debug)]
pub struct SegmentationRun {
    /// Over all cameras and judged frames.
    pub score: MaskScore,
    /// Of one frame of one camera.
    pub time_ms: Spread,
    /// Bytes of one camera's model, the mean over the cameras.
    pub memory_bytes: u64,
    /// What every camera saw at the frames at which views are judged, by the frame's index in its period.
    pub observations: BTreeMap<usize, Vec<(CameraId, Observation)>>,
}

impl SegmentationRun {
    /// Plays every camera of `subject` with `form`.
    ///
    /// # Errors
    /// When the gate ends it.
    pub fn of(subject: &Subject, form: &SegmentationForm, watch: &Stopwatch<'_>) -> Result<Self, SweepError> {
        let judged = subject.judged_frames();
        let mut score = MaskScore::default();
        let (mut times_ms, mut bytes) = (Vec::new(), 0);
        let mut observations: BTreeMap<usize, Vec<_>> =
            judged.iter().map(|frame| (*frame, Vec::new())).collect();
        for camera in &subject.cameras {
            bytes += play(subject, camera, form, watch, |number, observation, time_ms| {
                score.add(
                    &observation.labels,
                    &camera.instances[number],
                    |label| label == MOVING,
                    |truth| truth > 0,
                );
                times_ms.extend(time_ms);
                if let Some(kept) = observations.get_mut(&number) {
                    kept.push((camera.id.clone(), observation));
                }
            })?;
        }
        let time_ms = Spread::of(&times_ms).ok_or(SweepError::Untimed)?;
        let memory_bytes = bytes / subject.cameras.len().max(1) as u64;
        Ok(Self { score, time_ms, memory_bytes, observations })
    }

    /// What is reported: the main error, 1 - F, and every measure by name.
    #[must_use]
    pub fn measures(&self) -> (f64, BTreeMap<String, f64>) {
        let f_measure = self.score.f_measure();
        let named = [
            ("f_measure", Some(f_measure)),
            ("precision", self.score.precision()),
            ("recall", self.score.recall()),
        ];
        (1.0 - f_measure, super::named(named))
    }
}

/// Plays a camera twice; hands each observation of the second time on, with its time. Bytes of the model.
fn play(
    subject: &Subject,
    camera: &SubjectCamera,
    form: &SegmentationForm,
    watch: &Stopwatch<'_>,
    mut judge: impl FnMut(usize, Observation, Option<f64>),
) -> Result<u64, SweepError> {
    let settings = form.applied(&camera.settings);
    let mut pipeline = Pipeline::new(&settings.background, &settings.segment);
    let n_frames = camera.frames.len();
    for number in 0..2 * n_frames {
        let frame = subject.frame(camera, number);
        let (observation, time_ms) = watch.once(|| pipeline.process(frame))?;
        if number >= n_frames {
            judge(number - n_frames, observation, time_ms);
        }
    }
    Ok(pipeline.model_bytes() as u64)
}
