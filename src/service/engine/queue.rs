//! The queue of the renderer, and whose turn is next: the renderer's time is shared fairly among users ([`super::flow`]), within one by
//! the order in which pictures were first asked for.
//!
//! Requests flow in from any thread; the render thread draws a picture, or a piece of one, then asks what is next. Each picture stands here
//! with everyone who waits for it, and is drawn on behalf of whichever of them has the next turn. Replies stay here until they are answered,
//! also while their picture is drawn, so that whoever has waited too long is refused in time, whatever the render thread waits for. Must not
//! know of scenes or devices.

mod waiting;

use super::EngineError;
use super::accuracy::AccuracyBoard;
use super::error::LateStage;
use super::flow::{Asking, Flow, Kind, Turns};
use super::pace::Pace;
use super::view::{Origin, ViewAnswer, ViewRequest};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::oneshot;
use videofields_recording::telemetry::{Metrics, ViewRefusal};
use videofields_vision::clock::Clock;
use videofields_vision::config::RenderSettings;
use waiting::{Hand, Place};

/// Where the answer to a request goes.
pub(super) type Reply = oneshot::Sender<Result<ViewAnswer, EngineError>>;

/// Most callers of one picture; more take a place of their own.
const MAX_CALLERS: usize = 1024;

/// Places, and bytes of pictures, that one flow may hold for each that is free: all screens of a wall may be one user.
const GREED: usize = 3;

/// Most bytes of all pictures that wait or are being drawn.
const MAX_BYTES: u64 = 1 << 30;

/// Most pictures of which pieces are drawn while others are waited for, and most bytes of theirs. One alone may have more.
const MAX_PAUSED: usize = 4;
const MAX_PAUSED_BYTES: u64 = 256 << 20;

/// How long the thread that refuses the late sleeps where nobody waits.
const NOBODY_WAITS: Duration = Duration::from_secs(60);

/// Names a place in the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PlaceId(u64);

/// Names a picture in hand: by the place for which it was begun.
pub(super) type JobId = PlaceId;

impl JobId {
    /// Names what nobody waits for.
    pub(super) const fn nobody() -> Self {
        Self(0)
    }
}

struct Caller {
    reply: Reply,
    asked_at: Duration,
    flow: Flow,
}

struct State {
    /// In the order of their first callers.
    places: Vec<Place>,
    n_ever: u64,
    is_open: bool,
    pace: Pace,
    /// No device can be had until then.
    down_until: Duration,
    turns: Turns,
    /// The turn that goes on: its flow, its kind, and since when.
    turn: Option<(Flow, Kind, Duration)>,
}

/// A picture that is to be begun.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Job {
    pub(super) id: JobId,
    pub(super) request: ViewRequest,
    /// Moment at which it was first asked for.
    pub(super) asked_at: Duration,
    /// On whose behalf it is begun.
    pub(super) flow: Flow,
}

/// What the render thread is to do.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Next {
    /// Draw this.
    Picture(Box<Job>),
    /// Go on with that.
    GoOn(JobId),
    /// Nothing was asked for.
    Nothing,
    /// Nothing will be asked for any more.
    End,
}

/// See the module.
pub(super) struct RenderQueue {
    max_pictures: usize,
    timeout: Duration,
    /// Samples of a picture that asks for none.
    samples: u32,
    clock: Arc<dyn Clock>,
    metrics: Arc<Metrics>,
    accuracy: Arc<AccuracyBoard>,
    state: Mutex<State>,
    /// Something came, or the end is near.
    changed: Condvar,
}

impl RenderQueue {
    /// An empty queue.
    pub(super) fn new(
        settings: &RenderSettings,
        clock: Arc<dyn Clock>,
        metrics: Arc<Metrics>,
        accuracy: Arc<AccuracyBoard>,
    ) -> Self {
        let state = State {
            places: Vec::new(),
            n_ever: 0,
            is_open: true,
            pace: Pace::default(),
            down_until: Duration::ZERO,
            turns: Turns::default(),
            turn: None,
        };
        Self {
            max_pictures: settings.queue_length,
            timeout: Duration::try_from_secs_f64(settings.timeout_secs).unwrap_or_default(),
            samples: settings.samples,
            clock,
            metrics,
            accuracy,
            state: Mutex::new(state),
            changed: Condvar::new(),
        }
    }

