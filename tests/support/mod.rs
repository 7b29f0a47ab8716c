//! What several tests share.

pub(crate) mod golden;
pub(crate) mod video;

use std::path::PathBuf;
use std::time::Duration;
use videofields::clock::{Clock, SystemClock};

/// A file or folder of the real footage beside the project, or `None` (and a line on standard error that says
/// what was skipped) where the footage is not at hand.
#[must_use]
pub(crate) fn real_data(path: &str) -> Option<PathBuf> {
    let full = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(path);
    if full.try_exists().unwrap_or(false) {
        return Some(full);
    }
    #[expect(clippy::print_stderr, reason = "a skipped test says so where a person looks")]
    {
        eprintln!("skipped: no real footage at ../shared/data/{path}");
    }
    None
}

/// Asks again and again until there is an answer.
///
/// # Panics
/// When there is none within half a minute.
pub(crate) fn wait_for<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
    const MOST: Duration = Duration::from_secs(30);
    let clock = SystemClock::new();
    while clock.monotonic() < MOST {
        if let Some(answer) = ask() {
            return answer;
        }
        clock.sleep(Duration::from_millis(5));
    }
    panic!("waited {MOST:?} for {what}");
}
