//! `/api/v1/scenes/{id}/view.{jpg,png}`: the fused picture of a scene from anywhere.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{Parameter, words};
use super::picture::{Encoded, Picture, pictured, server_timing, split, write_rgb};
use super::query::{Moment, Query};
use super::segments::Segments;
use super::tags::{Finish, Had, Key};
use super::{Api, effects, effort, scenes};
use axum::extract::RawQuery;
use axum::http::HeaderMap;
use axum::response::{IntoResponse, Response};
use glam::DVec3;
use std::ops::RangeInclusive;
use std::sync::Arc;
use videofields_picture::plan::{Aim, Colors, EntityStyle, Preset};
use videofields_picture::scene::SceneView;
use videofields_service::engine::{
    EYE_DISTANCE_M, EngineError, Expected, Origin, ViewAnswer, ViewKind, ViewRequest,
};
use videofields_vision::access::{Right, Scope};
use videofields_vision::clock::Timestamp;
use videofields_vision::encode::PictureFormat;
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::frame::{CameraId, is_id};

/// Columns and rows of a picture where the request names none.
const DEFAULT_SIZE_PX: [u32; 2] = [1280, 720];

/// Most columns and rows that any format can hold; what the renderer allows is the engine's to say.
const SIDE_PX: RangeInclusive<u32> = 1..=65_535;

/// Vertical field of view, degrees.
const FOV_DEGREES: RangeInclusive<f64> = 1.0..=170.0;

/// Least distance between eye and target, metres: below it there is no direction to look in.
const MIN_DISTANCE_M: f64 = 1e-6;

pub(super) const STYLES: [(&str, EntityStyle); 5] = [
    ("billboards", EntityStyle::Billboards),
    ("points", EntityStyle::Points),
    ("hulls", EntityStyle::Hulls),
    ("auto", EntityStyle::Auto),
    ("none", EntityStyle::None),
];

/// The kinds of pictures, with the parameters that mean something to each alone.
const KINDS: [(&str, &[&str]); 6] = [
    ("perspective", &["eye", "target", "fov"]),
    ("orthographic", &["eye", "target", "across"]),
    ("map", &["target", "across", "heading"]),
    ("panorama", &["eye", "target", "fov", "span"]),
    ("stereo", &["eye", "target", "fov", "eye_distance", "convergence"]),
    ("window", &["eye", "window"]),
];

/// Those of [`effort`] come after them.
pub(super) const PARAMETERS: &[Parameter] = &[
    Parameter::word("projection", || words(&KINDS), "How the world comes onto the picture")
        .default_is("perspective"),
    Parameter::point("eye", "Where the viewer stands"),
    Parameter::point("target", "What the viewer looks at"),
    Parameter::number("fov", &FOV_DEGREES, "Vertical field of view, degrees"),
    Parameter::number("across", &ACROSS_M, "Width shown, metres; of `orthographic` and `map`"),
    Parameter::number("heading", &HEADING_DEGREES, "Direction at the top, degrees from north; of `map`"),
    Parameter::number("span", &SPAN_DEGREES, "Degrees from left to right; of `panorama`"),
    Parameter::number("eye_distance", &EYE_DISTANCE_RANGE_M, "Between both eyes, metres; of `stereo`"),
    Parameter::number("convergence", &CONVERGENCE_M, "Where both pictures agree, metres; of `stereo`"),
    Parameter::points("window", "Lower left, lower right and upper left corner; of `window`, which needs it"),
    Parameter::whole("width", &(1..=65_535), "Columns").default_is("1280"),
    Parameter::whole("height", &(1..=65_535), "Rows").default_is("720"),
    Parameter::moment("t", "Which instant is shown"),
    Parameter::word("entities", || words(&STYLES), "How people and things that move are drawn")
        .default_is("billboards"),
    Parameter::word(
        "see_through",
        || vec!["on", "off"],
        "Whether buildings that hide somebody are translucent",
    )
    .default_is("on"),
    Parameter::word("colors", || vec!["even", "raw"], "Whether cameras' exposures are evened out")
        .default_is("even"),
    Parameter::id("session", "Who looks: what changes from picture to picture does so smoothly for them"),
];