    /// Puts a request at the end, or to an equal one that waits already, whoever asked for that.
    ///
    /// # Errors
    /// [`EngineError::Busy`] and [`EngineError::OverShare`] at once where too much waits, of all or of that flow;
    /// [`EngineError::Unavailable`] at the end.
    pub(super) fn push(
        &self,
        request: ViewRequest,
        asking: impl Into<Asking>,
        reply: Reply,
    ) -> Result<(), EngineError> {
        let now = self.clock.monotonic();
        let Asking { flow, since } = asking.into();
        let asked_at = since.map_or(now, |since| since.min(now));
        let mut state = self.lock();
        if !state.is_open {
            return Err(EngineError::Unavailable("the daemon is stopping".to_owned()));
        }
        state.turns.note(&flow);
        let joined = state.places.iter_mut().find(|place| {
            place.hand.is_none() && place.request == request && place.callers.len() < MAX_CALLERS
        });
        if let Some(place) = joined {
            place.callers.push(Caller { reply, asked_at, flow });
        } else {
            let mut refused = state.refusal(&flow, request_bytes(&request), self.max_pictures);
            if refused.is_some() {
                // Some may have left.
                self.prune(&mut state, now);
                state.turns.note(&flow);
                refused = state.refusal(&flow, request_bytes(&request), self.max_pictures);
            }
            if let Some(reason) = refused {
                self.metrics.count_refused(reason);
                let retry_after = state.retry_after(&flow, now, self.timeout);
                return Err(match reason {
                    ViewRefusal::UserShare | ViewRefusal::UserBytes => {
                        EngineError::OverShare { waiting: state.n_held_by(&flow), retry_after }
                    }
                    _ => EngineError::Busy { waiting: state.n_waiting(), retry_after },
                });
            }
            state.n_ever += 1;
            let id = PlaceId(state.n_ever);
            let caller = Caller { reply, asked_at, flow };
            state.places.push(Place::new(id, request, caller, self.samples));
        }
        self.accuracy.note_asked();
        self.tell_length(&state);
        self.changed.notify_all();
        Ok(())
    }

    /// Takes what is to be drawn next in hand; waits up to `timeout` for something. What that takes, until [`Self::end_turn`], is charged
    /// to whose turn it is.
    pub(super) fn next(&self, timeout: Duration) -> Next {
        let mut state = self.lock();
        loop {
            let now = self.clock.monotonic();
            self.prune(&mut state, now);
            if let Some(next) = state.begin_turn(now) {
                self.tell_length(&state);
                return next;
            }
            if !state.is_open {
                return Next::End;
            }
            let (woken, waited) =
                self.changed.wait_timeout(state, timeout).unwrap_or_else(PoisonError::into_inner);
            state = woken;
            if waited.timed_out() {
                return Next::Nothing;
            }
        }
    }

    /// Charges what the turn took, if there is one.
    pub(super) fn end_turn(&self) {
        let now = self.clock.monotonic();
        let mut state = self.lock();
        let Some((flow, kind, began)) = state.turn.take() else { return };
        let took = now.saturating_sub(began);
        state.turns.charge(&flow, kind, took);
        drop(state);
        self.metrics.render_turn.observe(took.as_secs_f64());
    }

    /// Notes that pieces of a picture in hand are still to be drawn, which takes about `left` by itself: others may have a turn.
    pub(super) fn pause(&self, job: JobId, left: Duration) {
        for place in &mut self.lock().places {
            if let Some(hand) = place.hand.as_mut().filter(|hand| hand.job == job) {
                (hand.is_paused, hand.left) = (true, Some(left));
            }
        }
    }

    /// What waits and is not in hand.
    pub(super) fn waiting(&self) -> Vec<(PlaceId, ViewRequest)> {
        let state = self.lock();
        let waiting = state.places.iter().filter(|place| place.hand.is_none());
        waiting.map(|place| (place.id, place.request.clone())).collect()
    }

    /// Takes those of `ids` that still wait in hand with `job` too: they are answered with it.
    pub(super) fn take_along(&self, job: JobId, ids: &[PlaceId]) {
        let now = self.clock.monotonic();
        let mut state = self.lock();
        for place in &mut state.places {
            if place.hand.is_none() && ids.contains(&place.id) {
                place.hand = Some(Hand::new(job, now));
            }
        }
        self.tell_length(&state);
    }

    /// Has everyone who waits for `job` wait for another picture in hand, which is paused and turned out to be the same.
    pub(super) fn join(&self, job: JobId, other: JobId) {
        let mut state = self.lock();
        let left = state.places.iter().filter_map(|place| place.hand.as_ref()).find(|hand| hand.job == other);
        let left = left.and_then(|hand| hand.left);
        for hand in state.places.iter_mut().filter_map(|place| place.hand.as_mut()) {
            if hand.job == job {
                (hand.job, hand.is_paused, hand.left) = (other, true, left);
            }
        }
    }

    /// Whether anybody still waits for what is in hand; whose time is up is refused first.
    pub(super) fn is_wanted(&self, job: JobId) -> bool {
        let mut state = self.lock();
        self.prune(&mut state, self.clock.monotonic());
        state.places.iter().any(|place| place.is_of(job))
    }

    /// Answers everyone who waits for what is in hand.
    pub(super) fn finish(&self, job: JobId, answer: &Result<ViewAnswer, EngineError>) {
        let mut state = self.lock();
        let mut n_answered = 0;
        for place in state.places.extract_if(.., |place| place.is_of(job)) {
            let begun_at = place.hand.map_or(Duration::ZERO, |hand| hand.begun_at);
            for caller in place.callers {
                let waited = begun_at.saturating_sub(caller.asked_at);
                let told = answer.as_ref().map(|answer| told_to(answer, n_answered, waited));
                self.answer(caller, told.map_err(Clone::clone));
                n_answered += 1;
            }
        }
        if !state.is_open {
            self.changed.notify_all();
        }
    }

