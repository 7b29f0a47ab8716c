//! When a frame is due, and when it is too late: real-time playing of stream time against the monotonic clock.

use std::time::Duration;

/// Lateness that is always forgiven; a source with long frame intervals is forgiven two of them.
const FORGIVEN: Duration = Duration::from_millis(250);

/// Longest time without a delivered frame, however late all are.
const STARVED: Duration = Duration::from_secs(1);

/// A source later than this is not caught up with: its time jumps to where real time stands.
const HOPELESS: Duration = Duration::from_secs(30);

/// What becomes of a frame whose time has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// It is delivered.
    Deliver,
    /// It is too late and left out, so that newer ones may be on time.
    Drop,
}

/// Maps stream time to monotonic time. Stream time 0 is the same instant for all cameras that begin together: one
/// whose first frame comes late leaves frames out until it has caught up, so that clips which belong together stay
/// together. One that is hopelessly late, from its start or because it decodes more slowly than real time, jumps to
/// where real time stands. Stream time runs on when a source begins anew, no earlier than real time stands.
#[derive(Debug)]
pub(super) struct Pacer {
    /// Monotonic time of stream time 0.
    began: Duration,
    /// Whether any source began before the one at hand.
    has_begun: bool,
    /// What is added to the present source's own stream time; `None` until its first frame.
    offset_nanos: Option<i64>,
    /// Stream time of the frame at hand.
    stream_nanos: i64,
    /// From the frame before it to the frame at hand.
    interval_nanos: i64,
    delivered: Option<Duration>,
}

impl Pacer {
    /// A pacer whose stream time 0 is monotonic time `began`.
    pub(super) const fn new(began: Duration) -> Self {
        Self {
            began,
            has_begun: false,
            offset_nanos: None,
            stream_nanos: 0,
            interval_nanos: 0,
            delivered: None,
        }
    }

    /// Tells that the next frame is the first of a source opened anew.
    pub(super) const fn begin(&mut self) {
        self.offset_nanos = None;
    }

    /// When a frame is due that came at `now` with the source's stream time `source_nanos`.
    pub(super) fn due(&mut self, now: Duration, source_nanos: i64) -> Duration {
        let elapsed_nanos = i64::try_from(now.saturating_sub(self.began).as_nanos()).unwrap_or(i64::MAX);
        let is_first_source = !self.has_begun;
        let mut offset_nanos = *self.offset_nanos.get_or_insert_with(|| {
            let next_nanos = self.stream_nanos.saturating_add(self.interval_nanos.max(1));
            // What begins with the daemon is due at its own times; one that is opened later goes on from there.
            if is_first_source { 0 } else { elapsed_nanos.max(next_nanos).saturating_sub(source_nanos) }
        });
        self.has_begun = true;
        let late_nanos = elapsed_nanos.saturating_sub(offset_nanos.saturating_add(source_nanos));
        if nanos(late_nanos) > HOPELESS {
            tracing::warn!(late = ?nanos(late_nanos), "too late to catch up: the camera's time jumps to the present");
            offset_nanos = offset_nanos.saturating_add(late_nanos);
            self.offset_nanos = Some(offset_nanos);
        }
        let stream_nanos = offset_nanos.saturating_add(source_nanos);
        self.interval_nanos = stream_nanos.saturating_sub(self.stream_nanos).max(0);
        self.stream_nanos = stream_nanos;
        self.began.saturating_add(nanos(stream_nanos))
    }

    /// What becomes of the frame last asked for, at `now`.
    pub(super) fn turn(&mut self, now: Duration) -> Turn {
        let due = self.began.saturating_add(nanos(self.stream_nanos));
        let is_late = now.saturating_sub(due) > FORGIVEN.max(nanos(self.interval_nanos.saturating_mul(2)));
        let is_starved = self.delivered.is_none_or(|delivered| now.saturating_sub(delivered) >= STARVED);
        if is_late && !is_starved {
            return Turn::Drop;
        }
        self.delivered = Some(now);
        Turn::Deliver
    }

    /// What is added to the present source's own stream time, nanoseconds; 0 before its first frame.
    pub(super) fn offset_nanos(&self) -> i64 {
        self.offset_nanos.unwrap_or(0)
    }

