//! The ring: the newest observations of one camera, as many as fit its bytes.
//!
//! One thread pushes, any number look. The lock is held for a search and a clone of a few counters; pixels are
//! freed outside it. Knows nothing of other cameras, nor of the machine's time.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::watch;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::ErrorKind;
use videofields_vision::observation::Observation;

/// How far from its time an observation counts at least, nanoseconds.
pub const REACH_NANOS: i64 = 1_000_000_000;

/// A time at which a camera saw nothing, or an observation that does not follow the newest.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TimelineError {
    /// Nothing was seen yet.
    #[error("no frame yet")]
    Empty,
    /// The time lies in no frame's reach.
    #[error("nothing was seen at {at}: {}", edges(*before, *after))]
    Gap {
        /// The time asked for.
        at: Timestamp,
        /// Time of the newest frame before it, if one is kept.
        before: Option<Timestamp>,
        /// Time of the oldest frame after it, if there is one.
        after: Option<Timestamp>,
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

/// Where a gap begins and ends, in words.
pub fn edges(before: Option<Timestamp>, after: Option<Timestamp>) -> String {
    match (before, after) {
        (Some(before), Some(after)) => format!("there is a gap from {before} to {after}"),
        (None, Some(after)) => format!("the first frame kept is of {after}"),
        (Some(before), None) => format!("the last frame is of {before}"),
        (None, None) => "there is no frame".to_owned(),
    }
}

impl TimelineError {
    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Empty => ErrorKind::Unavailable,
            Self::Gap { .. } => ErrorKind::NotFound,
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

    /// Lets go of all there is.
    pub fn clear(&self) {
        let gone = std::mem::take(&mut *self.lock());
        drop(gone);
    }

    /// Puts what `change` makes of each observation in its place, one after the other; those that come meanwhile are left as
    /// they are. Whoever holds one from before keeps it.
    pub fn replace_each(&self, mut change: impl FnMut(&Observation) -> Observation) {
        let mut next = i64::MIN;
        loop {
            let asked = self.lock().from(Timestamp::from_nanos(next)).cloned();
            let Some(before) = asked else { break };
            let at = before.frame.timestamp;
            let after = change(&before);
            let gone = self.lock().replace(&before, after);
            drop(gone);
            let Some(following) = at.as_nanos().checked_add(1) else { break };
            next = following;
        }
        self.version.send_modify(|version| *version += 1);
    }

    /// The newest observation.
    ///
    /// # Errors
    /// When there is none yet.
    pub fn latest(&self) -> Result<Observation, TimelineError> {
        self.lock().observations.back().cloned().ok_or(TimelineError::Empty)
    }

    /// The observation nearest to `at`, of two as near the earlier; one that is further away than a second and
    /// than twice the distance to the observation beside it shows another time, and is no answer.
    ///
    /// # Errors
    /// When there is none yet, or none within reach.
    pub fn at(&self, at: Timestamp) -> Result<Observation, TimelineError> {
        self.at_within(at, Timestamp::from_nanos(i64::MAX))
    }

    /// As [`Timeline::at`], as if nothing had come after `newest`: the answer stays the same whatever comes.
    ///
    /// # Errors
    /// As [`Timeline::at`].
    pub fn at_within(&self, at: Timestamp, newest: Timestamp) -> Result<Observation, TimelineError> {
        let ring = self.lock();
        let n_known = ring.observations.partition_point(|seen| seen.frame.timestamp <= newest);
        let (before, after) = ring.around(at, n_known)?;
        let away = |seen: &Observation| seen.frame.timestamp.nanos_since(at).saturating_abs();
        let nearest = [before, after].into_iter().flatten().min_by_key(|idx| away(&ring.observations[*idx]));
        if let Some(idx) = nearest
            && away(&ring.observations[idx]) <= ring.reach_nanos(idx, n_known)
        {
            return Ok(ring.observations[idx].clone());
        }
        let time = |idx: Option<usize>| idx.map(|idx| ring.observations[idx].frame.timestamp);
        Err(TimelineError::Gap { at, before: time(before), after: time(after) })
    }

    /// The newest observation at or before `at`, however old: what was known at that time.
    ///
    /// # Errors
    /// When there is none.
    pub fn at_or_before(&self, at: Timestamp) -> Result<Observation, TimelineError> {
        let ring = self.lock();
        let (before, after) = ring.around(at, ring.observations.len())?;
        let found = before.map(|idx| ring.observations[idx].clone());
        let after = after.map(|idx| ring.observations[idx].frame.timestamp);
        found.ok_or(TimelineError::Gap { at, before: None, after })
    }

    /// Time of the oldest observation after `at`.
    #[must_use]
    pub fn next_after(&self, at: Timestamp) -> Option<Timestamp> {
        let ring = self.lock();
        let n_not_later = ring.observations.partition_point(|seen| seen.frame.timestamp <= at);
        ring.observations.get(n_not_later).map(|seen| seen.frame.timestamp)
    }

    /// Time of the newest observation before `at`.
    #[must_use]
    pub fn last_before(&self, at: Timestamp) -> Option<Timestamp> {
        let ring = self.lock();
        let n_earlier = ring.observations.partition_point(|seen| seen.frame.timestamp < at);
        ring.observations.get(n_earlier.checked_sub(1)?).map(|seen| seen.frame.timestamp)
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
    /// Places of the newest observation at or before `at` and of the oldest after it, among the first `n_known`.
    fn around(&self, at: Timestamp, n_known: usize) -> Result<(Option<usize>, Option<usize>), TimelineError> {
        if n_known == 0 {
            return Err(TimelineError::Empty);
        }
        let n_not_later = self.observations.partition_point(|seen| seen.frame.timestamp <= at).min(n_known);
        let after = (n_not_later < n_known).then_some(n_not_later);
        Ok((n_not_later.checked_sub(1), after))
    }

    /// How far from an observation a time may lie and still be shown by it, nanoseconds, if the first `n_known` are all.
    fn reach_nanos(&self, idx: usize, n_known: usize) -> i64 {
        let time = |idx: usize| {
            self.observations.get(idx).filter(|_| idx < n_known).map(|seen| seen.frame.timestamp)
        };
        let (before, own, after) = (idx.checked_sub(1).and_then(time), time(idx), time(idx + 1));
        let distances = [(before, own), (own, after)];
        let distances = distances.into_iter().filter_map(|(from, to)| Some(to?.nanos_since(from?)));
        distances.min().map_or(REACH_NANOS, |distance| REACH_NANOS.max(distance.saturating_mul(2)))
    }

    fn range(&self) -> Option<(Timestamp, Timestamp)> {
        let (first, last) = (self.observations.front()?, self.observations.back()?);
        Some((first.frame.timestamp, last.frame.timestamp))
    }

    fn add(&mut self, observation: Observation) {
        self.count_in(&observation);
        self.observations.push_back(observation);
    }

    /// The oldest observation at or after an instant.
    fn from(&self, at: Timestamp) -> Option<&Observation> {
        self.observations.get(self.observations.partition_point(|seen| seen.frame.timestamp < at))
    }

    /// Puts `after` in the place of `before`, if that is still there; the caller frees what is answered without the lock.
    fn replace(&mut self, before: &Observation, after: Observation) -> Option<Observation> {
        let at = before.frame.timestamp;
        let idx = self.observations.partition_point(|seen| seen.frame.timestamp < at);
        let is_there = self
            .observations
            .get(idx)
            .is_some_and(|seen| Arc::ptr_eq(&seen.frame.image, &before.frame.image));
        if !is_there {
            return Some(after);
        }
        self.count_in(&after);
        let gone = std::mem::replace(&mut self.observations[idx], after);
        self.count_out(&gone);
        Some(gone)
    }

    fn count_in(&mut self, observation: &Observation) {
        for (address, n_bytes) in holdings(observation) {
            let (n_holders, _) = self.holdings.entry(address).or_insert((0, n_bytes));
            *n_holders += 1;
            if *n_holders == 1 {
                self.n_bytes += n_bytes;
            }
        }
    }

    fn count_out(&mut self, observation: &Observation) {
        for (address, n_bytes) in holdings(observation) {
            let Some((n_holders, _)) = self.holdings.get_mut(&address) else { continue };
            *n_holders -= 1;
            if *n_holders == 0 {
                self.holdings.remove(&address);
                self.n_bytes -= n_bytes;
            }
        }
    }

    /// Takes the oldest out until the rest fits or one is left; the caller frees them without the lock.
    fn shrink(&mut self, max_bytes: usize) -> Vec<Observation> {
        let mut gone = Vec::new();
        while self.n_bytes > max_bytes && self.observations.len() > 1 {
            let Some(oldest) = self.observations.pop_front() else { break };
            self.count_out(&oldest);
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
    use proptest::prelude::*;
    use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, Mask, YuvImage};

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
        const SECOND: i64 = 1_000_000_000;
        for nanos in [100, 200, 300] {
            timeline.push(observation(nanos, &background)).unwrap();
        }
        for nanos in [10, 11, 15] {
            timeline.push(observation(nanos * SECOND, &background)).unwrap();
        }
        let near = [(100 - SECOND, 100), (99, 100), (149, 100), (150, 100), (151, 200), (SECOND, 300)];
        for (asked, found) in near {
            assert_eq!(at(asked), Ok(found), "{asked}");
        }
        let far = [(9, 10), (11, 11), (13, 11), (14, 15), (23, 15)];
        for (asked, found) in far {
            assert_eq!(at(asked * SECOND), Ok(found * SECOND), "{asked} s");
        }
        let seconds = |nanos: i64| Some(Timestamp::from_nanos(nanos * SECOND));
        let gap = |asked: i64| match timeline.at(Timestamp::from_nanos(asked)).unwrap_err() {
            TimelineError::Gap { before, after, .. } => (before, after),
            other => panic!("{other}"),
        };
        assert_eq!(gap(5 * SECOND), (Some(Timestamp::from_nanos(300)), seconds(10)));
        assert_eq!(gap(-SECOND - 100), (None, Some(Timestamp::from_nanos(100))));
        assert_eq!(gap(i64::MIN), (None, Some(Timestamp::from_nanos(100))));
        assert_eq!(gap(24 * SECOND), (seconds(15), None));
        assert_eq!(gap(i64::MAX), (seconds(15), None));
        let error = timeline.at(Timestamp::from_nanos(5 * SECOND)).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::NotFound);
        assert!(
            error.to_string().contains("from 1970-01-01T00:00:00.0000003Z to 1970-01-01T00:00:10Z"),
            "{error}"
        );
        let known =
            |asked: i64| timeline.at_or_before(Timestamp::from_nanos(asked)).map(|seen| seen.frame.timestamp);
        assert_eq!(known(5 * SECOND), Ok(Timestamp::from_nanos(300)));
        assert_eq!(known(i64::MAX).ok(), seconds(15));
        assert!(matches!(known(99), Err(TimelineError::Gap { before: None, .. })));
        let beside = |nanos: i64| {
            let at = Timestamp::from_nanos(nanos);
            let nanos = |time: Option<Timestamp>| time.map(Timestamp::as_nanos);
            (nanos(timeline.last_before(at)), nanos(timeline.next_after(at)))
        };
        assert_eq!(beside(200), (Some(100), Some(300)));
        assert_eq!(beside(201), (Some(200), Some(300)));
        assert_eq!((beside(100).0, beside(15 * SECOND).1), (None, None));
    }

    #[test]
    fn what_was_known_at_a_moment_stays_whatever_comes() {
        const SECOND: i64 = 1_000_000_000;
        let (timeline, background) = (Timeline::new(usize::MAX), picture());
        // Slow at first: then a frame counts for long.
        for secs in [0, 10, 20] {
            timeline.push(observation(secs * SECOND, &background)).unwrap();
        }
        let newest = Timestamp::from_nanos(20 * SECOND);
        let asked: Vec<i64> = (0..50).map(|secs| secs * SECOND).collect();
        let found = |timeline: &Timeline| {
            let within = |nanos: &i64| timeline.at_within(Timestamp::from_nanos(*nanos), newest);
            asked.iter().map(|at| within(at).map(|seen| seen.frame.timestamp)).collect::<Vec<_>>()
        };
        let before = found(&timeline);
        assert_eq!(before[39], Ok(newest));
        assert!(before[41].is_err());
        for tenth in 205..400 {
            timeline.push(observation(tenth * SECOND / 10, &background)).unwrap();
        }
        let now = timeline.at(Timestamp::from_nanos(30 * SECOND)).unwrap().frame.timestamp;
        assert_eq!(now.as_nanos(), 30 * SECOND);
        assert_eq!(found(&timeline), before);
        let nothing = timeline.at_within(newest, Timestamp::from_nanos(-1));
        assert_eq!(nothing.unwrap_err(), TimelineError::Empty);
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
            // All are near: the frames of this test lie within a microsecond.
            let naive = kept.iter().min_by_key(|time| (**time - asked).abs()).copied();
            let found = timeline.at(Timestamp::from_nanos(asked)).ok().map(|seen| seen.frame.timestamp.as_nanos());
            prop_assert_eq!(found, naive);
            let naive = kept.iter().rev().find(|time| **time <= asked).copied();
            let found = timeline.at_or_before(Timestamp::from_nanos(asked)).ok();
            prop_assert_eq!(found.map(|seen| seen.frame.timestamp.as_nanos()), naive);
        }
    }
}