    fn answer(&self, caller: Caller, answer: Result<ViewAnswer, EngineError>) {
        match &answer {
            Ok(answer) => {
                if let Some((_, waited)) = answer.timings.first() {
                    self.metrics.render_wait.observe(waited.as_secs_f64());
                }
                match answer.origin {
                    Origin::Drawn => {}
                    Origin::Shared => self.metrics.render_shared.inc(),
                    Origin::Kept => self.metrics.render_cache_hits.inc(),
                }
            }
            Err(EngineError::NoRenderer { .. }) => self.metrics.count_refused(ViewRefusal::NoRenderer),
            Err(_) => {}
        }
        self.accuracy.note_answered();
        if caller.reply.send(answer).is_err() {
            self.metrics.render_abandoned.inc();
        }
    }

    /// Notes what a turn of drawing took.
    pub(super) fn note_drawn(&self, took: Duration) {
        self.lock().pace.note(took);
    }

    /// Notes that no device can be had for a while.
    pub(super) fn note_down_for(&self, pause: Duration) {
        self.lock().down_until = self.clock.monotonic().saturating_add(pause);
    }

    /// After how long a new request of that flow would about be answered.
    pub(super) fn retry_after(&self, flow: &Flow) -> Duration {
        self.lock().retry_after(flow, self.clock.monotonic(), self.timeout)
    }

    /// Returns how much of `left` a picture of a flow can have that is drawn in several turns, by what others wait for: its share of the
    /// time, or all that is left when others are done.
    pub(super) fn share_of(&self, flow: &Flow, left: Duration) -> Duration {
        let state = self.lock();
        let (n_others, backlog) = state.rivals(flow, left);
        (left / (n_others + 1)).max(left.saturating_sub(backlog))
    }

    /// Takes nothing more; what waits is still answered.
    pub(super) fn close(&self) {
        self.lock().is_open = false;
        self.changed.notify_all();
    }

    /// Refuses whoever has waited too long, until the queue is closed and empty.
    pub(super) fn refuse_late(&self) {
        let mut state = self.lock();
        loop {
            let now = self.clock.monotonic();
            self.prune(&mut state, now);
            if !state.is_open && state.places.is_empty() {
                return;
            }
            let ends = state.places.iter().flat_map(|place| {
                let patience = place.patience(self.timeout);
                place.callers.iter().map(move |caller| caller.asked_at.saturating_add(patience))
            });
            let sleep = ends.min().map_or(NOBODY_WAITS, |end| end.saturating_sub(now));
            // Never no time at all, so that a clock that stands still is no busy loop.
            let sleep = sleep.max(Duration::from_millis(1));
            state = self.changed.wait_timeout(state, sleep).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Lets go who has left, and refuses who has waited too long.
    fn prune(&self, state: &mut State, now: Duration) {
        for idx in 0..state.places.len() {
            let place = &state.places[idx];
            let stage = if place.hand.is_some() { LateStage::Drawing } else { LateStage::Waiting };
            let patience = place.patience(self.timeout);
            let is_over =
                |caller: &Caller| caller.reply.is_closed() || now.saturating_sub(caller.asked_at) >= patience;
            while let Some(over) = state.places[idx].callers.iter().position(is_over) {
                let caller = state.places[idx].callers.remove(over);
                let waited = now.saturating_sub(caller.asked_at);
                let retry_after = state.retry_after(&caller.flow, now, self.timeout);
                if caller.reply.send(Err(EngineError::Late { waited, stage, retry_after })).is_ok() {
                    self.metrics.count_refused(ViewRefusal::Late);
                } else {
                    self.metrics.render_abandoned.inc();
                }
                self.accuracy.note_answered();
            }
        }
        state.places.retain(|place| !place.callers.is_empty());
        let State { turns, places, turn, .. } = state;
        turns.tidy(|flow| {
            let is_turn = turn.as_ref().is_some_and(|(of, ..)| of == flow);
            is_turn || places.iter().any(|place| place.is_for(flow))
        });
        if !state.is_open && state.places.is_empty() {
            self.changed.notify_all();
        }
        self.tell_length(state);
    }

    fn tell_length(&self, state: &State) {
        self.metrics.render_queue_length.set(i64::try_from(state.n_waiting()).unwrap_or(i64::MAX));
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Every change is made in one step: a panic leaves none by half.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Bytes of the picture that is asked for.
fn request_bytes(request: &ViewRequest) -> u64 {
    3 * u64::from(request.width_px) * u64::from(request.height_px)
}

/// `answer` as the caller `idx` of its picture is told it, who waited so long for it to be begun.
fn told_to(answer: &ViewAnswer, idx: usize, waited: Duration) -> ViewAnswer {
    let mut answer = answer.clone();
    answer.timings.insert(0, ("wait", waited));
    if idx > 0 && answer.origin == Origin::Drawn {
        answer.origin = Origin::Shared;
    }
    answer
}

#[cfg(test)]
mod tests;
