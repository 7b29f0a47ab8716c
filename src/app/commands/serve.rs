//! `serve` and `demo`: the daemon.

use crate::daemon::{self, Load};
use anyhow::{Context, Result, bail};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use videofields_recording::telemetry::{self, LogFormat, Traces};
use videofields_vision::config::{self, Config, ConfigError};

/// The demo's configuration, from the project's root.
const DEMO_CONFIG: &str = "config/demo/plaza.toml";

/// Runs the daemon until SIGTERM or SIGINT.
#[derive(Debug, clap::Args)]
pub(crate) struct Serve {
    /// The configuration (TOML); every key is in config/example.toml.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Listens here instead of where the configuration says.
    #[arg(long, value_name = "ADDR")]
    listen: Option<SocketAddr>,
    #[command(flatten)]
    log: Log,
}

/// Runs the daemon with the simulated plaza.
#[derive(Debug, clap::Args)]
pub(crate) struct Demo {
    /// Where to listen.
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// The demo's configuration; by default that of the project in whose folder the command runs.
    #[arg(long, value_name = "FILE", default_value = DEMO_CONFIG)]
    config: PathBuf,
    #[command(flatten)]
    log: Log,
}

#[derive(Debug, clap::Args)]
struct Log {
    /// Writes logs as JSON lines, whatever `log.format` says.
    #[arg(long)]
    log_json: bool,
    /// What is logged: a level, or directives such as `info,videofields::ingest=debug`.
    #[arg(long, value_name = "FILTER")]
    log: Option<String>,
}

impl Log {
    /// Begins to tell of the daemon; traces are sent for as long as what comes back is there.
    fn init(&self, config: &Config) -> Result<Option<Traces>> {
        let settings = config.settings();
        let format = if self.log_json { LogFormat::Json } else { settings.log.format };
        Ok(telemetry::init_with(format, self.log.as_deref(), &settings.telemetry)?)
    }
}

fn load(path: &Path, listen: Option<SocketAddr>) -> Result<Config, ConfigError> {
    let config = config::load(path)?;
    Ok(match listen {
        Some(listen) => config.with_listen(listen)?,
        None => config,
    })
}

/// Reads the configuration again as it was read at the start.
fn loader(path: &Path, listen: Option<SocketAddr>) -> Load {
    let path = path.to_owned();
    Arc::new(move || load(&path, listen))
}

/// Prints where the daemon is found. A daemon that nobody listens to is still a daemon.
fn announce(lines: &[String]) {
    if let Err(error) = super::say(&lines.join("\n")) {
        tracing::warn!(error = super::message_with_causes(&error), "the address could not be printed");
    }
}

impl Serve {
    pub(crate) fn run(&self) -> Result<()> {
        let config = load(&self.config, self.listen)?;
        let _traces = self.log.init(&config)?;
        daemon::serve(&config, loader(&self.config, self.listen), |url| announce(&[url.to_owned()]))
    }
}

impl Demo {
    pub(crate) fn run(&self) -> Result<()> {
        let path = &self.config;
        if !path.try_exists().with_context(|| format!("cannot look for {}", path.display()))? {
            bail!(
                "there is no {}: run the demo in the project's folder, or name it with --config",
                path.display()
            );
        }
        let config = load(path, Some(self.listen))?;
        let _traces = self.log.init(&config)?;
        let scene = config.settings().scene.first().map_or_else(String::new, |scene| scene.id.clone());
        daemon::serve(&config, loader(path, Some(self.listen)), |url| {
            announce(&[
                format!("the page      {url}"),
                format!("a fused view  {url}api/v1/scenes/{scene}/view.jpg"),
                format!("the cameras   {url}api/v1/cameras"),
                format!("the metrics   {url}metrics"),
            ]);
        })
    }
}
