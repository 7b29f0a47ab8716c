//! Section `[camera.clock]`: how a camera's own time becomes scene time.

use super::source::{SourceSettings, as_text, timestamp};
use super::validate::range;
use crate::clock::Timestamp;
use crate::error::Gatherer;
use serde::{Deserialize, Serialize};

/// Furthest that a camera's clock may be off, seconds: a century.
const MAX_OFFSET_SECS: f64 = 3.2e9;

/// Fastest that a camera's clock may drift, parts per million: a minute in 17.
const MAX_DRIFT_PPM: f64 = 1e6 / 17.0;

/// Furthest that a clock is off which was set wrong, time zones included, seconds.
const USUAL_OFFSET_SECS: f64 = 86_400.0;

/// Fastest that a clock drifts which is not broken, parts per million.
const USUAL_DRIFT_PPM: f64 = 1000.0;

/// What is wrong with a camera's clock: where it says `t`, scene time is `t + offset + drift * (t - since)`.
///
/// Of a file without a `start` this moves it against the others that begin with the daemon: it begins later, or what lies
/// before their beginning is left out.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClockSettings {
    /// Seconds that are added to the camera's time, at most a century. Default 0.
    pub offset_secs: f64,
    /// Millionths that scene time runs faster than the camera's own. Default 0.
    pub drift_ppm: f64,
    /// When the offset alone was right, by the camera's own time. Default: a file's beginning; a live camera that drifts
    /// needs it.
    #[serde(deserialize_with = "timestamp", serialize_with = "as_text")]
    pub since: Option<Timestamp>,
}

impl ClockSettings {
    /// Scene time where the camera's own is `time`; `since` counts where the settings name none. Saturates.
    #[must_use]
    pub fn scene_time(&self, time: Timestamp, since: Timestamp) -> Timestamp {
        let passed_nanos = time.nanos_since(self.since.unwrap_or(since)) as f64;
        // A cast from float saturates. Offset and drift apart, so that a large one costs the other no digits.
        let drift_nanos = (passed_nanos * self.drift_ppm * 1e-6).round() as i64;
        time.saturating_add_nanos(self.offset_nanos()).saturating_add_nanos(drift_nanos)
    }

    /// Returns true where these mend what clocks do: at the camera's own time `now` scene time is within a day of it, and drifts by a
    /// thousandth at most.
    #[must_use]
    pub fn is_usual(&self, now: Timestamp) -> bool {
        let off_secs = self.scene_time(now, now).nanos_since(now) as f64 * 1e-9;
        let is_near = |secs: f64| secs.abs() <= USUAL_OFFSET_SECS;
        is_near(self.offset_secs) && is_near(off_secs) && self.drift_ppm.abs() <= USUAL_DRIFT_PPM
    }

    /// The settings that bring into step a camera which these leave ahead by `ahead_secs` at the scene time `now`, and which
    /// runs fast by `drift` then. `since` is when its drift counts from where the settings name no instant; none for a live camera,
    /// where they come to name one.
    #[must_use]
    pub fn corrected(
        &self,
        now: Timestamp,
        (ahead_secs, drift): (f64, f64),
        since: Option<Timestamp>,
    ) -> Self {
        // A live camera's drift may count from anywhere: from now.
        let own_now = now.saturating_add_nanos(-self.offset_nanos());
        let own_since = self.since.or(since).unwrap_or(own_now);
        let scene_since = self.scene_time(own_since, own_since);
        let passed_secs = scene_since.nanos_since(now) as f64 * 1e-9;
        let offset_secs = self.offset_secs - (ahead_secs + drift * passed_secs);
        let drift_ppm = ((1.0 + self.drift_ppm * 1e-6) * (1.0 - drift) - 1.0) * 1e6;
        let is_named = self.since.is_some() || since.is_none();
        // To the microsecond and to a thousandth: more digits than anything here is known to.
        Self {
            offset_secs: (offset_secs * 1e6).round() / 1e6,
            drift_ppm: (drift_ppm * 1e3).round() / 1e3,
            since: is_named.then_some(own_since),
        }
    }

    /// The offset, nanoseconds.
    #[must_use]
    pub fn offset_nanos(&self) -> i64 {
        let whole = self.offset_secs.trunc();
        let rest_nanos = ((self.offset_secs - whole) * 1e9).round() as i64;
        (whole as i64).saturating_mul(1_000_000_000).saturating_add(rest_nanos)
    }
}

