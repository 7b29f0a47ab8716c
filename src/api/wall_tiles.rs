//! `/api/v1/walls/{id}/tiles`: what every screen of a wall shows, all of them at one instant.
//!
//! A frame of a wall is an instant with a number. Whoever asks for a tile without `at` gets the frame that is due; who names
//! one that is to come waits for it, who names one that is long over gets the one that is due. So a tile of another frame than
//! its neighbours' never passes for one of theirs: every answer names its frame.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter, words};
use super::picture::{Picture, pictured, split};
use super::query::{Moment, Query};
use super::schema;
use super::segments::Segments;
use super::view::{self, drawn};
use super::walls::{self, Kept};
use super::{Api, playheads, scenes};
use crate::access::Right;
use crate::clock::Timestamp;
use crate::encode::PictureFormat;
use crate::engine::{At, ViewKind, ViewRequest};
use crate::error::{ErrorKind, Fault};
use crate::frame::{CameraId, RgbImage};
use crate::wall::{Pattern, Tile, WallFrame, blend, pattern};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use glam::DVec3;
use serde_json::{Value, json};
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

/// Longest that a frame is waited for, or two frames of a slow wall.
const MAX_AHEAD: Duration = Duration::from_secs(1);

/// Greatest number of a frame.
const MAX_FRAME: u64 = (1 << 53) - 1;

/// How often a listener hears of a wall on which nothing changes, and how soon of one that changes.
const BEAT: Duration = Duration::from_secs(1);
const LOOK: Duration = Duration::from_millis(200);

/// What a request says beside which tile.
struct Wishes {
    frame: Option<u64>,
    pattern: Option<Pattern>,
    edges: Edges,
}

/// How a tile is shown where another overlaps it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Edges {
    #[default]
    Faded,
    Whole,
}

/// The values of `blend`.
pub(super) const EDGES: [(&str, Edges); 2] = [("on", Edges::Faded), ("off", Edges::Whole)];

const PATTERNS: [(&str, Option<Pattern>); 3] =
    [("none", None), ("test", Some(Pattern::Test)), ("identify", Some(Pattern::Identify))];

/// How overlapping edges are shown.
pub(super) const BLEND: &[Parameter] =
    &[Parameter::word("blend", || words(&EDGES), "Whether edges that overlap another tile's fade out")
        .default_is("on")];

const PARAMETERS: &[Parameter] = &[
    Parameter::whole("at", &(0..=MAX_FRAME), "The number of a frame; the one that is due without it"),
    Parameter::word("pattern", || words(&PATTERNS), "Lines or the tile's name, for setting up")
        .default_is("none"),
];

/// Routes about what screens show.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_tiles", "Every tile of a wall, with its window into the world")
        .answers(Answer::json(200, "The tiles", schema::walls::tiles()));
    let picture = Operation::new("show_tile", "What a tile of a wall shows")
        .about(
            "Two tiles with the same `Videofields-Wall-Frame` and `Videofields-Wall-Version` show the same instant. A frame \
             that is due within a second is waited for.",
        )
        .right(Right::Live)
        .parameters(PARAMETERS)
        .parameters(BLEND)
        .may_fail(&[422])
        .answers(
            pictured("The picture")
                .field("Videofields-Wall-Frame", "The number of the frame")
                .field("Videofields-Wall-Version", "The wall's version"),
        );
    let events = Operation::new("follow_wall", "What a wall shows as it changes, and once a second")
        .about("Server-sent events `wall`.")
        .answers(Answer::nothing(200, "Events without end").media("text/event-stream", Some(schema::text())));
    Routes::of(walls::TAG, walls::SEGMENTS)
        .get("/api/v1/walls/{id}/tiles", self::list, list)
        .get("/api/v1/walls/{id}/tiles/{tile}/{picture}", self::picture, picture)
        .get("/api/v1/walls/{id}/events", self::events, events)
}

fn read(raw: Option<&str>) -> Result<Wishes, Problem> {
    let mut query = Query::parse(raw, &[PARAMETERS, BLEND].concat());
    let wishes = Wishes {
        frame: query.whole("at", &(0..=MAX_FRAME)),
        pattern: query.choice("pattern", &PATTERNS).unwrap_or_default(),
        edges: query.choice("blend", &EDGES).unwrap_or_default(),
    };
    query.finish(Some(wishes))
}

