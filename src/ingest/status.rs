//! How a camera is doing, for everyone who asks.

use crate::clock::Timestamp;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Where a camera stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraState {
    /// Its source is being opened, or opened again after a failure.
    Connecting,
    /// Frames come.
    Live,
    /// The last frame came; or the camera was stopped.
    Ended,
    /// Its source failed and is tried again later; or its processing failed, and it stays so.
    Failed,
}

impl CameraState {
    /// Its name, as the API shows it.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Connecting => "connecting",
            Self::Live => "live",
            Self::Ended => "ended",
            Self::Failed => "failed",
        }
    }
}

/// How a camera is doing.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraStatus {
    /// Where it stands.
    pub state: CameraState,
    /// Why it failed last, or what is wrong although frames come; else `None`.
    pub reason: Option<String>,
    /// Frames delivered.
    pub frames: u64,
    /// Frames left out because they came too late.
    pub dropped: u64,
    /// Scene time of the frame delivered last.
    pub last_timestamp: Option<Timestamp>,
    /// Monotonic time at which a frame was delivered last.
    pub last_frame_at: Option<Duration>,
    /// Columns and rows of the frame delivered last.
    pub size: Option<(u32, u32)>,
    /// Frames delivered a second, over the last second or more; 0 until a second has passed, and when none come.
    pub fps: f64,
}

/// Reads a camera's status wherever its thread stands. Cheap to clone; outlives the thread.
#[derive(Clone, Debug)]
pub struct StatusReader(SharedStatus);

impl StatusReader {
    /// How the camera is doing now.
    #[must_use]
    pub fn read(&self) -> CameraStatus {
        self.0.read()
    }
}

/// A camera's status with one writer, its thread, and any number of readers. Cheap to clone.
#[derive(Clone, Debug)]
pub(super) struct SharedStatus(Arc<Mutex<CameraStatus>>);

impl SharedStatus {
    pub(super) fn new() -> Self {
        Self(Arc::new(Mutex::new(CameraStatus {
            state: CameraState::Connecting,
            reason: None,
            frames: 0,
            dropped: 0,
            last_timestamp: None,
            last_frame_at: None,
            size: None,
            fps: 0.0,
        })))
    }

    pub(super) fn reader(&self) -> StatusReader {
        StatusReader(self.clone())
    }

    pub(super) fn read(&self) -> CameraStatus {
        self.lock().clone()
    }

    pub(super) fn set(&self, state: CameraState) {
        let mut status = self.lock();
        status.state = state;
        if state != CameraState::Live {
            status.fps = 0.0;
        }
    }

    pub(super) fn fail(&self, reason: String) {
        let mut status = self.lock();
        status.reason = Some(reason);
        (status.state, status.fps) = (CameraState::Failed, 0.0);
    }

    pub(super) fn count_dropped(&self) {
        self.lock().dropped += 1;
    }

    /// Counts a delivered frame; whether it is the first since the source was opened.
    pub(super) fn count_frame(
        &self,
        timestamp: Timestamp,
        now: Duration,
        size: (u32, u32),
        fps: f64,
        concern: Option<&str>,
    ) -> bool {
        let mut status = self.lock();
        let is_first = status.state != CameraState::Live;
        (status.state, status.fps) = (CameraState::Live, fps);
        if status.reason.as_deref() != concern {
            status.reason = concern.map(str::to_owned);
        }
        (status.last_timestamp, status.last_frame_at, status.size) = (Some(timestamp), Some(now), Some(size));
        status.frames += 1;
        is_first
    }

    fn lock(&self) -> MutexGuard<'_, CameraStatus> {
        // Every update leaves the status whole, so a poisoned lock holds nothing broken.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Counts events a second, in windows of a second or a little more.
#[derive(Debug, Default)]
pub(super) struct RateMeter {
    window_start: Option<Duration>,
    n_events: u32,
    rate_hz: f64,
}

impl RateMeter {
    /// The shortest window.
    const WINDOW: Duration = Duration::from_secs(1);

    /// Counts an event at monotonic time `now`; events a second in the last full window.
    pub(super) fn count(&mut self, now: Duration) -> f64 {
        let start = *self.window_start.get_or_insert(now);
        let elapsed = now.saturating_sub(start);
        if elapsed >= Self::WINDOW {
            self.rate_hz = f64::from(self.n_events) / elapsed.as_secs_f64();
            (self.window_start, self.n_events) = (Some(now), 0);
        }
        self.n_events += 1;
        self.rate_hz
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_that_of_the_last_full_window() {
        let mut meter = RateMeter::default();
        let rates: Vec<f64> = (0..60).map(|n| meter.count(Duration::from_millis(n * 40))).collect();
        assert_eq!(rates[..25], [0.0; 25]);
        assert!(rates[25..].iter().all(|rate| (rate - 25.0).abs() < 1e-9), "{rates:?}");
    }
}
