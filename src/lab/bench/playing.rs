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
    let pipeline = |camera: &SubjectCamera| subject.pipeline(camera, &camera.settings);
    let mut pipelines: Vec<Pipeline> = subject.cameras.iter().map(pipeline).collect();
    let n_frames = subject.n_frames();
    for number in 0..2 * n_frames {
        let cameras = subject.cameras.iter().zip(&mut pipelines);
        let seen: Vec<Observation> =
            cameras.map(|(camera, pipeline)| pipeline.process(subject.frame(camera, number))).collect();
        if let Some(frame) = number.checked_sub(n_frames) {
            judge(frame, number, &seen)?;
        }
    }
    Ok(())
}
