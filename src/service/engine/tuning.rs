//! What callers change of a camera while it runs: handed over to its thread, which takes it before its next frame.

use std::sync::{Mutex, MutexGuard, PoisonError};
use videofields_recording::ingest::Pipeline;
use videofields_vision::config::SegmentSettings;

/// What is to be changed of one camera, and what it was changed to.
#[derive(Debug)]
pub(super) struct Tuning(Mutex<State>);

#[derive(Debug)]
struct State {
    /// As callers see them; in force from the next frame on.
    segment: SegmentSettings,
    is_segment_new: bool,
    is_place_accepted: bool,
}

impl Tuning {
    pub(super) fn new(segment: &SegmentSettings) -> Self {
        let state = State { segment: segment.clone(), is_segment_new: false, is_place_accepted: false };
        Self(Mutex::new(state))
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
    }

    pub(super) fn accept_place(&self) {
        self.lock().is_place_accepted = true;
    }

    /// Changes the pipeline by what is new.
    pub(super) fn apply(&self, pipeline: &mut Pipeline) {
        let mut state = self.lock();
        if std::mem::take(&mut state.is_segment_new) {
            pipeline.set_segment(&state.segment);
        }
        if std::mem::take(&mut state.is_place_accepted) {
            pipeline.accept_place();
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Every field is whole by itself.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
