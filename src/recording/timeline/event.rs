//! What happened before the cameras: a bounded log of events.

use serde::Serialize;
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;
use videofields_vision::segment::PixelRect;

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// What had come by itself stands still.
    Stopped,
    /// Something that did not come by itself stands there: left behind.
    LeftBehind,
    /// Something that was part of the background is gone.
    TakenAway,
    /// The light of most of the picture changed at once; the background is learned afresh.
    LightChanged,
    /// The same picture came again and again, to the bit.
    Frozen,
    /// The place's edges are gone from the picture: covered, fogged, out of focus.
    Covered,
    /// The camera was turned or knocked: its calibration is suspect until it is accepted or the camera is back.
    Moved,
    /// People seen elsewhere than other cameras see them: the camera's calibration, or theirs, is wrong.
    Misaligned,
}

impl EventKind {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Stopped,
        Self::LeftBehind,
        Self::TakenAway,
        Self::LightChanged,
        Self::Frozen,
        Self::Covered,
        Self::Moved,
        Self::Misaligned,
    ];

    /// Its name, as in JSON.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Stopped => "stopped",
            Self::LeftBehind => "left_behind",
            Self::TakenAway => "taken_away",
            Self::LightChanged => "light_changed",
            Self::Frozen => "frozen",
            Self::Covered => "covered",
            Self::Moved => "moved",
            Self::Misaligned => "misaligned",
        }
    }
}

/// What happened before one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Which camera.
    pub camera: CameraId,
    /// Scene time of the frame at which it was certain.
    pub time: Timestamp,
    /// Since when it has been so, as far as that is known.
    pub since: Timestamp,
    /// What happened.
    pub kind: EventKind,
    /// Where in the picture; none for what happened to the whole of it.
    pub rect: Option<PixelRect>,
    /// The track that it happened to.
    pub track: Option<u64>,
    /// Whether this is the end of something that an earlier event told: a picture that thawed, a camera that is back.
    pub is_end: bool,
}

impl Event {
    /// What happened to the whole picture of a camera, at `time`.
    #[must_use]
    pub const fn of_picture(camera: CameraId, time: Timestamp, kind: EventKind) -> Self {
        Self { camera, time, since: time, kind, rect: None, track: None, is_end: false }
    }
}

/// An event with its number in the log.
#[derive(Clone, Debug, PartialEq)]
pub struct LoggedEvent {
    /// When it was told, microseconds since 1970-01-01 UTC by the machine's clock, or one more than the one before: greater
    /// is later. A time and not a count, so that who may see some cameras alone does not learn how much happens before
    /// others.
    pub id: u64,
    /// The event.
    pub event: Event,
}

/// The newest events of every camera, as many of each as it holds, so that what happens before one drives out nothing of
/// another; the oldest go first, and are counted.
#[derive(Debug)]
pub struct EventLog {
    log: Mutex<Log>,
    capacity: usize,
}

#[derive(Debug, Default)]
struct Log {
    /// By camera, each in the order in which they came.
    cameras: BTreeMap<CameraId, VecDeque<LoggedEvent>>,
    last_id: u64,
    n_gone: u64,
}

