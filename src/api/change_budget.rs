//! Bounds how much one user can change, since every change is an entry of the audit log.
//!
//! A user has a number of changes at hand ([`ChangeKind::most`]), and gets one back each [`INTERVAL`] (the generic cell rate algorithm,
//! ITU-T I.371). Administrators are not bounded, nor is anybody while there are no users. A request that was refused counts for nothing:
//! refusals have bounds of their own in the audit log.

use super::Api;
use super::error::Problem;
use super::openapi::Verb;
use super::{described, session, tokens};
use axum::http::{Method, Uri};
use std::collections::{BTreeSet, HashMap};
use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Time after which a user has one change more.
const INTERVAL: Duration = Duration::from_secs(1);

/// Users that are remembered before those are forgotten who have all of their changes.
const MANY_USERS: usize = 256;

/// Paths of questions that are asked by POST and change nothing; it follows from the program alone.
static QUESTIONS: LazyLock<BTreeSet<&'static str>> = LazyLock::new(|| {
    let questions = described().routes.into_iter();
    let questions = questions.filter(|route| route.verb == Verb::Post && route.operation.keeps_nothing);
    questions.map(|route| route.path).collect()
});

/// Returns true for a request that may change something: no GET or HEAD, no question that keeps nothing, no validation alone.
pub(super) fn is_change(method: &Method, route: &str, uri: &Uri) -> bool {
    match *method {
        Method::GET | Method::HEAD => false,
        Method::POST if QUESTIONS.contains(route) => false,
        _ => !is_validation(uri),
    }
}

/// Returns true for a request that says that nothing is to be kept; routes that do not know the word refuse it.
fn is_validation(uri: &Uri) -> bool {
    uri.query().is_some_and(|query| query.split('&').any(|part| part == "validate_only=true"))
}

/// Returns true for a change that counts when it is asked for. Log-ins are counted where the password is known to be right; what ends a
/// session or a token is possible as often as there was one, and must be while somebody else uses up the user's changes.
pub(super) fn is_counted(method: &Method, route: &str) -> bool {
    let ends_token = *method == Method::DELETE && route == tokens::ONE;
    route != session::PATH && !ends_token
}

/// Kinds of changes, each with a budget of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum ChangeKind {
    /// Log-in by password.
    LogIn,
    /// Any other.
    Other,
}

impl ChangeKind {
    /// Returns the changes that a user can make at once who made none for long. Playheads are dragged; sessions are 64 at most.
    const fn most(self) -> u32 {
        match self {
            Self::LogIn => 100,
            Self::Other => 1000,
        }
    }

    const fn plural(self) -> &'static str {
        match self {
            Self::LogIn => "log-ins",
            Self::Other => "changes",
        }
    }
}

/// Changes that users have left, by user and kind: the monotonic time at which each has all of them again.
#[derive(Debug, Default)]
pub(super) struct ChangeBudget(Mutex<HashMap<(String, ChangeKind), Duration>>);

impl ChangeBudget {
    /// Spends a change of that user's at `now` (monotonic).
    ///
    /// # Errors
    /// The time until there is one, where none is left.
    pub(super) fn spend(&self, (user, kind): (&str, ChangeKind), now: Duration) -> Result<(), Duration> {
        let mut whole_at = self.lock();
        if whole_at.len() >= MANY_USERS {
            whole_at.retain(|_, whole_at| *whole_at > now);
        }
        let key = (user.to_owned(), kind);
        let next = whole_at.get(&key).copied().unwrap_or(now).max(now) + INTERVAL;
        let wait = next.saturating_sub(now + INTERVAL * kind.most());
        if !wait.is_zero() {
            return Err(wait);
        }
        whole_at.insert(key, next);
        Ok(())
    }

