//! One thread a camera: opens its source, paces the frames in real time, opens it again after a failure.
//!
//! In: a source and a clock. Out: frames of scene time to one consumer, and the camera's status. Scene time is the
//! configured start, or the daemon's, plus stream time; it never runs backwards, also when a source failed and
//! begins anew: then it goes on where real time stands. Live sources are not paced (`follow`).

mod follow;

use super::arrival::ArrivalClock;
use super::pacing::{Pacer, Turn};
use super::status::{CameraState, CameraStatus, Delivered, RateMeter, SharedStatus, StatusReader};
use super::{IngestError, MediaRoots, Source, SourceFrame, StopFlag, Tap, open_tapped};
use crate::clock::{Clock, Timestamp};
use crate::config::{End, SourceSettings};
use crate::frame::{CameraId, Frame};
use crate::media::{EncodedFrame, TICK_NANOS};
use crate::telemetry::DropReason;
use std::hash::BuildHasher;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

/// Longest sleep between two looks at the stop flag.
const SLICE: Duration = Duration::from_millis(100);

/// Least time between two ticks.
const TICK_INTERVAL: Duration = Duration::from_secs(1);

/// Time for which frames must have come before a failure counts as the first again.
const STEADY: Duration = Duration::from_secs(30);

/// What receives a camera's frames, on the camera's own thread. Slow consumers lose frames, never others' time.
pub trait FrameConsumer: Send {
    /// Takes the next frame; timestamps and numbers only grow.
    fn consume(&mut self, frame: Frame);

    /// Whether [`Self::record`] is to be called. Asked once, before the source is opened.
    fn tap(&self) -> Tap {
        Tap::Closed
    }

    /// Takes a frame as the camera encoded it, with the scene time of its picture, in decoding order; each comes about
    /// when its picture does, and also where its picture was left out.
    fn record(&mut self, _frame: &EncodedFrame, _time: Timestamp) {}

    /// What is wrong with the camera although its frames come; shown as its reason.
    fn concern(&self) -> Option<&str> {
        None
    }

    /// Whether the camera's picture is known not to change any more, although frames come.
    fn is_frozen(&self) -> bool {
        false
    }

    /// Called where `n` frames were left out.
    fn miss(&mut self, _reason: DropReason, _n: u64) {}

    /// Called about once a second between frames, also while the camera waits to try again; not while its source
    /// blocks, which lasts ten seconds at most. For checkpoints.
    fn tick(&mut self) {}

    /// Called once, after the last frame or when the camera is stopped; not after a panic of this consumer.
    fn finish(&mut self) {}
}

/// A camera at work. Dropping it stops it and waits for its thread.
#[derive(Debug)]
pub struct CameraWorker {
    id: CameraId,
    stop: StopFlag,
    status: SharedStatus,
    thread: Option<JoinHandle<()>>,
}

impl CameraWorker {
    /// Starts the camera `id`. Stream time 0 is monotonic time `began`, the same for cameras that belong together; its
    /// scene time is `settings.start`, or `origin` if there is none.
    ///
    /// # Errors
    /// When no thread can be started. Whatever is wrong with the source shows in the status.
    pub fn spawn(
        id: CameraId,
        settings: SourceSettings,
        roots: MediaRoots,
        clock: Arc<dyn Clock>,
        (origin, began): (Timestamp, Duration),
        consumer: Box<dyn FrameConsumer>,
    ) -> Result<Self, IngestError> {
        let start = Start { scene: settings.start.unwrap_or(origin), began };
        let (end, stall, tap) = (settings.end, settings.stall_secs, consumer.tap());
        let stall = Duration::try_from_secs_f64(stall).unwrap_or(Duration::from_secs(5));
        let open = move |stop: &StopFlag| open_tapped(&settings, &roots, stop, tap);
        Self::spawn_with(id, open, (end, stall), clock, start, consumer)
    }

    fn spawn_with(
        id: CameraId,
        open: impl FnMut(&StopFlag) -> Result<Box<dyn Source>, IngestError> + Send + 'static,
        (end, stall): (End, Duration),
        clock: Arc<dyn Clock>,
        start: Start,
        consumer: Box<dyn FrameConsumer>,
    ) -> Result<Self, IngestError> {
        let (stop, status) = (StopFlag::default(), SharedStatus::new(clock.now()));
        let camera = Camera {
            id: id.clone(),
            clock,
            scene_start: start.scene,
            end,
            stall,
            stop: stop.clone(),
            status: status.clone(),
            tap: consumer.tap(),
            consumer,
            pacer: Pacer::new(start.began),
            arrivals: ArrivalClock::default(),
            steady_since: None,
            rate: RateMeter::default(),
            ticked: None,
            next_number: 0,
        };
        let thread = std::thread::Builder::new()
            .name(format!("camera-{id}"))
            .spawn(move || camera.run_contained(open))
            .map_err(|source| IngestError::Thread { camera: id.clone(), source })?;
        Ok(Self { id, stop, status, thread: Some(thread) })
    }

