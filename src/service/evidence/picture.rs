//! What is put down of a view or a camera's picture: pixels, and everything that tells what they show and where from.
//!
//! What may not be seen is gone before anything is written: zones by the engine, and people here where that is asked for, in
//! the very frames that a view was drawn from.

use super::EvidenceError;
use super::making::Subject;
use super::people::{Hidden, blur_document, people_document};
use super::record::{PICTURE, camera_file};
use crate::engine::{At, BlurAsked, CameraSummary, EngineError, Handle, ViewAnswer, ViewKind, ViewRequest};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;
use videofields_picture::scene::{Scene, SceneView};
use videofields_vision::access::{Grants, Right, Role};
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{CameraId, RgbImage, YuvImage};

/// A picture that is to be kept, with what it was made from.
pub(super) struct Taken {
    pub(super) picture: Pixels,
    /// The frames of the cameras that took part, with their files' names.
    pub(super) frames: Vec<(String, Arc<YuvImage>)>,
    pub(super) shown_at: Timestamp,
    /// `scene` or `camera`, and which.
    pub(super) subject: (&'static str, String),
    pub(super) cameras: Vec<String>,
    /// Members of the record.
    pub(super) about: Map<String, Value>,
}

pub(super) enum Pixels {
    Rendered(Arc<RgbImage>),
    Frame(Arc<YuvImage>),
}

/// Asks the engine for what is to be kept.
pub(super) async fn take(
    door: &Handle,
    grants: &Grants,
    subject: Subject,
    blur: Option<BlurAsked>,
) -> Result<Taken, EvidenceError> {
    if grants.role() < Role::Operator {
        return Err(EvidenceError::Forbidden("making a snapshot is for operator and above".to_owned()));
    }
    match subject {
        Subject::View { request, parameters } => {
            take_view(door, grants, ViewRequest { blur_people: blur, ..*request }, parameters).await
        }
        Subject::Camera { camera, at } => take_camera(door, grants, (camera, at), blur).await,
    }
}

fn check_export(grants: &Grants, camera: &str) -> Result<(), EvidenceError> {
    let what =
        || EvidenceError::Forbidden(format!("of camera {camera} you have no right to {}", Right::Export));
    grants.has(camera, Right::Export).then_some(()).ok_or_else(what)
}

async fn take_view(
    door: &Handle,
    grants: &Grants,
    request: ViewRequest,
    parameters: String,
) -> Result<Taken, EvidenceError> {
    let (id, at) = (request.scene.clone(), request.at);
    let scene = door.scene(&id)?;
    // Those that take part whatever they do, before anything is drawn.
    let right = if at == At::Live { Right::Live } else { Right::History };
    let is_allowed = |camera: &CameraId| grants.has(camera.as_str(), right);
    let members = scene.cameras.iter().map(|member| &member.id);
    members.filter(|id| is_allowed(id)).try_for_each(|id| check_export(grants, id.as_str()))?;
    let is_left_out = door.leaves_out(&id, at);
    let size_px = [request.width_px, request.height_px];
    let people = people_document(request.blur_people.as_ref());
    let hidden = Hidden::of(door, scene.cameras.iter().map(|member| member.id.as_str()));
    let answer = door.view(request).await?;
    // At once: what was drawn is held by nobody else.
    let held: Vec<Option<Arc<YuvImage>>> = answer.frames.iter().map(|frame| frame.upgrade()).collect();
    let states = door.cameras();
    if door.scene(&id)?.document != scene.document {
        return Err(EvidenceError::Gone(format!("the scene {id} was changed meanwhile")));
    }
    hidden.check_unchanged(door)?;
    // And those that took part though the caller may see no more than now of them.
    let took_part = |camera: &CameraId| answer.sources.iter().any(|source| source.camera == *camera);
    let scene = scene.with_cameras(|camera| is_allowed(camera) || took_part(camera));
    scene.cameras.iter().try_for_each(|member| check_export(grants, member.id.as_str()))?;
    let door = door.clone();
    let worked = tokio::task::spawn_blocking(move || {
        let mut frames = Vec::new();
        let mut documents = Vec::new();
        for member in &scene.cameras {
            let place = answer.sources.iter().position(|source| source.camera == member.id);
            let is_gap = answer.gaps.contains(&member.id);
            let mut document = camera_document(&member.id, &states, answer.instant);
            document.insert("calibration".to_owned(), calibration(&scene, &member.id)?);
            document.insert(
                "part".to_owned(),
                json!(match place {
                    Some(_) if is_gap => "background",
                    Some(_) => "frame",
                    None => "none",
                }),
            );
            let blur = answer.blurs.iter().flat_map(|blurs| blurs.iter()).find(|of| of.camera == member.id);
            if let Some(place) = place {
                let time = answer.sources[place].timestamp;
                let hidden = hidden.at(&door, member.id.as_str(), time)?;
                document.insert("seen_at".to_owned(), json!(time.to_string()));
                document.insert("hidden".to_owned(), json!(hidden));
                document.insert("blurred".to_owned(), json!(blur.map(blur_document)));
            }
            if let Some(place) = place.filter(|_| !is_gap) {
                let time = answer.sources[place].timestamp;
                let (frame, is_same) = match held.get(place).cloned().flatten() {
                    Some(frame) => (frame, true),
                    None => (seen_again(&door, &member.id, time)?, false),
                };
                let file = camera_file(member.id.as_str());
                let before_secs = answer.instant.secs_since(time);
                document.insert("frame_time".to_owned(), json!(time.to_string()));
                document.insert("frame_before_secs".to_owned(), json!(before_secs));
                document.insert("frame_file".to_owned(), json!(file));
                document
                    .insert("frame_from".to_owned(), json!(if is_same { "memory" } else { "decoded_again" }));
                frames.push((file, blur.map_or_else(|| Arc::clone(&frame), |blur| blur.blurred(&frame))));
            }
            documents.push(Value::Object(document));
        }
        Ok::<_, EvidenceError>((scene, answer, frames, documents))
    });
    let (scene, answer, frames, documents) =
        worked.await.map_err(EvidenceError::broken_off("looking at cameras"))??;
    let mut about = Map::new();
    let mut put = |name: &str, value: Value| drop(about.insert(name.to_owned(), value));
    put("asked", json!({ "scene": id, "parameters": parameters, "t": asked_time(at) }));
    put("people", people);
    put("view", view_document(answer.kind, answer.view, size_px));
    put("plan", plan_document(&answer));
    put("cameras", Value::Array(documents));
    put("cameras_left_out", json!(is_left_out));
    put("scene", scene_document(&scene)?);
    let cameras = scene.cameras.iter().map(|member| member.id.to_string()).collect();
    let picture = Pixels::Rendered(Arc::clone(&answer.image));
    Ok(Taken { picture, frames, shown_at: answer.instant, subject: ("scene", id), cameras, about })
}

/// A frame that memory no longer holds, from the recordings.
fn seen_again(door: &Handle, camera: &CameraId, time: Timestamp) -> Result<Arc<YuvImage>, EvidenceError> {
    let seen = door.observation(camera.as_str(), At::Time(time))?;
    if seen.frame.timestamp == time {
        return Ok(seen.frame.image);
    }
    Err(EvidenceError::Gone(format!(
        "the frame of camera {camera} at {time} is gone before it could be kept"
    )))
}

async fn take_camera(
    door: &Handle,
    grants: &Grants,
    (camera, at): (String, At),
    blur: Option<BlurAsked>,
) -> Result<Taken, EvidenceError> {
    let people = people_document(blur.as_ref());
    let hidden = Hidden::of(door, std::iter::once(camera.as_str()));
    let (asked, of) = (door.clone(), camera.clone());
    let looked = tokio::task::spawn_blocking(move || asked.observation(&of, at)).await;
    let seen = looked.map_err(EvidenceError::broken_off("looking back"))??;
    check_export(grants, &camera)?;
    let (asked, of) = (door.clone(), seen.clone());
    let blurred = tokio::task::spawn_blocking(move || {
        let blur = blur.map(|blur| asked.blur(&of, &blur)).transpose()?;
        let image = blur.as_ref().map(|blur| blur.blurred(&of.frame.image));
        Ok::<_, EvidenceError>((blur, image))
    });
    let (blur, blurred) = blurred.await.map_err(EvidenceError::broken_off("blurring"))??;
    hidden.check_unchanged(door)?;
    let time = seen.frame.timestamp;
    let id = seen.frame.camera.clone();
    let mut document = camera_document(&id, &door.cameras(), time);
    let mut calibrations = BTreeMap::new();
    for summary in door.scenes() {
        if summary.cameras.contains(&id)
            && let Ok(scene) = door.scene(&summary.id)
        {
            calibrations.insert(summary.id, calibration(&scene, &id)?);
        }
    }
    document.insert("calibrations".to_owned(), json!(calibrations));
    document.insert("seen_at".to_owned(), json!(time.to_string()));
    document.insert("hidden".to_owned(), json!(hidden.at(door, &camera, time)?));
    document.insert("blurred".to_owned(), json!(blur.as_ref().map(blur_document)));
    document.insert("part".to_owned(), json!("frame"));
    document.insert("frame_time".to_owned(), json!(time.to_string()));
    document.insert("frame_before_secs".to_owned(), json!(0.0));
    document.insert("frame_file".to_owned(), json!(PICTURE));
    document.insert("frame_from".to_owned(), json!("memory"));
    let about = Map::from_iter([
        ("asked".to_owned(), json!({ "camera": camera, "t": asked_time(at) })),
        ("cameras".to_owned(), json!([document])),
        ("people".to_owned(), people),
    ]);
    Ok(Taken {
        picture: Pixels::Frame(blurred.unwrap_or(seen.frame.image)),
        frames: Vec::new(),
        shown_at: time,
        subject: ("camera", camera.clone()),
        cameras: vec![camera],
        about,
    })
}

fn asked_time(at: At) -> String {
    match at {
        At::Live => "live".to_owned(),
        At::Time(instant) => instant.to_string(),
    }
}

/// What is known of a camera at the time of making.
fn camera_document(camera: &CameraId, states: &[CameraSummary], shown_at: Timestamp) -> Map<String, Value> {
    let state = states.iter().find(|state| state.id == *camera);
    let newest = state.and_then(|state| state.last.as_deref()?.parse::<Timestamp>().ok());
    let document = json!({
        "id": camera.as_str(),
        "name": state.map(|state| state.name.as_str()),
        "state": state.map(|state| state.state.as_str()),
        "state_since": state.map(|state| state.since.as_str()),
        // Readers of the record are told no addresses and paths, whoever made it.
        "reason": state.and_then(|state| state.public_reason.as_deref()),
        "size_px": state.and_then(|state| state.size_px),
        "newest_frame_time": newest.map(|newest| newest.to_string()),
        "newest_frame_after_secs": newest.map(|newest| newest.secs_since(shown_at)),
        "newest_frame_age_secs": state.and_then(|state| state.age_secs),
    });
    match document {
        Value::Object(members) => members,
        _ => Map::new(),
    }
}

fn calibration(scene: &Scene, camera: &CameraId) -> Result<Value, EvidenceError> {
    let member = scene.cameras.iter().find(|member| member.id == *camera);
    let document = member.map(|member| CameraDocument::from_camera(&member.camera));
    serde_json::to_value(document).map_err(unwritten)
}

fn scene_document(scene: &Scene) -> Result<Value, EvidenceError> {
    let document: Value = serde_json::from_str(&scene.document).map_err(unwritten)?;
    Ok(json!({ "id": scene.id, "name": scene.name, "document": document }))
}

fn unwritten(error: serde_json::Error) -> EvidenceError {
    EvidenceError::Engine(EngineError::Internal(format!("writing down a snapshot: {error}")))
}

/// Where a picture is seen from, lengths in metres and angles in radians.
fn view_document(kind: ViewKind, view: SceneView, size_px: [u32; 2]) -> Value {
    let mut document = json!({
        "eye_m": view.eye.to_array(),
        "target_m": view.target.to_array(),
        "fov_y_rad": view.fov_y_rad,
        "size_px": size_px,
    });
    let own = match kind {
        ViewKind::Perspective => json!({ "projection": "perspective" }),
        ViewKind::Orthographic { across_m } => json!({ "projection": "orthographic", "across_m": across_m }),
        ViewKind::Map { across_m, heading_rad } => {
            json!({ "projection": "map", "across_m": across_m, "heading_rad": heading_rad })
        }
        ViewKind::Panorama { span_rad } => json!({ "projection": "panorama", "span_rad": span_rad }),
        ViewKind::Stereo { eye_distance_m, convergence_m } => {
            json!({ "projection": "stereo", "eye_distance_m": eye_distance_m, "convergence_m": convergence_m })
        }
        ViewKind::Window { corners } => {
            json!({ "projection": "window", "corners_m": corners.map(|corner| corner.to_array()) })
        }
    };
    if let (Value::Object(document), Value::Object(own)) = (&mut document, own) {
        document.extend(own);
    }
    document
}

/// Which effects ran and why, and which cameras showed what: by their places among those that had a frame.
fn plan_document(answer: &ViewAnswer) -> Value {
    let plan = &answer.plan;
    let ids = |places: &[usize]| {
        let id = |place: &usize| answer.sources.get(*place).map(|source| source.camera.as_str());
        places.iter().filter_map(id).map(str::to_owned).collect::<Vec<_>>()
    };
    json!({
        "effects": plan.reasons,
        "surface_cameras": ids(&plan.surface_cameras),
        "depth_map_cameras": ids(&plan.depth_map_cameras),
        "entity_cameras": ids(&plan.entity_cameras),
        "entities": plan.billboards.chunk_by(|a, b| a.entity == b.entity).count(),
        "settings": answer.settings.knobs().into_iter().collect::<BTreeMap<_, _>>(),
    })
}
