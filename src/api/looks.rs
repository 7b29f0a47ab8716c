//! Which requests look at what cameras saw, and at which time, for the audit log.
//!
//! Both are decided here: a route is a look where its description names a right of cameras, and the time is what the query
//! (`t`, `from`, `to`), a playhead or the events that are answered say, gathered while the request is answered. What goes on after
//! its answer has begun ([`Following`]) notes by itself where it goes.

use super::audit::{Line, unwritten};
use super::error::Problem;
use super::openapi::Verb;
use super::{Api, described};
use axum::http::StatusCode;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::fmt;
use std::future::Future;
use std::sync::{LazyLock, Mutex, PoisonError};
use videofields_vision::access::Right;
use videofields_vision::clock::Timestamp;

/// Looks at the same part of the past are one look.
const PART_NANOS: i64 = 600_000_000_000;

/// Kind of a route at which somebody looks at what cameras saw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Looks {
    /// At what goes on now, where no time is named.
    Live,
    /// At the past always.
    Past,
}

/// Those routes by their paths; it follows from the program alone.
static LOOKS: LazyLock<BTreeMap<&'static str, Looks>> = LazyLock::new(|| {
    let looks = described().routes.into_iter().filter(|route| route.verb == Verb::Get).filter_map(|route| {
        let has = |right| route.operation.rights.contains(&right);
        let is_past = has(Right::History) || has(Right::Export);
        let looks = if has(Right::Live) { Some(Looks::Live) } else { is_past.then_some(Looks::Past) };
        looks.map(|looks| (route.path, looks))
    });
    looks.collect()
});

/// The request in hand.
struct InHand {
    line: Line,
    /// Span at which it has looked so far.
    span: Cell<Option<Span>>,
}

tokio::task_local! {
    static IN_HAND: InHand;
}

/// Span from the earliest to the latest instant that was looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    from: Timestamp,
    to: Timestamp,
}

impl Span {
    const fn at(instant: Timestamp) -> Self {
        Self { from: instant, to: instant }
    }

    /// Returns in which parts of the past it begins and ends.
    pub(super) fn part(self) -> (i64, i64) {
        (self.from.as_nanos().div_euclid(PART_NANOS), self.to.as_nanos().div_euclid(PART_NANOS))
    }
}

impl fmt::Display for Span {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { from, to } = self;
        if from == to { write!(formatter, "shown={from}") } else { write!(formatter, "shown={from}/{to}") }
    }
}

/// Returns how a GET of the route at `path` looks at what cameras saw, where it does.
pub(super) fn of_route(path: &str) -> Option<Looks> {
    LOOKS.get(path).copied()
}

/// Notes that the request in hand looks at an instant of the past.
pub(super) fn at(instant: Timestamp) {
    // What goes on after its answer has begun is no request's any more.
    let _outside = IN_HAND.try_with(|InHand { span: looked, .. }| {
        let span = looked.get().unwrap_or(Span::at(instant));
        looked.set(Some(Span { from: span.from.min(instant), to: span.to.max(instant) }));
    });
}

/// Returns what a request's `answer` is, and at what of the past it looked; `line` tells of it.
pub(super) async fn of<T>(line: Line, answer: impl Future<Output = T>) -> (T, Option<Span>) {
    let both = async {
        let answer = answer.await;
        (answer, IN_HAND.with(|request| request.span.get()))
    };
    IN_HAND.scope(InHand { line, span: Cell::new(None) }, both).await
}

/// Returns what notes where the answer of the request in hand goes that goes on for long; none where nothing is noted.
pub(super) fn following(status: StatusCode) -> Option<Following> {
    let line = IN_HAND.try_with(|request| request.line.clone()).ok()?;
    Some(Following { line, status, part: Mutex::new(None) })
}

/// Looks of a stream, which shows another part of the past when its playhead gets there.
#[derive(Debug)]
pub(super) struct Following {
    line: Line,
    status: StatusCode,
    /// The part that was noted last.
    part: Mutex<Option<(i64, i64)>>,
}

impl Following {
    /// Notes that it shows an instant of the past, where that is in another part than what it showed before.
    ///
    /// # Errors
    /// When that cannot be written: then it must not be shown.
    pub(super) async fn shows(&self, api: &Api, instant: Timestamp) -> Result<(), Problem> {
        let span = Span::at(instant);
        // One value, replaced whole.
        let known = || self.part.lock().unwrap_or_else(PoisonError::into_inner);
        if *known() == Some(span.part()) {
            return Ok(());
        }
        let user = api.identity.caller.user.as_deref();
        let noted = self.line.note_look(api, (user, self.status), None, Some(span)).await;
        noted.map_err(unwritten)?;
        *known() = Some(span.part());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_route_that_takes_a_time_is_a_look() {
        for route in described().routes.iter().filter(|route| route.verb == Verb::Get) {
            let takes_time =
                route.operation.parameters.iter().any(super::super::parameters::Parameter::is_time);
            // Its times are those at which snapshots were made.
            let is_list = route.path == "/api/v1/snapshots";
            assert!(!takes_time || of_route(route.path).is_some() || is_list, "{}", route.path);
        }
        for of_cameras in ["/api/v1/events", "/api/v1/walls/{id}/tiles/{tile}/frames"] {
            assert_eq!(of_route(of_cameras), Some(Looks::Live), "{of_cameras}");
        }
        for past in ["/api/v1/exports/{id}/{file}", "/api/v1/cameras/{id}/strip.jpg"] {
            assert_eq!(of_route(past), Some(Looks::Past), "{past}");
        }
        assert_eq!([of_route("/api/v1/cameras"), of_route("/api/v1/audit")], [None, None]);
    }

    #[tokio::test]
    async fn a_span_reaches_over_all_that_a_request_looked_at() {
        let second = |second: i64| Timestamp::from_nanos(second * 1_000_000_000);
        let (answer, span) = of(Line::test(), async { [700, 500, 600].map(second).map(at).len() }).await;
        let span = span.unwrap();
        assert_eq!((answer, span.part()), (3, (0, 1)));
        assert_eq!(span.to_string(), "shown=1970-01-01T00:08:20Z/1970-01-01T00:11:40Z");
        assert_eq!(
            of(Line::test(), async { at(second(-1)) }).await.1.unwrap().to_string(),
            "shown=1969-12-31T23:59:59Z"
        );
        assert_eq!(of(Line::test(), async {}).await.1, None);
        // Nothing is noted outside.
        at(second(1));
    }
}
