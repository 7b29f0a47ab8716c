//! `Idempotency-Key`: who asks for a job again, not knowing whether it was heard, gets the answer of the first time, and no
//! second job.
//!
//! Around what routes do that make something. Keys are of a caller (with the rights it has: who was given others is another
//! caller) and of a route. The answer to a request that went well is kept for a day, within bounds, and in memory: a daemon that
//! was started anew has forgotten it. A request that came to nothing leaves its key free.

use super::Api;
use super::error::Problem;
use super::tune::refuse_foreign;
use axum::body::{Body, Bytes, to_bytes};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use videofields_vision::access::Grants;
use videofields_vision::error::{ErrorKind, Fault};

/// The field that holds a key.
const FIELD: &str = "idempotency-key";

/// What tells that an answer is the first time's.
const REPLAYED: HeaderName = HeaderName::from_static("idempotency-replayed");

/// Most characters of a key.
const MAX_KEY_CHARS: usize = 255;

/// How long an answer is kept.
const KEPT_FOR: Duration = Duration::from_secs(24 * 3600);

/// Answers that are kept, of one caller and of all: a caller pushes none of others' out before its own.
const MAX_OF_CALLER: usize = 64;
const MAX_ANSWERS: usize = 1024;

/// Bytes of answers that are kept, and of one that is.
const MAX_BYTES: usize = 4 << 20;
const MAX_ANSWER_BYTES: usize = 256 << 10;

/// Fields of an answer that are kept with it.
const KEPT_FIELDS: [HeaderName; 4] =
    [header::CONTENT_TYPE, header::CACHE_CONTROL, header::LOCATION, header::ETAG];

/// Whose key it is, of what, and which.
#[derive(Clone, Debug, PartialEq)]
struct KeyOf {
    user: Option<String>,
    grants: Arc<Grants>,
    /// Method and path.
    route: &'static str,
    key: String,
}

/// An answer of the first time.
#[derive(Clone, Debug)]
struct Kept {
    status: StatusCode,
    fields: Vec<(HeaderName, HeaderValue)>,
    body: Bytes,
}

#[derive(Debug)]
struct Entry {
    of: KeyOf,
    /// SHA-256 of query and body.
    asked: [u8; 32],
    /// Monotonic time of the request.
    at: Duration,
    /// None while it is being answered.
    kept: Option<Kept>,
}

impl Entry {
    fn bytes(&self) -> usize {
        self.kept.as_ref().map_or(0, |kept| kept.body.len())
    }
}

/// What was asked for with a key, the oldest first.
#[derive(Debug, Default)]
pub(super) struct Answered(Mutex<VecDeque<Entry>>);

/// What is to be done about a request.
enum Turn {
    /// It is the first.
    First(Held),
    /// This was answered the first time.
    Again(Kept),
}

/// A key in hand; it is free again once this is gone, unless an answer was kept.
struct Held {
    answered: Arc<Answered>,
    of: KeyOf,
}

impl Drop for Held {
    fn drop(&mut self) {
        self.answered.lock().retain(|entry| entry.kept.is_some() || entry.of != self.of);
    }
}

impl Answered {
    fn lock(&self) -> MutexGuard<'_, VecDeque<Entry>> {
        // A panic leaves the list whole: it is changed entry by entry.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a key in hand.
    fn begin(self: &Arc<Self>, of: KeyOf, asked: [u8; 32], now: Duration) -> Result<Turn, Problem> {
        let mut entries = self.lock();
        entries.retain(|entry| entry.kept.is_none() || now.saturating_sub(entry.at) < KEPT_FOR);
        if let Some(entry) = entries.iter().find(|entry| entry.of == of) {
            if entry.asked != asked {
                return Err(Problem::key_reused());
            }
            let in_flight =
                || Problem::new(ErrorKind::Conflict, "a request with this Idempotency-Key is being answered");
            return entry.kept.clone().map(Turn::Again).ok_or_else(in_flight);
        }
        entries.push_back(Entry { of: of.clone(), asked, at: now, kept: None });
        drop(entries);
        Ok(Turn::First(Held { answered: Arc::clone(self), of }))
    }

