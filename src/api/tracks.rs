//! `/api/v1/scenes/{id}/tracks`: what moved before a scene's cameras, by time, camera and place.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::pages;
use super::parameters::{IDS_PATTERN, Parameter};
use super::query::{MAX_COORDINATE_M, Query};
use super::scenes;
use super::scenes::problem_of;
use super::schema;
use super::segments::Segments;
use axum::http::Uri;
use axum::response::Response;
use glam::DVec2;
use serde_json::{Value, json};
use videofields_service::engine::{FoundPoint, FoundTrack, TrackQuery};
use videofields_vision::access::Right;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::GroundPolygon;

/// Most corners of a region.
const MAX_CORNERS: usize = 64;

const PARAMETERS: &[Parameter] = &[
    Parameter::instant("from", "Where the time begins; tracks count that were seen between").required(),
    Parameter::instant("to", "Where it ends").required(),
    Parameter::text(
        "cameras",
        (IDS_PATTERN, "north,east"),
        "Cameras of the scene, with commas between them; all without it",
    ),
    Parameter::text(
        "region",
        (REGION_PATTERN, "0,0;6,0;6,4;0,4"),
        "Corners x,y of a part of the ground, metres in the world; everywhere without it",
    ),
    pages::LIMIT,
    pages::CURSOR,
];

/// 3 to [`MAX_CORNERS`] corners.
const REGION_PATTERN: &str = r"^[-+]?[0-9]{1,7}(\.[0-9]{1,17})?,[-+]?[0-9]{1,7}(\.[0-9]{1,17})?(;[-+]?[0-9]{1,7}(\.[0-9]{1,17})?,[-+]?[0-9]{1,7}(\.[0-9]{1,17})?){2,63}$";

/// Routes about what moved.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_tracks", "What moved before a scene's cameras, and where it went")
        .about("The track that began last first.")
        .right(Right::History)
        .parameters(PARAMETERS)
        .answers(Answer::page("The tracks", schema::past::tracks()));
    Routes::of(scenes::TAG, scenes::SEGMENTS).get("/api/v1/scenes/{id}/tracks", self::list, list)
}

/// The newest tracks of a span of time, the one that began last first.
pub(super) async fn list(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    uri: Uri,
) -> Result<Response, Problem> {
    let query = read(uri.query())?;
    let (from, to) = query.span;
    let found = api.compute("searching tracks", move |door| door.search_tracks(&id, &query)).await;
    let found = found.map_err(|error| problem_of(&api, error))?;
    let body = json!({
        "from": from.to_string(),
        "to": to.to_string(),
        "tracks": found.tracks.iter().map(track).collect::<Vec<_>>(),
        "is_complete": found.next.is_none(),
    });
    Ok(pages::answer(&uri, body, found.next.map(|next| next.to_string())))
}

fn read(raw: Option<&str>) -> Result<TrackQuery, Problem> {
    let mut query = Query::parse(raw, PARAMETERS);
    let span = span(&mut query);
    let cameras = query.value("cameras", "ids of cameras with commas between them", cameras);
    let around = format!(
        "x,y;x,y;x,y: 3 to {MAX_CORNERS} corners of two numbers of metres, each within +-{MAX_COORDINATE_M:e}, around an \
         area of at least 1e-6 m2 and without edges that cross"
    );
    let region = query.value("region", &around, region);
    let limit = pages::limit(&mut query);
    let before = pages::cursor(&mut query, |text| text.parse().ok());
    let span = ordered(query.finish(span)?)?;
    Ok(TrackQuery { span, cameras, region, before, limit })
}

/// Returns the time from `from` to `to`, which must be there.
pub(super) fn span(query: &mut Query) -> Option<(Timestamp, Timestamp)> {
    query.require("from");
    query.require("to");
    let (from, to) = (query.instant("from"), query.instant("to"));
    from.zip(to)
}

/// Refuses a time that ends before it begins.
pub(super) fn ordered(span: (Timestamp, Timestamp)) -> Result<(Timestamp, Timestamp), Problem> {
    if span.0 >= span.1 {
        let fault = Fault::new("to", format!("must be after from, which is {}", span.0));
        return Err(Problem::at(ErrorKind::Invalid, vec![fault]));
    }
    Ok(span)
}

/// Ids of cameras with commas between them.
pub(super) fn cameras(text: &str) -> Option<Vec<CameraId>> {
    text.split(',').map(|id| CameraId::new(id).ok()).collect()
}

fn region(text: &str) -> Option<GroundPolygon> {
    let corner = |text: &str| {
        let (x, y) = text.split_once(',')?;
        Some(DVec2::new(x.parse().ok()?, y.parse().ok()?))
    };
    // No more are read than may be.
    let corners: Vec<DVec2> = text.split(';').take(MAX_CORNERS + 1).map(corner).collect::<Option<_>>()?;
    // The polygon refuses what is not finite, too far off, without area or crossed by itself.
    (corners.len() <= MAX_CORNERS).then(|| GroundPolygon::new(corners, 0.0).ok())?
}

fn track(of: &FoundTrack) -> Value {
    json!({
        "camera": of.camera.as_str(),
        "track": of.number,
        "entity": of.entity,
        "began": of.began_at.to_string(),
        "ended": of.ended_at.to_string(),
        "height": rounded(of.height_share, 1e5),
        "first_in_region": of.in_region.map(|(first, _)| first.to_string()),
        "last_in_region": of.in_region.map(|(_, last)| last.to_string()),
        "path": of.path.iter().map(point).collect::<Vec<_>>(),
    })
}

fn point(of: &FoundPoint) -> Value {
    let [u, v] = of.texture.map(|value| rounded(value, 1e5));
    // What is kept of a foot's place is no finer.
    let point_m = of.point_m.map(|point| point.map(|value| rounded(value, 1e3)));
    json!({ "at": of.at.to_string(), "u": u, "v": v, "point_m": point_m })
}

/// To whole parts of which `parts` make one; never -0.
fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts + 0.0
}
