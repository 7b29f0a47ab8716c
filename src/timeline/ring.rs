//! The ring: the newest observations of one camera, as many as fit its bytes.
//!
//! One thread pushes, any number look. The lock is held for a search and a clone of a few counters; pixels are
//! freed outside it. Knows nothing of other cameras, nor of the machine's time.

use super::Observation;
use crate::clock::Timestamp;
use crate::error::ErrorKind;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::watch;

/// A time at which a camera saw nothing, or an observation that does not follow the newest.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TimelineError {
    /// Nothing was seen yet.
    #[error("no frame yet")]
    Empty,
    /// The time lies before what is kept.
    #[error("no frame is kept from {at}: what is kept reaches from {first} to {last}")]
    BeforeFirst {
        /// The time asked for.
        at: Timestamp,
        /// The oldest observation's time.
        first: Timestamp,
        /// The newest observation's time.
        last: Timestamp,
    },
    /// An observation that is no newer than the newest.
    #[error("a frame of {pushed} cannot follow one of {last}: time must grow")]
    NotNewer {
        /// The refused observation's time.
        pushed: Timestamp,
        /// The newest observation's time.
        last: Timestamp,
    },
}

impl TimelineError {
    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Empty => ErrorKind::Unavailable,
            Self::BeforeFirst { .. } => ErrorKind::NotFound,
            Self::NotNewer { .. } => ErrorKind::Internal,
        }
    }
}

/// The newest observations of one camera, in growing order of time, bounded in bytes.
///
/// Bytes count once however many observations share them, as they share backgrounds. The newest observation stays
/// even if it alone passes the bound: a camera always has its present.
#[derive(Debug)]
pub struct Timeline {
    ring: Mutex<Ring>,
    version: watch::Sender<u64>,
    max_bytes: usize,
}

#[derive(Debug, Default)]
struct Ring {
    observations: VecDeque<Observation>,
    /// Shared things by their address: how many observations hold each, and its bytes.
    holdings: HashMap<usize, (usize, usize)>,
    n_bytes: usize,
}

impl Timeline {
    /// A timeline that keeps at most `max_bytes` of pictures and masks.
    #[must_use]
    pub fn new(max_bytes: usize) -> Self {
        Self { ring: Mutex::default(), version: watch::Sender::new(0), max_bytes }
    }

    /// Adds the newest observation and lets the oldest go until the rest fits.
    ///
    /// An observation that is no newer than the newest is refused, not sorted in: whoever looked already has been
    /// told what was there at that time, and time that steps back is a fault of the source, which should show.
    ///
    /// # Errors
    /// When `observation` is no newer than the newest.
    pub fn push(&self, observation: Observation) -> Result<(), TimelineError> {
        let pushed = observation.frame.timestamp;
        let mut ring = self.lock();
        if let Some((_, last)) = ring.range()
            && pushed <= last
        {
            return Err(TimelineError::NotNewer { pushed, last });
        }
        ring.add(observation);
        let gone = ring.shrink(self.max_bytes);
        drop(ring);
        drop(gone);
        self.version.send_modify(|version| *version += 1);
        Ok(())
    }

    /// The newest observation.
    ///
    /// # Errors
    /// When there is none yet.
    pub fn latest(&self) -> Result<Observation, TimelineError> {
        self.lock().observations.back().cloned().ok_or(TimelineError::Empty)
    }

    /// The newest observation at or before `at`; the newest of all when `at` is later.
    ///
    /// # Errors
    /// When there is none yet, or `at` lies before the oldest that is kept.
    pub fn at(&self, at: Timestamp) -> Result<Observation, TimelineError> {
        let ring = self.lock();
        let Some((first, last)) = ring.range() else { return Err(TimelineError::Empty) };
        let n_not_later = ring.observations.partition_point(|seen| seen.frame.timestamp <= at);
        let found = n_not_later.checked_sub(1).and_then(|index| ring.observations.get(index));
        found.cloned().ok_or(TimelineError::BeforeFirst { at, first, last })
    }

    /// Times of the oldest and the newest observation, if there are any.
    #[must_use]
    pub fn range(&self) -> Option<(Timestamp, Timestamp)> {
        self.lock().range()
    }

