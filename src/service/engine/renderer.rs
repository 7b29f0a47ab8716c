//! The render thread: owns the GPU, draws a picture or some pieces of one in each turn that the queue gives, and answers everything that
//! means the same with it.
//!
//! A device that is lost is made anew, and the picture in hand drawn once more; a panic costs its own picture alone.

mod sharing;
mod warm_up;

use super::EngineError;
use super::associations::{Associations, Remembered};
use super::flow::Flow;
use super::frame_cache::FrameCache;
use super::handle::DeviceSummary;
use super::identity::ViewIdentity;
use super::pace::Backoff;
use super::picture::{HOST_STAGES, LEAST_SHARE, Painting, Subject, failure_of, none_fits};
use super::queue::{Job, JobId, Next};
use super::resolve::{Resolved, Seen};
use super::sessions::Sessions;
use super::shared::Shared;
use super::view::{Origin, ViewAnswer};
use sharing::same_as;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{Plan, ViewSession};
use videofields_recording::telemetry::ViewRefusal;
use videofields_render::gpu::{Gpu, GpuError};
use videofields_render::{Progress, RenderError, Renderer};
use videofields_vision::error::ErrorKind;
use warm_up::WarmUp;

/// Longest pause between two looks at what is not asked for by a picture.
const IDLE_TIME: Duration = Duration::from_secs(5);

/// Times that a picture is drawn anew because privacy zones were changed meanwhile.
const MAX_DRAWN_ANEW: u32 = 3;

/// Least time of a turn: pieces that take less are drawn one after the other.
const LEAST_TURN: Duration = Duration::from_millis(20);

/// Time between two looks at where recordings begin; retention and new recordings move that slowly.
const LOOK_INTERVAL: Duration = Duration::from_secs(5);

/// Serves the queue until it is closed and empty.
pub(super) fn run(shared: &Shared) {
    let mut thread = RenderThread::new(shared);
    let mut looked = None;
    loop {
        // Opening the device before it is asked for takes the wait out of the first request; readiness tells how it
        // went, and comes back without anybody asking for a picture.
        if let Err(error) = thread.contained(|thread| thread.ensure_renderer().map(|_renderer| ())) {
            tracing::debug!(%error, "no renderer yet");
        }
        let now = shared.clock.monotonic();
        if let Some(past) = &shared.past {
            let is_due = looked.is_none_or(|looked: Duration| now.saturating_sub(looked) >= LOOK_INTERVAL);
            if is_due {
                looked = Some(now);
            }
            let looking = thread.contained(|_| {
                past.tidy();
                if is_due {
                    past.look();
                }
                Ok(())
            });
            if let Err(error) = looking {
                tracing::error!(%error, "recordings could not be looked after");
            }
        }
        let next = shared.queue.next(thread.longest_wait());
        // Whoever waited may have left.
        thread.paused.retain(|paused| shared.queue.is_wanted(paused.job.id));
        match next {
            Next::Picture(job) => thread.serve(*job),
            Next::GoOn(job) => thread.go_on(job),
            Next::Nothing => thread.make_scenes_ready(),
            Next::End => break,
        }
        shared.queue.end_turn();
    }
}

struct RenderThread<'a> {
    shared: &'a Shared,
    renderer: Option<Renderer>,
    backoff: Backoff,
    was_opened: bool,
    cache: FrameCache,
    /// Pictures of which pieces are drawn.
    paused: Vec<Paused>,
    /// Turns so far.
    n_turns: u64,
    sessions: Sessions,
    /// Who is who in each scene, and how its cameras' colours agree.
    associations: Associations,
    warm_up: WarmUp,
    /// How often scenes had been exchanged when that was last looked at.
    scene_changes: u64,
    /// How often privacy zones had been.
    privacy_changes: u64,
}

/// A picture in hand once it is known what it means, with what the answer tells beside it.
struct Begun {
    subject: Arc<Subject>,
    resolving: Duration,
    started: Duration,
    /// Changes of privacy zones before it was begun.
    privacy_changes: u64,
    /// Times that it was begun.
    n_begun: u32,
}

