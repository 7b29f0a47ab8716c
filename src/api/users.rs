//! `/api/v1/users`: who may ask for what. For admins; anybody may look at themselves.

use super::conditions::{etag, required};
use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::{Routes, Tag};
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::schema;
use super::segments::Segments;
use super::tune::{read_body, refuse_foreign};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::json;
use videofields_recording::accounts::{AccountError, UserChange, UserSummary};
use videofields_service::catalog::Condition;
use videofields_vision::access::Role;
use videofields_vision::error::Fault;
use videofields_vision::frame::is_id;

/// What these routes, and those of tokens and sessions, are about.
pub(super) const TAG: Tag = ("Users", "Who may ask for what, and what they did");

const SEGMENTS: &[Parameter] = &[Parameter::id("id", "A user")];

/// Routes about users.
pub(super) fn routes() -> Routes {
    let user = |status, meaning| Answer::json(status, meaning, schema::named("User")).tagged();
    let list = Operation::new("list_users", "Every user")
        .role(Role::Admin)
        .may_fail(&[501])
        .answers(Answer::json(200, "The users", schema::users::users()));
    let one = Operation::new("show_user", "A user: admins see any, everybody themselves")
        .may_fail(&[403, 501])
        .answers(user(200, "The user"));
    let put = Operation::new("put_user", "Makes a user or changes one")
        .about("The first user must be an admin with a password, and the last of these stays.")
        .role(Role::Admin)
        .conditional()
        .takes(schema::users::user_asked())
        .may_fail(&[409, 501])
        .answers(user(200, "It is changed"))
        .answers(user(201, "It is made"));
    let remove = Operation::new("remove_user", "Removes a user, with tokens and sessions")
        .role(Role::Admin)
        .conditional()
        .may_fail(&[409, 501])
        .answers(Answer::nothing(204, "It is gone"));
    Routes::of(TAG, SEGMENTS)
        .get("/api/v1/users", self::list, list)
        .get("/api/v1/users/{id}", self::one, one)
        .put("/api/v1/users/{id}", self::put, put)
        .delete("/api/v1/users/{id}", self::remove, remove)
}

/// Every user.
pub(super) async fn list(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    api.check_admin("the list of users")?;
    let body = Json(json!({ "users": api.accounts()?.users() }));
    Ok(([(header::CACHE_CONTROL, "no-store")], body).into_response())
}

/// One user.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    if api.identity.caller.user.as_deref() != Some(&id) {
        api.check_admin("another user")?;
    }
    Ok(answer(StatusCode::OK, api.accounts()?.user(&id)?))
}

/// Makes a user (`If-None-Match: *`) or changes one (`If-Match`).
pub(super) async fn put(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    api.check_admin("changing users")?;
    if !is_id(&id) {
        let message = "a user's name is 1 to 64 of a-z, 0-9, - and _, the first a letter or digit";
        return Err(AccountError::Faults(vec![Fault::new("id", message)]).into());
    }
    let was = match required(&headers)? {
        Condition::Absent => None,
        Condition::Version(version) => Some(version),
        Condition::Present => Some(api.accounts()?.user(&id)?.version),
    };
    let change = UserChange::read(read_body(&body)?)?;
    let user = api.accounts()?.put_user(&id, change, was).await?;
    tracing::info!(user = id, by = ?api.identity.caller.user, role = user.role.as_str(), "user changed");
    Ok(answer(if was.is_none() { StatusCode::CREATED } else { StatusCode::OK }, user))
}

/// Removes a user (`If-Match`), with tokens and sessions.
pub(super) async fn remove(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    api.check_admin("removing users")?;
    let now = api.accounts()?.user(&id)?.version;
    let was = match required(&headers)? {
        Condition::Version(version) => version,
        Condition::Present => now,
        Condition::Absent => return Err(AccountError::Changed { now: Some(now) }.into()),
    };
    api.accounts()?.remove_user(&id, was).await?;
    tracing::info!(user = id, by = ?api.identity.caller.user, "user removed");
    Ok((StatusCode::NO_CONTENT, [(header::CACHE_CONTROL, "no-store")]).into_response())
}

fn answer(status: StatusCode, user: UserSummary) -> Response {
    let fields = [(header::CACHE_CONTROL, "no-store".to_owned()), (header::ETAG, etag(user.version))];
    (status, fields, Json(user)).into_response()
}
