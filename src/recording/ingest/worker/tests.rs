//! A camera's thread over scripted sources and a clock that stands still until it is moved.

use super::*;
use crate::media::EncodedFormat;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use videofields_vision::clock::SimulatedClock;
use videofields_vision::config::SourceSettings;
use videofields_vision::frame::{ColorMatrix, ColorRange, YuvImage};

const FRAME_NANOS: i64 = 40_000_000;

#[derive(Clone, Debug, PartialEq)]
enum Event {
    Frame { number: u64, nanos: i64, at: Duration },
    Tick(Duration),
    Miss,
    Damaged(u64),
    Finish,
    Encoded(i64),
}

/// Tells what it was called with; each frame takes `cost` of the clock.
struct Recorder {
    clock: Arc<SimulatedClock>,
    events: Arc<Mutex<Vec<Event>>>,
    cost: Duration,
    prepare_cost: Duration,
    panics_at: Option<u64>,
    tap: Tap,
    has_room: Arc<AtomicBool>,
}

impl FrameConsumer for Recorder {
    fn prepare(&mut self, first: &YuvImage) {
        assert_eq!((first.width(), first.height()), (4, 2));
        self.clock.advance(self.prepare_cost);
    }

    fn has_room(&self) -> bool {
        self.has_room.load(Ordering::Relaxed)
    }

    fn consume(&mut self, frame: Frame) {
        assert_ne!(Some(frame.number), self.panics_at, "told to panic");
        let (number, nanos) = (frame.number, frame.timestamp.as_nanos());
        let at = self.clock.monotonic();
        self.events.lock().unwrap().push(Event::Frame { number, nanos, at });
        self.clock.advance(self.cost);
    }

    fn tick(&mut self) {
        self.events.lock().unwrap().push(Event::Tick(self.clock.monotonic()));
    }

    fn miss(&mut self, reason: DropReason, n: u64) {
        self.events.lock().unwrap().push(match (reason, n) {
            (DropReason::Overrun, 1) => Event::Miss,
            (DropReason::Damaged, n) => Event::Damaged(n),
            other => panic!("{other:?}"),
        });
    }

    fn tap(&self) -> Tap {
        self.tap
    }

    fn record(&mut self, frame: &EncodedFrame, time: Timestamp) {
        self.events.lock().unwrap().push(Event::Encoded(time.as_nanos()));
        assert_eq!(frame.format.codec(), "image/jpeg");
    }

    fn finish(&mut self) {
        self.events.lock().unwrap().push(Event::Finish);
    }
}

/// `n` frames of 25 fps, each of which takes `cost` to decode, then the end or a failure.
struct Scripted {
    clock: Arc<SimulatedClock>,
    n: u64,
    next: u64,
    cost: Duration,
    fails: bool,
    encoded: Vec<EncodedFrame>,
    /// After how many frames each one that is damaged comes; none does with 0.
    damaged_every: u64,
}

impl Source for Scripted {
    fn lost(&self) -> Lost {
        Lost { n_damaged: self.next.checked_div(self.damaged_every).unwrap_or(0), n_replaced: 0 }
    }

    fn take_encoded(&mut self) -> Option<EncodedFrame> {
        (!self.encoded.is_empty()).then(|| self.encoded.remove(0))
    }

    fn next_frame(&mut self) -> Result<Option<SourceFrame>, IngestError> {
        self.clock.advance(self.cost);
        if self.next == self.n {
            let failure = IngestError::Damaged { path: "a.avi".into(), detail: "noise".to_owned() };
            return if self.fails { Err(failure) } else { Ok(None) };
        }
        let number = self.next;
        self.next += 1;
        let format = Arc::new(EncodedFormat::named("image/jpeg"));
        self.encoded.push(EncodedFrame::blank(format, Some(number as i64 * FRAME_NANOS), None));
        let image = YuvImage::filled(4, 2, [1, 128, 128], ColorMatrix::Bt601, ColorRange::Full);
        Ok(Some(SourceFrame {
            image: Arc::new(image),
            stream_nanos: number as i64 * FRAME_NANOS,
            number,
            reference: None,
        }))
    }
}

