//! Hands what callers change of a camera while it runs over to its thread, which takes it before its next frame, and tells which stages
//! of seeing run there.

use std::sync::{Mutex, MutexGuard, PoisonError};
use videofields_recording::ingest::Pipeline;
use videofields_vision::config::SegmentSettings;
use videofields_vision::stage::StageState;

/// Changes that one camera's thread is to make, and what it says of its stages.
#[derive(Debug)]
pub(super) struct Tuning(Mutex<State>);

#[derive(Debug)]
struct State {
    /// As callers see them; in force from the next frame on.
    segment: SegmentSettings,
    is_segment_new: bool,
    is_place_accepted: bool,
    /// As of the camera's last frame but one; none before.
    stages: Option<[StageState; 6]>,
}

impl Tuning {
    pub(super) fn new(segment: &SegmentSettings) -> Self {
        Self(Mutex::new(State {
            segment: segment.clone(),
            is_segment_new: false,
            is_place_accepted: false,
            stages: None,
        }))
    }

    pub(super) fn segment(&self) -> SegmentSettings {
        self.lock().segment.clone()
    }

    pub(super) fn set_segment(&self, segment: SegmentSettings) {
        let mut state = self.lock();
        state.segment = segment;
        state.is_segment_new = true;
    }

    /// As [`Self::set_segment`], of a thread that is still to be made, with these settings.
    pub(super) fn begin_with(&self, segment: SegmentSettings) {
        let mut state = self.lock();
        state.segment = segment;
        state.is_segment_new = false;
        state.stages = None;
    }

    pub(super) fn accept_place(&self) {
        self.lock().is_place_accepted = true;
    }

    /// Returns which stages of detection run and why; none before the camera's second frame.
    pub(super) fn stages(&self) -> Option<[StageState; 6]> {
        self.lock().stages
    }

    /// Changes the pipeline by what is new, and notes which of its stages run.
    pub(super) fn apply(&self, pipeline: &mut Pipeline) {
        let mut state = self.lock();
        if std::mem::take(&mut state.is_segment_new) {
            pipeline.set_segment(&state.segment);
        }
        if std::mem::take(&mut state.is_place_accepted) {
            pipeline.accept_place();
        }
        state.stages = pipeline.stages();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Every field is whole by itself.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
