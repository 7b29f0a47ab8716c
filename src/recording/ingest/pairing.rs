//! Gives encoded frames the times of their pictures.
//!
//! Encoded frames flow in as they are read, in decoding order, and the times that pictures were given, in the order in
//! which pictures are seen; encoded frames with those times flow out, still in decoding order. A picture that a decoder
//! left out never comes: its frame's time follows from those around it.
//!
//! A frame of a file and its picture have one number. A camera's are paired by the stream's own times.

use super::time_map::{MAX_MOMENTS, TimeMap};
use crate::media::EncodedFrame;
use std::collections::VecDeque;

/// Pairs the frames of one pass through a stream with its pictures.
#[derive(Debug, Default)]
pub(super) struct Pairing {
    waiting: VecDeque<Waiting>,
    /// The stream's own time of each of the last pictures, and the time that it was given.
    times: TimeMap,
    /// Times of the pictures before the stream's own time stepped back last.
    times_before: TimeMap,
    /// Steps back of the pictures' own times.
    n_setbacks: u64,
    numbered: NumberedPictures,
    /// Time that was given last, and the distance to the next: as it was promised, or the last step.
    last: Option<(i64, i64)>,
}

/// A frame that waits for its picture.
#[derive(Debug)]
struct Waiting {
    frame: EncodedFrame,
    /// Steps back that the stream's own time had taken when it was read.
    n_setbacks: u64,
    /// True where its time is far beyond that of the next frame: it is wrong, or the camera's clock was set back.
    is_leap: bool,
}

/// Distance by which a frame's time is far beyond the next one's: no codec reorders so much.
const LEAP_NANOS: i64 = 2_000_000_000;

impl Pairing {
    /// Adds the frame that was read next. It must be added before its own picture is: so a picture that came already is not its own.
    pub(super) fn push_frame(&mut self, frame: EncodedFrame) {
        let has_stepped =
            self.times.newest().is_some_and(|newest| frame.stream_nanos.is_some_and(|nanos| nanos <= newest));
        if let Some(before) = self.waiting.back_mut()
            && let (Some(before_nanos), Some(nanos)) = (before.frame.stream_nanos, frame.stream_nanos)
        {
            before.is_leap = before_nanos.saturating_sub(nanos) > LEAP_NANOS;
        }
        self.waiting.push_back(Waiting {
            frame,
            n_setbacks: self.n_setbacks + u64::from(has_stepped),
            is_leap: false,
        });
    }

    /// Tells the time that the next picture was given, the stream's own, if it had one, and the number of its frame, if that is known.
    pub(super) fn push_picture(
        &mut self,
        stream_nanos: Option<i64>,
        frame_number: Option<u64>,
        given_nanos: i64,
    ) {
        if let Some(number) = frame_number {
            self.numbered.push(NumberedPicture { number, stream_nanos, given_nanos, has_other_time: false });
        }
        let Some(stream_nanos) = stream_nanos else { return };
        if self.times.newest().is_some_and(|newest| stream_nanos <= newest) {
            self.times_before = std::mem::take(&mut self.times);
            self.n_setbacks += 1;
        }
        self.times.push(stream_nanos, given_nanos);
    }

    /// Returns how far before the stream's own time `stream_nanos` the first of the frames lies that wait and are not after it.
    pub(super) fn waiting_nanos(&self, stream_nanos: i64) -> Option<i64> {
        let times = self.waiting.iter().filter_map(|waiting| waiting.frame.stream_nanos);
        let first = times.filter(|nanos| *nanos <= stream_nanos).min()?;
        Some(stream_nanos.saturating_sub(first))
    }

    /// The next frame whose time is known, its `stream_nanos` what its picture was given.
    pub(super) fn take(&mut self) -> Option<EncodedFrame> {
        let front = self.waiting.front()?;
        if let Some(is_known) = self.numbered.is_known(&front.frame) {
            return if is_known || self.waiting.len() > MAX_MOMENTS { self.take_anyway() } else { None };
        }
        // A frame with a wrong time may have no picture, or one with another time: then the next frame's picture has come.
        let is_doubtful = |waiting: &Waiting| waiting.is_leap || waiting.n_setbacks > self.n_setbacks;
        let is_passed = || {
            let mut behind = self.waiting.iter().skip(1);
            behind.find(|waiting| !is_doubtful(waiting)).is_some_and(|waiting| self.is_known(waiting))
        };
        let is_known = self.is_known(front) || is_doubtful(front) && is_passed();
        if is_known || self.waiting.len() > MAX_MOMENTS { self.take_anyway() } else { None }
    }

