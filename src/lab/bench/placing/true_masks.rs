//! A world played with true masks in place of segmentation's: what placing makes of the best that could be seen.

use anyhow::Result;
use std::sync::Arc;
use videofields::accuracy::{Subject, SubjectCamera};
use videofields_vision::frame::{BitMask, Mask};
use videofields_vision::observation::Observation;
use videofields_vision::segment::{MOVING, blobs_of};
use videofields_vision::track::Tracker;

/// Hands `take` what all cameras would observe if their masks were true, as
/// [`play_all`](super::super::playing::play_all) does. Blobs are large enough and parted by each camera's settings, and followed as ever.
pub(super) fn play_true(
    subject: &Subject,
    n_learned: usize,
    mut take: impl FnMut(Option<usize>, usize, &[Observation]) -> Result<()>,
) -> Result<()> {
    let mut trackers: Vec<Tracker> =
        subject.cameras.iter().map(|camera| Tracker::new(&camera.settings.track)).collect();
    let n_before = n_learned * subject.n_frames();
    for number in 0..n_before + subject.n_frames() {
        let cameras = subject.cameras.iter().zip(&mut trackers);
        let seen: Vec<Observation> =
            cameras.map(|(camera, tracker)| observation(subject, camera, tracker, number)).collect();
        take(number.checked_sub(n_before), number, &seen)?;
    }
    Ok(())
}

fn observation(
    subject: &Subject,
    camera: &SubjectCamera,
    tracker: &mut Tracker,
    number: usize,
) -> Observation {
    let frame = subject.frame(camera, number);
    let truth = &camera.instances[number % camera.instances.len()];
    let (labels, moving) = moving(truth);
    let blobs = blobs_of(&moving, &camera.settings.segment);
    let tracks = tracker.update(frame.timestamp, (truth.width, truth.height), &blobs);
    let labels = Arc::new(labels);
    Observation {
        background: Arc::clone(&frame.image),
        frame,
        soft_mask: Arc::clone(&labels),
        labels,
        blobs: blobs.into(),
        tracks: tracks.into(),
    }
}

/// Everybody's pixels, as labels and as bits.
fn moving(truth: &Mask) -> (Mask, BitMask) {
    let mut labels = Mask::filled(truth.width, truth.height, 0);
    let mut bits = BitMask::new(truth.width, truth.height);
    let width = truth.width.max(1) as usize;
    for (idx, label) in labels.data.iter_mut().enumerate().filter(|(idx, _)| truth.data[*idx] > 0) {
        *label = MOVING;
        bits.set_run(idx / width, idx % width, idx % width + 1);
    }
    (labels, bits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_it_is_moves() {
        let truth = Mask { width: 3, height: 2, data: vec![0, 7, 0, 2, 0, 0].into() };
        let (labels, bits) = moving(&truth);
        assert_eq!(labels.data.to_vec(), [0, MOVING, 0, MOVING, 0, 0]);
        assert!(bits.get(1, 0) && bits.get(0, 1) && !bits.get(0, 0) && !bits.get(2, 1));
    }
}
