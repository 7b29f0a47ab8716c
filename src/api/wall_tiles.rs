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
use super::picture::{Encoded, Picture, pictured, split};
use super::query::{Moment, Query};
use super::segments::Segments;
use super::tags::Finish;
use super::view::{self, drawn};
use super::wall_rounds::Turn;
use super::walls::Kept;
use super::{Api, kept, looks, playheads, scenes, schema, screens, walls};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use glam::DVec3;
use serde_json::{Value, json};
use std::convert::Infallible;
use std::time::Duration;
use videofields_service::engine::{At, SceneMoment, ViewKind, ViewRequest};
use videofields_service::wall::{Pattern, Tile, Wall, WallFrame, pattern};
use videofields_vision::access::Right;
use videofields_vision::encode::PictureFormat;
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::frame::CameraId;

/// Longest that a frame is waited for, or two frames of a slow wall.
const MAX_AHEAD: Duration = Duration::from_secs(1);

/// Greatest number of a frame.
const MAX_FRAME: u64 = (1 << 53) - 1;

/// How often a listener hears of a wall on which nothing changes, and how soon of one that changes.
const BEAT: Duration = Duration::from_secs(1);
const LOOK: Duration = Duration::from_millis(200);

/// Least pause between two looks at whether a frame is due: clocks differ by rounding.
const LEAST_LOOK: Duration = Duration::from_millis(1);

/// What a request says beside which tile and which frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wishes {
    /// Which pattern, or none; what all tiles of the wall are to show where nothing is said.
    pattern: Option<Option<Pattern>>,
    edges: Edges,
}

/// How a tile is shown where another overlaps it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Edges {
    #[default]
    Faded,
    Whole,
}

/// The values of `pattern`.
pub(super) const PATTERNS: [(&str, Option<Pattern>); 3] =
    [("none", None), ("test", Some(Pattern::Test)), ("identify", Some(Pattern::Identify))];

/// The values of `blend`.
const EDGES: [(&str, Edges); 2] = [("on", Edges::Faded), ("off", Edges::Whole)];

const AT: &[Parameter] =
    &[Parameter::whole("at", &(0..=MAX_FRAME), "The number of a frame; the one that is due without it")];

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
        .parameters(AT)
        .parameters(Wishes::PARAMETERS)
        .revalidated()
        .may_fail(&[422])
        .answers(
            pictured("The picture")
                .field("Videofields-Wall-Frame", "The number of the frame")
                .field("Videofields-Wall-Version", "The wall's version"),
        );
    let events = Operation::new("follow_wall", "What a wall shows as it changes, and once a second")
        .about("Server-sent events `wall`.")
        .answers(Answer::nothing(200, "Events without end").media(
            "text/event-stream",
            Some(schema::sent(
                &["wall"],
                "The wall, its version, the frame that is due and the pattern, as JSON",
            )),
        ));
    Routes::of(walls::TAG, walls::SEGMENTS)
        .get("/api/v1/walls/{id}/tiles", self::list, list)
        .get("/api/v1/walls/{id}/tiles/{tile}/{picture}", self::picture, picture)
        .get("/api/v1/walls/{id}/events", self::events, events)
}

impl Wishes {
    /// The parameters that say them.
    pub(super) const PARAMETERS: &[Parameter] = &[
        Parameter::word(
            "pattern",
            || words(&PATTERNS),
            "Lines or the tile's name, for setting up; without it what all tiles are told to show (`show_pattern`)",
        ),
        Parameter::word("blend", || words(&EDGES), "Whether edges that overlap another tile's fade out")
            .default_is("on"),
    ];

    /// What `query` says.
    pub(super) fn read(query: &mut Query) -> Self {
        Self {
            pattern: query.choice("pattern", &PATTERNS),
            edges: query.choice("blend", &EDGES).unwrap_or_default(),
        }
    }

    /// The pattern that a tile of that wall shows now.
    fn pattern(self, api: &Api, wall: &str) -> Option<Pattern> {
        self.pattern.unwrap_or_else(|| api.screens.pattern(wall, api.clock.monotonic()))
    }
}

