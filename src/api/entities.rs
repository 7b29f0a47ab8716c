//! `/api/v1/scenes/{id}/entities`: who stands before a scene's cameras at a time, and the shape that their silhouettes leave.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::pages;
use super::parameters::Parameter;
use super::query::Query;
use super::segments::Segments;
use super::{scenes, schema, tracks};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderValue, Uri, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::ops::RangeInclusive;
use videofields_picture::fuse::{EntityHull, HullMaking, HullMemory, LEAST_VIEWS, SceneState};
use videofields_service::engine::{EntityQuery, FoundEntity, FoundStand, PresentEntity};
use videofields_vision::access::Right;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::RgbImage;
use videofields_vision::hull::{self, Bounds, Method};
use videofields_vision::mesh::Mesh;

/// Places of the grid along a hull's longest side.
const RESOLUTION: RangeInclusive<u32> = 16..=256;
const DEFAULT_RESOLUTION: u32 = 96;

/// Of the masks' pixels, by how much outlines are simplified.
const OUTLINE_ERROR_PX: f64 = 0.25;

/// How a mesh is written, by the file's name.
const FILES: [(&str, Written, &str); 2] =
    [("hull.glb", Written::Glb, "model/gltf-binary"), ("hull.ply", Written::Ply, "application/octet-stream")];

#[derive(Clone, Copy, PartialEq, Eq)]
enum Written {
    Glb,
    Ply,
}

const T: &[Parameter] = &[Parameter::moment("t", "Which time is asked for")];

const PARAMETERS: &[Parameter] = &[
    Parameter::moment("t", "Which time is asked for"),
    Parameter::whole("resolution", &(16..=256), "Places of the grid along the longest side").default_is("96"),
];

const PATHS: &[Parameter] = &[
    Parameter::instant("from", "Where the time begins").required(),
    Parameter::instant("to", "Where it ends").required(),
    pages::LIMIT,
    pages::CURSOR,
];

const SEGMENTS: &[Parameter] = &[
    Parameter::id("id", "A scene"),
    Parameter::whole("entity", &(0..=(1 << 53) - 1), "An entity"),
    Parameter::files(
        "file",
        || FILES.iter().map(|(name, ..)| (*name).to_owned()).collect(),
        "How the mesh is written",
    ),
];

/// Routes about who stands in a scene.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_entities", "Who stands before a scene's cameras at a time")
        .about("With the ids of its tracks' stream, now and when it is over.")
        .right(Right::Live)
        .parameters(T)
        .answers(Answer::json(200, "Who is there and where", schema::scenes::entities()));
    let mesh = Operation::new("show_hull", "The shape that an entity's silhouettes leave, as a closed mesh")
        .about("With colours of the cameras that see it. Needs two cameras that see it.")
        .right(Right::Live)
        .parameters(PARAMETERS)
        .answers(
            Answer::bytes(200, "The mesh", &["model/gltf-binary", "application/octet-stream"])
                .field("Videofields-Time", "The instant shown, RFC 3339")
                .field("Videofields-Cameras", "The cameras whose silhouettes it is of")
                .field("Videofields-Skew", "How far apart their frames are, seconds"),
        );
    let paths = Operation::new("list_entity_paths", "Who was where before a scene's cameras in a time")
        .about("By all of its cameras together, with one id for one person; whoever began first comes first.")
        .right(Right::History)
        .parameters(PATHS)
        .answers(Answer::page("Who was where", schema::past::entity_paths()));
    Routes::of(scenes::TAG, SEGMENTS)
        .get("/api/v1/scenes/{id}/entities", self::list, list)
        .get("/api/v1/scenes/{id}/entities/paths", self::paths, paths)
        .get("/api/v1/scenes/{id}/entities/{entity}/{file}", self::mesh, mesh)
}

/// Returns who was where in a time.
async fn paths(Asked(api): Asked, Segments(id): Segments<String>, uri: Uri) -> Result<Response, Problem> {
    let mut query = Query::parse(uri.query(), PATHS);
    let span = tracks::span(&mut query);
    let limit = pages::limit(&mut query);
    let after = pages::cursor(&mut query, |text| text.parse().ok());
    let (from, to) = tracks::ordered(query.finish(span)?)?;
    let asked = EntityQuery { span: (from, to), after, limit };
    let found = api.compute("searching entities", move |door| door.search_entities(&id, &asked)).await;
    let found = found.map_err(|error| scenes::problem_of(&api, error))?;
    let unknown =
        |(from, to): &(Timestamp, Timestamp)| json!({ "from": from.to_string(), "to": to.to_string() });
    let body = json!({
        "from": from.to_string(),
        "to": to.to_string(),
        "entities": found.entities.iter().map(path).collect::<Vec<_>>(),
        "unknown": found.unknown.iter().map(unknown).collect::<Vec<_>>(),
        "is_complete": found.next.is_none(),
    });
    Ok(pages::answer(&uri, body, found.next.map(|next| next.to_string())))
}

