//! What the daemon tells about itself: logs and traces through `tracing`, and every metric.
//!
//! Nothing flows in but events and numbers; out go lines on standard error or to the journal, Prometheus text, and spans to a
//! collector where there is one. Knows nothing of the daemon's own HTTP: `api` hands the text out.

pub mod metrics;
#[cfg(feature = "opentelemetry")]
mod traces;
#[cfg(not(feature = "opentelemetry"))]
#[path = "no_traces.rs"]
mod traces;

pub use metrics::{
    DropReason, Metrics, RecordingDrop, RemovalReason, SnapshotFailure, SnapshotRemoval, Stage, ViewRefusal,
};
pub use traces::{Traces, link, spans, tell_stages};
pub use videofields_vision::config::LogFormat;

use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Registry, fmt};
use videofields_vision::config::TelemetrySettings;
use videofields_vision::error::ErrorKind;

/// The filter when none is given.
const DEFAULT_FILTER: &str = "info";

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
    /// Traces cannot be sent.
    #[error("traces cannot be sent: {reason}")]
    Traces {
        /// Why.
        reason: String,
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
            Self::Filter { .. } | Self::Traces { .. } => ErrorKind::Invalid,
            Self::AlreadySet(_) => ErrorKind::Internal,
        }
    }
}

/// Lines or entries of the log, for whatever is below them.
type Written = Box<dyn Layer<Registry> + Send + Sync>;

/// Sends this process's logs where `format` says.
///
/// `filter` wins over the variable `VIDEOFIELDS_LOG`, which wins over `RUST_LOG`; without any, `info`.
///
/// # Errors
/// When the filter is no filter, or logging was set up before.
pub fn init(format: LogFormat, filter: Option<&str>) -> Result<(), TelemetryError> {
    let nobody = TelemetrySettings::default();
    init_with(format, filter, &nobody).map(|traces| assert!(traces.is_none(), "nobody is told"))
}

/// As [`init`], and tells a collector of requests where the settings name one: for as long as what comes back is there.
///
/// # Errors
/// As [`init`]; and when traces cannot be sent, which a build without the feature `opentelemetry` never can.
pub fn init_with(
    format: LogFormat,
    filter: Option<&str>,
    telemetry: &TelemetrySettings,
) -> Result<Option<Traces>, TelemetryError> {
    let filter = parse_filter(&choose_filter(filter, |name| std::env::var(name).ok()))?;
    let (written, complaint) = written(format);
    let mut layers: Vec<Written> = vec![written.with_filter(filter).boxed()];
    let mut traces = None;
    if let Some((layer, begun)) = traces::begin(telemetry)? {
        layers.push(layer.boxed());
        traces = Some(begun);
    }
    tracing_subscriber::registry().with(layers).try_init().map_err(TelemetryError::AlreadySet)?;
    if let Some(error) = complaint {
        tracing::warn!(%error, "there is no journal; the log goes to standard error");
    }
    Ok(traces)
}

/// What writes the log, and why not as asked.
fn written(format: LogFormat) -> (Written, Option<std::io::Error>) {
    let lines = || fmt::layer().with_writer(std::io::stderr);
    let text = || {
        let is_terminal = std::io::IsTerminal::is_terminal(&std::io::stderr());
        lines().with_ansi(is_terminal).boxed()
    };
    match format {
        LogFormat::Text => (text(), None),
        LogFormat::Json => (lines().json().flatten_event(true).boxed(), None),
        LogFormat::Journald => match tracing_journald::layer() {
            Ok(journal) => (journal.with_syslog_identifier("videofields".to_owned()).boxed(), None),
            Err(error) => (text(), Some(error)),
        },
    }
}

fn choose_filter(given: Option<&str>, variable: impl Fn(&str) -> Option<String>) -> String {
    let is_said = |text: &String| !text.trim().is_empty();
    given
        .map(str::to_owned)
        .or_else(|| variable("VIDEOFIELDS_LOG").filter(is_said))
        .or_else(|| variable("RUST_LOG").filter(is_said))
        .unwrap_or_else(|| DEFAULT_FILTER.to_owned())
}

/// The crates whose rooms log, but for the program's own.
const CRATES: [&str; 6] = ["vision", "picture", "render", "recording", "service", "api"];

/// Returns a filter in which `videofields::ROOM` means that room, whichever crate it is in: what logs is called by its crate, such as
/// `videofields_recording::ingest`.
fn with_crates(filter: &str) -> String {
    let with_others = |directive: &str| {
        let Some(room) = directive.trim().strip_prefix("videofields::") else { return directive.to_owned() };
        let is_crate = |name: &str| {
            room.strip_prefix(name).is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric()))
        };
        let roots = CRATES.iter().filter(|name| is_crate(name)).map(|_name| format!("videofields_{room}"));
        let rooms = CRATES.iter().map(|name| format!("videofields_{name}::{room}"));
        [directive.to_owned()].into_iter().chain(rooms).chain(roots).collect::<Vec<_>>().join(",")
    };
    filter.split(',').map(with_others).collect::<Vec<_>>().join(",")
}

fn parse_filter(filter: &str) -> Result<EnvFilter, TelemetryError> {
    EnvFilter::builder()
        .parse(with_crates(filter))
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
    fn a_room_is_found_in_whichever_crate_it_is() {
        let filter = parse_filter("info,videofields::ingest=debug").unwrap().to_string();
        assert!(
            filter.contains("videofields_recording::ingest=debug") && filter.contains("info"),
            "{filter}"
        );
        let filter = parse_filter("videofields::render::passes=trace").unwrap().to_string();
        assert!(filter.contains("videofields_render::passes=trace"), "{filter}");
        let filter = parse_filter("videofields=debug,hyper=warn").unwrap().to_string();
        assert!(filter.contains("videofields=debug") && !filter.contains("videofields_"), "{filter}");
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
