//! Log-ins that fail are answered ever more slowly: by the name that is tried, whether it exists or not.

use std::collections::HashMap;
use std::time::Duration;

/// Failures that cost nothing.
const FREE: u32 = 4;

/// The longest that a name must wait.
const LONGEST: Duration = Duration::from_secs(60);

/// After so long without a failure all is forgotten.
const FORGOTTEN: Duration = Duration::from_secs(900);

/// Names that are remembered; a flood of others makes those go first that failed longest ago.
const MAX_NAMES: usize = 4096;

/// How often names failed, and until when they must wait; times are monotonic.
#[derive(Debug, Default)]
pub(super) struct Throttle(HashMap<String, Failures>);

#[derive(Clone, Copy, Debug)]
struct Failures {
    n: u32,
    last: Duration,
}

impl Failures {
    /// 1, 2, 4, ... seconds from the fifth failure on.
    fn until(self) -> Duration {
        let pause = match self.n.checked_sub(FREE) {
            None | Some(0) => Duration::ZERO,
            Some(n) => Duration::from_secs(1u64 << (n - 1).min(16)).min(LONGEST),
        };
        self.last.saturating_add(pause)
    }
}

impl Throttle {
    /// How long `name` must wait at `now`; none where it may be tried.
    pub(super) fn wait(&self, name: &str, now: Duration) -> Option<Duration> {
        let wait = self.0.get(name)?.until().saturating_sub(now);
        (!wait.is_zero()).then_some(wait)
    }

    pub(super) fn failed(&mut self, name: &str, now: Duration) {
        self.0.retain(|_, failures| now.saturating_sub(failures.last) < FORGOTTEN);
        if self.0.len() >= MAX_NAMES && !self.0.contains_key(name) {
            let oldest =
                self.0.iter().min_by_key(|(_, failures)| failures.last).map(|(name, _)| name.clone());
            oldest.map(|oldest| self.0.remove(&oldest));
        }
        let failures = self.0.entry(name.to_owned()).or_insert(Failures { n: 0, last: now });
        *failures = Failures { n: failures.n.saturating_add(1), last: now };
    }

    pub(super) fn succeeded(&mut self, name: &str) {
        self.0.remove(name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn secs(secs: u64) -> Duration {
        Duration::from_secs(secs)
    }

    #[test]
    fn who_fails_waits_twice_as_long_each_time() {
        let mut throttle = Throttle::default();
        for _ in 0..FREE {
            assert_eq!(throttle.wait("a", secs(0)), None);
            throttle.failed("a", secs(0));
        }
        let mut now = secs(0);
        for expected in [1, 2, 4, 8, 16, 32, 60, 60] {
            throttle.failed("a", now);
            assert_eq!(throttle.wait("a", now), Some(secs(expected)));
            assert_eq!(throttle.wait("b", now), None, "others do not wait");
            now += secs(expected);
            assert_eq!(throttle.wait("a", now), None);
        }
        throttle.failed("a", now + FORGOTTEN);
        assert_eq!(throttle.wait("a", now + FORGOTTEN), None, "all before is forgotten");
        throttle.succeeded("a");
        assert!(throttle.0.is_empty());
    }

    #[test]
    fn few_names_are_remembered() {
        let mut throttle = Throttle::default();
        for idx in 0..MAX_NAMES as u64 + 10 {
            throttle.failed(&idx.to_string(), Duration::from_millis(idx));
        }
        assert_eq!(throttle.0.len(), MAX_NAMES);
        assert!(!throttle.0.contains_key("3") && throttle.0.contains_key("10"));
    }
}
