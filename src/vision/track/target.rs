//! One tracked thing: where it is, how large it is, and how long it lives on unseen.

use super::Track;
use super::extent::Extent;
use super::motion::{Axis, Motion};
use super::sighting::{self, Cut, Place};
use crate::clock::Timestamp;

/// Noise of acceleration, sizes of the thing a second and root second: people start, stop and turn within a step.
const ACCELERATION: f64 = 1.0;

/// Standard deviation of the velocity of what was seen once, sizes of the thing a second.
const FIRST_SPEED: f64 = 2.0;

/// Seconds after which a blob's error is another one.
const SWING_SECS: f64 = 0.1;

/// Seconds in which the size follows what is seen.
const SIZE_TAU_SECS: f64 = 1.0;

/// How many times slower the size follows what differs from it by more than limbs do: most likely something hides a
/// part, or another thing adds to it.
const DOUBT: f64 = 3.0;

/// Ratio of sizes beyond which there is doubt.
const DOUBTFUL_RATIO: f64 = 1.35;

/// How far a still thing's middle wanders, share of its size.
const STILL_SHARE: f64 = 0.15;

/// Seconds that a thing must stay before it counts as still.
const STILL_SECS: f64 = 1.0;

/// A thing that may be a track.
#[derive(Clone, Debug)]
pub(super) struct Target {
    /// Its number; none before it is confirmed.
    pub(super) id: Option<u64>,
    /// Middle, by axis.
    axes: [Axis; 2],
    /// Width and height, pixels, above 0.
    size: [f64; 2],
    /// Seconds over which the size was averaged, by axis; 0 while nothing but cut blobs were seen.
    sized_secs: [f64; 2],
    first_seen: Timestamp,
    last_seen: Timestamp,
    /// Seconds between its first sighting and now.
    pub(super) age_secs: f64,
    /// Seconds since its latest sighting.
    pub(super) missed_secs: f64,
    /// The blob that shows it in the current frame.
    pub(super) blob: Option<usize>,
    pub(super) is_in_group: bool,
    /// Where its middle stood when it last began to be still, since when, and for how many seconds.
    still_at: [f64; 2],
    still_since: Timestamp,
    still_secs: f64,
}

impl Target {
    /// What `seen` shows for the first time.
    pub(super) fn new(seen: &Extent, blob: usize, time: Timestamp) -> Self {
        let size = seen.size().map(|len| len.max(1.0));
        let center = seen.center();
        let variance = sighting::variance_px2(size);
        let speed_variance = (FIRST_SPEED * sighting::scale_px(size)).powi(2);
        Self {
            id: None,
            axes: center.map(|position| Axis::new(position, variance, speed_variance)),
            size,
            sized_secs: [0.0; 2],
            first_seen: time,
            last_seen: time,
            age_secs: 0.0,
            missed_secs: 0.0,
            blob: Some(blob),
            is_in_group: false,
            still_at: center,
            still_since: time,
            still_secs: 0.0,
        }
    }

