//! Files that are handed out whole or in ranges: what was recorded, and pictures that are kept as evidence.

use super::error::Problem;
use super::operation::{Answer, Operation};
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::fs::File;
use tower_http::services::ServeFile;
use videofields_recording::media::descriptor_path;
use videofields_vision::error::ErrorKind;

/// The operation as one that hands out a file of one of these media types.
pub(super) fn described(
    operation: Operation,
    meaning: &'static str,
    media_types: &[&'static str],
) -> Operation {
    let whole = Answer::bytes(200, meaning, media_types)
        .field("Accept-Ranges", "`bytes`")
        .field("Last-Modified", "When it was written; `If-Modified-Since` takes it");
    let part = Answer::bytes(206, "Bytes of it", media_types).field("Content-Range", "Which of how many");
    operation
        .ranged()
        .answers(whole)
        .answers(part)
        .answers(Answer::nothing(304, "It is as old as the caller's"))
}

/// What was opened, whole, or the one range that is asked for. A `Range` that is none, or several, is as if it were not there
/// (RFC 9110, section 14.2).
pub(super) async fn answer(opened: &File, mut request: Request) -> Result<Response, Problem> {
    let gone = |error: std::io::Error| {
        Problem::new(ErrorKind::Unavailable, format!("the file cannot be read: {}", error.kind()))
    };
    if let Some(asked) = request.headers_mut().remove(header::RANGE)
        && let Some(range) = one_range(&asked)
    {
        request.headers_mut().insert(header::RANGE, range);
    }
    // The file that was opened, whatever its name leads to by now.
    let response = ServeFile::new(descriptor_path(opened)).try_call(request).await.map_err(gone)?;
    match response.status() {
        StatusCode::NOT_FOUND => Err(gone(std::io::ErrorKind::NotFound.into())),
        StatusCode::PRECONDITION_FAILED => {
            Err(Problem::new(ErrorKind::Changed, "the file is younger than If-Unmodified-Since"))
        }
        StatusCode::RANGE_NOT_SATISFIABLE => {
            let size_bytes = opened.metadata().map_err(gone)?.len();
            let mut refused = Problem::range(size_bytes).into_response();
            if let Ok(size) = HeaderValue::try_from(format!("bytes */{size_bytes}")) {
                refused.headers_mut().insert(header::CONTENT_RANGE, size);
            }
            Ok(refused)
        }
        _ => Ok(response.map(Body::new)),
    }
}

/// The one range of bytes that it is, from a byte on or of the last bytes, as `bytes=` (units are of either case).
fn one_range(value: &HeaderValue) -> Option<HeaderValue> {
    let (unit, range) = value.to_str().ok()?.split_once('=')?;
    let (first, last) = range.trim().split_once('-')?;
    // Longer numbers than any file has bytes are none.
    let is_number = |text: &str| text.len() <= 18 && text.bytes().all(|byte| byte.is_ascii_digit());
    let is_one = unit.eq_ignore_ascii_case("bytes") && is_number(first) && is_number(last);
    let has_end = !(first.is_empty() && last.is_empty());
    (is_one && has_end).then(|| HeaderValue::try_from(format!("bytes={first}-{last}")).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    #[tokio::test]
    async fn one_range_is_taken_and_what_is_none_is_ignored() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(b"0123456789").unwrap();
        for (range, status, told) in [
            ("bytes=2-4", 206, "bytes 2-4/10"),
            ("BYTES=8-", 206, "bytes 8-9/10"),
            ("bytes=-3", 206, "bytes 7-9/10"),
            ("bytes=0-99", 206, "bytes 0-9/10"),
            ("bytes=10-", 416, "bytes */10"),
            ("bytes=4-2", 416, "bytes */10"),
            ("bytes=-", 200, ""),
            ("bytes=0-1,4-5", 200, ""),
            ("bytes=99999999999999999999-", 200, ""),
            ("lines=0-1", 200, ""),
            ("bytes", 200, ""),
        ] {
            let request = Request::builder().header(header::RANGE, range).body(Body::empty()).unwrap();
            let response = answer(file.as_file(), request).await.unwrap();
            let of = response.headers().get(header::CONTENT_RANGE).map_or("", |of| of.to_str().unwrap());
            assert_eq!((response.status().as_u16(), of), (status, told), "{range}");
        }
        let early = "Thu, 01 Jan 1970 00:00:01 GMT";
        let request =
            Request::builder().header(header::IF_UNMODIFIED_SINCE, early).body(Body::empty()).unwrap();
        let refused = answer(file.as_file(), request).await.unwrap_err().into_response();
        assert_eq!(refused.status(), StatusCode::PRECONDITION_FAILED);
    }
}
