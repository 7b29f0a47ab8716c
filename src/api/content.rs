//! Request bodies whose refusal is a problem document like any other.

use super::error::Problem;
use crate::error::ErrorKind;
use axum::body::Bytes;
use axum::extract::{FromRequest, Request};
use axum::http::StatusCode;

/// Most bytes of a body where a route says nothing else.
pub(super) const MAX_BODY_BYTES: usize = 1 << 20;

/// A request's whole body.
pub(super) struct Content(pub(super) Bytes);

impl<S: Send + Sync> FromRequest<S> for Content {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<Self, Problem> {
        match Bytes::from_request(request, state).await {
            Ok(bytes) => Ok(Self(bytes)),
            Err(rejection) if rejection.status() == StatusCode::PAYLOAD_TOO_LARGE => {
                Err(Problem::content_too_large())
            }
            Err(rejection) => Err(Problem::new(ErrorKind::Invalid, rejection.body_text())),
        }
    }
}
