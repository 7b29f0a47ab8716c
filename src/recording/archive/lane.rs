//! What a camera's thread and the writer share of one camera: its state and its counts.

use crate::telemetry::{Metrics, RecordingDrop};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use videofields_vision::frame::CameraId;

/// Whether a camera is recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RecordingState {
    /// Nobody records it.
    Off,
    /// Its frames are written.
    Recording,
    /// Its next key frame begins a segment.
    WaitingForKey,
    /// It cannot be recorded now; tried again every few seconds.
    Paused {
        /// Why, without the places of files.
        reason: String,
    },
}

/// How one camera's recording goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraRecording {
    /// The camera.
    pub camera: CameraId,
    /// Whether it is recorded.
    pub state: RecordingState,
    /// Bytes written since the start.
    pub n_bytes: u64,
    /// Frames written since the start.
    pub n_frames: u64,
    /// Frames left out since the start, by reason.
    pub dropped: [(RecordingDrop, u64); RecordingDrop::ALL.len()],
}

/// One camera's state and counts.
#[derive(Debug)]
pub(super) struct Lane {
    camera: CameraId,
    metrics: Arc<Metrics>,
    recording: Mutex<CameraRecording>,
    /// Frames that were handed over and neither written nor left out yet.
    n_waiting: AtomicU64,
}

impl Lane {
    pub(super) fn new(camera: CameraId, metrics: Arc<Metrics>) -> Self {
        metrics.announce_recording(camera.as_str());
        let recording = CameraRecording {
            camera: camera.clone(),
            state: RecordingState::Off,
            n_bytes: 0,
            n_frames: 0,
            dropped: RecordingDrop::ALL.map(|reason| (reason, 0)),
        };
        Self { camera, metrics, recording: Mutex::new(recording), n_waiting: AtomicU64::new(0) }
    }

    pub(super) const fn camera(&self) -> &CameraId {
        &self.camera
    }

    pub(super) fn recording(&self) -> CameraRecording {
        self.lock().clone()
    }

    /// A frame is about to be handed over.
    pub(super) fn hand_over(&self) {
        self.n_waiting.fetch_add(1, Ordering::AcqRel);
    }

    /// A frame that was handed over is written or left out.
    pub(super) fn settle(&self) {
        self.n_waiting.fetch_sub(1, Ordering::AcqRel);
    }

    /// Whether frames that were handed over are not written yet.
    pub(super) fn is_behind(&self) -> bool {
        self.n_waiting.load(Ordering::Acquire) > 0
    }

    pub(super) fn is_paused(&self) -> bool {
        matches!(self.lock().state, RecordingState::Paused { .. })
    }

    pub(super) fn set_state(&self, state: RecordingState) {
        let is_paused = matches!(state, RecordingState::Paused { .. });
        self.metrics.archive_paused.with_label_values(&[self.camera.as_str()]).set(i64::from(is_paused));
        self.lock().state = state;
    }

    pub(super) fn count_written(&self, n_bytes: u64) {
        let camera = self.camera.as_str();
        self.metrics.archive_frames.with_label_values(&[camera]).inc();
        self.metrics.archive_bytes.with_label_values(&[camera]).inc_by(n_bytes);
        let mut recording = self.lock();
        recording.n_frames += 1;
        recording.n_bytes += n_bytes;
    }

    pub(super) fn count_dropped(&self, reason: RecordingDrop) {
        self.metrics.count_unrecorded(self.camera.as_str(), reason);
        for (known, n) in &mut self.lock().dropped {
            *n += u64::from(*known == reason);
        }
    }

    fn lock(&self) -> MutexGuard<'_, CameraRecording> {
        self.recording.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
