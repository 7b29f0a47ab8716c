//! What a caller reads when a request fails: RFC 9457 problem documents, and the one map from what a caller can do
//! about a failure to an HTTP status.
//!
//! Failures of the rooms flow in, a [`Problem`] flows out; `guard` writes it down as the answer's body, since only
//! there the request's path is known. What a client may not read (the text of an internal fault) stays aside for
//! the log.

use axum::body::Body;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use std::time::Duration;
use videofields_recording::accounts::AccountError;
use videofields_recording::store::StoreError;
use videofields_service::catalog::CatalogError;
use videofields_service::engine::EngineError;
use videofields_vision::encode::EncodeError;
use videofields_vision::error::{ErrorKind, Fault, join_faults};

/// Why a request failed, on its way to become a problem document.
#[derive(Clone, Debug)]
pub(super) struct Problem {
    class: Class,
    detail: String,
    errors: Vec<Fault>,
    /// What only the log may say.
    internal: Option<String>,
    /// After how many seconds a 429 or 503 may be asked again.
    retry_after_secs: u64,
}

/// After how many seconds a 503 of which nothing else is known may be asked again.
const RETRY_AFTER_SECS: u64 = 1;

/// Returns whole seconds, a little later rather than too early.
fn whole_secs(after: Duration) -> u64 {
    (after.as_secs_f64().ceil() as u64).max(RETRY_AFTER_SECS)
}

/// A class of problems: its status, the last part of its type's URN and its title.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Class {
    status: StatusCode,
    slug: &'static str,
    title: &'static str,
}

const fn class(status: StatusCode, slug: &'static str, title: &'static str) -> Class {
    Class { status, slug, title }
}

/// The one map from what a caller can do about a failure to an HTTP status.
const fn class_of(kind: ErrorKind) -> Class {
    match kind {
        ErrorKind::Invalid => class(StatusCode::BAD_REQUEST, "invalid", "The request is wrong"),
        ErrorKind::NotFound => class(StatusCode::NOT_FOUND, "not-found", "There is no such thing"),
        ErrorKind::Unauthenticated => {
            class(StatusCode::UNAUTHORIZED, "unauthenticated", "It is not known who you are")
        }
        ErrorKind::Changed => class(StatusCode::PRECONDITION_FAILED, "changed", "It was changed meanwhile"),
        ErrorKind::Conflict => class(StatusCode::CONFLICT, "conflict", "It does not go with what there is"),
        ErrorKind::Throttled => class(StatusCode::TOO_MANY_REQUESTS, "throttled", "Too many requests"),
        ErrorKind::Forbidden => class(StatusCode::FORBIDDEN, "forbidden", "You may not do that"),
        ErrorKind::Unsupported => {
            class(StatusCode::NOT_IMPLEMENTED, "unsupported", "This daemon cannot do that")
        }
        ErrorKind::TooLarge => {
            class(StatusCode::UNPROCESSABLE_ENTITY, "too-large", "More is asked for than a limit allows")
        }
        ErrorKind::StorageFull => {
            class(StatusCode::INSUFFICIENT_STORAGE, "storage-full", "The daemon's disk is full")
        }
        ErrorKind::Unavailable => class(StatusCode::SERVICE_UNAVAILABLE, "unavailable", "Not now"),
        ErrorKind::Internal => {
            class(StatusCode::INTERNAL_SERVER_ERROR, "internal", "The daemon met a fault of its own")
        }
    }
}

impl Problem {
    /// A failure of that kind; `detail` is what the client reads, or what the log says of an internal fault.
    pub(super) fn new(kind: ErrorKind, detail: impl Into<String>) -> Self {
        let class = class_of(kind);
        let detail = detail.into();
        if matches!(kind, ErrorKind::Internal) {
            let public = "the daemon could not answer; its log says why".to_owned();
            return Self { internal: Some(detail), ..Self::of(class, public) };
        }
        Self::of(class, detail)
    }

    const fn of(class: Class, detail: String) -> Self {
        Self { class, detail, errors: Vec::new(), internal: None, retry_after_secs: RETRY_AFTER_SECS }
    }

    /// A failure at named places of the request.
    pub(super) fn at(kind: ErrorKind, errors: Vec<Fault>) -> Self {
        Self { errors: errors.clone(), ..Self::new(kind, join_faults(&errors)) }
    }

    /// The named places of the request that are at fault.
    pub(super) fn into_faults(self) -> Vec<Fault> {
        self.errors
    }