fn path(of: &FoundEntity) -> Value {
    let stand = |of: &FoundStand| json!({ "at": of.at.to_string(), "point_m": of.point_m.map(millimetres), "cameras": of.cameras });
    json!({
        "id": of.id,
        "height_m": millimetres(of.height_m),
        "path": of.path.iter().map(stand).collect::<Vec<_>>(),
    })
}

/// Rounds to a millimetre; never -0.
fn millimetres(metres: f64) -> f64 {
    (metres * 1e3).round() / 1e3 + 0.0
}

/// Who stands there.
async fn list(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), T);
    let moment = query.moment(|id| api.door.playhead_at(id));
    let moment = query.finish(Some(moment))?;
    let scene = id.clone();
    let present =
        api.look_back("looking who was there", move |door| door.present_at(&scene, moment.at)).await;
    let present = present.map_err(|error| scenes::problem_of(&api, error))?;
    let entity = |of: &PresentEntity| {
        json!({
            "id": of.id,
            "position_m": of.foot_in_world.to_array().map(millimetres),
            "height_m": millimetres(of.height_m),
            "cameras": of.seen_by,
            "has_hull": of.seen_by.len() >= LEAST_VIEWS,
        })
    };
    let entities: Vec<Value> = present.entities.iter().map(entity).collect();
    let body = json!({ "scene": id, "time": present.instant.to_string(), "entities": entities });
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(body)).into_response())
}

/// One hull.
async fn mesh(
    Asked(api): Asked,
    Segments((id, entity, file)): Segments<(String, String, String)>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let names = FILES.map(|(name, ..)| name);
    let Some((_, written, content_type)) = FILES.into_iter().find(|(name, ..)| *name == file) else {
        return Err(Problem::missing("file", &file, &names));
    };
    let mut query = Query::parse(raw.as_deref(), PARAMETERS);
    let moment = query.moment(|id| api.door.playhead_at(id));
    let resolution = query.whole("resolution", &RESOLUTION).unwrap_or(DEFAULT_RESOLUTION);
    let (moment, resolution) = query.finish(Some((moment, resolution)))?;
    let scene = id.clone();
    let made = api.look_back("making a hull", move |door| {
        door.standing(&scene, moment.at).map(|state| made(state, &entity, (resolution, written)))
    });
    let Made { bytes, time, cameras, skew_s } =
        made.await.map_err(|error| scenes::problem_of(&api, error))??;
    let mut response = bytes.into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(content_type));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    for (name, value) in [
        ("content-disposition", format!("attachment; filename=\"{file}\"")),
        ("videofields-time", time),
        ("videofields-cameras", cameras),
        ("videofields-skew", format!("{skew_s:.3}")),
    ] {
        if let Ok(value) = HeaderValue::try_from(value) {
            headers.insert(name, value);
        }
    }
    Ok(response)
}

/// A mesh in a file's bytes.
struct Made {
    bytes: Vec<u8>,
    time: String,
    cameras: String,
    skew_s: f64,
}

fn made(mut state: SceneState, entity: &str, (resolution, written): (u32, Written)) -> Result<Made, Problem> {
    let idx = entity.parse().ok().and_then(|id: u64| state.entities.iter().position(|of| of.id == id));
    let Some(idx) = idx else {
        let ids: Vec<String> = state.entities.iter().map(|of| of.id.to_string()).collect();
        let ids: Vec<&str> = ids.iter().map(String::as_str).collect();
        return Err(Problem::missing("entity", entity, &ids));
    };
    let refused = |why: String| {
        Problem::new(ErrorKind::NotFound, format!("there is no hull of entity {entity}: {why}"))
    };
    state.entities.swap(0, idx);
    state.entities.truncate(1);
    let making = HullMaking { error_px: OUTLINE_ERROR_PX, n_voxels: None };
    state.place_hulls(making, &mut HullMemory::default());
    let Some(of) = state.hulls.first() else {
        return Err(refused(format!("fewer than {LEAST_VIEWS} cameras see it")));
    };
    let mesh = painted(&state, of, resolution).map_err(|error| refused(error.to_string()))?;
    let mut bytes = Vec::new();
    match written {
        Written::Glb => mesh.write_glb(&mut bytes),
        Written::Ply => mesh.write_ply(&mut bytes),
    }
    .map_err(|error| refused(error.to_string()))?;
    let ids: Vec<&str> = of.cameras.iter().map(|camera| state.cameras[*camera].id.as_str()).collect();
    Ok(Made { bytes, time: state.instant.to_string(), cameras: ids.join(","), skew_s: of.skew_s })
}

fn painted(state: &SceneState, of: &EntityHull, resolution: u32) -> Result<Mesh, hull::HullError> {
    let [low, high] = of.bounds_in_world;
    let bounds = Bounds::new(low, high).ok_or(hull::HullError::Unbounded)?;
    let mut mesh = hull::extract(&of.hull, &bounds, (Method::ImageBased, resolution))?;
    let picture = |camera: &usize| Some(state.cameras[*camera].observation.frame.image.to_rgb());
    let pictures: Vec<Option<RgbImage>> = of.cameras.iter().map(picture).collect();
    hull::paint(&mut mesh, &of.hull, &pictures);
    Ok(mesh)
}
