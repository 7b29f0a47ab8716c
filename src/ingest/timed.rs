//! Numbers and times the pictures of a medium, once or in a loop without a seam.

use super::medium::Medium;
use super::pairing::Pairing;
use super::{IngestError, Source, SourceFrame};
use crate::config::{End, Timing};
use crate::media::{EncodedFrame, Picture};
use std::collections::VecDeque;
use std::sync::Arc;

const NANOS_PER_SEC: f64 = 1e9;

/// A step of the container's time longer than this, and than [`MAX_STEP_INTERVALS`], is a break in its clock (a
/// damaged timestamp, a recording that paused for hours) and counts as one frame interval.
const MAX_STEP_NANOS: i64 = 10_000_000_000;
const MAX_STEP_INTERVALS: i64 = 50;

/// A medium whose pictures are numbered from 0 and timed from the first one on.
///
/// With `Timing::Index` picture n is seen at n / rate. With `Timing::Pts` the container's stream times count; one
/// that is missing, does not grow, or leaps ahead is replaced by the time one frame interval after the picture before
/// it, so that time always runs forward and no leap stops the camera. When the medium loops, its first picture follows its last by the mean interval
/// of the pass.
pub(super) struct TimedSource<M> {
    media: M,
    end: End,
    rate_hz: f64,
    timing: Timing,
    number: u64,
    position: Position,
    pass: Pass,
    pairing: Pairing,
    /// Encoded frames of passes that have ended.
    encoded: VecDeque<EncodedFrame>,
}

enum Position {
    BeforeFirst,
    Within,
    AfterLast,
}

/// Times of one run from the first picture to the last.
#[derive(Default)]
struct Pass {
    /// Time of its first picture since the source's first.
    start_nanos: i64,
    /// The container's time of its first picture that has one, and ours of the same picture.
    anchor_nanos: Option<(i64, i64)>,
    /// Time of its latest picture since the source's first.
    latest_nanos: i64,
    /// Frame interval that the container promised last.
    promised_nanos: Option<i64>,
    /// Pictures so far.
    n_pictures: i64,
}

impl<M: Medium> TimedSource<M> {
    /// Times `media`; `rate_hz` counts with `Timing::Index`, and where nothing else tells the frame interval.
    pub(super) fn new(media: M, timing: Timing, rate_hz: f64, end: End) -> Self {
        Self {
            media,
            end,
            rate_hz,
            timing,
            number: 0,
            position: Position::BeforeFirst,
            pass: Pass::default(),
            pairing: Pairing::default(),
            encoded: VecDeque::new(),
        }
    }

    /// Takes over what was read of the encoded frames.
    fn read_encoded(&mut self) {
        while let Some(frame) = self.media.take_encoded() {
            self.pairing.push_frame(frame);
        }
    }

    fn stamp(&mut self, picture: Picture) -> SourceFrame {
        let fallback_nanos = index_nanos(1, self.rate_hz);
        let container_nanos = self.pass.time(&picture, fallback_nanos);
        let stream_nanos = match self.timing {
            Timing::Pts => container_nanos,
            Timing::Index => index_nanos(self.number, self.rate_hz),
        };
        self.pairing.push_picture(picture.stream_nanos, stream_nanos);
        let number = self.number;
        self.number += 1;
        SourceFrame { image: Arc::new(picture.image), stream_nanos, number, reference: None }
    }
}

impl<M: Medium> Source for TimedSource<M> {
    fn take_encoded(&mut self) -> Option<EncodedFrame> {
        self.encoded.pop_front().or_else(|| self.pairing.take())
    }

    fn n_encoded_dropped(&self) -> u64 {
        self.media.n_encoded_dropped()
    }

    fn next_frame(&mut self) -> Result<Option<SourceFrame>, IngestError> {
        loop {
            match self.position {
                Position::BeforeFirst => {
                    self.media.begin()?;
                    self.position = Position::Within;
                }
                Position::Within => {}
                Position::AfterLast => return Ok(None),
            }
            let picture = self.media.next_picture()?;
            self.read_encoded();
            if let Some(picture) = picture {
                return Ok(Some(self.stamp(picture)));
            }
            self.encoded.extend(std::iter::from_fn(|| self.pairing.take_anyway()));
            self.pairing = Pairing::default();
            // An endless loop over nothing would otherwise follow.
            if self.pass.n_pictures == 0 {
                return Err(IngestError::Empty { path: self.media.path().to_path_buf() });
            }
            match self.end {
                End::Stop => self.position = Position::AfterLast,
                End::Loop => {
                    self.pass = self.pass.next(index_nanos(1, self.rate_hz));
                    self.position = Position::BeforeFirst;
                }
            }
        }
    }
}

impl Pass {
    fn time(&mut self, picture: &Picture, fallback_nanos: i64) -> i64 {
        self.promised_nanos = picture.interval_nanos.filter(|nanos| *nanos > 0);
        let interval_nanos = self.promised_nanos.unwrap_or(fallback_nanos);
        let next = if self.n_pictures == 0 {
            self.start_nanos
        } else {
            self.latest_nanos.saturating_add(interval_nanos)
        };
        let told = picture.stream_nanos.and_then(|told| {
            let (theirs, ours) = *self.anchor_nanos.get_or_insert((told, next));
            ours.checked_add(told.checked_sub(theirs)?)
        });
        let longest = MAX_STEP_NANOS.max(interval_nanos.saturating_mul(MAX_STEP_INTERVALS));
        let step = told.map(|told| told.saturating_sub(self.latest_nanos));
        if self.n_pictures > 0 && step.is_some_and(|step| step > longest) {
            tracing::warn!(step_nanos = step, "timestamps leap ahead: the leap is left out");
            self.anchor_nanos = picture.stream_nanos.map(|told| (told, next));
        }
        let is_next = |nanos: &i64| {
            self.n_pictures == 0 || (1..=longest).contains(&nanos.saturating_sub(self.latest_nanos))
        };
        let nanos = told.filter(is_next).unwrap_or(next);
        self.latest_nanos = nanos;
        self.n_pictures += 1;
        nanos
    }