    /// Stream time of the frame last asked for, nanoseconds.
    pub(super) const fn stream_nanos(&self) -> i64 {
        self.stream_nanos
    }
}

fn nanos(nanos: i64) -> Duration {
    Duration::from_nanos(u64::try_from(nanos).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: i64 = 40_000_000;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn frames_are_due_at_their_stream_time_after_the_beginning() {
        let mut pacer = Pacer::new(ms(700));
        assert_eq!(pacer.due(ms(700), 0), ms(700));
        assert_eq!(pacer.due(ms(705), FRAME), ms(740));
        assert_eq!(pacer.stream_nanos(), FRAME);
    }

    #[test]
    fn late_frames_are_left_out_until_one_is_in_time_or_a_second_has_passed() {
        let mut pacer = Pacer::new(ms(0));
        let mut turn = |now, n: i64| {
            pacer.due(ms(now), n * FRAME);
            pacer.turn(ms(now))
        };
        assert_eq!(turn(0, 0), Turn::Deliver);
        assert_eq!(turn(290, 1), Turn::Deliver, "250 ms late is forgiven");
        assert_eq!(turn(331, 2), Turn::Drop, "251 ms late is not");
        assert_eq!(turn(332, 3), Turn::Deliver);
        assert_eq!(turn(1331, 4), Turn::Drop);
        assert_eq!(turn(1332, 5), Turn::Deliver, "a second without a frame is long enough");
        let mut slow = Pacer::new(ms(0));
        slow.due(ms(0), 0);
        assert_eq!(slow.turn(ms(0)), Turn::Deliver);
        slow.due(ms(0), 400_000_000);
        assert_eq!(slow.turn(ms(1_200)), Turn::Deliver, "two intervals are forgiven");
    }

    #[test]
    fn a_source_that_begins_anew_goes_on_where_real_time_stands() {
        let mut pacer = Pacer::new(ms(100));
        pacer.due(ms(100), 0);
        pacer.due(ms(100), FRAME);
        pacer.begin();
        assert_eq!(pacer.due(ms(5_100), 7), ms(5_100));
        assert_eq!(pacer.stream_nanos(), 5_000_000_000);
        pacer.due(ms(5_100), FRAME + 7);
        pacer.begin();
        pacer.due(ms(5_100), 0);
        assert_eq!(pacer.stream_nanos(), 5_000_000_000 + 2 * FRAME, "never backwards, though real time lags");
    }

    #[test]
    fn a_camera_whose_first_frame_comes_late_catches_up_with_the_others() {
        let mut pacer = Pacer::new(ms(1_000));
        assert_eq!(pacer.due(ms(3_000), 0), ms(1_000));
        assert_eq!(pacer.turn(ms(3_000)), Turn::Deliver, "a first picture is shown however late it is");
        for n in 1..44 {
            pacer.due(ms(3_000), n * FRAME);
            assert_eq!(pacer.turn(ms(3_000)), Turn::Drop, "{n}");
        }
        pacer.due(ms(3_000), 44 * FRAME);
        assert_eq!(pacer.turn(ms(3_000)), Turn::Deliver);
        assert_eq!(pacer.stream_nanos(), 44 * FRAME);
    }

    #[test]
    fn a_hopelessly_late_source_jumps_to_the_present() {
        let mut late = Pacer::new(ms(0));
        assert_eq!(late.due(ms(3_600_000), 5), ms(3_600_000));
        assert_eq!(late.due(ms(3_600_001), FRAME + 5), ms(3_600_040));
        // Decoded at half of real time: never more than half a minute behind.
        let mut slow = Pacer::new(ms(0));
        for n in 0..5_000_i64 {
            let now = ms(n as u64 * 80);
            let due = slow.due(now, n * FRAME);
            assert!(now.saturating_sub(due) <= HOPELESS, "frame {n}");
        }
    }

    #[test]
    fn extreme_times_saturate() {
        let mut pacer = Pacer::new(ms(0));
        pacer.due(ms(1), i64::MIN);
        assert!(pacer.due(ms(1), i64::MAX) > ms(1));
        pacer.begin();
        pacer.due(Duration::MAX, i64::MAX);
        assert_eq!(pacer.turn(Duration::MAX), Turn::Deliver);
    }
}
