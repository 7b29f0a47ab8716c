//! Blobs of a mask that others made: what segmentation would follow if it saw no worse than that.

use super::Blob;
use super::segmenter::{Limits, Pieces};
use crate::config::SegmentSettings;
use crate::frame::BitMask;

/// Returns the blobs of `moving`, large enough and parted as segmentation by `settings` has its own.
#[must_use]
pub fn blobs_of(moving: &BitMask, settings: &SegmentSettings) -> Vec<Blob> {
    let limits = Limits::full(settings, (moving.width() as u32, moving.height() as u32));
    let mut pieces = Pieces::default();
    pieces.find(moving);
    pieces.drop_small(&limits, |_run| ());
    pieces.blobs(moving, &limits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::PixelRect;

    #[test]
    fn pieces_of_a_mask_are_blobs_where_they_are_large_enough() {
        let mut moving = BitMask::new(64, 48);
        for y in 10..30 {
            moving.set_run(y, 5, 15);
            moving.set_run(y, 40, 42);
        }
        let settings = SegmentSettings { min_area_px: 100, ..SegmentSettings::default() };
        let blobs = blobs_of(&moving, &settings);
        assert_eq!(blobs.len(), 1, "the second has 40 pixels");
        assert_eq!(blobs[0].rect, PixelRect { x: 5, y: 10, width: 10, height: 20 });
        assert_eq!((blobs[0].area_px, blobs[0].foot_in_image), (200, [10.0, 30.0]));
        assert!(blobs_of(&BitMask::new(64, 48), &settings).is_empty());
    }
}
