//! What waits for the renderer: pictures in the order in which they were first asked for, each with everyone who waits
//! for it.
//!
//! Requests flow in from any thread; the render thread takes one picture after the other, and whatever else it finds to
//! be the same. Replies stay here until they are answered, also while their picture is drawn, so that whoever has waited
//! too long is refused in time, whatever the render thread waits for. Must not know of scenes or devices.

use super::EngineError;
use super::accuracy::AccuracyBoard;
use super::error::LateStage;
use super::pace::Pace;
use super::view::{Origin, ViewAnswer, ViewRequest};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::oneshot;
use videofields_recording::telemetry::{Metrics, ViewRefusal};
use videofields_vision::clock::Clock;
use videofields_vision::config::RenderSettings;

/// Where the answer to a request goes.
pub(super) type Reply = oneshot::Sender<Result<ViewAnswer, EngineError>>;

/// Most callers of one picture; more take a place of their own.
const MAX_CALLERS: usize = 1024;

/// How long the thread that refuses the late sleeps where nobody waits.
const NOBODY_WAITS: Duration = Duration::from_secs(60);

/// Names a place in the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PlaceId(u64);

struct Caller {
    reply: Reply,
    asked_at: Duration,
}

/// One picture, and who waits for it.
struct Place {
    id: PlaceId,
    request: ViewRequest,
    callers: Vec<Caller>,
    /// Since when the render thread has it.
    begun_at: Option<Duration>,
}

impl Place {
    /// How long a caller waits: until its deadline for the drawing to begin, and for what has begun as for any.
    fn patience(&self, timeout: Duration) -> Duration {
        match self.request.effort.deadline() {
            Some(deadline) if self.begun_at.is_none() => deadline.total.min(timeout),
            _ => timeout,
        }
    }
}

struct State {
    /// In the order of their first callers.
    places: Vec<Place>,
    n_ever: u64,
    is_open: bool,
    pace: Pace,
    /// No device can be had until then.
    down_until: Duration,
}

/// What the render thread is to do.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Next {
    /// Draw this, which was first asked for then.
    Picture(Box<ViewRequest>, Duration),
    /// Nothing was asked for.
    Nothing,
    /// Nothing will be asked for any more.
    End,
}

