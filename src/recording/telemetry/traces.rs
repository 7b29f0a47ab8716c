//! Traces of requests for a collector: what each request took, and its stages, by OTLP over HTTP.
//!
//! Spans named below flow in from `tracing`; a thread of its own sends them in batches. What waits for it is bounded: a
//! collector that is slow or away costs spans, which are counted, and nobody's time. Nothing is sent but the spans' names, times
//! and fields, which hold no query and no secret.

use super::TelemetryError;
use opentelemetry::propagation::{Extractor, TextMapPropagator};
use opentelemetry::trace::{Span as _, TraceContextExt, Tracer as _, TracerProvider as _};
use opentelemetry::{Context, KeyValue};
use opentelemetry_http::{Bytes, HttpClient, HttpError, Request, Response};
use opentelemetry_otlp::{Protocol, SpanExporter, WithExportConfig, WithHttpConfig};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::error::OTelSdkResult;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::{
    Sampler, SdkTracer, SdkTracerProvider, Span, SpanData, SpanExporter as _, SpanProcessor,
};
use prometheus::{IntCounterVec, Opts};
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, SystemTime};
use tracing_opentelemetry::OpenTelemetrySpanExt;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::filter_fn;
use tracing_subscriber::registry::LookupSpan;
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::TelemetrySettings;

/// Spans that are sent; all others of this program are for the log alone.
const NAMES: [&str; 2] = ["request", "store"];

/// Spans that wait to be sent.
const MAX_WAITING: usize = 4096;

/// Most spans of a batch, and how long one is gathered.
const MAX_BATCH: usize = 512;
const BATCH_TIME: Duration = Duration::from_secs(1);

/// Longest that the collector is waited for.
const ANSWER_TIME: Duration = Duration::from_secs(5);

/// Longest that the last batch is waited for when the daemon ends.
const LAST_TIME: Duration = Duration::from_millis(300);

/// Where this machine keeps the certificates of those that it trusts.
const TRUSTED: &str = "/etc/ssl/certs/ca-certificates.crt";

/// What became of spans, once traces have begun.
static SPANS: OnceLock<IntCounterVec> = OnceLock::new();

/// What makes spans of requests' stages, once traces have begun.
static TRACER: OnceLock<SdkTracer> = OnceLock::new();

/// What became of spans, by `outcome`: `sent`, `failed` (the collector did not take them) or `dropped` (too many waited). None
/// where no traces are sent.
pub fn spans() -> Option<&'static IntCounterVec> {
    SPANS.get()
}

/// Traces that are being sent; dropped, what waits is sent if that takes no longer than a moment.
#[derive(Debug)]
pub struct Traces {
    is_ending: Arc<AtomicBool>,
    has_ended: Receiver<()>,
}

impl Drop for Traces {
    fn drop(&mut self) {
        self.is_ending.store(true, Ordering::Release);
        if self.has_ended.recv_timeout(LAST_TIME) == Err(RecvTimeoutError::Timeout) {
            tracing::warn!("the last traces were not sent: the collector did not answer in time");
        }
    }
}

