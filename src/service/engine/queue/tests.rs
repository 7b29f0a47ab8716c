//! Tests of the queue on a clock that stands still.

use super::*;
use crate::engine::At;
use crate::engine::view::ViewKind;
use glam::DVec3;
use std::cell::Cell;
use std::collections::HashMap;
use videofields_picture::plan::{Aim, Deadline, Effort, EntityStyle, Plan, Settings};
use videofields_picture::scene::SceneView;
use videofields_vision::clock::{SimulatedClock, Timestamp};
use videofields_vision::frame::RgbImage;

/// A size of several pieces.
const LARGE: (u32, u32) = (4000, 3000);

/// A size of one.
const SMALL: (u32, u32) = (64, 48);

fn user(name: &str) -> Flow {
    Flow::User(name.into())
}

type Answer = oneshot::Receiver<Result<ViewAnswer, EngineError>>;

/// A queue of three pictures and a timeout of 8 s, on a clock that stands still.
struct Bench {
    clock: Arc<SimulatedClock>,
    metrics: Arc<Metrics>,
    accuracy: Arc<AccuracyBoard>,
    queue: RenderQueue,
    /// The picture that was taken last.
    job: Cell<JobId>,
}

impl Bench {
    fn new() -> Self {
        Self::with_length(3)
    }

    fn with_length(queue_length: usize) -> Self {
        let clock = Arc::new(SimulatedClock::new(Timestamp::from_nanos(0)));
        let metrics = Arc::new(Metrics::new());
        let accuracy = Arc::new(AccuracyBoard::new(Arc::clone(&clock) as Arc<dyn Clock>));
        let settings = RenderSettings { queue_length, timeout_secs: 8.0, ..RenderSettings::default() };
        let queue = RenderQueue::new(
            &settings,
            Arc::clone(&clock) as Arc<dyn Clock>,
            Arc::clone(&metrics),
            Arc::clone(&accuracy),
        );
        Self { clock, metrics, accuracy, queue, job: Cell::new(JobId::nobody()) }
    }

    fn ask(&self, width_px: u32) -> Answer {
        self.try_ask(width_px).expect("there is room")
    }

    fn try_ask(&self, width_px: u32) -> Result<Answer, EngineError> {
        let (reply, answer) = oneshot::channel();
        self.queue.push(request(width_px), Flow::Common, reply).map(|()| answer)
    }

    /// Takes the picture that is to be drawn next in hand; its width. None where nothing waits.
    fn next(&self) -> Option<u32> {
        match self.queue.next(Duration::ZERO) {
            Next::Picture(job) => {
                self.job.set(job.id);
                Some(job.request.width_px)
            }
            Next::GoOn(_) | Next::Nothing | Next::End => None,
        }
    }

    /// Answers with what was taken last.
    fn finish(&self) {
        self.queue.finish(self.job.get(), &picture());
        self.queue.end_turn();
    }

    fn is_wanted(&self) -> bool {
        self.queue.is_wanted(self.job.get())
    }

    fn ask_by(&self, flow: &Flow, size_px: (u32, u32)) -> Result<Answer, EngineError> {
        let (reply, answer) = oneshot::channel();
        let request = ViewRequest { height_px: size_px.1, ..request(size_px.0) };
        self.queue.push(request, flow.clone(), reply).map(|()| answer)
    }