impl Begun {
    /// The answer by a picture that is kept.
    fn kept(self, kept: ViewAnswer) -> Step {
        let answer = ViewAnswer { timings: vec![("resolve", self.resolving)], origin: Origin::Kept, ..kept };
        Step::Drawn(self, Box::new(answer))
    }
}

/// A picture of which pieces are drawn, between two of its turns.
struct Paused {
    job: Job,
    of: Begun,
    painting: Painting,
    /// Time that deciding and drawing it took so far.
    spent: Duration,
    n_turns: u32,
    /// Which turn of all was its last one, and when that ended.
    last_turn: (u64, Duration),
    /// Time that others took between its turns.
    between: Duration,
    /// True where a device failed under it before.
    was_failed: bool,
}

/// The outcome of a turn.
enum Step {
    /// A picture.
    Drawn(Begun, Box<ViewAnswer>),
    /// Others may have a turn.
    Paused(Box<Paused>),
    /// It is the same as one that is paused.
    Joined(JobId),
    /// Nobody waits for it any more.
    GivenUp,
}

/// A picture that was decided on.
enum Choice {
    /// A picture that was drawn before.
    Kept(Box<ViewAnswer>),
    /// One that is to be drawn.
    New(Box<Painting>),
}

/// Why there is no picture, before it is told to anybody.
enum Failure {
    Engine(EngineError),
    Render(RenderError),
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Self {
        Self::Engine(error)
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        Self::Render(error)
    }
}

impl<'a> RenderThread<'a> {
    fn new(shared: &'a Shared) -> Self {
        let cache = FrameCache::new(shared.render_settings.cache_mib as usize * 1024 * 1024);
        Self {
            shared,
            renderer: None,
            backoff: Backoff::default(),
            was_opened: false,
            cache,
            paused: Vec::new(),
            n_turns: 0,
            sessions: Sessions::default(),
            associations: Associations::default(),
            warm_up: WarmUp::default(),
            scene_changes: 0,
            privacy_changes: 0,
        }
    }

    /// Until when a new device is opened, if one is wanted; else when things are looked after or made ready.
    fn longest_wait(&self) -> Duration {
        if self.renderer.is_some() {
            return IDLE_TIME.min(self.until_warm_up());
        }
        // A little more, so that it is over then.
        let remaining = self.backoff.remaining(self.shared.clock.monotonic()) + Duration::from_millis(1);
        remaining.min(IDLE_TIME)
    }

    /// Does `work`; should it panic, the renderer is made anew, so that one bad picture costs no other.
    fn contained<T>(
        &mut self,
        work: impl FnOnce(&mut Self) -> Result<T, EngineError>,
    ) -> Result<T, EngineError> {
        // What a panic may leave half-changed is the renderer and what is kept, and both are dropped.
        catch_unwind(AssertUnwindSafe(|| work(self))).unwrap_or_else(|_panic| {
            tracing::error!("drawing a picture panicked; the renderer will be made anew");
            self.drop_kept();
            self.drop_renderer("drawing a picture panicked");
            Err(EngineError::Internal("drawing the picture panicked".to_owned()))
        })
    }

    /// Gives a picture that was asked for its first turn.
    fn serve(&mut self, job: Job) {
        self.n_turns += 1;
        self.forget_changed_scenes();
        self.forget_hidden();
        let taken = self.contained(|thread| thread.begin(job.clone()));
        self.conclude(job, taken);
    }

    /// Gives a picture that is paused its next turn.
    fn go_on(&mut self, job: JobId) {
        let Some(place) = self.paused.iter().position(|paused| paused.job.id == job) else {
            let lost = EngineError::Internal("a picture that is being drawn was lost".to_owned());
            return self.shared.queue.finish(job, &Err(lost));
        };
        let mut paused = self.paused.swap_remove(place);
        self.n_turns += 1;
        let (last, ended_at) = paused.last_turn;
        if self.n_turns > last + 1 {
            paused.between += self.shared.clock.monotonic().saturating_sub(ended_at);
        }
        let job = paused.job.clone();
        let taken = self.contained(|thread| thread.take_turn(paused));
        self.conclude(job, taken);
    }

