//! An observation of which more is hidden than when it was made.

use super::Observation;
use crate::frame::{BufferPool, Mask, ZoneMask};
use crate::segment::Blob;
use crate::track::Track;
use std::sync::Arc;

impl Observation {
    /// The same with what `zones` hide filled in its pictures, and nothing moving there. Things of which any part of the
    /// rectangle is hidden are left out whole: where they ended is not to be told. Its memory is of `pool`.
    ///
    /// # Panics
    /// When `zones` are of pictures of another size than the frame's.
    #[must_use]
    pub fn hidden_by(&self, zones: &Arc<ZoneMask>, pool: &Arc<BufferPool>) -> Self {
        let mut frame = self.frame.clone();
        frame.image = Arc::new(frame.image.masked_of(pool, zones));
        // Where nothing was looked for a picture is its own background.
        let background = if Arc::ptr_eq(&self.background, &self.frame.image) {
            Arc::clone(&frame.image)
        } else {
            Arc::new(self.background.masked_of(pool, zones))
        };
        let cleared = |mask: &Mask| {
            let mut mask = mask.clone();
            zones.clear(&mut mask);
            Arc::new(mask)
        };
        let is_seen =
            |rect: &crate::segment::PixelRect| !zones.touches([rect.x, rect.y], [rect.width, rect.height]);
        // Where each blob that is left comes to lie.
        let mut places = Vec::with_capacity(self.blobs.len());
        let mut blobs: Vec<Blob> = Vec::with_capacity(self.blobs.len());
        for blob in &*self.blobs {
            let is_left = is_seen(&blob.rect);
            places.push(is_left.then_some(blobs.len() as u32));
            blobs.extend(is_left.then(|| blob.clone()));
        }
        let left = |track: &Track| {
            let blob_idx = match track.blob_idx {
                Some(idx) => Some((*places.get(idx as usize)?)?),
                None => None,
            };
            is_seen(&track.rect).then(|| Track { blob_idx, ..track.clone() })
        };
        let tracks: Vec<Track> = self.tracks.iter().filter_map(left).collect();
        Self {
            frame,
            soft_mask: cleared(&self.soft_mask),
            labels: cleared(&self.labels),
            background,
            blobs: blobs.into(),
            tracks: tracks.into(),
        }
    }
}
