//! One thread a camera: opens its source, hands its frames on, opens it again after a failure.
//!
//! In: a source and a clock. Out: frames of scene time to one consumer, and the camera's status. Scene time is the
//! configured start, or that of the beginning, plus stream time; it never runs backwards, also when a source failed and
//! begins anew. Files are played in real time or as fast as their frames are processed (`play`), live sources are
//! followed (`follow`).

mod follow;
mod play;
mod start;
#[cfg(test)]
mod tests;

use super::arrival::ArrivalClock;
use super::losses::{Counts, Losses};
use super::pacing::Pacer;
use super::secret::LoginWatch;
use super::status::{CameraState, CameraStatus, Delivered, RateMeter, Reason, SharedStatus, StatusReader};
use super::together::{Member, Together};
use super::{IngestError, Lost, MediaRoots, Source, SourceFrame, StopFlag, Tap, open_tapped};
use crate::media::{EncodedFrame, TICK_NANOS};
use crate::telemetry::DropReason;
use follow::RecordedTimes;
use play::Played;
pub use start::Feed;
use start::{Corrected, SharedClock, Start};
use std::hash::BuildHasher;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::config::{ClockSettings, End, Pace};
use videofields_vision::frame::{CameraId, Frame, YuvImage};

/// Longest sleep between two looks at the stop flag.
const SLICE: Duration = Duration::from_millis(100);

/// Least time between two ticks.
const TICK_INTERVAL: Duration = Duration::from_secs(1);

/// Time for which frames must have come before a failure counts as the first again.
const STEADY: Duration = Duration::from_secs(30);

/// Time for which a decoding process must have lived for its end to be a mishap, after which the camera is opened again soon. One that
/// ends sooner met something that ends it: then pauses grow as after all else.
const DECODER_STEADY: Duration = Duration::from_secs(5);

/// Time to the next attempt after such a mishap.
const DECODER_PAUSE: Duration = Duration::from_millis(500);

/// Time to the next attempt with a login that was refused: cameras lock an account, or the address that asks, after some wrong
/// passwords within minutes.
const LOGIN_PAUSE: Duration = Duration::from_secs(600);

/// Time between two looks at whether a refused login has changed.
const LOGIN_LOOK: Duration = Duration::from_secs(1);

/// What receives a camera's frames, on the camera's own thread. Slow consumers lose frames, never others' time.
pub trait FrameConsumer: Send {
    /// Gets ready for frames such as the first one of a file, before any of its frames is due: whatever takes long. Called once.
    fn prepare(&mut self, _first: &YuvImage) {}

    /// Takes the next frame; timestamps and numbers only grow.
    fn consume(&mut self, frame: Frame);

    /// Whether [`Self::record`] is to be called. Asked once, before the source is opened.
    fn tap(&self) -> Tap {
        Tap::Closed
    }

    /// Called where a source begins, the first time and each time after a failure: encoded frames that follow do not build on those
    /// before.
    fn begin(&mut self) {}

    /// Takes a frame as the camera encoded it, with the scene time of its picture, in decoding order; each comes about
    /// when its picture does, and also where its picture was left out.
    fn record(&mut self, _frame: &EncodedFrame, _time: Timestamp) {}

    /// Returns true where [`Self::record`] leaves nothing out for want of room; a file of which every frame counts waits for it.
    fn has_room(&self) -> bool {
        true
    }

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
    clock: SharedClock,
    zero: Arc<AtomicI64>,
    thread: Option<JoinHandle<()>>,
}

impl CameraWorker {
    /// Starts the camera `id`. Files that are given the same `together` have a common stream time 0; its scene time is that of
    /// the file's `start`, or that of the common beginning if there is none.
    ///
    /// # Errors
    /// When no thread can be started. Whatever is wrong with the source shows in the status.
    pub fn spawn(
        id: CameraId,
        feed: impl Into<Feed>,
        roots: MediaRoots,
        clock: Arc<dyn Clock>,
        together: impl Into<Together>,
        consumer: Box<dyn FrameConsumer>,
    ) -> Result<Self, IngestError> {
        let feed = feed.into();
        let start = feed.start(together.into());
        let (end, stall, tap) = (feed.source.end, feed.source.stall_secs, consumer.tap());
        let stall = Duration::try_from_secs_f64(stall).unwrap_or(Duration::from_secs(5));
        let login = LoginWatch::of(&feed.source, &roots);
        let open = move |stop: &StopFlag| open_tapped(&feed.source, &roots, stop, tap);
        Self::spawn_with(id, (open, login), (end, stall), clock, start, consumer)
    }