struct Bench {
    clock: Arc<SimulatedClock>,
    events: Arc<Mutex<Vec<Event>>>,
    consume_cost: Duration,
    decode_cost: Duration,
    panics_at: Option<u64>,
    end: End,
    tap: Tap,
    own_clock: ClockSettings,
    corrected: Corrected,
    start: Option<Timestamp>,
    pace: Pace,
    /// Those with whom it begins; nobody else if absent.
    together: Option<Together>,
    /// Time that getting ready takes.
    prepare_cost: Duration,
    has_room: Arc<AtomicBool>,
    damaged_every: u64,
}

impl Bench {
    fn begins_now(&self) -> (Timestamp, Duration) {
        (self.clock.now(), self.clock.monotonic())
    }

    fn new() -> Self {
        let clock = Arc::new(SimulatedClock::new(Timestamp::from_nanos(77)));
        let (consume_cost, decode_cost) = (Duration::ZERO, Duration::ZERO);
        Self {
            clock,
            events: Arc::default(),
            consume_cost,
            decode_cost,
            panics_at: None,
            end: End::Loop,
            tap: Tap::Closed,
            own_clock: ClockSettings::default(),
            corrected: Corrected::StreamTime,
            start: Some(Timestamp::from_nanos(1_000)),
            pace: Pace::RealTime,
            together: None,
            prepare_cost: Duration::ZERO,
            has_room: Arc::new(AtomicBool::new(true)),
            damaged_every: 0,
        }
    }

    /// Runs sources of these lengths one after the other; all but the last fail at their end.
    fn spawn(&self, lengths: &'static [u64]) -> CameraWorker {
        let (clock, cost) = (Arc::clone(&self.clock), self.decode_cost);
        let recorder = Recorder {
            clock: Arc::clone(&clock),
            events: Arc::clone(&self.events),
            cost: self.consume_cost,
            prepare_cost: self.prepare_cost,
            panics_at: self.panics_at,
            tap: self.tap,
            has_room: Arc::clone(&self.has_room),
        };
        let (mut n_opened, damaged_every) = (0, self.damaged_every);
        let sources = Arc::clone(&clock);
        let open = move |_stop: &StopFlag| {
            n_opened += 1;
            let (n, fails) = (lengths[n_opened - 1], n_opened < lengths.len());
            Ok(Box::new(Scripted {
                clock: Arc::clone(&sources),
                n,
                next: 0,
                cost,
                fails,
                encoded: Vec::new(),
                damaged_every,
            }) as Box<dyn Source>)
        };
        let id = CameraId::new("gate").unwrap();
        let start = Start {
            scene: self.start,
            together: self.together.clone().unwrap_or_else(|| self.begins_now().into()),
            pace: Some(self.pace),
            clock: SharedClock(Arc::new(Mutex::new(self.own_clock))),
            corrected: self.corrected,
            status: None,
        };
        let kind = (self.end, Duration::from_secs(5));
        CameraWorker::spawn_with(id, (open, None), kind, clock, start, Box::new(recorder)).unwrap()
    }

    fn run(&self, lengths: &'static [u64]) -> (Vec<Event>, CameraStatus) {
        let worker = self.spawn(lengths);
        while !worker.is_finished() {
            std::thread::yield_now();
        }
        (self.events.lock().unwrap().clone(), worker.status())
    }
}

fn numbers(events: &[Event]) -> Vec<u64> {
    let number = |event: &Event| match event {
        Event::Frame { number, .. } => Some(*number),
        _ => None,
    };
    events.iter().filter_map(number).collect()
}

