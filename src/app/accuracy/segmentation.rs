//! The stage `segmentation`: background and foreground of every frame, judged pixel by pixel against instance masks.
//!
//! A period is played to learn and played again to judge, as a looped clip would be. The unit of work that is timed is
//! one frame of one camera: reduction, background and segmentation together.

use super::SweepError;
use super::gate::{Stopped, Stopwatch};
use super::settings::SegmentationForm;
use super::subject::{Subject, SubjectCamera};
use std::collections::BTreeMap;
use videofields_picture::plan::Spread;
use videofields_recording::ingest::Pipeline;
use videofields_vision::frame::CameraId;
use videofields_vision::measures::MaskScore;
use videofields_vision::observation::Observation;
use videofields_vision::segment::MOVING;

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
        let (mut runs, outcome) = Self::all(subject, &[*form], watch)?;
        outcome?;
        runs.pop().ok_or(SweepError::Untimed)
    }

    /// Plays every camera of `subject` with every form, the forms in turns at each frame, so that what else the machine
    /// does falls on all alike. What the gate ends early is told as far as it went, once every form was timed some
    /// times; whether it did end it stands beside the runs.
    ///
    /// # Errors
    /// When the gate ends it before.
    pub fn all(
        subject: &Subject,
        forms: &[SegmentationForm],
        watch: &Stopwatch<'_>,
    ) -> Result<(Vec<Self>, Result<(), Stopped>), SweepError> {
        let judged = subject.judged_frames();
        let mut gathered: Vec<Gathered> = forms.iter().map(|_| Gathered::new(&judged)).collect();
        let mut cameras = subject.cameras.iter();
        let outcome = cameras.try_for_each(|camera| play(subject, camera, forms, watch, &mut gathered));
        if gathered.iter().any(|of| of.times_ms.len() < LEAST_TIMES) {
            outcome?;
        }
        let runs: Result<Vec<Self>, _> = gathered.into_iter().map(Gathered::into_run).collect();
        Ok((runs?, outcome))
    }

    /// What a camera saw at a frame at which views are judged.
    #[must_use]
    pub fn of_frame(&self, frame: usize, camera: &CameraId) -> Option<&Observation> {
        let seen = self.observations.get(&frame)?;
        seen.iter().find(|(of, _)| of == camera).map(|(_, observation)| observation)
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

/// Times of a form that are enough to be told.
const LEAST_TIMES: usize = 4;

/// What is known of a form while it is played.
struct Gathered {
    score: MaskScore,
    times_ms: Vec<f64>,
    model_bytes: u64,
    n_cameras: u64,
    observations: BTreeMap<usize, Vec<(CameraId, Observation)>>,
}

impl Gathered {
    fn new(judged: &[usize]) -> Self {
        Self {
            score: MaskScore::default(),
            times_ms: Vec::new(),
            model_bytes: 0,
            n_cameras: 0,
            observations: judged.iter().map(|frame| (*frame, Vec::new())).collect(),
        }
    }

    fn judge(
        &mut self,
        camera: &SubjectCamera,
        number: usize,
        observation: Observation,
        time_ms: Option<f64>,
    ) {
        let truth = &camera.instances[number];
        self.score.add(&observation.labels, truth, |label| label == MOVING, |truth| truth > 0);
        self.times_ms.extend(time_ms);
        if let Some(kept) = self.observations.get_mut(&number) {
            kept.push((camera.id.clone(), observation));
        }
    }

    fn into_run(self) -> Result<SegmentationRun, SweepError> {
        Ok(SegmentationRun {
            score: self.score,
            time_ms: Spread::of(&self.times_ms).ok_or(SweepError::Untimed)?,
            memory_bytes: self.model_bytes / self.n_cameras.max(1),
            observations: self.observations,
        })
    }
}

/// Plays a camera twice with every form in turns; what the second time shows is judged.
fn play(
    subject: &Subject,
    camera: &SubjectCamera,
    forms: &[SegmentationForm],
    watch: &Stopwatch<'_>,
    gathered: &mut [Gathered],
) -> Result<(), Stopped> {
    let pipeline = |form: &SegmentationForm| subject.pipeline(camera, &form.applied(&camera.settings));
    let mut pipelines: Vec<Pipeline> = forms.iter().map(pipeline).collect();
    let n_frames = camera.frames.len();
    for number in 0..2 * n_frames {
        for (pipeline, gathered) in pipelines.iter_mut().zip(gathered.iter_mut()) {
            let frame = subject.frame(camera, number);
            let (observation, time_ms) = watch.once(|| pipeline.process(frame))?;
            if number == n_frames {
                gathered.model_bytes += pipeline.model_bytes() as u64;
                gathered.n_cameras += 1;
            }
            if number >= n_frames {
                gathered.judge(camera, number - n_frames, observation, time_ms);
            }
        }
    }
    Ok(())
}
