//! The background room seen from outside: a restart in the middle of real footage.

use videofields_recording::ingest::{self, MediaRoots, Pipeline};
use videofields_testing::real_data;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{BackgroundSettings, SegmentSettings, SourceSettings, TrackSettings};
use videofields_vision::frame::{CameraId, Frame};

#[test]
fn restart_in_the_middle_of_a_clip_changes_no_mask() {
    let Some(path) = real_data("pets2009_s2l1/vtest.avi") else { return };
    let roots = MediaRoots::of_caller(&path).unwrap();
    let settings = SourceSettings::of_path(path);
    let mut source = ingest::open(&settings, &roots).unwrap();
    let mut frames = std::iter::from_fn(|| source.next_frame().unwrap()).map(|frame| Frame {
        camera: CameraId::new("campus").unwrap(),
        timestamp: Timestamp::from_nanos(frame.stream_nanos),
        number: frame.number,
        image: frame.image,
    });
    // Tracks begin anew after a restart, and with them what is held from learning: without that, nothing differs.
    let track = TrackSettings { absorb_after_secs: 0.0, ..TrackSettings::default() };
    let new =
        || Pipeline::new(&BackgroundSettings::default(), &SegmentSettings::default()).with_track(&track);
    let mut unbroken = new();
    for frame in frames.by_ref().take(150) {
        unbroken.process(frame);
    }
    let checkpoint = unbroken.checkpoint().unwrap();
    assert!(checkpoint.len() < 20 << 20, "{} bytes for 768 x 576", checkpoint.len());
    let mut restarted = new();
    restarted.restore(&checkpoint).unwrap();
    for frame in frames.take(5) {
        let [before, after] = [&mut unbroken, &mut restarted].map(|pipeline| pipeline.process(frame.clone()));
        assert!(before.labels == after.labels, "labels of frame {}", frame.number);
        assert!(before.soft_mask == after.soft_mask, "soft mask of frame {}", frame.number);
        assert!(before.blobs == after.blobs && !before.blobs.is_empty(), "blobs of frame {}", frame.number);
    }
}
