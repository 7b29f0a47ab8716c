//! Where one segment ends and the next begins, by the times of the frames alone.

use crate::telemetry::RecordingDrop;
use videofields_vision::clock::Timestamp;

/// A longer pause between two frames is a gap, and gaps lie between segments.
const GAP_NANOS: i64 = 5_000_000_000;

/// Frames in decoding order step back in time by this at most: some ten frames of a slow camera.
const REORDER_NANOS: i64 = 1_000_000_000;

/// One camera's segments.
#[derive(Debug)]
pub(super) struct Boundaries {
    segment_nanos: i64,
    open: Option<Span>,
    /// A span in which something is recorded already.
    barred: Option<(Timestamp, Timestamp)>,
    /// Whether frames are left out up to the next key frame.
    needs_key: bool,
}

#[derive(Debug)]
struct Span {
    first_at: Timestamp,
    newest: Timestamp,
    newest_key: Timestamp,
    /// What is recorded already begins here.
    ceiling: Option<Timestamp>,
}

/// A frame as far as it matters here.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub at: Timestamp,
    pub is_key: bool,
    pub format: Format,
}

/// Whether a frame fits to those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Same,
    Changed,
}

/// What is done with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// It goes on in the open segment.
    Append,
    /// A segment begins with it, if nothing is recorded there yet.
    Begin,
    /// It is left out.
    Drop(RecordingDrop),
}

impl Boundaries {
    pub(super) fn new(segment_secs: u32) -> Self {
        let segment_nanos = i64::from(segment_secs) * 1_000_000_000;
        Self { segment_nanos, open: None, barred: None, needs_key: true }
    }

    /// From now on files end after so many seconds, the open one too.
    pub(super) fn set_segment_secs(&mut self, segment_secs: u32) {
        self.segment_nanos = i64::from(segment_secs) * 1_000_000_000;
    }

    /// What is done with a frame, and whether the open segment ends before it.
    pub(super) fn judge(&mut self, moment: Moment) -> (Verdict, bool) {
        let has_ended = self.open.as_ref().is_some_and(|span| span.ends_before(moment, self.segment_nanos));
        if has_ended {
            self.end();
        }
        let Moment { at, is_key, .. } = moment;
        let Some(span) = &mut self.open else {
            let is_barred = self.barred.is_some_and(|(from, to)| from <= at && at <= to);
            let verdict = match (is_key, is_barred) {
                (true, false) => Verdict::Begin,
                (true, true) => Verdict::Drop(RecordingDrop::Overlap),
                (false, _) => Verdict::Drop(RecordingDrop::NoKeyFrame),
            };
            return (verdict, has_ended);
        };
        if self.needs_key && !is_key {
            return (Verdict::Drop(RecordingDrop::NoKeyFrame), false);
        }
        // What is decoded after a key frame is seen after all that was decoded before it, or leads up to the key frame
        // itself; a key frame that does not come later than what there is begins a past that was recorded.
        if at < span.first_at || is_key && at <= span.newest {
            self.needs_key |= is_key;
            return (Verdict::Drop(RecordingDrop::OutOfOrder), false);
        }
        self.needs_key = false;
        span.newest = span.newest.max(at);
        if is_key {
            span.newest_key = at;
        }
        (Verdict::Append, false)
    }

    /// A segment was begun; `ceiling` is where the next one begins that is there already.
    pub(super) fn begun(&mut self, at: Timestamp, ceiling: Option<Timestamp>) {
        self.needs_key = false;
        self.open = Some(Span { first_at: at, newest: at, newest_key: at, ceiling });
    }

    /// Something is recorded already from `from` to `to`.
    pub(super) fn bar(&mut self, from: Timestamp, to: Timestamp) {
        self.barred = Some((from, to));
    }

    /// The open segment ended, whatever came.
    pub(super) fn end(&mut self) {
        if let Some(span) = self.open.take() {
            self.bar(span.first_at, span.newest);
        }
        self.needs_key = true;
    }
}

