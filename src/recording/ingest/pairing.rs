//! Gives encoded frames the times of their pictures.
//!
//! Encoded frames flow in as they are read, in decoding order, and the times that pictures were given, in the order in
//! which pictures are seen; encoded frames with those times flow out, still in decoding order. A picture that a decoder
//! left out never comes: its frame's time follows from those around it.

use crate::media::EncodedFrame;
use std::collections::VecDeque;

/// Pictures whose times are remembered: more than any codec reorders.
const MAX_TIMES: usize = 64;

/// Pairs the frames of one pass through a stream with its pictures.
#[derive(Debug, Default)]
pub(super) struct Pairing {
    waiting: VecDeque<EncodedFrame>,
    /// The stream's own time of each of the last pictures, and the time that it was given; both grow.
    times: VecDeque<(i64, i64)>,
    /// Time that was given last, and the distance that was promised then.
    last: Option<(i64, i64)>,
}

impl Pairing {
    /// Adds the frame that was read next.
    pub(super) fn push_frame(&mut self, frame: EncodedFrame) {
        self.waiting.push_back(frame);
    }

    /// Tells the time that the next picture was given, and the stream's own, if it had one.
    pub(super) fn push_picture(&mut self, stream_nanos: Option<i64>, given_nanos: i64) {
        let Some(stream_nanos) = stream_nanos else { return };
        // Where the stream's own time steps back, what was before tells nothing of what comes.
        if self.times.back().is_some_and(|(before, _)| *before >= stream_nanos) {
            self.times.clear();
        }
        if self.times.len() == MAX_TIMES {
            self.times.pop_front();
        }
        self.times.push_back((stream_nanos, given_nanos));
    }

    /// The next frame whose time is known, its `stream_nanos` what its picture was given.
    pub(super) fn take(&mut self) -> Option<EncodedFrame> {
        let (newest, _) = self.times.back()?;
        let is_known = self.waiting.front()?.stream_nanos.is_none_or(|nanos| nanos <= *newest);
        if is_known || self.waiting.len() > MAX_TIMES { self.take_anyway() } else { None }
    }

    /// The next frame, also if its picture has not come: there will be no more pictures.
    pub(super) fn take_anyway(&mut self) -> Option<EncodedFrame> {
        let mut frame = self.waiting.pop_front()?;
        let given = match frame.stream_nanos {
            Some(nanos) => self.given(nanos).unwrap_or(nanos),
            None => self.last.map_or(0, |(last, interval)| last.saturating_add(interval)),
        };
        self.last = Some((given, frame.interval_nanos.unwrap_or(0).max(1)));
        frame.stream_nanos = Some(given);
        Some(frame)
    }

    /// The time that the picture of stream time `nanos` was given, or would have been.
    fn given(&self, nanos: i64) -> Option<i64> {
        let n_before = self.times.partition_point(|(stream, _)| *stream <= nanos);
        let nearest = self.times.get(n_before.saturating_sub(1))?;
        Some(nearest.1.saturating_add(nanos.saturating_sub(nearest.0)))
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
        pairing.push_picture(Some(100_000_000), 0);
        assert_eq!(taken(&mut pairing), [0]);
        pairing.push_picture(Some(140_000_000), 40_000_000);
        pairing.push_picture(Some(180_000_000), 80_000_000);
        assert!(taken(&mut pairing).is_empty(), "the second is decoded before the third and fourth");
        // This one was given another time than the stream's own distance says.
        pairing.push_picture(Some(220_000_000), 125_000_000);
        assert_eq!(taken(&mut pairing), [125, 40, 80]);
    }

    #[test]
    fn a_frame_without_a_picture_is_timed_by_those_around_it() {
        let mut pairing = Pairing::default();
        reading(&mut pairing, &[Some(0), Some(40), None, Some(120), Some(160)]);
        pairing.push_picture(Some(0), 500_000_000);
        pairing.push_picture(Some(120_000_000), 620_000_000);
        assert_eq!(taken(&mut pairing), [500, 540, 580, 620]);
        assert_eq!(pairing.take_anyway().unwrap().stream_nanos, Some(660_000_000));
        assert!(pairing.take_anyway().is_none());
    }

    #[test]
    fn frames_of_a_decoder_that_shows_nothing_more_do_not_pile_up() {
        let mut pairing = Pairing::default();
        reading(&mut pairing, &[Some(0)]);
        pairing.push_picture(Some(0), 0);
        assert_eq!(taken(&mut pairing), [0]);
        let later: Vec<_> = (1..=100).map(|i| Some(40 * i)).collect();
        reading(&mut pairing, &later);
        assert_eq!(taken(&mut pairing).len(), 100 - MAX_TIMES);
    }
}