    /// Returns true once a frame's picture, or a later one of the same clock, has come.
    fn is_known(&self, Waiting { frame, n_setbacks, is_leap }: &Waiting) -> bool {
        let Some(newest) = self.times.newest() else { return false };
        let Some(nanos) = frame.stream_nanos else { return true };
        if *is_leap {
            return self.picture_time(nanos, *n_setbacks).is_some();
        }
        *n_setbacks < self.n_setbacks || *n_setbacks == self.n_setbacks && nanos <= newest
    }

    /// Returns the time that was given to the picture of exactly this time of the stream, by the clock of the frame where that is known.
    fn picture_time(&self, nanos: i64, n_setbacks: u64) -> Option<i64> {
        match n_setbacks.cmp(&self.n_setbacks) {
            std::cmp::Ordering::Less => {
                self.times_before.exactly(nanos).or_else(|| self.times.exactly(nanos))
            }
            std::cmp::Ordering::Equal => self.times.exactly(nanos),
            std::cmp::Ordering::Greater => None,
        }
    }

    /// Returns the next frame, also if its picture has not come: there will be no more pictures.
    pub(super) fn take_anyway(&mut self) -> Option<EncodedFrame> {
        let Waiting { mut frame, n_setbacks, is_leap } = self.waiting.pop_front()?;
        let next = self.last.map_or(0, |(last, interval)| last.saturating_add(interval));
        let times = if n_setbacks < self.n_setbacks { &self.times_before } else { &self.times };
        let by_number = self.numbered.time_given(&frame);
        let own_nanos = frame.stream_nanos.filter(|_| !self.numbered.has_other_times());
        let by_time = |nanos| {
            let is_doubtful = is_leap || n_setbacks > self.n_setbacks;
            let beside = || if is_doubtful { next } else { times.at(nanos).unwrap_or(nanos) };
            self.picture_time(nanos, n_setbacks).unwrap_or_else(beside)
        };
        let given = by_number.unwrap_or_else(|| own_nanos.map_or(next, by_time));
        // The last step tells the interval where the stream promises none.
        let step = self.last.map_or(1, |(last, interval)| {
            let step = given.saturating_sub(last);
            if (1..LEAP_NANOS).contains(&step) { step } else { interval }
        });
        self.last = Some((given, frame.interval_nanos.filter(|nanos| *nanos > 0).unwrap_or(step)));
        frame.stream_nanos = Some(given);
        Some(frame)
    }
}

/// The last pictures of which the number of the frame is known.
#[derive(Debug, Default)]
struct NumberedPictures {
    newest: VecDeque<NumberedPicture>,
}

#[derive(Clone, Copy, Debug)]
struct NumberedPicture {
    number: u64,
    stream_nanos: Option<i64>,
    given_nanos: i64,
    /// True where its frame had another time, or the picture before had none before it.
    has_other_time: bool,
}

impl NumberedPictures {
    /// Returns true where the times of the stream do not tell in which order its pictures are seen.
    fn has_other_times(&self) -> bool {
        self.newest.iter().any(|picture| picture.has_other_time)
    }

    fn push(&mut self, mut picture: NumberedPicture) {
        let is_later = |before: &NumberedPicture| picture.stream_nanos > before.stream_nanos;
        picture.has_other_time = !self.newest.back().is_none_or(is_later);
        if self.newest.len() == MAX_MOMENTS {
            self.newest.pop_front();
        }
        self.newest.push_back(picture);
    }

    /// Returns true once a frame's picture has come, or so many of later frames that it will not come; none where numbers tell nothing.
    fn is_known(&self, frame: &EncodedFrame) -> Option<bool> {
        let number = frame.number.filter(|_| !self.newest.is_empty())?;
        let n_later = self.newest.iter().filter(|picture| picture.number > number).count();
        let has_come = self.newest.iter().any(|picture| picture.number == number);
        Some(has_come || n_later > most_reordered(frame.format.codec()))
    }

    /// Returns the time that was given to a frame's own picture, where that has come.
    fn time_given(&mut self, frame: &EncodedFrame) -> Option<i64> {
        let number = frame.number?;
        let picture = self.newest.iter_mut().find(|picture| picture.number == number)?;
        picture.has_other_time |= picture.stream_nanos != frame.stream_nanos;
        Some(picture.given_nanos)
    }
}

