//! Plays a file on a camera's thread: in real time, together with others, or whole, as fast as its frames are processed.
//!
//! Frames of a file flow in as fast as they are taken; each is handed on when its time has come. The first waits until the
//! consumer is prepared and, in real time, until all files that begin together are ready.

use super::Camera;
use crate::ingest::pacing::{Pacer, Turn};
use crate::ingest::{IngestError, Lost, Source};
use crate::telemetry::DropReason;
use std::sync::atomic::Ordering;
use std::time::Duration;
use videofields_vision::config::{End, Pace};
use videofields_vision::frame::YuvImage;

/// Time between two looks at whether others are as far.
const LOOK: Duration = Duration::from_millis(5);

/// Progress of a file that is played whole.
#[derive(Clone, Copy)]
pub(super) struct Played {
    /// Stream time of the latest frame.
    stream_nanos: i64,
    /// The number that the file's first frame has.
    first_number: u64,
}

impl Camera {
    /// Delivers a file's frames until it or the camera ends.
    pub(super) fn play(&mut self, source: &mut dyn Source) -> Result<(), IngestError> {
        // Others know that it comes before it is opened.
        self.member.get_or_insert_with(|| self.together.join(self.pace));
        let mut counted = Lost::default();
        let played = self.play_frames(source, &mut counted);
        // Losses that the last look found, and those of an error.
        self.count_file_lost(source, &mut counted);
        if self.end == End::Stop && counted.n_damaged > 0 {
            self.losses.count(DropReason::Damaged, counted.n_damaged, self.clock.monotonic());
        }
        played
    }

    fn play_frames(&mut self, source: &mut dyn Source, counted: &mut Lost) -> Result<(), IngestError> {
        self.resumed = self.played;
        let first_number = self.resumed.map_or(self.next_number, |played| played.first_number);
        let mut has_begun = false;
        while let Some(frame) = source.next_frame()? {
            if !has_begun {
                self.begin(&frame.image);
                has_begun = true;
            }
            if self.stop.is_raised() {
                return Ok(());
            }
            self.count_file_lost(source, counted);
            let stream_nanos = self.stream_time(frame.stream_nanos);
            if stream_nanos < 0 || self.is_played_already(stream_nanos) {
                // Before the beginning that is common to all, or before the failure of a file that is played whole.
                self.hand_on_encoded(source, self.file_offset_nanos());
                continue;
            }
            let (turn, stream_nanos) = self.wait_for_turn(stream_nanos);
            if self.stop.is_raised() {
                return Ok(());
            }
            if self.pace == Pace::All {
                self.played = Some(Played { stream_nanos, first_number });
            }
            self.hand_on_encoded(source, self.file_offset_nanos());
            self.next_number = first_number + frame.number + 1;
            match turn {
                Turn::Deliver => {
                    self.tell_decoding(source);
                    let timestamp = self.scene_time(self.scene_start.saturating_add_nanos(stream_nanos));
                    self.deliver(frame, timestamp, first_number);
                }
                Turn::Drop => self.leave_out(DropReason::Overrun, 1),
            }
            self.tick_if_due();
        }
        self.hand_on_encoded(source, self.file_offset_nanos());
        Ok(())
    }

    /// Gets ready for a file's frames, and waits for those that begin with it.
    fn begin(&mut self, first: &YuvImage) {
        if !self.is_prepared {
            self.is_prepared = true;
            self.consumer.prepare(first);
        }
        match (self.pace, &mut self.pacer) {
            (Pace::All, _) => {}
            // A source that is opened anew goes on from where real time stands.
            (Pace::RealTime, Some(pacer)) => pacer.begin(),
            (Pace::RealTime, None) => {
                let Some(began) = self.wait_for_beginning() else { return };
                self.pacer = Some(Pacer::new(began));
                if self.start.is_none() {
                    self.scene_start = self.together.origin();
                    self.zero.store(self.scene_start.as_nanos(), Ordering::Relaxed);
                }
            }
        }
    }

    /// Waits until all files that begin together are ready; returns the monotonic time of stream time 0, or nothing where the camera
    /// is stopped.
    fn wait_for_beginning(&mut self) -> Option<Duration> {
        let mut is_told = false;
        while !self.stop.is_raised() {
            let now = self.clock.monotonic();
            if let Some(began) = self.member.as_ref()?.begin(now) {
                return Some(began);
            }
            if !is_told {
                is_told = true;
                self.status.set_reason("it is ready and waits for the files that begin with it".to_owned());
            }
            self.sleep_until(now.saturating_add(LOOK));
        }
        None
    }

    /// Waits until the frame of that stream time may be handed on, or the camera is to stop; returns what becomes of it, and its
    /// stream time through all openings of the source.
    fn wait_for_turn(&mut self, stream_nanos: i64) -> (Turn, i64) {
        let now = self.clock.monotonic();
        if let Some(pacer) = &mut self.pacer {
            let due = pacer.due(now, stream_nanos);
            let stream_nanos = pacer.stream_nanos();
            self.sleep_until(due);
            let now = self.clock.monotonic();
            return (self.pacer.as_mut().map_or(Turn::Deliver, |pacer| pacer.turn(now)), stream_nanos);
        }
        while !self.stop.is_raised() && !self.may_go(stream_nanos) {
            self.sleep_until(self.clock.monotonic().saturating_add(LOOK));
        }
        (Turn::Deliver, stream_nanos)
    }

    /// Tells whether the frame of that stream time of a file that is played whole may be handed on.
    fn may_go(&self, stream_nanos: i64) -> bool {
        self.consumer.has_room() && self.member.as_ref().is_none_or(|member| member.may_go(stream_nanos))
    }

    /// Tells whether a file that is played whole was played up to that stream time before it failed.
    pub(super) fn is_played_already(&self, stream_nanos: i64) -> bool {
        self.resumed.is_some_and(|played| stream_nanos <= played.stream_nanos)
    }

    /// Counts what a file lost since the last look. The log tells it at the file's end, or of a loop when it is over.
    fn count_file_lost(&mut self, source: &dyn Source, counted: &mut Lost) {
        let n_damaged = source.lost().n_damaged.saturating_sub(counted.n_damaged);
        if n_damaged > 0 {
            counted.n_damaged += n_damaged;
            self.damage += n_damaged;
            self.status.count_dropped(n_damaged);
            self.consumer.miss(DropReason::Damaged, n_damaged);
            if self.end == End::Loop {
                self.losses.count(DropReason::Damaged, n_damaged, self.clock.monotonic());
            }
        }
        if self.source_concern.as_deref() != source.concern() {
            self.source_concern = source.concern().map(str::to_owned);
        }
    }
}
