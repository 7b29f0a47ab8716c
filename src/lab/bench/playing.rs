//! A world played before its cameras: one period to learn, and the same again to be judged.

use anyhow::Result;
use videofields::accuracy::{Subject, SubjectCamera};
use videofields_recording::ingest::Pipeline;
use videofields_vision::observation::Observation;

/// Hands `judge` what all cameras observe at each frame of the second period: the frame, its number over both, and the observations.
pub(super) fn play(
    subject: &Subject,
    mut judge: impl FnMut(usize, usize, &[Observation]) -> Result<()>,
) -> Result<()> {
    play_all(subject, 1, |frame, number, seen| match frame {
        Some(frame) => judge(frame, number, seen),
        None => Ok(()),
    })
}

/// Hands `take` what all cameras observe at each frame of `n_learned` periods and one more: the frame of the last, none before, its number
/// over all, and the observations.
pub(super) fn play_all(
    subject: &Subject,
    n_learned: usize,
    mut take: impl FnMut(Option<usize>, usize, &[Observation]) -> Result<()>,
) -> Result<()> {
    let pipeline = |camera: &SubjectCamera| subject.pipeline(camera, &camera.settings);
    let mut pipelines: Vec<Pipeline> = subject.cameras.iter().map(pipeline).collect();
    let n_before = n_learned * subject.n_frames();
    for number in 0..n_before + subject.n_frames() {
        let cameras = subject.cameras.iter().zip(&mut pipelines);
        let seen: Vec<Observation> =
            cameras.map(|(camera, pipeline)| pipeline.process(subject.frame(camera, number))).collect();
        take(number.checked_sub(n_before), number, &seen)?;
    }
    Ok(())
}