/// Every tile of a wall, with the window in the world that it shows.
pub(super) async fn list(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let Kept { id, version, wall, .. } = walls::find(&api, &id)?;
    let tile = |tile: &Tile| {
        json!({
            "id": tile.id,
            "size_px": tile.size_px,
            "blend_px": tile.blend_px,
            "window_m": wall.window(tile.corners_m).map(|corner| corner.to_array()),
        })
    };
    let body = json!({
        "wall": id,
        "version": version,
        "rate_hz": wall.rate_hz,
        "eye_m": wall.eye_m.to_array(),
        "tiles": wall.tiles.iter().map(tile).collect::<Vec<Value>>(),
    });
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(body)).into_response())
}

/// A tile's picture.
pub(super) async fn picture(
    Asked(api): Asked,
    Segments((id, name, file)): Segments<(String, String, String)>,
    RawQuery(raw): RawQuery,
) -> Result<Picture, Problem> {
    let ((), format) = split(&file, &[("frame", ())])?;
    let wishes = read(raw.as_deref())?;
    let kept = walls::find(&api, &id)?;
    let tile = tile_of(&kept, &name)?;
    let frame = frame_of(&api, &kept, wishes.frame).await?;
    shown(&api, &kept, (tile, frame), (format, wishes)).await
}

/// A tile's picture of the first frame after `last`, with its number; of the one that is due where there was none.
pub(super) async fn after(
    api: &Api,
    (id, name): (&str, &str),
    edges: Edges,
    last: Option<u64>,
) -> Result<(u64, Picture), Problem> {
    let kept = walls::find(api, id)?;
    let tile = tile_of(&kept, name)?;
    if let Some(last) = last {
        let wait = api.frames.due_in(last + 1, kept.wall.rate_hz, api.clock.monotonic());
        // Another rate numbers frames otherwise: then what is due is shown.
        if wait.as_secs_f64() <= 1.0 / kept.wall.rate_hz {
            tokio::time::sleep(wait).await;
        }
    }
    let frame = frame_of(api, &kept, None).await?;
    let wishes = Wishes { frame: None, pattern: None, edges };
    let picture = shown(api, &kept, (tile, frame), (PictureFormat::Jpeg, wishes)).await?;
    Ok((frame.id, picture))
}

fn tile_of(kept: &Kept, name: &str) -> Result<Tile, Problem> {
    kept.wall.tile(name).cloned().ok_or_else(|| {
        let names: Vec<&str> = kept.wall.tiles.iter().map(|tile| tile.id.as_str()).collect();
        Problem::missing("tile", name, &names)
    })
}

async fn shown(
    api: &Api,
    kept: &Kept,
    (tile, frame): (Tile, WallFrame),
    (format, wishes): (PictureFormat, Wishes),
) -> Result<Picture, Problem> {
    let at = if kept.wall.playhead.is_some() { At::Time(frame.instant) } else { At::Live };
    let moment = Moment { at, is_fixed: false };
    let mut picture = match wishes.pattern {
        Some(which) => patterned(api, kept, (tile, which), (format, moment, frame.instant)).await?,
        None => {
            let request = request_of(api, kept, &tile, (format, frame.instant))?;
            drawn(api, request, (format, moment), move |image| finished(image, &tile, wishes.edges)).await?
        }
    };
    picture.fields.push(("videofields-wall-frame", frame.id.to_string()));
    picture.fields.push(("videofields-wall-version", kept.version.to_string()));
    Ok(picture)
}

/// What a tile shows, as any view is asked for.
fn request_of(
    api: &Api,
    Kept { wall, .. }: &Kept,
    tile: &Tile,
    (format, instant): (PictureFormat, Timestamp),
) -> Result<ViewRequest, Problem> {
    let asked = view::read_view_request(&wall.scene, &wall.parameters);
    let asked = asked.map_err(|faults| Problem::at(ErrorKind::Invalid, faults))?;
    let corners: [DVec3; 3] = wall.window(tile.corners_m);
    let mut request = ViewRequest {
        kind: ViewKind::Window { corners },
        eye: Some(wall.eye_m),
        width_px: tile.size_px[0],
        height_px: tile.size_px[1],
        at: At::Time(instant),
        ..asked
    };
    view::reserve(api, &mut request, format);
    Ok(request)
}

fn finished(image: Arc<RgbImage>, tile: &Tile, edges: Edges) -> Arc<RgbImage> {
    if edges == Edges::Whole || tile.blend_px == [0; 4] {
        return image;
    }
    let mut faded = RgbImage::clone(&image);
    blend(tile, &mut faded);
    Arc::new(faded)
}

