//! `/api/v1/audit`: who did what; and the layer that notes it.
//!
//! Noted is whatever changes something, whatever came of it, and who looked at what cameras saw, and of the past at which
//! time ([`looks`]): of the same caller, target and ten minutes of the past once in ten minutes, so that a wall that pulls
//! thirty pictures a second is a line and not a flood; and what strangers tried, once in ten minutes a route. What is only
//! tried (`validate_only`) changes nothing: pages ask it while somebody types. An entry is on disk before the answer goes out.

use super::Api;
use super::error::Problem;
use super::identity::{Asked, Identity};
use super::looks::{self, Span};
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
use axum::response::Response;
use serde_json::{Value, json};
use videofields_recording::accounts::Newness;
use videofields_recording::store::{AuditEntry, AuditRecord};
use videofields_service::engine::BlurAsked;
use videofields_vision::access::Role;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::ErrorKind;

/// Greatest number of an entry that is asked for.
const MAX_NUMBER: i64 = (1 << 53) - 1;

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

/// Notes what a request did.
pub(super) async fn note(
    State(api): State<Api>,
    matched: Option<MatchedPath>,
    request: Request,
    next: Next,
) -> Response {
    let Some(audit) = api.audit.clone() else { return next.run(request).await };
    let method = request.method().clone();
    let method_name = known_name(&method);
    let uri = request.uri().clone();
    let identity = request.extensions().get::<Identity>();
    let is_unknown = identity.is_none_or(Identity::is_stranger);
    let mut user = identity.and_then(|identity| identity.caller.user.clone());
    let (mut response, span) = looks::of(next.run(request)).await;
    if let Some(Actor(actor)) = response.extensions_mut().remove::<Actor>() {
        user = Some(actor);
    }
    let is_stranger = is_unknown && user.is_none();
    let told = response.extensions_mut().remove::<Noted>().map(|Noted(told)| told);
    let route = matched.as_ref().map_or("(none)", MatchedPath::as_str);
    let is_look = matches!(method, Method::GET | Method::HEAD);
    let status = response.status();
    let now = api.clock.monotonic();
    let newness = if is_look {
        // What was refused showed nothing; of a flood of wrong requests the metrics tell.
        let is_shown = status.is_success() || status == StatusCode::SWITCHING_PROTOCOLS;
        // Another thing about it is another look.
        let what =
            told.as_ref().map_or_else(|| uri.path().to_owned(), |told| format!("{}#{told}", uri.path()));
        if looks::is_look(route) && is_shown {
            audit.look(user.as_deref(), &what, span.map(Span::part), now)
        } else {
            Newness::Known
        }
    } else if is_stranger || status == StatusCode::UNAUTHORIZED {
        // A stranger may try without end, under any name: once a route, or the log would be theirs to fill.
        audit.look(None, &format!("{method_name} {route}"), None, now)
    } else if matched.is_some() && !is_try(&uri, status) {
        Newness::New
    } else {
        Newness::Known
    };
    if newness == Newness::Known {
        return response;
    }
    let mut target = uri.path_and_query().map_or_else(|| uri.path().to_owned(), ToString::to_string);
    let further = (newness == Newness::Last).then(|| "further=not_noted".to_owned());
    let told: Vec<String> =
        told.into_iter().chain(span.map(|span| span.to_string())).chain(further).collect();
    if !told.is_empty() {
        target = format!("{target}#{}", told.join("&"));
    }
    let entry = AuditEntry {
        at: api.clock.now(),
        user,
        action: format!("{method_name} {route}"),
        target,
        status: status.as_u16(),
    };
    if let Err(error) = audit.append(&entry).await {
        tracing::error!(%error, ?entry, "what was done could not be noted in the audit log");
    }
    response
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

/// Whether a request by somebody who may ask it said that nothing is to be kept; routes that do not know the word refuse it.
fn is_try(uri: &Uri, status: StatusCode) -> bool {
    let says_so = |query: &str| query.split('&').any(|part| part == "validate_only=true");
    status != StatusCode::FORBIDDEN && uri.query().is_some_and(says_so)
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
