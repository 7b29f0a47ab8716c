//! `doctor`: whether the machine, the configuration and the database are as a daemon needs them. Changes nothing.
//!
//! One file a subject. Each is looked at on a thread of its own and for a bounded time: a device or file server that hangs
//! is a line like others.

mod calibrations;
mod cameras;
mod database;
mod drawing;
mod folders;
mod line;
mod machine;
mod network;

use super::operator::CONFIG;
use line::{Level, Line};
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::{self, Config};

/// Says what a daemon would meet on this machine: devices, GPU, codecs, disks, clock, port, certificate, database.
///
/// Looks, and changes nothing; run it as the daemon's user, whose rights count. A line each: `ok`, `warning` or `problem`,
/// what it is, why, and what to do. Exit status 0 where all is well, 1 where there are warnings, 2 where there are problems.
#[derive(Debug, clap::Args)]
pub(crate) struct Doctor {
    /// The daemon's configuration (TOML).
    #[arg(long, value_name = "FILE", default_value = CONFIG)]
    config: PathBuf,
    /// Writes one JSON object instead of lines.
    #[arg(long)]
    json: bool,
}

/// A subject: its name, how long it may take, and what looks at it.
type Subject = (&'static str, Duration, fn(&Config) -> Vec<Line>);

/// Time for what only asks the system.
const SHORT: Duration = Duration::from_secs(5);

/// Time for what opens drivers or reads a database.
const LONG: Duration = Duration::from_secs(30);

const SUBJECTS: [Subject; 8] = [
    ("machine", SHORT, machine::look),
    ("folders", SHORT, folders::look),
    ("database", LONG, database::look),
    ("network", SHORT, network::look),
    ("codecs", LONG, cameras::look_at_codecs),
    ("cameras", SHORT, cameras::look),
    ("calibrations", LONG, calibrations::look),
    ("drawing", LONG, drawing::look),
];

impl Doctor {
    pub(crate) fn run(&self) -> ExitCode {
        let lines = match config::load(&self.config) {
            Ok(config) => {
                let counted = |n: usize, what: &str| format!("{n} {what}");
                let settings = config.settings();
                let what =
                    [counted(settings.camera.len(), "cameras"), counted(settings.scene.len(), "scenes")];
                let good =
                    Line::ok("configuration", format!("{}: {}", self.config.display(), what.join(", ")));
                std::iter::once(good).chain(look_at_all(Arc::new(config))).collect()
            }
            Err(error) => {
                let fault = |fault: &str| {
                    Line::problem("configuration", fault.to_owned(), "the daemon does not start with it")
                        .do_this("mend the file; config/example.toml has every key")
                };
                error.to_string().lines().map(fault).collect::<Vec<_>>()
            }
        };
        let worst = lines.iter().map(|line| line.level).max().unwrap_or(Level::Ok);
        if let Err(error) = self.write(&lines, worst) {
            super::complain(&super::message_with_causes(&error));
            return ExitCode::from(2);
        }
        ExitCode::from(worst as u8)
    }

    fn write(&self, lines: &[Line], worst: Level) -> anyhow::Result<()> {
        if self.json {
            return super::say(&json!({ "verdict": worst, "lines": lines }).to_string());
        }
        lines.iter().try_for_each(|line| super::say(&line.to_string()))
    }
}

/// Looks at every subject, all at once, each for no longer than it may take.
fn look_at_all(config: Arc<Config>) -> Vec<Line> {
    let clock = SystemClock::new();
    let begun: Vec<_> = SUBJECTS.iter().map(|subject| (*subject, begin(*subject, &config))).collect();
    let waited = |((name, time, _), answer): (Subject, Result<Receiver<Vec<Line>>, std::io::Error>)| {
        let Ok(answer) = answer else {
            return vec![Line::problem(name, "cannot be looked at".to_owned(), "no thread can be started")];
        };
        match answer.recv_timeout(time.saturating_sub(clock.monotonic())) {
            Ok(lines) => lines,
            Err(RecvTimeoutError::Timeout) => {
                let what = format!("no answer within {} s", time.as_secs());
                let why = "a device, a driver or a file server hangs, or there is much to read";
                vec![Line::problem(name, what, why).do_this("see the kernel's log (dmesg), and mount")]
            }
            Err(RecvTimeoutError::Disconnected) => {
                vec![Line::problem(name, "looking at it broke off".to_owned(), "a fault of this program")]
            }
        }
    };
    begun.into_iter().flat_map(waited).collect()
}

fn begin((name, _, look): Subject, config: &Arc<Config>) -> std::io::Result<Receiver<Vec<Line>>> {
    let (tell, told) = sync_channel(1);
    let config = Arc::clone(config);
    let thread = std::thread::Builder::new().name(format!("doctor-{name}"));
    // One that hangs is left: it ends with the process.
    thread.spawn(move || tell.send(look(&config)).is_ok())?;
    Ok(told)
}