    /// Gives a change back that came to nothing.
    pub(super) fn give_back(&self, user: &str) {
        if let Some(whole_at) = self.lock().get_mut(&(user.to_owned(), ChangeKind::Other)) {
            *whole_at = whole_at.saturating_sub(INTERVAL);
        }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<(String, ChangeKind), Duration>> {
        // A panic leaves it whole: times are changed one by one.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Api {
    /// Spends a change of that user's.
    ///
    /// # Errors
    /// [`ErrorKind::Throttled`](videofields_vision::error::ErrorKind::Throttled), if none is left.
    pub(super) fn spend_change(&self, user: &str, kind: ChangeKind) -> Result<(), Problem> {
        let spent = self.change_budget.spend((user, kind), self.clock.monotonic());
        spent.map_err(|wait| {
            let secs = INTERVAL.as_secs();
            let (most, what) = (kind.most(), kind.plural());
            let detail =
                format!("this user made {most} {what} in a short time: one more is possible every {secs} s");
            Problem::throttled(detail, wait)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OTHER: ChangeKind = ChangeKind::Other;

    const fn millis(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    #[test]
    fn a_user_has_so_many_changes_and_one_more_each_second() {
        let budget = ChangeBudget::default();
        let start = millis(5_000);
        for _ in 0..OTHER.most() {
            assert_eq!(budget.spend(("ann", OTHER), start), Ok(()));
        }
        assert_eq!(budget.spend(("ann", OTHER), start), Err(INTERVAL));
        assert_eq!(budget.spend(("ann", OTHER), start + millis(300)), Err(millis(700)));
        assert_eq!(budget.spend(("bob", OTHER), start), Ok(()), "another's are its own");
        assert_eq!(budget.spend(("ann", ChangeKind::LogIn), start), Ok(()), "and so are log-ins");
        assert_eq!(budget.spend(("ann", OTHER), start + INTERVAL), Ok(()));
        assert_eq!(budget.spend(("ann", OTHER), start + INTERVAL), Err(INTERVAL), "a refusal costs nothing");
        budget.give_back("ann");
        assert_eq!(budget.spend(("ann", OTHER), start + INTERVAL), Ok(()));
        // A long wait gives no more than there was at first.
        let later = start + INTERVAL * OTHER.most() * 3;
        assert!((0..OTHER.most()).all(|_| budget.spend(("ann", OTHER), later).is_ok()));
        assert_eq!(budget.spend(("ann", OTHER), later), Err(INTERVAL));
    }

    #[test]
    fn users_who_have_all_of_their_changes_are_forgotten() {
        let budget = ChangeBudget::default();
        budget.spend(("busy", OTHER), millis(0)).unwrap();
        budget.spend(("busy", OTHER), millis(0)).unwrap();
        for n in 1..MANY_USERS {
            budget.spend((&format!("user-{n}"), OTHER), millis(0)).unwrap();
        }
        budget.spend(("last", OTHER), millis(1_500)).unwrap();
        let mut left: Vec<String> = budget.lock().keys().map(|(user, _)| user.clone()).collect();
        left.sort();
        assert_eq!(left, ["busy", "last"]);
        budget.give_back("nobody");
    }

    #[test]
    fn questions_and_validations_change_nothing() {
        let check = |method: Method, route: &str, uri: &str| is_change(&method, route, &uri.parse().unwrap());
        let solve = "/api/v1/calibrations/solve";
        assert!(!check(Method::POST, solve, solve));
        assert!(check(Method::PUT, "/api/v1/calibrations/{camera}", solve), "a camera of that name");
        assert!(check(Method::POST, "/api/v1/tokens", "/api/v1/tokens"));
        assert!(!check(Method::GET, "/api/v1/tokens", "/api/v1/tokens"));
        assert!(!check(Method::HEAD, "/api/v1/tokens", "/api/v1/tokens"));
        let view = "/api/v1/views/{id}";
        assert!(!check(Method::PUT, view, "/api/v1/views/a?validate_only=true"));
        assert!(check(Method::PUT, view, "/api/v1/views/a?validate_only=false"));
        assert_eq!(QUESTIONS.len(), 3, "{QUESTIONS:?}");
    }
}
