//! How much moves before a camera, gathered minute by minute of scene time and written when a minute is over.

use tokio::runtime::Handle as Runtime;
use videofields_recording::store::{ActivityRecord, Store};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;
use videofields_vision::observation::Observation;

const MINUTE_NANOS: i64 = 60_000_000_000;

/// Gathers what moves before one camera.
pub(super) struct Activity {
    camera: CameraId,
    store: Store,
    runtime: Runtime,
    gathered: Gathered,
}

/// The minute at hand, and those that are over and not written yet.
#[derive(Debug, Default)]
struct Gathered {
    current: Option<ActivityRecord>,
    over: Vec<ActivityRecord>,
    /// Id of the newest thing that came; later ones are greater.
    newest_track: Option<u64>,
}

/// Minutes that wait for a database that fails; older ones are lost.
const MAX_WAITING: usize = 60;

impl Activity {
    pub(super) fn new(camera: CameraId, store: Store, runtime: Runtime) -> Self {
        Self { camera, store, runtime, gathered: Gathered::default() }
    }

    /// Takes what was seen in one frame.
    pub(super) fn observe(&mut self, seen: &Observation) {
        self.gathered.observe(seen);
    }

    /// Writes the minutes that are over. Blocks for a short write once a minute.
    pub(super) fn write(&mut self) {
        while let Some(record) = self.gathered.over.first() {
            if let Err(error) = self.runtime.block_on(self.store.add_activity(&self.camera, record)) {
                tracing::warn!(camera = %self.camera, %error, "activity not written");
                return;
            }
            self.gathered.over.remove(0);
        }
    }

    /// Writes all there is: no frame will follow.
    pub(super) fn write_finally(&mut self) {
        self.gathered.end_minute();
        self.write();
    }
}

impl Gathered {
    fn observe(&mut self, seen: &Observation) {
        let nanos = seen.frame.timestamp.as_nanos();
        let at = Timestamp::from_nanos(nanos - nanos.rem_euclid(MINUTE_NANOS));
        if self.current.is_some_and(|current| current.at != at) {
            self.end_minute();
        }
        let none = ActivityRecord { at, n_frames: 0, moving_sum: 0.0, max_tracks: 0, new_tracks: 0 };
        let current = self.current.get_or_insert(none);
        let n_pixels = f64::from(seen.frame.image.width()) * f64::from(seen.frame.image.height());
        let moving: u64 = seen.blobs.iter().map(|blob| u64::from(blob.area_px)).sum();
        current.n_frames += 1;
        current.moving_sum += moving as f64 / n_pixels.max(1.0);
        current.max_tracks = current.max_tracks.max(seen.tracks.len() as u32);
        let newest = seen.tracks.last().map(|track| track.id);
        let is_new = |id: &u64| self.newest_track.is_none_or(|newest| *id > newest);
        current.new_tracks += seen.tracks.iter().filter(|track| is_new(&track.id)).count() as u32;
        self.newest_track = newest.max(self.newest_track);
    }

    fn end_minute(&mut self) {
        self.over.extend(self.current.take());
        if self.over.len() > MAX_WAITING {
            self.over.remove(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use videofields_vision::frame::{ColorMatrix, ColorRange, Frame, Mask, YuvImage};

    fn seen(secs: i64) -> Observation {
        let image = Arc::new(YuvImage::filled(8, 4, [9, 128, 128], ColorMatrix::Bt601, ColorRange::Full));
        let camera = CameraId::new("gate").unwrap();
        let timestamp = Timestamp::from_nanos(secs * 1_000_000_000);
        let mask = || Arc::new(Mask::filled(8, 4, 0));
        Observation {
            background: Arc::clone(&image),
            frame: Frame { camera, timestamp, number: 0, image },
            soft_mask: mask(),
            labels: mask(),
            blobs: Arc::from([]),
            tracks: Arc::from([]),
        }
    }

    #[test]
    fn frames_are_gathered_by_the_minute_of_their_scene_time() {
        let mut gathered = Gathered::default();
        for secs in [-61, -1, 0, 1, 59, 60, 200] {
            gathered.observe(&seen(secs));
        }
        gathered.end_minute();
        let minutes: Vec<_> = gathered
            .over
            .iter()
            .map(|record| (record.at.as_nanos() / MINUTE_NANOS, record.n_frames))
            .collect();
        assert_eq!(minutes, [(-2, 1), (-1, 1), (0, 3), (1, 1), (3, 1)]);
        for minute in 10..200 {
            gathered.observe(&seen(60 * minute));
        }
        assert_eq!(gathered.over.len(), MAX_WAITING, "a database that is gone costs no memory");
    }
}
