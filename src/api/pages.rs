//! Long lists in pages, everywhere alike: `limit` says how many, an answer's `next` goes into `cursor` of the question for
//! more, and `Link` has that question ready.
//!
//! A cursor is the place of what was told last, not a count: what is added or taken away meanwhile moves no page.

use super::parameters::Parameter;
use super::query::Query;
use axum::Json;
use axum::http::{HeaderValue, Uri, header};
use axum::response::{IntoResponse, Response};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde_json::{Value, json};

/// What goes on behind an answer.
pub(super) const CURSOR: Parameter = Parameter::text(
    "cursor",
    ("^[A-Za-z0-9:_-]{1,200}$", "1772369883200000000:north:412"),
    "`next` of an answer to the same question: goes on behind it",
);

/// Most bytes of a cursor.
const MAX_CURSOR_BYTES: usize = 200;

/// What is escaped of a cursor in a link.
const ESCAPED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'_').remove(b':');

/// Most of one answer where a route says nothing else, and how many where the request says nothing.
pub(super) const MOST: u32 = 1000;
const USUAL: u32 = 100;

/// How many are asked for.
pub(super) const LIMIT: Parameter =
    Parameter::whole("limit", &(1..=MOST as u64), "Most of one answer").default_is("100");

/// How many a query asks for.
pub(super) fn limit(query: &mut Query) -> usize {
    query.whole("limit", &(1..=MOST)).unwrap_or(USUAL) as usize
}

/// Where a query goes on, as `read` understands it.
pub(super) fn cursor<T>(query: &mut Query, read: impl FnOnce(&str) -> Option<T>) -> Option<T> {
    query.value("cursor", "what an answer gave as next", |text| read(text).filter(|_| is_cursor(text)))
}

/// Whether a text looks as [`CURSOR`] says that cursors do.
fn is_cursor(text: &str) -> bool {
    let is_of_one = |byte: u8| byte.is_ascii_alphanumeric() || b":_-".contains(&byte);
    (1..=MAX_CURSOR_BYTES).contains(&text.len()) && text.bytes().all(is_of_one)
}

/// Cuts a list to `limit`; whether it had more.
pub(super) fn cut<T>(list: &mut Vec<T>, limit: usize) -> bool {
    let has_more = list.len() > limit;
    list.truncate(limit);
    has_more
}

/// A page: `body` with `next`, and where there is more, the question for it.
pub(super) fn answer(uri: &Uri, mut body: Value, next: Option<String>) -> Response {
    body["next"] = json!(next);
    let mut response = ([(header::CACHE_CONTROL, "no-store")], Json(body)).into_response();
    let link = next.map(|next| format!("<{}>; rel=\"next\"", target(uri, &next)));
    if let Some(Ok(link)) = link.map(HeaderValue::try_from) {
        response.headers_mut().insert(header::LINK, link);
    }
    response
}

/// The same question behind `next`.
fn target(uri: &Uri, next: &str) -> String {
    let parts = uri.query().unwrap_or_default().split('&');
    let kept = parts.filter(|part| !part.is_empty() && part.split('=').next() != Some("cursor"));
    let cursor = format!("cursor={}", utf8_percent_encode(next, ESCAPED));
    let query: Vec<&str> = kept.chain([cursor.as_str()]).collect();
    format!("{}?{}", uri.path(), query.join("&"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_asks_the_same_behind_what_was_told() {
        let check = |asked: &str, next: &str, expected: &str| {
            assert_eq!(target(&asked.parse().unwrap(), next), expected);
        };
        check("/api/v1/audit", "7", "/api/v1/audit?cursor=7");
        check("/api/v1/audit?cursor=3&limit=5", "8", "/api/v1/audit?limit=5&cursor=8");
        check("/x?from=1&&cursor=a&to=2", "9:north:4", "/x?from=1&to=2&cursor=9:north:4");
        check("/x", "a>b\"\r\n", "/x?cursor=a%3Eb%22%0D%0A");
    }

    #[test]
    fn the_last_page_has_no_link() {
        let answer = |next: Option<&str>| {
            let uri = "/x".parse().unwrap();
            answer(&uri, json!({}), next.map(str::to_owned)).headers().get("link").cloned()
        };
        assert_eq!(answer(Some("1")).unwrap(), "</x?cursor=1>; rel=\"next\"");
        assert_eq!(answer(None), None);
    }
}
