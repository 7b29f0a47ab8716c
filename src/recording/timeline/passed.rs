//! Pictures of the past that were decoded on the way to others: who drags a time bar or plays backwards asks for those next.
//!
//! Bounded in bytes over all cameras; each camera has an equal part of them, and of those the newest decoded stay.

use super::replay::PastFrame;
use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// A picture and when the next one was seen.
#[derive(Clone, Debug)]
pub(super) struct Passed {
    pub(super) frame: PastFrame,
    pub(super) next_at: Timestamp,
}

/// The pictures of all cameras.
#[derive(Debug)]
pub(super) struct PassedPictures {
    by_camera: BTreeMap<CameraId, Pictures>,
    max_bytes: usize,
}

#[derive(Debug, Default)]
struct Pictures {
    kept: VecDeque<Passed>,
    n_bytes: usize,
    used: Duration,
}

impl PassedPictures {
    /// None yet, and never more than `max_bytes` of them.
    pub(super) fn new(max_bytes: usize) -> Self {
        Self { by_camera: BTreeMap::new(), max_bytes }
    }

    /// The frame nearest to `at`, if it lies between two that are known to follow each other.
    pub(super) fn find(&mut self, camera: &CameraId, at: Timestamp, now: Duration) -> Option<PastFrame> {
        let pictures = self.by_camera.get_mut(camera)?;
        let before = pictures.kept.iter().find(|of| of.frame.timestamp <= at && at < of.next_at)?;
        let (since, until) = (at.nanos_since(before.frame.timestamp), before.next_at.nanos_since(at));
        let nearest = if since <= until {
            &before.frame
        } else {
            let is_next = |of: &&Passed| of.frame.timestamp == before.next_at;
            &pictures.kept.iter().find(is_next)?.frame
        };
        pictures.used = now;
        Some(nearest.clone())
    }

    /// Pictures of `n_bytes` each that a camera may keep.
    pub(super) fn room(&self, camera: &CameraId, n_bytes: usize) -> usize {
        let n_cameras = self.by_camera.len() + usize::from(!self.by_camera.contains_key(camera));
        self.max_bytes / n_cameras / n_bytes.max(1)
    }

    /// Keeps what was passed, in the order of time.
    pub(super) fn add(&mut self, camera: &CameraId, passed: impl Iterator<Item = Passed>, now: Duration) {
        let pictures = self.by_camera.entry(camera.clone()).or_default();
        pictures.used = now;
        for of in passed {
            if pictures.kept.iter().any(|kept| kept.frame.timestamp == of.frame.timestamp) {
                continue;
            }
            pictures.n_bytes += of.frame.image.len_bytes();
            pictures.kept.push_back(of);
        }
        let part = self.max_bytes / self.by_camera.len();
        for pictures in self.by_camera.values_mut() {
            pictures.shrink(part);
        }
    }

    /// Lets go of the pictures of cameras that nobody has asked for since the monotonic clock said `until`.
    pub(super) fn tidy(&mut self, until: Duration) {
        self.by_camera.retain(|_camera, pictures| pictures.used >= until);
    }
}

impl Pictures {
    fn shrink(&mut self, max_bytes: usize) {
        while self.n_bytes > max_bytes {
            let Some(gone) = self.kept.pop_front() else { break };
            self.n_bytes -= gone.frame.image.len_bytes();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use videofields_vision::frame::{ColorMatrix, ColorRange, YuvImage};

    fn passed(secs: i64) -> Passed {
        let image = YuvImage::filled(4, 2, [secs as u8, 128, 128], ColorMatrix::Bt601, ColorRange::Full);
        let at = |secs: i64| Timestamp::from_nanos(secs * 1_000_000_000);
        Passed { frame: PastFrame { image: Arc::new(image), timestamp: at(secs) }, next_at: at(secs + 1) }
    }

    #[test]
    fn the_nearest_of_two_that_follow_each_other_is_found() {
        let (camera, other) = (CameraId::new("a").unwrap(), CameraId::new("b").unwrap());
        let mut pictures = PassedPictures::new(1 << 20);
        pictures.add(&camera, [5, 6, 9].into_iter().map(passed), Duration::ZERO);
        let mut found = |camera: &CameraId, ms: i64| {
            let at = Timestamp::from_nanos(ms * 1_000_000);
            let found = pictures.find(camera, at, Duration::ZERO);
            found.map(|frame| frame.timestamp.as_nanos() / 1_000_000_000)
        };
        assert_eq!(found(&camera, 5_000), Some(5));
        assert_eq!(found(&camera, 5_400), Some(5));
        assert_eq!(found(&camera, 5_600), Some(6));
        assert_eq!(found(&camera, 6_600), None, "the one at 7 is not here");
        assert_eq!(found(&camera, 8_900), None, "what comes before 9 is not known");
        assert_eq!(found(&camera, 10_000), None);
        assert_eq!(found(&other, 5_000), None);
    }

    #[test]
    fn bytes_are_bounded_and_shared_by_cameras_and_what_is_not_used_goes() {
        let n_bytes = passed(0).frame.image.len_bytes();
        let cameras = ["a", "b"].map(|id| CameraId::new(id).unwrap());
        let mut pictures = PassedPictures::new(10 * n_bytes);
        assert_eq!(pictures.room(&cameras[0], n_bytes), 10);
        pictures.add(&cameras[0], (0..30).map(passed), Duration::from_secs(1));
        let count = |pictures: &PassedPictures, of: usize| {
            pictures.by_camera.get(&cameras[of]).map_or(0, |pictures| pictures.kept.len())
        };
        assert_eq!(count(&pictures, 0), 10);
        assert_eq!(pictures.room(&cameras[1], n_bytes), 5);
        pictures.add(&cameras[1], (0..30).map(passed), Duration::from_secs(5));
        assert_eq!((count(&pictures, 0), count(&pictures, 1)), (5, 5));
        pictures.add(&cameras[1], (20..30).map(passed), Duration::from_secs(5));
        assert_eq!(count(&pictures, 1), 5, "none is kept twice");
        pictures.tidy(Duration::from_secs(2));
        assert_eq!((count(&pictures, 0), count(&pictures, 1)), (0, 5));
    }
}
