//! `/api/v1/calibrations`: where cameras stand and how their lenses see, in each scene that holds them; and a calibration put
//! in the place of another.
//!
//! A calibration is a part of a scene's document. Here it is read and replaced by itself, by who may manage the camera and needs
//! not know the rest of the scene: its tag is a digest of what is shown of it, and changes with nothing else.

use super::calibration_import::{self, Reading};
use super::conditions::{TagCondition, optional};
use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::Parameter;
use super::query::Query;
use super::segments::Segments;
use super::tags::EntityTag;
use super::tune::refuse_foreign;
use super::{Api, cameras, pages, scenes, schema};
use axum::extract::RawQuery;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use glam::{DMat3, DVec3};
use serde_json::{Value, json};
use std::sync::Arc;
use videofields_picture::scene::{Scene, SceneCamera};
use videofields_service::catalog::CatalogError;
use videofields_vision::access::{Right, Role};
use videofields_vision::calibrate::{CameraDocument, DistortionDocument};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::CameraId;

const LIST: &str = "/api/v1/calibrations";
const ONE: &str = "/api/v1/calibrations/{camera}";

/// How far the fit of another lens model misses, where there was one to fit.
const FIT_ERROR: HeaderName = HeaderName::from_static("videofields-fit-error");

const SEGMENTS: &[Parameter] = &[Parameter::id("camera", "A camera")];

const SCENE: Parameter = Parameter::id("scene", "In which scene; the first that holds the camera without it");

const LIST_PARAMETERS: &[Parameter] =
    &[Parameter::id("scene", "Of this scene alone"), pages::LIMIT, pages::CURSOR];

const PUT_PARAMETERS: &[Parameter] = &[
    SCENE,
    calibration_import::FORMAT,
    calibration_import::ENTRY,
    calibration_import::IMAGE_SIZE,
    calibration_import::METRES_PER_UNIT,
    Parameter::flag("validate_only", "Keeps nothing, needs no condition, and says what would be kept"),
];

/// Routes about calibrations.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_calibrations", "Every camera's calibration in every scene, in short")
        .about("In the order of cameras, then of scenes; of cameras that the caller may know of.")
        .parameters(LIST_PARAMETERS)
        .may_fail(&[404])
        .answers(Answer::page("The calibrations", schema::calibrations::all()));
    let one = Operation::new("show_calibration", "Where a camera stands in a scene, and how its lens sees")
        .about("The tag is a digest of the answer.")
        .parameters(&[SCENE])
        .revalidated()
        .answers(Answer::json(200, "The calibration", schema::named("CameraCalibration")).tagged());
    let put = Operation::new("put_calibration", "Puts a calibration in the place of another")
        .about(
            "In any format that scenes import. On disk, as the next version of the scene, and in force from the next picture \
             on; maps are built anew.",
        )
        .role(Role::Operator)
        .right(Right::Manage)
        .conditional()
        .parameters(PUT_PARAMETERS)
        .takes(json!({"anyOf": [schema::named("Calibration"), schema::anything()]}))
        .takes_media("application/yaml", schema::text())
        .takes_media("application/xml", schema::text())
        .may_fail(&[409, 422, 501])
        .answers(
            Answer::json(200, "It is replaced, or would be kept like that", schema::named("CameraCalibration"))
                .may_have("ETag", "Of what is kept now")
                .may_have(
                    "Videofields-Fit-Error",
                    "Where the text's lens model was fitted by ours: by how many pixels it misses at most",
                ),
        );
    Routes::of(cameras::TAG, SEGMENTS).get(LIST, self::list, list).get(ONE, self::one, one).put(
        ONE,
        self::put,
        put,
    )
}

/// Every calibration that the caller may know of, in short.
pub(super) async fn list(Asked(api): Asked, uri: Uri) -> Result<Response, Problem> {
    let mut query = Query::parse(uri.query(), LIST_PARAMETERS);
    let of = query.id("scene");
    let limit = pages::limit(&mut query);
    let cursor = pages::cursor(&mut query, |text| {
        let (camera, scene) = text.split_once(':')?;
        Some((CameraId::new(camera).ok()?, scene.to_owned()))
    });
    let of = query.finish(Some(of))?;
    let mut all: Vec<(CameraId, Arc<Scene>)> = known(&api, of.as_deref())?
        .into_iter()
        .flat_map(|scene| {
            let ids: Vec<_> = scene.cameras.iter().map(|member| member.id.clone()).collect();
            ids.into_iter().map(move |id| (id, Arc::clone(&scene)))
        })
        .collect();
    let place = |(camera, scene): &(CameraId, Arc<Scene>)| (camera.clone(), scene.id.clone());
    all.sort_by_key(place);
    all.retain(|one| cursor.as_ref().is_none_or(|told| place(one) > *told));
    let has_more = pages::cut(&mut all, limit);
    let next = all.last().filter(|_| has_more).map(|(camera, scene)| format!("{camera}:{}", scene.id));
    let told: Vec<Value> = all
        .iter()
        .filter_map(|(camera, scene)| Some(summary(&api, scene, member(scene, camera.as_str())?)))
        .collect();
    Ok(pages::answer(&uri, json!({ "calibrations": told }), next))
}