impl Span {
    fn ends_before(&self, Moment { at, is_key, format }: Moment, segment_nanos: i64) -> bool {
        let is_full = is_key && at > self.newest && at.nanos_since(self.first_at) >= segment_nanos;
        is_full
            || format == Format::Changed
            || at.nanos_since(self.newest) > GAP_NANOS
            || self.newest_key.nanos_since(at) > REORDER_NANOS
            || self.ceiling.is_some_and(|ceiling| at >= ceiling)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(millis: i64) -> Timestamp {
        Timestamp::from_nanos(millis * 1_000_000)
    }

    fn delta(millis: i64) -> Moment {
        Moment { at: at(millis), is_key: false, format: Format::Same }
    }

    fn key(millis: i64) -> Moment {
        Moment { is_key: true, ..delta(millis) }
    }

    const NO_KEY: Verdict = Verdict::Drop(RecordingDrop::NoKeyFrame);
    const LATE: Verdict = Verdict::Drop(RecordingDrop::OutOfOrder);
    const OVERLAP: Verdict = Verdict::Drop(RecordingDrop::Overlap);

    /// Feeds frames, `k` before the time of a key frame, and holds each to what is expected of it.
    fn check(boundaries: &mut Boundaries, frames: &[(&str, Verdict, bool)]) {
        for (text, verdict, has_ended) in frames {
            let (text, is_key) = text.strip_prefix('k').map_or((*text, false), |text| (text, true));
            let millis = text.parse().unwrap();
            assert_eq!(
                boundaries.judge(if is_key { key(millis) } else { delta(millis) }),
                (*verdict, *has_ended),
                "{millis}"
            );
            if *verdict == Verdict::Begin {
                boundaries.begun(at(millis), None);
            }
        }
    }

    #[test]
    fn segments_begin_with_key_frames_and_end_at_the_first_after_their_time() {
        use Verdict::{Append, Begin};
        check(
            &mut Boundaries::new(10),
            &[
                ("0", NO_KEY, false),
                ("k40", Begin, false),
                ("160", Append, false),
                ("80", Append, false),
                ("k5040", Append, false),
                ("10039", Append, false),
                ("k10040", Begin, true),
                ("k10080", Append, false),
                ("13000", Append, false),
                ("18001", NO_KEY, true),
                ("k18041", Begin, false),
            ],
        );
    }

    #[test]
    fn time_that_steps_back_records_nothing_twice() {
        use Verdict::{Append, Begin};
        check(
            &mut Boundaries::new(60),
            &[
                ("k1000", Begin, false),
                ("900", LATE, false),
                ("3000", Append, false),
                // A key frame that is not the newest: what follows it was seen before.
                ("k2900", LATE, false),
                ("3100", NO_KEY, false),
                ("k3200", Append, false),
                // Leads up to the key frame.
                ("3150", Append, false),
                ("1900", NO_KEY, true),
                ("k2000", OVERLAP, false),
                ("k3200", OVERLAP, false),
                ("k500", Begin, false),
            ],
        );
    }

    #[test]
    fn another_format_and_what_is_recorded_already_end_a_segment() {
        let mut boundaries = Boundaries::new(60);
        boundaries.begun(at(0), Some(at(2000)));
        assert_eq!(boundaries.judge(delta(1999)), (Verdict::Append, false));
        assert_eq!(boundaries.judge(delta(2000)), (NO_KEY, true));
        boundaries.begun(at(5000), None);
        let changed = |moment| Moment { format: Format::Changed, ..moment };
        assert_eq!(boundaries.judge(changed(delta(5040))), (NO_KEY, true));
        boundaries.begun(at(5000), None);
        assert_eq!(boundaries.judge(changed(key(5040))), (Verdict::Begin, true));
    }

    proptest! {
        #![proptest_config(super::super::tests::seeded(500))]
        #[test]
        fn segments_never_overlap_the_one_before(
            steps in prop::collection::vec((-3000_i64..3000, any::<bool>()), 1..200),
        ) {
            let mut boundaries = Boundaries::new(5);
            let (mut millis, mut segments) = (0, Vec::<Vec<i64>>::new());
            for (step, is_key) in steps {
                // Mostly forward, as time goes.
                millis += if step > -2500 { step.abs() } else { 4 * step };
                match boundaries.judge(if is_key { key(millis) } else { delta(millis) }).0 {
                    Verdict::Begin => {
                        boundaries.begun(at(millis), None);
                        segments.push(vec![millis]);
                    }
                    Verdict::Append => segments.last_mut().unwrap().push(millis),
                    Verdict::Drop(_) => {}
                }
            }
            for pair in segments.windows(2) {
                let (first, last) = (pair[0][0], pair[0].iter().max().unwrap());
                prop_assert!(pair[1][0] > *last || pair[1][0] < first, "{:?}", pair);
            }
            for segment in &segments {
                prop_assert!(segment.iter().all(|millis| *millis >= segment[0]));
            }
        }
    }
}