    /// Observations kept.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lock().observations.len()
    }

    /// Whether nothing was seen yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes of pictures and masks kept, shared ones counted once.
    #[must_use]
    pub fn len_bytes(&self) -> usize {
        self.lock().n_bytes
    }

    /// Follows the number of observations pushed so far, which changes with each.
    #[must_use]
    pub fn subscribe(&self) -> watch::Receiver<u64> {
        self.version.subscribe()
    }

    fn lock(&self) -> MutexGuard<'_, Ring> {
        // Nothing panics between two changes that belong together, so a poisoned ring is whole.
        self.ring.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Ring {
    fn range(&self) -> Option<(Timestamp, Timestamp)> {
        let (first, last) = (self.observations.front()?, self.observations.back()?);
        Some((first.frame.timestamp, last.frame.timestamp))
    }

    fn add(&mut self, observation: Observation) {
        for (address, n_bytes) in holdings(&observation) {
            let (n_holders, _) = self.holdings.entry(address).or_insert((0, n_bytes));
            *n_holders += 1;
            if *n_holders == 1 {
                self.n_bytes += n_bytes;
            }
        }
        self.observations.push_back(observation);
    }

    /// Takes the oldest out until the rest fits or one is left; the caller frees them without the lock.
    fn shrink(&mut self, max_bytes: usize) -> Vec<Observation> {
        let mut gone = Vec::new();
        while self.n_bytes > max_bytes && self.observations.len() > 1 {
            let Some(oldest) = self.observations.pop_front() else { break };
            for (address, n_bytes) in holdings(&oldest) {
                let Some((n_holders, _)) = self.holdings.get_mut(&address) else { continue };
                *n_holders -= 1;
                if *n_holders == 0 {
                    self.holdings.remove(&address);
                    self.n_bytes -= n_bytes;
                }
            }
            gone.push(oldest);
        }
        gone
    }
}

