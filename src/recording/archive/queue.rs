//! Frames on their way to the disk. Bounded in bytes; who pushes never waits.

use super::lane::Lane;
use crate::media::EncodedFrame;
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use videofields_vision::clock::Timestamp;

/// Bytes that a frame takes beside its own.
const FRAME_BYTES: usize = 512;

/// What the writer is asked to do.
#[derive(Debug)]
pub(super) enum Job {
    /// Record a frame.
    Frame(Arc<Lane>, EncodedFrame, Timestamp),
    /// Nothing more comes of a camera.
    End(Arc<Lane>),
}

/// Jobs in their order.
#[derive(Debug)]
pub(super) struct Queue {
    waiting: Mutex<Waiting>,
    has_come: Condvar,
    max_bytes: usize,
}

#[derive(Debug, Default)]
struct Waiting {
    jobs: VecDeque<Job>,
    n_bytes: usize,
    is_closed: bool,
}

/// What [`Queue::take`] found.
#[derive(Debug)]
pub(super) enum Taken {
    Job(Job),
    /// Nothing came for as long as was waited.
    Nothing,
    /// Nothing more will come.
    End,
}

impl Queue {
    pub(super) fn new(max_bytes: usize) -> Self {
        Self { waiting: Mutex::default(), has_come: Condvar::new(), max_bytes }
    }

    /// Adds a job; false where there is no room for its frame, or nobody takes it.
    pub(super) fn push(&self, job: Job) -> bool {
        let n_bytes = job.len_bytes();
        let mut waiting = self.lock();
        if waiting.is_closed || n_bytes > 0 && waiting.n_bytes + n_bytes > self.max_bytes {
            return false;
        }
        waiting.n_bytes += n_bytes;
        waiting.jobs.push_back(job);
        drop(waiting);
        self.has_come.notify_one();
        true
    }

    /// Tells whether half of the room is free, or nobody takes anything any more.
    pub(super) fn has_room(&self) -> bool {
        let waiting = self.lock();
        waiting.is_closed || waiting.n_bytes <= self.max_bytes / 2
    }

    /// The job that has waited longest, or the first that comes within `patience`.
    pub(super) fn take(&self, patience: Duration) -> Taken {
        let is_idle = |waiting: &mut Waiting| waiting.jobs.is_empty() && !waiting.is_closed;
        let (mut waiting, _timeout) = self
            .has_come
            .wait_timeout_while(self.lock(), patience, is_idle)
            .unwrap_or_else(PoisonError::into_inner);
        match waiting.jobs.pop_front() {
            Some(job) => {
                waiting.n_bytes -= job.len_bytes();
                Taken::Job(job)
            }
            None if waiting.is_closed => Taken::End,
            None => Taken::Nothing,
        }
    }

    /// Takes no more; what waits can still be taken.
    pub(super) fn close(&self) {
        self.lock().is_closed = true;
        self.has_come.notify_all();
    }

    pub(super) fn is_closed(&self) -> bool {
        self.lock().is_closed
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        // No panic falls between two changes that belong together.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Job {
    fn len_bytes(&self) -> usize {
        match self {
            Self::Frame(_, frame, _) => frame.len_bytes() + FRAME_BYTES,
            Self::End(_) => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::media::EncodedFormat;
    use crate::telemetry::Metrics;
    use videofields_vision::frame::CameraId;

    #[test]
    fn there_is_room_up_to_the_half_and_once_nobody_takes_anything() {
        let queue = Queue::new(4 * FRAME_BYTES);
        let lane = Arc::new(Lane::new(CameraId::new("north").unwrap(), Arc::new(Metrics::new())));
        let format = Arc::new(EncodedFormat::named("image/jpeg"));
        let push = || {
            let frame = EncodedFrame::blank(Arc::clone(&format), Some(0), None);
            queue.push(Job::Frame(Arc::clone(&lane), frame, Timestamp::from_nanos(0)))
        };
        assert!(queue.has_room() && push() && push());
        assert!(queue.has_room(), "half of it is taken");
        assert!(push() && !queue.has_room());
        assert!(matches!(queue.take(Duration::ZERO), Taken::Job(_)));
        assert!(queue.has_room() && push());
        queue.close();
        assert!(queue.has_room(), "who waited would wait for ever");
    }
}