    pub(super) fn center(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.axes[axis].position_px())
    }

    pub(super) const fn size(&self) -> [f64; 2] {
        self.size
    }

    /// Where it is, as large as it is.
    pub(super) fn extent(&self) -> Extent {
        Extent::around(self.center(), self.size)
    }

    /// Variance of where it is along `axis`, pixels squared.
    pub(super) const fn variance_px2(&self, axis: usize) -> f64 {
        self.axes[axis].variance_px2()
    }

    /// Lets `dt_secs` pass, 0 or more.
    pub(super) fn predict(&mut self, motion: &mut Motion, dt_secs: f64) {
        self.blob = None;
        self.is_in_group = false;
        self.age_secs += dt_secs;
        self.missed_secs += dt_secs;
        if dt_secs > 0.0 {
            let density = (ACCELERATION * sighting::scale_px(self.size)).powi(2);
            for axis in &mut self.axes {
                motion.predict(axis, dt_secs, density);
            }
        }
    }

    /// Takes in where its middle lies along `axis`, `dt_secs` after the frame before.
    pub(super) fn correct(&mut self, motion: &mut Motion, axis: usize, place: Place, dt_secs: f64) {
        // Frames that follow one another faster than limbs swing repeat each other's errors.
        let repeats = (SWING_SECS / dt_secs.max(1e-3)).max(1.0);
        motion.correct(&mut self.axes[axis], place.position_px, place.variance_px2 * repeats);
    }

    /// Notes that `blob` shows it now.
    pub(super) const fn note_seen(&mut self, blob: usize, time: Timestamp) {
        self.blob = Some(blob);
        self.last_seen = time;
        self.missed_secs = 0.0;
    }

    /// Takes in what shows it alone: place and size.
    pub(super) fn see(&mut self, motion: &mut Motion, seen: &Extent, cut: &Cut, dt_secs: f64) {
        for axis in [0, 1] {
            self.resize(axis, seen.size()[axis], cut, dt_secs);
            let expected = self.axes[axis].position_px();
            if let Some(place) = sighting::place(seen, cut, axis, self.size, expected) {
                self.correct(motion, axis, place, dt_secs);
            }
        }
    }

    /// Lets the size along `axis` follow a blob of `len` pixels.
    fn resize(&mut self, axis: usize, len: f64, cut: &Cut, dt_secs: f64) {
        let old = self.size[axis];
        let is_known = self.sized_secs[axis] > 0.0;
        if cut.is_any() {
            // Part of it is outside: it is at least as large as what shows, and grows out of the border.
            if len > old && (cut.is_on(axis) || !is_known) {
                self.size[axis] = len;
                let grown = (len - old) / 2.0;
                match (cut.low[axis], cut.high[axis]) {
                    (true, false) => self.axes[axis].shift(-grown),
                    (false, true) => self.axes[axis].shift(grown),
                    _ => {}
                }
            }
            return;
        }
        let ratio = (len / old).max(old / len);
        let tau = if is_known && ratio > DOUBTFUL_RATIO { DOUBT * SIZE_TAU_SECS } else { SIZE_TAU_SECS };
        self.sized_secs[axis] = (self.sized_secs[axis] + dt_secs.max(1e-3)).min(SIZE_TAU_SECS);
        // A plain mean at first, which then fades.
        let share = (dt_secs / self.sized_secs[axis].max(dt_secs) * SIZE_TAU_SECS / tau).clamp(0.0, 1.0);
        self.size[axis] = (old + share * (len - old)).max(1.0);
    }

    /// Ends a frame: judges whether it is still.
    pub(super) fn settle(&mut self, time: Timestamp, dt_secs: f64) {
        let center = self.center();
        let gone = [0, 1].map(|axis| center[axis] - self.still_at[axis]);
        if gone[0].hypot(gone[1]) > STILL_SHARE * sighting::scale_px(self.size) {
            (self.still_at, self.still_since, self.still_secs) = (center, time, 0.0);
        } else {
            self.still_secs += dt_secs;
        }
    }

    /// What is told of it in a picture of `size_px`; `None` before it is confirmed and where it lies outside.
    pub(super) fn track(&self, size_px: (u32, u32)) -> Option<Track> {
        let extent = self.extent();
        let is_still = self.still_secs >= STILL_SECS;
        Some(Track {
            id: self.id?,
            rect: extent.pixels(size_px)?,
            blob_idx: self.blob.and_then(|blob| u32::try_from(blob).ok()),
            foot_in_image: [self.axes[0].position_px(), extent.high[1]],
            velocity_px_per_sec: self.axes.map(|axis| axis.velocity_px_per_sec()),
            first_seen: self.first_seen,
            last_seen: self.last_seen,
            is_in_group: self.is_in_group,
            still_since: is_still.then_some(self.still_since),
        })
    }
}
