//! `/api/v1/audit`: who did what; and the layer that notes it.
//!
//! Noted is whatever changes something, whatever came of it, and who looked at what cameras saw, and of the past at which
//! time ([`looks`]): of the same caller, target and ten minutes of the past once in ten minutes, so that a wall that pulls
//! thirty pictures a second is a line and not a flood; and what was refused, of one user, route and status once in ten minutes with
//! a count, of strangers once a route. What is only tried (`validate_only`) and questions that keep nothing change nothing: pages ask
//! them while somebody types or drags. Who is no administrator has so many changes and no more ([`super::change_budget`]), since no entry is
//! left out.
//!
//! An entry is on disk before the answer goes out, and is written also where the caller leaves before. Where it cannot be written,
//! nothing of the past is shown; what is live is, and what was changed is changed.

use super::Api;
use super::change_budget::{ChangeKind, is_change, is_counted};
use super::error::Problem;
use super::identity::{Asked, Identity};
use super::looks::{self, Looks, Span};
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::pages;
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::schema;
use super::users;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{Method, StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use percent_encoding::percent_decode_str;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::time::Duration;
use videofields_recording::accounts::{Once, OnceKind, Unwritten};
use videofields_recording::store::{AuditEntry, AuditRecord};
use videofields_service::engine::BlurAsked;
use videofields_vision::access::Role;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::ErrorKind;

/// Greatest number of an entry that is asked for.
const MAX_NUMBER: i64 = (1 << 53) - 1;

/// Most bytes of a request's target in an entry.
const MAX_TARGET_BYTES: usize = 512;

/// Longest time that a look at what is live waits for its entry: a disk may hang.
const LIVE_TIME: Duration = Duration::from_secs(2);

/// Parameters of queries that name what is looked at. Others say how it is shown, or which part of the past, which is told apart by
/// itself.
const NAMING: [&str; 2] = ["camera", "relight_camera"];

const PARAMETERS: &[Parameter] = &[pages::LIMIT, pages::CURSOR];

/// Routes about what was done.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_audit", "Who did what")
        .about("The oldest first: whatever changed something or tried to, and who looked at what cameras saw, and of the past at which time.")
        .role(Role::Admin)
        .parameters(PARAMETERS)
        .may_fail(&[501])
        .answers(Answer::page("Entries of the audit log", schema::users::audit()));
    Routes::of(users::TAG, NONE).get("/api/v1/audit", self::list, list)
}

/// What is noted beside a request's target, behind a `#`, which no target has: what was asked for in its body, what came of it.
#[derive(Clone, Debug)]
pub(super) struct Noted(pub(super) String);

/// Mark of an answer to a request that succeeded and changed nothing, as a log-out where nobody is logged in.
#[derive(Clone, Copy, Debug)]
pub(super) struct NothingChanged;

/// The user as whom a request was answered that was a stranger's when it came.
#[derive(Clone, Debug)]
pub(super) struct Actor(pub(super) String);

/// Whether people can be told in what was asked for, in a line of the log.
pub(super) fn people_noted(blur: Option<&BlurAsked>) -> String {
    let Some(BlurAsked { except }) = blur else { return "people=seen".to_owned() };
    let tracks: Vec<String> = except.iter().map(|who| format!("{}/{}", who.camera, who.track)).collect();
    if tracks.is_empty() {
        "people=blurred".to_owned()
    } else {
        format!("people=blurred&except={}", tracks.join(","))
    }
}

/// A request, as far as lines tell of it. Cheap to clone.
#[derive(Clone, Debug)]
pub(super) struct Line {
    method: Method,
    uri: Uri,
    matched: Option<MatchedPath>,
}

impl Line {
    #[cfg(test)]
    pub(super) fn test() -> Self {
        Self { method: Method::GET, uri: Uri::default(), matched: None }
    }

    fn route(&self) -> &str {
        self.matched.as_ref().map_or("(none)", MatchedPath::as_str)
    }

    fn action(&self) -> String {
        format!("{} {}", known_name(&self.method), self.route())
    }

    /// Returns an entry of it; `told` stands behind its target.
    fn entry(&self, api: &Api, (user, status): (Option<String>, StatusCode), told: &[String]) -> AuditEntry {
        let asked = self.uri.path_and_query().map_or_else(|| self.uri.path(), |asked| asked.as_str());
        let mut target = cut(asked).into_owned();
        if !told.is_empty() {
            target = format!("{target}#{}", told.join("&"));
        }
        AuditEntry { at: api.clock.now(), user, action: self.action(), target, status: status.as_u16() }
    }

    /// Returns words for what it looks at: method, path, the names of a query, and what was told of it.
    fn looked_at(&self, told: Option<&str>) -> String {
        let mut words = format!("{} {}", known_name(&self.method), decoded(self.uri.path()));
        let query = self.uri.query().unwrap_or_default();
        for name in NAMING {
            let pairs = query.split('&').filter_map(|part| part.split_once('='));
            let mut named = pairs.filter(|(other, _)| decoded(other) == name);
            if let Some((_, value)) = named.next() {
                words = format!("{words}?{name}={}", decoded(value));
            }
        }
        match told {
            Some(told) => format!("{words}#{told}"),
            None => words,
        }
    }

