//! A camera's thread over scripted sources and a clock that stands still until it is moved.

use super::*;
use crate::media::EncodedFormat;
use std::sync::Mutex;
use videofields_vision::clock::SimulatedClock;
use videofields_vision::frame::{ColorMatrix, ColorRange, YuvImage};

const FRAME_NANOS: i64 = 40_000_000;

#[derive(Clone, Debug, PartialEq)]
enum Event {
    Frame { number: u64, nanos: i64, at: Duration },
    Tick(Duration),
    Miss,
    Finish,
    Encoded(i64),
}

/// Tells what it was called with; each frame takes `cost` of the clock.
struct Recorder {
    clock: Arc<SimulatedClock>,
    events: Arc<Mutex<Vec<Event>>>,
    cost: Duration,
    panics_at: Option<u64>,
    tap: Tap,
}

impl FrameConsumer for Recorder {
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
        assert_eq!((reason, n), (DropReason::Overrun, 1));
        self.events.lock().unwrap().push(Event::Miss);
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
}

impl Source for Scripted {
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
}

impl Bench {
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
        }
    }

    /// Runs sources of these lengths one after the other; all but the last fail at their end.
    fn spawn(&self, lengths: &'static [u64]) -> CameraWorker {
        let (clock, cost) = (Arc::clone(&self.clock), self.decode_cost);
        let recorder = Recorder {
            clock: Arc::clone(&clock),
            events: Arc::clone(&self.events),
            cost: self.consume_cost,
            panics_at: self.panics_at,
            tap: self.tap,
        };
        let mut n_opened = 0;
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
            }) as Box<dyn Source>)
        };
        let id = CameraId::new("gate").unwrap();
        let start = Start {
            scene: Timestamp::from_nanos(1_000),
            began: clock.monotonic(),
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
            let source = Scripted { clock, n: 1, next: 0, cost, fails: false, encoded: Vec::new() };
            return Ok(Box::new(source) as Box<dyn Source>);
        }
        let (place, fault) = ("rtsp://cam:554".to_owned(), crate::media::ConnectionFault::LoginRefused);
        Err(super::super::CameraError::Connection { place, fault }.into())
    };
    let recorder = Recorder {
        clock: Arc::clone(&clock),
        events: Arc::clone(&bench.events),
        cost: Duration::ZERO,
        panics_at: None,
        tap: Tap::Closed,
    };
    let login = LoginWatch::of(&source);
    let (id, kind) = (CameraId::new("gate").unwrap(), (End::Loop, Duration::from_secs(5)));
    let worker =
        CameraWorker::spawn_with(id, (open, login), kind, clock, Start::default(), Box::new(recorder))
            .unwrap();
    while !worker.is_finished() {
        std::thread::yield_now();
    }
    let tried = tried.lock().unwrap();
    let pauses: Vec<u64> = tried.windows(2).map(|pair| (pair[1] - pair[0]).as_secs()).collect();
    assert_eq!(pauses, [600, 600, 0]);
    assert_eq!(worker.status().frames, 1);
}