    /// What the client reads of it.
    pub(super) fn into_detail(self) -> String {
        self.detail
    }

    /// Something that is not there, with the names of what is.
    pub(super) fn missing(what: &str, name: &str, there_are: &[&str]) -> Self {
        let shown = super::query::shown(name);
        let listed = super::query::listed(name, there_are);
        Self::new(ErrorKind::NotFound, format!("there is no {what} {shown}; {listed}"))
    }

    /// A method that the route does not take; `detail` says which it does.
    pub(super) fn method(detail: &str) -> Self {
        let class = class(StatusCode::METHOD_NOT_ALLOWED, "method", "The method is not allowed");
        Self::of(class, detail.to_owned())
    }

    /// A change that came without a condition.
    pub(super) fn precondition_required() -> Self {
        let class =
            class(StatusCode::PRECONDITION_REQUIRED, "precondition-required", "A condition is needed");
        let detail =
            "send If-Match with the ETag of what you change, or If-None-Match: * to make something new";
        Self::of(class, detail.to_owned())
    }

    /// A key of another request.
    pub(super) fn key_reused() -> Self {
        let status = StatusCode::UNPROCESSABLE_ENTITY;
        let class = class(status, "key-reused", "The key was another request's");
        let detail =
            "with this Idempotency-Key something else was asked for; another request needs another key";
        Self::of(class, detail.to_owned())
    }

    /// A target of more than `limit_bytes`.
    pub(super) fn target_too_long(limit_bytes: usize) -> Self {
        let class = class(StatusCode::URI_TOO_LONG, "target-too-long", "The request's target is too long");
        let detail = format!("path and query together may have {limit_bytes} bytes");
        Self::of(class, detail)
    }

    /// A request to a host that this daemon is not known by.
    pub(super) fn host(name: &str) -> Self {
        let class = class(StatusCode::MISDIRECTED_REQUEST, "host", "The daemon is not known by that name");
        let shown = super::query::shown(name);
        let detail = format!("{shown} is neither an IP address nor localhost nor listed in server.hosts");
        Self::of(class, detail)
    }

    /// Header fields of more than `limit_bytes`.
    pub(super) fn fields_too_large(limit_bytes: usize) -> Self {
        let status = StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE;
        let class = class(status, "fields-too-large", "The request's header fields are too large");
        let detail = format!("header fields together may have {limit_bytes} bytes");
        Self::of(class, detail)
    }

    /// A range that has no byte of a file of that size.
    pub(super) fn range(size_bytes: u64) -> Self {
        let status = StatusCode::RANGE_NOT_SATISFIABLE;
        let class = class(status, "range", "No byte of the file lies in the range");
        Self::of(class, format!("the file has {size_bytes} bytes"))
    }

    /// A body of more bytes than its route takes.
    pub(super) fn content_too_large() -> Self {
        let class =
            class(StatusCode::PAYLOAD_TOO_LARGE, "content-too-large", "The request's body is too large");
        let detail =
            "a scene document may have 4 MiB, a glTF 32 MiB, a file of scenes 64 MiB, any other body 1 MiB";
        Self::of(class, detail.to_owned())
    }

    /// More than somebody may ask within a time, who may ask again after `wait`.
    pub(super) fn throttled(detail: String, wait: Duration) -> Self {
        Self { retry_after_secs: whole_secs(wait), ..Self::new(ErrorKind::Throttled, detail) }
    }

    /// A body that did not come within `time`.
    pub(super) fn content_too_late(time: Duration) -> Self {
        let class = class(StatusCode::REQUEST_TIMEOUT, "timeout", "The request took too long");
        Self::of(class, format!("the body did not come within {:.1} s", time.as_secs_f64()))
    }

    /// Whether the same may go well a little later.
    pub(super) fn may_pass(&self) -> bool {
        let statuses =
            [StatusCode::SERVICE_UNAVAILABLE, StatusCode::UNPROCESSABLE_ENTITY, StatusCode::NOT_FOUND];
        statuses.contains(&self.class.status)
    }

    /// What the log must say, where the client reads nothing of it.
    pub(super) fn internal(&self) -> Option<&str> {
        self.internal.as_deref()
    }

    /// The problem document for a request of `path`.
    pub(super) fn document(&self, path: &str) -> Vec<u8> {
        let document = Document {
            kind: format!("urn:videofields:problem:{}", self.class.slug),
            title: self.class.title,
            status: self.class.status.as_u16(),
            detail: &self.detail,
            instance: path,
            errors: self.errors.iter().map(Place::from).collect(),
        };
        serde_json::to_vec(&document).unwrap_or_default()
    }
}