    fn next(&self, fallback_nanos: i64) -> Self {
        let interval_nanos = if self.n_pictures > 1 {
            (self.latest_nanos - self.start_nanos) / (self.n_pictures - 1)
        } else {
            self.promised_nanos.unwrap_or(fallback_nanos)
        };
        let start_nanos = self.latest_nanos.saturating_add(interval_nanos.max(1));
        Self { start_nanos, latest_nanos: start_nanos, ..Self::default() }
    }
}

fn index_nanos(number: u64, rate_hz: f64) -> i64 {
    // Exact to the nanosecond up to 2^53 ns x rate; a cast from float saturates.
    (number as f64 * NANOS_PER_SEC / rate_hz).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{ColorMatrix, ColorRange, YuvImage};
    use std::path::Path;

    struct Listed {
        times: Vec<Option<i64>>,
        interval_nanos: Option<i64>,
        next: usize,
    }

    impl Medium for Listed {
        fn path(&self) -> &Path {
            Path::new("listed.avi")
        }

        fn begin(&mut self) -> Result<(), IngestError> {
            self.next = 0;
            Ok(())
        }

        fn next_picture(&mut self) -> Result<Option<Picture>, IngestError> {
            let Some(stream_nanos) = self.times.get(self.next).copied() else { return Ok(None) };
            self.next += 1;
            let image = YuvImage::filled(2, 2, [9, 128, 128], ColorMatrix::Bt601, ColorRange::Full);
            let interval_nanos = self.interval_nanos;
            Ok(Some(Picture { image, stream_nanos, interval_nanos, reference_nanos: None }))
        }
    }

    fn times(
        stream: &[Option<i64>],
        interval_nanos: Option<i64>,
        timing: Timing,
        end: End,
        most: usize,
    ) -> Vec<i64> {
        let media = Listed { times: stream.to_vec(), interval_nanos, next: 0 };
        let mut source = TimedSource::new(media, timing, 10.0, end);
        let mut times = Vec::new();
        while times.len() < most {
            let Some(frame) = source.next_frame().unwrap() else { break };
            assert_eq!(frame.number, times.len() as u64);
            times.push(frame.stream_nanos);
        }
        if times.len() < most {
            assert!(source.next_frame().unwrap().is_none(), "a source that has ended stays at its end");
        }
        times
    }

    #[test]
    fn stream_time_begins_at_the_first_picture_and_loops_without_a_seam() {
        let stream = [Some(70), Some(110), Some(150)];
        assert_eq!(times(&stream, None, Timing::Pts, End::Stop, 9), [0, 40, 80]);
        assert_eq!(times(&stream, None, Timing::Pts, End::Loop, 7), [0, 40, 80, 120, 160, 200, 240]);
    }

    #[test]
    fn index_timing_ignores_the_containers_times() {
        let expected: Vec<i64> = (0..8).map(|n| n * 100_000_000).collect();
        assert_eq!(times(&[Some(5), Some(5), None], Some(1), Timing::Index, End::Loop, 8), expected);
    }

    #[test]
    fn broken_times_still_run_forward() {
        let check = |stream: &[Option<i64>], expected: &[i64]| {
            assert_eq!(times(stream, Some(10), Timing::Pts, End::Stop, 9), expected, "{stream:?}");
        };
        check(&[Some(0), Some(20), Some(20), Some(40)], &[0, 20, 30, 40]);
        check(&[Some(0), None, Some(20)], &[0, 10, 20]);
        check(&[None, None, Some(500), Some(540)], &[0, 10, 20, 60]);
        check(&[Some(i64::MIN), Some(i64::MAX), Some(0)], &[0, 10, 20]);
        check(&[Some(1000), Some(0), Some(10)], &[0, 10, 20]);
    }

    #[test]
    fn a_leap_ahead_is_left_out_and_time_goes_on_from_there() {
        let check = |stream: &[i64], interval, expected: &[i64]| {
            let stream: Vec<_> = stream.iter().copied().map(Some).collect();
            assert_eq!(times(&stream, Some(interval), Timing::Pts, End::Stop, 9), expected, "{stream:?}");
        };
        let hour = 3_600_000_000_000;
        check(&[0, 10, 3 * hour, 3 * hour + 10, 3 * hour + 30], 10, &[0, 10, 20, 30, 50]);
        check(&[0, i64::MAX - 1, 20], 10, &[0, 10, 20]);
        // Nine seconds are a pause; an hour is nothing to a camera that takes a picture an hour.
        check(&[0, 9_000_000_000], 10, &[0, 9_000_000_000]);
        check(&[0, hour, 3 * hour], hour, &[0, hour, 3 * hour]);
    }

    #[test]
    fn a_single_picture_loops_at_the_promised_or_the_configured_interval() {
        assert_eq!(times(&[Some(3)], Some(40), Timing::Pts, End::Loop, 3), [0, 40, 80]);
        assert_eq!(times(&[None], None, Timing::Pts, End::Loop, 3), [0, 100_000_000, 200_000_000]);
    }

    #[test]
    fn a_medium_without_pictures_is_an_error_and_no_endless_loop() {
        for end in [End::Stop, End::Loop] {
            let media = Listed { times: Vec::new(), interval_nanos: None, next: 0 };
            let error = TimedSource::new(media, Timing::Pts, 10.0, end).next_frame().unwrap_err();
            assert!(matches!(error, IngestError::Empty { .. }), "{error}");
        }
    }
}