    /// Does what a turn came to.
    fn conclude(&mut self, job: Job, taken: Result<Step, EngineError>) {
        let queue = &self.shared.queue;
        match taken {
            Ok(Step::Drawn(of, answer)) => self.answer(&job, &of, *answer),
            Ok(Step::Paused(paused)) => {
                queue.pause(job.id, paused.painting.left());
                self.paused.push(*paused);
            }
            Ok(Step::Joined(other)) => queue.join(job.id, other),
            Ok(Step::GivenUp) => tracing::debug!("a picture was given up: nobody waits for it"),
            Err(error) => queue.finish(job.id, &Err(error)),
        }
    }

    /// Answers a picture in hand, and all that turn out to be the same; never with one that was begun before something that it shows was
    /// hidden.
    fn answer(&mut self, job: &Job, of: &Begun, answer: ViewAnswer) {
        let queue = &self.shared.queue;
        if self.shared.privacies.changes() != of.privacy_changes {
            if of.n_begun >= MAX_DRAWN_ANEW {
                let changing = EngineError::Unavailable("privacy zones are being changed".to_owned());
                return queue.finish(job.id, &Err(changing));
            }
            self.forget_hidden();
            let n_begun = of.n_begun;
            let taken = self.contained(|thread| thread.begin_anew(job.clone(), n_begun));
            return self.conclude(job.clone(), taken);
        }
        let subject = &of.subject;
        let answer = ViewAnswer { identity: Some(Arc::new(ViewIdentity::of(subject))), ..answer };
        // What came meanwhile may be the same too: it need not wait for what is before it.
        let meanwhile = queue.waiting();
        queue.finish(job.id, &Ok(answer.clone()));
        let same =
            self.contained(|thread| Ok(same_as(thread.shared, (&job.request, subject), None, meanwhile)));
        let same = same.unwrap_or_default();
        if !same.is_empty() {
            queue.take_along(job.id, &same);
            let origin = if answer.origin == Origin::Drawn { Origin::Shared } else { answer.origin };
            queue.finish(job.id, &Ok(ViewAnswer { timings: Vec::new(), origin, ..answer }));
        }
    }

    fn begin(&mut self, job: Job) -> Result<Step, EngineError> {
        self.begin_anew(job, 0)
    }

    /// Finds out what `job` means now, and decides and begins to draw that where it is not kept; it was begun `n_before` times.
    fn begin_anew(&mut self, job: Job, n_before: u32) -> Result<Step, EngineError> {
        let (shared, clock) = (self.shared, &*self.shared.clock);
        let privacy_changes = shared.privacies.changes();
        let started = clock.monotonic();
        let Resolved { subject, seen } = shared.resolve(&job.request)?;
        let resolved = clock.monotonic();
        let resolving = resolved.saturating_sub(started);
        let same = same_as(shared, (&job.request, &subject), Some(&seen), shared.queue.waiting());
        shared.queue.take_along(job.id, &same);
        if let Some(other) = self.paused.iter().find(|paused| paused.of.subject == subject) {
            return Ok(Step::Joined(other.job.id));
        }
        let n_begun = n_before + 1;
        let of = Begun { subject, resolving, started, privacy_changes, n_begun };
        if let Some(kept) = self.cache.get(&of.subject) {
            return Ok(of.kept(kept));
        }
        shared.metrics.render_cache_misses.inc();
        // A panic on the way costs what is known of gains and hulls, and no more.
        let mut associations = std::mem::take(&mut self.associations);
        let subject = &of.subject;
        let remembered = associations.of(&subject.scene);
        let mut session = subject.session.as_deref().map(|name| self.sessions.take(&subject.scene, name));
        shared.refresh_forecaster();
        let decided = self.twice_at_most(job.id, |thread| {
            thread.ensure_renderer()?;
            let decided = thread.decided(subject, &seen, (&mut *remembered, session.as_mut()), &job)?;
            Ok(Some(decided))
        });
        self.associations = associations;
        if let Some((name, session)) = subject.session.as_deref().zip(session) {
            self.sessions.put(&subject.scene, name, session);
        }
        let Some(decided) = decided? else { return Ok(Step::GivenUp) };
        match decided {
            Choice::Kept(kept) => Ok(of.kept(*kept)),
            Choice::New(painting) => {
                let spent = clock.monotonic().saturating_sub(resolved);
                let (last_turn, between) = ((0, Duration::ZERO), Duration::ZERO);
                let (painting, n_turns, was_failed) = (*painting, 0, false);
                self.take_turn(Paused { job, of, painting, spent, n_turns, last_turn, between, was_failed })
            }
        }
    }