/// Every tile of a wall, with the window in the world that it shows.
pub(super) async fn list(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let Kept { id, version, content: wall, .. } = kept::find(&api, &id)?;
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
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let ((), format) = split(&file, &[("frame", ())])?;
    let mut query = Query::parse(raw.as_deref(), &[AT, Wishes::PARAMETERS].concat());
    let wishes = Wishes::read(&mut query);
    let asked = query.whole("at", &(0..=MAX_FRAME));
    query.finish(Some(()))?;
    let kept = kept::find(&api, &id)?;
    let tile = tile_of(&kept, &name)?;
    let frame = frame_of(&api, &kept, asked).await?;
    if let Some(spared) = spared(&api, &kept, (&tile, &frame), (format, wishes, &headers)).await? {
        return Ok(spared);
    }
    let (picture, _) = shown(&api, &kept, (tile, &frame), (format, wishes)).await?;
    Ok(picture.into_response())
}

/// That the caller has the tile already, if that can be told without drawing it; and of which frame it is.
async fn spared(
    api: &Api,
    kept: &Kept,
    (tile, frame): (&Tile, &WallFrame),
    (format, wishes, headers): (PictureFormat, Wishes, &HeaderMap),
) -> Result<Option<Response>, Problem> {
    if wishes.pattern(api, &kept.id).is_some() {
        return Ok(None);
    }
    let request = request_of(api, &kept.content, (tile, frame), format)?;
    let finish = finish_of(tile, wishes.edges);
    let spared = view::spared(api, &request, (format, moment_of(kept, frame), &finish), headers).await;
    Ok(spared.map(|mut spared| {
        for (name, value) in numbers(kept, frame) {
            if let Ok(value) = HeaderValue::try_from(value) {
                spared.headers_mut().insert(name, value);
            }
        }
        spared
    }))
}

