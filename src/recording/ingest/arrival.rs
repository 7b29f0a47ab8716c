//! Scene time of live frames: when the camera says that they were taken, else when they came, less the jitter of the way.
//!
//! In: clocks' readings at a frame's arrival, its stream time and, where the camera tells it, the time of capture. Out:
//! scene time, which never runs backwards and never repeats. Knows no source and no thread.
//!
//! Jitter only ever delays, so the least of arrival less stream time is what the way itself takes. That lower edge is
//! followed down at once and up by at most [`DRIFT_PPM`], which is more than two clocks drift apart.

use crate::media::TICK_NANOS;
use std::time::Duration;
use videofields_vision::clock::Timestamp;

/// How fast the lower edge rises, parts per million of time.
const DRIFT_PPM: i64 = 500;

/// An arrival further from the lower edge than this is no jitter: the stream's own time was set anew.
const MAX_JITTER_NANOS: i64 = 5_000_000_000;

/// A time of capture further from arrival than this is a camera's clock that nobody set.
const MAX_REFERENCE_NANOS: i64 = 3_600_000_000_000;

/// How long a time of capture counts for the frames behind it that have none.
const REFERENCE_LASTS_NANOS: i64 = 30_000_000_000;

/// Least pace of scene time while it is ahead of what it should be: it goes on at nine tenths until it is not.
const LEAST_PACE_TENTHS: i64 = 9;

/// Least pace while a connection is young: its first pictures come late, since their decoder is started meanwhile.
const YOUNG_PACE_TENTHS: i64 = 4;

/// Time for which a connection is young.
const YOUNG_NANOS: i64 = 2_000_000_000;

/// What is known of a frame when it comes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival {
    /// Wall-clock time.
    pub(super) now: Timestamp,
    /// Monotonic time.
    pub(super) monotonic: Duration,
    /// The frame's own stream time, nanoseconds.
    pub(super) stream_nanos: i64,
    /// When the camera says that it was taken.
    pub(super) reference: Option<Timestamp>,
}

/// The scene time of one camera's frames, through all its connections.
#[derive(Debug, Default)]
pub(super) struct ArrivalClock {
    /// Least arrival less stream time, and the monotonic time at which it was looked at last.
    edge: Option<Stand>,
    /// Time of capture less stream time, and the monotonic time of the last frame that told it.
    reference: Option<Stand>,
    latest: Option<Latest>,
    /// Monotonic time of the connection's first frame.
    begun_nanos: Option<i64>,
    has_warned: bool,
}

#[derive(Clone, Copy, Debug)]
struct Stand {
    offset_nanos: i64,
    at_nanos: i64,
}

#[derive(Clone, Copy, Debug)]
struct Latest {
    scene: Timestamp,
    monotonic_nanos: i64,
    stream_nanos: i64,
}

impl ArrivalClock {
    /// Tells that the next frame is the first of a new connection, whose stream time is another.
    pub(super) const fn begin(&mut self) {
        (self.edge, self.reference, self.begun_nanos, self.has_warned) = (None, None, None, false);
    }

    /// The scene time of a frame.
    pub(super) fn stamp(&mut self, arrival: &Arrival) -> Timestamp {
        let monotonic_nanos = i64::try_from(arrival.monotonic.as_nanos()).unwrap_or(i64::MAX);
        let told = self.told(arrival, monotonic_nanos);
        let smooth_nanos = self.smooth(arrival.stream_nanos, monotonic_nanos);
        let early_nanos = monotonic_nanos.saturating_sub(smooth_nanos);
        let target = told.unwrap_or_else(|| arrival.now.saturating_add_nanos(-early_nanos));
        let begun_nanos = *self.begun_nanos.get_or_insert(monotonic_nanos);
        let is_young = monotonic_nanos.saturating_sub(begun_nanos) < YOUNG_NANOS;
        let pace_tenths = if is_young { YOUNG_PACE_TENTHS } else { LEAST_PACE_TENTHS };
        let scene = self.latest.map_or(target, |latest| {
            let step = arrival.stream_nanos.saturating_sub(latest.stream_nanos);
            let passed = monotonic_nanos.saturating_sub(latest.monotonic_nanos).max(0);
            // Stream time that was set anew says nothing of how far apart two frames are.
            let step = if (0..=MAX_JITTER_NANOS).contains(&step) { step } else { passed };
            let least_nanos = (step / 10 * pace_tenths).max(TICK_NANOS);
            target.max(latest.scene.saturating_add_nanos(least_nanos))
        });
        self.latest = Some(Latest { scene, monotonic_nanos, stream_nanos: arrival.stream_nanos });
        scene
    }

    /// Monotonic time at which the frame would have come without jitter: not later than it came.
    fn smooth(&mut self, stream_nanos: i64, monotonic_nanos: i64) -> i64 {
        let offset_nanos = monotonic_nanos.saturating_sub(stream_nanos);
        if self.latest.is_some_and(|latest| stream_nanos < latest.stream_nanos) {
            self.edge = None;
        }
        let offset_nanos = match self.edge {
            Some(edge) if offset_nanos.abs_diff(edge.offset_nanos) <= MAX_JITTER_NANOS.unsigned_abs() => {
                let passed = monotonic_nanos.saturating_sub(edge.at_nanos).max(0);
                let risen = edge.offset_nanos.saturating_add(passed / 1_000_000 * DRIFT_PPM);
                offset_nanos.min(risen)
            }
            _ => offset_nanos,
        };
        self.edge = Some(Stand { offset_nanos, at_nanos: monotonic_nanos });
        stream_nanos.saturating_add(offset_nanos)
    }

