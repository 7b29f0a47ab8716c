//! Picture equality: the tests of whatever draws, run on this device. They hold its pictures to goldens and to twins on the processor.
//!
//! The bundle carries them as a program beside this one (`render-tests`, with the files that they read in `files`); in a checkout
//! `VIDEOFIELDS_RENDER_TESTS` names it.

use super::{Found, Stage};
use anyhow::{Context as _, Result, bail};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use videofields_vision::clock::Clock as _;

/// Time from one look whether the tests are done to the next.
const EVERY: Duration = Duration::from_millis(100);

/// Most failures that are named.
const MOST_NAMED: usize = 40;

/// Counts the tests' results so far.
#[derive(Debug, Default, PartialEq, Eq)]
struct Outcome {
    /// Number of tests in the program.
    n_tests: usize,
    n_passed: usize,
    failed: Vec<String>,
    n_skipped: usize,
}

/// Reads the lines of Rust's test runner: `test render::views::a_golden ... ok`.
fn outcome(text: &str) -> Outcome {
    let mut outcome = Outcome::default();
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("running ") {
            outcome.n_tests = rest.split(' ').next().and_then(|n| n.parse().ok()).unwrap_or_default();
        }
        let Some((name, result)) = line.strip_prefix("test ").and_then(|rest| rest.rsplit_once(" ... "))
        else {
            continue;
        };
        match result.trim() {
            "ok" => outcome.n_passed += 1,
            "FAILED" => outcome.failed.push(name.to_owned()),
            result if result.starts_with("ignored") => outcome.n_skipped += 1,
            _ => {}
        }
    }
    outcome
}

/// Returns the tests' program and the folder of their files; the checkout's where it is none.
fn program() -> Result<(PathBuf, Option<PathBuf>)> {
    if let Some(named) = std::env::var_os("VIDEOFIELDS_RENDER_TESTS") {
        return Ok((named.into(), None));
    }
    let own = std::env::current_exe().context("where this program lies")?;
    let folder = own.parent().context("this program lies in no folder")?;
    let tests = folder.join("render-tests");
    if !tests.is_file() {
        bail!(
            "there are no tests at {}: the bundle has them, or VIDEOFIELDS_RENDER_TESTS names them",
            tests.display()
        );
    }
    Ok((tests, Some(folder.join("files"))))
}

/// Copies what the tests read to where they may write too.
fn copy_goldens(files: &Path, to: &Path) -> Result<()> {
    let goldens = Path::new("tests/golden");
    let (from, to) = (files.join(goldens), to.join(goldens));
    std::fs::create_dir_all(&to).with_context(|| format!("cannot make {}", to.display()))?;
    let entries = std::fs::read_dir(&from).with_context(|| format!("cannot read {}", from.display()))?;
    for entry in entries {
        let entry = entry.with_context(|| format!("cannot read {}", from.display()))?;
        std::fs::copy(entry.path(), to.join(entry.file_name()))
            .with_context(|| format!("cannot copy {}", entry.path().display()))?;
    }
    Ok(())
}

/// Runs the tests until they are done or the time is over.
pub(super) fn measure(stage: &Stage<'_>) -> Result<Found> {
    let (tests, files) = program()?;
    let has_files = files.is_some();
    let folder = tempfile::tempdir().context("a folder for the tests' output")?;
    if let Some(files) = files {
        copy_goldens(&files, folder.path())?;
    }
    let output_path = folder.path().join("output");
    let output = std::fs::File::create(&output_path).context("a file for the tests' output")?;
    let mut command = Command::new(&tests);
    command.args(["--test-threads", "2"]).env("VIDEOFIELDS_TEST_ADAPTER", stage.device).env_remove("CI");
    if has_files {
        command.env("VIDEOFIELDS_ROOT", folder.path());
    }
    let mut child = command
        .stdin(Stdio::null())
        .stdout(output)
        .stderr(Stdio::null())
        .spawn()
        .with_context(|| format!("cannot start {}", tests.display()))?;
    let clock = stage.budget.clock;
    let status = loop {
        if let Some(status) = child.try_wait().context("the tests' end")? {
            break Some(status);
        }
        if stage.budget.is_over() {
            child.kill().context("cannot end the tests")?;
            child.wait().context("the tests' end")?;
            break None;
        }
        clock.sleep(EVERY);
    };
    let text = std::fs::read_to_string(&output_path).context("the tests' output")?;
    let outcome = outcome(&text);
    let mut found = Found { is_cut_short: status.is_none(), ..Found::default() };
    if let Some(status) = status.filter(|_| outcome.n_passed + outcome.failed.len() == 0) {
        bail!("the tests ended at once, with {status}");
    }
    found.notes.push(format!(
        "Of {} tests {} were run: {} hold, {} do not. Goldens are drawn by lavapipe, so an edge may lie a pixel off elsewhere; twins are computed in f64.",
        outcome.n_tests,
        outcome.n_passed + outcome.failed.len(),
        outcome.n_passed,
        outcome.failed.len()
    ));
    for name in outcome.failed.iter().take(MOST_NAMED) {
        found.notes.push(format!("- does not hold: `{name}`"));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_runner_are_counted_and_failures_named() {
        let text = "running 4 tests\ntest render::a ... ok\ntest render::b - should panic ... ok\ntest numerics::c ... FAILED\n\
                    test render::d ... ignored, for want of time\n\nfailures:\n    numerics::c\n";
        let expected =
            Outcome { n_tests: 4, n_passed: 2, failed: vec!["numerics::c".to_owned()], n_skipped: 1 };
        assert_eq!(outcome(text), expected);
    }
}
