//! How a camera is doing, for everyone who asks.

use super::IngestError;
use crate::media::Decoding;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use videofields_vision::clock::Timestamp;

/// Where a camera stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraState {
    /// Its source is being opened, or opened again after a failure.
    Connecting,
    /// Frames come.
    Live,
    /// Frames come, but they are all the same.
    Frozen,
    /// A live source is connected, but no frame has come for a while.
    Stalled,
    /// The last frame came; or the camera was stopped.
    Ended,
    /// Its source failed and is tried again later; or its processing failed, and it stays so.
    Failed,
}

impl CameraState {
    /// Whether frames come.
    #[must_use]
    pub const fn delivers(self) -> bool {
        matches!(self, Self::Live | Self::Frozen)
    }

    /// Its name, as the API shows it.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Connecting => "connecting",
            Self::Live => "live",
            Self::Frozen => "frozen",
            Self::Stalled => "stalled",
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
    /// Reason for callers who do not administer the site: without paths and addresses, and what answers there.
    pub public_reason: Option<String>,
    /// Wall-clock time at which this state began.
    pub since: Timestamp,
    /// How often its source was opened again.
    pub retries: u64,
    /// Wall-clock time at which the source is opened again, where it failed.
    pub next_try: Option<Timestamp>,
    /// The process that decodes its pictures and what holds that; none before the first one, and where they come unencoded.
    pub decoding: Option<Decoding>,
    /// Frames delivered.
    pub frames: u64,
    /// Frames left out: too late, replaced by newer ones, or damaged.
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

/// A reason for a camera's state, with its text for callers who do not administer the site.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Reason {
    /// Text for administrators.
    pub(super) text: String,
    /// Text for others.
    pub(super) public: String,
}

impl From<String> for Reason {
    /// Returns a reason that everybody may read.
    fn from(text: String) -> Self {
        Self { public: text.clone(), text }
    }
}

impl From<&IngestError> for Reason {
    fn from(error: &IngestError) -> Self {
        Self { text: error.to_string(), public: error.public_text() }
    }
}

impl CameraStatus {
    fn tell(&mut self, reason: Option<Reason>) {
        (self.reason, self.public_reason) =
            reason.map_or((None, None), |reason| (Some(reason.text), Some(reason.public)));
    }

    /// Goes over to `state`, if it is another.
    fn enter(&mut self, state: CameraState, now: Timestamp) {
        if self.state != state {
            (self.state, self.since) = (state, now);
        }
        self.next_try = None;
        if !state.delivers() {
            self.fps = 0.0;
        }
    }
}

/// A frame that was delivered.
pub(super) struct Delivered {
    /// Its scene time.
    pub(super) timestamp: Timestamp,
    /// When that was.
    pub(super) monotonic: Duration,
    /// As well.
    pub(super) wall: Timestamp,
    /// Columns and rows.
    pub(super) size: (u32, u32),
    /// Frames delivered a second.
    pub(super) fps: f64,
    /// [`CameraState::Live`] or [`CameraState::Frozen`].
    pub(super) state: CameraState,
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

    /// Of a camera that has no thread yet, since it is switched off.
    #[must_use]
    pub fn switched_off(now: Timestamp) -> Self {
        let status = Self(SharedStatus::new(now));
        status.switch_off(now);
        status
    }

    /// Tells that the camera was switched off: the thread that told its status has ended.
    pub fn switch_off(&self, now: Timestamp) {
        let mut status = self.0.lock();
        status.enter(CameraState::Ended, now);
        status.tell(Some("switched off".to_owned().into()));
    }

    /// Tells that the camera's thread could not be started.
    pub fn fail(&self, reason: String, now: Timestamp) {
        self.0.fail(reason.into(), now, None);
    }

    /// What is read here, to be told on.
    pub(super) fn shared(self) -> SharedStatus {
        self.0
    }
}

/// A camera's status with one writer, its thread, and any number of readers. Cheap to clone.
#[derive(Clone, Debug)]
pub(super) struct SharedStatus(Arc<Mutex<CameraStatus>>);

impl SharedStatus {
    pub(super) fn new(now: Timestamp) -> Self {
        Self(Arc::new(Mutex::new(CameraStatus {
            state: CameraState::Connecting,
            reason: None,
            public_reason: None,
            since: now,
            retries: 0,
            decoding: None,
            next_try: None,
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

    pub(super) fn set(&self, state: CameraState, now: Timestamp) {
        self.lock().enter(state, now);
    }

    /// Tells that the source failed, and after what time it is tried again, if it is.
    pub(super) fn fail(&self, reason: Reason, now: Timestamp, retry_in: Option<Duration>) {
        let mut status = self.lock();
        status.enter(CameraState::Failed, now);
        status.tell(Some(reason));
        status.next_try = retry_in
            .map(|delay| now.saturating_add_nanos(i64::try_from(delay.as_nanos()).unwrap_or(i64::MAX)));
    }

    /// Tells that the source is opened again after it failed for `reason`.
    pub(super) fn retry(&self, reason: Reason) {
        let mut status = self.lock();
        status.retries += 1;
        status.tell(Some(reason));
    }

    /// Tells something of the state that it is in.
    pub(super) fn set_reason(&self, reason: String) {
        self.lock().tell(Some(reason.into()));
    }

    /// Tells that no frame has come for a while.
    pub(super) fn stall(&self, reason: String, now: Timestamp) {
        let mut status = self.lock();
        status.enter(CameraState::Stalled, now);
        status.tell(Some(reason.into()));
    }

    /// Tells which process decodes its pictures and what holds that.
    pub(super) fn tell_decoding(&self, decoding: Option<Decoding>) {
        self.lock().decoding = decoding;
    }

    pub(super) fn count_dropped(&self, n: u64) {
        self.lock().dropped += n;
    }

    /// Counts a delivered frame; whether it is the first since the source was opened.
    pub(super) fn count_frame(&self, frame: &Delivered, concern: Option<&str>) -> bool {
        let mut status = self.lock();
        let is_first = !status.state.delivers();
        status.enter(frame.state, frame.wall);
        status.fps = frame.fps;
        if status.reason.as_deref() != concern {
            status.tell(concern.map(|concern| concern.to_owned().into()));
        }
        (status.last_timestamp, status.last_frame_at) = (Some(frame.timestamp), Some(frame.monotonic));
        status.size = Some(frame.size);
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
