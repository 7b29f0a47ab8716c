//! Feeds of cameras, and the scene time that follows from where their stream time 0 lies.

use super::super::status::StatusReader;
use super::super::together::Together;
use std::sync::{Arc, Mutex, PoisonError};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{ClockSettings, Pace, SourceSettings};

/// Feed of a camera.
#[derive(Clone, Debug, Default)]
pub struct Feed {
    /// Source of its frames.
    pub source: SourceSettings,
    /// Correction of its clock.
    pub clock: ClockSettings,
    /// The status of the worker that stood here before: it is told on, and its counts go on.
    pub status: Option<StatusReader>,
}

impl From<SourceSettings> for Feed {
    fn from(source: SourceSettings) -> Self {
        Self { source, ..Self::default() }
    }
}

impl Feed {
    /// Returns where stream time 0 lies, if the camera begins with others.
    pub(super) fn start(&self, together: Together) -> Start {
        let from_nanos = (self.source.from_secs * 1e9).round() as i64;
        let is_file = self.source.path.is_some();
        Start {
            scene: self.source.start.map(|start| start.saturating_add_nanos(from_nanos)),
            pace: is_file.then_some(self.source.pace),
            clock: SharedClock(Arc::new(Mutex::new(self.clock))),
            corrected: match self.source.start {
                Some(since) => Corrected::SceneTime { since },
                None if is_file => Corrected::StreamTime,
                None => Corrected::SceneTime { since: together.asked_at() },
            },
            together,
            status: self.status.clone(),
        }
    }
}

/// Correction of a camera's clock; may be changed while the camera runs.
#[derive(Clone, Debug, Default)]
pub(super) struct SharedClock(pub(super) Arc<Mutex<ClockSettings>>);

impl SharedClock {
    pub(super) fn get(&self) -> ClockSettings {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn set(&self, clock: ClockSettings) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = clock;
    }
}

/// Kind of time in which the camera's clock is corrected.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum Corrected {
    /// A file that begins with the daemon is moved against the others that do: it plays later, or what lies before their
    /// beginning is left out.
    #[default]
    StreamTime,
    /// All else is played as it comes, and bears another time; `since` is the instant from which on drift counts.
    SceneTime { since: Timestamp },
}

/// Beginning of a camera: where stream time 0 lies, and how scene time follows from it.
pub(super) struct Start {
    /// In scene time, before the correction; none of a file that begins when those begin with which it belongs together.
    pub(super) scene: Option<Timestamp>,
    pub(super) together: Together,
    /// Pace at which it is played; none of a live source.
    pub(super) pace: Option<Pace>,
    pub(super) clock: SharedClock,
    pub(super) corrected: Corrected,
    pub(super) status: Option<StatusReader>,
}