#[test]
fn encoded_frames_have_the_times_of_their_pictures_also_of_those_left_out() {
    // Decoding is slower than real time, and the second source begins where real time stands.
    let decode_cost = Duration::from_millis(70);
    let (events, status) = Bench { tap: Tap::Open, decode_cost, ..Bench::new() }.run(&[40, 20]);
    let shown: Vec<i64> = events
        .iter()
        .filter_map(|event| if let Event::Frame { nanos, .. } = event { Some(*nanos) } else { None })
        .collect();
    let encoded: Vec<i64> = events
        .iter()
        .filter_map(|event| if let Event::Encoded(nanos) = event { Some(*nanos) } else { None })
        .collect();
    assert!(status.dropped > 5, "{status:?}");
    assert_eq!(encoded.len(), 60);
    assert!(encoded.is_sorted_by(|a, b| a < b));
    assert!(shown.iter().all(|nanos| encoded.contains(nanos)));
    // What recordings hold is whole ticks.
    assert!(encoded.iter().all(|nanos| nanos % TICK_NANOS == 0));
    assert!(Bench::new().run(&[3]).0.iter().all(|event| !matches!(event, Event::Encoded(_))));
}

#[test]
fn frames_come_in_real_time_with_scene_time_from_the_start() {
    let (events, status) = Bench::new().run(&[60]);
    assert_eq!(numbers(&events), (0..60).collect::<Vec<_>>());
    for event in &events {
        if let Event::Frame { number, nanos, at } = event {
            assert_eq!(*nanos, 1_000 + *number as i64 * FRAME_NANOS);
            assert_eq!(*at, Duration::from_millis(40 * number));
        }
    }
    assert_eq!(events.last(), Some(&Event::Finish));
    let ticks = events.iter().filter(|event| matches!(event, Event::Tick(_))).count();
    assert_eq!(ticks, 2, "2.4 s have two ticks");
    assert_eq!((status.state, status.reason, status.dropped), (CameraState::Ended, None, 0));
    assert_eq!((status.frames, status.size), (60, Some((4, 2))));
    assert_eq!(status.last_timestamp, Some(Timestamp::from_nanos(1_000 + 59 * FRAME_NANOS)));
}

#[test]
fn a_slow_consumer_loses_frames_but_not_the_present() {
    let bench = Bench { consume_cost: Duration::from_millis(100), ..Bench::new() };
    let (events, status) = bench.run(&[500]);
    assert_eq!(status.frames + status.dropped, 500);
    assert!(status.dropped > 250, "{status:?}");
    let n_missed = events.iter().filter(|event| **event == Event::Miss).count();
    assert_eq!(n_missed as u64, status.dropped);
    for event in &events {
        if let Event::Frame { number, at, .. } = event {
            let late = at.saturating_sub(Duration::from_millis(40 * number));
            assert!(late <= Duration::from_millis(250), "frame {number} came {late:?} late");
        }
    }
}

#[test]
fn a_decoder_slower_than_real_time_still_gives_a_frame_a_second() {
    let bench = Bench { decode_cost: Duration::from_millis(100), ..Bench::new() };
    let (events, status) = bench.run(&[200]);
    assert_eq!(status.frames + status.dropped, 200);
    let times: Vec<Duration> = events
        .iter()
        .filter_map(|e| if let Event::Frame { at, .. } = e { Some(*at) } else { None })
        .collect();
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] <= Duration::from_millis(1_100)), "{times:?}");
}

#[test]
fn a_failed_source_is_opened_again_and_time_runs_on() {
    let (events, status) = Bench::new().run(&[10, 0, 10]);
    assert_eq!(numbers(&events), (0..20).collect::<Vec<_>>());
    let frames: Vec<(i64, Duration)> = events
        .iter()
        .filter_map(
            |event| if let Event::Frame { nanos, at, .. } = event { Some((*nanos, *at)) } else { None },
        )
        .collect();
    assert!(frames.windows(2).all(|pair| pair[0].0 < pair[1].0));
    let pause = frames[10].1 - frames[9].1;
    assert!(
        pause >= Duration::from_secs(3) && pause <= Duration::from_secs(7),
        "1..2 s and 2..4 s: {pause:?}"
    );
    assert_eq!(frames[10].0 - frames[9].0, i64::try_from(pause.as_nanos()).unwrap());
    assert_eq!((status.state, status.reason), (CameraState::Ended, None));
    assert!(events.iter().any(|event| matches!(event, Event::Tick(_))), "waiting cameras tick");
}

