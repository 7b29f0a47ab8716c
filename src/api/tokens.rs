//! `/api/v1/tokens`: what programs show in a user's place. Everybody has their own; admins see all.

use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::schema;
use super::segments::Segments;
use super::tune::{read_members, refuse_foreign};
use super::users;
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::json;
use videofields_recording::accounts::AccountError;
use videofields_vision::access::Role;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{ErrorKind, Fault, Gatherer};

/// Most characters of what a token is for.
const MAX_NOTE_CHARS: usize = 200;

/// A token as it is asked for.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TokenAsked {
    /// Whose it is to be; the caller's if absent.
    #[serde(default)]
    user: Option<String>,
    /// What it is for.
    #[serde(default)]
    note: String,
    /// From when on it is not taken any more; never if absent.
    #[serde(default)]
    expires_at: Option<String>,
}

const SEGMENTS: &[Parameter] =
    &[Parameter::text("id", ("^[0-9a-z]{1,64}$", "7f3a"), "A token, not its secret")];

/// Path of one token.
pub(super) const ONE: &str = "/api/v1/tokens/{id}";

/// Routes about tokens.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_tokens", "The caller's tokens; all of an admin")
        .may_fail(&[501])
        .answers(Answer::json(200, "The tokens", schema::users::tokens()));
    let add = Operation::new("add_token", "Makes a token")
        .about("Everybody makes their own, admins anybody's. Its secret is told this once.")
        .takes(schema::users::token_asked())
        .may_fail(&[404, 409, 422, 501])
        .answers(Answer::json(201, "The token with its secret", schema::users::token_made()));
    let remove = Operation::new("remove_token", "Revokes a token")
        .about("It is nobody's from the next request on.")
        .may_fail(&[501])
        .answers(Answer::nothing(204, "It is nobody's"));
    Routes::of(users::TAG, SEGMENTS)
        .get("/api/v1/tokens", self::list, list)
        .post("/api/v1/tokens", self::add, add)
        .delete(ONE, self::remove, remove)
}

/// The caller's tokens; all of an admin.
pub(super) async fn list(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let caller = &api.identity.caller;
    let whose = if caller.grants.role() == Role::Admin { None } else { caller.user.as_deref() };
    let body = Json(json!({ "tokens": api.accounts()?.tokens(whose) }));
    Ok(([(header::CACHE_CONTROL, "no-store")], body).into_response())
}

/// Makes a token; its secret is told this once.
pub(super) async fn add(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let (asked, expires_at) = read(&body, api.clock.now())?;
    let own = api.identity.caller.user.as_deref();
    let Some(user) = asked.user.as_deref().or(own) else {
        return Err(AccountError::Faults(vec![Fault::new("/user", "name whose it is to be")]).into());
    };
    if own != Some(user) {
        api.check_admin("another user's token")?;
    }
    // Admins, who make them for others too, find room whatever others did.
    let is_admin = api.identity.caller.grants.role() == Role::Admin;
    let accounts = api.accounts()?;
    let (token, text) = match is_admin {
        true => accounts.add_token(user, asked.note, expires_at).await?,
        false => accounts.add_own_token(user, asked.note, expires_at).await?,
    };
    tracing::info!(token = token.id, user, by = ?own, "token made");
    let mut body =
        serde_json::to_value(token).map_err(|error| Problem::new(ErrorKind::Internal, error.to_string()))?;
    body["token"] = json!(text);
    Ok((StatusCode::CREATED, [(header::CACHE_CONTROL, "no-store")], Json(body)).into_response())
}

fn read(body: &[u8], now: Timestamp) -> Result<(TokenAsked, Option<Timestamp>), Problem> {
    let asked: TokenAsked = read_members(body)?;
    let mut gatherer = Gatherer::default();
    let mut expires_at = None;
    if asked.note.chars().count() > MAX_NOTE_CHARS {
        gatherer.fault("/note", format!("at most {MAX_NOTE_CHARS} characters"));
    }
    match asked.expires_at.as_deref().map(str::parse::<Timestamp>) {
        Some(Ok(at)) if at <= now => gatherer.fault("/expires_at", "lies in the past"),
        Some(Ok(at)) => expires_at = Some(at),
        Some(Err(error)) => gatherer.fault("/expires_at", error.to_string()),
        None => {}
    }
    let faults = gatherer.into_faults();
    if faults.is_empty() { Ok((asked, expires_at)) } else { Err(AccountError::Faults(faults).into()) }
}

/// Takes a token back.
pub(super) async fn remove(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let caller = &api.identity.caller;
    let whose = if caller.grants.role() == Role::Admin { None } else { caller.user.as_deref() };
    api.accounts()?.remove_token(&id, whose).await?;
    tracing::info!(token = id, by = ?caller.user, "token revoked");
    Ok((StatusCode::NO_CONTENT, [(header::CACHE_CONTROL, "no-store")]).into_response())
}
