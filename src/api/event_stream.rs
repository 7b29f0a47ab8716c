//! `/api/v1/events/stream`: what happens before the cameras, as it happens, as server-sent events.

use super::Api;
use super::cameras::problem_of;
use super::error::Problem;
use super::events::{MAX_ID, TAG, document};
use super::identity::Asked;
use super::looks;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::schema;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::time::Duration;
use videofields_recording::timeline::LoggedEvent;
use videofields_vision::access::Right;
use videofields_vision::error::{ErrorKind, Fault};

/// The field in which a browser says which event it has had last.
const LAST_EVENT_ID: &str = "last-event-id";

/// How often it is looked for new events, and for whether the caller may still see them.
const LOOK: Duration = Duration::from_millis(200);

/// Time between two comments while nothing happens.
pub(super) const HEARTBEAT: Duration = Duration::from_secs(10);

/// Most events that are taken at one look; of more the newest.
const AT_ONCE: usize = 1000;

const PARAMETERS: &[Parameter] = &[
    Parameter::id("camera", "Whose events; of all without it"),
    Parameter::whole("after", &(0..=MAX_ID), "Only events with a greater `id`; without it those from now on"),
];

/// Routes about what happens.
pub(super) fn routes() -> Routes {
    let stream = Operation::new("follow_events", "What happens before the cameras, as it happens")
        .about("Server-sent events, each with its `id` and its kind as its name; `Last-Event-ID` goes on after one.")
        .right(Right::Live)
        .parameters(PARAMETERS)
        .resumed()
        .may_fail(&[404])
        .answers(
            Answer::nothing(200, "Events without end")
                .media("text/event-stream", Some(schema::sent(&schema::system::EVENT_KINDS, "An event as `list_events` answers it, as JSON"))),
        );
    Routes::of(TAG, NONE).get("/api/v1/events/stream", self::stream, stream)
}

/// Events from now on, or after one (`after`, or what a browser had last).
pub(super) async fn stream(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), PARAMETERS);
    let camera = query.id("camera");
    let after = query.whole("after", &(0..=MAX_ID));
    query.finish(Some(()))?;
    let newest = api.door.events(camera.as_deref(), 0, 1).map_err(|error| problem_of(&api, error))?;
    let newest = newest.last().map_or(0, |logged| logged.id);
    let after = had_last(&headers)?.or(after).unwrap_or(newest);
    // What is told first is of the past where it goes on after an old one.
    let missed =
        api.door.events(camera.as_deref(), after, AT_ONCE).map_err(|error| problem_of(&api, error))?;
    missed.first().into_iter().chain(missed.last()).for_each(|logged| looks::at(logged.event.time));
    let connection = api.connection.clone();
    let following = Following { api, camera, after, found: VecDeque::new() };
    let events = connection.carry(stream::unfold(following, Following::next));
    let body = Sse::new(events).keep_alive(KeepAlive::new().interval(HEARTBEAT));
    Ok(([(header::CACHE_CONTROL, "no-store")], body).into_response())
}

/// Which event a browser that comes back has had last.
fn had_last(headers: &HeaderMap) -> Result<Option<u64>, Problem> {
    let Some(field) = headers.get(LAST_EVENT_ID) else { return Ok(None) };
    let number = field.to_str().ok().and_then(|text| text.parse().ok()).filter(|number| *number <= MAX_ID);
    number.map(Some).ok_or_else(|| {
        let message = format!("must be a whole number from 0 to {MAX_ID}: an event's id");
        Problem::at(ErrorKind::Invalid, vec![Fault::new("Last-Event-ID", message)])
    })
}

/// One listener. It holds no more than one look's events: a slow one is told of the others when it reads on.
struct Following {
    api: Api,
    camera: Option<String>,
    /// The event that was told last.
    after: u64,
    found: VecDeque<LoggedEvent>,
}

impl Following {
    async fn next(mut self) -> Option<(Result<Event, Infallible>, Self)> {
        loop {
            // Who may no longer see it hears no more of it; what was found before is looked for again then.
            let own = self.api.renewed()?;
            if own.identity.caller.grants != self.api.identity.caller.grants {
                self.found.clear();
            }
            self.api = own;
            if self.found.is_empty() {
                let found = self.api.door.events(self.camera.as_deref(), self.after, AT_ONCE).ok()?;
                self.found = found.into();
            }
            if let Some(logged) = self.found.pop_front() {
                self.after = logged.id;
                let event = Event::default().id(logged.id.to_string()).event(logged.event.kind.as_str());
                return Some((Ok(event.json_data(document(&logged)).ok()?), self));
            }
            tokio::time::sleep(LOOK).await;
        }
    }
}