/// Returns the most pictures of later frames that are seen before a frame's own.
fn most_reordered(codec: &str) -> usize {
    match codec {
        // ITU-T H.264, max_num_reorder_frames, and H.265, sps_max_num_reorder_pics: at most the pictures that are kept, which are 16.
        "video/x-h264" | "video/x-h265" => 16,
        // The next P-VOP is decoded before the B-VOPs that lead up to it. More than that was not seen of any encoder.
        "video/mpeg" | "video/x-divx" | "video/x-xvid" => 4,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::media::EncodedFormat;
    use std::sync::Arc;

    /// Frames of these stream times, milliseconds, in the order in which they are decoded.
    fn reading(pairing: &mut Pairing, millis: &[Option<i64>]) {
        let format = Arc::new(EncodedFormat::named("image/jpeg"));
        for millis in millis {
            let nanos = millis.map(|millis| millis * 1_000_000);
            pairing.push_frame(EncodedFrame::blank(Arc::clone(&format), nanos, Some(40_000_000)));
        }
    }

    fn taken(pairing: &mut Pairing) -> Vec<i64> {
        std::iter::from_fn(|| pairing.take()).map(|frame| frame.stream_nanos.unwrap() / 1_000_000).collect()
    }

    #[test]
    fn frames_wait_for_their_pictures_and_keep_decoding_order() {
        let mut pairing = Pairing::default();
        // I P B B: the third and fourth are seen before the second.
        reading(&mut pairing, &[Some(100), Some(220), Some(140), Some(180)]);
        assert!(taken(&mut pairing).is_empty());
        pairing.push_picture(Some(100_000_000), None, 0);
        assert_eq!(taken(&mut pairing), [0]);
        pairing.push_picture(Some(140_000_000), None, 40_000_000);
        pairing.push_picture(Some(180_000_000), None, 80_000_000);
        assert!(taken(&mut pairing).is_empty(), "the second is decoded before the third and fourth");
        // This one was given another time than the stream's own distance says.
        pairing.push_picture(Some(220_000_000), None, 125_000_000);
        assert_eq!(taken(&mut pairing), [125, 40, 80]);
    }

    /// Frames of H.264 with numbers from 0 on, all of the same time or one in decoding order, in milliseconds.
    fn reading_numbered(pairing: &mut Pairing, millis: &[i64]) {
        let format = Arc::new(EncodedFormat::named("video/x-h264"));
        for (number, millis) in (0..).zip(millis) {
            let mut frame = EncodedFrame::blank(Arc::clone(&format), Some(millis * 1_000_000), None);
            frame.number = Some(number);
            pairing.push_frame(frame);
        }
    }

    #[test]
    fn numbers_pair_where_times_are_those_of_decoding_or_all_the_same() {
        for own in [[0, 40, 80, 120, 160, 200], [0; 6]] {
            let mut pairing = Pairing::default();
            // I P B B P P, of which the last picture never comes.
            reading_numbered(&mut pairing, &own);
            for (number, given) in [(0, 0), (2, 40), (3, 80)] {
                pairing.push_picture(Some(own[0]), Some(number), given * 1_000_000);
            }
            assert_eq!(taken(&mut pairing), [0], "{own:?}");
            pairing.push_picture(Some(own[2] * 1_000_000), Some(1), 120_000_000);
            assert_eq!(taken(&mut pairing), [120, 40, 80], "{own:?}");
            pairing.push_picture(Some(own[5] * 1_000_000), Some(4), 160_000_000);
            assert_eq!(taken(&mut pairing), [160], "{own:?}");
            assert_eq!(pairing.take_anyway().unwrap().stream_nanos, Some(240_000_000), "by the last step");
        }
    }

    #[test]
    fn a_numbered_frame_whose_picture_does_not_come_holds_up_no_more_than_can_be_reordered() {
        let mut pairing = Pairing::default();
        let own: Vec<_> = (0..20).map(|i| 40 * i).collect();
        reading_numbered(&mut pairing, &own);
        let picture = |pairing: &mut Pairing, number: u64| {
            pairing.push_picture(Some(number as i64 * 40_000_000), Some(number), number as i64 * 40_000_000);
        };
        picture(&mut pairing, 0);
        (2..18).for_each(|number| picture(&mut pairing, number));
        assert_eq!(taken(&mut pairing), [0], "16 are reordered at most");
        picture(&mut pairing, 18);
        assert_eq!(taken(&mut pairing), (1..19).map(|i| 40 * i).collect::<Vec<_>>(), "its own time is true");
    }

    #[test]
    fn after_a_step_back_frames_wait_for_their_own_pictures() {
        let mut pairing = Pairing::default();
        reading(&mut pairing, &[Some(0), Some(1040)]);
        pairing.push_picture(Some(0), None, 0);
        pairing.push_picture(Some(1_040_000_000), None, 1_040_000_000);
        assert_eq!(taken(&mut pairing), [0, 1040]);
        reading(&mut pairing, &[Some(80), Some(120)]);
        assert!(taken(&mut pairing).is_empty(), "the newest picture is of before");
        // Its time goes on.
        pairing.push_picture(Some(80_000_000), None, 1_080_000_000);
        assert_eq!(taken(&mut pairing), [1080]);
        // One of before whose picture never came.
        let mut pairing = Pairing::default();
        reading(&mut pairing, &[Some(0), Some(1040), Some(1080)]);
        pairing.push_picture(Some(0), None, 0);
        pairing.push_picture(Some(1_040_000_000), None, 1_040_000_000);
        assert_eq!(taken(&mut pairing), [0, 1040]);
        reading(&mut pairing, &[Some(120)]);
        pairing.push_picture(Some(120_000_000), None, 1_120_000_000);
        assert_eq!(taken(&mut pairing), [1080, 1120]);
    }

    #[test]
    fn a_frame_without_a_time_follows_by_the_last_step() {
        let mut pairing = Pairing::default();
        let format = Arc::new(EncodedFormat::named("image/jpeg"));
        for nanos in [Some(0), Some(40_000_000), None, None] {
            pairing.push_frame(EncodedFrame::blank(Arc::clone(&format), nanos, None));
        }
        pairing.push_picture(Some(0), None, 0);
        pairing.push_picture(Some(40_000_000), None, 50_000_000);
        assert_eq!(taken(&mut pairing), [0, 50, 100, 150]);
    }

    #[test]
    fn a_wrong_time_holds_up_nothing() {
        let mut pairing = Pairing::default();
        reading(&mut pairing, &[Some(0), Some(40), Some(37_600_000), Some(120), Some(160)]);
        pairing.push_picture(Some(0), None, 0);
        pairing.push_picture(Some(40_000_000), None, 40_000_000);
        assert_eq!(taken(&mut pairing), [0, 40]);
        // Its picture was replaced by the next.
        pairing.push_picture(Some(120_000_000), None, 120_000_000);
        assert_eq!(taken(&mut pairing), [80, 120]);
        pairing.push_picture(Some(160_000_000), None, 160_000_000);
        // Or it was of before all.
        reading(&mut pairing, &[Some(-37_600_000), Some(220)]);
        assert_eq!(taken(&mut pairing), [160]);
        pairing.push_picture(Some(220_000_000), None, 220_000_000);
        assert_eq!(taken(&mut pairing), [200, 220]);
        // Or its picture came.
        reading(&mut pairing, &[Some(37_600_000), Some(300)]);
        pairing.push_picture(Some(37_600_000_000_000), None, 260_000_000);
        pairing.push_picture(Some(300_000_000), None, 300_000_000);
        assert_eq!(taken(&mut pairing), [260, 300]);
    }

    #[test]
    fn a_frame_without_a_picture_is_timed_by_those_around_it() {
        let mut pairing = Pairing::default();
        reading(&mut pairing, &[Some(0), Some(40), None, Some(120), Some(160)]);
        pairing.push_picture(Some(0), None, 500_000_000);
        pairing.push_picture(Some(120_000_000), None, 620_000_000);
        assert_eq!(taken(&mut pairing), [500, 540, 580, 620]);
        assert_eq!(pairing.take_anyway().unwrap().stream_nanos, Some(660_000_000));
        assert!(pairing.take_anyway().is_none());
    }

    #[test]
    fn frames_of_a_decoder_that_shows_nothing_more_do_not_pile_up() {
        let mut pairing = Pairing::default();
        reading(&mut pairing, &[Some(0)]);
        pairing.push_picture(Some(0), None, 0);
        assert_eq!(taken(&mut pairing), [0]);
        let later: Vec<_> = (1..=100).map(|i| Some(40 * i)).collect();
        reading(&mut pairing, &later);
        assert_eq!(taken(&mut pairing).len(), 100 - MAX_MOMENTS);
    }
}