    /// When the frame was taken as its camera says: of this frame, or of one shortly before it.
    fn told(&mut self, arrival: &Arrival, monotonic_nanos: i64) -> Option<Timestamp> {
        if let Some(reference) = arrival.reference {
            let off_nanos = reference.nanos_since(arrival.now);
            if off_nanos.unsigned_abs() <= MAX_REFERENCE_NANOS.unsigned_abs() {
                let offset_nanos = reference.as_nanos().saturating_sub(arrival.stream_nanos);
                self.reference = Some(Stand { offset_nanos, at_nanos: monotonic_nanos });
            } else if !self.has_warned {
                self.has_warned = true;
                let off_secs = off_nanos as f64 * 1e-9;
                tracing::warn!(off_secs, "a camera's clock is wrong and not used: is its time set?");
            }
        }
        let stand = self.reference?;
        let is_fresh = monotonic_nanos.saturating_sub(stand.at_nanos) <= REFERENCE_LASTS_NANOS;
        let told = Timestamp::from_nanos(arrival.stream_nanos.saturating_add(stand.offset_nanos));
        // Stream time that was set anew makes an older stand worthless.
        let is_near = told.nanos_since(arrival.now).unsigned_abs() <= MAX_REFERENCE_NANOS.unsigned_abs();
        (is_fresh && is_near).then_some(told)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    #[test]
    fn a_first_picture_that_comes_late_puts_scene_time_ahead_for_less_than_a_second() {
        let mut clock = ArrivalClock::default();
        clock.begin();
        let ahead = (0..40).map(|n| {
            // The first waits 300 ms for its decoder, and so do those that come meanwhile.
            let monotonic_nanos = (n * FRAME).max(300 * MS);
            let arrival = Arrival {
                now: Timestamp::from_nanos(BEGAN + monotonic_nanos),
                monotonic: Duration::from_nanos(monotonic_nanos as u64),
                stream_nanos: n * FRAME,
                reference: None,
            };
            clock.stamp(&arrival).nanos_since(Timestamp::from_nanos(BEGAN + n * FRAME))
        });
        let ahead: Vec<i64> = ahead.collect();
        assert!(ahead.windows(2).all(|pair| pair[1] <= pair[0]), "{ahead:?}");
        assert!(ahead[0] == 300 * MS && ahead[20] < 10 * MS, "{ahead:?}");
    }

    const SEC: i64 = 1_000_000_000;
    const MS: i64 = 1_000_000;
    const FRAME: i64 = 40 * MS;
    /// Wall-clock time of monotonic time 0.
    const BEGAN: i64 = 1_790_000_000 * SEC;

    fn arrival(now_nanos: i64, monotonic_nanos: i64, stream_nanos: i64) -> Arrival {
        Arrival {
            now: Timestamp::from_nanos(now_nanos),
            monotonic: Duration::from_nanos(monotonic_nanos as u64),
            stream_nanos,
            reference: None,
        }
    }

    /// Scene times of frames that come at these monotonic and stream times, on a wall clock that keeps step.
    fn times(frames: &[(i64, i64)]) -> Vec<i64> {
        let mut clock = ArrivalClock::default();
        let stamp = |(at, stream): &(i64, i64)| clock.stamp(&arrival(BEGAN + at, *at, *stream)).as_nanos();
        frames.iter().map(stamp).collect()
    }

    fn assert_grows(times: &[i64]) {
        assert!(times.windows(2).all(|pair| pair[1] - pair[0] >= TICK_NANOS), "{times:?}");
    }

    #[test]
    fn jitter_is_taken_out_once_a_frame_came_without() {
        let jitter = [30, 0, 80, 5, 40, 0, 60].map(|ms| ms * MS);
        let frames: Vec<_> =
            jitter.iter().cycle().zip(1..30).map(|(late, n)| (n * FRAME + late, n * FRAME)).collect();
        let times = times(&frames);
        assert_grows(&times);
        assert_eq!(times[0], BEGAN + FRAME + 30 * MS);
        for (n, time) in (1..).zip(&times).skip(10) {
            let error = time - (BEGAN + n * FRAME);
            assert!((0..=MS).contains(&error), "frame {n}: {error}");
        }
    }

    #[test]
    fn stream_time_that_begins_anew_is_no_jitter() {
        let mut frames: Vec<_> = (1..50).map(|n| (n * FRAME, n * FRAME)).collect();
        frames.extend((50..100).map(|n| (n * FRAME, (n - 50) * FRAME)));
        frames.extend((100..150).map(|n| (n * FRAME, (n + 90_000) * FRAME)));
        let times = times(&frames);
        assert_grows(&times);
        for (time, (at, _)) in times.iter().zip(&frames) {
            assert!((time - BEGAN - at).abs() <= 2 * FRAME, "{time} {at}");
        }
    }

    #[test]
    fn a_wall_clock_that_steps_leaves_a_gap_or_is_waited_for() {
        let run = |step: i64| {
            let mut clock = ArrivalClock::default();
            let mut stamp = |n: i64| {
                let stepped = if n >= 100 { step } else { 0 };
                clock.stamp(&arrival(BEGAN + n * FRAME + stepped, n * FRAME, n * FRAME)).as_nanos()
            };
            (1..1_000).map(&mut stamp).collect::<Vec<_>>()
        };
        let ahead = run(3_600 * SEC);
        assert_grows(&ahead);
        assert_eq!(ahead[99] - ahead[98], 3_600 * SEC + FRAME, "a gap");
        let back = run(-SEC);
        assert_grows(&back);
        assert_eq!(back[99] - back[98], FRAME * 9 / 10, "it runs on, a little slower");
        assert_eq!(back[998], BEGAN + 999 * FRAME - SEC, "until the clock has caught up");
        let far_back = run(-3_600 * SEC);
        assert_grows(&far_back);
        assert!(far_back.windows(2).all(|pair| pair[1] - pair[0] <= FRAME));
    }

    #[test]
    fn a_cameras_own_time_counts_where_it_is_sane() {
        let mut clock = ArrivalClock::default();
        let mut stamp = |n: i64, reference: Option<i64>| {
            let reference = reference.map(Timestamp::from_nanos);
            let arrival = Arrival { reference, ..arrival(BEGAN + n * FRAME, n * FRAME, n * FRAME) };
            clock.stamp(&arrival).as_nanos()
        };
        assert_eq!(stamp(1, None), BEGAN + FRAME);
        // 1970, as of a camera whose clock was never set.
        assert_eq!(stamp(2, Some(0)), BEGAN + 2 * FRAME);
        let taken = |n: i64| BEGAN + n * FRAME - 250 * MS;
        let mut before = stamp(3, Some(taken(3)));
        for n in 4..100 {
            let now = stamp(n, Some(taken(n)).filter(|_| n % 3 == 0));
            assert!(now > before, "frame {n}");
            before = now;
        }
        assert_eq!(before, taken(99), "frames between two that tell their time have theirs too");
        // It tells none any more: after half a minute arrival counts again.
        assert_eq!(stamp(900, None), BEGAN + 900 * FRAME);
    }

    #[test]
    fn extreme_times_saturate() {
        let mut clock = ArrivalClock::default();
        for (now, stream) in [(0, i64::MIN), (i64::MAX, i64::MAX), (i64::MIN, 0), (5, i64::MIN)] {
            clock.stamp(&Arrival { monotonic: Duration::MAX, ..arrival(now, 0, stream) });
            clock.stamp(&arrival(now, 1, stream));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 40,
            rng_seed: RngSeed::Fixed(2004),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        /// Drift of 100 ppm either way, jitter of up to 80 ms that leaves one frame in a few alone.
        #[test]
        fn drift_is_followed_through_jitter(
            drift_ppm in -100_i64..=100,
            late_ms in prop::collection::vec(0_i64..80, 3000),
        ) {
            let mut clock = ArrivalClock::default();
            let (mut latest, mut at) = (i64::MIN, 0);
            for (n, late) in late_ms.iter().enumerate() {
                let stream = n as i64 * FRAME;
                let sent = stream + stream / 1_000_000 * drift_ppm;
                // Frames do not overtake one another.
                at = at.max(sent + if late % 7 == 0 { 0 } else { late * MS });
                let time = clock.stamp(&arrival(BEGAN + at, at, stream)).as_nanos();
                prop_assert!(latest == i64::MIN || time - latest >= TICK_NANOS);
                latest = time;
                if n >= 250 {
                    let error = time - (BEGAN + sent);
                    prop_assert!((-MS..=4 * MS).contains(&error), "frame {n}: {error}");
                }
            }
        }

        /// Whatever clocks and streams do.
        #[test]
        fn time_grows_whatever_happens(
            steps in prop::collection::vec((0_i64..100, -5_000_i64..5_000, -20_000_i64..20_000, 0..20_u8), 1..300),
        ) {
            let mut clock = ArrivalClock::default();
            let (mut monotonic, mut wall, mut stream, mut latest) = (0, BEGAN, 0, i64::MIN);
            for (passed, wall_step, stream_step, what) in steps {
                monotonic += passed * MS;
                wall += passed * MS + if what == 0 { wall_step * SEC } else { 0 };
                stream += if what == 1 { stream_step * MS } else { passed * MS };
                if what == 2 {
                    clock.begin();
                    stream = 0;
                }
                let reference = (what > 15).then(|| Timestamp::from_nanos(wall - 200 * MS + wall_step * MS));
                let time = clock.stamp(&Arrival { reference, ..arrival(wall, monotonic, stream) }).as_nanos();
                prop_assert!(latest == i64::MIN || time - latest >= TICK_NANOS);
                latest = time;
            }
        }
    }
}
