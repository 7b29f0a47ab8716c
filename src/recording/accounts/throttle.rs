//! Log-ins that fail are answered ever more slowly: by the name that is tried, whether it exists or not, together with the address
//! that tries it, so that nobody elsewhere is kept out; and by an address that tries many names.

use std::collections::HashMap;
use std::net::IpAddr;
use std::time::Duration;

/// Failures that cost nothing: of one name at an address, and of an address with any names, since many people may share it.
const FREE: u32 = 4;
const FREE_OF_ADDRESS: u32 = 40;

/// The longest that anybody must wait.
const LONGEST: Duration = Duration::from_secs(60);

/// After so long without a failure all is forgotten.
const FORGOTTEN: Duration = Duration::from_secs(900);

/// Names and addresses that are remembered; a flood of others makes those go first that failed longest ago.
const MAX_REMEMBERED: usize = 4096;

/// Somebody who tries to log in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attempt<'a> {
    /// The name that is tried; one that may be a user's, so that what is remembered is bounded.
    pub name: &'a str,
    /// The address, or the network, that tries it, as far as that is known.
    pub address: Option<IpAddr>,
}

/// Failures so far, by name and address, and by address alone; times are monotonic.
#[derive(Debug, Default)]
pub(super) struct Throttle {
    by_name: HashMap<(String, Option<IpAddr>), Failures>,
    by_address: HashMap<IpAddr, Failures>,
}

/// Failures so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Failures {
    n: u32,
    last: Duration,
}

impl Failures {
    /// 1, 2, 4, ... seconds from the one after the last `free` failure on.
    fn until(self, free: u32) -> Duration {
        let pause = match self.n.checked_sub(free) {
            None | Some(0) => Duration::ZERO,
            Some(n) => Duration::from_secs(1u64 << (n - 1).min(16)).min(LONGEST),
        };
        self.last.saturating_add(pause)
    }
}

impl Throttle {
    /// Returns the time for which somebody must wait at `now`; none where they may try.
    pub(super) fn wait(&self, attempt: Attempt<'_>, now: Duration) -> Option<Duration> {
        let of_name = self.by_name.get(&key(attempt)).map(|failures| failures.until(FREE));
        let of_address = attempt.address.and_then(|address| self.by_address.get(&address));
        let of_address = of_address.map(|failures| failures.until(FREE_OF_ADDRESS));
        let wait = of_name.max(of_address)?.saturating_sub(now);
        (!wait.is_zero()).then_some(wait)
    }

    /// Counts a failure; returns what was known of the address before.
    pub(super) fn failed(&mut self, attempt: Attempt<'_>, now: Duration) -> Option<Failures> {
        count(&mut self.by_name, key(attempt), now);
        // Everybody who comes through a proxy on this machine may have this address.
        let address = attempt.address.filter(|address| !address.is_loopback())?;
        let before = self.by_address.get(&address).copied();
        count(&mut self.by_address, address, now);
        before
    }

    /// Forgets the failures of a name at an address. Of the address all is as it was `before`.
    pub(super) fn succeeded(&mut self, attempt: Attempt<'_>, before: Option<Failures>) {
        self.by_name.remove(&key(attempt));
        if let Some(address) = attempt.address {
            match before {
                Some(before) => drop(self.by_address.insert(address, before)),
                None => drop(self.by_address.remove(&address)),
            }
        }
    }
}

fn key(attempt: Attempt<'_>) -> (String, Option<IpAddr>) {
    (attempt.name.to_owned(), attempt.address)
}