/// The layer that takes spans up, and what sends them; none where nobody is to be told.
///
/// # Errors
/// [`TelemetryError::Traces`].
pub(super) fn begin<S>(
    settings: &TelemetrySettings,
) -> Result<Option<(impl Layer<S> + Send + Sync + 'static, Traces)>, TelemetryError>
where
    S: tracing::Subscriber + for<'a> LookupSpan<'a> + Send + Sync,
{
    let Some(url) = settings.traces_url() else { return Ok(None) };
    let failed = |reason: String| TelemetryError::Traces { reason };
    let counts = IntCounterVec::new(
        Opts::new("videofields_telemetry_spans_total", "Spans of traces, by what became of them."),
        &["outcome"],
    )
    .map_err(|error| failed(error.to_string()))?;
    for outcome in ["sent", "failed", "dropped"] {
        counts.with_label_values(&[outcome]).inc_by(0);
    }
    let mut exporter = SpanExporter::builder()
        .with_http()
        .with_http_client(Http::new(url.scheme() == "https")?)
        .with_protocol(Protocol::HttpBinary)
        .with_endpoint(url.as_str())
        .with_timeout(ANSWER_TIME)
        .build()
        .map_err(|error| failed(error.to_string()))?;
    let resource = Resource::builder_empty()
        .with_service_name(settings.service_name.clone())
        .with_attribute(KeyValue::new("service.version", env!("CARGO_PKG_VERSION")))
        .build();
    exporter.set_resource(&resource);

    let (waiting, spans) = sync_channel(MAX_WAITING);
    let (ended, has_ended) = sync_channel(1);
    let is_ending = Arc::new(AtomicBool::new(false));
    let sender =
        Sender { spans, exporter, counts: counts.clone(), is_ending: Arc::clone(&is_ending), is_away: false };
    std::thread::Builder::new()
        .name("traces".to_owned())
        .spawn(move || {
            sender.run();
            ended.send(()).ok();
        })
        .map_err(|error| failed(error.to_string()))?;
    let provider = SdkTracerProvider::builder()
        .with_span_processor(Waiting { waiting, dropped: counts.with_label_values(&["dropped"]) })
        .with_sampler(Sampler::ParentBased(Box::new(Sampler::TraceIdRatioBased(settings.sampling_ratio))))
        .with_resource(resource)
        .build();
    let tracer = provider.tracer("videofields");
    // Set once a process, as the subscriber that the layer becomes part of.
    SPANS.set(counts).ok();
    TRACER.set(tracer.clone()).ok();
    let layer = tracing_opentelemetry::layer()
        .with_tracer(tracer)
        .with_location(false)
        .with_threads(false)
        .with_target(false)
        .with_tracked_inactivity(false)
        .with_filter(filter_fn(|metadata| metadata.is_span() && NAMES.contains(&metadata.name())));
    Ok(Some((layer, Traces { is_ending, has_ended })))
}

/// Notes with `span` the trace that a caller says it belongs to (W3C Trace Context, `traceparent`). As a link and never as its
/// parent: no stranger decides what is told, nor writes into anybody's trace.
pub fn link(span: &tracing::Span, traceparent: &str) {
    let context = TraceContextPropagator::new().extract(&OneField(traceparent));
    span.add_link(context.span().span_context().clone());
}

/// Tells of the stages of the request in hand, one behind the other up to now; of two that ran side by side too.
pub fn tell_stages(stages: &[(&str, Duration)]) {
    let Some(tracer) = TRACER.get() else { return };
    let context = tracing::Span::current().context();
    if !context.span().span_context().is_sampled() {
        return;
    }
    let now = SystemClock::new().now().as_nanos();
    let now = SystemTime::UNIX_EPOCH + Duration::from_nanos(u64::try_from(now).unwrap_or_default());
    let mut start = now.checked_sub(stages.iter().map(|(_, took)| *took).sum()).unwrap_or(now);
    for (name, took) in stages {
        let builder = tracer.span_builder((*name).to_owned()).with_start_time(start);
        start += *took;
        tracer.build_with_context(builder, &context).end_with_timestamp(start);
    }
}

/// The one header field that is read.
struct OneField<'a>(&'a str);

impl Extractor for OneField<'_> {
    fn get(&self, key: &str) -> Option<&str> {
        (key == "traceparent").then_some(self.0)
    }

    fn keys(&self) -> Vec<&str> {
        vec!["traceparent"]
    }
}

/// Where spans wait; never waits itself.
#[derive(Debug)]
struct Waiting {
    waiting: SyncSender<SpanData>,
    dropped: prometheus::IntCounter,
}

impl SpanProcessor for Waiting {
    fn on_start(&self, _span: &mut Span, _context: &Context) {}

    fn on_end(&self, span: SpanData) {
        if self.waiting.try_send(span).is_err() {
            self.dropped.inc();
        }
    }

    fn force_flush(&self) -> OTelSdkResult {
        Ok(())
    }

    fn shutdown_with_timeout(&self, _timeout: Duration) -> OTelSdkResult {
        Ok(())
    }
}

