//! Checks every request's limits before any route sees it, and completes every answer: writes problem documents down, sets security
//! header fields, counts it.

use super::error::Problem;
use super::{Api, Site};
use axum::body::Body;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::net::{Ipv4Addr, Ipv6Addr};
use tracing::Instrument;
use videofields_recording::telemetry;

/// Route label of requests that no route matches.
const NO_ROUTE: &str = "(none)";

/// Most bytes of any route's body.
const MAX_ANY_BYTES: u64 = videofields_picture::scene::exchange::MAX_EXCHANGE_BYTES as u64;

/// Sees every request first and every answer last.
pub(super) async fn observe(
    State(api): State<Api>,
    matched: Option<MatchedPath>,
    request: Request,
    next: Next,
) -> Response {
    let start = api.clock.monotonic();
    let path = request.uri().path().to_owned();
    let route = matched.as_ref().map_or(NO_ROUTE, MatchedPath::as_str);
    let span = tracing::debug_span!(
        "request",
        method = %request.method(),
        ?path,
        otel.kind = "server",
        otel.name = format_args!("{} {route}", request.method()),
        http.route = route,
        http.response.status_code = tracing::field::Empty,
    );
    if let Some(traceparent) = request.headers().get("traceparent").and_then(|value| value.to_str().ok()) {
        telemetry::link(&span, traceparent);
    }
    let refused = too_large(&api, &request).or_else(|| foreign_host(&api, &request));
    let refused = refused.or_else(|| too_long(&request));
    let mut response = match refused {
        Some(problem) => problem.into_response(),
        None => next.run(request).instrument(span.clone()).await,
    };
    let _entered = span.enter();
    if let Some(problem) = response.extensions_mut().remove::<Problem>() {
        if let Some(internal) = problem.internal() {
            tracing::error!(?path, error = internal, "a request met a fault of the daemon");
        }
        *response.body_mut() = Body::from(problem.document(&path));
    }
    set_security_fields(response.headers_mut(), &api.site);
    let duration = api.clock.monotonic().saturating_sub(start);
    let status = response.status().as_u16();
    span.record("http.response.status_code", status);
    tracing::debug!(status, millis = duration.as_secs_f64() * 1e3, "answered");
    api.door.count_http(route, status, duration);
    response
}

fn too_large(api: &Api, request: &Request) -> Option<Problem> {
    let target_bytes = request.uri().path_and_query().map_or(0, |target| target.as_str().len());
    if target_bytes > api.limits.target_bytes {
        return Some(Problem::target_too_long(api.limits.target_bytes));
    }
    let field_bytes: usize =
        request.headers().iter().map(|(name, value)| name.as_str().len() + value.len()).sum();
    (field_bytes > api.limits.field_bytes).then(|| Problem::fields_too_large(api.limits.field_bytes))
}

/// A body that is announced longer than any route takes is refused before any of it comes.
fn too_long(request: &Request) -> Option<Problem> {
    let length = request.headers().get(header::CONTENT_LENGTH).and_then(|length| length.to_str().ok());
    let is_too_long =
        length.and_then(|length| length.parse().ok()).is_some_and(|length: u64| length > MAX_ANY_BYTES);
    is_too_long.then(Problem::content_too_large)
}

/// A page of somebody else's whose name was made to lead here would be taken by the browser for the daemon's own, and
/// could read its pictures: only names known to be the daemon's are answered (DNS rebinding).
fn foreign_host(api: &Api, request: &Request) -> Option<Problem> {
    let asked = request.uri().authority().map(|authority| authority.as_str());
    let asked = asked.or_else(|| request.headers().get(header::HOST).and_then(|host| host.to_str().ok()));
    let Some(named) = asked else {
        // HTTP/1.0 without the field comes from no browser; one that is no text is nobody's name.
        return request.headers().get(header::HOST).map(|_host| Problem::host("?"));
    };
    let name = match named.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => named,
    };
    let is_address = name.parse::<Ipv4Addr>().is_ok()
        || name
            .strip_prefix('[')
            .and_then(|name| name.strip_suffix(']'))
            .is_some_and(|name| name.parse::<Ipv6Addr>().is_ok());
    let is_known = is_address
        || name.eq_ignore_ascii_case("localhost")
        || api.site.hosts.iter().any(|known| known.eq_ignore_ascii_case(name));
    (!is_known).then(|| Problem::host(name))
}

fn set_security_fields(headers: &mut HeaderMap, site: &Site) {
    let mut set = |name, value| {
        headers.entry(name).or_insert(HeaderValue::from_static(value));
    };
    set(header::X_CONTENT_TYPE_OPTIONS, "nosniff");
    set(header::CONTENT_SECURITY_POLICY, "default-src 'none'; frame-ancestors 'none'");
    set(header::REFERRER_POLICY, "no-referrer");
    // Where there are no users, any page open in the operator's browser could else show the daemon's pictures.
    set(header::HeaderName::from_static("cross-origin-resource-policy"), "same-origin");
    if site.is_encrypted {
        // A year: a browser that was here once comes back encrypted, whatever a link says.
        set(header::STRICT_TRANSPORT_SECURITY, "max-age=31536000");
    }
}
