//! The track room seen from outside: real footage through source and pipeline, against truth.

use crate::segment::{frames, n_met, truth_boxes};
use std::collections::BTreeSet;
use videofields_recording::ingest::Pipeline;
use videofields_testing::real_data;
use videofields_vision::config::{BackgroundSettings, SegmentSettings};

/// Blobs alone meet 0.856 of these boxes, and 0.925 of them meet one.
#[test]
fn people_on_a_campus_are_met_by_tracks_better_than_by_blobs() {
    let Some(folder) = real_data("pets2009_s2l1") else { return };
    let truth = truth_boxes(&folder.join("boxes_frames_0_399.xml"));
    let mut pipeline = Pipeline::new(&BackgroundSettings::default(), &SegmentSettings::default());
    let (mut n_boxes, mut n_tracks, mut n_met_in_all, mut ids) = (0, 0, 0, BTreeSet::new());
    for frame in frames(&folder.join("vtest.avi")).take(400) {
        let number = frame.number;
        let observation = pipeline.process(frame);
        if number >= 100 {
            let boxes = truth.get(&number).map_or(&[][..], Vec::as_slice);
            n_met_in_all += n_met(boxes, observation.tracks.iter().map(|track| track.rect));
            n_boxes += boxes.len();
            n_tracks += observation.tracks.len();
            ids.extend(observation.tracks.iter().map(|track| track.id));
        }
    }
    let (of_boxes, of_tracks) = (n_met_in_all as f64 / n_boxes as f64, n_met_in_all as f64 / n_tracks as f64);
    assert!(of_boxes >= 0.94, "{of_boxes:.3} of the boxes met");
    assert!(of_tracks >= 0.9, "{of_tracks:.3} of the tracks meet a box");
    assert!(ids.len() <= 20, "ten people are {} tracks", ids.len());
}