async fn patterned(
    api: &Api,
    kept: &Kept,
    (tile, which): (Tile, Pattern),
    (format, moment, instant): (PictureFormat, Moment, Timestamp),
) -> Result<Picture, Problem> {
    let wall = kept.wall.clone();
    let write = move || super::picture::write_rgb(format, &pattern(&wall, &tile, which));
    let (bytes, _took) = api.encoded(write).await?;
    Ok(Picture { format, bytes, moment, instant, fields: Vec::new() })
}

/// The frame that is asked for, or the one that is due.
async fn frame_of(api: &Api, kept: &Kept, asked: Option<u64>) -> Result<WallFrame, Problem> {
    let rate_hz = kept.wall.rate_hz;
    if let Some(id) = asked {
        let wait = api.frames.due_in(id, rate_hz, api.clock.monotonic());
        let most = Duration::try_from_secs_f64(2.0 / rate_hz).unwrap_or(MAX_AHEAD).max(MAX_AHEAD);
        if wait > most {
            let message = format!("frame {id} is due in {wait:.1?}; at most {most:?} are waited for");
            return Err(Problem::at(ErrorKind::Invalid, vec![Fault::new("at", message)]));
        }
        tokio::time::sleep(wait).await;
    }
    let (instant, cameras) = now_shown(api, kept)?;
    let now = api.clock.monotonic();
    let kept_frame = |asked| api.frames.frame((&kept.id, kept.version, &cameras), asked, rate_hz, now);
    if let Some(frame) = asked.and_then(kept_frame) {
        return Ok(frame);
    }
    Ok(api.frames.due((&kept.id, kept.version, cameras), rate_hz, now, instant))
}

/// What the wall would show if it were asked now, and the cameras that this hangs on: those that are shown, and those that a
/// playhead's place follows from.
fn now_shown(api: &Api, kept: &Kept) -> Result<(Timestamp, Vec<CameraId>), Problem> {
    let of_playhead = |error| playheads::problem_of(api, error);
    let (at, followed) = match &kept.wall.playhead {
        Some(playhead) => {
            let at = At::Time(api.door.playhead_at(playhead).map_err(of_playhead)?);
            let scene = api.door.playhead(playhead).map_err(of_playhead)?.scene;
            (at, Some(scenes::find(api, &scene)?))
        }
        None => (At::Live, None),
    };
    let moment = api.door.moment(&kept.wall.scene, at);
    let (instant, mut cameras) = moment.map_err(|error| scenes::problem_of(api, error))?;
    let followed = followed.iter().flat_map(|scene| scene.cameras.iter().map(|member| member.id.clone()));
    cameras.extend(followed);
    Ok((instant, cameras))
}

/// What a wall shows: whenever it is changed, and once a second, as server-sent events; ends when it is removed.
pub(super) async fn events(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    walls::find(&api, &id)?;
    let states = futures_util::stream::unfold(Following { api, id, told: None }, Following::next);
    let stream = Sse::new(states).keep_alive(KeepAlive::default());
    Ok(([(header::CACHE_CONTROL, "no-store")], stream).into_response())
}

/// One listener of one wall. It holds nothing of what was: a slow one is told the newest state when it reads on.
struct Following {
    api: Api,
    id: String,
    /// The version that was told last, and when.
    told: Option<(i64, Duration)>,
}

impl Following {
    async fn next(mut self) -> Option<(Result<Event, Infallible>, Self)> {
        loop {
            // Who may no longer see it hears no more of it.
            self.api = self.api.renewed()?;
            let kept = walls::find(&self.api, &self.id).ok()?;
            let now = self.api.clock.monotonic();
            let is_old =
                |(version, at): (i64, Duration)| version != kept.version || now.saturating_sub(at) >= BEAT;
            if self.told.is_none_or(is_old) {
                self.told = Some((kept.version, now));
                let event = Event::default().event("wall").json_data(self.state(&kept)).ok()?;
                return Some((Ok(event), self));
            }
            tokio::time::sleep(LOOK).await;
        }
    }

    fn state(&self, kept: &Kept) -> Value {
        let due = now_shown(&self.api, kept).map(|(instant, cameras)| {
            let now = self.api.clock.monotonic();
            self.api.frames.due((&kept.id, kept.version, cameras), kept.wall.rate_hz, now, instant)
        });
        // A scene of which nothing is to be seen yet has no frames.
        let due = due.ok();
        json!({
            "wall": kept.id,
            "version": kept.version,
            "rate_hz": kept.wall.rate_hz,
            "frame": due.map(|frame| frame.id),
            "time": due.map(|frame| frame.instant.to_string()),
        })
    }
}
