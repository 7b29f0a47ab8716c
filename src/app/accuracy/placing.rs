//! The stage `placing`: people found at every frame of a period, held against where they truly stand.
//!
//! All efforts look at the same masks, in turns at each frame, so that what else the machine does falls on all alike. The unit of work
//! that is timed is one instant of all cameras.

use super::SweepError;
use super::gate::Stopwatch;
use super::settings::SegmentationForm;
use super::subject::{Subject, SubjectFigure};
use glam::DVec2;
use std::collections::BTreeMap;
use videofields_picture::fuse::Placing;
use videofields_picture::occupancy::Effort;
use videofields_picture::plan::Spread;
use videofields_recording::ingest::Pipeline;
use videofields_vision::frame::CameraId;
use videofields_vision::measures::distance_figures;
use videofields_vision::observation::Observation;
use videofields_vision::track::{Pair, assign};

/// Distance on the ground up to which somebody is found, metres.
const GATE_M: f64 = 0.5;

/// Pixels with which one camera at least must show somebody who is to be found.
const LEAST_PX: usize = 40;

/// Cost of finding nobody, metres: above the sum of two distances, so that as many are found as can be.
const ALONE_M: f64 = 4.0 * GATE_M;

/// Figures of people found with one effort.
#[derive(Debug, Default)]
pub struct PlacingRun {
    n_true: usize,
    n_missed: usize,
    n_false: usize,
    distances_m: Vec<f64>,
    times_ms: Vec<f64>,
    memory_bytes: u64,
}

impl PlacingRun {
    /// Plays the cameras of `subject`, segmented as `form` says, and finds people with each of `efforts`.
    ///
    /// # Errors
    /// When the gate ends it.
    pub fn all(
        subject: &Subject,
        form: &SegmentationForm,
        efforts: &[Effort],
        watch: &Stopwatch<'_>,
    ) -> Result<Vec<Self>, SweepError> {
        let pipeline = |camera| subject.pipeline(camera, &form.applied(&camera.settings));
        let mut pipelines: Vec<Pipeline> = subject.cameras.iter().map(pipeline).collect();
        let mut runs: Vec<(Placing, Self)> =
            efforts.iter().map(|effort| (Placing::with_effort(*effort), Self::default())).collect();
        let n_learned = subject.n_frames();
        for number in 0..2 * n_learned {
            watch.enter()?;
            let cameras = subject.cameras.iter().zip(&mut pipelines);
            let seen: Vec<Observation> =
                cameras.map(|(camera, pipeline)| pipeline.process(subject.frame(camera, number))).collect();
            let Some(frame) = number.checked_sub(n_learned) else { continue };
            let figures = figures_at(subject, frame);
            for (placing, run) in &mut runs {
                let find = |id: &CameraId| seen.iter().find(|of| of.frame.camera == *id).cloned();
                let (state, time_ms) =
                    watch.once(|| placing.assemble(&subject.scene, subject.instant(number), find))?;
                // The first instant finds the cells of the scene.
                run.times_ms.extend(time_ms.filter(|_| frame > 0));
                let places = state.entities.iter().map(|entity| entity.foot_in_world.truncate());
                run.judge(&figures, &places.collect::<Vec<_>>());
                run.memory_bytes = placing.memory_bytes() as u64;
            }
        }
        Ok(runs.into_iter().map(|(_, run)| run).collect())
    }

    /// Returns the time of one instant; none if none was timed.
    #[must_use]
    pub fn time_ms(&self) -> Option<Spread> {
        Spread::of(&self.times_ms)
    }

    /// Returns the bytes that are kept of the scene and of masks.
    #[must_use]
    pub const fn memory_bytes(&self) -> u64 {
        self.memory_bytes
    }

    /// Returns what is reported: the main error, missed and false people as a share of those who are there (none where nobody is), and
    /// every measure by name.
    #[must_use]
    pub fn measures(&self) -> (Option<f64>, BTreeMap<String, f64>) {
        let share = |count: usize| (self.n_true > 0).then(|| count as f64 / self.n_true as f64);
        let distances = distance_figures(self.distances_m.clone());
        let named = [
            ("missed_share", share(self.n_missed)),
            ("false_share", share(self.n_false)),
            ("mean_m", distances.map(|[mean, ..]| mean)),
            ("p95_m", distances.map(|[_, most, _]| most)),
        ];
        (share(self.n_missed + self.n_false), super::named(named))
    }

