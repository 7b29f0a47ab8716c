//! Sections `[log]` and `[telemetry]`: how the daemon tells of itself.

use crate::error::Gatherer;
use serde::Deserialize;

/// Most bytes of the collector's URL.
const MAX_URL_BYTES: usize = 2048;

/// Most characters of the service's name.
const MAX_NAME_CHARS: usize = 200;

/// How log lines are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// For people, on standard error.
    #[default]
    Text,
    /// One JSON object a line, on standard error.
    Json,
    /// To systemd's journal with level and fields; as text where there is no journal.
    Journald,
}

/// The log.
#[derive(Clone, Debug, PartialEq, Eq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LogSettings {
    /// `text`, `json` or `journald`. Default `text`.
    pub format: LogFormat,
}

/// Traces of requests.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TelemetrySettings {
    /// The collector that is told of requests (OTLP over HTTP, protobuf): an http or https URL without user, password, query and
    /// fragment; `/v1/traces` is added where it does not end so. Needs a build with the feature `opentelemetry`. Empty tells
    /// nobody. Default empty.
    pub otlp_endpoint: String,
    /// Which share of requests is told, 0 to 1. Default 0.1.
    pub sampling_ratio: f64,
    /// What the daemon is called there, 1 to 200 characters. Default `videofields`.
    pub service_name: String,
}

impl Default for TelemetrySettings {
    fn default() -> Self {
        Self { otlp_endpoint: String::new(), sampling_ratio: 0.1, service_name: "videofields".to_owned() }
    }
}

impl TelemetrySettings {
    /// Where traces are sent; none where nobody is told, or the URL is none.
    #[must_use]
    pub fn traces_url(&self) -> Option<url::Url> {
        let mut url = collector(&self.otlp_endpoint)?;
        let path = url.path().trim_end_matches('/').to_owned();
        if !path.ends_with("/v1/traces") {
            url.set_path(&format!("{path}/v1/traces"));
        }
        Some(url)
    }
}

/// The URL that the text is, if a collector may have such.
pub(super) fn collector(text: &str) -> Option<url::Url> {
    // The parser would drop line breaks and tabs silently.
    if text.len() > MAX_URL_BYTES || text.chars().any(|c| c.is_control() || c.is_whitespace()) {
        return None;
    }
    let url = url::Url::parse(text).ok()?;
    let is_plain = matches!(url.scheme(), "http" | "https")
        && url.host_str().is_some_and(|host| !host.is_empty())
        && url.username().is_empty()
        && url.password().is_none()
        && url.query().is_none()
        && url.fragment().is_none();
    is_plain.then_some(url)
}

/// Checks `[telemetry]`. Nothing of a wrong URL is repeated: it may hold a password.
pub(super) fn check(telemetry: &TelemetrySettings, gatherer: &mut Gatherer) {
    if !telemetry.otlp_endpoint.is_empty() && collector(&telemetry.otlp_endpoint).is_none() {
        let message = "expected an http or https URL such as http://127.0.0.1:4318, without user, password, query and fragment";
        gatherer.fault("/telemetry/otlp_endpoint", message);
    }
    super::validate::range(
        gatherer,
        "/telemetry/sampling_ratio",
        telemetry.sampling_ratio,
        0.0,
        1.0,
        "of all requests",
    );
    let name = &telemetry.service_name;
    if !(1..=MAX_NAME_CHARS).contains(&name.chars().count()) || name.chars().any(char::is_control) {
        let message = format!("expected 1 to {MAX_NAME_CHARS} characters, none of them a control character");
        gatherer.fault("/telemetry/service_name", message);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_collector_is_a_plain_url_and_a_wrong_one_is_not_repeated() {
        let settings = |endpoint: &str| TelemetrySettings {
            otlp_endpoint: endpoint.to_owned(),
            ..TelemetrySettings::default()
        };
        for (endpoint, expected) in [
            ("http://127.0.0.1:4318", "http://127.0.0.1:4318/v1/traces"),
            ("http://127.0.0.1:4318/", "http://127.0.0.1:4318/v1/traces"),
            ("https://collector.example/otlp/", "https://collector.example/otlp/v1/traces"),
            ("https://collector.example/v1/traces", "https://collector.example/v1/traces"),
        ] {
            assert_eq!(settings(endpoint).traces_url().map(String::from).as_deref(), Some(expected));
        }
        assert_eq!(settings("").traces_url(), None);
        for endpoint in [
            "127.0.0.1:4318",
            "grpc://127.0.0.1:4317",
            "http://",
            "http://ann:s3cret@collector/",
            "http://collector/?key=s3cret",
            "http://collector/#s3cret",
            "http://coll ector/",
            "http://collector/\n",
        ] {
            let mut gatherer = Gatherer::default();
            check(&settings(endpoint), &mut gatherer);
            let faults = gatherer.into_faults();
            assert_eq!(faults.len(), 1, "{endpoint}");
            assert_eq!(faults[0].place, "/telemetry/otlp_endpoint");
            assert!(!faults[0].message.contains("s3cret"), "{}", faults[0]);
            assert_eq!(settings(endpoint).traces_url(), None, "{endpoint}");
        }
        let mut gatherer = Gatherer::default();
        check(
            &TelemetrySettings { sampling_ratio: f64::NAN, service_name: "\n".to_owned(), ..settings("") },
            &mut gatherer,
        );
        let places: Vec<_> = gatherer.into_faults().into_iter().map(|fault| fault.place).collect();
        assert_eq!(places, ["/telemetry/sampling_ratio", "/telemetry/service_name"]);
    }
}