    /// Draws pieces of a picture for a turn, or all of it where nothing may be drawn between.
    fn take_turn(&mut self, mut paused: Paused) -> Result<Step, EngineError> {
        let (shared, clock) = (self.shared, &*self.shared.clock);
        let began = clock.monotonic();
        let had_failed = paused.was_failed;
        let outcome = self.twice_at_most(paused.job.id, |thread| {
            let turned = thread.turn(&mut paused, began);
            match turned {
                // Twice a picture, not twice a turn.
                Err(Failure::Render(error)) if had_failed => {
                    thread.recovers_from(&error);
                    Err(Failure::Engine(thread.told(error.into())))
                }
                turned => turned,
            }
        })?;
        let turn = clock.monotonic().saturating_sub(began);
        let Some(progress) = outcome else { return Ok(Step::GivenUp) };
        paused.spent += turn;
        // The first turn bears the time of deciding.
        shared.queue.note_drawn(if paused.n_turns == 0 { paused.spent } else { turn });
        paused.n_turns += 1;
        if progress == Progress::MoreToDraw {
            paused.last_turn = (self.n_turns, clock.monotonic());
            return Ok(Step::Paused(Box::new(paused)));
        }
        let Paused { of, painting, between, .. } = paused;
        let answer = painting.finish(&of.subject, &shared.forecaster);
        let mut answer = answer.ok_or_else(|| EngineError::Internal("a picture was lost".to_owned()))?;
        self.note_drawn(&answer, of.started);
        answer.timings.insert(0, ("resolve", of.resolving));
        if !between.is_zero() {
            answer.timings.insert(1, ("pause", between));
        }
        // What a session shows depends on what it showed before: after a seek the same instant is another picture.
        if of.subject.session.is_none() {
            let chosen = || Arc::new(of.subject.with(answer.settings));
            let kept = if of.subject.deadline.is_some() { chosen() } else { Arc::clone(&of.subject) };
            self.cache.insert(kept, answer.clone());
        }
        shared.metrics.render_cache.set(i64::try_from(self.cache.bytes()).unwrap_or(i64::MAX));
        Ok(Step::Drawn(of, Box::new(answer)))
    }

    /// Draws pieces while somebody waits for them, until the turn that began then is over.
    fn turn(&mut self, paused: &mut Paused, began: Duration) -> Result<Option<Progress>, Failure> {
        let (shared, clock) = (self.shared, &*self.shared.clock);
        let Paused { job, of, painting, was_failed, .. } = paused;
        loop {
            if !shared.queue.is_wanted(job.id) {
                return Ok(None);
            }
            let renderer = self.ensure_renderer()?;
            let progress =
                painting.go_on(&of.subject, renderer, clock).inspect_err(|_| *was_failed = true)?;
            let is_over = clock.monotonic().saturating_sub(began) >= LEAST_TURN && painting.may_pause();
            if progress == Progress::Finished || is_over {
                return Ok(Some(progress));
            }
        }
    }