    /// Keeps what came of it, and lets the oldest go where there is too much.
    fn keep(&self, held: &Held, kept: Kept) {
        let mut entries = self.lock();
        let Some(entry) = entries.iter_mut().find(|entry| entry.of == held.of) else { return };
        entry.kept = Some(kept);
        let is_own = |entry: &Entry| entry.of.user == held.of.user && entry.kept.is_some();
        while entries.iter().filter(|entry| is_own(entry)).count() > MAX_OF_CALLER {
            let oldest = entries.iter().position(is_own);
            oldest.and_then(|oldest| entries.remove(oldest));
        }
        while entries.len() > MAX_ANSWERS || entries.iter().map(Entry::bytes).sum::<usize>() > MAX_BYTES {
            let Some(oldest) = first_to_go(&entries) else { break };
            entries.remove(oldest);
        }
    }
}

/// Returns the oldest answer of the caller whose answers take most room.
fn first_to_go(entries: &VecDeque<Entry>) -> Option<usize> {
    let mut rooms: BTreeMap<&Option<String>, usize> = BTreeMap::new();
    for entry in entries.iter().filter(|entry| entry.kept.is_some()) {
        // One of no bytes takes its place too.
        *rooms.entry(&entry.of.user).or_default() += entry.bytes() + MAX_BYTES / MAX_ANSWERS;
    }
    let most = rooms.into_iter().max_by_key(|(_, room)| *room)?.0;
    entries.iter().position(|entry| entry.kept.is_some() && entry.of.user == *most)
}

/// A request that may have a key.
pub(super) struct Wanted<'a> {
    /// Method and path, as the caller's words for what it asks for.
    pub(super) route: &'static str,
    pub(super) headers: &'a HeaderMap,
    pub(super) query: Option<&'a str>,
    pub(super) body: &'a [u8],
}

/// What was answered before, if the request has a key that was heard already; else what `answering` comes to.
pub(super) async fn once(
    api: &Api,
    Wanted { route, headers, query, body }: Wanted<'_>,
    answering: impl Future<Output = Result<Response, Problem>>,
) -> Result<Response, Problem> {
    let Some(key) = key_of(headers)? else { return answering.await };
    refuse_foreign(&api.site, headers)?;
    let caller = api.identity.caller.clone();
    let of = KeyOf { user: caller.user, grants: caller.grants, route, key };
    let asked = digest(query.unwrap_or_default(), body);
    let held = match api.answered.begin(of, asked, api.clock.monotonic())? {
        Turn::Again(kept) => return Ok(replayed(kept)),
        Turn::First(held) => held,
    };
    let response = answering.await?;
    if !response.status().is_success() {
        return Ok(response);
    }
    let (parts, body) = response.into_parts();
    let body = to_bytes(body, MAX_ANSWER_BYTES).await.map_err(|error| {
        Problem::new(ErrorKind::Internal, format!("an answer that is to be kept: {error}"))
    })?;
    let field = |name: &HeaderName| parts.headers.get(name).map(|value| (name.clone(), value.clone()));
    let fields = KEPT_FIELDS.iter().filter_map(field).collect();
    api.answered.keep(&held, Kept { status: parts.status, fields, body: body.clone() });
    Ok(Response::from_parts(parts, Body::from(body)))
}

/// The key of a request: a text in quotation marks (as the draft for the field has it), or without.
fn key_of(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    let mut fields = headers.get_all(FIELD).iter();
    let Some(field) = fields.next() else { return Ok(None) };
    let text = field.to_str().ok().map(str::trim).filter(|_| fields.next().is_none());
    let bare = |text: &str| {
        let inner = text.strip_prefix('"').map_or(Some(text), |text| text.strip_suffix('"'));
        inner.map(str::to_owned)
    };
    let is_good = |key: &String| {
        (1..=MAX_KEY_CHARS).contains(&key.len())
            && key.bytes().all(|byte| byte.is_ascii_graphic() && byte != b'"')
    };
    text.and_then(bare).filter(is_good).map(Some).ok_or_else(|| {
        let message = format!("expected one key of 1 to {MAX_KEY_CHARS} visible characters, such as a UUID");
        Problem::at(ErrorKind::Invalid, vec![Fault::new("Idempotency-Key", message)])
    })
}