    /// Counts who is found at an instant. Who is found where somebody is whom no camera shows, or where a vehicle is, is not false.
    fn judge(&mut self, figures: &[(SubjectFigure, bool)], found: &[DVec2]) {
        let counts = |(figure, is_shown): &&(SubjectFigure, bool)| figure.is_on_foot && *is_shown;
        let counted: Vec<SubjectFigure> = figures.iter().filter(counts).map(|(of, _)| *of).collect();
        let others: Vec<SubjectFigure> = figures.iter().filter(|of| !counts(of)).map(|(of, _)| *of).collect();
        let matches = matched(&counted, found);
        self.n_true += counted.len();
        self.n_missed += matches.iter().filter(|of| of.is_none()).count();
        let mut is_met = vec![false; found.len()];
        for (figure, of) in counted.iter().zip(&matches).filter_map(|(figure, of)| Some((figure, (*of)?))) {
            self.distances_m.push(figure.distance_m(found[of]));
            is_met[of] = true;
        }
        let rest = found.iter().zip(is_met).filter(|(_, is_met)| !is_met).map(|(place, _)| *place);
        let rest: Vec<DVec2> = rest.collect();
        self.n_false += rest.len() - matched(&others, &rest).into_iter().flatten().count();
    }
}

/// Returns the place of whom each figure is found as, if it is: as many as can be, by the least sum of distances.
fn matched(figures: &[SubjectFigure], found: &[DVec2]) -> Vec<Option<usize>> {
    let pairs = figures.iter().enumerate().flat_map(|(target, figure)| {
        found.iter().enumerate().filter_map(move |(blob, place)| {
            let cost = figure.distance_m(*place);
            (cost <= GATE_M).then_some(Pair { target, blob, cost })
        })
    });
    assign(&pairs.collect::<Vec<_>>(), figures.len(), found.len(), ALONE_M)
}

/// Returns everything that moves at a frame of the period, each with whether a camera shows enough of it.
fn figures_at(subject: &Subject, frame: usize) -> Vec<(SubjectFigure, bool)> {
    let mut is_shown = [false; 256];
    for camera in &subject.cameras {
        let mut counts = [0_usize; 256];
        camera.instances[frame].data.iter().for_each(|value| counts[usize::from(*value)] += 1);
        is_shown.iter_mut().zip(counts).for_each(|(is_shown, count)| *is_shown |= count >= LEAST_PX);
    }
    subject.figures[frame].iter().map(|of| (*of, is_shown[usize::from(of.instance)])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn person(instance: u8, x: f64) -> SubjectFigure {
        let place = DVec2::new(x, 0.0);
        SubjectFigure { instance, ground_m: [place; 2], is_on_foot: true }
    }

    #[test]
    fn people_are_missed_and_false_once_each() {
        let car = SubjectFigure {
            instance: 4,
            ground_m: [DVec2::new(9.0, -1.0), DVec2::new(13.0, 1.0)],
            is_on_foot: false,
        };
        let figures = [(person(1, 0.0), true), (person(2, 0.6), true), (person(3, 5.0), false), (car, true)];
        let mut run = PlacingRun::default();
        // One is near both, one near the second alone: both are found. One is hidden, one a car; nobody is at 20 m.
        let found = [0.3, 0.9, 5.1, 11.0, 20.0].map(|x| DVec2::new(x, 0.0));
        run.judge(&figures, &found);
        let (error, measures) = run.measures();
        assert_eq!(error, Some(0.5));
        assert_eq!([measures["missed_share"], measures["false_share"]], [0.0, 0.5]);
        assert!((measures["mean_m"] - 0.3).abs() < 1e-9);
        // Farther off than the gate is nobody; the same car twice is one too many.
        let mut run = PlacingRun::default();
        run.judge(&figures, &[0.6 + 0.51, 10.0, 12.0].map(|x| DVec2::new(x, 0.0)));
        let (error, measures) = run.measures();
        assert_eq!(error, Some(2.0));
        assert_eq!([measures["missed_share"], measures["false_share"]], [1.0, 1.0]);
        assert!(!measures.contains_key("mean_m"));
        assert!(PlacingRun::default().measures().0.is_none());
    }
}
