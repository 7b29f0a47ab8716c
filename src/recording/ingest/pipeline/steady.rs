//! Measures how far a camera's picture is shifted, and brings what was found in one that was shifted back to where the picture itself
//! shows it.

use super::Model;
use std::sync::Arc;
use videofields_vision::config::StageChoice;
use videofields_vision::frame::{BufferPool, YuvImage};
use videofields_vision::segment::{Blob, PixelRect, Segmentation};
use videofields_vision::shake::{Shift, shift_of, shifted_back};
use videofields_vision::track::Track;

/// A background that learned fewer frames than this is no measure of how far a camera shakes.
const LEAST_LEARNED_FRAMES: u64 = 50;

impl Model {
    /// Measures by how much a picture is to be shifted back. What zones hide stays where it is in the picture, so with zones nothing is
    /// shifted.
    pub(super) fn shift(&mut self, image: &YuvImage, dt_secs: f64, choice: StageChoice) -> Shift {
        if self.hidden.is_some() {
            return Shift::default();
        }
        let frame = image.plane(0);
        let is_new = self.mixture.n_frames() < LEAST_LEARNED_FRAMES;
        let place = if is_new { frame } else { self.mixture.background_planes()[0] };
        self.shake.observe(frame, place, dt_secs, choice)
    }

    /// As [`Self::shift`], of a picture alone: whatever was seen before it.
    pub(super) fn shift_alone(&self, image: &YuvImage, choice: StageChoice) -> Shift {
        if self.hidden.is_some() || self.mixture.n_frames() == 0 || choice == StageChoice::Off {
            return Shift::default();
        }
        shift_of(image.plane(0), self.mixture.background_planes()[0])
    }
}

/// Shifts masks, blobs and tracks of a full picture by `shift`.
pub(super) fn shift_back(
    found: &mut Segmentation,
    tracks: &mut [Track],
    shift: Shift,
    pool: &Arc<BufferPool>,
) {
    if shift.is_none() {
        return;
    }
    let size_px = (found.labels.width, found.labels.height);
    for mask in [&mut found.soft_mask, &mut found.labels] {
        *mask = shifted_back(mask, shift, pool);
    }
    for blob in &mut found.blobs {
        shift_blob(blob, shift, size_px);
    }
    for track in tracks {
        track.rect = shifted(track.rect, shift, size_px);
        track.foot_in_image = moved(track.foot_in_image, shift);
    }
}

fn moved([x, y]: [f64; 2], shift: Shift) -> [f64; 2] {
    [x + f64::from(shift.x), y + f64::from(shift.y)]
}

/// Returns a rectangle that was shifted, cut by the picture's borders; at least a pixel is left.
fn shifted(rect: PixelRect, shift: Shift, (width, height): (u32, u32)) -> PixelRect {
    let side = |first: u32, length: u32, shift: i32, whole: u32| {
        let (first, whole) = (i64::from(first) + i64::from(shift), i64::from(whole));
        let end = (first + i64::from(length)).clamp(1, whole);
        let first = first.clamp(0, end - 1);
        (first as u32, (end - first) as u32)
    };
    let (x, width) = side(rect.x, rect.width, shift.x, width);
    let (y, height) = side(rect.y, rect.height, shift.y, height);
    PixelRect { x, y, width, height }
}

fn shift_blob(blob: &mut Blob, shift: Shift, size_px: (u32, u32)) {
    blob.rect = shifted(blob.rect, shift, size_px);
    blob.foot_in_image = moved(blob.foot_in_image, shift);
    let rect = blob.rect;
    blob.is_truncated |= rect.x == 0 || rect.x + rect.width == size_px.0 || rect.y + rect.height == size_px.1;
    let corner = |of: u16, shift: i32, whole: u32| {
        (i64::from(of) + i64::from(shift)).clamp(0, i64::from(whole.min(u32::from(u16::MAX)))) as u16
    };
    blob.contour = blob
        .contour
        .iter()
        .map(|[x, y]| [corner(*x, shift.x, size_px.0), corner(*y, shift.y, size_px.1)])
        .collect();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_are_shifted_and_cut_and_never_empty() {
        let rect = PixelRect { x: 10, y: 20, width: 30, height: 40 };
        let sides = |x, y| {
            let PixelRect { x, y, width, height } = shifted(rect, Shift { x, y }, (100, 80));
            (x, y, width, height)
        };
        assert_eq!(sides(5, -6), (15, 14, 30, 40));
        assert_eq!(sides(-15, 30), (0, 50, 25, 30));
        assert_eq!(sides(-60, 100), (0, 79, 1, 1));
        assert_eq!(sides(75, 0), (85, 20, 15, 40));
    }
}