    /// Draws a small picture in 20 ms, or one of so many pieces of a large one in 300 ms; the width of which. None where nothing waits.
    fn turn(&self, drawn: &mut HashMap<u64, (u32, u32)>, n_pieces: u32) -> Option<u32> {
        let (id, width) = match self.queue.next(Duration::ZERO) {
            Next::Picture(job) => {
                drawn.insert(job.id.0, (job.request.width_px, 0));
                (job.id, job.request.width_px)
            }
            Next::GoOn(id) => (id, drawn[&id.0].0),
            Next::Nothing | Next::End => return None,
        };
        let is_large = width >= LARGE.0;
        self.clock.advance(Duration::from_millis(if is_large { 300 } else { 20 }));
        let n_drawn = &mut drawn.get_mut(&id.0).expect("begun").1;
        *n_drawn += 1;
        if is_large && *n_drawn < n_pieces {
            self.queue.pause(id, Duration::from_millis(300) * (n_pieces - *n_drawn));
        } else {
            self.queue.finish(id, &picture());
        }
        self.queue.end_turn();
        Some(width)
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

fn answer_of(answer: &mut Answer) -> Option<Result<ViewAnswer, EngineError>> {
    answer.try_recv().ok()
}

#[test]
fn pictures_are_drawn_in_the_order_in_which_they_were_first_asked_for() {
    let bench = Bench::new();
    let _answers = [2, 1, 2, 3, 1].map(|width| bench.ask(width));
    assert_eq!(bench.metrics.render_queue_length.get(), 3);
    for expected in [2, 1, 3] {
        assert_eq!(bench.next(), Some(expected));
        bench.finish();
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
    // The picture in hand is of an earlier moment: the next one is another picture.
    let mut later = bench.ask(7);
    bench.finish();
    let origins: Vec<Origin> = answers
        .iter_mut()
        .map(|answer| {
            let answer = answer_of(answer).expect("answered").expect("a picture");
            assert_eq!(answer.timings[0], ("wait", Duration::from_secs(2)));
            answer.origin
        })
        .collect();
    assert_eq!(origins[0], Origin::Drawn);
    assert!(origins[1..].iter().all(|origin| *origin == Origin::Shared));
    assert_eq!(bench.metrics.render_shared.get(), 14);
    assert!(answer_of(&mut later).is_none());
    // Unless it turns out to be the same.
    let waiting = bench.queue.waiting();
    assert_eq!(waiting.len(), 1);
    bench.queue.take_along(bench.job.get(), &[waiting[0].0]);
    bench.finish();
    assert!(answer_of(&mut later).is_some_and(|answer| answer.is_ok()));
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
    // A caller who joins a waiting picture needs no room; one who left makes some.
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
    assert!(bench.is_wanted());
    bench.pass(3);
    // The first one's time is up while it is drawn; another waits for the same picture.
    assert!(bench.is_wanted());
    let late = answer_of(&mut first).expect("refused").expect_err("late");
    assert!(matches!(late, EngineError::Late { stage: LateStage::Drawing, .. }), "{late}");
    assert_eq!(late.to_string(), "no picture within 8.0 s: it is still being drawn");
    assert!(late.retry_after().is_some_and(|after| after > Duration::ZERO));
    assert!(answer_of(&mut same).is_none() && answer_of(&mut second).is_none());
    bench.pass(5);
    assert!(!bench.is_wanted(), "a drawing for nobody may stop");
    assert!(answer_of(&mut same).is_some_and(|answer| answer.is_err()));
    let late = answer_of(&mut second).expect("refused").expect_err("late");
    assert!(matches!(late, EngineError::Late { stage: LateStage::Waiting, .. }), "{late}");
    assert_eq!((bench.next(), bench.n_refused(ViewRefusal::Late)), (None, 3));
    bench.finish();
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
        bench
            .queue
            .push(ViewRequest { effort, ..request(width_px) }, Flow::Common, reply)
            .expect("there is room");
        answer
    };
    let (mut first, mut second) = (ask(1), ask(2));
    assert_eq!(bench.next(), Some(1));
    bench.pass(3);
    assert!(bench.is_wanted(), "what has begun is waited for");
    let late = second.try_recv().expect("it is answered").expect_err("its time is up");
    assert!(matches!(late, EngineError::Late { stage: LateStage::Waiting, .. }), "{late}");
    assert!(first.try_recv().is_err(), "not yet");
    bench.pass(5);
    assert!(!bench.is_wanted());
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
    assert!(!bench.is_wanted());
    assert_eq!((bench.next(), bench.metrics.render_abandoned.get()), (Some(3), 2));
}

#[test]
fn a_closed_queue_takes_nothing_and_what_waits_is_still_drawn() {
    let bench = Bench::new();
    let mut answer = bench.ask(1);
    bench.queue.close();
    assert!(matches!(bench.try_ask(1), Err(EngineError::Unavailable(_))));
    assert_eq!(bench.next(), Some(1));
    bench.finish();
    assert!(answer_of(&mut answer).is_some_and(|answer| answer.is_ok()));
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
    assert!(answer_of(&mut one).is_some_and(|answer| answer.is_err()));
    assert!(answer_of(&mut two).is_some_and(|answer| answer.is_err()));
}

/// One user asks for large pictures again and again; another's small one waited for all of them.
#[test]
fn a_users_small_picture_waits_for_one_piece_of_anothers_large_ones() {
    let bench = Bench::with_length(32);
    let (greedy, owner) = (user("greedy"), user("owner"));
    let mut drawn = HashMap::new();
    let mut wide = LARGE.0;
    let mut asked = Vec::new();
    let mut ask_large = || {
        wide += 1;
        bench.ask_by(&greedy, (wide, LARGE.1)).expect("there is room")
    };
    (0..6).for_each(|_| asked.push(ask_large()));
    for idx in 0..20_u32 {
        // Something is begun, and then the owner asks.
        assert!(bench.turn(&mut drawn, 5).is_some_and(|width| width >= LARGE.0));
        let mut answer = bench.ask_by(&owner, (SMALL.0 + idx, SMALL.1)).expect("there is room");
        assert_eq!(bench.turn(&mut drawn, 5), Some(SMALL.0 + idx), "the next turn of all");
        assert!(answer_of(&mut answer).is_some_and(|answer| answer.is_ok()));
        asked.retain_mut(|answer| answer_of(answer).is_none());
        while asked.len() < 6 {
            asked.push(ask_large());
        }
    }
}

#[test]
fn users_with_much_to_draw_get_equal_time() {
    let bench = Bench::with_length(32);
    let mut drawn = HashMap::new();
    let [one, many] = [user("one"), user("many")];
    let mut n_turns = [0_u32; 2];
    let mut asked = Vec::new();
    for idx in 0..200 {
        asked.retain_mut(|answer: &mut (u32, Answer)| answer_of(&mut answer.1).is_none());
        // One picture at a time, and eight.
        for (flow, most, from) in [(&one, 1, 0), (&many, 8, 1)] {
            while asked.iter().filter(|(of, _)| *of == from).count() < most {
                let wide = LARGE.0 + 2 * (idx + asked.len() as u32) + from;
                let Ok(answer) = bench.ask_by(flow, (wide, LARGE.1)) else { break };
                asked.push((from, answer));
            }
        }
        let width = bench.turn(&mut drawn, 4).expect("something waits");
        n_turns[(width % 2) as usize] += 1;
    }
    assert!(n_turns[0].abs_diff(n_turns[1]) <= 3, "{n_turns:?}");
}

/// Without users nothing tells callers apart.
#[test]
fn small_pictures_wait_for_one_piece_of_large_ones_of_whoever_it_is() {
    let bench = Bench::with_length(32);
    let mut drawn = HashMap::new();
    let _large: Vec<_> = (0..4).map(|idx| bench.ask_by(&Flow::Common, (LARGE.0 + idx, LARGE.1))).collect();
    bench.turn(&mut drawn, 5);
    let _small = [bench.ask(1), bench.ask(2)];
    let turns: Vec<u32> = (0..4).map_while(|_| bench.turn(&mut drawn, 5)).collect();
    assert_eq!(turns[..2], [1, 2], "{turns:?}");
    assert!(turns[2..].iter().all(|width| *width == LARGE.0), "one large one at a time: {turns:?}");
}

#[test]
fn a_user_gets_a_share_of_the_places_and_of_the_bytes_and_is_told_so() {
    let bench = Bench::with_length(8);
    let (greedy, other) = (user("greedy"), user("other"));
    let held: Vec<Answer> = (1..=20).map_while(|wide| bench.ask_by(&greedy, (wide, 9)).ok()).collect();
    assert_eq!(held.len(), 6, "three for each that is free");
    let refused = bench.ask_by(&greedy, (99, 9)).expect_err("it is over");
    assert!(matches!(refused, EngineError::OverShare { waiting: 6, .. }), "{refused}");
    let _own = bench.ask_by(&greedy, (3, 9)).expect("who joins what waits needs no room");
    let _other = bench.ask_by(&other, (99, 9)).expect("there is room for others");
    let refused_of = |reason| bench.n_refused(reason);
    assert_eq!((refused_of(ViewRefusal::UserShare), refused_of(ViewRefusal::QueueFull)), (2, 0));
    // A caller who leaves gives the place back.
    drop(held);
    bench.ask_by(&greedy, (100, 9)).expect("there is room again");

    let bench = Bench::with_length(1024);
    let large = |flow: &Flow, idx: u32| bench.ask_by(flow, (6000 + idx, 5000));
    let held: Vec<Answer> = (0..30).map_while(|idx| large(&greedy, idx).ok()).collect();
    // 90 MB each, of a gibibyte.
    assert_eq!(held.len(), 8);
    assert!(matches!(large(&greedy, 99), Err(EngineError::OverShare { waiting: 8, .. })));
    assert_eq!(bench.n_refused(ViewRefusal::UserBytes), 2);
    let more: Vec<Answer> = (40..70).map_while(|idx| large(&other, idx).ok()).collect();
    assert!((1..3).contains(&more.len()), "{}", more.len());
    bench.ask_by(&user("third"), SMALL).expect("small ones find room");
}

#[test]
fn who_waits_for_what_another_user_waits_for_too_waits_for_no_more_of_theirs() {
    let bench = Bench::with_length(32);
    let mut drawn = HashMap::new();
    let (greedy, owner) = (user("greedy"), user("owner"));
    let _all: Vec<_> = (0..6).map(|idx| bench.ask_by(&greedy, (LARGE.0 + idx, LARGE.1))).collect();
    bench.turn(&mut drawn, 5);
    let mut same = bench.ask_by(&owner, (LARGE.0 + 5, LARGE.1)).expect("there is room");
    let mut turns = 0;
    while answer_of(&mut same).is_none() {
        assert!(bench.turn(&mut drawn, 5).is_some());
        turns += 1;
    }
    assert!(turns <= 10, "{turns} turns, five of which are another's");
}

#[test]
fn a_picture_that_everybody_left_has_no_turn_any_more() {
    let bench = Bench::with_length(32);
    let mut drawn = HashMap::new();
    let large = bench.ask_by(&user("a"), LARGE).expect("there is room");
    let _other = bench.ask_by(&user("b"), (LARGE.0 + 1, LARGE.1)).expect("there is room");
    let turns: Vec<_> = (0..4).map(|_| bench.turn(&mut drawn, 5)).collect();
    assert!(turns.contains(&Some(LARGE.0)) && turns.contains(&Some(LARGE.0 + 1)), "{turns:?}");
    drop(large);
    let turns: Vec<_> = (0..5).map_while(|_| bench.turn(&mut drawn, 5)).collect();
    assert!(!turns.is_empty() && turns.iter().all(|width| *width == LARGE.0 + 1), "{turns:?}");
    assert_eq!(bench.metrics.render_abandoned.get(), 1);
}

#[test]
fn what_others_wait_for_is_part_of_what_is_told() {
    let bench = Bench::with_length(32);
    for _ in 0..40 {
        bench.queue.note_drawn(Duration::from_secs(1));
    }
    let (greedy, owner) = (user("greedy"), user("owner"));
    let _all: Vec<_> = (0..6).map(|idx| bench.ask_by(&greedy, (9 + idx, 9))).collect();
    let secs = |flow: &Flow| bench.queue.retry_after(flow).as_secs();
    // One of theirs at most, however many wait.
    assert_eq!((secs(&greedy), secs(&owner)), (6, 1));
    let _own = [bench.ask_by(&owner, (1, 9)), bench.ask_by(&owner, (2, 9))];
    assert_eq!(secs(&owner), 2 + 3);
    // A picture of several pieces has half of the time, or what is left when the others are done.
    let share = |secs| bench.queue.share_of(&owner, Duration::from_secs(secs)).as_secs();
    assert_eq!((share(4), share(20)), (2, 14));
}

#[test]
fn one_picture_may_be_larger_than_the_queue_and_no_second_one_beside_it() {
    let (width, height) = (20_000, 18_000);
    assert!(request_bytes(&ViewRequest { height_px: height, ..request(width) }) > MAX_BYTES);
    for flow in [Flow::Common, user("only")] {
        let bench = Bench::with_length(1024);
        let first = bench.ask_by(&flow, (width, height)).expect("nothing else waits");
        assert!(bench.ask_by(&flow, SMALL).is_err() && bench.ask_by(&user("other"), SMALL).is_err());
        assert_eq!(bench.n_refused(ViewRefusal::QueueBytes), 2);
        drop(first);
        // Together no more than that, also of callers whom nothing tells apart.
        let held: Vec<Answer> =
            (0..30).map_while(|idx| bench.ask_by(&Flow::Common, (6000 + idx, 5000)).ok()).collect();
        assert_eq!(held.len(), 11, "90 MB each, of a gibibyte");
    }
    // Whoever holds nothing gets a place for one that leaves less free than a share asks for.
    let bench = Bench::with_length(1024);
    let _large = bench.ask_by(&user("greedy"), (18_000, 17_000)).expect("nothing else waits");
}

#[test]
fn pieces_of_four_pictures_at_most_are_drawn_at_once() {
    let bench = Bench::with_length(64);
    let mut drawn = HashMap::new();
    let users: Vec<Flow> = (0..8).map(|idx| user(&format!("user{idx}"))).collect();
    // One piece of each would be drawn in turn.
    let size = |idx: u32| (LARGE.0 + idx, 1000);
    let _asked: Vec<Answer> =
        (0..8).map(|idx| bench.ask_by(&users[idx as usize], size(idx)).expect("there is room")).collect();
    let turns: Vec<u32> = (0..16).map_while(|_| bench.turn(&mut drawn, 4)).collect();
    assert_eq!(turns.len(), 16);
    let begun: std::collections::HashSet<u32> = turns.iter().copied().collect();
    assert_eq!(begun.len(), 4, "the others wait until one is finished: {turns:?}");
}

#[test]
fn what_a_caller_waited_before_the_queue_counts() {
    let bench = Bench::new();
    bench.pass(10);
    let (reply, mut answer) = oneshot::channel();
    let since = Some(bench.clock.monotonic().saturating_sub(Duration::from_secs(6)));
    bench.queue.push(request(1), Asking { flow: Flow::Common, since }, reply).expect("there is room");
    let _later = bench.ask(2);
    bench.pass(3);
    assert_eq!(bench.next(), Some(2), "the one that is late is refused");
    bench.finish();
    let late = answer_of(&mut answer).expect("it waited for 9 s").expect_err("late");
    assert!(matches!(late, EngineError::Late { stage: LateStage::Waiting, .. }), "{late}");
    // A moment still to come is none.
    let (reply, mut answer) = oneshot::channel();
    let since = Some(bench.clock.monotonic() + Duration::from_secs(60));
    bench.queue.push(request(3), Asking { flow: Flow::Common, since }, reply).expect("there is room");
    bench.pass(9);
    assert_eq!(bench.next(), None);
    assert!(answer_of(&mut answer).is_some());
}
