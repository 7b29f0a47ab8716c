//! A path that is thinned out while it grows, of whatever places it leads through.
//!
//! A point a second, and one where it moved far, is kept; of what stands still, the first and the last of the time. Once
//! there are too many, every second one goes and the next ones come half as often, so that an hour takes no more than a
//! minute does.

use crate::clock::Timestamp;

/// Most points of a path.
pub const MAX_PATH_POINTS: usize = 512;

/// Unit of time of a path.
const TICK_NANOS: i64 = 100_000_000;

/// Time between two points of what moves slowly, ticks.
const TICKS_BETWEEN: u32 = 10;

/// Most times that the points come half as often.
const MAX_HALVINGS: u32 = 16;

/// A place that paths lead through.
pub trait PathPlace: Clone {
    /// Tells that `before` lies so far away, or is so different, that this place is kept at once. Once points come `spacing` times as
    /// seldom, it must lie that much further away.
    fn is_far_from(&self, before: &Self, spacing: u32) -> bool;

    /// Tells that something that was at `stood` still stands there.
    fn is_still_at(&self, stood: &Self) -> bool;
}

/// A place and when it was reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimedPlace<P> {
    /// Since the path began, units of 0.1 s.
    pub ticks: u32,
    /// The place.
    pub place: P,
}

impl<P> TimedPlace<P> {
    /// Returns when it was reached, on a path of that beginning; within 0.05 s.
    #[must_use]
    pub const fn at(&self, began_at: Timestamp) -> Timestamp {
        began_at.saturating_add_nanos(self.ticks as i64 * TICK_NANOS)
    }
}

/// A path while it grows.
#[derive(Clone, Debug)]
pub struct ThinnedPath<P> {
    began_at: Timestamp,
    ended_at: Timestamp,
    /// Points in growing order of time, the first at 0; fewer than [`MAX_PATH_POINTS`].
    points: Vec<TimedPlace<P>>,
    latest: TimedPlace<P>,
    n_halvings: u32,
}

impl<P: PathPlace> ThinnedPath<P> {
    /// Returns a path that begins at a place.
    pub fn new(at: Timestamp, place: P) -> Self {
        let first = TimedPlace { ticks: 0, place };
        Self { began_at: at, ended_at: at, points: vec![first.clone()], latest: first, n_halvings: 0 }
    }

    /// Takes the next place, and tells that it was taken: one no later than the one before it says nothing.
    pub fn add(&mut self, at: Timestamp, place: P) -> bool {
        if at <= self.ended_at {
            return false;
        }
        let ticks = at.nanos_since(self.began_at).saturating_add(TICK_NANOS / 2) / TICK_NANOS;
        let Ok(ticks) = u32::try_from(ticks) else { return false };
        let point = TimedPlace { ticks, place };
        let before = std::mem::replace(&mut self.latest, point.clone());
        self.ended_at = at;
        let is_kept = self.points.last().is_some_and(|last| last.ticks >= before.ticks);
        if !is_kept && point.place.is_far_from(&before.place, 1 << self.n_halvings) {
            // A line from what was kept to where it leapt would be nowhere near it.
            self.push(before);
        }
        self.keep(point);
        true
    }

    /// Keeps a point if the ones before it do not say it already.
    fn keep(&mut self, point: TimedPlace<P>) {
        let [.., last] = &self.points[..] else { return };
        let passed = point.ticks - last.ticks;
        let spacing = 1 << self.n_halvings;
        let is_far = passed >= spacing && point.place.is_far_from(&last.place, spacing);
        if !is_far && passed < TICKS_BETWEEN << self.n_halvings {
            return;
        }
        // Held against where it began to stand, so that what creeps is not taken for still.
        if let [.., stood, last] = &mut self.points[..]
            && last.place.is_still_at(&stood.place)
            && point.place.is_still_at(&stood.place)
        {
            *last = point;
            return;
        }
        self.push(point);
    }

    fn push(&mut self, point: TimedPlace<P>) {
        self.points.push(point);
        if self.points.len() >= MAX_PATH_POINTS {
            let mut is_kept = false;
            self.points.retain(|_| {
                is_kept = !is_kept;
                is_kept
            });
            self.n_halvings = (self.n_halvings + 1).min(MAX_HALVINGS);
        }
    }

    /// Returns when it began.
    pub const fn began_at(&self) -> Timestamp {
        self.began_at
    }

    /// Returns when the latest place was reached.
    pub const fn ended_at(&self) -> Timestamp {
        self.ended_at
    }

    /// Returns what is kept of it, the latest place last: 1 to [`MAX_PATH_POINTS`] points.
    pub fn points(&self) -> impl Iterator<Item = &TimedPlace<P>> + '_ {
        let last_ticks = self.points.last().map(|last| last.ticks);
        let latest = last_ticks.is_none_or(|ticks| ticks < self.latest.ticks).then_some(&self.latest);
        self.points.iter().chain(latest)
    }
}

/// Appends a number in LEB128: 7 bits a byte, the lowest first.
pub fn push_number(bytes: &mut Vec<u8>, mut number: u32) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// Returns the number that `bytes` begin with, as [`push_number`] wrote it, and what follows it; `None` where it does not end or has
/// more than 32 bits.
#[must_use]
pub fn take_number(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let mut value = 0_u64;
    for (i, byte) in bytes.iter().enumerate().take(5) {
        value |= u64::from(byte & 0x7f) << (7 * i);
        if byte & 0x80 == 0 {
            return Some((u32::try_from(value).ok()?, &bytes[i + 1..]));
        }
    }
    None
}
