//! `/api/v1/walls/{id}/screens` and `.../pattern`: who shows a wall's tiles by WebSocket and how they fare, and a pattern that all
//! of them show for a while.
//!
//! Nothing of it is kept: a screen is there as long as its conversation is, and a pattern ends by itself, so that none that was
//! forgotten stays on a wall.

use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::kept;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::segments::Segments;
use super::tune::{read_body, refuse_foreign};
use super::wall_tiles::PATTERNS;
use super::{schema, walls};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use videofields_service::wall::{Pattern, Wall};
use videofields_vision::access::Role;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{ErrorKind, Fault, Gatherer};

/// How long a pattern stays where nothing is said, and at most.
const PATTERN_SECS: RangeInclusive<u64> = 1..=3600;
const DEFAULT_PATTERN_SECS: u64 = 60;

/// Routes about the screens of walls.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_screens", "Who shows a wall's tiles by WebSocket, and how they fare")
        .answers(Answer::json(200, "The screens", schema::walls::screens()));
    let shown = || Answer::json(200, "What then is shown", schema::named("WallPattern"));
    let put = Operation::new("show_pattern", "Has all tiles of a wall show a pattern for a while")
        .about("Wherever a tile is asked for without `pattern`. `none` ends it at once; a restart of the daemon does too.")
        .role(Role::Operator)
        .takes(schema::walls::pattern_asked())
        .answers(shown());
    Routes::of(walls::TAG, walls::SEGMENTS).get("/api/v1/walls/{id}/screens", self::list, list).put(
        "/api/v1/walls/{id}/pattern",
        self::put,
        put,
    )
}

/// What a screen says of itself.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Health {
    /// Number of the frame that it shows.
    frame: Option<u64>,
    /// How long it has shown that.
    age_secs: Option<f64>,
    /// Frames a second over the last seconds.
    rate_hz: f64,
    /// Frames that it passed over, showed too late, or could not read.
    missed: u64,
    late: u64,
    unreadable: u64,
    /// Conversations before this one.
    reconnects: u64,
    /// Its clock before the daemon's, with the way between.
    clock_offset_secs: Option<f64>,
}

/// A conversation that shows a tile.
#[derive(Debug)]
struct Screen {
    wall: String,
    tile: String,
    since: Timestamp,
    /// The last frame that it acknowledged.
    frame: Option<u64>,
    /// When that was, or its beginning; by the monotonic clock.
    heard: Duration,
    health: Option<Health>,
}

#[derive(Debug, Default)]
struct Board {
    n_ever: u64,
    screens: BTreeMap<u64, Screen>,
    /// By wall, until when by the monotonic clock.
    patterns: BTreeMap<String, (Pattern, Duration)>,
}

/// The screens of all walls; as many at most as there are streams at once.
#[derive(Debug, Default)]
pub(super) struct Screens {
    board: Mutex<Board>,
}

/// A screen's place among them; it has gone once this is dropped.
#[derive(Debug)]
pub(super) struct Place {
    screens: Arc<Screens>,
    id: u64,
}

impl Screens {
    /// Notes a screen that shows a tile from now on.
    pub(super) fn enter(
        self: &Arc<Self>,
        (wall, tile): (&str, &str),
        (now, monotonic): (Timestamp, Duration),
    ) -> Place {
        let mut board = self.lock();
        board.n_ever += 1;
        let id = board.n_ever;
        let (wall, tile) = (wall.to_owned(), tile.to_owned());
        let screen = Screen { wall, tile, since: now, frame: None, heard: monotonic, health: None };
        board.screens.insert(id, screen);
        Place { screens: Arc::clone(self), id }
    }

    /// What all tiles of a wall are to show in the place of their pictures.
    pub(super) fn pattern(&self, wall: &str, monotonic: Duration) -> Option<Pattern> {
        self.lock().pattern(wall, monotonic).map(|(pattern, _)| pattern)
    }

    fn show(&self, wall: &str, pattern: Option<(Pattern, Duration)>) {
        let mut board = self.lock();
        match pattern {
            Some(pattern) => board.patterns.insert(wall.to_owned(), pattern),
            None => board.patterns.remove(wall),
        };
    }

    fn lock(&self) -> MutexGuard<'_, Board> {
        // Each change is one step: a panic leaves none by half.
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Board {
    fn pattern(&mut self, wall: &str, monotonic: Duration) -> Option<(Pattern, Duration)> {
        self.patterns.retain(|_, (_, until)| *until > monotonic);
        self.patterns.get(wall).copied()
    }
}

impl Place {
    /// The screen has taken a frame.
    pub(super) fn has(&self, frame: u64, monotonic: Duration) {
        self.change(|screen| (screen.frame, screen.heard) = (Some(frame), monotonic));
    }

    /// The screen says how it fares.
    pub(super) fn tells(&self, health: Health) {
        self.change(|screen| screen.health = Some(health));
    }

