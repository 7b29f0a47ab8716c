//! Time: UTC instants in nanoseconds, and the one door to the machine's clocks.
//!
//! Nothing else calls `SystemTime::now` or `Instant::now` (clippy refuses it), so tests run on a simulated clock.

use std::fmt;
use std::sync::Mutex;
use std::time::Duration;

/// An instant: nanoseconds since the Unix epoch, UTC. Spans the years 1677 to 2262.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Timestamp(i64);

/// A text that names no instant.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected nanoseconds since 1970-01-01 (UTC) or an RFC 3339 instant such as 2026-03-01T12:00:00.5Z")]
pub struct ParseTimestampError;

impl Timestamp {
    /// The instant `nanos` nanoseconds after the Unix epoch.
    #[must_use]
    pub const fn from_nanos(nanos: i64) -> Self {
        Self(nanos)
    }

    /// Nanoseconds since the Unix epoch.
    #[must_use]
    pub const fn as_nanos(self) -> i64 {
        self.0
    }

    /// The instant `nanos` nanoseconds later (earlier if negative); stops at the ends of the range.
    #[must_use]
    pub const fn saturating_add_nanos(self, nanos: i64) -> Self {
        Self(self.0.saturating_add(nanos))
    }

    /// Nanoseconds from `earlier` to this instant (negative if it is later); stops at the ends of the range.
    #[must_use]
    pub const fn nanos_since(self, earlier: Self) -> i64 {
        self.0.saturating_sub(earlier.0)
    }

    /// Seconds from `earlier` to this instant.
    #[must_use]
    pub fn secs_since(self, earlier: Self) -> f64 {
        self.nanos_since(earlier) as f64 * 1e-9
    }
}

impl fmt::Display for Timestamp {
    /// RFC 3339 in UTC, with as many digits of the second as it has.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match jiff::Timestamp::from_nanosecond(i128::from(self.0)) {
            Ok(instant) => fmt::Display::fmt(&instant, formatter),
            Err(_) => write!(formatter, "{} ns", self.0),
        }
    }
}

impl std::str::FromStr for Timestamp {
    type Err = ParseTimestampError;

    fn from_str(text: &str) -> Result<Self, ParseTimestampError> {
        if let Ok(nanos) = text.parse::<i64>() {
            return Ok(Self(nanos));
        }
        let instant: jiff::Timestamp =
            text.parse().map_err(|_unreadable: jiff::Error| ParseTimestampError)?;
        i64::try_from(instant.as_nanosecond())
            .map(Self)
            .map_err(|_too_far: std::num::TryFromIntError| ParseTimestampError)
    }
}

/// The machine's clocks, or a test's.
pub trait Clock: Send + Sync {
    /// Wall-clock time.
    fn now(&self) -> Timestamp;

    /// Time since an arbitrary start that never steps; what intervals are measured with.
    fn monotonic(&self) -> Duration;

    /// Blocks the calling thread for `duration`.
    fn sleep(&self, duration: Duration);
}

/// The clocks of the machine.
#[derive(Debug)]
pub struct SystemClock {
    start: std::time::Instant,
}

impl SystemClock {
    /// A clock whose monotonic time begins now.
    #[must_use]
    #[expect(clippy::disallowed_methods, reason = "this is the door that everything else goes through")]
    pub fn new() -> Self {
        Self { start: std::time::Instant::now() }
    }
}

impl Default for SystemClock {
    fn default() -> Self {
        Self::new()
    }
}

impl Clock for SystemClock {
    #[expect(clippy::disallowed_methods, reason = "this is the door that everything else goes through")]
    fn now(&self) -> Timestamp {
        let nanos = match std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH) {
            Ok(after) => i64::try_from(after.as_nanos()).unwrap_or(i64::MAX),
            Err(before) => i64::try_from(before.duration().as_nanos()).map_or(i64::MIN, |nanos| -nanos),
        };
        Timestamp(nanos)
    }

    fn monotonic(&self) -> Duration {
        self.start.elapsed()
    }

    fn sleep(&self, duration: Duration) {
        std::thread::sleep(duration);
    }
}

/// A clock that stands still until it is moved; sleeping moves it.
#[derive(Debug)]
pub struct SimulatedClock {
    state: Mutex<(Timestamp, Duration)>,
}

impl SimulatedClock {
    /// A clock that shows `now`.
    #[must_use]
    pub const fn new(now: Timestamp) -> Self {
        Self { state: Mutex::new((now, Duration::ZERO)) }
    }

    /// Moves both times on by `duration`.
    pub fn advance(&self, duration: Duration) {
        let mut state = self.lock();
        state.0 = state.0.saturating_add_nanos(i64::try_from(duration.as_nanos()).unwrap_or(i64::MAX));
        state.1 = state.1.saturating_add(duration);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, (Timestamp, Duration)> {
        self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl Clock for SimulatedClock {
    fn now(&self) -> Timestamp {
        self.lock().0
    }

    fn monotonic(&self) -> Duration {
        self.lock().1
    }

    fn sleep(&self, duration: Duration) {
        self.advance(duration);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_are_read_as_nanoseconds_or_rfc3339() {
        let check = |text: &str, expected: Option<i64>| {
            assert_eq!(text.parse::<Timestamp>().ok(), expected.map(Timestamp::from_nanos), "{text}");
        };
        check("0", Some(0));
        check("-5", Some(-5));
        check("1970-01-01T00:00:01.5Z", Some(1_500_000_000));
        check("1970-01-01T02:00:00+02:00", Some(0));
        check("9223372036854775807", Some(i64::MAX));
        check("9223372036854775808", None);
        check("1500-01-01T00:00:00Z", None);
        check("", None);
        check("live", None);
        check("NaN", None);
        check("1970-01-01", None);
    }

    #[test]
    fn what_is_shown_is_read_back() {
        for nanos in [0, 1, -1, 1_790_000_000_123_456_789, i64::MAX, i64::MIN] {
            let instant = Timestamp::from_nanos(nanos);
            assert_eq!(instant.to_string().parse(), Ok(instant), "{instant}");
        }
    }
}