    /// Decides what of `subject` is drawn and how exactly, or finds what was decided among the pictures that are kept.
    fn decided(
        &mut self,
        subject: &Subject,
        seen: &Seen,
        (remembered, session): (&mut Remembered, Option<&mut ViewSession>),
        job: &Job,
    ) -> Result<Choice, Failure> {
        let (shared, clock) = (self.shared, &*self.shared.clock);
        let forecaster = &shared.forecaster;
        let renderer = self.renderer.as_mut().ok_or_else(|| no_renderer(shared, shared.renderer_state()))?;
        let sequences = shared.sequences_of(subject);
        let started = clock.monotonic();
        let placing = shared.placing_of(&subject.scene);
        // Nobody waits for a picture to be drawn to learn who is there.
        let state = {
            let mut own = placing.lock();
            subject.state(&seen.0, (&mut own, remembered), (&shared.overlaps, sequences))
        };
        let fused = clock.monotonic();
        let deadline = subject.deadline.map(|(deadline, _)| deadline);
        let left = || {
            let drawing = deadline.map_or(Duration::MAX, |of| of.total.saturating_sub(of.reserve));
            let left = job.asked_at.saturating_add(drawing).saturating_sub(clock.monotonic());
            // Others have turns between its pieces; what is one is drawn at once.
            match deadline {
                Some(_) => shared.queue.share_of(&job.flow, left).max(left.min(LEAST_SHARE)),
                None => left,
            }
        };
        let pending = |state: &SceneState, plan: &Plan| renderer.pending(state, plan);
        let decided = subject
            .decide(state, (&mut remembered.hulls, session), forecaster, &left, &pending)
            .map_err(|none| {
                shared.metrics.count_refused(ViewRefusal::Deadline);
                none_fits(deadline, none, shared.queue.retry_after(&job.flow))
            })?;
        if subject.deadline.is_some()
            && subject.session.is_none()
            && let Some(kept) = self.cache.get(&subject.with(decided.decision.settings))
        {
            let expected = Some(decided.decision.expected);
            return Ok(Choice::Kept(Box::new(ViewAnswer { origin: Origin::Kept, expected, ..kept })));
        }
        let planned = clock.monotonic();
        let took = [fused.saturating_sub(started), planned.saturating_sub(fused)];
        Ok(Choice::New(Box::new(Painting::new(decided, took))))
    }

    fn note_drawn(&mut self, answer: &ViewAnswer, started: Duration) {
        self.backoff.note_drawn();
        let metrics = &self.shared.metrics;
        let all = self.shared.clock.monotonic().saturating_sub(started);
        metrics.render_picture.observe(all.as_secs_f64());
        if let Some(expected) = &answer.expected {
            let measured_ms: f64 = answer
                .timings
                .iter()
                .filter(|(stage, _)| HOST_STAGES.contains(stage))
                .map(|(_, time)| time.as_secs_f64() * 1e3)
                .sum();
            metrics.render_expected_ratio.observe(measured_ms / expected.forecast.median_ms.max(1e-3));
        }
        for (pass, time) in answer.timings.iter().filter(|(stage, _)| !HOST_STAGES.contains(stage)) {
            metrics.render_pass.with_label_values(&[pass]).observe(time.as_secs_f64());
        }
    }

    /// Draws, and draws once more where what failed may go well now: on a new device after a loss, with all caches
    /// dropped when memory ran out.
    fn twice_at_most<T>(
        &mut self,
        job: JobId,
        mut draw: impl FnMut(&mut Self) -> Result<Option<T>, Failure>,
    ) -> Result<Option<T>, EngineError> {
        match draw(self) {
            Ok(drawn) => return Ok(drawn),
            Err(Failure::Render(error)) if self.recovers_from(&error) => {
                if !self.shared.queue.is_wanted(job) {
                    return Ok(None);
                }
            }
            Err(failure) => return Err(self.told(failure)),
        }
        draw(self).map_err(|failure| {
            if let Failure::Render(error) = &failure {
                self.recovers_from(error);
            }
            self.told(failure)
        })
    }