/// The thread that sends.
struct Sender {
    spans: Receiver<SpanData>,
    exporter: SpanExporter,
    counts: IntCounterVec,
    is_ending: Arc<AtomicBool>,
    /// Whether the last batch was not taken.
    is_away: bool,
}

impl Sender {
    fn run(mut self) {
        loop {
            let is_last = self.is_ending.load(Ordering::Acquire);
            let (batch, is_over) = self.batch(is_last);
            let is_empty = batch.is_empty();
            self.send(batch);
            if is_over || (is_last && is_empty) {
                return;
            }
        }
    }

    /// What comes within a moment; and whether nothing comes any more.
    fn batch(&self, is_last: bool) -> (Vec<SpanData>, bool) {
        // So that the end is heard soon.
        const LOOK: Duration = Duration::from_millis(50);
        let clock = SystemClock::new();
        let mut batch = Vec::new();
        while batch.len() < MAX_BATCH {
            let wait = if is_last { Duration::ZERO } else { LOOK };
            match self.spans.recv_timeout(wait) {
                Ok(span) => batch.push(span),
                Err(RecvTimeoutError::Disconnected) => return (batch, true),
                Err(RecvTimeoutError::Timeout) => {
                    if is_last || self.is_ending.load(Ordering::Acquire) || clock.monotonic() >= BATCH_TIME {
                        break;
                    }
                }
            }
        }
        (batch, false)
    }

    fn send(&mut self, batch: Vec<SpanData>) {
        let n_spans = batch.len() as u64;
        if n_spans == 0 {
            return;
        }
        let sent = pollster::block_on(self.exporter.export(batch));
        let outcome = if sent.is_ok() { "sent" } else { "failed" };
        self.counts.with_label_values(&[outcome]).inc_by(n_spans);
        match sent {
            Err(error) if !self.is_away => tracing::warn!(%error, "the collector of traces takes none"),
            Ok(()) if self.is_away => tracing::info!("the collector of traces takes them again"),
            _ => {}
        }
        self.is_away = outcome == "failed";
    }
}

/// The way to the collector: no redirects, no proxy, and whom this machine trusts.
#[derive(Debug)]
struct Http(ureq::Agent);

impl Http {
    fn new(is_encrypted: bool) -> Result<Self, TelemetryError> {
        let mut tls = ureq::tls::TlsConfig::builder();
        if is_encrypted {
            let failed = |reason: String| TelemetryError::Traces { reason: format!("{TRUSTED}: {reason}") };
            let text = std::fs::read(TRUSTED).map_err(|error| failed(error.to_string()))?;
            let mut trusted = Vec::new();
            for item in ureq::tls::parse_pem(&text) {
                if let ureq::tls::PemItem::Certificate(certificate) =
                    item.map_err(|error| failed(error.to_string()))?
                {
                    trusted.push(certificate);
                }
            }
            let provider = Arc::new(rustls::crypto::ring::default_provider());
            tls = tls
                .root_certs(ureq::tls::RootCerts::Specific(Arc::new(trusted)))
                .unversioned_rustls_crypto_provider(provider);
        }
        let config = ureq::Agent::config_builder()
            .timeout_global(Some(ANSWER_TIME))
            .max_redirects(0)
            .proxy(None)
            .http_status_as_error(false)
            .tls_config(tls.build())
            .build();
        Ok(Self(config.into()))
    }

    fn sent(&self, request: Request<Bytes>) -> Result<Response<Bytes>, HttpError> {
        let (parts, body) = request.into_parts();
        let response = self.0.run(Request::from_parts(parts, body.to_vec()))?;
        let (parts, mut body) = response.into_parts();
        let bytes = body.with_config().limit(1 << 20).read_to_vec()?;
        Ok(Response::from_parts(parts, Bytes::from(bytes)))
    }
}

impl HttpClient for Http {
    /// Blocks: the thread that sends has nothing else to do.
    fn send_bytes<'own, 'answer>(
        &'own self,
        request: Request<Bytes>,
    ) -> Pin<Box<dyn Future<Output = Result<Response<Bytes>, HttpError>> + Send + 'answer>>
    where
        'own: 'answer,
        Self: 'answer,
    {
        Box::pin(std::future::ready(self.sent(request)))
    }
}