/// Everything large that an observation holds: its address, which nothing else has while it is held, and its bytes.
fn holdings(observation: &Observation) -> [(usize, usize); 6] {
    let Observation { frame, soft_mask, labels, background, blobs, tracks } = observation;
    [
        (Arc::as_ptr(&frame.image).addr(), frame.image.len_bytes()),
        (Arc::as_ptr(soft_mask).addr(), soft_mask.data.len()),
        (Arc::as_ptr(labels).addr(), labels.data.len()),
        (Arc::as_ptr(background).addr(), background.len_bytes()),
        (blobs.as_ptr().addr(), size_of_val::<[_]>(blobs)),
        (tracks.as_ptr().addr(), size_of_val::<[_]>(tracks)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{CameraId, ColorMatrix, ColorRange, Frame, Mask, YuvImage};
    use proptest::prelude::*;

    const SIDE: u32 = 4;
    /// A picture of 4 x 4 luma and 2 x 2 x 2 chroma, and two masks.
    const OWN_BYTES: usize = 24 + 16 + 16;
    const SHARED_BYTES: usize = 24;

    fn picture() -> Arc<YuvImage> {
        Arc::new(YuvImage::filled(SIDE, SIDE, [1, 2, 3], ColorMatrix::Bt601, ColorRange::Full))
    }

    fn observation(nanos: i64, background: &Arc<YuvImage>) -> Observation {
        let frame = Frame {
            camera: CameraId::new("a").unwrap(),
            timestamp: Timestamp::from_nanos(nanos),
            number: 0,
            image: picture(),
        };
        let mask = || Arc::new(Mask::filled(SIDE, SIDE, 0));
        Observation {
            frame,
            soft_mask: mask(),
            labels: mask(),
            background: Arc::clone(background),
            blobs: Arc::from([]),
            tracks: Arc::from([]),
        }
    }

    #[test]
    fn what_is_kept_is_found_and_what_is_not_is_told() {
        let timeline = Timeline::new(usize::MAX);
        let at =
            |nanos| timeline.at(Timestamp::from_nanos(nanos)).map(|seen| seen.frame.timestamp.as_nanos());
        assert_eq!(at(0), Err(TimelineError::Empty));
        assert_eq!(timeline.latest().unwrap_err().kind(), ErrorKind::Unavailable);
        assert_eq!(timeline.range(), None);
        let background = picture();
        for nanos in [100, 200, 300] {
            timeline.push(observation(nanos, &background)).unwrap();
        }
        for (asked, found) in [(100, 100), (199, 100), (200, 200), (300, 300), (i64::MAX, 300)] {
            assert_eq!(at(asked), Ok(found), "{asked}");
        }
        for asked in [99, 0, i64::MIN] {
            let error = timeline.at(Timestamp::from_nanos(asked)).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::NotFound);
            assert!(error.to_string().contains("1970-01-01T00:00:00.0000003Z"), "{error}");
        }
    }

    #[test]
    fn time_that_does_not_grow_is_refused_and_changes_nothing() {
        let timeline = Timeline::new(usize::MAX);
        let background = picture();
        timeline.push(observation(5, &background)).unwrap();
        let n_bytes = timeline.len_bytes();
        for nanos in [5, 4, i64::MIN] {
            let error = timeline.push(observation(nanos, &background)).unwrap_err();
            assert!(matches!(error, TimelineError::NotNewer { .. }), "{error}");
        }
        assert_eq!((timeline.len(), timeline.len_bytes()), (1, n_bytes));
    }

    #[test]
    fn a_shared_background_counts_once_and_as_long_as_one_holds_it() {
        let timeline = Timeline::new(SHARED_BYTES + 3 * OWN_BYTES);
        let (old, new) = (picture(), picture());
        for nanos in 0..3 {
            timeline.push(observation(nanos, &old)).unwrap();
        }
        assert_eq!((timeline.len(), timeline.len_bytes()), (3, SHARED_BYTES + 3 * OWN_BYTES));
        timeline.push(observation(3, &new)).unwrap();
        assert_eq!((timeline.len(), timeline.len_bytes()), (2, 2 * SHARED_BYTES + 2 * OWN_BYTES));
        for nanos in 4..6 {
            timeline.push(observation(nanos, &new)).unwrap();
        }
        assert_eq!((timeline.len(), timeline.len_bytes()), (3, SHARED_BYTES + 3 * OWN_BYTES));
        assert_eq!(Arc::strong_count(&old), 1, "what left the ring is free");
    }

    #[test]
    fn the_present_stays_even_where_nothing_fits() {
        let timeline = Timeline::new(0);
        for nanos in 0..3 {
            timeline.push(observation(nanos, &picture())).unwrap();
            assert_eq!(timeline.latest().unwrap().frame.timestamp.as_nanos(), nanos);
            assert_eq!(timeline.len(), 1);
        }
    }

    #[test]
    fn watchers_notice_every_push() {
        let timeline = Timeline::new(usize::MAX);
        let mut watcher = timeline.subscribe();
        assert!(!watcher.has_changed().unwrap());
        timeline.push(observation(1, &picture())).unwrap();
        assert!(watcher.has_changed().unwrap());
        assert_eq!(*watcher.borrow_and_update(), 1);
        timeline.push(observation(1, &picture())).unwrap_err();
        assert!(!watcher.has_changed().unwrap());
    }

    proptest! {
        #[test]
        fn the_ring_keeps_its_promises(
            steps in prop::collection::vec((-2_i64..9, any::<bool>()), 1..60),
            n_fit in 0_usize..9,
            asked in -5_i64..300,
        ) {
            let max_bytes = n_fit * OWN_BYTES + SHARED_BYTES;
            let timeline = Timeline::new(max_bytes);
            let (mut background, mut nanos, mut pushed) = (picture(), 0, Vec::new());
            for (step, is_new_background) in steps {
                if is_new_background {
                    background = picture();
                }
                nanos += step;
                let is_newer = pushed.last().is_none_or(|last| nanos > *last);
                prop_assert_eq!(timeline.push(observation(nanos, &background)).is_ok(), is_newer);
                if is_newer {
                    pushed.push(nanos);
                } else {
                    nanos = *pushed.last().unwrap();
                }
                prop_assert!(timeline.len_bytes() <= max_bytes || timeline.len() == 1);
                prop_assert_eq!(timeline.latest().unwrap().frame.timestamp.as_nanos(), nanos);
            }
            let kept = &pushed[pushed.len() - timeline.len()..];
            let range = timeline.range().map(|(first, last)| (first.as_nanos(), last.as_nanos()));
            prop_assert_eq!(range, Some((kept[0], *kept.last().unwrap())));
            let naive = kept.iter().rev().find(|time| **time <= asked).copied();
            let found = timeline.at(Timestamp::from_nanos(asked)).ok().map(|seen| seen.frame.timestamp.as_nanos());
            prop_assert_eq!(found, naive);
        }
    }
}
