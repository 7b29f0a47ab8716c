//! Frame lock: which instant all tiles of a wall show at once.
//!
//! Time is cut into frames. Whoever asks first in a frame's time decides its instant, and everybody else who asks for that
//! frame gets the same, at once or a little later. So tiles that ask each on their own show one moment.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use videofields_recording::timeline::Horizon;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// Seconds for which a frame can be asked for again.
const KEPT_SECS: f64 = 5.0;

/// Walls, each as one set of cameras shows it, whose frames are kept; the one asked for longest ago goes first.
const MAX_KEPT: usize = 256;

/// A moment of a wall.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WallFrame {
    /// Its name: greater than those of all frames before of the same version of the wall.
    pub id: u64,
    /// What all tiles show.
    pub instant: Timestamp,
    /// How far cameras had been seen when that was decided: tiles that are asked for later show no more.
    pub horizon: Horizon,
}

/// The frames of all walls.
#[derive(Debug)]
pub struct FrameLock {
    /// Seconds since 1970 when the monotonic clock was at its beginning: what is done to the machine's clock during a run
    /// changes nothing, and frames of a run are numbered beyond those of the run before, unless it is set back between.
    origin_secs: f64,
    walls: Mutex<Vec<Kept>>,
}

#[derive(Debug)]
struct Kept {
    key: Key,
    frames: VecDeque<WallFrame>,
}

/// A wall in one of its versions, and the cameras that its instants hang on: what some callers may not see must not tell in
/// the instants of theirs.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Key {
    wall: String,
    version: i64,
    cameras: Vec<CameraId>,
}

impl FrameLock {
    /// Frames numbered by the clocks as they stand: what the machine's clock says when the monotonic one says `monotonic`.
    #[must_use]
    pub fn new(now: Timestamp, monotonic: Duration) -> Self {
        let origin_secs = now.as_nanos() as f64 * 1e-9 - monotonic.as_secs_f64();
        Self { origin_secs: origin_secs.max(0.0), walls: Mutex::default() }
    }

    /// How long it is from `monotonic` until the frame of that number is due; nothing once it is.
    #[must_use]
    pub fn due_in(&self, id: u64, rate_hz: f64, monotonic: Duration) -> Duration {
        let secs = id as f64 / rate_hz - (self.origin_secs + monotonic.as_secs_f64());
        Duration::try_from_secs_f64(secs.max(0.0)).unwrap_or(Duration::MAX)
    }

    /// The frame of a wall that is due at `monotonic`, of which `instant` and `horizon` are what would be shown if nobody has
    /// asked yet. `cameras` are those that may be seen. Frames are `1 / rate_hz` seconds long.
    pub fn due(
        &self,
        (wall, version, cameras): (&str, i64, Vec<CameraId>),
        rate_hz: f64,
        monotonic: Duration,
        (instant, horizon): (Timestamp, Horizon),
    ) -> WallFrame {
        let id = ((self.origin_secs + monotonic.as_secs_f64()) * rate_hz) as u64;
        let key = Key { wall: wall.to_owned(), version, cameras };
        let mut walls = self.lock();
        let mut kept = match walls.iter().position(|kept| kept.key == key) {
            Some(place) => walls.remove(place),
            None => Kept { key, frames: VecDeque::new() },
        };
        let frame = match kept.frames.back() {
            // Who was quick has asked for this one already.
            Some(newest) if newest.id >= id => newest.clone(),
            _ => {
                let frame = WallFrame { id, instant, horizon };
                kept.frames.push_back(frame.clone());
                let most = (KEPT_SECS * rate_hz).ceil().max(2.0) as usize;
                while kept.frames.len() > most {
                    kept.frames.pop_front();
                }
                frame
            }
        };
        if walls.len() >= MAX_KEPT {
            walls.remove(0);
        }
        walls.push(kept);
        frame
    }

