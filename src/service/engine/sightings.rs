//! Where a camera saw things stand, thinned out and kept longer than pictures are: for comparing clocks.

use glam::DVec2;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use videofields_vision::clock::Timestamp;
use videofields_vision::observation::Observation;

/// Sightings of a camera that are kept, the newest: 1.5 MiB, an hour with four people in the picture.
const MAX_SIGHTINGS: usize = 65_536;

/// Least time between two looks: nobody turns a corner in less.
const LEAST_NANOS: i64 = 200_000_000;

/// Where a thing stood in a camera's picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    pub(super) at: Timestamp,
    pub(super) track: u32,
    /// From (0, 0) at the top left corner to (1, 1).
    pub(super) foot_in_texture: [f32; 2],
}

/// One thread adds, any number look.
#[derive(Debug, Default)]
pub(super) struct Sightings(Mutex<VecDeque<Seen>>);

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
        let size = DVec2::new(seen.frame.image.width().into(), seen.frame.image.height().into());
        let alone = seen
            .tracks
            .iter()
            .filter(|track| track.blob_idx.is_some() && !track.is_in_group && track.still_since.is_none());
        for track in alone {
            let foot = DVec2::from_array(track.foot_in_image) / size;
            if foot.cmpge(DVec2::ZERO).all() && foot.cmplt(DVec2::ONE).all() {
                if kept.len() == MAX_SIGHTINGS {
                    kept.pop_front();
                }
                let foot_in_texture = foot.as_vec2().to_array();
                kept.push_back(Seen { at, track: track.id as u32, foot_in_texture });
            }
        }
    }

    /// Lets go of all: what follows is of another clock, or another place.
    pub(super) fn clear(&self) {
        self.lock().clear();
    }

    /// All there is, in the order of time.
    pub(super) fn all(&self) -> Vec<Seen> {
        self.lock().iter().copied().collect()
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<Seen>> {
        // Each entry is whole by itself.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