    /// Does what a failure calls for; whether drawing again may go well then.
    fn recovers_from(&mut self, error: &RenderError) -> bool {
        match error {
            RenderError::Gpu(GpuError::OutOfMemory { .. }) => {
                tracing::warn!(%error, "all that is kept is dropped, on the device too");
                self.drop_kept();
                self.renderer = None;
                self.shared.set_device_loss(None);
                true
            }
            _ if error.kind() == ErrorKind::Unavailable => {
                tracing::warn!(%error, "the renderer failed and will be made anew");
                self.drop_renderer(&error.to_string());
                true
            }
            // Also after a fault that the device survives: what it could not allocate stays unusable.
            RenderError::Gpu(_) if error.kind() == ErrorKind::Internal => {
                tracing::warn!(%error, "the renderer failed and will be made anew");
                self.drop_renderer(&error.to_string());
                false
            }
            _ => false,
        }
    }

    /// A failure as callers are told it.
    fn told(&self, failure: Failure) -> EngineError {
        match failure {
            Failure::Engine(error) => error,
            Failure::Render(error) if error.kind() == ErrorKind::Unavailable => {
                no_renderer(self.shared, error.to_string())
            }
            Failure::Render(error) => failure_of(&error),
        }
    }

    /// Lets go of pictures of scenes that were exchanged: each holds its scene with all that it is made of.
    fn forget_changed_scenes(&mut self) {
        let changes = self.shared.scenes.now().changes;
        if self.scene_changes != changes {
            self.scene_changes = changes;
            self.drop_kept();
        }
    }

    /// Lets go of what was drawn before something was hidden, and of gains that were reckoned from it.
    fn forget_hidden(&mut self) {
        let changes = self.shared.privacies.changes();
        if self.privacy_changes != changes {
            self.privacy_changes = changes;
            self.drop_kept();
            self.associations.forget_gains();
        }
    }

    fn drop_kept(&mut self) {
        self.cache.clear();
        self.shared.metrics.render_cache.set(0);
    }

    fn drop_renderer(&mut self, reason: &str) {
        self.renderer = None;
        self.shared.set_device_loss(None);
        self.shared.set_device(None);
        self.shared.set_renderer_state(Err(reason.to_owned()));
        let now = self.shared.clock.monotonic();
        self.backoff.note_lost(now);
        self.shared.queue.note_down_for(self.backoff.remaining(now));
    }

    fn ensure_renderer(&mut self) -> Result<&mut Renderer, EngineError> {
        if self.renderer.is_none() {
            let now = self.shared.clock.monotonic();
            if self.backoff.remaining(now) == Duration::ZERO {
                self.open_device();
            }
        }
        let shared = self.shared;
        self.renderer.as_mut().ok_or_else(|| no_renderer(shared, shared.renderer_state()))
    }

    fn open_device(&mut self) {
        match open_renderer(&self.shared.render_settings) {
            Ok((renderer, adapter)) => {
                tracing::info!(adapter, "renderer ready");
                if std::mem::replace(&mut self.was_opened, true) {
                    self.shared.metrics.render_devices_rebuilt.inc();
                }
                self.shared.set_renderer_state(Ok(adapter));
                self.shared.set_device(Some(summary_of(renderer.gpu())));
                self.shared.set_device_loss(Some(Box::new(renderer.gpu().loss())));
                self.shared.forecaster.forget_programs();
                self.warm_up.forget_device();
                self.renderer = Some(renderer);
            }
            Err(error) => {
                tracing::error!(%error, "no renderer");
                self.shared.set_renderer_state(Err(error.to_string()));
                let now = self.shared.clock.monotonic();
                self.backoff.note_not_opened(now);
                self.shared.queue.note_down_for(self.backoff.remaining(now));
            }
        }
    }
}

fn no_renderer(shared: &Shared, reason: String) -> EngineError {
    EngineError::NoRenderer { reason, retry_after: shared.queue.retry_after(&Flow::Common) }
}

/// What is told of a device.
fn summary_of(gpu: &Gpu) -> DeviceSummary {
    let limits = gpu.limits();
    DeviceSummary {
        adapter: gpu.name().to_owned(),
        is_software: gpu.is_software(),
        max_texture_side_px: limits.max_texture_dimension_2d,
        max_buffer_bytes: limits.max_buffer_size,
        has_timestamps: gpu.has_timestamps(),
    }
}

