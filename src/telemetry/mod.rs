//! What the daemon tells about itself: logs through `tracing`, and every metric.
//!
//! Nothing flows in but events and numbers; out go lines on standard error and Prometheus text. Knows nothing of
//! HTTP: `api` hands the text out.

pub mod metrics;

pub use metrics::{
    DropReason, Metrics, RecordingDrop, RemovalReason, SnapshotFailure, SnapshotRemoval, Stage, ViewRefusal,
};

use crate::error::ErrorKind;
use tracing_subscriber::EnvFilter;

/// The filter when none is given.
const DEFAULT_FILTER: &str = "info";

/// How log lines are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum LogFormat {
    /// For people.
    #[default]
    Text,
    /// One JSON object a line.
    Json,
}

/// Why logging could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum TelemetryError {
    /// The filter is no filter.
    #[error(
        "cannot read the log filter {filter:?}: {source}; expected a level (error, warn, info, debug, trace, off) \
         or directives such as info,videofields::ingest=debug"
    )]
    Filter {
        /// What was given.
        filter: String,
        /// What is wrong with it.
        source: tracing_subscriber::filter::ParseError,
    },
    /// Logging was set up before in this process.
    #[error("logging is already set up: {0}")]
    AlreadySet(tracing_subscriber::util::TryInitError),
}

impl TelemetryError {
    /// What the caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Filter { .. } => ErrorKind::Invalid,
            Self::AlreadySet(_) => ErrorKind::Internal,
        }
    }
}

/// Sends this process's logs to standard error.
///
/// `filter` wins over the variable `VIDEOFIELDS_LOG`, which wins over `RUST_LOG`; without any, `info`.
///
/// # Errors
/// When the filter is no filter, or logging was set up before.
pub fn init(format: LogFormat, filter: Option<&str>) -> Result<(), TelemetryError> {
    use tracing_subscriber::fmt;
    use tracing_subscriber::util::SubscriberInitExt;

    let filter = parse_filter(&choose_filter(filter, |name| std::env::var(name).ok()))?;
    let subscriber = fmt().with_env_filter(filter).with_writer(std::io::stderr);
    match format {
        LogFormat::Text => {
            let is_terminal = std::io::IsTerminal::is_terminal(&std::io::stderr());
            subscriber.with_ansi(is_terminal).finish().try_init()
        }
        LogFormat::Json => subscriber.json().flatten_event(true).finish().try_init(),
    }
    .map_err(TelemetryError::AlreadySet)
}

fn choose_filter(given: Option<&str>, variable: impl Fn(&str) -> Option<String>) -> String {
    let is_said = |text: &String| !text.trim().is_empty();
    given
        .map(str::to_owned)
        .or_else(|| variable("VIDEOFIELDS_LOG").filter(is_said))
        .or_else(|| variable("RUST_LOG").filter(is_said))
        .unwrap_or_else(|| DEFAULT_FILTER.to_owned())
}

fn parse_filter(filter: &str) -> Result<EnvFilter, TelemetryError> {
    EnvFilter::builder()
        .parse(filter)
        .map_err(|source| TelemetryError::Filter { filter: filter.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_filter_wins() {
        let variables = |pairs: &'static [(&str, &str)]| {
            move |name: &str| pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
        };
        let both = variables(&[("VIDEOFIELDS_LOG", "debug"), ("RUST_LOG", "trace")]);
        assert_eq!(choose_filter(Some("warn"), both), "warn");
        assert_eq!(choose_filter(None, both), "debug");
        assert_eq!(
            choose_filter(None, variables(&[("VIDEOFIELDS_LOG", " "), ("RUST_LOG", "trace")])),
            "trace"
        );
        assert_eq!(choose_filter(None, variables(&[])), "info");
    }

    #[test]
    fn a_wrong_filter_is_refused_with_what_is_allowed() {
        assert!(parse_filter("info,videofields::ingest=debug").is_ok());
        let error = parse_filter("videofields=loud").expect_err("a refusal");
        assert_eq!(error.kind(), ErrorKind::Invalid);
        let message = error.to_string();
        assert!(message.contains("videofields=loud") && message.contains("info,videofields::ingest=debug"));
    }
}