fn count<K: Clone + Eq + std::hash::Hash>(all: &mut HashMap<K, Failures>, key: K, now: Duration) {
    all.retain(|_, failures| now.saturating_sub(failures.last) < FORGOTTEN);
    if all.len() >= MAX_REMEMBERED && !all.contains_key(&key) {
        let oldest = all.iter().min_by_key(|(_, failures)| failures.last).map(|(key, _)| key.clone());
        oldest.map(|oldest| all.remove(&oldest));
    }
    let failures = all.entry(key).or_insert(Failures { n: 0, last: now });
    *failures = Failures { n: failures.n.saturating_add(1), last: now };
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn secs(secs: u64) -> Duration {
        Duration::from_secs(secs)
    }

    fn attempt(name: &str, last: u8) -> Attempt<'_> {
        Attempt { name, address: (last > 0).then(|| IpAddr::from([10, 0, 0, last])) }
    }

    #[test]
    fn who_fails_waits_twice_as_long_each_time() {
        for place in [0, 1] {
            let mut throttle = Throttle::default();
            for _ in 0..FREE {
                assert_eq!(throttle.wait(attempt("a", place), secs(0)), None);
                throttle.failed(attempt("a", place), secs(0));
            }
            let mut now = secs(0);
            for expected in [1, 2, 4, 8, 16, 32, 60, 60] {
                throttle.failed(attempt("a", place), now);
                assert_eq!(throttle.wait(attempt("a", place), now), Some(secs(expected)));
                assert_eq!(throttle.wait(attempt("b", place), now), None, "others do not wait");
                now += secs(expected);
                assert_eq!(throttle.wait(attempt("a", place), now), None);
            }
            throttle.failed(attempt("a", place), now + FORGOTTEN);
            assert_eq!(throttle.wait(attempt("a", place), now + FORGOTTEN), None, "all before is forgotten");
            throttle.succeeded(attempt("a", place), None);
            assert!(throttle.by_name.is_empty());
        }
    }

    #[test]
    fn a_stranger_elsewhere_keeps_nobody_out() {
        let mut throttle = Throttle::default();
        for _ in 0..30 {
            throttle.failed(attempt("owner", 6), secs(0));
        }
        assert!(throttle.wait(attempt("owner", 6), secs(0)).is_some());
        assert_eq!(throttle.wait(attempt("owner", 7), secs(0)), None);
        assert_eq!(throttle.wait(attempt("owner", 0), secs(0)), None, "where nobody knows from where");
    }

    #[test]
    fn an_address_that_tries_many_names_waits_with_all_of_them() {
        let mut throttle = Throttle::default();
        for idx in 0..=FREE_OF_ADDRESS {
            assert_eq!(throttle.wait(attempt("next", 6), secs(0)), None, "{idx}");
            throttle.failed(attempt(&format!("name{idx}"), 6), secs(0));
        }
        assert_eq!(throttle.wait(attempt("next", 6), secs(0)), Some(secs(1)));
        assert_eq!(throttle.wait(attempt("next", 7), secs(0)), None);
        // A right password makes nobody wait longer.
        let now = secs(1);
        let before = throttle.failed(attempt("next", 6), now);
        throttle.succeeded(attempt("next", 6), before);
        assert_eq!(throttle.wait(attempt("other", 6), now), None);
    }

    #[test]
    fn this_machine_s_own_address_is_that_of_many_people() {
        let mut throttle = Throttle::default();
        let address = Some(IpAddr::from([127, 0, 0, 1]));
        for idx in 0..2 * FREE_OF_ADDRESS {
            let name = format!("name{idx}");
            throttle.failed(Attempt { name: &name, address }, secs(0));
        }
        assert_eq!(throttle.wait(Attempt { name: "next", address }, secs(0)), None);
    }

    #[test]
    fn few_names_and_addresses_are_remembered() {
        let mut throttle = Throttle::default();
        for idx in 0..MAX_REMEMBERED as u32 + 10 {
            let (name, address) = (idx.to_string(), Some(IpAddr::from(idx.to_be_bytes())));
            throttle.failed(Attempt { name: &name, address }, Duration::from_millis(idx.into()));
        }
        assert_eq!((throttle.by_name.len(), throttle.by_address.len()), (MAX_REMEMBERED, MAX_REMEMBERED));
        let is_known = |idx: u32| throttle.by_address.contains_key(&IpAddr::from(idx.to_be_bytes()));
        assert!(!is_known(3) && is_known(10));
    }
}
