//! Keeps where a camera saw things stand, thinned out and longer than pictures are kept: for comparing clocks and calibrations.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use videofields_picture::fuse::{FootSighting, foot_sightings};
use videofields_vision::observation::Observation;

/// Sightings of a camera that are kept, the newest: 1.5 MiB, an hour with four people in the picture.
const MAX_SIGHTINGS: usize = 65_536;

/// Least time between two looks: nobody turns a corner in less.
const LEAST_NANOS: i64 = 200_000_000;

/// One thread adds, any number look.
#[derive(Debug, Default)]
pub(super) struct Sightings {
    kept: Mutex<VecDeque<FootSighting>>,
    /// Centimetres by which the camera is told to see people elsewhere than other cameras do; 0 where it is not.
    misaligned_cm: AtomicU32,
}

impl Sightings {
    /// Takes what stands by itself in a picture, its foot within, and moves.
    pub(super) fn observe(&self, seen: &Observation) {
        let at = seen.frame.timestamp;
        let mut kept = self.lock();
        match kept.back().map(|latest| at.nanos_since(latest.at)) {
            Some(passed) if (0..LEAST_NANOS).contains(&passed) => return,
            // Time that was set back belongs to another clock.
            Some(passed) if passed < 0 => kept.clear(),
            _ => {}
        }
        for sighting in foot_sightings(seen) {
            if kept.len() == MAX_SIGHTINGS {
                kept.pop_front();
            }
            kept.push_back(sighting);
        }
    }

    /// Tells by how many metres the camera sees people elsewhere than other cameras do; none where it sees them at the same places.
    pub(super) fn tell_misaligned(&self, offset_m: Option<f64>) {
        let centimetres = offset_m.map_or(0, |offset_m| (offset_m * 100.0).round().max(1.0) as u32);
        self.misaligned_cm.store(centimetres, Ordering::Relaxed);
    }

    /// Returns what was told last by [`Self::tell_misaligned`], to the centimetre.
    pub(super) fn misaligned_m(&self) -> Option<f64> {
        let centimetres = self.misaligned_cm.load(Ordering::Relaxed);
        (centimetres > 0).then(|| f64::from(centimetres) / 100.0)
    }

    /// Lets go of all: what follows is of another clock, or another place.
    pub(super) fn clear(&self) {
        self.lock().clear();
    }

    /// All there is, in the order of time.
    pub(super) fn all(&self) -> Vec<FootSighting> {
        self.lock().iter().copied().collect()
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<FootSighting>> {
        // Each entry is whole by itself.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
