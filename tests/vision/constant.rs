//! A camera whose picture never changes, for as long as ten million frames: a fortnight at eight a second.

use videofields_vision::background::{Format, GaussianMixture};
use videofields_vision::config::{BackgroundSettings, SegmentSettings};
use videofields_vision::frame::{ColorMatrix, ColorRange, YuvImage};
use videofields_vision::segment::{MOVING, Segmenter};

const N_FRAMES: u32 = 10_000_000;
const SIDE_PX: u32 = 2;

fn picture(luma: u8) -> YuvImage {
    YuvImage::filled(SIDE_PX, SIDE_PX, [luma, 120, 131], ColorMatrix::Bt601, ColorRange::Limited)
}

#[test]
fn constant_pixels_for_ten_million_frames_leave_thresholds_and_models_what_they_were() {
    let place = picture(140);
    let mut mixture = GaussianMixture::new(&BackgroundSettings::default(), Format::of(&place));
    let mut segmenter = Segmenter::new(&SegmentSettings { min_area_px: 1, ..SegmentSettings::default() });
    for frame in 0..N_FRAMES {
        mixture.update(&place, 0.125).unwrap();
        // Masks cost more than learning: verdicts are asked for now and then.
        if frame % 16 == 0 {
            let planes = mixture.background_planes();
            let found = segmenter.segment(&place, planes, mixture.unmatched(), 2.0);
            assert!(found.blobs.is_empty(), "frame {frame}: {:?}", found.blobs);
        }
    }
    let planes = mixture.background_planes().map(|plane| plane.row(0)[0]);
    assert_eq!(planes, [140, 120, 131]);
    for state in segmenter.stages() {
        assert!(state.measured.is_none_or(|measured| measured.abs() < 1e-6), "{state:?}");
    }
    // Luma that differs is found at once; by less than the threshold it is not.
    let mut is_found = |luma: u8| {
        mixture.classify(&picture(luma)).unwrap();
        let planes = mixture.background_planes();
        let found = segmenter.segment(&picture(luma), planes, mixture.unmatched(), 0.125);
        found.labels.data.iter().all(|label| *label == MOVING)
    };
    assert!(is_found(180) && is_found(100) && !is_found(150));
}