fn digest(query: &str, body: &[u8]) -> [u8; 32] {
    let mut digest = Sha256::new();
    digest.update((query.len() as u64).to_le_bytes());
    digest.update(query);
    digest.update(body);
    digest.finalize().into()
}

fn replayed(Kept { status, fields, body }: Kept) -> Response {
    let mut response = (status, body).into_response();
    response.headers_mut().remove(header::CONTENT_TYPE);
    for (name, value) in fields {
        response.headers_mut().insert(name, value);
    }
    response.headers_mut().insert(REPLAYED, HeaderValue::from_static("true"));
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(user: &str, key: &str) -> KeyOf {
        let grants = Arc::new(Grants::nothing());
        KeyOf { user: Some(user.to_owned()), grants, route: "POST /x", key: key.to_owned() }
    }

    fn kept(bytes: usize) -> Kept {
        Kept { status: StatusCode::ACCEPTED, fields: Vec::new(), body: Bytes::from(vec![0; bytes]) }
    }

    fn first(answered: &Arc<Answered>, of: KeyOf, now: Duration) -> Held {
        match answered.begin(of, [1; 32], now) {
            Ok(Turn::First(held)) => held,
            _ => panic!("it is not the first"),
        }
    }

    fn is_kept(answered: &Arc<Answered>, of: KeyOf, now: Duration) -> bool {
        matches!(answered.begin(of, [1; 32], now), Ok(Turn::Again(_)))
    }

    #[test]
    fn a_key_is_free_again_once_its_request_came_to_nothing() {
        let answered = Arc::new(Answered::default());
        let held = first(&answered, of("a", "k"), Duration::ZERO);
        assert!(answered.begin(of("a", "k"), [1; 32], Duration::ZERO).is_err(), "in flight");
        drop(held);
        let held = first(&answered, of("a", "k"), Duration::ZERO);
        answered.keep(&held, kept(1));
        drop(held);
        assert!(is_kept(&answered, of("a", "k"), Duration::from_secs(86_399)));
        assert!(answered.begin(of("a", "k"), [2; 32], Duration::ZERO).is_err(), "another request");
        drop(first(&answered, of("b", "k"), Duration::ZERO));
        drop(first(&answered, of("a", "k"), Duration::from_secs(86_400)));
    }

    #[test]
    fn a_caller_pushes_out_its_own_answers_and_all_are_bounded() {
        let answered = Arc::new(Answered::default());
        let ask = |user: &str, key: &str, bytes| {
            let held = first(&answered, of(user, key), Duration::ZERO);
            answered.keep(&held, kept(bytes));
        };
        ask("quiet", "one", 10);
        for number in 0..=MAX_OF_CALLER {
            ask("busy", &number.to_string(), 10);
        }
        assert!(is_kept(&answered, of("quiet", "one"), Duration::ZERO));
        assert!(is_kept(&answered, of("busy", "1"), Duration::ZERO));
        assert_eq!(answered.lock().len(), MAX_OF_CALLER + 1);
        for number in 0..64 {
            ask("large", &number.to_string(), MAX_ANSWER_BYTES);
        }
        assert!(is_kept(&answered, of("quiet", "one"), Duration::ZERO), "what is large pushes out its own");
        for number in 0..64 {
            ask(&format!("large-{number}"), "one", MAX_ANSWER_BYTES);
        }
        assert!(answered.lock().iter().map(Entry::bytes).sum::<usize>() <= MAX_BYTES);
        for number in 0..2 * MAX_ANSWERS {
            ask(&format!("user-{number}"), "one", 1);
        }
        assert!(answered.lock().len() <= MAX_ANSWERS);
    }

    #[test]
    fn keys_are_visible_text() {
        let key = |text: &'static str| {
            key_of(&HeaderMap::from_iter([(HeaderName::from_static(FIELD), HeaderValue::from_static(text))]))
        };
        assert_eq!(key_of(&HeaderMap::new()).ok().flatten(), None);
        assert_eq!(key("\"8e03978e\"").ok().flatten().as_deref(), Some("8e03978e"));
        assert_eq!(key("8e03978e").ok().flatten().as_deref(), Some("8e03978e"));
        for bad in ["", "\"\"", "a b", "\"a", "a\"b"] {
            assert!(key(bad).is_err(), "{bad}");
        }
    }
}