#[test]
fn a_recording_that_ends_in_damage_is_not_played_again() {
    let (events, status) = Bench { end: End::Stop, ..Bench::new() }.run(&[10, 10]);
    assert_eq!(numbers(&events), (0..10).collect::<Vec<_>>());
    assert_eq!(events.last(), Some(&Event::Finish));
    assert_eq!(status.state, CameraState::Failed);
    assert!(status.reason.as_deref().unwrap_or("").contains("noise"), "{status:?}");
}

#[test]
fn a_panic_of_the_consumer_becomes_a_failed_camera() {
    let bench = Bench { panics_at: Some(3), ..Bench::new() };
    let (events, status) = bench.run(&[10]);
    assert_eq!(numbers(&events), [0, 1, 2]);
    assert_eq!(status.state, CameraState::Failed);
    assert!(status.reason.as_deref().unwrap_or("").contains("told to panic"), "{status:?}");
    assert!(!events.contains(&Event::Finish));
}

#[test]
fn a_stopped_camera_finishes_its_consumer() {
    let bench = Bench::new();
    let worker = bench.spawn(&[u64::MAX]);
    while worker.status().frames < 5 {
        std::thread::yield_now();
    }
    worker.stop();
    assert_eq!(bench.events.lock().unwrap().last(), Some(&Event::Finish));
}

#[test]
fn retries_wait_1_to_30_seconds_and_differ() {
    for (n_failures, longest_ms) in [(0, 2_000), (1, 4_000), (3, 16_000), (4, 30_000), (u32::MAX, 30_000)] {
        let delays = [0, 1, 12_345, u64::MAX].map(|entropy| retry_delay(n_failures, entropy).as_millis());
        assert!(delays.iter().all(|ms| (longest_ms / 2..=longest_ms).contains(ms)), "{delays:?}");
        assert_ne!(delays[0], delays[2]);
    }
}

/// Scene times after the beginning, and when they came.
fn shown(events: &[Event]) -> Vec<(i64, i64)> {
    let shown = |event: &Event| match event {
        Event::Frame { nanos, at, .. } => Some((*nanos - 1_000, i64::try_from(at.as_nanos()).unwrap())),
        _ => None,
    };
    events.iter().filter_map(shown).collect()
}

#[test]
fn a_clip_that_began_sooner_leaves_out_what_the_others_did_not_see() {
    let own_clock = ClockSettings { offset_secs: -0.1, ..ClockSettings::default() };
    let bench = Bench { own_clock, ..Bench::new() };
    let began = bench.clock.monotonic().as_nanos() as i64;
    let (events, _) = bench.run(&[5]);
    assert_eq!(numbers(&events), [3, 4]);
    let due = [20_000_000, 60_000_000];
    assert_eq!(
        shown(&events),
        due.map(|nanos| (nanos, began + nanos)),
        "when the others show the same instant"
    );
    let (events, _) = Bench { own_clock, tap: Tap::Open, ..Bench::new() }.run(&[5]);
    let encoded = |event: &Event| if let Event::Encoded(nanos) = event { Some(*nanos) } else { None };
    assert_eq!(events.iter().filter_map(encoded).collect::<Vec<_>>(), due, "in whole ticks");
}

#[test]
fn a_clip_that_began_later_waits_and_one_that_drifts_is_stretched() {
    let own_clock = ClockSettings { offset_secs: 2.0, drift_ppm: 50_000.0, since: None };
    let bench = Bench { own_clock, ..Bench::new() };
    let began = bench.clock.monotonic().as_nanos() as i64;
    let (events, _) = bench.run(&[3]);
    let due = [2_000_000_000, 2_042_000_000, 2_084_000_000];
    assert_eq!(shown(&events), due.map(|nanos| (nanos, began + nanos)));
}

