//! Progress of long work on standard error: a line that is rewritten on a terminal, else a line now and then.

use std::io::{IsTerminal as _, Write as _};
use std::time::Duration;
use videofields_vision::clock::{Clock, SystemClock};

/// How often a terminal's line is rewritten, and how often a line is written where there is no terminal.
const REWRITTEN_EVERY: Duration = Duration::from_millis(100);
const WRITTEN_EVERY: Duration = Duration::from_secs(5);

/// Tells how far a command has come.
pub struct Progress {
    clock: SystemClock,
    is_terminal: bool,
    shown_at: Option<Duration>,
    is_line_open: bool,
}

impl Default for Progress {
    fn default() -> Self {
        Self::new()
    }
}

impl Progress {
    /// Shows nothing before the first interval is over, so short work stays silent where there is no terminal.
    pub fn new() -> Self {
        let clock = SystemClock::new();
        let shown_at = Some(clock.monotonic());
        Self { clock, is_terminal: std::io::stderr().is_terminal(), shown_at, is_line_open: false }
    }

    /// Shows how far the work is, if it is time to.
    pub fn show(&mut self, line: impl FnOnce() -> String) {
        let now = self.clock.monotonic();
        let interval = if self.is_terminal { REWRITTEN_EVERY } else { WRITTEN_EVERY };
        if self.shown_at.is_some_and(|shown_at| now.saturating_sub(shown_at) < interval) {
            return;
        }
        self.shown_at = Some(now);
        if self.is_terminal {
            self.write(&format!("\r\x1b[2K{}", line()));
            self.is_line_open = true;
        } else {
            self.write(&format!("{}\n", line()));
        }
    }

    /// Takes the line away.
    pub fn finish(&mut self) {
        if std::mem::take(&mut self.is_line_open) {
            self.write("\r\x1b[2K");
        }
    }

    /// Progress is a courtesy: where it cannot be written, the work goes on without.
    fn write(&mut self, text: &str) {
        let mut stderr = std::io::stderr();
        if stderr.write_all(text.as_bytes()).and_then(|()| stderr.flush()).is_err() {
            self.is_terminal = false;
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}
