//! What nobody may see of one camera's pictures, before anything else is done with them.
//!
//! Pictures flow in as the camera sent them and out with their zones filled. A model that learned under other zones takes
//! what the next picture shows where either hides something: no mode of what is hidden now is left in it, and where a zone
//! was lifted the place is learned from what is seen.

use std::sync::Arc;
use videofields_vision::frame::{BitMask, BufferPool, YuvImage, Zone, ZoneMask};
use videofields_vision::segment::Blob;

/// Masked pictures whose memory waits for the next: as a new one comes, who keeps frames lets one or two go.
const MAX_SPARE: usize = 3;

/// A camera's zones, and what they cover of its pictures.
#[derive(Debug)]
pub(super) struct Zoned {
    zones: Arc<[Zone]>,
    /// For pictures of the size that came last; none while there are no zones.
    mask: Option<Arc<ZoneMask>>,
    pool: Arc<BufferPool>,
}

impl Zoned {
    pub(super) fn none() -> Self {
        Self { zones: Arc::from([]), mask: None, pool: BufferPool::new(MAX_SPARE) }
    }

    /// Hides other zones from the next picture on; whether they are others.
    pub(super) fn set(&mut self, zones: &Arc<[Zone]>) -> bool {
        if Arc::ptr_eq(&self.zones, zones) || self.zones == *zones {
            return false;
        }
        self.zones = Arc::clone(zones);
        self.mask = None;
        true
    }

    /// What is hidden of pictures of `size_px`; none where nothing is.
    pub(super) fn mask(&mut self, size_px: (u32, u32)) -> Option<Arc<ZoneMask>> {
        if self.zones.is_empty() {
            return None;
        }
        if self.mask.as_ref().is_none_or(|mask| mask.size_px() != size_px) {
            let polygons = self.zones.iter().map(|zone| &zone.polygon[..]);
            self.mask = Some(Arc::new(ZoneMask::of(polygons, size_px)));
        }
        self.mask.clone()
    }

    /// The picture with what is hidden filled; none where nothing is.
    pub(super) fn masked(&mut self, image: &YuvImage) -> Option<YuvImage> {
        let mask = self.mask((image.width(), image.height()))?;
        Some(image.masked_of(&self.pool, &mask))
    }
}

/// The pixels of a model, of pictures that are smaller by `factor`, that it must take anew: those hidden now, and those that
/// were; none where there are none.
pub(super) fn renewed(now: Option<&ZoneMask>, before: Option<&ZoneMask>, factor: u32) -> Option<BitMask> {
    let reduced = |mask: &ZoneMask| mask.reduced(factor);
    match (now.map(reduced), before.map(reduced)) {
        (Some(mut now), Some(before)) if (now.width(), now.height()) == (before.width(), before.height()) => {
            for (own, other) in now.words_mut().iter_mut().zip(before.words()) {
                *own |= other;
            }
            Some(now)
        }
        (Some(now), _) => Some(now),
        (None, before) => before,
    }
}

/// Notes of blobs beside what is hidden that their feet may lie there, as with the picture's border.
pub(super) fn mark_cut(blobs: &mut [Blob], hidden: &ZoneMask) {
    for blob in blobs {
        let rect = blob.rect;
        let left_top = [rect.x.saturating_sub(1), rect.y];
        blob.is_truncated |= hidden.touches(left_top, [rect.width + 2, rect.height + 1]);
    }
}

/// Whether both are the same mask, or both none.
pub(super) fn is_same(one: Option<&Arc<ZoneMask>>, other: Option<&Arc<ZoneMask>>) -> bool {
    match (one, other) {
        (Some(one), Some(other)) => Arc::ptr_eq(one, other) || one == other,
        (None, None) => true,
        _ => false,
    }
}