#[test]
fn what_begins_at_an_instant_of_its_own_is_played_at_once_and_bears_another_time() {
    let own_clock = ClockSettings { offset_secs: -3600.0, ..ClockSettings::default() };
    let corrected = Corrected::SceneTime { since: Timestamp::from_nanos(1_000) };
    let bench = Bench { own_clock, corrected, ..Bench::new() };
    let began = bench.clock.monotonic().as_nanos() as i64;
    let (events, _) = bench.run(&[2]);
    let hour = 3_600_000_000_000;
    assert_eq!(shown(&events), [0, FRAME_NANOS].map(|nanos| (nanos - hour, began + nanos)));
}

#[test]
fn a_refused_login_is_tried_again_when_it_changes_or_after_ten_minutes() {
    let folder = tempfile::tempdir().unwrap();
    let password_file = folder.path().join("password");
    std::fs::write(&password_file, "wrong").unwrap();
    let clock = Arc::new(SimulatedClock::new(Timestamp::from_nanos(77)));
    let bench = Bench { clock: Arc::clone(&clock), ..Bench::new() };
    let source = SourceSettings {
        user: Some("guard".to_owned()),
        password_file: Some(password_file.clone()),
        ..SourceSettings::default()
    };
    let tried: Arc<Mutex<Vec<Duration>>> = Arc::default();
    let (tries, opened) = (Arc::clone(&tried), Arc::clone(&clock));
    let open = move |_stop: &StopFlag| {
        let mut tries = tries.lock().unwrap();
        tries.push(opened.monotonic());
        if tries.len() == 3 {
            // Somebody changes it while it is tried.
            std::fs::write(&password_file, "right").unwrap();
        }
        if tries.len() == 4 {
            let (clock, cost) = (Arc::clone(&opened), Duration::ZERO);
            let source =
                Scripted { clock, n: 1, next: 0, cost, fails: false, encoded: Vec::new(), damaged_every: 0 };
            return Ok(Box::new(source) as Box<dyn Source>);
        }
        let (place, fault) = ("rtsp://cam:554".to_owned(), crate::media::ConnectionFault::LoginRefused);
        Err(super::super::CameraError::Connection { place, fault }.into())
    };
    let recorder = Recorder {
        clock: Arc::clone(&clock),
        events: Arc::clone(&bench.events),
        cost: Duration::ZERO,
        prepare_cost: Duration::ZERO,
        panics_at: None,
        tap: Tap::Closed,
        has_room: Arc::clone(&bench.has_room),
    };
    let start = Start {
        scene: bench.start,
        together: bench.begins_now().into(),
        pace: None,
        clock: SharedClock::default(),
        corrected: Corrected::default(),
        status: None,
    };
    let login = LoginWatch::of(&source, &MediaRoots::new(&[]).unwrap());
    let (id, kind) = (CameraId::new("gate").unwrap(), (End::Loop, Duration::from_secs(5)));
    let worker = CameraWorker::spawn_with(id, (open, login), kind, clock, start, Box::new(recorder)).unwrap();
    while !worker.is_finished() {
        std::thread::yield_now();
    }
    let tried = tried.lock().unwrap();
    let pauses: Vec<u64> = tried.windows(2).map(|pair| (pair[1] - pair[0]).as_secs()).collect();
    assert_eq!(pauses, [600, 600, 0]);
    assert_eq!(worker.status().frames, 1);
}

#[test]
fn a_file_begins_when_its_camera_is_ready_and_loses_nothing_before() {
    let prepare_cost = Duration::from_secs(40);
    let bench = Bench { prepare_cost, start: None, ..Bench::new() };
    let (events, status) = bench.run(&[60]);
    assert_eq!(numbers(&events), (0..60).collect::<Vec<_>>());
    assert_eq!((status.frames, status.dropped), (60, 0));
    for event in &events {
        if let Event::Frame { number, nanos, at } = event {
            assert_eq!(*at, prepare_cost + Duration::from_millis(40 * number));
            // Without a start of its own it bears the time at which it is shown.
            assert_eq!(*nanos, 77 + i64::try_from(at.as_nanos()).unwrap());
        }
    }
}

