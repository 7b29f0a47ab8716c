//! `/api/v1/scenes/{id}/tracks/stream`: who is before a scene's cameras, again and again, as server-sent events.

use super::Api;
use super::error::Problem;
use super::event_stream::HEARTBEAT;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::Parameter;
use super::query::Query;
use super::scenes::problem_of;
use super::segments::Segments;
use super::shares::Place;
use super::{events, scenes, schema};
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use serde_json::{Value, json};
use std::convert::Infallible;
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{Interval, MissedTickBehavior};
use videofields_service::engine::{EngineError, Present, PresentEntity};
use videofields_vision::access::Right;
use videofields_vision::error::ErrorKind;

/// Events a second.
const RATE_HZ: RangeInclusive<f64> = 0.1..=10.0;
const DEFAULT_RATE_HZ: f64 = 2.0;

const RATE: &[Parameter] = &[Parameter::number("rate", &RATE_HZ, "Most events a second").default_is("2")];

/// Routes about who is there.
pub(super) fn routes() -> Routes {
    let stream =
        Operation::new("follow_tracks", "Who is before a scene's cameras, again and again")
            .about("Server-sent events `tracks`, with the place of each in the world.")
            .right(Right::Live)
            .parameters(RATE)
            .answers(Answer::nothing(200, "Events without end").media(
                "text/event-stream",
                Some(schema::sent(&["tracks"], "Who is there and where, as JSON")),
            ));
    Routes::of(events::TAG, scenes::SEGMENTS).get("/api/v1/scenes/{id}/tracks/stream", self::stream, stream)
}

/// By so much time is set back at least where it belongs to another clock.
const SET_BACK_NANOS: i64 = 10_000_000_000;

/// Who is there now, whenever that is of another instant, at most `rate` times a second.
pub(super) async fn stream(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), RATE);
    let rate_hz = query.number("rate", &RATE_HZ, " events a second").unwrap_or(DEFAULT_RATE_HZ);
    let rate_hz = query.finish(Some(rate_hz))?;
    let permit = api.stream_place()?;
    // What is wrong is told before it begins; that nothing was seen yet passes.
    match present(&api, &id).await {
        Ok(_) => {}
        Err(error) if error.kind() == ErrorKind::Unavailable => {}
        Err(error) => return Err(problem_of(&api, error)),
    }
    let mut ticks = tokio::time::interval(Duration::try_from_secs_f64(1.0 / rate_hz).unwrap_or(HEARTBEAT));
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let connection = api.connection.clone();
    let following = Following { api, id, ticks, told: None, _permit: permit };
    let events = connection.carry(stream::unfold(following, Following::next));
    let body = Sse::new(events).keep_alive(KeepAlive::new().interval(HEARTBEAT));
    Ok(([(header::CACHE_CONTROL, "no-store")], body).into_response())
}

async fn present(api: &Api, id: &str) -> Result<Arc<Present>, EngineError> {
    let id = id.to_owned();
    api.ask("looking who is there", move |door| door.present(&id)).await
}

/// One listener. It holds nothing of what was: a slow one is told the newest when it reads on.
struct Following {
    api: Api,
    id: String,
    ticks: Interval,
    told: Option<Arc<Present>>,
    _permit: Place<String>,
}

impl Following {
    async fn next(mut self) -> Option<(Result<Event, Infallible>, Self)> {
        loop {
            self.ticks.tick().await;
            // Who may no longer see it hears no more of it.
            self.api = self.api.renewed()?;
            let present = match present(&self.api, &self.id).await {
                Ok(present) => present,
                Err(error) if error.kind() == ErrorKind::Unavailable => continue,
                Err(_) => return None,
            };
            if self.told.as_ref().is_some_and(|told| !is_news(told, &present)) {
                continue;
            }
            let event = Event::default()
                .id(present.instant.as_nanos().to_string())
                .event("tracks")
                .json_data(document(&self.id, &present))
                .ok()?;
            self.told = Some(present);
            return Some((Ok(event), self));
        }
    }
}

/// Whether something is of a later instant than what was told, or time was set back.
fn is_news(told: &Present, present: &Present) -> bool {
    let nanos = present.instant.nanos_since(told.instant);
    // A camera that lagged and has caught up takes "now" back a little: by as much nobody is told anew of the same.
    !(-SET_BACK_NANOS..=0).contains(&nanos)
}

fn document(scene: &str, present: &Present) -> Value {
    let millimetres = |metres: f64| (metres * 1e3).round() / 1e3;
    let track = |entity: &PresentEntity| {
        json!({
            "id": entity.id,
            "position_m": entity.foot_in_world.to_array().map(millimetres),
            "height_m": millimetres(entity.height_m),
            "cameras": entity.seen_by,
        })
    };
    json!({
        "scene": scene,
        "time": present.instant.to_string(),
        "tracks": present.entities.iter().map(track).collect::<Vec<Value>>(),
    })
}