impl EventLog {
    /// A log that holds `capacity` events of each camera.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        Self { log: Mutex::default(), capacity: capacity.max(1) }
    }

    /// Adds an event that is told `now`; its number.
    pub fn push(&self, event: Event, now: Timestamp) -> u64 {
        let mut log = self.lock();
        let log = &mut *log;
        let micros = u64::try_from(now.as_nanos() / 1000).unwrap_or(0);
        // A clock that steps back, or two events at once: still later.
        let id = micros.max(log.last_id + 1);
        log.last_id = id;
        let own = log.cameras.entry(event.camera.clone()).or_default();
        if own.len() == self.capacity {
            own.pop_front();
            log.n_gone += 1;
        }
        own.push_back(LoggedEvent { id, event });
        id
    }

    /// The newest `limit` events of those after number `after` that `wanted` accepts, in the order in which they came.
    #[must_use]
    pub fn after(&self, after: u64, limit: usize, wanted: impl Fn(&Event) -> bool) -> Vec<LoggedEvent> {
        let log = self.lock();
        let newer = |own: &VecDeque<LoggedEvent>| {
            let newest = own.iter().rev().take_while(|logged| logged.id > after);
            newest.filter(|logged| wanted(&logged.event)).take(limit).cloned().collect::<Vec<_>>()
        };
        let mut found: Vec<LoggedEvent> = log.cameras.values().flat_map(newer).collect();
        found.sort_unstable_by_key(|logged| logged.id);
        found.drain(..found.len().saturating_sub(limit));
        found
    }

    /// Lets go of a camera's events that `is_kept` refuses: they tell what nobody may know any more.
    pub fn retain(&self, camera: &CameraId, is_kept: impl Fn(&Event) -> bool) {
        if let Some(own) = self.lock().cameras.get_mut(camera) {
            own.retain(|logged| is_kept(&logged.event));
        }
    }

    /// Events that were let go to make room.
    #[must_use]
    pub fn n_gone(&self) -> u64 {
        self.lock().n_gone
    }

    fn lock(&self) -> MutexGuard<'_, Log> {
        // A panic between two writes leaves a log that is whole.
        self.log.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(camera: &str, micros: i64, kind: EventKind) -> Event {
        Event::of_picture(CameraId::new(camera).unwrap(), Timestamp::from_nanos(micros * 1000), kind)
    }

    fn told(log: &EventLog, camera: &str, micros: i64, kind: EventKind) -> u64 {
        log.push(event(camera, micros, kind), Timestamp::from_nanos(micros * 1000))
    }

    #[test]
    fn the_newest_are_kept_and_the_others_counted() {
        let log = EventLog::new(3);
        for micros in 1..=5 {
            let kind = if micros % 2 == 0 { EventKind::Stopped } else { EventKind::LightChanged };
            assert_eq!(told(&log, "a", micros, kind), micros as u64);
        }
        let ids = |after, limit, kind: Option<EventKind>| {
            let found = log.after(after, limit, |event| kind.is_none_or(|kind| event.kind == kind));
            found.iter().map(|logged| logged.id).collect::<Vec<_>>()
        };
        assert_eq!(ids(0, 10, None), [3, 4, 5]);
        assert_eq!(ids(0, 2, None), [4, 5]);
        assert_eq!(ids(3, 10, None), [4, 5]);
        assert_eq!(ids(0, 10, Some(EventKind::Stopped)), [4]);
        assert_eq!(ids(9, 10, None), [0; 0]);
        assert_eq!(log.n_gone(), 2);
    }

    #[test]
    fn a_busy_camera_neither_drives_out_nor_counts_another_s() {
        let log = EventLog::new(3);
        let first = told(&log, "quiet", 10, EventKind::Stopped);
        for micros in 20..40 {
            told(&log, "busy", micros, EventKind::Stopped);
        }
        let last = told(&log, "quiet", 50, EventKind::LeftBehind);
        let quiet = log.after(0, 100, |event| event.camera.as_str() == "quiet");
        assert_eq!(quiet.iter().map(|logged| logged.id).collect::<Vec<_>>(), [first, last]);
        assert_eq!((first, last), (10, 50), "as if nothing else had happened");
        let all: Vec<u64> = log.after(0, 4, |_| true).iter().map(|logged| logged.id).collect();
        assert_eq!(all, [37, 38, 39, 50]);
    }

    #[test]
    fn numbers_grow_though_the_clock_steps_back() {
        let log = EventLog::new(3);
        assert_eq!(told(&log, "a", 100, EventKind::Stopped), 100);
        assert_eq!(told(&log, "a", 40, EventKind::Stopped), 101);
        assert_eq!(told(&log, "b", 101, EventKind::Stopped), 102);
        assert_eq!(told(&log, "b", -5, EventKind::Stopped), 103);
    }

    #[test]
    fn names_are_those_of_json() {
        for kind in EventKind::ALL {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.as_str());
        }
    }
}
