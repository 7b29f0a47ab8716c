//! What stands in the place of traces in a build without the feature `opentelemetry`: nothing, at no cost.

use super::{TelemetryError, Written};
use prometheus::IntCounterVec;
use std::time::Duration;
use videofields_vision::config::TelemetrySettings;

/// Traces that are being sent: never, in this build.
#[derive(Debug)]
pub struct Traces(());

/// What became of spans: there are none.
#[must_use]
pub const fn spans() -> Option<&'static IntCounterVec> {
    None
}

/// Refuses to tell a collector; where none is named, there is nothing to do.
///
/// # Errors
/// [`TelemetryError::Traces`].
pub(super) fn begin(settings: &TelemetrySettings) -> Result<Option<(Written, Traces)>, TelemetryError> {
    if settings.traces_url().is_none() {
        return Ok(None);
    }
    let reason = "telemetry.otlp_endpoint needs a build with the feature `opentelemetry`".to_owned();
    Err(TelemetryError::Traces { reason })
}

/// Would note the trace that a caller says it belongs to.
pub const fn link(_span: &tracing::Span, _traceparent: &str) {}

/// Would tell of the stages of the request in hand.
pub const fn tell_stages(_stages: &[(&str, Duration)]) {}
