//! What tests of several crates share: comparing with goldens, cameras and servers to test against, and how a test is skipped.

pub mod golden;
#[cfg(feature = "streams")]
pub mod odd_rtsp;
#[cfg(feature = "streams")]
pub mod onvif;
#[cfg(feature = "streams")]
pub mod rtsp;
#[cfg(feature = "streams")]
pub mod schema;
pub mod small_disk;
#[cfg(feature = "streams")]
pub mod tls;
#[cfg(feature = "streams")]
pub mod video;

use proptest::prelude::ProptestConfig;
use proptest::test_runner::RngSeed;
use std::path::PathBuf;
use std::time::Duration;
#[cfg(feature = "gpu")]
use videofields_render::gpu::{Gpu, GpuError};
use videofields_vision::clock::{Clock, SystemClock};

/// Returns the repository's root, or the folder that `VIDEOFIELDS_ROOT` names: where tests run elsewhere than they were built, the
/// files that they read lie beneath it as they do in the repository.
#[must_use]
pub fn root() -> PathBuf {
    let named = std::env::var_os("VIDEOFIELDS_ROOT").map(PathBuf::from);
    named.unwrap_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")))
}

/// Says what is skipped and why, where a person looks.
pub fn say_skipped(why: &str) {
    #[expect(clippy::print_stderr, reason = "a skipped test says so where a person looks")]
    {
        eprintln!("skipped: {why}");
    }
}

/// Says what is skipped and why; with CI=true nothing may be.
///
/// # Panics
/// With CI=true in the environment.
pub fn skip_for_want_of_an_adapter(why: &str) {
    assert!(std::env::var("CI").as_deref() != Ok("true"), "CI needs an adapter: {why}");
    say_skipped(why);
}

/// Returns the adapter's name that `VIDEOFIELDS_TEST_ADAPTER` gives: whatever draws is then tested on that device alone.
#[must_use]
pub fn named_adapter() -> Option<String> {
    std::env::var("VIDEOFIELDS_TEST_ADAPTER").ok().filter(|name| !name.is_empty())
}

/// Returns the GPU of that name (or of [`named_adapter`]), or `None` (and a line on standard error) where there is none; with CI=true
/// there must be.
#[cfg(feature = "gpu")]
#[must_use]
pub fn adapter(name: &str) -> Option<Gpu> {
    match Gpu::new(named_adapter().as_deref().unwrap_or(name)) {
        Ok(gpu) => Some(gpu),
        Err(error @ GpuError::NoAdapter { .. }) => {
            skip_for_want_of_an_adapter(&error.to_string());
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// A file or folder of the real footage beside the project, or `None` (and a line on standard error that says
/// what was skipped) where the footage is not at hand; with `VIDEOFIELDS_DATA=required` it must be.
///
/// # Panics
/// Where the footage is required and is not there.
#[must_use]
pub fn real_data(path: &str) -> Option<PathBuf> {
    let full = root().join("../shared/data").join(path);
    if full.try_exists().unwrap_or(false) {
        return Some(full);
    }
    let is_required = std::env::var("VIDEOFIELDS_DATA").as_deref() == Ok("required");
    assert!(!is_required, "VIDEOFIELDS_DATA=required: no real footage at ../shared/data/{path}");
    say_skipped(&format!("no real footage at ../shared/data/{path}"));
    None
}

/// Settings of a property test: the same cases in every run, and nothing written beside the tests.
pub fn seeded(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(2004);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

/// Asks again and again until there is an answer.
///
/// # Panics
/// When there is none within a minute and a half: a machine may be busy with more than tests.
pub fn wait_for<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
    const MOST: Duration = Duration::from_secs(90);
    let clock = SystemClock::new();
    while clock.monotonic() < MOST {
        if let Some(answer) = ask() {
            return answer;
        }
        clock.sleep(Duration::from_millis(5));
    }
    panic!("waited {MOST:?} for {what}");
}

/// Makes workers of test programs: whatever decodes in a test starts the test's own program for it, as the daemon does.
#[cfg(feature = "streams")]
#[ctor::ctor(unsafe)]
fn run_worker_if_asked() {
    videofields_recording::media::run_if_asked();
}
