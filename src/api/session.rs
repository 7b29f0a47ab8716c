//! `/api/v1/session`: who the caller is, and logging a page or a wall's screen in and out.

use super::address;
use super::audit::{Actor, Noted, NothingChanged};
use super::change_budget::ChangeKind;
use super::content::Content;
use super::error::Problem;
use super::identity::{Asked, COOKIE, Credential, Identity, NOBODYS_TOKEN, SCREEN_COOKIE};
use super::log_budget::shortened;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::schema;
use super::tune::{read_members, refuse_foreign};
use super::users;
use super::{Api, Site};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::{Value, json};
use std::time::Duration;
use videofields_recording::accounts::{AccountError, Attempt, Caller, SESSION_TIME};
use videofields_vision::error::{ErrorKind, Fault};

/// Path of the session.
pub(super) const PATH: &str = "/api/v1/session";

const NO_STORE: (header::HeaderName, &str) = (header::CACHE_CONTROL, "no-store");

/// For how long a browser keeps a screen's token: the longest that browsers do. The token may end sooner.
const SCREEN_TIME: Duration = Duration::from_secs(400 * 24 * 3600);

/// What logs in: a user, or a screen that was given a token.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Credentials {
    user: Option<String>,
    password: Option<String>,
    token: Option<String>,
}

/// Routes about who asks.
pub(super) fn routes() -> Routes {
    let who = |status, meaning| Answer::json(status, meaning, schema::users::caller());
    let show = Operation::new("show_session", "Who the caller is").open().answers(who(200, "The caller"));
    let log_in = Operation::new("log_in", "Logs a page in for 12 hours, or a screen for as long as its token holds")
        .about("What it is known by is in a cookie that no script reads. After four wrong passwords it is throttled. With a token, as a wall's screen has it, the page may look and change nothing.")
        .open()
        .takes(schema::users::credentials())
        .may_fail(&[401, 429, 501])
        .answers(who(200, "Who is logged in").field("Set-Cookie", "The session's key"));
    let log_out = Operation::new("log_out", "Logs a page out")
        .open()
        .may_fail(&[501])
        .answers(Answer::nothing(204, "Nobody is logged in").field("Set-Cookie", "None any more"));
    Routes::of(users::TAG, NONE).get(PATH, self::show, show).post(PATH, self::log_in, log_in).delete(
        PATH,
        self::log_out,
        log_out,
    )
}

/// Who asks.
pub(super) async fn show(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    Ok(([NO_STORE], Json(document(&api))).into_response())
}

fn document(api: &Api) -> Value {
    let Caller { user, grants, csrf_token, .. } = &api.identity.caller;
    let role = (user.is_some() || grants.is_everything()).then(|| grants.role());
    json!({ "user": user, "role": role, "csrf_token": csrf_token, "name_ending": api.name_ending() })
}

/// Logs a page in: its key is in a cookie that scripts cannot read.
pub(super) async fn log_in(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let from = address::of(api.connection.peer(), &headers, &api.site.trusted_proxies);
    let secure = secure_attribute(&api, &headers);
    let (identity, cookie) = match read_members(&body)? {
        Credentials { user: Some(user), password: Some(password), token: None } => {
            let address = address::of_log_in(api.connection.peer(), &headers, &api.site.trusted_proxies);
            let attempt = Attempt { name: &user, address };
            let accounts = api.accounts()?;
            let log_failure = |error: &AccountError| {
                if let Some(n_left_out) = api.stranger_lines.spend(api.clock.monotonic()) {
                    tracing::warn!(user = ?shortened(&user), ?from, %error, n_left_out, "a log-in failed");
                }
            };
            let verified = accounts.check_password(attempt, &password).await.inspect_err(log_failure)?;
            // Before there is a session, which would end the user's oldest one.
            if let Some(bounded) = verified.caller().bounded_user() {
                api.spend_change(bounded, ChangeKind::LogIn)?;
            }
            let logged = accounts.begin_session(verified).inspect_err(log_failure)?;
            let cookie = cookie(COOKIE, &logged.session, SESSION_TIME, secure);
            (
                Identity { caller: logged.caller, credential: Some(Credential::Session(logged.session)) },
                cookie,
            )
        }
        Credentials { user: None, password: None, token: Some(token) } => {
            let Some(identity) = Identity::screen(api.accounts()?, token.clone()) else {
                if let Some(n_left_out) = api.stranger_lines.spend(api.clock.monotonic()) {
                    tracing::warn!(?from, n_left_out, "a screen's log-in failed");
                }
                return Err(Problem::new(ErrorKind::Unauthenticated, NOBODYS_TOKEN));
            };
            // Not a log-in's bound: whoever has but a token of a user keeps nobody from logging in.
            if let Some(bounded) = identity.caller.bounded_user() {
                api.spend_change(bounded, ChangeKind::Other)?;
            }
            (identity, cookie(SCREEN_COOKIE, &token, SCREEN_TIME, secure))
        }
        _ => {
            let detail = "must be user and password, or token alone";
            return Err(Problem::at(ErrorKind::Invalid, vec![Fault::new("", detail)]));
        }
    };
    let is_screen = matches!(identity.credential, Some(Credential::Screen(_)));
    tracing::info!(user = identity.caller.user, ?from, is_screen, "logged in");
    let api = Api { identity, ..api };
    let mut response = ([NO_STORE], Json(document(&api))).into_response();
    response.headers_mut().insert(header::SET_COOKIE, cookie);
    if let Some(user) = api.identity.caller.user {
        response.extensions_mut().insert(Actor(user));
    }
    let from = from.map_or_else(|| "unknown".to_owned(), |address| address.to_string());
    response.extensions_mut().insert(Noted(format!("from={from}")));
    Ok(response)
}

/// Logs a page out.
pub(super) async fn log_out(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let has_ended = match &api.identity.credential {
        Some(Credential::Session(key)) => api.accounts()?.log_out(key),
        _ => false,
    };
    let secure = secure_attribute(&api, &headers);
    let mut response = (StatusCode::NO_CONTENT, [NO_STORE]).into_response();
    for name in [COOKIE, SCREEN_COOKIE] {
        response.headers_mut().append(header::SET_COOKIE, cookie(name, "", Duration::ZERO, secure));
    }
    if !has_ended {
        response.extensions_mut().insert(NothingChanged);
    }
    Ok(response)
}

/// Returns the attribute by which a cookie is sent over HTTPS alone, where the page came by it: from the daemon itself, or from a proxy
/// that it trusts.
fn secure_attribute(api: &Api, headers: &HeaderMap) -> &'static str {
    let Site { is_encrypted, trusted_proxies, .. } = &*api.site;
    let is_secure = *is_encrypted || address::is_encrypted(api.connection.peer(), headers, trusted_proxies);
    if is_secure { "; Secure" } else { "" }
}

/// Returns a cookie that goes to this daemon alone; it is sent by the daemon's own pages alone and read by no script.
fn cookie(name: &str, key: &str, time: Duration, secure: &str) -> HeaderValue {
    let secs = time.as_secs();
    let text = format!("{name}={key}; Max-Age={secs}; Path=/; HttpOnly; SameSite=Strict{secure}");
    HeaderValue::try_from(text).unwrap_or(HeaderValue::from_static(""))
}