/// Which frame of which version a tile is of.
fn numbers(kept: &Kept, frame: &WallFrame) -> [(&'static str, String); 2] {
    [("videofields-wall-frame", frame.id.to_string()), ("videofields-wall-version", kept.version.to_string())]
}

fn moment_of(kept: &Kept, frame: &WallFrame) -> Moment {
    let at = if kept.content.playhead.is_some() { At::Time(frame.instant) } else { At::Live };
    Moment { at, is_fixed: false }
}

/// A tile's picture in a stream of them.
pub(super) struct Streamed {
    /// The number of its frame.
    pub(super) frame: u64,
    /// The wall's version.
    pub(super) version: i64,
    pub(super) rate_hz: f64,
    /// Whether the wall shows what is now.
    pub(super) is_live: bool,
    /// Whether it is no picture of the scene.
    pub(super) is_pattern: bool,
    pub(super) picture: Picture,
}

/// A tile's picture of the first frame after `last`, which streams of the wall's other tiles show too; of the one that is due
/// where there was none.
pub(super) async fn after(
    api: &Api,
    (id, name): (&str, &str),
    (format, wishes): (PictureFormat, Wishes),
    last: Option<u64>,
) -> Result<Streamed, Problem> {
    let kept = kept::find(api, id)?;
    let tile = tile_of(&kept, name)?;
    let rate_hz = kept.content.rate_hz;
    let mut wait =
        last.map_or(Duration::ZERO, |last| api.frames.due_in(last + 1, rate_hz, api.clock.monotonic()));
    // Another rate numbers frames otherwise: then what is due is shown.
    let last = last.filter(|_| wait.as_secs_f64() <= 1.0 / rate_hz);
    wait = if last.is_some() { wait } else { Duration::ZERO };
    tokio::time::sleep(wait).await;
    let turn = turn(api, &kept, last).await?;
    let (picture, is_pattern) = shown(api, &kept, (tile, &turn.frame), (format, wishes)).await?;
    let (frame, version, is_live) = (turn.frame.id, kept.version, kept.content.playhead.is_none());
    Ok(Streamed { frame, version, rate_hz, is_live, is_pattern, picture })
}

/// A turn in a frame of the wall that is newer than `last`.
async fn turn(api: &Api, kept: &Kept, last: Option<u64>) -> Result<Turn, Problem> {
    loop {
        let ended = api.rounds.ended();
        let (due, cameras) = due(api, kept)?;
        let key = (kept.id.clone(), kept.version, cameras);
        if let Some(turn) = api.rounds.enter(&key, last, &due) {
            return Ok(turn);
        }
        let wait = match last {
            // It is the one before that is still drawn.
            Some(last) if due.id <= last => {
                api.frames.due_in(last + 1, kept.content.rate_hz, api.clock.monotonic()).max(LEAST_LOOK)
            }
            _ => LOOK,
        };
        tokio::select! {
            () = ended => {}
            () = tokio::time::sleep(wait) => {}
        }
    }
}

pub(super) fn tile_of(kept: &Kept, name: &str) -> Result<Tile, Problem> {
    kept.content.tile(name).cloned().ok_or_else(|| {
        let names: Vec<&str> = kept.content.tiles.iter().map(|tile| tile.id.as_str()).collect();
        Problem::missing("tile", name, &names)
    })
}

/// A tile's picture, and whether it is a pattern's.
async fn shown(
    api: &Api,
    kept: &Kept,
    (tile, frame): (Tile, &WallFrame),
    (format, wishes): (PictureFormat, Wishes),
) -> Result<(Picture, bool), Problem> {
    let moment = moment_of(kept, frame);
    let pattern = wishes.pattern(api, &kept.id);
    let mut picture = match pattern {
        Some(which) => patterned(api, kept, (tile, which), (format, moment, frame.instant)).await?,
        None => {
            let request = request_of(api, &kept.content, (&tile, frame), format)?;
            drawn(api, request, (format, moment), finish_of(&tile, wishes.edges)).await?
        }
    };
    picture.fields.extend(numbers(kept, frame));
    Ok((picture, pattern.is_some()))
}

/// What a tile shows, as any view is asked for.
fn request_of(
    api: &Api,
    wall: &Wall,
    (tile, frame): (&Tile, &WallFrame),
    format: PictureFormat,
) -> Result<ViewRequest, Problem> {
    let asked = view::read_view_request(&wall.scene, &wall.parameters);
    let asked = asked.map_err(|faults| Problem::at(ErrorKind::Invalid, faults))?;
    let corners: [DVec3; 3] = wall.window(tile.corners_m);
    let mut request = ViewRequest {
        kind: ViewKind::Window { corners },
        eye: Some(wall.eye_m),
        width_px: tile.size_px[0],
        height_px: tile.size_px[1],
        at: At::Time(frame.instant),
        horizon: Some(frame.horizon.clone()),
        ..asked
    };
    view::reserve(api, &mut request, format);
    Ok(request)
}

fn finish_of(tile: &Tile, edges: Edges) -> Finish {
    if edges == Edges::Whole || tile.blend_px == [0; 4] {
        return Finish::None;
    }
    Finish::Faded(Box::new(tile.clone()))
}

async fn patterned(
    api: &Api,
    kept: &Kept,
    (tile, which): (Tile, Pattern),
    (format, moment, instant): (PictureFormat, Moment, videofields_vision::clock::Timestamp),
) -> Result<Picture, Problem> {
    let wall = kept.content.clone();
    let size_px = tile.size_px;
    let write = move || super::picture::write_rgb(format, &pattern(&wall, &tile, which));
    let Encoded { bytes, tag, .. } = api.encoded(size_px, write).await?;
    Ok(Picture { format, bytes, tag, moment, instant, fields: Vec::new() })
}

/// The frame that is asked for, or the one that is due.
async fn frame_of(api: &Api, kept: &Kept, asked: Option<u64>) -> Result<WallFrame, Problem> {
    let rate_hz = kept.content.rate_hz;
    if let Some(id) = asked {
        let wait = api.frames.due_in(id, rate_hz, api.clock.monotonic());
        let most = Duration::try_from_secs_f64(2.0 / rate_hz).unwrap_or(MAX_AHEAD).max(MAX_AHEAD);
        if wait > most {
            let message = format!("frame {id} is due in {wait:.1?}; at most {most:?} are waited for");
            return Err(Problem::at(ErrorKind::Invalid, vec![Fault::new("at", message)]));
        }
        tokio::time::sleep(wait).await;
    }
    let (due, cameras) = due(api, kept)?;
    let now = api.clock.monotonic();
    let kept_frame = |asked| api.frames.frame((&kept.id, kept.version, &cameras), asked, rate_hz, now);
    Ok(asked.and_then(kept_frame).unwrap_or(due))
}

/// Returns which time a wall shows; a look at the past is noted as one.
pub(super) fn time_of(api: &Api, wall: &Wall) -> Result<At, Problem> {
    let Some(playhead) = &wall.playhead else { return Ok(At::Live) };
    let instant = api.door.playhead_at(playhead).map_err(|error| playheads::problem_of(api, error))?;
    looks::at(instant);
    Ok(At::Time(instant))
}

/// The frame of a wall that is due, and the cameras that it hangs on: those that are shown, and those that a playhead's place
/// follows from.
fn due(api: &Api, kept: &Kept) -> Result<(WallFrame, Vec<CameraId>), Problem> {
    let wall = &kept.content;
    let at = time_of(api, wall)?;
    let followed = match &wall.playhead {
        Some(playhead) => {
            let found = api.door.playhead(playhead).map_err(|error| playheads::problem_of(api, error))?;
            Some(scenes::find(api, &found.scene)?)
        }
        None => None,
    };
    let moment = api.door.moment(&wall.scene, at).map_err(|error| scenes::problem_of(api, error))?;
    let SceneMoment { instant, mut cameras, horizon } = moment;
    let followed = followed.iter().flat_map(|scene| scene.cameras.iter().map(|member| member.id.clone()));
    cameras.extend(followed);
    let (now, shown) = (api.clock.monotonic(), (instant, horizon));
    let frame = api.frames.due((&kept.id, kept.version, cameras.clone()), wall.rate_hz, now, shown);
    Ok((frame, cameras))
}

/// What a wall shows: whenever it is changed, and once a second, as server-sent events; ends when it is removed.
pub(super) async fn events(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    kept::find::<Wall>(&api, &id)?;
    let connection = api.connection.clone();
    let states = futures_util::stream::unfold(Following { api, id, told: None }, Following::next);
    let stream = Sse::new(connection.carry(states)).keep_alive(KeepAlive::default());
    Ok(([(header::CACHE_CONTROL, "no-store")], stream).into_response())
}

/// One listener of one wall. It holds nothing of what was: a slow one is told the newest state when it reads on.
struct Following {
    api: Api,
    id: String,
    /// The version and the pattern that were told last, and when.
    told: Option<(i64, Option<Pattern>, Duration)>,
}

impl Following {
    async fn next(mut self) -> Option<(Result<Event, Infallible>, Self)> {
        loop {
            // Who may no longer see it hears no more of it.
            self.api = self.api.renewed()?;
            let kept = kept::find(&self.api, &self.id).ok()?;
            let now = self.api.clock.monotonic();
            let pattern = self.api.screens.pattern(&kept.id, now);
            let is_old = |(version, shown, at): (i64, Option<Pattern>, Duration)| {
                (version, shown) != (kept.version, pattern) || now.saturating_sub(at) >= BEAT
            };
            if self.told.is_none_or(is_old) {
                self.told = Some((kept.version, pattern, now));
                let event = Event::default().event("wall").json_data(self.state(&kept, pattern)).ok()?;
                return Some((Ok(event), self));
            }
            tokio::time::sleep(LOOK).await;
        }
    }

    fn state(&self, kept: &Kept, pattern: Option<Pattern>) -> Value {
        // A scene of which nothing is to be seen yet has no frames.
        let due = due(&self.api, kept).ok().map(|(frame, _)| frame);
        json!({
            "wall": kept.id,
            "version": kept.version,
            "rate_hz": kept.content.rate_hz,
            "frame": due.as_ref().map(|frame| frame.id),
            "time": due.as_ref().map(|frame| frame.instant.to_string()),
            "pattern": screens::word_of(pattern),
        })
    }
}