    fn spawn_with(
        id: CameraId,
        (open, login): (
            impl FnMut(&StopFlag) -> Result<Box<dyn Source>, IngestError> + Send + 'static,
            Option<LoginWatch>,
        ),
        (end, stall): (End, Duration),
        clock: Arc<dyn Clock>,
        start: Start,
        consumer: Box<dyn FrameConsumer>,
    ) -> Result<Self, IngestError> {
        let stop = StopFlag::default();
        let status = start.status.map_or_else(|| SharedStatus::new(clock.now()), |status| status.shared());
        let counted = status.read();
        let scene_start = start.scene.unwrap_or_else(|| start.together.origin());
        let zero = Arc::new(AtomicI64::new(scene_start.as_nanos()));
        let camera = Camera {
            id: id.clone(),
            clock,
            start: start.scene,
            scene_start,
            zero: Arc::clone(&zero),
            member: start.pace.map(|pace| start.together.join(pace)),
            pace: start.pace.unwrap_or_default(),
            together: start.together,
            is_prepared: false,
            played: None,
            resumed: None,
            losses: Losses::default(),
            damage: 0,
            source_concern: None,
            own_clock: start.clock.clone(),
            corrected: start.corrected,
            end,
            stall,
            login,
            stop: stop.clone(),
            status: status.clone(),
            tap: consumer.tap(),
            consumer,
            pacer: None,
            arrivals: ArrivalClock::default(),
            recorded: RecordedTimes::default(),
            steady_since: None,
            rate: RateMeter::default(),
            ticked: None,
            next_number: counted.frames + counted.dropped,
        };
        let thread = std::thread::Builder::new()
            .name(format!("camera-{id}"))
            .spawn(move || camera.run_contained(open))
            .map_err(|source| IngestError::Thread { camera: id.clone(), source })?;
        Ok(Self { id, stop, status, clock: start.clock, zero, thread: Some(thread) })
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

    /// Returns the scene time of stream time 0, before the clock is corrected: of a file, where it began.
    #[must_use]
    pub fn zero(&self) -> Timestamp {
        Timestamp::from_nanos(self.zero.load(Ordering::Relaxed))
    }

    /// Corrects the camera's clock from its next frame on. Where that sets time back, frames come for a while whose times
    /// were there already.
    pub fn set_clock(&self, clock: ClockSettings) {
        self.clock.set(clock);
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

/// What lives on the camera's thread.
struct Camera {
    id: CameraId,
    clock: Arc<dyn Clock>,
    /// Scene time of stream time 0 as it is configured.
    start: Option<Timestamp>,
    /// Start that is in force.
    scene_start: Timestamp,
    /// Tells that to others.
    zero: Arc<AtomicI64>,
    /// Those with whom a file begins, and its place among them while it is played or about to be.
    together: Together,
    member: Option<Member>,
    pace: Pace,
    /// True once the consumer is prepared.
    is_prepared: bool,
    /// Progress of a file that is played whole, and its progress when it was opened again after a failure.
    played: Option<Played>,
    resumed: Option<Played>,
    /// Frames that were left out, until the log tells them.
    losses: Losses,
    /// Frames of a file that were damaged.
    damage: u64,
    /// Concern of the source although its frames come.
    source_concern: Option<String>,
    own_clock: SharedClock,
    corrected: Corrected,
    end: End,
    /// Silence after which a live source is stalled.
    stall: Duration,
    /// Watches the login, where somebody logs in.
    login: Option<LoginWatch>,
    stop: StopFlag,
    status: SharedStatus,
    tap: Tap,
    consumer: Box<dyn FrameConsumer>,
    /// Paces a file in real time, once it has begun.
    pacer: Option<Pacer>,
    arrivals: ArrivalClock,
    recorded: RecordedTimes,
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
            self.status.fail(format!("its processing panicked: {text}").into(), self.clock.now(), None);
        }
    }

    fn run(&mut self, mut open: impl FnMut(&StopFlag) -> Result<Box<dyn Source>, IngestError>) {
        let mut n_failures = 0;
        let mut last_state = CameraState::Ended;
        while !self.stop.is_raised() {
            self.status.set(CameraState::Connecting, self.clock.now());
            let (opened_at, number_before) = (self.clock.monotonic(), self.next_number);
            self.steady_since = None;
            if let Some(login) = &mut self.login {
                login.remember();
            }
            let mut is_live = false;
            let outcome = open(&self.stop).and_then(|mut source| {
                is_live = source.is_live();
                self.consumer.begin();
                if is_live { self.follow(source.as_mut()) } else { self.play(source.as_mut()) }
            });
            // Whoever fails or has ended is not waited for.
            self.member = None;
            self.tell_losses(Losses::take);
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
                self.status.retry((&error).into());
                continue;
            }
            // What was played cannot be played again as if it were new: a recording that ends in damage ends there.
            if !is_live && self.end == End::Stop && self.next_number > 0 && error.ends_a_recording() {
                tracing::error!(%error, "a camera's recording is damaged and ends here");
                self.status.fail((&error).into(), self.clock.now(), None);
                last_state = CameraState::Failed;
                break;
            }
            let (mut reason, mut delay) = (
                Reason::from(&error),
                retry_delay(n_failures, std::hash::RandomState::new().hash_one(n_failures)),
            );
            let is_mishap =
                is_live && matches!(error, IngestError::Worker { .. }) && lasted >= DECODER_STEADY;
            if is_mishap {
                delay = DECODER_PAUSE;
            }
            let is_refused = self.login.is_some() && error.is_login_refused();
            if is_refused {
                delay = LOGIN_PAUSE;
                reason.text.push_str("; it is tried again when they change, or in 10 minutes");
            }
            tracing::warn!(%error, retry_in = ?delay, "a camera's source failed");
            self.status.fail(reason.clone(), self.clock.now(), Some(delay));
            n_failures += u32::from(!is_mishap);
            let due = self.clock.monotonic().saturating_add(delay);
            if is_refused {
                self.sleep_until_login_changes(due);
            } else {
                self.sleep_until(due);
            }
            self.status.retry(reason);
        }
        self.consumer.finish();
        if self.damage > 0 && last_state == CameraState::Ended && !self.stop.is_raised() {
            self.status.set_reason(format!("{} of its pictures were damaged and are left out", self.damage));
        }
        if last_state != CameraState::Failed {
            self.status.set(last_state, self.clock.now());
        }
    }