    /// The frame of that name, if it is kept still at `monotonic`: some seconds long.
    #[must_use]
    pub fn frame(
        &self,
        (wall, version, cameras): (&str, i64, &[CameraId]),
        id: u64,
        rate_hz: f64,
        monotonic: Duration,
    ) -> Option<WallFrame> {
        let ago = (self.origin_secs + monotonic.as_secs_f64()) * rate_hz - id as f64;
        if ago > KEPT_SECS * rate_hz + 1.0 {
            return None;
        }
        let walls = self.lock();
        let is_it = |kept: &&Kept| {
            kept.key.wall == wall && kept.key.version == version && kept.key.cameras == cameras
        };
        walls.iter().find(is_it)?.frames.iter().find(|frame| frame.id == id).cloned()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Kept>> {
        // A panic leaves the list whole, but for the wall in hand.
        self.walls.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: i64) -> (Timestamp, Horizon) {
        let instant = Timestamp::from_nanos(ms * 1_000_000);
        (instant, Horizon::new([(CameraId::new("north").unwrap(), instant)]))
    }

    fn frame(id: u64, ms: i64) -> WallFrame {
        let (instant, horizon) = at(ms);
        WallFrame { id, instant, horizon }
    }

    fn wall(version: i64) -> (&'static str, i64, Vec<CameraId>) {
        ("control", version, vec![CameraId::new("north").unwrap()])
    }

    #[test]
    fn all_who_ask_in_a_frames_time_get_its_instant() {
        let lock = FrameLock::new(at(100_000).0, Duration::from_secs(40));
        let ms = Duration::from_millis;
        let first = lock.due(wall(1), 10.0, ms(41_010), at(7_000));
        assert_eq!(first, frame(1010, 7_000));
        assert_eq!(lock.due(wall(1), 10.0, ms(41_090), at(7_080)), first, "later in its time");
        let second = lock.due(wall(1), 10.0, ms(41_110), at(7_100));
        assert_eq!(second, frame(1011, 7_100));
        // One that is late asks by name, or gets the next; one that lags in its clock gets no frame of before.
        assert_eq!(lock.frame(("control", 1, &wall(1).2), 1010, 10.0, ms(41_110)), Some(first.clone()));
        assert_eq!(lock.due(wall(1), 10.0, ms(41_090), at(7_120)), second);
        let wait = lock.due_in(1012, 10.0, ms(41_110));
        assert!(wait.abs_diff(ms(90)) < Duration::from_micros(1), "{wait:?}");
        assert_eq!(lock.due_in(1011, 10.0, ms(41_110)), Duration::ZERO);
        assert_eq!(lock.due_in(u64::MAX, 0.1, ms(41_110)), Duration::MAX);
        // Another version, or other cameras, are others.
        assert_eq!(lock.due(wall(2), 10.0, ms(41_110), at(9_000)).instant, at(9_000).0);
        assert_eq!(lock.frame(("control", 2, &wall(2).2), 1010, 10.0, ms(41_110)), None);
        assert_eq!(lock.frame(("control", 1, &[]), 1010, 10.0, ms(41_110)), None);
    }

    #[test]
    fn frames_are_kept_for_seconds_and_walls_in_number() {
        let lock = FrameLock::new(at(0).0, Duration::ZERO);
        for tenth in 0..100 {
            lock.due(wall(1), 10.0, Duration::from_millis(tenth * 100 + 50), at(0));
        }
        let end = Duration::from_millis(9_950);
        let kept = (0..100).filter(|id| lock.frame(("control", 1, &wall(1).2), *id, 10.0, end).is_some());
        assert_eq!(kept.collect::<Vec<_>>(), (50..100).collect::<Vec<_>>());
        // Also where nobody asked for anything since.
        let later = lock.frame(("control", 1, &wall(1).2), 99, 10.0, Duration::from_secs(3600));
        assert_eq!(later, None);
        for version in 0..2 * MAX_KEPT as i64 {
            lock.due(wall(version), 10.0, Duration::from_secs(20), at(0));
        }
        assert_eq!(lock.lock().len(), MAX_KEPT);
    }

    #[test]
    fn numbers_grow_over_a_restart_and_whatever_the_clock_does() {
        let before = FrameLock::new(at(50_000).0, Duration::from_secs(5));
        let last = before.due(wall(1), 10.0, Duration::from_secs(100), at(0)).id;
        // Started again 2 s later, its monotonic clock at 0.
        let after = FrameLock::new(at(147_000).0, Duration::ZERO);
        assert!(after.due(wall(1), 10.0, Duration::ZERO, at(0)).id > last);
        // A machine whose clock is before 1970.
        let early = FrameLock::new(at(-50_000).0, Duration::ZERO);
        assert_eq!(early.due(wall(1), 10.0, Duration::from_secs(1), at(0)).id, 10);
    }
}