    /// The camera.
    #[must_use]
    pub const fn id(&self) -> &CameraId {
        &self.id
    }

    /// How it is doing. Costs a short lock.
    #[must_use]
    pub fn status(&self) -> CameraStatus {
        self.status.read()
    }

    /// What reads the camera's status also where the worker is not at hand.
    #[must_use]
    pub fn status_reader(&self) -> StatusReader {
        self.status.reader()
    }

    /// Asks the camera to end and returns at once; it ends within half a second, or when its consumer returns.
    pub fn request_stop(&self) {
        self.stop.raise();
    }

    /// Whether its thread has ended: after the last frame, after a panic of its consumer, or once stopped.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Ends the camera and waits for it.
    pub fn stop(mut self) {
        self.join();
    }

    /// Asks the camera to end and does not wait for its thread: for one that hangs in a call that nothing ends.
    pub fn abandon(mut self) {
        self.stop.raise();
        drop(self.thread.take());
    }

    fn join(&mut self) {
        self.stop.raise();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!(camera = %self.id, "a camera's thread panicked outside its containment");
        }
    }
}

impl Drop for CameraWorker {
    fn drop(&mut self) {
        self.join();
    }
}

/// Where stream time 0 lies.
#[derive(Clone, Copy)]
struct Start {
    /// In scene time.
    scene: Timestamp,
    /// In monotonic time.
    began: Duration,
}

/// What lives on the camera's thread.
struct Camera {
    id: CameraId,
    clock: Arc<dyn Clock>,
    scene_start: Timestamp,
    end: End,
    /// Silence after which a live source is stalled.
    stall: Duration,
    stop: StopFlag,
    status: SharedStatus,
    tap: Tap,
    consumer: Box<dyn FrameConsumer>,
    pacer: Pacer,
    arrivals: ArrivalClock,
    /// Monotonic times of the first and the latest frame since the source was opened.
    steady_since: Option<(Duration, Duration)>,
    rate: RateMeter,
    ticked: Option<Duration>,
    next_number: u64,
}