/// A camera's calibration in a scene.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(camera): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), &[SCENE]);
    let scene = query.id("scene");
    let scene = query.finish(Some(scene))?;
    let (scene, camera) = find(&api, &camera, scene.as_deref())?;
    let text = document(&api, &scene, &camera).to_string();
    let tag = EntityTag::of(text.as_bytes()).text();
    Ok((fields(Some(tag)), text).into_response())
}

/// Replaces it (`If-Match`); with `validate_only=true` says what would be kept.
pub(super) async fn put(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    let Asking { scene, reading, validates_only } = Asking::read(raw.as_deref())?;
    refuse_foreign(&api.site, &headers)?;
    let (scene, _) = find(&api, &id, scene.as_deref())?;
    check_change(&api, &id)?;
    let condition = if validates_only {
        // It needs none, but one that cannot be read is told.
        optional(&headers)?;
        None
    } else {
        Some(TagCondition::required(&headers)?)
    };
    let imported = calibration_import::taken(&api, &body, reading).await?;
    let fit_error = imported.residual_px.map(|residual_px| format!("{residual_px:.4}"));
    let fit_error = fit_error.and_then(|text| HeaderValue::try_from(text).ok());
    let mut response = match condition {
        None => {
            let would_be = SceneCamera { id: camera_id(&scene, &id)?, camera: Arc::new(imported.camera) };
            (fields(None), document(&api, &scene, &would_be).to_string()).into_response()
        }
        Some(condition) => {
            let calibration = CameraDocument::from_camera(&imported.camera);
            keep(&api, (&scene.id, &id), &calibration, condition).await?
        }
    };
    if let Some(fit_error) = fit_error {
        response.headers_mut().insert(FIT_ERROR, fit_error);
    }
    Ok(response)
}

/// What a change says in its query.
struct Asking {
    scene: Option<String>,
    reading: Reading,
    validates_only: bool,
}

impl Asking {
    fn read(raw: Option<&str>) -> Result<Self, Problem> {
        let mut query = Query::parse(raw, PUT_PARAMETERS);
        let scene = query.id("scene");
        let reading = Reading::read(&mut query);
        let only = query.choice("validate_only", &[("false", false), ("true", true)]).unwrap_or_default();
        query.finish(Some(Self { scene, reading, validates_only: only }))
    }
}

async fn keep(
    api: &Api,
    (scene, camera): (&str, &str),
    calibration: &CameraDocument,
    condition: TagCondition,
) -> Result<Response, Problem> {
    let catalog = Arc::clone(api.catalog()?);
    let by = api.identity.caller.user.clone();
    // Of the whole scene this camera's part alone: what else was changed of it is no concern of this caller's.
    let is_seen = |now: &Scene| {
        let tag = member(now, camera).map(|own| tag(api, now, own));
        tag.is_some_and(|tag| condition.holds(&tag))
    };
    let put = catalog.put_calibration(&api.whole, (scene, camera), calibration, is_seen, by.clone()).await;
    let scene = put.map_err(|error| problem_of(api, error))?;
    tracing::info!(scene = scene.id, camera, by, "a camera's calibration is replaced");
    let own = member(&scene, camera)
        .ok_or_else(|| Problem::new(ErrorKind::Internal, format!("camera {camera} is lost")))?;
    let text = document(api, &scene, own).to_string();
    let tag = EntityTag::of(text.as_bytes()).text();
    Ok((StatusCode::OK, fields(Some(tag)), text).into_response())
}

/// Refuses who may not change a camera that they know of.
fn check_change(api: &Api, camera: &str) -> Result<(), Problem> {
    let grants = &api.identity.caller.grants;
    if !grants.has(camera, Right::Manage) {
        let detail = format!("of camera {camera} you have no right to manage");
        return Err(Problem::new(ErrorKind::Forbidden, detail));
    }
    if grants.role() < Role::Operator {
        let detail = "changing a camera is for operator and above";
        return Err(Problem::new(ErrorKind::Forbidden, detail));
    }
    Ok(())
}

/// The scenes with the cameras that the caller may know of; one of them where it is named.
fn known(api: &Api, of: Option<&str>) -> Result<Vec<Arc<Scene>>, Problem> {
    match of {
        Some(of) => Ok(vec![scenes::find(api, of)?]),
        // One that is taken away meanwhile is left out.
        None => Ok(api.door.scenes().iter().filter_map(|scene| api.door.scene(&scene.id).ok()).collect()),
    }
}

