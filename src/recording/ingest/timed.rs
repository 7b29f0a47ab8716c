//! Numbers and times the pictures of a medium, once or in a loop without a seam.

use super::medium::Medium;
use super::pairing::Pairing;
use super::{IngestError, Lost, Source, SourceFrame};
use crate::media::{Decoding, EncodedFrame, Picture};
use std::collections::VecDeque;
use std::sync::Arc;
use videofields_vision::config::{End, Timing};

const NANOS_PER_SEC: f64 = 1e9;

/// A step of the container's time longer than this, and than [`MAX_STEP_INTERVALS`], is a break in its clock (a
/// damaged timestamp, a recording that paused for hours) and counts as one frame interval.
const MAX_STEP_NANOS: i64 = 10_000_000_000;
const MAX_STEP_INTERVALS: i64 = 50;

/// Which part of a medium is played; stream time begins where the part does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(super) struct Cut {
    /// The part begins here, nanoseconds after the first picture.
    pub(super) from_nanos: i64,
    /// And ends before this.
    pub(super) until_nanos: Option<i64>,
}

/// A medium whose pictures are numbered from 0 and timed from the beginning of its part on.
///
/// With `Timing::Index` picture n is seen at n / rate. With `Timing::Pts` the container's stream times count; one
/// that is missing, does not grow, or leaps ahead is replaced by the time one frame interval after the picture before
/// it, so that time always runs forward and no leap stops the camera. When the medium loops, its part's first picture
/// follows its last by the mean interval of the pass.
pub(super) struct TimedSource<M> {
    media: M,
    end: End,
    rate_hz: f64,
    timing: Timing,
    cut: Cut,
    number: u64,
    position: Position,
    pass: Pass,
    pairing: Pairing,
    /// Encoded frames of passes that have ended.
    encoded: VecDeque<EncodedFrame>,
    /// Columns and rows of the first picture.
    first_size_px: Option<(u32, u32)>,
    /// Concern although pictures come: one had another size than the first.
    concern: Option<String>,
}

enum Position {
    BeforeFirst,
    Within,
    AfterLast,
}

/// Times of one run from the first picture to the last.
#[derive(Default)]
struct Pass {
    /// Stream time of the part's beginning.
    start_nanos: i64,
    /// The container's time of its first picture that has one, and ours of the same picture.
    anchor_nanos: Option<(i64, i64)>,
    /// Time of its latest picture since its first.
    latest_nanos: i64,
    /// Frame interval that the container promised last.
    promised_nanos: Option<i64>,
    /// Pictures so far.
    n_pictures: i64,
    /// Time of the latest picture since the first, as it counts.
    own_nanos: i64,
    /// Stream time of the latest picture that was played, and how many were.
    played: (i64, i64),
}

impl<M: Medium> TimedSource<M> {
    /// Times `media`; `rate_hz` counts with `Timing::Index`, and where nothing else tells the frame interval.
    pub(super) fn new(media: M, timing: Timing, rate_hz: f64, end: End) -> Self {
        Self {
            media,
            end,
            rate_hz,
            timing,
            cut: Cut::default(),
            number: 0,
            position: Position::BeforeFirst,
            pass: Pass::default(),
            pairing: Pairing::default(),
            encoded: VecDeque::new(),
            first_size_px: None,
            concern: None,
        }
    }

    /// The same, of which only a part is played.
    pub(super) fn with_cut(mut self, cut: Cut) -> Self {
        self.cut = cut;
        self
    }

    /// Takes over what was read of the encoded frames.
    fn read_encoded(&mut self) {
        while let Some(frame) = self.media.take_encoded() {
            self.pairing.push_frame(frame);
        }
    }

    /// Whether what is seen at `stream_nanos` of this pass is played.
    fn is_played(&self, stream_nanos: i64) -> bool {
        let end = self.cut.until_nanos.map(|until| self.stream_nanos(until));
        stream_nanos >= self.pass.start_nanos && end.is_none_or(|end| stream_nanos < end)
    }

