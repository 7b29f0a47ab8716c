//! Path parameters whose refusal is a problem document like any other.

use super::error::Problem;
use axum::extract::{FromRequestParts, Path};
use axum::http::request::Parts;
use serde::de::DeserializeOwned;
use videofields_vision::error::ErrorKind;

/// The named segments of a request's path, unescaped.
pub(super) struct Segments<T>(pub(super) T);

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for Segments<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        match Path::<T>::from_request_parts(parts, state).await {
            Ok(Path(segments)) => Ok(Self(segments)),
            Err(rejection) if rejection.status().is_client_error() => {
                Err(Problem::new(ErrorKind::Invalid, "the path's escapes are not UTF-8"))
            }
            Err(rejection) => Err(Problem::new(ErrorKind::Internal, rejection.body_text())),
        }
    }
}
