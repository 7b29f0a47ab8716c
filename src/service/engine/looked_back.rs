//! Keeps what was looked back at for a picture until that picture is drawn.
//!
//! One thread draws for everybody. Whoever asks for a picture of the past reads and decodes beforehand, on another thread; the render
//! thread then finds these observations here.

use super::EngineError;
use super::handle::At;
use super::shared::{CameraEntry, Shared};
use super::view::ViewRequest;
use std::sync::{Arc, Mutex};
use videofields_recording::timeline::{Horizon, ReplayError};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;
use videofields_vision::lock::lock;
use videofields_vision::observation::Observation;

/// Observations of one picture's instant, which stay in memory until this is dropped.
#[derive(Debug, Default)]
pub struct LookedBack {
    memory: Arc<LookedBackMemory>,
    picture: u64,
}

/// A camera's observation, with true where it is known what moved; or the reason why there is none.
pub(super) type Looked = Result<(Observation, bool), ReplayError>;

/// Observations that pictures wait for. Holds no more than callers do: each keeps those of one instant.
#[derive(Debug, Default)]
pub(super) struct LookedBackMemory(Mutex<Board>);

#[derive(Debug, Default)]
struct Board {
    n_pictures: u64,
    entries: Vec<Entry>,
}

#[derive(Debug)]
struct Entry {
    picture: u64,
    camera: CameraId,
    at: Timestamp,
    /// Number of the camera's privacy zones under which it was seen.
    zones: u64,
    looked: Looked,
}

impl LookedBackMemory {
    /// Returns a guard for the observations of one picture.
    pub(super) fn begin(self: &Arc<Self>) -> LookedBack {
        let mut board = lock(&self.0);
        board.n_pictures += 1;
        LookedBack { memory: Arc::clone(self), picture: board.n_pictures }
    }

    /// Returns what `camera` saw nearest to `at`, if somebody keeps that and the camera's zones are still those of that number.
    pub(super) fn find(&self, camera: &CameraId, at: Timestamp, zones: u64) -> Option<Looked> {
        let board = lock(&self.0);
        let is_it = |entry: &&Entry| entry.at == at && entry.zones == zones && entry.camera == *camera;
        board.entries.iter().find(is_it).and_then(|entry| copy_of(&entry.looked))
    }
}

/// Returns a copy; none of a failure of the archive, which is tried once more.
fn copy_of(looked: &Looked) -> Option<Looked> {
    match looked {
        Ok(seen) => Some(Ok(seen.clone())),
        Err(ReplayError::Gap { at, before, after }) => {
            Some(Err(ReplayError::Gap { at: *at, before: *before, after: *after }))
        }
        Err(ReplayError::Undecoded { path, reason }) => {
            Some(Err(ReplayError::Undecoded { path: path.clone(), reason: reason.clone() }))
        }
        Err(ReplayError::Archive(_)) => None,
    }
}

impl LookedBack {
    /// Keeps what `camera` saw nearest to `at` under the zones of that number.
    pub(super) fn keep(&self, camera: CameraId, at: Timestamp, (zones, looked): (u64, Looked)) {
        lock(&self.memory.0).entries.push(Entry { picture: self.picture, camera, at, zones, looked });
    }
}

impl Drop for LookedBack {
    fn drop(&mut self) {
        lock(&self.memory.0).entries.retain(|entry| entry.picture != self.picture);
    }
}

impl Shared {
    /// Returns the cameras of which a picture needs what has to be read and decoded.
    pub(super) fn looked_back_at(&self, request: &ViewRequest) -> Vec<CameraId> {
        let At::Time(instant) = request.at else { return Vec::new() };
        let Ok(scene) = self.scene_within(&request.scene, &request.scope).map(|scene| self.members(&scene))
        else {
            return Vec::new();
        };
        let asks = |entry: &&Arc<CameraEntry>| asks_recording(entry, instant, request.horizon.as_ref());
        let is_recorded = self.past.as_ref().is_some_and(|past| past.archive().is_some());
        scene.iter().filter(|_| is_recorded).filter(asks).map(|entry| entry.id.clone()).collect()
    }

    /// Reads and decodes what a picture needs. See [`super::Door::look_back`].
    pub(super) fn look_back_for(&self, request: &ViewRequest) -> Result<LookedBack, EngineError> {
        self.scene_within(&request.scene, &request.scope)?;
        let cameras = self.looked_back_at(request);
        match (&self.past, request.at) {
            (Some(past), At::Time(instant)) => Ok(past.look_back(&cameras, instant)),
            _ => Ok(LookedBack::default()),
        }
    }
}

/// Tells that what a camera saw of `instant` is asked of its recording, as [`Shared::observation_within`] does.
fn asks_recording(of: &CameraEntry, instant: Timestamp, horizon: Option<&Horizon>) -> bool {
    let Some(horizon) = horizon else {
        // Before the oldest that memory holds may lie one that is nearer.
        let is_oldest =
            |seen: Observation| seen.frame.timestamp > instant && of.timeline.last_before(instant).is_none();
        return of.timeline.at(instant).map_or(true, is_oldest);
    };
    let newest = horizon.of(&of.id);
    let is_kept = newest.is_some_and(|newest| of.timeline.at_within(instant, newest).is_ok());
    !is_kept && newest.is_none_or(|newest| instant <= newest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::frame::{ColorMatrix, ColorRange, Frame, Mask, YuvImage};

    fn observation_of(camera: &CameraId, at: Timestamp) -> Looked {
        let image = Arc::new(YuvImage::filled(4, 2, [9, 128, 128], ColorMatrix::Bt601, ColorRange::Limited));
        let mask = Arc::new(Mask::filled(4, 2, 0));
        let observation = Observation {
            frame: Frame { camera: camera.clone(), timestamp: at, number: 0, image: Arc::clone(&image) },
            soft_mask: Arc::clone(&mask),
            labels: mask,
            background: image,
            blobs: Arc::from([]),
            tracks: Arc::from([]),
        };
        Ok((observation, true))
    }

    #[test]
    fn what_a_picture_waits_for_is_found_until_it_is_drawn_and_under_the_same_zones_alone() {
        let memory = Arc::new(LookedBackMemory::default());
        let [west, east] = ["west", "east"].map(|id| CameraId::new(id).expect("an id"));
        let [early, late] = [1, 2].map(Timestamp::from_nanos);
        let (first, second) = (memory.begin(), memory.begin());
        first.keep(west.clone(), early, (3, observation_of(&west, early)));
        second.keep(west.clone(), early, (3, observation_of(&west, early)));
        second.keep(east.clone(), late, (0, observation_of(&east, late)));
        assert!(memory.find(&west, early, 3).is_some());
        assert!(memory.find(&west, early, 4).is_none(), "under other zones it is another picture");
        first.keep(
            east.clone(),
            early,
            (3, Err(ReplayError::Gap { at: early, before: None, after: Some(late) })),
        );
        let gap = memory.find(&east, early, 3).expect("that there is nothing is known too");
        assert!(
            matches!(gap, Err(ReplayError::Gap { before: None, after: Some(after), .. }) if after == late)
        );
        assert!(memory.find(&west, late, 3).is_none() && memory.find(&east, early, 0).is_none());
        drop(second);
        assert!(memory.find(&east, late, 0).is_none());
        assert!(memory.find(&west, early, 3).is_some(), "another picture waits for it");
        drop(first);
        assert!(lock(&memory.0).entries.is_empty());
    }
}