    /// Stream time of what is seen `nanos` after this pass's first picture.
    fn stream_nanos(&self, nanos: i64) -> i64 {
        self.pass.start_nanos.saturating_add(nanos.saturating_sub(self.cut.from_nanos))
    }

    /// The picture with its number and time; none before the part that is played.
    fn stamp(&mut self, picture: Picture) -> Option<SourceFrame> {
        let fallback_nanos = index_nanos(1, self.rate_hz);
        let container_nanos = self.pass.time(&picture, fallback_nanos);
        let own_nanos = match self.timing {
            Timing::Pts => container_nanos,
            Timing::Index => index_nanos(self.pass.n_pictures - 1, self.rate_hz),
        };
        self.pass.own_nanos = own_nanos;
        let stream_nanos = self.stream_nanos(own_nanos);
        self.pairing.push_picture(picture.stream_nanos, picture.encoded_number, stream_nanos);
        if !self.is_played(stream_nanos) {
            return None;
        }
        self.pass.played = (stream_nanos, self.pass.played.1 + 1);
        let number = self.number;
        self.number += 1;
        self.compare_size((picture.image.width(), picture.image.height()), number);
        Some(SourceFrame { image: Arc::new(picture.image), stream_nanos, number, reference: None })
    }

    /// Tells once, in the log and as a concern, where a picture has another size than the first.
    fn compare_size(&mut self, size_px: (u32, u32), number: u64) {
        let first_size_px = *self.first_size_px.get_or_insert(size_px);
        if size_px == first_size_px || self.concern.is_some() {
            return;
        }
        let ((first_width, first_height), (width, height)) = (first_size_px, size_px);
        let path = self.media.newest_path();
        tracing::warn!(
            path = %path.display(), number, width, height, first_width, first_height,
            "a picture has another size than the first one; each size has a background of its own"
        );
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        self.concern = Some(format!(
            "its pictures are of several sizes: {first_width} x {first_height} at first, {width} x {height} in {name} \
             (number {number}); each has a background of its own"
        ));
    }

    /// The next picture of the part that is played; none where the pass is over.
    fn next_in_pass(&mut self) -> Result<Option<SourceFrame>, IngestError> {
        loop {
            let picture = self.media.next_picture()?;
            self.read_encoded();
            let Some(picture) = picture else { return Ok(None) };
            if let Some(frame) = self.stamp(picture) {
                return Ok(Some(frame));
            }
            // Nothing of a pass is played after its part.
            if self.cut.until_nanos.is_some_and(|until| self.pass.own_nanos >= until) {
                return Ok(None);
            }
        }
    }

    /// Lets the pass end.
    fn end_pass(&mut self) -> Result<(), IngestError> {
        while let Some(frame) = self.pairing.take_anyway() {
            if self.is_played(frame.stream_nanos.unwrap_or(i64::MIN)) {
                self.encoded.push_back(frame);
            }
        }
        self.pairing = Pairing::default();
        // An endless loop over nothing would otherwise follow.
        if self.pass.played.1 == 0 {
            let path = self.media.path().to_path_buf();
            return Err(if self.pass.n_pictures == 0 {
                IngestError::Empty { path }
            } else {
                IngestError::CutAway { path, n_pictures: self.pass.n_pictures }
            });
        }
        match self.end {
            End::Stop => self.position = Position::AfterLast,
            End::Loop => {
                self.pass = self.pass.next(self.timing, self.rate_hz);
                self.position = Position::BeforeFirst;
            }
        }
        Ok(())
    }
}

impl<M: Medium> Source for TimedSource<M> {
    fn take_encoded(&mut self) -> Option<EncodedFrame> {
        if let Some(frame) = self.encoded.pop_front() {
            return Some(frame);
        }
        loop {
            let frame = self.pairing.take()?;
            if self.is_played(frame.stream_nanos.unwrap_or(i64::MIN)) {
                return Some(frame);
            }
        }
    }

    fn n_encoded_dropped(&self) -> u64 {
        self.media.n_encoded_dropped()
    }

    fn decoding(&self) -> Option<Decoding> {
        self.media.decoding()
    }

    fn lost(&self) -> Lost {
        Lost { n_damaged: self.media.n_damaged(), ..Lost::default() }
    }