/// See the module.
pub(super) struct RenderQueue {
    max_pictures: usize,
    timeout: Duration,
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
        };
        Self {
            max_pictures: settings.queue_length,
            timeout: Duration::try_from_secs_f64(settings.timeout_secs).unwrap_or_default(),
            clock,
            metrics,
            accuracy,
            state: Mutex::new(state),
            changed: Condvar::new(),
        }
    }

    /// Puts a request at the end, or to an equal one that waits already.
    ///
    /// # Errors
    /// [`EngineError::Busy`] at once where too many pictures wait, [`EngineError::Unavailable`] at the end.
    pub(super) fn push(&self, request: ViewRequest, reply: Reply) -> Result<(), EngineError> {
        let now = self.clock.monotonic();
        let mut state = self.lock();
        if !state.is_open {
            return Err(EngineError::Unavailable("the daemon is stopping".to_owned()));
        }
        let caller = Caller { reply, asked_at: now };
        let joined = state.places.iter_mut().find(|place| {
            place.begun_at.is_none() && place.request == request && place.callers.len() < MAX_CALLERS
        });
        if let Some(place) = joined {
            place.callers.push(caller);
        } else {
            if state.n_waiting() >= self.max_pictures {
                // Some may have left.
                self.prune(&mut state, now);
            }
            let waiting = state.n_waiting();
            if waiting >= self.max_pictures {
                self.metrics.count_refused(ViewRefusal::QueueFull);
                return Err(EngineError::Busy { waiting, retry_after: state.retry_after(now, self.timeout) });
            }
            state.n_ever += 1;
            let id = PlaceId(state.n_ever);
            state.places.push(Place { id, request, callers: vec![caller], begun_at: None });
        }
        self.accuracy.note_asked();
        self.tell_length(&state);
        self.changed.notify_all();
        Ok(())
    }

    /// Takes the picture that waits longest in hand; waits up to `timeout` for one.
    pub(super) fn next(&self, timeout: Duration) -> Next {
        let mut state = self.lock();
        loop {
            let now = self.clock.monotonic();
            self.prune(&mut state, now);
            if let Some(place) = state.places.iter_mut().find(|place| place.begun_at.is_none()) {
                place.begun_at = Some(now);
                let request = Box::new(place.request.clone());
                let asked_at = place.callers.iter().map(|caller| caller.asked_at).min().unwrap_or(now);
                self.tell_length(&state);
                return Next::Picture(request, asked_at);
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

    /// What waits and is not in hand.
    pub(super) fn waiting(&self) -> Vec<(PlaceId, ViewRequest)> {
        let state = self.lock();
        let waiting = state.places.iter().filter(|place| place.begun_at.is_none());
        waiting.map(|place| (place.id, place.request.clone())).collect()
    }

    /// Takes those of `ids` that still wait in hand too: they are answered with what is in hand already.
    pub(super) fn take_along(&self, ids: &[PlaceId]) {
        let now = self.clock.monotonic();
        let mut state = self.lock();
        for place in &mut state.places {
            if place.begun_at.is_none() && ids.contains(&place.id) {
                place.begun_at = Some(now);
            }
        }
        self.tell_length(&state);
    }

    /// Whether anybody still waits for what is in hand; whose time is up is refused first.
    pub(super) fn is_wanted(&self) -> bool {
        let mut state = self.lock();
        self.prune(&mut state, self.clock.monotonic());
        state.places.iter().any(|place| place.begun_at.is_some())
    }

    /// Answers everyone who waits for what is in hand.
    pub(super) fn finish(&self, answer: &Result<ViewAnswer, EngineError>) {
        let mut state = self.lock();
        let (in_hand, waiting) =
            std::mem::take(&mut state.places).into_iter().partition(|place: &Place| place.begun_at.is_some());
        state.places = waiting;
        let callers = in_hand.into_iter().flat_map(|place| {
            let begun_at = place.begun_at.unwrap_or_default();
            place.callers.into_iter().map(move |caller| (begun_at, caller))
        });
        for (idx, (begun_at, caller)) in callers.enumerate() {
            let waited = begun_at.saturating_sub(caller.asked_at);
            self.answer(
                caller,
                answer.as_ref().map(|answer| told_to(answer, idx, waited)).map_err(Clone::clone),
            );
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

    /// Notes what a drawing took.
    pub(super) fn note_drawn(&self, took: Duration) {
        self.lock().pace.note(took);
    }

    /// Notes that no device can be had for a while.
    pub(super) fn note_down_for(&self, pause: Duration) {
        self.lock().down_until = self.clock.monotonic().saturating_add(pause);
    }

    /// After how long a new request would about be answered.
    pub(super) fn retry_after(&self) -> Duration {
        self.lock().retry_after(self.clock.monotonic(), self.timeout)
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
        let retry_after = state.retry_after(now, self.timeout);
        for place in &mut state.places {
            let stage = if place.begun_at.is_some() { LateStage::Drawing } else { LateStage::Waiting };
            let patience = place.patience(self.timeout);
            let is_over = |caller: &mut Caller| {
                caller.reply.is_closed() || now.saturating_sub(caller.asked_at) >= patience
            };
            for caller in place.callers.extract_if(.., is_over) {
                let waited = now.saturating_sub(caller.asked_at);
                if caller.reply.send(Err(EngineError::Late { waited, stage, retry_after })).is_ok() {
                    self.metrics.count_refused(ViewRefusal::Late);
                } else {
                    self.metrics.render_abandoned.inc();
                }
                self.accuracy.note_answered();
            }
        }
        state.places.retain(|place| !place.callers.is_empty());
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

impl State {
    fn n_waiting(&self) -> usize {
        self.places.iter().filter(|place| place.begun_at.is_none()).count()
    }

    /// What is before a new request takes about that long: what is in hand counts as one, since it is one drawing.
    /// After `timeout` nothing of that waits any more.
    fn retry_after(&self, now: Duration, timeout: Duration) -> Duration {
        let n_waiting = self.n_waiting();
        let n_in_hand = usize::from(self.places.len() > n_waiting);
        let n_pictures = u32::try_from(n_waiting + n_in_hand).unwrap_or(u32::MAX);
        let queued = self.pace.median().saturating_mul(n_pictures).min(timeout);
        queued.max(self.down_until.saturating_sub(now))
    }
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
mod tests {
    use super::*;
    use crate::engine::At;
    use crate::engine::view::ViewKind;
    use glam::DVec3;
    use videofields_picture::plan::{Aim, Deadline, Effort, EntityStyle, Plan, Settings};
    use videofields_picture::scene::SceneView;
    use videofields_vision::clock::{SimulatedClock, Timestamp};
    use videofields_vision::frame::RgbImage;

    type Answer = oneshot::Receiver<Result<ViewAnswer, EngineError>>;

    /// A queue of three pictures and a timeout of 8 s, on a clock that stands still.
    struct Bench {
        clock: Arc<SimulatedClock>,
        metrics: Arc<Metrics>,
        accuracy: Arc<AccuracyBoard>,
        queue: RenderQueue,
    }

    impl Bench {
        fn new() -> Self {
            let clock = Arc::new(SimulatedClock::new(Timestamp::from_nanos(0)));
            let metrics = Arc::new(Metrics::new());
            let accuracy = Arc::new(AccuracyBoard::new(Arc::clone(&clock) as Arc<dyn Clock>));
            let settings = RenderSettings { queue_length: 3, timeout_secs: 8.0, ..RenderSettings::default() };
            let queue = RenderQueue::new(
                &settings,
                Arc::clone(&clock) as Arc<dyn Clock>,
                Arc::clone(&metrics),
                Arc::clone(&accuracy),
            );
            Self { clock, metrics, accuracy, queue }
        }

        fn ask(&self, width_px: u32) -> Answer {
            self.try_ask(width_px).expect("there is room")
        }

        fn try_ask(&self, width_px: u32) -> Result<Answer, EngineError> {
            let (reply, answer) = oneshot::channel();
            self.queue.push(request(width_px), reply).map(|()| answer)
        }

        /// The width of the picture that is to be drawn next; none where nothing waits.
        fn next(&self) -> Option<u32> {
            match self.queue.next(Duration::ZERO) {
                Next::Picture(request, _) => Some(request.width_px),
                Next::Nothing | Next::End => None,
            }
        }

        fn pass(&self, secs: u64) {
            self.clock.advance(Duration::from_secs(secs));
        }

        fn n_refused(&self, reason: ViewRefusal) -> u64 {
            self.metrics.render_refused.with_label_values(&[reason.as_str()]).get()
        }
    }

    fn request(width_px: u32) -> ViewRequest {
        ViewRequest {
            scene: "yard".to_owned(),
            kind: ViewKind::Perspective,
            eye: Some(DVec3::ONE),
            target: None,
            fov_y_rad: None,
            width_px,
            height_px: 9,
            at: At::Live,
            style: EntityStyle::Billboards,
            see_through: true,
            colors: videofields_picture::plan::Colors::Even,
            session: None,
            effort: Effort::default(),
            effects: Default::default(),
            horizon: None,
            blur_people: None,
            scope: videofields_vision::access::Scope::all(),
        }
    }

    fn picture() -> Result<ViewAnswer, EngineError> {
        Ok(ViewAnswer {
            image: Arc::new(RgbImage { width: 1, height: 1, data: vec![0; 3] }),
            instant: Timestamp::from_nanos(0),
            kind: ViewKind::Perspective,
            view: SceneView { eye: DVec3::ZERO, target: DVec3::X, fov_y_rad: 1.0 },
            sources: Vec::new(),
            frames: Vec::new(),
            gaps: Vec::new(),
            blurs: None,
            settings: Settings::default(),
            expected: None,
            plan: Arc::new(Plan::bare(&Settings::default())),
            timings: vec![("render", Duration::from_millis(5))],
            origin: Origin::Drawn,
            identity: None,
        })
    }

    fn told(answer: &mut Answer) -> Option<Result<ViewAnswer, EngineError>> {
        answer.try_recv().ok()
    }

    #[test]
    fn pictures_are_drawn_in_the_order_in_which_they_were_first_asked_for() {
        let bench = Bench::new();
        let _answers = [2, 1, 2, 3, 1].map(|width| bench.ask(width));
        assert_eq!(bench.metrics.render_queue_length.get(), 3);
        for expected in [2, 1, 3] {
            assert_eq!(bench.next(), Some(expected));
            bench.queue.finish(&picture());
        }
        assert_eq!((bench.next(), bench.metrics.render_queue_length.get()), (None, 0));
        assert!(bench.accuracy.is_quiet() || bench.accuracy.n_asked() == 5);
    }

    #[test]
    fn who_asks_for_what_waits_takes_no_place_and_shares_the_picture() {
        let bench = Bench::new();
        let mut answers: Vec<Answer> = (0..15).map(|_| bench.ask(7)).collect();
        bench.pass(2);
        assert_eq!((bench.next(), bench.next()), (Some(7), None), "one picture");
        // What is in hand is of an earlier moment: the next one is another picture.
        let mut later = bench.ask(7);
        bench.queue.finish(&picture());
        let origins: Vec<Origin> = answers
            .iter_mut()
            .map(|answer| {
                let answer = told(answer).expect("answered").expect("a picture");
                assert_eq!(answer.timings[0], ("wait", Duration::from_secs(2)));
                answer.origin
            })
            .collect();
        assert_eq!(origins[0], Origin::Drawn);
        assert!(origins[1..].iter().all(|origin| *origin == Origin::Shared));
        assert_eq!(bench.metrics.render_shared.get(), 14);
        assert!(told(&mut later).is_none());
        // Unless it turns out to be the same.
        let waiting = bench.queue.waiting();
        assert_eq!(waiting.len(), 1);
        bench.queue.take_along(&[waiting[0].0]);
        bench.queue.finish(&picture());
        assert!(told(&mut later).is_some_and(|answer| answer.is_ok()));
    }

    #[test]
    fn a_full_queue_refuses_at_once_and_says_when_to_ask_again() {
        let bench = Bench::new();
        for _ in 0..40 {
            bench.queue.note_drawn(Duration::from_secs(2));
        }
        bench.queue.note_drawn(Duration::from_secs(100));
        let answers = [1, 2, 3].map(|width| bench.ask(width));
        let refused = |expected: u64| {
            let Err(EngineError::Busy { waiting, retry_after }) = bench.try_ask(9) else {
                panic!("there is no room")
            };
            assert_eq!((waiting, retry_after), (3, Duration::from_secs(expected)));
        };
        refused(6);
        assert_eq!(bench.next(), Some(1));
        let _fourth = bench.ask(4);
        // Three wait, and one is in hand.
        refused(8);
        assert_eq!(bench.n_refused(ViewRefusal::QueueFull), 2);
        bench.queue.note_down_for(Duration::from_secs(20));
        refused(20);
        // Who joins what waits needs no room; who left makes some.
        let _joined = bench.ask(2);
        drop(answers);
        let _fifth = bench.ask(5);
        assert_eq!(bench.metrics.render_abandoned.get(), 3);
    }

    #[test]
    fn who_waited_too_long_is_refused_and_not_drawn() {
        let bench = Bench::new();
        let mut first = bench.ask(1);
        bench.pass(5);
        let (mut same, mut second) = (bench.ask(1), bench.ask(2));
        assert_eq!(bench.next(), Some(1));
        assert!(bench.queue.is_wanted());
        bench.pass(3);
        // The first one's time is up while it is drawn; another waits for the same picture.
        assert!(bench.queue.is_wanted());
        let late = told(&mut first).expect("refused").expect_err("late");
        assert!(matches!(late, EngineError::Late { stage: LateStage::Drawing, .. }), "{late}");
        assert_eq!(late.to_string(), "no picture within 8.0 s: it is still being drawn");
        assert!(late.retry_after().is_some_and(|after| after > Duration::ZERO));
        assert!(told(&mut same).is_none() && told(&mut second).is_none());
        bench.pass(5);
        assert!(!bench.queue.is_wanted(), "a drawing for nobody may stop");
        assert!(told(&mut same).is_some_and(|answer| answer.is_err()));
        let late = told(&mut second).expect("refused").expect_err("late");
        assert!(matches!(late, EngineError::Late { stage: LateStage::Waiting, .. }), "{late}");
        assert_eq!((bench.next(), bench.n_refused(ViewRefusal::Late)), (None, 3));
        bench.queue.finish(&picture());
        bench.pass(60);
        assert!(bench.accuracy.is_quiet(), "nobody is waited for any more");
    }

    #[test]
    fn a_deadline_bounds_the_wait_and_not_what_has_begun() {
        let bench = Bench::new();
        let ask = |width_px: u32| {
            let (reply, answer) = oneshot::channel();
            let total = Duration::from_secs(2);
            let aim = Aim::Within(Deadline { total, reserve: Duration::ZERO });
            let effort = Effort { aim, ..Effort::default() };
            bench.queue.push(ViewRequest { effort, ..request(width_px) }, reply).expect("there is room");
            answer
        };
        let (mut first, mut second) = (ask(1), ask(2));
        assert_eq!(bench.next(), Some(1));
        bench.pass(3);
        assert!(bench.queue.is_wanted(), "what has begun is waited for");
        let late = second.try_recv().expect("it is answered").expect_err("its time is up");
        assert!(matches!(late, EngineError::Late { stage: LateStage::Waiting, .. }), "{late}");
        assert!(first.try_recv().is_err(), "not yet");
        bench.pass(5);
        assert!(!bench.queue.is_wanted());
        let late = first.try_recv().expect("it is answered").expect_err("its time is up too");
        assert!(matches!(late, EngineError::Late { stage: LateStage::Drawing, .. }), "{late}");
    }

    #[test]
    fn who_left_is_not_drawn() {
        let bench = Bench::new();
        let [first, second, _third] = [1, 2, 3].map(|width| bench.ask(width));
        drop(first);
        assert_eq!(bench.next(), Some(2));
        drop(second);
        assert!(!bench.queue.is_wanted());
        assert_eq!((bench.next(), bench.metrics.render_abandoned.get()), (Some(3), 2));
    }

    #[test]
    fn a_closed_queue_takes_nothing_and_what_waits_is_still_drawn() {
        let bench = Bench::new();
        let mut answer = bench.ask(1);
        bench.queue.close();
        assert!(matches!(bench.try_ask(1), Err(EngineError::Unavailable(_))));
        assert_eq!(bench.next(), Some(1));
        bench.queue.finish(&picture());
        assert!(told(&mut answer).is_some_and(|answer| answer.is_ok()));
        assert_eq!(bench.queue.next(Duration::from_secs(60)), Next::End);
        bench.queue.refuse_late();
    }

    #[test]
    fn the_late_are_refused_though_nobody_draws() {
        let bench = Bench::new();
        let (mut one, mut two) = (bench.ask(1), bench.ask(2));
        bench.queue.close();
        bench.pass(9);
        // Ends, since nobody is left.
        bench.queue.refuse_late();
        assert!(told(&mut one).is_some_and(|answer| answer.is_err()));
        assert!(told(&mut two).is_some_and(|answer| answer.is_err()));
    }
}