/// The GPU that the settings name and a renderer on it, with the adapter's name.
pub(super) fn open_renderer(
    settings: &videofields_vision::config::RenderSettings,
) -> Result<(Renderer, String), EngineError> {
    let gpu = Gpu::new(&settings.adapter).map_err(|error| EngineError::Unavailable(error.to_string()))?;
    let adapter = gpu.name().to_owned();
    let renderer = Renderer::new(gpu, settings).map_err(|error| failure_of(&error))?;
    Ok((renderer, adapter))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::At;
    use crate::engine::Door;
    use crate::engine::privacy::Privacies;
    use videofields_recording::telemetry::Metrics;
    use videofields_recording::timeline::EventLog;
    use videofields_vision::clock::{SimulatedClock, Timestamp};
    use videofields_vision::config::RenderSettings;

    /// What a render thread without cameras, scenes or a device shares.
    fn shared() -> (Arc<SimulatedClock>, Shared) {
        let clock = Arc::new(SimulatedClock::new(Timestamp::from_nanos(0)));
        let settings = RenderSettings { adapter: "no such adapter".to_owned(), ..RenderSettings::default() };
        let shared = Shared::new(
            Arc::clone(&clock) as _,
            Arc::new(Metrics::new()),
            (Vec::new(), Arc::new(Privacies::new(&[])), None),
            (Arc::new(EventLog::new(1)), None),
            (Vec::new(), Arc::default()),
            (settings, crate::engine::entities::Entities::default()),
            Arc::default(),
        );
        (clock, shared)
    }

    /// Somebody waits for a picture, and it is in hand.
    fn in_hand(shared: &Shared) -> (JobId, tokio::sync::oneshot::Receiver<Result<ViewAnswer, EngineError>>) {
        let (reply, answer) = tokio::sync::oneshot::channel();
        let request = crate::engine::view::ViewRequest {
            scene: "yard".to_owned(),
            kind: crate::engine::ViewKind::Perspective,
            eye: None,
            target: None,
            fov_y_rad: None,
            width_px: 4,
            height_px: 3,
            at: At::Live,
            style: videofields_picture::plan::EntityStyle::None,
            see_through: true,
            colors: videofields_picture::plan::Colors::Even,
            session: None,
            effort: videofields_picture::plan::Effort::default(),
            effects: Default::default(),
            horizon: None,
            blur_people: None,
            scope: videofields_vision::access::Scope::all(),
        };
        shared.queue.push(request, Flow::Common, reply).expect("there is room");
        let Next::Picture(job) = shared.queue.next(Duration::ZERO) else { panic!("it is next") };
        (job.id, answer)
    }

    fn lost() -> Failure {
        RenderError::from(GpuError::Lost { message: "a test".to_owned() }).into()
    }

    fn out_of_memory() -> Failure {
        RenderError::from(GpuError::OutOfMemory { message: "a test".to_owned() }).into()
    }

    /// Draws with one outcome after the other; how often, and what came of it.
    fn drawn<T>(
        thread: &mut RenderThread<'_>,
        job: JobId,
        outcomes: impl IntoIterator<Item = Result<Option<T>, Failure>>,
    ) -> (usize, Result<Option<T>, EngineError>) {
        let mut outcomes = outcomes.into_iter();
        let mut n_drawn = 0;
        let outcome = thread.twice_at_most(job, |_thread| {
            n_drawn += 1;
            outcomes.next().expect("drawn twice at most")
        });
        (n_drawn, outcome)
    }

    #[test]
    fn a_panic_costs_its_own_picture_alone() {
        let (_clock, shared) = shared();
        shared.set_renderer_state(Ok("a GPU".to_owned()));
        let mut thread = RenderThread::new(&shared);
        let error = thread.contained(|_| -> Result<(), EngineError> { panic!("told to panic") });
        assert!(matches!(error, Err(EngineError::Internal(_))));
        assert!(!shared.readiness().ready);
        assert_eq!(thread.contained(|_| Ok(7)).unwrap(), 7);
        assert_eq!(
            thread.backoff.remaining(Duration::ZERO),
            Duration::ZERO,
            "a device is opened again at once"
        );
    }

    #[test]
    fn what_met_a_loss_is_drawn_once_more() {
        let (_clock, shared) = shared();
        let mut thread = RenderThread::new(&shared);
        let (job, _answer) = in_hand(&shared);
        let (n_drawn, outcome) = drawn(&mut thread, job, [Err(lost()), Ok(Some(7))]);
        assert_eq!((n_drawn, outcome.unwrap()), (2, Some(7)));
        assert!(shared.renderer_state().contains("the GPU was lost: a test"));
        let (n_drawn, outcome) = drawn(&mut thread, job, [Err::<Option<()>, _>(lost()), Err(lost())]);
        let error = outcome.unwrap_err();
        assert!(matches!(error, EngineError::NoRenderer { .. }), "{error}");
        assert_eq!((n_drawn, error.kind()), (2, ErrorKind::Unavailable));
        // The third loss in a row: the pause is told.
        assert_eq!(thread.backoff.remaining(Duration::ZERO), Duration::from_millis(500));
        assert!(error.retry_after().is_some_and(|after| after >= Duration::from_millis(500)));
    }

    #[test]
    fn what_nobody_waits_for_any_more_is_not_drawn_again() {
        let (clock, shared) = shared();
        let mut thread = RenderThread::new(&shared);
        let (job, answer) = in_hand(&shared);
        drop(answer);
        let (n_drawn, outcome) = drawn(&mut thread, job, [Err::<Option<()>, _>(lost())]);
        assert_eq!((n_drawn, outcome.unwrap()), (1, None));
        let (job, mut answer) = in_hand(&shared);
        clock.advance(Duration::from_secs(9));
        let (n_drawn, outcome) = drawn(&mut thread, job, [Err::<Option<()>, _>(lost())]);
        assert_eq!((n_drawn, outcome.unwrap()), (1, None));
        assert!(matches!(answer.try_recv(), Ok(Err(EngineError::Late { .. }))));
    }

    #[test]
    fn when_memory_runs_out_caches_are_dropped_and_it_is_tried_once_more() {
        let (_clock, shared) = shared();
        let mut thread = RenderThread::new(&shared);
        let (job, _answer) = in_hand(&shared);
        shared.metrics.render_cache.set(99);
        let (n_drawn, outcome) = drawn(&mut thread, job, [Err(out_of_memory()), Ok(Some(7))]);
        assert_eq!((n_drawn, outcome.unwrap()), (2, Some(7)));
        assert_eq!(shared.metrics.render_cache.get(), 0);
        let (n_drawn, outcome) =
            drawn(&mut thread, job, [Err::<Option<()>, _>(out_of_memory()), Err(out_of_memory())]);
        assert_eq!((n_drawn, outcome.unwrap_err().kind()), (2, ErrorKind::TooLarge));
    }

    #[test]
    fn a_fault_of_the_request_is_not_tried_again() {
        let (_clock, shared) = shared();
        let mut thread = RenderThread::new(&shared);
        let (job, _answer) = in_hand(&shared);
        let refused = RenderError::View(videofields_vision::error::Fault::new("width", "must be 1 to 9"));
        let (n_drawn, outcome) = drawn(&mut thread, job, [Err::<Option<()>, _>(refused.into())]);
        assert_eq!((n_drawn, outcome.unwrap_err().kind()), (1, ErrorKind::Invalid));
    }

    #[test]
    fn a_device_that_cannot_be_had_is_tried_after_growing_pauses() {
        let (clock, shared) = shared();
        let mut thread = RenderThread::new(&shared);
        let mut waits = Vec::new();
        for _ in 0..7 {
            let error = thread.ensure_renderer().map(drop).unwrap_err();
            assert!(
                matches!(&error, EngineError::NoRenderer { reason, .. } if reason.contains("no such adapter"))
            );
            let wait = thread.longest_wait();
            assert!(error.retry_after().is_some_and(|after| after + Duration::from_millis(1) >= wait));
            waits.push(wait.as_millis());
            clock.advance(wait);
        }
        assert_eq!(waits, [251, 501, 1001, 2001, 4001, 5000, 5000]);
    }
}
