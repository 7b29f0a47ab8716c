//! `/api/v1/sources/files`: what lies beneath the media roots that could feed a camera, and cameras at this machine.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::{cameras, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Duration;
use videofields_service::engine::{FoundFile, FoundSources, StopFlag};
use videofields_vision::access::Role;

/// Longest time for looking around: what was found by then is told.
const TIME: Duration = Duration::from_secs(5);

const MAX_PATH_CHARS: usize = 1024;

const PARAMETERS: &[Parameter] = &[Parameter::text(
    "under",
    (r"^/[\s\S]{0,1023}$", "/films"),
    "Beneath this folder alone, which lies in a media root",
)];

/// The route about files.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_source_files", "What could feed a camera")
        .about(
            "Videos by their endings, and numbered pictures as one pattern; symbolic links are not followed.",
        )
        .role(Role::Admin)
        .parameters(PARAMETERS)
        .may_fail(&[404])
        .answers(Answer::json(200, "What was found", schema::sources::files()));
    Routes::of(cameras::TAG, NONE).get("/api/v1/sources/files", self::list, list)
}

/// Files and devices that could feed a camera.
pub(super) async fn list(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), PARAMETERS);
    let under = query.value("under", "an absolute path", |text| {
        let is_path = (1..=MAX_PATH_CHARS).contains(&text.chars().count()) && Path::new(text).is_absolute();
        is_path.then(|| PathBuf::from(text))
    });
    let under = query.finish(Some(under))?;
    let stop = StopFlag::default();
    let until = stop.clone();
    let found = api.ask("looking for files", move |door| door.find_sources(under.as_deref(), &stop));
    let mut found = std::pin::pin!(found);
    let told = match tokio::time::timeout(TIME, &mut found).await {
        Ok(told) => told,
        Err(_elapsed) => {
            until.raise();
            found.await
        }
    };
    let FoundSources { files, devices } = told?;
    let is_cut = files.is_cut;
    let files: Vec<Value> = files.files.iter().filter_map(shown).collect();
    let devices: Vec<Value> =
        devices.iter().filter_map(|path| Some(json!({ "path": path.to_str()? }))).collect();
    let body = Json(json!({ "files": files, "is_cut": is_cut, "devices": devices }));
    Ok(([(header::CACHE_CONTROL, "no-store")], body).into_response())
}

/// A file as it is told; none whose path no JSON could bring back.
fn shown(file: &FoundFile) -> Option<Value> {
    let mut shown = json!({
        "path": file.path.to_str()?,
        "bytes": file.bytes,
        "modified_at": file.modified_at.to_string(),
    });
    if let Some(count) = file.count {
        shown["count"] = json!(count);
    }
    Some(shown)
}
