//! Picture equality: the tests of whatever draws, run on this device. They hold its pictures to goldens and to twins on the processor.
//!
//! The bundle carries them as a program beside this one (`render-tests`, with the files that they read in `files`); in a checkout
//! `VIDEOFIELDS_RENDER_TESTS` names it.

use super::{Found, Stage};
use anyhow::{Context as _, Result, bail};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::Duration;
use videofields_vision::clock::Clock as _;

/// Time from one look whether the tests are done to the next.
const EVERY: Duration = Duration::from_millis(100);

/// Most failures that are named.
const MOST_NAMED: usize = 40;

/// Most lines of what the program said before it died.
const MOST_LINES: usize = 4;

/// The tests' results so far.
#[derive(Debug, Default, PartialEq, Eq)]
struct Outcome {
    passed: Vec<String>,
    failed: Vec<String>,
    skipped: Vec<String>,
    /// The test that was begun and has no result: known where tests run one after the other.
    begun: Option<String>,
}

/// Reads the lines of Rust's test runner: `test render::views::a_golden ... ok`.
fn outcome(text: &str) -> Outcome {
    let mut outcome = Outcome::default();
    for line in text.lines() {
        let Some((name, result)) = line.strip_prefix("test ").and_then(|rest| rest.rsplit_once(" ... "))
        else {
            continue;
        };
        let name = name.trim_end_matches(" - should panic").to_owned();
        match result.trim() {
            "ok" => outcome.passed.push(name),
            "FAILED" => outcome.failed.push(name),
            result if result.starts_with("ignored") => outcome.skipped.push(name),
            _ => outcome.begun = Some(name),
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

/// The tests' program, and where it runs.
struct Tests<'a> {
    stage: &'a Stage<'a>,
    program: PathBuf,
    /// A folder of its own, with copies of the files that the tests read where the bundle brings them.
    folder: tempfile::TempDir,
    has_files: bool,
}

/// End of one run of the program.
struct Run {
    outcome: Outcome,
    /// None where its time was over.
    status: Option<ExitStatus>,
    /// The last lines that it said of itself.
    said: String,
}

impl Tests<'_> {
    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.program);
        command.args(arguments).env("VIDEOFIELDS_TEST_ADAPTER", self.stage.device).env_remove("CI");
        if self.has_files {
            command.env("VIDEOFIELDS_ROOT", self.folder.path());
        }
        command.stdin(Stdio::null());
        command
    }

    /// Returns the names of all tests.
    fn names(&self) -> Result<Vec<String>> {
        let listed = self.command(&["--list"]).output().context("the list of the tests")?;
        let text = String::from_utf8_lossy(&listed.stdout);
        Ok(text.lines().filter_map(|line| line.strip_suffix(": test")).map(str::to_owned).collect())
    }

    /// Runs some tests until they are done or the time is over.
    fn run(&self, names: &[String], n_threads: &str) -> Result<Run> {
        let [output, errors] = ["output", "errors"].map(|name| self.folder.path().join(name));
        let file = |path: &Path| std::fs::File::create(path).context("a file for the tests' output");
        let mut child = self
            .command(&["--exact", "--test-threads", n_threads])
            .args(names)
            .stdout(file(&output)?)
            .stderr(file(&errors)?)
            .spawn()
            .with_context(|| format!("cannot start {}", self.program.display()))?;
        let clock = self.stage.budget.clock;
        let status = loop {
            if let Some(status) = child.try_wait().context("the tests' end")? {
                break Some(status);
            }
            if self.stage.budget.is_over() {
                child.kill().context("cannot end the tests")?;
                child.wait().context("the tests' end")?;
                break None;
            }
            clock.sleep(EVERY);
        };
        let read = |path: &Path| std::fs::read(path).context("the tests' output");
        let errors = String::from_utf8_lossy(&read(&errors)?).into_owned();
        let lines: Vec<&str> = errors.lines().filter(|line| !line.trim().is_empty()).collect();
        let said = lines[lines.len().saturating_sub(MOST_LINES)..].join("; ");
        Ok(Run { outcome: outcome(&String::from_utf8_lossy(&read(&output)?)), status, said })
    }
}

/// Runs the tests until they are done or the time is over. One that ends the program is named, and those behind it are run without it.
pub(super) fn measure(stage: &Stage<'_>) -> Result<Found> {
    let (program, files) = program()?;
    let folder = tempfile::tempdir().context("a folder for the tests' output")?;
    let has_files = files.is_some();
    if let Some(files) = files {
        copy_goldens(&files, folder.path())?;
    }
    let tests = Tests { stage, program, folder, has_files };
    let mut left = tests.names()?;
    let n_tests = left.len();
    let (mut n_passed, mut failed, mut notes) = (0, Vec::new(), Vec::new());
    let mut is_cut_short = n_tests == 0;
    let mut n_threads = "2";
    while !left.is_empty() {
        let run = tests.run(&left, n_threads)?;
        let outcome = run.outcome;
        n_passed += outcome.passed.len();
        let mut done: HashSet<String> = outcome.passed.into_iter().chain(outcome.skipped).collect();
        done.extend(outcome.failed.iter().cloned());
        failed.extend(outcome.failed);
        left.retain(|name| !done.contains(name));
        let Some(status) = run.status else {
            is_cut_short = true;
            break;
        };
        if left.is_empty() {
            break;
        }
        // The program died. With one thread the test that killed it is known; the first time it is not.
        if n_threads == "1" {
            let culprit = outcome.begun.filter(|name| left.contains(name)).unwrap_or_else(|| left[0].clone());
            notes.push(format!("- ends the program ({status}): `{culprit}`; it said: {}", run.said));
            left.retain(|name| *name != culprit);
            failed.push(culprit);
        } else {
            notes.push(format!(
                "- The program died ({status}) while two tests ran at once; it said: {}",
                run.said
            ));
        }
        n_threads = "1";
    }
    notes.insert(
        0,
        format!(
            "Of {n_tests} tests {} were run: {n_passed} hold, {} do not. Goldens are drawn by lavapipe, so an edge may lie a pixel off \
             elsewhere; twins are computed in f64.",
            n_passed + failed.len(),
            failed.len()
        ),
    );
    notes.extend(failed.iter().take(MOST_NAMED).map(|name| format!("- does not hold: `{name}`")));
    Ok(Found { notes, is_cut_short, ..Found::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_runner_are_counted_and_failures_named() {
        let text = "running 4 tests\ntest render::a ... ok\ntest render::b - should panic ... ok\ntest numerics::c ... FAILED\n\
                    test render::d ... ignored, for want of time\n\nfailures:\n    numerics::c\n";
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let mut expected = Outcome {
            passed: names(&["render::a", "render::b"]),
            failed: names(&["numerics::c"]),
            skipped: names(&["render::d"]),
            begun: None,
        };
        assert_eq!(outcome(text), expected);
        // With one thread the name comes before the result: the last one has none where the program died in it.
        expected.begun = Some("render::e".to_owned());
        assert_eq!(outcome(&format!("{text}\ntest render::e ... ")), expected);
    }
}