/// Ranges of what only some kinds take.
const ACROSS_M: RangeInclusive<f64> = 1e-3..=1e7;
const HEADING_DEGREES: RangeInclusive<f64> = -360.0..=360.0;
const SPAN_DEGREES: RangeInclusive<f64> = 1.0..=360.0;
const EYE_DISTANCE_RANGE_M: RangeInclusive<f64> = 0.0..=1e3;
const CONVERGENCE_M: RangeInclusive<f64> = 1e-3..=1e8;

/// How a view is answered.
fn answered() -> Answer {
    pictured("The picture")
        .field("Videofields-View", "`eye`, `target` and the like as shown, with semicolons between")
        .field("Videofields-Sources", "`camera=time` of each frame that went in")
        .field("Videofields-Plan", "The effects that ran")
        .field("Videofields-Settings", "Every knob of the picture")
        .field("Videofields-Cache", "`miss`, `shared` or `hit`")
}

/// Routes to views of scenes.
pub(super) fn routes() -> Routes {
    let picture = Operation::new("show_view", "The fused picture of a scene from anywhere")
        .revalidated()
        .about("Of the cameras that the caller may see at that time, as if the scene had no others.")
        .right(Right::Live)
        .parameters(PARAMETERS)
        .parameters(&effort::PARAMETERS)
        .parameters(&effects::PARAMETERS)
        .may_fail(&[422])
        .answers(answered());
    Routes::of(scenes::TAG, scenes::SEGMENTS).get("/api/v1/scenes/{id}/{picture}", self::picture, picture)
}

