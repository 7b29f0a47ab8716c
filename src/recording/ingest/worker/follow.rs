//! How a camera's thread follows a live source: nothing is paced, silence is told, what is lost is counted.
//!
//! Frames of a live source flow in as they come; they are given scene time by `ArrivalClock` and delivered at once.

use super::Camera;
use crate::ingest::arrival::Arrival;
use crate::ingest::status::CameraState;
use crate::ingest::{CameraError, IngestError, Lost, Polled, Source};
use std::time::Duration;

/// Longest time from connecting to the first frame.
const FIRST_FRAME: Duration = Duration::from_secs(10);

/// How long a stalled connection may come back by itself before it is given up.
const SECOND_CHANCE: Duration = Duration::from_secs(5);

/// Shortest life of a connection whose pictures could no longer be decoded after which it is made anew at once.
const WORTH_HASTE: Duration = Duration::from_secs(1);

impl Camera {
    /// Delivers a live source's frames until it fails or the camera ends.
    pub(super) fn follow(&mut self, source: &mut dyn Source) -> Result<(), IngestError> {
        self.arrivals.begin();
        let first_number = self.next_number;
        let mut heard = self.clock.monotonic();
        let (mut has_frame, mut counted) = (false, Lost::default());
        while !self.stop.is_raised() {
            let polled = source.poll()?;
            let now = self.clock.monotonic();
            self.count_lost(source.lost(), &mut counted);
            match polled {
                Polled::Ended => break,
                Polled::Waiting => {
                    let silence = now.saturating_sub(heard);
                    let patience =
                        if has_frame { self.stall.saturating_add(SECOND_CHANCE) } else { FIRST_FRAME };
                    let (place, secs) = (source.place().to_owned(), silence.as_secs_f64());
                    if silence >= patience {
                        return Err(CameraError::Silent { place, secs }.into());
                    }
                    if silence >= self.stall && has_frame {
                        self.tell_stall(&CameraError::Silent { place, secs: self.stall.as_secs_f64() });
                    }
                }
                Polled::Frame(frame) => {
                    (heard, has_frame) = (now, true);
                    self.next_number = first_number + frame.number + 1;
                    let (stream_nanos, reference) = (frame.stream_nanos, frame.reference);
                    let now = self.clock.now();
                    let arrival = Arrival { now, monotonic: heard, stream_nanos, reference };
                    self.tell_decoding(source);
                    let stamped = self.arrivals.stamp(&arrival);
                    let timestamp = self.scene_time(stamped);
                    self.hand_on_encoded(source, stamped.as_nanos().saturating_sub(stream_nanos));
                    self.deliver(frame, timestamp, first_number);
                }
            }
            self.tick_if_due();
        }
        Ok(())
    }

    /// Whether a live source that failed is opened again at once: its pictures were seen and went over to what this
    /// pipeline cannot decode, such as another codec. What fails right away again waits as all else.
    pub(super) fn is_worth_haste(&self, error: &IngestError, lasted: Duration, n_frames: u64) -> bool {
        error.is_of_content() && n_frames > 0 && lasted >= WORTH_HASTE
    }

    fn tell_stall(&self, silence: &CameraError) {
        if self.status.read().state != CameraState::Stalled {
            tracing::warn!(%silence, "a camera stalled");
            self.status.stall(silence.to_string(), self.clock.now());
        }
    }
}