    fn concern(&self) -> Option<&str> {
        self.concern.as_deref()
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
            if let Some(frame) = self.next_in_pass()? {
                return Ok(Some(frame));
            }
            self.end_pass()?;
        }
    }
}

impl Pass {
    /// The time of the next picture since the first, by the container.
    fn time(&mut self, picture: &Picture, fallback_nanos: i64) -> i64 {
        self.promised_nanos = picture.interval_nanos.filter(|nanos| *nanos > 0);
        let interval_nanos = self.promised_nanos.unwrap_or(fallback_nanos);
        let next = if self.n_pictures == 0 { 0 } else { self.latest_nanos.saturating_add(interval_nanos) };
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

    /// The pass after this one.
    fn next(&self, timing: Timing, rate_hz: f64) -> Self {
        let interval_nanos = match timing {
            Timing::Pts if self.n_pictures > 1 => self.latest_nanos / (self.n_pictures - 1),
            Timing::Pts => self.promised_nanos.unwrap_or_else(|| index_nanos(1, rate_hz)),
            Timing::Index => index_nanos(1, rate_hz),
        };
        let start_nanos = self.played.0.saturating_add(interval_nanos.max(1));
        Self { start_nanos, ..Self::default() }
    }
}

fn index_nanos(number: i64, rate_hz: f64) -> i64 {
    // Exact to the nanosecond up to 2^53 ns x rate; a cast from float saturates.
    (number as f64 * NANOS_PER_SEC / rate_hz).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use videofields_vision::frame::{ColorMatrix, ColorRange, YuvImage};

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
            let (reference_nanos, encoded_number) = (None, None);
            Ok(Some(Picture { image, stream_nanos, interval_nanos, reference_nanos, encoded_number }))
        }
    }

    fn times(
        stream: &[Option<i64>],
        interval_nanos: Option<i64>,
        timing: Timing,
        end: End,
        most: usize,
    ) -> Vec<i64> {
        cut_times(stream, interval_nanos, (timing, end), Cut::default(), most)
    }

    fn cut_times(
        stream: &[Option<i64>],
        interval_nanos: Option<i64>,
        (timing, end): (Timing, End),
        cut: Cut,
        most: usize,
    ) -> Vec<i64> {
        let media = Listed { times: stream.to_vec(), interval_nanos, next: 0 };
        let mut source = TimedSource::new(media, timing, 10.0, end).with_cut(cut);
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

    #[test]
    fn a_part_is_played_alone_and_keeps_its_times() {
        let stream: Vec<_> = (0..10).map(|n| Some(n * 40)).collect();
        let check = |cut: Cut, end: End, expected: &[i64]| {
            let most = if end == End::Stop { 99 } else { expected.len() };
            assert_eq!(cut_times(&stream, None, (Timing::Pts, end), cut, most), expected, "{cut:?}");
        };
        let cut = Cut { from_nanos: 100, until_nanos: Some(200) };
        // The frame at 120 is 20 after the part's beginning.
        check(cut, End::Stop, &[20, 60]);
        check(cut, End::Loop, &[20, 60, 120, 160, 220, 260]);
        check(Cut { until_nanos: Some(80), ..Cut::default() }, End::Stop, &[0, 40]);
        let by_index = cut_times(
            &stream,
            None,
            (Timing::Index, End::Loop),
            Cut { from_nanos: 200_000_000, until_nanos: Some(400_000_000) },
            5,
        );
        assert_eq!(by_index, [0, 1, 2, 3, 4].map(|n| n * 100_000_000));
    }

    #[test]
    fn a_part_in_which_nothing_lies_is_told_and_no_endless_loop() {
        for end in [End::Stop, End::Loop] {
            let media = Listed { times: vec![Some(0), Some(40)], interval_nanos: None, next: 0 };
            let cut = Cut { from_nanos: 1000, ..Cut::default() };
            let error =
                TimedSource::new(media, Timing::Pts, 10.0, end).with_cut(cut).next_frame().unwrap_err();
            assert!(matches!(error, IngestError::CutAway { n_pictures: 2, .. }), "{error}");
        }
    }
}
