//! A camera's end of the archive: hands frames over and never waits.

use super::lane::{Lane, RecordingState};
use super::queue::Job;
use super::shared::Shared;
use crate::media::EncodedFrame;
use crate::telemetry::RecordingDrop;
use std::sync::Arc;
use videofields_vision::clock::Timestamp;

/// Looks in a row that find no key frame until that counts as a fault.
const MAX_KEYLESS_LOOKS: u32 = 30;

/// Records one camera for as long as it lives; made by [`super::Archive::recorder`].
#[derive(Debug)]
pub struct Recorder {
    shared: Arc<Shared>,
    lane: Arc<Lane>,
    /// Whether frames are left out up to the next key frame.
    is_broken: bool,
    /// Looks in a row that found the recording waiting for a key frame.
    n_keyless_looks: u32,
}

impl Recorder {
    pub(super) fn new(shared: Arc<Shared>, lane: Arc<Lane>) -> Self {
        if !lane.is_paused() {
            lane.set_state(RecordingState::WaitingForKey);
        }
        Self { shared, lane, is_broken: true, n_keyless_looks: 0 }
    }

    /// Records the frame that was seen at `at`, or counts why not. Frames come in decoding order; `at` is a whole
    /// number of [`crate::media::TICK_NANOS`]. Never waits.
    pub fn push(&mut self, frame: &EncodedFrame, at: Timestamp) {
        debug_assert_eq!(at.as_nanos() % crate::media::TICK_NANOS, 0, "whole ticks");
        if self.lane.is_paused() {
            self.is_broken = true;
            self.lane.count_dropped(RecordingDrop::Paused);
        } else if self.is_broken && !frame.is_key {
            self.lane.count_dropped(RecordingDrop::NoKeyFrame);
        } else {
            let job = Job::Frame(Arc::clone(&self.lane), frame.clone(), at);
            self.lane.hand_over();
            self.is_broken = !self.shared.queue.push(job);
            if self.is_broken {
                self.lane.settle();
                let is_over = self.shared.queue.is_closed();
                self.lane.count_dropped(if is_over {
                    RecordingDrop::Stopping
                } else {
                    RecordingDrop::QueueFull
                });
            }
        }
    }
}

impl Recorder {
    /// Returns what is wrong with the recording, if anything is. Called about once a second.
    pub fn look(&mut self) -> Option<String> {
        let state = self.lane.recording().state;
        self.n_keyless_looks =
            if state == RecordingState::WaitingForKey { self.n_keyless_looks + 1 } else { 0 };
        match state {
            RecordingState::Paused { reason } => Some(format!("recording is paused: {reason}")),
            _ => (self.n_keyless_looks > MAX_KEYLESS_LOOKS)
                .then(|| "nothing is recorded: no key frame has come for half a minute".to_owned()),
        }
    }

    /// Tells whether frames can be handed over without one being left out for want of room.
    #[must_use]
    pub fn has_room(&self) -> bool {
        self.lane.is_paused() || self.shared.queue.has_room()
    }

    /// What follows does not build on what came before: it is recorded from its next key frame on.
    pub const fn break_off(&mut self) {
        self.is_broken = true;
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if !self.shared.queue.push(Job::End(Arc::clone(&self.lane))) {
            tracing::debug!(camera = %self.lane.camera(), "the archive ended before its camera");
        }
    }
}