    /// Hands on a file's encoded frames whose pictures came; `offset_nanos` is added to stream time.
    fn hand_on_encoded(&mut self, source: &mut dyn Source, offset_nanos: i64) {
        if self.tap == Tap::Closed {
            return;
        }
        while let Some(frame) = source.take_encoded() {
            let stream_nanos = self.stream_time(frame.stream_nanos.unwrap_or(0));
            if stream_nanos < 0 || self.is_played_already(stream_nanos) {
                continue;
            }
            let time = self.scene_time(Timestamp::from_nanos(offset_nanos.saturating_add(stream_nanos)));
            self.consumer.record(&frame, time);
        }
    }

    /// Stream time once the camera's clock is corrected, where that is what it corrects.
    fn stream_time(&self, stream_nanos: i64) -> i64 {
        let zero = Timestamp::from_nanos(0);
        match self.corrected {
            Corrected::SceneTime { .. } => stream_nanos,
            Corrected::StreamTime => {
                let clock = ClockSettings { since: None, ..self.own_clock.get() };
                clock.scene_time(Timestamp::from_nanos(stream_nanos), zero).as_nanos()
            }
        }
    }

    /// What is added to a file's stream time.
    fn file_offset_nanos(&self) -> i64 {
        self.scene_start.as_nanos().saturating_add(self.pacer.as_ref().map_or(0, Pacer::offset_nanos))
    }

    /// What `time` is once the camera's clock is corrected, as it is kept: of a camera that is recorded, in the unit that
    /// recordings hold, so that memory and recordings say the same.
    fn scene_time(&self, time: Timestamp) -> Timestamp {
        let time = match self.corrected {
            Corrected::StreamTime => time,
            Corrected::SceneTime { since } => self.own_clock.get().scene_time(time, since),
        };
        let nanos = time.as_nanos();
        Timestamp::from_nanos(match self.tap {
            Tap::Closed => nanos,
            Tap::Open => nanos - nanos.rem_euclid(TICK_NANOS),
        })
    }

    /// Tells with a source's first frame which process decodes it.
    fn tell_decoding(&self, source: &dyn Source) {
        if self.steady_since.is_none() {
            self.status.tell_decoding(source.decoding());
        }
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
        if self.status.count_frame(&delivered, self.consumer.concern().or(self.source_concern.as_deref())) {
            tracing::info!(width = size.0, height = size.1, "a camera is live");
        }
    }

    /// Counts what a live source left out beyond `counted`.
    fn count_lost(&mut self, lost: Lost, counted: &mut Lost) {
        let n_replaced = lost.n_replaced.saturating_sub(counted.n_replaced);
        let n_damaged = lost.n_damaged.saturating_sub(counted.n_damaged);
        counted.n_replaced += n_replaced;
        counted.n_damaged += n_damaged;
        self.leave_out(DropReason::Replaced, n_replaced);
        self.leave_out(DropReason::Damaged, n_damaged);
    }

    /// Counts `n` frames that are left out.
    fn leave_out(&mut self, reason: DropReason, n: u64) {
        if n > 0 {
            self.status.count_dropped(n);
            self.consumer.miss(reason, n);
            self.losses.count(reason, n, self.clock.monotonic());
        }
    }

    /// Tells the log of frames that were left out, if there are any to be told.
    fn tell_losses(&mut self, due: impl FnOnce(&mut Losses) -> Option<Counts>) {
        if let Some(Counts { n_late, n_replaced, n_damaged }) = due(&mut self.losses) {
            tracing::warn!(n_late, n_replaced, n_damaged, "frames of a camera were left out");
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

    /// Sleeps until monotonic time `due`, until the camera is to stop, or until its login is another than the one that was refused.
    fn sleep_until_login_changes(&mut self, due: Duration) {
        let Some(login) = self.login.take() else { return };
        while !self.stop.is_raised() && !login.has_changed() {
            let now = self.clock.monotonic();
            if now >= due {
                break;
            }
            self.sleep_until(due.min(now.saturating_add(LOGIN_LOOK)));
        }
        self.login = Some(login);
    }

    fn tick_if_due(&mut self) {
        let now = self.clock.monotonic();
        let ticked = *self.ticked.get_or_insert(now);
        if now.saturating_sub(ticked) >= TICK_INTERVAL {
            self.ticked = Some(now);
            self.consumer.tick();
            self.tell_losses(|losses| losses.due(now));
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