/// RFC 9457, section 3.1; `errors` is the extension of its section 3.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(rename = "type")]
    kind: String,
    title: &'static str,
    status: u16,
    detail: &'a str,
    instance: &'a str,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    errors: Vec<Place<'a>>,
}

#[derive(Serialize)]
struct Place<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    pointer: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    parameter: Option<&'a str>,
    detail: &'a str,
}

impl<'a> From<&'a Fault> for Place<'a> {
    fn from(fault: &'a Fault) -> Self {
        let place = fault.place.as_str();
        let is_pointer = place.is_empty() || place.starts_with('/');
        Self {
            pointer: is_pointer.then_some(place),
            parameter: (!is_pointer).then_some(place),
            detail: &fault.message,
        }
    }
}

impl IntoResponse for Problem {
    /// Status and header fields; the body is written by `guard`, which finds the problem among the extensions.
    fn into_response(self) -> Response {
        let mut response = Response::new(Body::empty());
        *response.status_mut() = self.class.status;
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if self.class.status == StatusCode::UNAUTHORIZED {
            headers
                .insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"videofields\""));
        }
        let statuses = [StatusCode::SERVICE_UNAVAILABLE, StatusCode::TOO_MANY_REQUESTS];
        if statuses.contains(&self.class.status) {
            headers.insert(header::RETRY_AFTER, HeaderValue::from(self.retry_after_secs));
        }
        response.extensions_mut().insert(self);
        response
    }
}

impl From<EngineError> for Problem {
    fn from(error: EngineError) -> Self {
        let kind = error.kind();
        let retry_after_secs = error.retry_after().map_or(RETRY_AFTER_SECS, whole_secs);
        let problem = match (&error, error.fault()) {
            (_, Some(fault)) => Self::at(kind, vec![fault.clone()]),
            (EngineError::Gap { .. }, None) => {
                let fault = Fault::new("t", error.to_string());
                Self { errors: vec![fault], ..Self::new(kind, error.to_string()) }
            }
            (EngineError::Faults(faults), None) => Self::at(kind, faults.clone()),
            (_, None) => Self::new(kind, error.to_string()),
        };
        Self { retry_after_secs, ..problem }
    }
}

impl From<&StoreError> for Problem {
    /// The file's place is told to the log alone; of what only its keeper can mend, the caller learns no more than that.
    fn from(error: &StoreError) -> Self {
        match error.kind() {
            kind @ ErrorKind::TooLarge => Self::new(kind, error.without_path()),
            kind @ (ErrorKind::StorageFull | ErrorKind::Unavailable) => {
                Self { internal: Some(error.to_string()), ..Self::new(kind, error.without_path()) }
            }
            _ => Self::new(ErrorKind::Internal, error.to_string()),
        }
    }
}

impl From<AccountError> for Problem {
    fn from(error: AccountError) -> Self {
        let kind = error.kind();
        match error {
            AccountError::Store(error) => (&*error).into(),
            AccountError::Faults(faults) => Self::at(kind, faults),
            AccountError::Throttled { wait } => Self::throttled(error.to_string(), wait),
            error => Self::new(kind, error.to_string()),
        }
    }
}

impl From<CatalogError> for Problem {
    fn from(error: CatalogError) -> Self {
        match error {
            CatalogError::Faults(faults) => Self::at(ErrorKind::Invalid, faults),
            CatalogError::Engine(error) => error.into(),
            CatalogError::Store(error) => (&*error).into(),
            CatalogError::Files { .. } if error.kind() == ErrorKind::StorageFull => {
                let public = "the disk with the daemon's files is full: nothing was changed";
                Self { internal: Some(error.to_string()), ..Self::new(ErrorKind::StorageFull, public) }
            }
            error => Self::new(error.kind(), error.to_string()),
        }
    }
}

impl From<EncodeError> for Problem {
    fn from(error: EncodeError) -> Self {
        Self::new(error.kind(), error.to_string())
    }
}

/// The answer to a method that a route does not take; `allowed` are those it does.
pub(super) fn only(allowed: &[&str]) -> Response {
    let listed = match allowed {
        [one] => format!("only {one} is answered here"),
        [first @ .., last] => format!("only {} and {last} are answered here", first.join(", ")),
        [] => "nothing is answered here".to_owned(),
    };
    let mut response = Problem::method(&listed).into_response();
    if let Ok(allowed) = HeaderValue::try_from(allowed.join(", ")) {
        response.headers_mut().insert(header::ALLOW, allowed);
    }
    response
}