    fn change(&self, change: impl FnOnce(&mut Screen)) {
        if let Some(screen) = self.screens.lock().screens.get_mut(&self.id) {
            change(screen);
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.screens.lock().screens.remove(&self.id);
    }
}

/// Who shows a wall's tiles.
async fn list(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let wall = kept::find::<Wall>(&api, &id)?;
    let now = api.clock.monotonic();
    let mut board = api.screens.lock();
    let pattern = board.pattern(&wall.id, now);
    let mut shown: Vec<&Screen> = board.screens.values().filter(|screen| screen.wall == wall.id).collect();
    shown.sort_by(|one, other| one.tile.cmp(&other.tile));
    let screens = shown.into_iter().map(|screen| {
        json!({
            "tile": screen.tile,
            "since": screen.since.to_string(),
            "frame": screen.frame,
            "heard_secs": now.saturating_sub(screen.heard).as_secs_f64(),
            "health": screen.health,
        })
    });
    let body = json!({
        "wall": wall.id,
        "pattern": told(pattern, now),
        "screens": screens.collect::<Vec<Value>>(),
    });
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(body)).into_response())
}

fn told(pattern: Option<(Pattern, Duration)>, now: Duration) -> Value {
    json!({
        "shows": word_of(pattern.map(|(pattern, _)| pattern)),
        "seconds_left": pattern.map(|(_, until)| until.saturating_sub(now).as_secs_f64()),
    })
}

/// What a pattern is called.
pub(super) fn word_of(pattern: Option<Pattern>) -> &'static str {
    PATTERNS.iter().find(|(_, known)| *known == pattern).map_or("none", |(word, _)| word)
}

/// What is asked of all tiles.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Asking {
    shows: String,
    #[serde(default)]
    seconds: Option<u64>,
}

/// Has all tiles show a pattern, or their pictures again.
async fn put(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    if api.identity.caller.grants.role() == Role::Viewer {
        return Err(Problem::new(ErrorKind::Forbidden, "what walls show is for operators and admins"));
    }
    let wall = kept::find::<Wall>(&api, &id)?;
    let (pattern, lasts) = read(read_body(&body)?)?;
    let now = api.clock.monotonic();
    let pattern = pattern.map(|pattern| (pattern, now.saturating_add(lasts)));
    api.screens.show(&wall.id, pattern);
    tracing::info!(wall = wall.id, pattern = ?pattern, by = ?api.identity.caller.user, "what the wall's tiles show");
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(told(pattern, now))).into_response())
}

fn read(document: Value) -> Result<(Option<Pattern>, Duration), Problem> {
    let mut gatherer = Gatherer::default();
    let asked = gatherer.read::<Asking>(document, "");
    let mut faults = gatherer.into_faults();
    let Some(Asking { shows, seconds }) = asked else { return Err(Problem::at(ErrorKind::Invalid, faults)) };
    let known = PATTERNS.iter().find(|(word, _)| *word == shows);
    if known.is_none() {
        let words: Vec<&str> = PATTERNS.iter().map(|(word, _)| *word).collect();
        faults.push(Fault::new("/shows", format!("is one of {}", words.join(", "))));
    }
    let seconds = seconds.unwrap_or(DEFAULT_PATTERN_SECS);
    if !PATTERN_SECS.contains(&seconds) {
        let message =
            format!("is {seconds}, but {} to {} are possible", PATTERN_SECS.start(), PATTERN_SECS.end());
        faults.push(Fault::new("/seconds", message));
    }
    match known {
        Some((_, pattern)) if faults.is_empty() => Ok((*pattern, Duration::from_secs(seconds))),
        _ => Err(Problem::at(ErrorKind::Invalid, faults)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_screen_is_there_as_long_as_its_conversation_and_a_pattern_for_its_time() {
        let screens = Arc::new(Screens::default());
        let at = |secs| (Timestamp::from_nanos(0), Duration::from_secs(secs));
        let place = screens.enter(("control", "a1"), at(5));
        place.has(17, Duration::from_secs(6));
        let seen = |screens: &Screens| {
            screens
                .lock()
                .screens
                .values()
                .map(|screen| (screen.tile.clone(), screen.frame))
                .collect::<Vec<_>>()
        };
        assert_eq!(seen(&screens), [("a1".to_owned(), Some(17))]);
        screens.show("control", Some((Pattern::Identify, Duration::from_secs(20))));
        assert_eq!(screens.pattern("control", Duration::from_secs(19)), Some(Pattern::Identify));
        assert_eq!(screens.pattern("lobby", Duration::from_secs(19)), None);
        assert_eq!(screens.pattern("control", Duration::from_secs(20)), None, "its time is over");
        assert!(screens.lock().patterns.is_empty(), "and nothing is left of it");
        drop(place);
        assert!(seen(&screens).is_empty());
    }

    #[test]
    fn what_is_wrong_with_a_pattern_is_told_at_its_place() {
        let good = read(json!({"shows": "test", "seconds": 5})).unwrap();
        assert_eq!(good, (Some(Pattern::Test), Duration::from_secs(5)));
        assert_eq!(read(json!({"shows": "none"})).unwrap().0, None);
        for wrong in [
            json!({}),
            json!({"shows": "bars"}),
            json!({"shows": "test", "seconds": 0}),
            json!({"shows": "test", "seconds": 5000}),
            json!({"shows": "test", "seconds": 1.5}),
            json!({"shows": "test", "for": 3}),
            json!([]),
        ] {
            assert!(read(wrong.clone()).is_err(), "{wrong}");
        }
    }
}
