//! How a camera's thread follows a live source: nothing is paced, silence is told, what is lost is counted.
//!
//! Frames of a live source flow in as they come; they are given scene time by `ArrivalClock` and delivered at once.

use super::Camera;
use crate::ingest::arrival::Arrival;
use crate::ingest::status::CameraState;
use crate::ingest::time_map::TimeMap;
use crate::ingest::{CameraError, IngestError, Lost, Polled, Source, Tap};
use crate::media::{EncodedFrame, TICK_NANOS};
use crate::telemetry::DropReason;
use std::time::Duration;
use videofields_vision::clock::Timestamp;

/// Longest time from connecting to the first frame.
const FIRST_FRAME: Duration = Duration::from_secs(10);

/// How long a stalled connection may come back by itself before it is given up.
const SECOND_CHANCE: Duration = Duration::from_secs(5);

/// Shortest life of a connection whose pictures could no longer be decoded after which it is made anew at once.
const WORTH_HASTE: Duration = Duration::from_secs(1);

impl Camera {
    /// Delivers a live source's frames until it fails or the camera ends.
    pub(super) fn follow(&mut self, source: &mut dyn Source) -> Result<(), IngestError> {
        let outcome = self.follow_pictures(source);
        // No pictures come of the last frames.
        source.end_encoded();
        self.record_encoded(source);
        outcome
    }

    fn follow_pictures(&mut self, source: &mut dyn Source) -> Result<(), IngestError> {
        self.arrivals.begin();
        self.recorded.begin();
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
                    self.recorded.times.push(stream_nanos, stamped.as_nanos());
                    self.record_encoded(source);
                    self.deliver(frame, timestamp, first_number);
                }
            }
            self.tick_if_due();
        }
        Ok(())
    }

    /// Hands on a live source's encoded frames, at the times of their pictures.
    fn record_encoded(&mut self, source: &mut dyn Source) {
        if self.tap == Tap::Closed {
            return;
        }
        while let Some(frame) = source.take_encoded() {
            let Some(time) = self.recorded.stamp(&frame) else {
                // No picture has come of the whole connection.
                self.leave_out(DropReason::Damaged, 1);
                continue;
            };
            let time = self.scene_time(time);
            self.consumer.record(&frame, time);
        }
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

/// Times of the frames that are recorded of a live source, before the camera's clock is corrected.
#[derive(Debug, Default)]
pub(super) struct RecordedTimes {
    /// Scene time by the source's stream time, at its pictures.
    times: TimeMap,
    /// The latest time of a frame, in nanoseconds.
    latest_nanos: Option<i64>,
    key: LastKeyFrame,
}

/// Times of the last key frame, in nanoseconds.
#[derive(Debug, Default)]
struct LastKeyFrame {
    /// The time of its picture.
    own_nanos: i64,
    /// The time at which it is recorded.
    recorded_nanos: i64,
    /// The latest time before it.
    before_nanos: i64,
}

impl RecordedTimes {
    /// Says that the next frame is the first of a new connection, whose stream time is another.
    fn begin(&mut self) {
        self.times = TimeMap::after(self.latest_nanos);
    }

    /// Returns the time at which the next frame is recorded, in decoding order; none where no picture has come yet. Frames after a key
    /// frame are seen after all before it. So one whose time says otherwise, since a time before it was wrong, is put behind them,
    /// and the frames that build on it pass at half their pace until they are where they should be. Frames that lead up to a key
    /// frame lie between both.
    fn stamp(&mut self, frame: &EncodedFrame) -> Option<Timestamp> {
        let own_nanos = self.times.at(frame.stream_nanos.unwrap_or(0))?;
        if frame.is_key {
            let before_nanos = self.latest_nanos.unwrap_or(i64::MIN);
            let recorded_nanos = own_nanos.max(before_nanos.saturating_add(TICK_NANOS));
            self.key = LastKeyFrame { own_nanos, recorded_nanos, before_nanos };
        }
        let LastKeyFrame { own_nanos: key_nanos, recorded_nanos, before_nanos } = self.key;
        let since_key_nanos = own_nanos.saturating_sub(key_nanos);
        let paced_nanos = if since_key_nanos < 0 { since_key_nanos } else { since_key_nanos / 2 };
        let mut nanos = own_nanos.max(recorded_nanos.saturating_add(paced_nanos));
        if nanos < recorded_nanos && nanos <= before_nanos {
            nanos = self.latest_nanos.unwrap_or(nanos).saturating_add(TICK_NANOS);
        }
        self.latest_nanos = Some(self.latest_nanos.map_or(nanos, |latest| latest.max(nanos)));
        Some(Timestamp::from_nanos(nanos))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::media::EncodedFormat;
    use std::sync::Arc;

    const MS: i64 = 1_000_000;

    /// Times of frames, in milliseconds of stream time and with `true` for key frames, once the pictures of `times` have come.
    fn stamped(recorded: &mut RecordedTimes, frames: &[(i64, bool)]) -> Vec<i64> {
        let format = Arc::new(EncodedFormat::named("video/x-h264"));
        let stamp = |(millis, is_key): &(i64, bool)| {
            let mut frame = EncodedFrame::blank(Arc::clone(&format), Some(millis * MS), None);
            frame.is_key = *is_key;
            recorded.stamp(&frame).unwrap().as_nanos() / MS
        };
        frames.iter().map(stamp).collect()
    }

    #[test]
    fn frames_before_and_between_pictures_are_recorded_between_them() {
        let mut recorded = RecordedTimes::default();
        recorded.begin();
        // The picture of the key frame was replaced, and scene time was ahead.
        recorded.times.push(100 * MS, 5000 * MS);
        recorded.times.push(400 * MS, 5120 * MS);
        let times =
            stamped(&mut recorded, &[(0, true), (100, false), (200, false), (300, false), (400, false)]);
        assert_eq!(times, [4900, 5000, 5040, 5080, 5120]);
        // The next connection's come after it, whatever its clock says.
        recorded.begin();
        recorded.times.push(300 * MS, 5200 * MS);
        let times = stamped(&mut recorded, &[(0, true), (100, false), (200, false), (300, false)]);
        assert!(
            times[0] > 5120 && times.windows(2).all(|pair| pair[0] < pair[1]) && times[3] == 5200,
            "{times:?}"
        );
    }

    #[test]
    fn one_wrong_time_costs_no_frame() {
        let mut recorded = RecordedTimes::default();
        recorded.begin();
        recorded.times.push(0, 1000 * MS);
        recorded.times.push(1000 * MS, 2000 * MS);
        let frames =
            [(0, true), (100, false), (700, false), (300, true), (400, false), (500, true), (600, false)];
        let times = stamped(&mut recorded, &frames);
        assert_eq!(times, [1000, 1100, 1700, 1700, 1750, 1750, 1800], "milliseconds");
        let frames = [(700, true), (900, false), (1100, false), (1200, true), (1300, false)];
        assert_eq!(stamped(&mut recorded, &frames), [1800, 1900, 2100, 2200, 2300], "where it should be");
        // A frame that leads up to its key frame stays, one of long before goes on from where it is.
        let frames = [(1600, true), (1500, false), (1000, false), (1700, false)];
        assert_eq!(stamped(&mut recorded, &frames), [2600, 2500, 2600, 2700]);
    }
}