    /// Notes a look of a user, at that part of the past; `told` was told of it.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(super) async fn note_look(
        &self,
        api: &Api,
        (user, status): (Option<&str>, StatusCode),
        told: Option<String>,
        span: Option<Span>,
    ) -> Result<(), Unwritten> {
        let Some(audit) = &api.audit else { return Ok(()) };
        let once = Once {
            user: user.map(str::to_owned),
            // Another thing about it is another look.
            what: self.looked_at(told.as_deref()),
            part: span.map(Span::part),
            kind: OnceKind::Look,
        };
        let entry = || {
            let told: Vec<String> = told.into_iter().chain(span.map(|span| span.to_string())).collect();
            self.entry(api, (user.map(str::to_owned), status), &told)
        };
        audit.note_once(once, api.clock.monotonic(), entry).await
    }
}

/// Returns what a part of a target says without its escapes: each can be written in many ways.
fn decoded(text: &str) -> Cow<'_, str> {
    percent_decode_str(text).decode_utf8_lossy()
}

/// Returns the first bytes of a target that is longer than lines have.
fn cut(target: &str) -> Cow<'_, str> {
    if target.len() <= MAX_TARGET_BYTES {
        return target.into();
    }
    format!("{}...", &target[..target.floor_char_boundary(MAX_TARGET_BYTES)]).into()
}

/// Returns what a caller reads whose look at the past cannot be noted.
pub(super) fn unwritten(error: Unwritten) -> Problem {
    Problem::new(ErrorKind::Unavailable, format!("{error}, and nothing of the past is shown without that"))
}

/// Notes what a request did.
pub(super) async fn note(
    State(api): State<Api>,
    matched: Option<MatchedPath>,
    request: Request,
    next: Next,
) -> Response {
    if api.audit.is_none() {
        return next.run(request).await;
    }
    let line = Line { method: request.method().clone(), uri: request.uri().clone(), matched };
    let identity = request.extensions().get::<Identity>();
    let is_unknown = identity.is_none_or(Identity::is_stranger);
    let mut user = identity.and_then(|identity| identity.caller.user.clone());
    let may_change = line.matched.is_some() && is_change(&line.method, line.route(), &line.uri);
    let spender = identity.and_then(|identity| identity.caller.bounded_user()).map(str::to_owned);
    let spender = spender.filter(|_| may_change && is_counted(&line.method, line.route()));
    let spent = spender.as_deref().map_or(Ok(()), |user| api.spend_change(user, ChangeKind::Other));
    let is_over_budget = spent.is_err();
    let (mut response, span) = match spent {
        Ok(()) => looks::of(line.clone(), next.run(request)).await,
        Err(problem) => (problem.into_response(), None),
    };
    if let Some(Actor(actor)) = response.extensions_mut().remove::<Actor>() {
        user = Some(actor);
    }
    let told = response.extensions_mut().remove::<Noted>().map(|Noted(told)| told);
    let status = response.status();
    let came_to_nothing =
        is_refusal(status) || response.extensions_mut().remove::<NothingChanged>().is_some();
    if let Some(user) = spender.filter(|_| !is_over_budget && came_to_nothing) {
        api.change_budget.give_back(&user);
    }
    if !matches!(line.method, Method::GET | Method::HEAD) {
        let is_strange = is_unknown && user.is_none() || status == StatusCode::UNAUTHORIZED;
        let is_noted = may_change || status == StatusCode::FORBIDDEN && line.matched.is_some();
        if is_strange || is_noted {
            let once = if is_strange {
                // A stranger may try without end, under any name: once a route, or the log would be theirs to fill.
                Some((None, line.action()))
            } else {
                // So may a user, but what they did is told one by one.
                came_to_nothing.then(|| (user.clone(), format!("{} {}", line.action(), status.as_u16())))
            };
            let told: Vec<String> = told.into_iter().chain(span.map(|span| span.to_string())).collect();
            note_change(&api, once, line.entry(&api, (user, status), &told)).await;
        }
        return response;
    }
    // A refused request showed nothing; metrics tell of a flood of them.
    let is_shown = status.is_success() || status == StatusCode::SWITCHING_PROTOCOLS;
    let Some(looks) = looks::of_route(line.route()).filter(|_| is_shown) else { return response };
    let is_past = looks == Looks::Past || span.is_some();
    let noting = line.note_look(&api, (user.as_deref(), status), told, span);
    if is_past {
        return noting.await.map_or_else(|error| unwritten(error).into_response(), |()| response);
    }
    // Without a picture of what goes on now nobody is watched over: it is shown, and the entry is written when that can be.
    match tokio::time::timeout(LIVE_TIME, noting).await {
        Ok(Ok(())) => {}
        Ok(Err(error)) => tracing::debug!(%error, "a look at what is live is not noted"),
        Err(_elapsed) => tracing::warn!("a look at what is live is answered before its entry is on disk"),
    }
    response
}