/// Checks what the types of the settings at `place`, of a camera with that source, cannot say.
pub(super) fn check(clock: &ClockSettings, source: &SourceSettings, place: &str, gatherer: &mut Gatherer) {
    let at = |key: &str| format!("{place}/{key}");
    range(gatherer, &at("offset_secs"), clock.offset_secs, -MAX_OFFSET_SECS, MAX_OFFSET_SECS, "seconds");
    range(gatherer, &at("drift_ppm"), clock.drift_ppm, -MAX_DRIFT_PPM, MAX_DRIFT_PPM, "millionths");
    if clock.drift_ppm != 0.0 && clock.since.is_none() && source.path.is_none() && !gatherer.is_faulty(place)
    {
        let message = "the drift of a live camera needs `since`: the instant from which on it counts";
        gatherer.fault(at("drift_ppm"), message);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_is_more_than_a_day_off_is_not_usual() {
        let now = Timestamp::from_nanos(1_790_000_000_000_000_000);
        let clock = |offset_secs, drift_ppm, since| ClockSettings { offset_secs, drift_ppm, since };
        for (usual, expected) in [
            (clock(0.0, 0.0, None), true),
            (clock(86_400.0, 0.0, None), true),
            (clock(-86_401.0, 0.0, None), false),
            (clock(2.4e9, 0.0, None), false),
            (clock(0.0, 1000.0, None), true),
            (clock(0.0, 1001.0, None), false),
            (clock(0.0, -1000.0, Some(now.saturating_add_nanos(-86_400_000_000_000))), true),
            // A thousandth of half a century.
            (clock(0.0, 1000.0, Some(Timestamp::from_nanos(0))), false),
            (clock(0.0, f64::NAN, None), false),
        ] {
            assert_eq!(usual.is_usual(now), expected, "{usual:?}");
        }
    }

    #[test]
    fn time_is_moved_and_stretched_to_the_nanosecond() {
        let at = Timestamp::from_nanos;
        let origin = at(1_790_000_000_000_000_000);
        let clock = |offset_secs, drift_ppm| ClockSettings { offset_secs, drift_ppm, since: None };
        let moved = |clock: ClockSettings, nanos: i64| {
            clock.scene_time(origin.saturating_add_nanos(nanos), origin).nanos_since(origin)
        };
        assert_eq!(moved(clock(0.0, 0.0), 12_345), 12_345);
        assert_eq!(moved(clock(-10.000_000_001, 0.0), 5), -9_999_999_996);
        assert_eq!(moved(clock(0.0, 100.0), 3_600_000_000_000), 3_600_360_000_000);
        assert_eq!(moved(clock(1e9 + 0.25, 0.0), 0), 1_000_000_000_250_000_000);
        // What is ahead by a known line is in step once that is corrected, whatever was set before.
        // What drifts says since when, or is a file that does so from its beginning.
        let drifting = ClockSettings { since: Some(origin), ..clock(7.25, -40.0) };
        let cases = [
            (clock(0.0, 0.0), None),
            (clock(0.0, 0.0), Some(origin)),
            (clock(7.25, -40.0), Some(origin)),
            (drifting, None),
        ];
        for (before, since) in cases {
            let now = origin.saturating_add_nanos(2_000_000_000_000);
            let corrected = before.corrected(now, (10.5, 100e-6), since);
            for own_secs in [0, 500, 3600] {
                let own = origin.saturating_add_nanos(own_secs * 1_000_000_000);
                let was = before.scene_time(own, origin);
                let ahead = 10.5 + 100e-6 * was.nanos_since(now) as f64 * 1e-9;
                let wrong = corrected.scene_time(own, origin).nanos_since(was) as f64 * 1e-9 + ahead;
                assert!(wrong.abs() < 1e-5, "{before:?} {since:?}: {wrong}");
            }
        }
        let since = ClockSettings { since: Some(at(0)), ..clock(0.0, -1.0) };
        assert_eq!(since.scene_time(at(2_000_000), origin), at(1_999_998));
        for time in [i64::MIN, i64::MAX] {
            let moved = clock(3.2e9, 5e4).scene_time(at(time), at(0));
            assert_eq!(moved.as_nanos().signum(), time.signum());
        }
    }
}
