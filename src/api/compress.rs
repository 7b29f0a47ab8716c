//! Which answers are compressed for who takes it (gzip): text that is long enough. Pictures are dense already, streams are sent
//! piece by piece, and what holds secrets beside a caller's own words is left as it is.

use super::tags::COMPRESSED;
use axum::body::HttpBody;
use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderValue, header};
use axum::middleware::Next;
use axum::response::Response;
use tower_http::CompressionLevel;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::Predicate;

/// Less than this fits into a packet anyway.
const LEAST_BYTES: u64 = 1024;

/// Compresses the answers beneath it that are worth it; quickly, since most are asked for once.
pub(super) fn layer() -> CompressionLayer<WorthIt> {
    CompressionLayer::new().quality(CompressionLevel::Fastest).compress_when(WorthIt)
}

/// Whether an answer is compressed.
#[derive(Clone, Copy, Debug)]
pub(super) struct WorthIt;

impl Predicate for WorthIt {
    fn should_compress<B: HttpBody>(&self, response: &axum::http::Response<B>) -> bool {
        let is_long = response.body().size_hint().upper().is_none_or(|bytes| bytes >= LEAST_BYTES);
        let kind = response.headers().get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
        let is_free = response.extensions().get::<Incompressible>().is_none();
        response.status().is_success() && is_long && is_free && is_text(kind.unwrap_or_default())
    }
}

/// Whether a content type is of text that is sent whole.
fn is_text(kind: &str) -> bool {
    let kind = kind.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    (kind.starts_with("text/") && kind != "text/event-stream")
        || ["application/json", "image/svg+xml", "model/gltf+json"].contains(&kind.as_str())
}

/// Gives what was compressed a tag of its own; it names the same version in conditions.
pub(super) async fn tell_compressed(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    if headers.get(header::CONTENT_ENCODING).is_none_or(|coding| coding != "gzip") {
        return response;
    }
    let tag =
        headers.get(header::ETAG).and_then(|tag| tag.to_str().ok()).and_then(|tag| tag.strip_suffix('"'));
    if let Some(tag) = tag.and_then(|tag| HeaderValue::try_from(format!("{tag}{COMPRESSED}\"")).ok()) {
        headers.insert(header::ETAG, tag);
    }
    response
}

/// Marks an answer that is never compressed.
#[derive(Clone, Copy, Debug)]
struct Incompressible;

/// Routes whose answers hold secrets: how long these become beside a caller's own words would tell of the secret (BREACH); and
/// of large files, whose ranges are of the file.
const NEVER: [&str; 5] = [
    "/api/v1/session",
    "/api/v1/tokens",
    "/api/v1/tokens/{id}",
    "/api/v1/exports/{id}/{file}",
    "/api/v1/snapshots/{id}/record.json",
];

/// Marks the answers of these.
pub(super) async fn mark(matched: Option<MatchedPath>, request: Request, next: Next) -> Response {
    let is_never = matched.is_some_and(|matched| NEVER.contains(&matched.as_str()));
    let mut response = next.run(request).await;
    if is_never {
        response.extensions_mut().insert(Incompressible);
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Body;
    use axum::http::StatusCode;

    #[test]
    fn only_long_text_that_holds_no_secrets_is_compressed() {
        let answer = |kind: &'static str, bytes: usize| {
            let mut answer = axum::http::Response::new(Body::from(vec![b' '; bytes]));
            answer.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
            answer
        };
        let check = |kind: &'static str, bytes, expected| {
            let mut answer = answer(kind, bytes);
            assert_eq!(WorthIt.should_compress(&answer), expected, "{kind}");
            *answer.status_mut() = StatusCode::NOT_FOUND;
            assert!(!WorthIt.should_compress(&answer), "{kind}");
        };
        check("application/json", 2000, true);
        check("application/json", 1000, false);
        check("text/html; charset=utf-8", 2000, true);
        check("image/svg+xml", 2000, true);
        check("image/jpeg", 2000, false);
        check("text/event-stream", 2000, false);
        check("multipart/x-mixed-replace; boundary=x", 2000, false);
        check("model/gltf-binary", 2000, false);
        check("video/mp4", 2000, false);
        let mut secret = answer("application/json", 2000);
        secret.extensions_mut().insert(Incompressible);
        assert!(!WorthIt.should_compress(&secret));
    }
}