impl Camera {
    fn run_contained(mut self, open: impl FnMut(&StopFlag) -> Result<Box<dyn Source>, IngestError>) {
        let _span = tracing::info_span!("camera", id = %self.id).entered();
        // After a panic the consumer is dropped and never called again, so nothing half-changed is looked at.
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| self.run(open))) {
            let text = panic_text(panic.as_ref());
            tracing::error!(panic = text, "processing of a camera panicked; the camera stays off");
            self.status.fail(format!("its processing panicked: {text}"), self.clock.now(), None);
        }
    }

    fn run(&mut self, mut open: impl FnMut(&StopFlag) -> Result<Box<dyn Source>, IngestError>) {
        let mut n_failures = 0;
        let mut last_state = CameraState::Ended;
        while !self.stop.is_raised() {
            self.status.set(CameraState::Connecting, self.clock.now());
            let (opened_at, number_before) = (self.clock.monotonic(), self.next_number);
            self.steady_since = None;
            let mut is_live = false;
            let outcome = open(&self.stop).and_then(|mut source| {
                is_live = source.is_live();
                if is_live { self.follow(source.as_mut()) } else { self.play(source.as_mut()) }
            });
            let Err(error) = outcome else { break };
            if self.stop.is_raised() {
                break;
            }
            if self.steady_since.is_some_and(|(first, latest)| latest.saturating_sub(first) >= STEADY) {
                n_failures = 0;
            }
            let lasted = self.clock.monotonic().saturating_sub(opened_at);
            if is_live && self.is_worth_haste(&error, lasted, self.next_number - number_before) {
                tracing::warn!(%error, "a camera's stream is connected anew at once");
                self.status.retry(error.to_string());
                continue;
            }
            // What was played cannot be played again as if it were new: a recording that ends in damage ends there.
            if !is_live && self.end == End::Stop && self.next_number > 0 && error.is_of_content() {
                tracing::error!(%error, "a camera's recording is damaged and ends here");
                self.status.fail(error.to_string(), self.clock.now(), None);
                last_state = CameraState::Failed;
                break;
            }
            let delay = retry_delay(n_failures, std::hash::RandomState::new().hash_one(n_failures));
            tracing::warn!(%error, retry_in = ?delay, "a camera's source failed");
            self.status.fail(error.to_string(), self.clock.now(), Some(delay));
            n_failures += 1;
            self.sleep_until(self.clock.monotonic().saturating_add(delay));
            self.status.retry(error.to_string());
        }
        self.consumer.finish();
        if last_state != CameraState::Failed {
            self.status.set(last_state, self.clock.now());
        }
    }

    /// Delivers frames until the source or the camera ends.
    fn play(&mut self, source: &mut dyn Source) -> Result<(), IngestError> {
        self.pacer.begin();
        let first_number = self.next_number;
        while let Some(frame) = source.next_frame()? {
            let due = self.pacer.due(self.clock.monotonic(), frame.stream_nanos);
            self.sleep_until(due);
            if self.stop.is_raised() {
                break;
            }
            self.hand_on_encoded(source, self.file_offset_nanos());
            self.next_number = first_number + frame.number + 1;
            match self.pacer.turn(self.clock.monotonic()) {
                Turn::Deliver => {
                    let timestamp = self.scene_start.saturating_add_nanos(self.pacer.stream_nanos());
                    let timestamp = self.scene_time(timestamp);
                    self.deliver(frame, timestamp, first_number);
                }
                Turn::Drop => {
                    self.status.count_dropped(1);
                    self.consumer.miss(DropReason::Overrun, 1);
                }
            }
            self.tick_if_due();
        }
        if !self.stop.is_raised() {
            self.hand_on_encoded(source, self.file_offset_nanos());
        }
        Ok(())
    }

    /// Hands on the encoded frames whose pictures came; `offset_nanos` is added to stream time.
    fn hand_on_encoded(&mut self, source: &mut dyn Source, offset_nanos: i64) {
        if self.tap == Tap::Closed {
            return;
        }
        while let Some(frame) = source.take_encoded() {
            let stream_nanos = frame.stream_nanos.unwrap_or(0);
            let time = self.scene_time(Timestamp::from_nanos(offset_nanos.saturating_add(stream_nanos)));
            self.consumer.record(&frame, time);
        }
    }

    /// What is added to a file's own stream time.
    fn file_offset_nanos(&self) -> i64 {
        self.scene_start.as_nanos().saturating_add(self.pacer.offset_nanos())
    }

    /// `time` as it is kept: of a camera that is recorded, in the unit that recordings hold, so that memory and recordings
    /// say the same.
    fn scene_time(&self, time: Timestamp) -> Timestamp {
        let nanos = time.as_nanos();
        Timestamp::from_nanos(match self.tap {
            Tap::Closed => nanos,
            Tap::Open => nanos - nanos.rem_euclid(TICK_NANOS),
        })
    }

    fn deliver(&mut self, frame: SourceFrame, timestamp: Timestamp, first_number: u64) {
        let size = (frame.image.width(), frame.image.height());
        self.consumer.consume(Frame {
            camera: self.id.clone(),
            timestamp,
            number: first_number + frame.number,
            image: frame.image,
        });
        let now = self.clock.monotonic();
        let fps = self.rate.count(now);
        self.steady_since = Some((self.steady_since.map_or(now, |(first, _)| first), now));
        let state = if self.consumer.is_frozen() { CameraState::Frozen } else { CameraState::Live };
        let delivered = Delivered { timestamp, monotonic: now, wall: self.clock.now(), size, fps, state };
        if self.status.count_frame(&delivered, self.consumer.concern()) {
            tracing::info!(width = size.0, height = size.1, "a camera is live");
        }
    }

    /// Sleeps until monotonic time `due` or until the camera is to stop; ticks meanwhile.
    fn sleep_until(&mut self, due: Duration) {
        while !self.stop.is_raised() {
            self.tick_if_due();
            let left = due.saturating_sub(self.clock.monotonic());
            if left.is_zero() {
                return;
            }
            self.clock.sleep(left.min(SLICE));
        }
    }

    fn tick_if_due(&mut self) {
        let now = self.clock.monotonic();
        let ticked = *self.ticked.get_or_insert(now);
        if now.saturating_sub(ticked) >= TICK_INTERVAL {
            self.ticked = Some(now);
            self.consumer.tick();
        }
    }
}

/// Time to the next attempt after `n_failures` before this one: between half of 2, 4, 8, 16, 30, 30, … seconds and
/// the whole, so that cameras that failed together do not come back together.
fn retry_delay(n_failures: u32, entropy: u64) -> Duration {
    let longest_ms = (2_000_u64 << n_failures.min(4)).min(30_000);
    let shortest_ms = longest_ms / 2;
    Duration::from_millis(shortest_ms + entropy % (longest_ms - shortest_ms + 1))
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::SimulatedClock;
    use crate::frame::{ColorMatrix, ColorRange, YuvImage};
    use crate::media::EncodedFormat;
    use std::sync::Mutex;

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
            let start = Start { scene: Timestamp::from_nanos(1_000), began: clock.monotonic() };
            let kind = (self.end, Duration::from_secs(5));
            CameraWorker::spawn_with(id, open, kind, clock, start, Box::new(recorder)).unwrap()
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
        for (n_failures, longest_ms) in [(0, 2_000), (1, 4_000), (3, 16_000), (4, 30_000), (u32::MAX, 30_000)]
        {
            let delays = [0, 1, 12_345, u64::MAX].map(|entropy| retry_delay(n_failures, entropy).as_millis());
            assert!(delays.iter().all(|ms| (longest_ms / 2..=longest_ms).contains(ms)), "{delays:?}");
            assert_ne!(delays[0], delays[2]);
        }
    }
}