/// Every status with which a described method may fail, with what the contract calls it.
pub(super) const PROBLEMS: [(u16, &str, &str); 19] = [
    (400, "Invalid", "The request is wrong: a parameter, a segment of the path or the body"),
    (401, "Unauthenticated", "It is not known who asks"),
    (403, "Forbidden", "The caller may not do that"),
    (404, "NotFound", "There is no such thing, or none that the caller may know of"),
    (408, "TooLate", "The body did not come in time"),
    (409, "Conflict", "It does not go with what there is"),
    (412, "Changed", "It was changed meanwhile, or is there already"),
    (413, "ContentTooLarge", "The body is too large"),
    (414, "TargetTooLong", "Path and query together are too long"),
    (416, "RangeNotSatisfiable", "No byte of the file lies in the range"),
    (421, "ForeignHost", "The daemon is not known by the name that the request is addressed to"),
    (422, "TooLarge", "More is asked for than a limit allows"),
    (428, "PreconditionRequired", "A change needs If-Match or If-None-Match"),
    (429, "Throttled", "Too many tries to log in, or too many changes by one user"),
    (431, "FieldsTooLarge", "The header fields are too large"),
    (500, "Internal", "The daemon met a fault of its own; its log says which"),
    (501, "Unsupported", "This daemon cannot do that"),
    (503, "Unavailable", "Not now"),
    (507, "StorageFull", "The daemon's disk is full"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_its_own_status() {
        let check = |kind, status: u16| {
            assert_eq!(Problem::new(kind, "x").into_response().status().as_u16(), status, "{kind:?}");
        };
        check(ErrorKind::Invalid, 400);
        check(ErrorKind::NotFound, 404);
        check(ErrorKind::Unauthenticated, 401);
        check(ErrorKind::Forbidden, 403);
        check(ErrorKind::Conflict, 409);
        check(ErrorKind::Changed, 412);
        check(ErrorKind::Throttled, 429);
        check(ErrorKind::Unsupported, 501);
        check(ErrorKind::TooLarge, 422);
        check(ErrorKind::StorageFull, 507);
        check(ErrorKind::Unavailable, 503);
        check(ErrorKind::Internal, 500);
    }

    #[test]
    fn places_are_pointers_or_parameters() {
        let faults =
            vec![Fault::new("/ground/0", "a"), Fault::new("width", "b"), Fault::new("", "whole document")];
        let document = Problem::at(ErrorKind::Invalid, faults).document("/x");
        let document: serde_json::Value = serde_json::from_slice(&document).unwrap();
        let expected = serde_json::json!([
            {"pointer": "/ground/0", "detail": "a"},
            {"parameter": "width", "detail": "b"},
            {"pointer": "", "detail": "whole document"},
        ]);
        assert_eq!(document["errors"], expected);
        assert_eq!(document["instance"], "/x");
    }

    #[test]
    fn where_the_database_lies_is_told_to_the_log_alone() {
        let check = |error: StoreError, status: u16| {
            let problem = Problem::from(CatalogError::from(error));
            let document = String::from_utf8(problem.document("/x")).unwrap();
            assert!(!document.contains("secret"), "{document}");
            assert!(problem.internal().is_some_and(|told| told.contains("/secret/a.sqlite")));
            assert_eq!(problem.into_response().status().as_u16(), status);
        };
        let path = || "/secret/a.sqlite".into();
        check(StoreError::DiskFull { path: path() }, 507);
        check(StoreError::Busy { path: path() }, 503);
        check(StoreError::Failing { path: path(), detail: "disk I/O error".to_owned() }, 503);
        check(StoreError::Damaged { path: path(), detail: "page 3".to_owned() }, 500);
        check(StoreError::NotWritable { path: path(), reason: "unable to open".to_owned() }, 500);
    }

    #[test]
    fn an_internal_fault_is_told_to_the_log_alone() {
        let problem = Problem::new(ErrorKind::Internal, "disk /dev/sda1 is on fire");
        assert_eq!(problem.internal(), Some("disk /dev/sda1 is on fire"));
        assert!(!String::from_utf8(problem.document("/x")).unwrap().contains("sda1"));
    }
}
