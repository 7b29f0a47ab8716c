//! `/api/v1/system`: the daemon itself: what runs here since when, on what, and what requests are held to.
//!
//! Counts are of what the caller may see; of the database, of users and since when it runs admins alone are told.

use super::content::MAX_BODY_BYTES;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::{Routes, Tag};
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::serve::{HEAD_BYTES, HEAD_FIELDS, HEAD_TIME, MAX_CONNECTIONS};
use super::{Api, ConnectionTimes, frames, guests, kept, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::sync::Arc;
use videofields_picture::scene::MAX_DOCUMENT_BYTES;
use videofields_recording::store::SCHEMA_VERSION;
use videofields_service::catalog::NamedView;
use videofields_service::wall::Wall;
use videofields_vision::access::Role;
use videofields_vision::error::ErrorKind;

/// What routes about the daemon itself are about.
pub(super) const TAG: Tag = ("System", "The daemon itself");

/// Most lists and objects within one another in a body: `serde_json` refuses more.
const BODY_DEPTH: u32 = 127;

/// Routes about the daemon itself.
pub(super) fn routes() -> Routes {
    let show = Operation::new("show_system", "What runs here, on what, and what requests are held to")
        .about("Counts are of what the caller may see. `uptime_secs`, `database`, `accounts` and `audit` are told to admins, and null to others.")
        .answers(Answer::json(200, "The daemon", schema::system::system()));
    Routes::of(TAG, NONE).get("/api/v1/system", self::show, show)
}

/// The daemon as the caller may know it.
async fn show(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let is_admin = api.identity.caller.grants.role() == Role::Admin;
    let uptime = api.clock.monotonic().saturating_sub(api.started);
    let body = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "build": if cfg!(debug_assertions) { "debug" } else { "release" },
        "uptime_secs": is_admin.then_some(uptime.as_secs()),
        "platform": {
            "os": std::env::consts::OS,
            "architecture": std::env::consts::ARCH,
            "n_processors": std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        },
        "device": api.door.device(),
        "limits": limits(&api),
        "counts": {
            "cameras": api.door.cameras().len(),
            "scenes": api.door.scenes().len(),
            "walls": kept::all::<Wall>(&api).len(),
            "views": kept::all::<NamedView>(&api).len(),
            "playheads": api.door.playheads().len(),
            "exports": api.door.exports().len(),
        },
        "database": if is_admin { database(&api).await? } else { Value::Null },
        "accounts": if is_admin { accounts(&api) } else { Value::Null },
        "audit": if is_admin { audit(&api) } else { Value::Null },
    });
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(body)).into_response())
}

fn limits(api: &Api) -> Value {
    let limits = &api.limits;
    let times = ConnectionTimes::default();
    json!({
        "target_bytes": limits.target_bytes,
        "head_bytes": HEAD_BYTES,
        "fields": HEAD_FIELDS,
        "field_bytes": limits.field_bytes,
        "body_bytes": MAX_BODY_BYTES,
        "scene_bytes": MAX_DOCUMENT_BYTES,
        "body_depth": BODY_DEPTH,
        "request_secs": limits.request_time.as_secs_f64(),
        "requests_at_once": limits.requests_at_once,
        "answer_bytes": limits.answer_bytes,
        "encoders": limits.encoders,
        "streams": frames::AT_ONCE,
        "listeners": guests::LISTENERS,
        "connections": MAX_CONNECTIONS,
        "connection_secs": times.age.as_secs_f64(),
        "idle_secs": HEAD_TIME.as_secs_f64(),
    })
}

/// What is kept, for admins: how much it is tells of everybody's doing.
async fn database(api: &Api) -> Result<Value, Problem> {
    let Some(catalog) = api.catalog.clone() else { return Ok(Value::Null) };
    let measured = tokio::task::spawn_blocking(move || catalog.file_bytes()).await;
    let bytes = measured.map_err(|panicked| Problem::new(ErrorKind::Internal, panicked.to_string()))?;
    let bytes = bytes.map_err(|error| {
        Problem::new(ErrorKind::Unavailable, format!("the database's file: {}", error.kind()))
    })?;
    Ok(json!({ "schema_version": SCHEMA_VERSION, "bytes": bytes }))
}

/// Returns the state of the audit log, for admins.
fn audit(api: &Api) -> Value {
    let Some(state) = api.audit.as_ref().map(|audit| audit.state()) else { return Value::Null };
    let head = state.head.map(|(number, digest)| json!({ "number": number, "digest": digest }));
    json!({
        "head": head,
        "signature": state.signed.map(|signed| signed.signature),
        "fault": state.fault,
        "faults": state.n_faults,
    })
}

fn accounts(api: &Api) -> Value {
    let of = |accounts: &Arc<videofields_recording::accounts::Accounts>| json!({ "users": accounts.users().len(), "tokens": accounts.tokens(None).len() });
    api.accounts.as_ref().map_or(Value::Null, of)
}