/// The scene as seen from where the request says.
pub(super) async fn picture(
    Asked(api): Asked,
    Segments((id, file)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let ((), format) = split(&file, &[("view", ())])?;
    let (request, moment) = asked(&api, (id, format), raw.as_deref())?;
    if let Some(spared) = spared(&api, &request, (format, moment, &Finish::None), &headers).await {
        return Ok(spared);
    }
    Ok(drawn(&api, request, (format, moment), Finish::None).await?.into_response())
}

/// That the caller has already what is asked for, if that can be told without drawing it.
pub(super) async fn spared(
    api: &Api,
    request: &ViewRequest,
    (format, moment, finish): (PictureFormat, Moment, &Finish),
    headers: &HeaderMap,
) -> Option<Response> {
    let had = Had::read(headers);
    // What a session shows follows from what it showed before.
    if had.is_empty() || request.session.is_some() {
        return None;
    }
    let _looked_back = api.looked_back(request).await;
    let asked = request.clone();
    // Drawing tells what is wrong with the request.
    let identity = api.ask("looking for a picture", move |door| door.identity(&asked)).await.ok()?;
    let instant = identity.instant();
    api.spared(&had, &Key::View(Arc::new(identity), format, finish.clone()), (moment, instant))
}

/// Draws what is asked for, writes it once it is finished, and tells how it came about. Whether cameras are left out
/// is told of the time that `moment` has: a wall that is live asks for instants, and is live all the same.
pub(super) async fn drawn(
    api: &Api,
    request: ViewRequest,
    (format, moment): (PictureFormat, Moment),
    finish: Finish,
) -> Result<Picture, Problem> {
    let size_px = (request.width_px, request.height_px);
    let is_restricted = api.door.leaves_out(&request.scene, moment.at);
    let since = api.clock.monotonic();
    // Kept until the picture is drawn.
    let looked_back = api.looked_back(&request).await;
    let answer = api
        .door
        .view_since(request, looked_back.is_some().then_some(since))
        .await
        .map_err(|error| scenes::problem_of(api, error))?;
    drop(looked_back);
    let instant = answer.instant;
    let image = Arc::clone(&answer.image);
    let finishing = finish.clone();
    let encoded = api.encoded(size_px.into(), move || write_rgb(format, &finishing.of(image))).await?;
    let Encoded { bytes, tag, took } = encoded;
    api.encoding_pace.note(format, size_px, took);
    if let Some(identity) = &answer.identity {
        api.tags.note(Key::View(Arc::clone(identity), format, finish), tag.clone());
    }
    let mut stages = answer.timings.clone();
    stages.push(("encode", took));
    let mut fields = vec![
        ("videofields-view", shown_text(&answer)),
        ("videofields-sources", sources(&answer)),
        ("videofields-plan", running(&answer)),
        ("videofields-settings", settings(&answer)),
        ("videofields-cache", origin(&answer).to_owned()),
        ("server-timing", server_timing(&stages)),
    ];
    if let Some(expected) = &answer.expected {
        fields.push(("videofields-expected", expected_text(expected)));
        if expected.deadline.is_some() {
            let left_out = answer.settings.left_out(&Preset::Exact.settings(4));
            fields.push(("videofields-left-out", left_out.join(",")));
        }
    }
    if !answer.gaps.is_empty() {
        let gaps = answer.gaps.iter().map(CameraId::as_str).collect::<Vec<_>>();
        fields.push(("videofields-gaps", gaps.join(",")));
    }
    if is_restricted {
        fields.push(("videofields-restricted", "true".to_owned()));
    }
    Ok(Picture { format, bytes, tag, moment, instant, fields })
}

/// The request for a view of the scene `id` that the query string `raw` is; of a deadline is kept what writing it in `format`
/// takes.
///
/// # Errors
/// With every wrong parameter, or with the scenes that there are.
pub(super) fn asked(
    api: &Api,
    (id, format): (String, PictureFormat),
    raw: Option<&str>,
) -> Result<(ViewRequest, Moment), Problem> {
    let (mut request, moment) = read(id, raw, |id| api.door.playhead_at(id))?;
    let own_view = scenes::find(api, &request.scene)?.view;
    check_direction(&request, own_view)?;
    reserve(api, &mut request, format);
    Ok((request, moment))
}

/// Keeps of a deadline what writing the picture takes.
pub(super) fn reserve(api: &Api, request: &mut ViewRequest, format: PictureFormat) {
    if let Aim::Within(deadline) = &mut request.effort.aim {
        deadline.reserve = api.encoding_pace.expected(format, (request.width_px, request.height_px));
    }
}

/// Reads a view's parameters as this route's query string has them, for callers that speak no HTTP.
///
/// # Errors
/// With every wrong parameter.
pub fn read_view_request(scene: &str, query: &str) -> Result<ViewRequest, Vec<Fault>> {
    let no_playhead = |id: &str| Err(EngineError::NoPlayhead { id: id.to_owned() });
    read(scene.to_owned(), Some(query), no_playhead)
        .map(|(request, _moment)| request)
        .map_err(Problem::into_faults)
}

/// As [`read_view_request`], of a view that is kept: its playhead may be made later.
pub(super) fn read_kept(scene: &str, query: &str) -> Result<ViewRequest, Vec<Fault>> {
    let playhead = |id: &str| match is_id(id) {
        true => Ok(Timestamp::default()),
        false => Err(EngineError::NoPlayhead { id: id.to_owned() }),
    };
    read(scene.to_owned(), Some(query), playhead)
        .map(|(request, _moment)| request)
        .map_err(Problem::into_faults)
}

fn read(
    scene: String,
    raw: Option<&str>,
    playhead: impl FnOnce(&str) -> Result<Timestamp, EngineError>,
) -> Result<(ViewRequest, Moment), Problem> {
    let known = [PARAMETERS, &effort::PARAMETERS, &effects::PARAMETERS].concat();
    let mut query = Query::parse(raw, &known);
    let moment = query.moment(playhead);
    let kind = read_kind(&mut query);
    let style = query.choice("entities", &STYLES).unwrap_or_default();
    let request = ViewRequest {
        scene,
        kind: kind.unwrap_or_default(),
        eye: query.point("eye"),
        target: query.point("target"),
        fov_y_rad: query.number("fov", &FOV_DEGREES, " degrees").map(f64::to_radians),
        width_px: query.whole("width", &SIDE_PX).unwrap_or(DEFAULT_SIZE_PX[0]),
        height_px: query.whole("height", &SIDE_PX).unwrap_or(DEFAULT_SIZE_PX[1]),
        at: moment.at,
        style,
        see_through: query.choice("see_through", &[("on", true), ("off", false)]).unwrap_or(true),
        colors: query.choice("colors", &[("even", Colors::Even), ("raw", Colors::Raw)]).unwrap_or_default(),
        session: query.id("session"),
        effort: effort::read(&mut query, style),
        effects: effects::read(&mut query),
        horizon: None,
        blur_people: None,
        scope: Scope::all(),
    };
    query.finish(Some((request, moment)))
}

/// Which kind of picture is asked for; `None` of a fault. Parameters of other kinds are faults.
fn read_kind(query: &mut Query) -> Option<ViewKind> {
    let words = KINDS.map(|kind| (kind.0, kind));
    let (name, own) = match query.choice("projection", &words) {
        Some(kind) => kind,
        // A word that is no kind is a fault already.
        None if query.has("projection") => return None,
        None => KINDS[0],
    };
    let others = KINDS.iter().flat_map(|(_, parameters)| *parameters);
    for parameter in others.filter(|parameter| !own.contains(parameter)) {
        query.refuse(
            parameter,
            &format!("means nothing to projection={name}, which takes {}", own.join(", ")),
        );
    }
    let metres = " metres";
    Some(match name {
        "orthographic" => ViewKind::Orthographic { across_m: query.number("across", &ACROSS_M, metres) },
        "map" => ViewKind::Map {
            across_m: query.number("across", &ACROSS_M, metres),
            heading_rad: query.number("heading", &HEADING_DEGREES, " degrees").unwrap_or(0.0).to_radians(),
        },
        "panorama" => ViewKind::Panorama {
            span_rad: query.number("span", &SPAN_DEGREES, " degrees").unwrap_or(360.0).to_radians(),
        },
        "stereo" => ViewKind::Stereo {
            eye_distance_m: query
                .number("eye_distance", &EYE_DISTANCE_RANGE_M, metres)
                .unwrap_or(EYE_DISTANCE_M),
            convergence_m: query.number("convergence", &CONVERGENCE_M, metres),
        },
        "window" => {
            query.require("window");
            ViewKind::Window { corners: query.points("window")? }
        }
        _ => ViewKind::Perspective,
    })
}

/// Refuses, before anything is drawn, an eye and a target (given, or the scene's own) that leave no direction to
/// look in.
fn check_direction(request: &ViewRequest, own: Option<SceneView>) -> Result<(), Problem> {
    if matches!(request.kind, ViewKind::Map { .. } | ViewKind::Window { .. }) {
        return Ok(());
    }
    let eye = request.eye.or(own.map(|view| view.eye));
    let target = request.target.or(own.map(|view| view.target));
    let Some((eye, target)) = eye.zip(target) else { return Ok(()) };
    if eye.distance(target) >= MIN_DISTANCE_M {
        return Ok(());
    }
    let place = if request.target.is_some() { "target" } else { "eye" };
    let message = format!("eye and target must be at least {MIN_DISTANCE_M} m apart");
    Err(Problem::at(ErrorKind::Invalid, vec![Fault::new(place, message)]))
}

/// What a picture shows, as the parameters that would ask for it again.
pub(super) fn shown_view(kind: ViewKind, view: SceneView) -> Vec<(&'static str, Shown)> {
    let eye = ("eye", Shown::Points(vec![view.eye]));
    let target = ("target", Shown::Points(vec![view.target]));
    let fov = ("fov", Shown::Number(view.fov_y_rad.to_degrees()));
    let projection = |name| ("projection", Shown::Word(name));
    let metres = |name, length_m: Option<f64>| (name, Shown::Number(length_m.unwrap_or(0.0)));
    match kind {
        ViewKind::Perspective => vec![eye, target, fov],
        ViewKind::Orthographic { across_m } => {
            vec![projection("orthographic"), eye, target, metres("across", across_m)]
        }
        ViewKind::Map { across_m, heading_rad } => vec![
            projection("map"),
            target,
            metres("across", across_m),
            ("heading", Shown::Number(heading_rad.to_degrees())),
        ],
        ViewKind::Panorama { span_rad } => {
            vec![projection("panorama"), eye, target, fov, ("span", Shown::Number(span_rad.to_degrees()))]
        }
        ViewKind::Stereo { eye_distance_m, convergence_m } => vec![
            projection("stereo"),
            eye,
            target,
            fov,
            ("eye_distance", Shown::Number(eye_distance_m)),
            metres("convergence", convergence_m),
        ],
        ViewKind::Window { corners } => {
            vec![projection("window"), eye, ("window", Shown::Points(corners.to_vec()))]
        }
    }
}

/// The value of a parameter.
pub(super) enum Shown {
    Word(&'static str),
    Number(f64),
    /// Metres.
    Points(Vec<DVec3>),
}

impl std::fmt::Display for Shown {
    /// As a query string has it.
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Word(word) => formatter.write_str(word),
            Self::Number(number) => write!(formatter, "{number}"),
            Self::Points(points) => {
                let point = |p: &DVec3| format!("{},{},{}", p.x, p.y, p.z);
                formatter.write_str(&points.iter().map(point).collect::<Vec<_>>().join(","))
            }
        }
    }
}