#[test]
fn a_file_with_a_start_bears_its_own_time_whenever_it_begins() {
    let bench = Bench { prepare_cost: Duration::from_secs(40), ..Bench::new() };
    let first = bench.run(&[2]).0.into_iter().find(|event| matches!(event, Event::Frame { .. }));
    assert_eq!(first, Some(Event::Frame { number: 0, nanos: 1_000, at: bench.prepare_cost }));
}

#[test]
fn a_file_waits_for_those_that_begin_with_it() {
    let bench = Bench::new();
    let together = Together::from(bench.begins_now());
    // Somebody who never gets ready: it is waited for, but not for ever.
    let _learns = together.hold();
    let (events, status) = Bench { together: Some(together), ..bench }.run(&[10]);
    assert_eq!(status.dropped, 0);
    assert_eq!(shown(&events)[0], (0, 300_000_000_000));
}

#[test]
fn a_file_that_is_played_whole_loses_nothing_and_waits_for_no_clock() {
    for (consume_cost, decode_cost) in [(100, 0), (0, 100), (1, 1)] {
        let (consume_cost, decode_cost) =
            (Duration::from_millis(consume_cost), Duration::from_millis(decode_cost));
        let (events, status) =
            Bench { pace: Pace::All, consume_cost, decode_cost, ..Bench::new() }.run(&[500]);
        assert_eq!(numbers(&events), (0..500).collect::<Vec<_>>());
        assert_eq!((status.frames, status.dropped), (500, 0));
        let cost_nanos = (consume_cost + decode_cost).as_nanos() as i64;
        for (frame, (stream_nanos, at_nanos)) in
            shown(&events).into_iter().zip(0_i64..).map(|(of, n)| (n, of))
        {
            assert_eq!(stream_nanos, frame * FRAME_NANOS);
            assert_eq!(at_nanos, frame * cost_nanos + decode_cost.as_nanos() as i64);
        }
    }
}

#[test]
fn a_file_that_is_played_whole_goes_on_where_it_failed() {
    let bench = Bench { pace: Pace::All, tap: Tap::Open, ..Bench::new() };
    let (events, status) = bench.run(&[10, 4, 30]);
    assert_eq!(numbers(&events), (0..30).collect::<Vec<_>>());
    let encoded = events.iter().filter(|event| matches!(event, Event::Encoded(_))).count();
    assert_eq!((encoded, status.dropped), (30, 0));
}

#[test]
fn a_file_that_is_played_whole_waits_for_room_in_its_recording() {
    let bench = Bench { pace: Pace::All, ..Bench::new() };
    bench.has_room.store(false, Ordering::Relaxed);
    let worker = bench.spawn(&[5]);
    while bench.clock.monotonic() < Duration::from_secs(3) && !worker.is_finished() {
        std::thread::yield_now();
    }
    bench.has_room.store(true, Ordering::Relaxed);
    while !worker.is_finished() {
        std::thread::yield_now();
    }
    let events = bench.events.lock().unwrap();
    assert_eq!(numbers(&events), (0..5).collect::<Vec<_>>());
    assert!(shown(&events)[0].1 >= 3_000_000_000, "{:?}", shown(&events)[0]);
}

#[test]
fn damaged_pictures_of_a_file_are_counted_and_told_at_its_end() {
    let (events, status) = Bench { damaged_every: 7, end: End::Stop, ..Bench::new() }.run(&[30]);
    let n_damaged: u64 = events.iter().map(|event| if let Event::Damaged(n) = event { *n } else { 0 }).sum();
    assert_eq!((n_damaged, status.dropped, status.frames), (4, 4, 30));
    assert_eq!(status.state, CameraState::Ended);
    assert_eq!(status.reason.as_deref(), Some("4 of its pictures were damaged and are left out"));
}
