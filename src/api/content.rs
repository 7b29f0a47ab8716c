//! Request bodies whose refusal is a problem document like any other.

use super::Api;
use super::error::Problem;
use axum::body::Bytes;
use axum::extract::{FromRequest, Request};
use axum::http::StatusCode;
use videofields_vision::error::ErrorKind;

/// Most bytes of a body where a route says nothing else.
pub(super) const MAX_BODY_BYTES: usize = 1 << 20;

/// A request's whole body, within the time that a request has.
pub(super) struct Content(pub(super) Bytes);

impl FromRequest<Api> for Content {
    type Rejection = Problem;

    async fn from_request(request: Request, api: &Api) -> Result<Self, Problem> {
        // What changes something goes on when its time is over: a body that never comes must not.
        let time = api.limits.request_time;
        let Ok(read) = tokio::time::timeout(time, Bytes::from_request(request, api)).await else {
            return Err(Problem::content_too_late(time));
        };
        match read {
            Ok(bytes) => Ok(Self(bytes)),
            Err(rejection) if rejection.status() == StatusCode::PAYLOAD_TOO_LARGE => {
                Err(Problem::content_too_large())
            }
            Err(rejection) => Err(Problem::new(ErrorKind::Invalid, rejection.body_text())),
        }
    }
}
