//! `/api/v1/cameras`: the cameras, their state, and what they see: frame, background and mask.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::{Routes, Tag};
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter};
use super::picture::{Encoded, Picture, files, pictured, server_timing, split, write_rgb, write_yuv};
use super::query::Query;
use super::segments::Segments;
use super::tags::{Had, Key};
use super::{Api, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use std::sync::Arc;
use videofields_service::engine::{At, CameraSummary, EngineError};
use videofields_vision::access::Right;
use videofields_vision::encode::{self, EncodeError, PictureFormat};
use videofields_vision::frame::{Mask, RgbImage};
use videofields_vision::observation::Observation;

/// Which picture of a camera.
#[derive(Clone, Copy)]
enum Kind {
    Frame,
    Background,
    Mask,
}

const KINDS: [(&str, Kind); 3] =
    [("frame", Kind::Frame), ("background", Kind::Background), ("mask", Kind::Mask)];

/// What these routes, and others of a camera, are about.
pub(super) const TAG: Tag = ("Cameras", "Cameras, what they see, and how they are set");

/// What their paths name.
pub(super) const SEGMENTS: &[Parameter] = &[
    Parameter::id("id", "A camera"),
    Parameter::files("picture", || files(&KINDS), "Which picture, and how it is written"),
];

const PICTURE_PARAMETERS: &[Parameter] = &[Parameter::moment("t", "Which time is shown")];

/// Routes about cameras and their pictures.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_cameras", "Every camera, with its state")
        .about("In the configuration's order; those alone of which the caller has a right.")
        .answers(Answer::json(200, "The cameras", schema::cameras::all()));
    let one = Operation::new("show_camera", "A camera with its state").answers(Answer::json(
        200,
        "The camera",
        schema::named("Camera"),
    ));
    let picture = Operation::new("show_camera_picture", "What a camera sees")
        .revalidated()
        .about(
            "`frame` is the camera's frame, `background` the place without what moves, `mask` what moves: 255 moving, 50 \
             shadow, 0 background.",
        )
        .right(Right::Live)
        .parameters(PICTURE_PARAMETERS)
        .answers(pictured("The picture").field("Videofields-Frame", "The frame's number in its input, from 0"));
    Routes::of(TAG, SEGMENTS)
        .get("/api/v1/cameras", self::list, list)
        .get("/api/v1/cameras/{id}", self::one, one)
        .get("/api/v1/cameras/{id}/{picture}", self::picture, picture)
}

/// Every camera.
pub(super) async fn list(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let body = Json(serde_json::json!({ "cameras": api.door.cameras() }));
    Ok(([(header::CACHE_CONTROL, "no-store")], body).into_response())
}

/// One camera.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let camera = find(&api, &id)?;
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(camera)).into_response())
}

/// What a camera saw.
pub(super) async fn picture(
    Asked(api): Asked,
    Segments((id, file)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (kind, format) = split(&file, &KINDS)?;
    let mut query = Query::parse(raw.as_deref(), PICTURE_PARAMETERS);
    let moment = query.moment(|id| api.door.playhead_at(id));
    let at = moment.at;
    query.finish(Some(()))?;
    let observation = match at {
        At::Live => api.door.observation(&id, at),
        // The past may have to be decoded.
        At::Time(_) => {
            let id = id.clone();
            api.look_back("looking back", move |door| door.observation(&id, at)).await
        }
    };
    let observation = observation.map_err(|error| problem_of(&api, error))?;
    let (instant, number) = (observation.frame.timestamp, observation.frame.number);
    let size_px = [observation.frame.image.width(), observation.frame.image.height()];
    let key = match kind {
        Kind::Frame => Key::Picture(Arc::downgrade(&observation.frame.image), format),
        Kind::Background => Key::Picture(Arc::downgrade(&observation.background), format),
        Kind::Mask => Key::Mask(Arc::downgrade(&observation.labels), format),
    };
    if let Some(spared) = api.spared(&Had::read(&headers), &key, (moment, instant)) {
        return Ok(spared);
    }
    let Encoded { bytes, tag, took } =
        api.encoded(size_px, move || write(&observation, kind, format)).await?;
    api.tags.note(key, tag.clone());
    let mut fields = vec![
        ("videofields-frame", number.to_string()),
        ("server-timing", server_timing(&[("encode", took)])),
    ];
    if at == At::Live
        && let Some(age_secs) = find(&api, &id)?.age_secs
    {
        fields.push(("videofields-age", format!("{age_secs:.3}")));
    }
    Ok(Picture { format, bytes, tag, moment, instant, fields }.into_response())
}

/// The camera of that id, if the caller may know of it.
pub(super) fn find(api: &Api, id: &str) -> Result<CameraSummary, Problem> {
    let found = api.door.cameras().into_iter().find(|camera| camera.id.as_str() == id);
    found.ok_or_else(|| problem_of(api, EngineError::NoCamera { id: id.to_owned() }))
}

/// As any failure of the engine; for a camera that is not there, with those that are.
pub(super) fn problem_of(api: &Api, error: EngineError) -> Problem {
    match error {
        EngineError::NoCamera { id } => {
            let cameras = api.door.cameras();
            let ids: Vec<&str> = cameras.iter().map(|camera| camera.id.as_str()).collect();
            Problem::missing("camera", &id, &ids)
        }
        other => other.into(),
    }
}

fn write(observation: &Observation, kind: Kind, format: PictureFormat) -> Result<Vec<u8>, EncodeError> {
    match (kind, format) {
        (Kind::Frame, _) => write_yuv(format, &observation.frame.image),
        (Kind::Background, _) => write_yuv(format, &observation.background),
        (Kind::Mask, PictureFormat::Png) => encode::png_gray(&observation.labels),
        (Kind::Mask, PictureFormat::Jpeg) => write_rgb(format, &gray(&observation.labels)),
    }
}

fn gray(mask: &Mask) -> RgbImage {
    let data = mask.data.iter().flat_map(|value| [*value; 3]).collect();
    RgbImage { width: mask.width, height: mask.height, data }
}
