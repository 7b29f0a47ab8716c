//! Snapshots that the daemon makes by itself, every so often.
//!
//! In: what is to be made how often, and what time it is. One is made after the other; what falls due meanwhile is made once,
//! not again and again. One that comes to nothing is counted and told, and made again when it next falls due.

use super::making::{Maker, Wanted};
use super::{EvidenceError, Snapshots};
use crate::engine::Handle;
use videofields_vision::access::Grants;
use videofields_vision::clock::Timestamp;

/// What is made every so often.
#[derive(Clone, Debug)]
pub struct Scheduled {
    /// By what name.
    pub id: String,
    /// Nanoseconds between two: they fall on whole multiples of it since 1970-01-01, UTC.
    pub period_nanos: i64,
    /// What is made.
    pub wanted: Wanted,
}

/// All that is made so.
#[derive(Debug)]
pub struct Schedule {
    /// With the period in which each was looked at last.
    entries: Vec<(Scheduled, i64)>,
}

impl Schedule {
    /// What falls due after `now`.
    #[must_use]
    pub fn new(scheduled: Vec<Scheduled>, now: Timestamp) -> Self {
        let entry = |of: Scheduled| {
            let period = period(&of, now);
            (of, period)
        };
        Self { entries: scheduled.into_iter().map(entry).collect() }
    }

    /// What has fallen due since it was last asked, once each.
    pub fn due(&mut self, now: Timestamp) -> Vec<Scheduled> {
        let mut due = Vec::new();
        for (scheduled, last) in &mut self.entries {
            let period = period(scheduled, now);
            // A clock that was set back must not silence it until it is where it was.
            let is_due = period > *last;
            *last = period;
            if is_due {
                due.push(scheduled.clone());
            }
        }
        due
    }

    /// Whether people are blurred in what is made by that name.
    #[must_use]
    pub fn blurs_people(&self, id: &str) -> bool {
        self.entries.iter().any(|(of, _)| of.id == id && of.wanted.blur_people.is_some())
    }

    /// Makes what has fallen due; what came of each.
    pub async fn make_due(
        &mut self,
        snapshots: &Snapshots,
        door: &Handle,
        now: Timestamp,
    ) -> Vec<(String, Result<String, EvidenceError>)> {
        let grants = Grants::everything();
        let mut made = Vec::new();
        for Scheduled { id, wanted, .. } in self.due(now) {
            let maker = Maker { user: None, schedule: Some(&id), grants: &grants };
            let record = snapshots.make(door, maker, wanted).await;
            made.push((id, record.map(|record| record.id)));
        }
        made
    }
}

fn period(of: &Scheduled, now: Timestamp) -> i64 {
    now.as_nanos().div_euclid(of.period_nanos.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::At;
    use crate::evidence::Subject;

    fn scheduled(id: &str, period_nanos: i64) -> Scheduled {
        let subject = Subject::Camera { camera: "north".to_owned(), at: At::Live };
        let wanted =
            Wanted { subject, note: String::new(), tags: Vec::new(), hold: false, blur_people: None };
        Scheduled { id: id.to_owned(), period_nanos, wanted }
    }

    #[test]
    fn what_falls_due_is_made_once_however_late() {
        let at = Timestamp::from_nanos;
        let mut schedule = Schedule::new(vec![scheduled("a", 10), scheduled("b", 25)], at(103));
        let mut check = |now: i64, expected: &[&str]| {
            let due: Vec<String> = schedule.due(at(now)).into_iter().map(|of| of.id).collect();
            assert_eq!(due, expected, "{now}");
        };
        check(103, &[]);
        check(109, &[]);
        check(110, &["a"]);
        check(119, &[]);
        check(151, &["a", "b"]);
        check(152, &[]);
        // Set back: from there on it goes on.
        check(20, &[]);
        check(30, &["a", "b"]);
    }
}