/// Notes what was changed or tried; of what has a caller and words, one line stands for all.
async fn note_change(api: &Api, once: Option<(Option<String>, String)>, entry: AuditEntry) {
    let Some(audit) = &api.audit else { return };
    match once {
        Some((user, what)) => {
            let once = Once { user, what, part: None, kind: OnceKind::Try };
            // It was refused already.
            if let Err(error) = audit.note_once(once, api.clock.monotonic(), || entry).await {
                tracing::debug!(%error, "what was refused is not noted");
            }
        }
        None => {
            if let Err(error) = audit.append(&entry).await {
                tracing::error!(%error, ?entry, "what was done could not be noted in the audit log");
            }
        }
    }
}

/// Returns whether a status says that nothing was changed; of a fault of the daemon's own nobody knows.
fn is_refusal(status: StatusCode) -> bool {
    status.is_client_error() || status.is_server_error() && status != StatusCode::INTERNAL_SERVER_ERROR
}

/// Returns the name of a method, and one name for all that nobody knows: clients can write any.
fn known_name(method: &Method) -> &str {
    let known = [
        Method::GET,
        Method::HEAD,
        Method::POST,
        Method::PUT,
        Method::PATCH,
        Method::DELETE,
        Method::OPTIONS,
        Method::CONNECT,
        Method::TRACE,
    ];
    if known.contains(method) { method.as_str() } else { "unknown" }
}

/// Entries, the oldest first.
pub(super) async fn list(Asked(api): Asked, uri: Uri) -> Result<Response, Problem> {
    let mut query = Query::parse(uri.query(), PARAMETERS);
    let is_number = |number: &i64| (0..=MAX_NUMBER).contains(number);
    let after = pages::cursor(&mut query, |text| text.parse().ok().filter(is_number)).unwrap_or(0);
    let limit = pages::limit(&mut query);
    query.finish(Some(()))?;
    api.check_admin("the audit log")?;
    let audit = api.audit.as_ref();
    let audit =
        audit.ok_or_else(|| Problem::new(ErrorKind::Unsupported, "this daemon keeps no audit log"))?;
    // One more than is told, to know whether there are more.
    let found = audit.entries(after, limit as u32 + 1).await;
    let mut found = found.map_err(|error| Problem::from(&error))?;
    let has_more = pages::cut(&mut found, limit);
    let next = found.last().filter(|_| has_more).map(|last| last.number.to_string());
    let entries: Vec<Value> = found.iter().map(document).collect();
    Ok(pages::answer(&uri, json!({ "entries": entries }), next))
}

fn document(record: &AuditRecord) -> Value {
    let AuditEntry { at, user, action, target, status } = &record.entry;
    let at: &Timestamp = at;
    json!({
        "number": record.number,
        "at": at.to_string(),
        "user": user,
        "action": action,
        "target": target,
        "status": status,
        "digest": record.digest_text(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::described;
    use crate::openapi::Verb;
    use crate::parameters::Parameter;
    use std::collections::BTreeSet;

    fn line(target: &str) -> Line {
        Line { uri: target.parse().unwrap(), ..Line::test() }
    }

    #[test]
    fn looks_at_other_things_have_other_words_however_they_are_written() {
        let words = |target: &str| line(target).looked_at(None);
        let path = "/api/v1/events";
        assert_ne!(words(&format!("{path}?camera=north")), words(&format!("{path}?camera=south")));
        assert_ne!(words(path), words(&format!("{path}?camera=north")));
        for same in ["camera=n%6Frth", "c%61mera=north", "after=3&camera=north", "camera=north&limit=2"] {
            assert_eq!(words(&format!("{path}?camera=north")), words(&format!("{path}?{same}")), "{same}");
        }
        assert_eq!(words("/api/v1/cameras/n%6Frth"), words("/api/v1/cameras/north"));
        let head = Line { method: Method::HEAD, ..line(path) };
        assert_ne!(head.looked_at(None), words(path));
        assert_ne!(line(path).looked_at(Some("shows_hidden=north")), words(path));
    }

    #[test]
    fn every_parameter_that_names_something_seen_tells_looks_apart() {
        // It names a viewer.
        let others = BTreeSet::from(["session"]);
        let routes = described().routes.into_iter();
        let looks = routes.filter(|route| route.verb == Verb::Get && looks::of_route(route.path).is_some());
        let named: BTreeSet<&str> = looks
            .flat_map(|route| route.operation.parameters.clone())
            .filter(Parameter::is_id)
            .map(|parameter| parameter.name)
            .collect();
        assert_eq!(named.difference(&others).copied().collect::<Vec<_>>(), NAMING);
    }

    #[test]
    fn long_targets_are_cut() {
        let whole = format!("/{}", "a".repeat(MAX_TARGET_BYTES - 1));
        assert_eq!(cut(&whole), whole);
        assert_eq!(cut(&format!("{whole}bc")), format!("{whole}..."));
        assert_eq!(cut(&"ä".repeat(300)).len(), MAX_TARGET_BYTES + 3);
        assert_eq!(cut(&format!("a{}", "ä".repeat(300))).len(), MAX_TARGET_BYTES - 1 + 3);
    }
}