fn shown_text(answer: &ViewAnswer) -> String {
    let parameter = |(name, value): (&str, Shown)| format!("{name}={value}");
    shown_view(answer.kind, answer.view).into_iter().map(parameter).collect::<Vec<_>>().join(";")
}

const fn origin(answer: &ViewAnswer) -> &'static str {
    match answer.origin {
        Origin::Drawn => "miss",
        Origin::Shared => "shared",
        Origin::Kept => "hit",
    }
}

fn sources(answer: &ViewAnswer) -> String {
    let source =
        |source: &videofields_service::engine::SourceTime| format!("{}={}", source.camera, source.timestamp);
    answer.sources.iter().map(source).collect::<Vec<_>>().join(",")
}

fn settings(answer: &ViewAnswer) -> String {
    let knob = |(name, value): (&str, String)| format!("{name}={value}");
    answer.settings.knobs().into_iter().map(knob).collect::<Vec<_>>().join(";")
}

/// What was expected of a picture, milliseconds of drawing and codes.
fn expected_text(expected: &Expected) -> String {
    let forecast = &expected.forecast;
    let mut text = format!("ms={:.1};upper_ms={:.1}", forecast.median_ms, forecast.upper_ms);
    if let Some(deadline) = expected.deadline {
        text.push_str(&format!(";encode_ms={:.1}", deadline.reserve.as_secs_f64() * 1e3));
    }
    if let Some(error) = expected.error {
        text.push_str(&format!(";error={error:.2}"));
    }
    text.push_str(&format!(";basis={}", forecast.basis.as_str()));
    text
}

fn running(answer: &ViewAnswer) -> String {
    let running = answer.plan.reasons.iter().filter(|reason| reason.is_on);
    running.map(|reason| reason.effect).collect::<Vec<_>>().join(",")
}