/// A scene that holds a camera, and the camera in it.
fn find(api: &Api, camera: &str, scene: Option<&str>) -> Result<(Arc<Scene>, SceneCamera), Problem> {
    let known = known(api, scene)?;
    let found = known.iter().find_map(|scene| Some((Arc::clone(scene), member(scene, camera)?.clone())));
    found.ok_or_else(|| {
        let members = known.iter().flat_map(|scene| &scene.cameras);
        let mut ids: Vec<&str> = members.map(|member| member.id.as_str()).collect();
        ids.sort_unstable();
        ids.dedup();
        Problem::missing("calibrated camera", camera, &ids)
    })
}

fn member<'a>(scene: &'a Scene, camera: &str) -> Option<&'a SceneCamera> {
    scene.cameras.iter().find(|member| member.id.as_str() == camera)
}

fn camera_id(scene: &Scene, camera: &str) -> Result<CameraId, Problem> {
    let found = member(scene, camera).map(|member| member.id.clone());
    found.ok_or_else(|| Problem::missing("calibrated camera", camera, &[]))
}

/// The entity tag of a calibration as the caller is shown it.
fn tag(api: &Api, scene: &Scene, camera: &SceneCamera) -> String {
    EntityTag::of(document(api, scene, camera).to_string().as_bytes()).text()
}

fn fields(tag: Option<String>) -> HeaderMap {
    let mut fields = HeaderMap::new();
    fields.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
    fields.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    if let Some(tag) = tag.and_then(|tag| HeaderValue::try_from(tag).ok()) {
        fields.insert(header::ETAG, tag);
    }
    fields
}

/// How the list shows it.
fn summary(api: &Api, scene: &Scene, camera: &SceneCamera) -> Value {
    let CameraDocument { image_size_px, distortion, position_m, .. } =
        CameraDocument::from_camera(&camera.camera);
    let model = match distortion {
        DistortionDocument::None => "none",
        DistortionDocument::BrownConrady { .. } => "brown_conrady",
        DistortionDocument::Fisheye { .. } => "fisheye",
    };
    json!({
        "camera": camera.id.as_str(),
        "scene": scene.id,
        "image_size_px": image_size_px,
        "lens": model,
        "position_m": position_m,
        "etag": tag(api, scene, camera),
    })
}

fn document(api: &Api, scene: &Scene, camera: &SceneCamera) -> Value {
    let calibration = CameraDocument::from_camera(&camera.camera);
    let ([fx, fy], [cx, cy]) = (calibration.focal_px, calibration.center_px);
    let pose = camera.camera.pose();
    let turn = DMat3::from_quat(pose.world_from_local);
    let back = turn.transpose();
    json!({
        "camera": camera.id.as_str(),
        "scene": scene.id,
        "calibration": calibration,
        "camera_matrix_px": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
        "camera_from_world": rows(back, -(back * pose.position_in_world)),
        "world_from_camera": rows(turn, pose.position_in_world),
        "conventions": {
            "world": "right-handed, metres, z up",
            "camera": "right-handed, metres, x right, y down, z forward",
            "matrices": "rows; camera_from_world turns and shifts a point of the world into the camera's axes, \
                         world_from_camera back",
            "quaternion": "x, y, z, w; turns the camera's axes into the world's",
            "pixel_centers": 0.5,
        },
        "source": source(api, &scene.id),
    })
}

/// A turn and what is added after it, row by row; never -0.
fn rows(turn: DMat3, shift: DVec3) -> [[f64; 4]; 3] {
    let row = |idx: usize| {
        let of = turn.row(idx);
        [of.x, of.y, of.z, shift[idx]].map(|value| value + 0.0)
    };
    [row(0), row(1), row(2)]
}

/// Where the scene's document is, for admins: whether it is still the file's tells of changes of hidden cameras too.
fn source(api: &Api, scene: &str) -> Value {
    let is_admin = api.identity.caller.grants.role() == Role::Admin;
    let Some(catalog) = api.catalog.as_ref().filter(|_| is_admin) else { return Value::Null };
    let file = catalog.scene_file(scene);
    let kind = if file.is_some() { "configuration" } else { "kept" };
    json!({ "kind": kind, "file": file.map(|file| file.display().to_string()) })
}

/// As any failure of the catalog, without what would tell of the rest of the scene.
fn problem_of(api: &Api, error: CatalogError) -> Problem {
    match error {
        CatalogError::Changed { .. } | CatalogError::Overtaken { .. } => {
            Problem::new(ErrorKind::Changed, "the calibration was changed meanwhile: look at it again")
        }
        // The calibration itself is right: what does not fit any more is of the rest, such as a model's file that is gone.
        error @ (CatalogError::Faults(_) | CatalogError::Scene(_)) => {
            tracing::warn!(%error, "a scene cannot be read again with another calibration");
            let is_admin = api.identity.caller.grants.role() == Role::Admin;
            let why = if is_admin { format!(": {error}") } else { "; the log says why".to_owned() };
            let detail = format!("the scene that holds the camera cannot be read again as it stands{why}");
            Problem::new(ErrorKind::Conflict, detail)
        }
        CatalogError::Engine(error) => scenes::problem_of(api, error),
        error => error.into(),
    }
}
