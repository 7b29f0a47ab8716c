//! The timeline room seen from outside: one camera's thread pushes while others look.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use videofields_recording::timeline::{Timeline, TimelineError};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, Mask, YuvImage};
use videofields_vision::observation::Observation;

fn observation(camera: &CameraId, number: u64, background: &Arc<YuvImage>) -> Observation {
    let code = [(number % 251) as u8, 128, 128];
    let image = Arc::new(YuvImage::filled(32, 24, code, ColorMatrix::Bt601, ColorRange::Full));
    let timestamp = Timestamp::from_nanos(number as i64 * 10);
    Observation {
        frame: Frame { camera: camera.clone(), timestamp, number, image },
        soft_mask: Arc::new(Mask::filled(32, 24, code[0])),
        labels: Arc::new(Mask::filled(32, 24, 0)),
        background: Arc::clone(background),
        blobs: Arc::from([]),
        tracks: Arc::from([]),
    }
}

#[test]
fn lookers_always_see_whole_observations_of_the_time_they_asked_for() {
    const MAX_BYTES: usize = 40_000;
    let camera = CameraId::new("yard").expect("an id");
    let (timeline, is_done) = (Timeline::new(MAX_BYTES), AtomicBool::new(false));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                let mut asked = 0;
                while !is_done.load(Ordering::Acquire) {
                    asked = (asked + 7_919) % 20_100;
                    look(&timeline, asked);
                    assert!(timeline.len_bytes() <= MAX_BYTES);
                }
            });
        }
        let background =
            Arc::new(YuvImage::filled(32, 24, [0, 128, 128], ColorMatrix::Bt601, ColorRange::Full));
        for number in 0..2_000 {
            timeline.push(observation(&camera, number, &background)).expect("time grows");
        }
        is_done.store(true, Ordering::Release);
    });
    assert_eq!(*timeline.subscribe().borrow(), 2_000);
    assert_eq!(timeline.latest().expect("frames were pushed").frame.number, 1_999);
}

fn look(timeline: &Timeline, asked: i64) {
    let range = timeline.range();
    match timeline.at(Timestamp::from_nanos(asked)) {
        Ok(seen) => {
            // Of what was kept before and after the look, half a frame's distance is the furthest.
            let kept =
                range.zip(timeline.range()).map(|((_, last), (first, _))| first.as_nanos()..=last.as_nanos());
            if kept.is_some_and(|kept| kept.contains(&asked)) {
                assert!((seen.frame.timestamp.as_nanos() - asked).abs() <= 5, "{asked}");
            }
            let code = (seen.frame.number % 251) as u8;
            assert_eq!((seen.frame.image.plane(0).row(23)[31], seen.soft_mask.get(31, 23)), (code, code));
        }
        Err(TimelineError::Empty) => assert_eq!(range, None),
        Err(error) => panic!("{error}"),
    }
}
