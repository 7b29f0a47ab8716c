//! The render thread: owns the GPU, takes one request after the other, and answers equal ones with one picture.

use super::EngineError;
use super::handle::{At, Door};
use super::picture::{HOST_STAGES, Observations, Subject, failure_of};
use super::shared::Shared;
use super::view::{ViewAnswer, ViewRequest};
use crate::clock::Timestamp;
use crate::error::ErrorKind;
use crate::frame::CameraId;
use crate::gpu::Gpu;
use crate::render::Renderer;
use crate::scene::Scene;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;
use tokio::sync::oneshot;

/// A request on its way to the renderer.
pub(super) struct Job {
    pub(super) request: ViewRequest,
    pub(super) reply: oneshot::Sender<Result<ViewAnswer, EngineError>>,
}

/// After a device could not be had, it is not tried again for this long.
const DEVICE_RETRY: Duration = Duration::from_secs(5);

/// Time between two looks at where recordings begin; retention and new recordings move that slowly.
const LOOK_INTERVAL: Duration = Duration::from_secs(5);

/// A live view shows what moved before a camera that lags, until its newest picture is this much older than the instant
/// shown; then its background alone, since whom it saw last may be long gone.
const STALE_NANOS: i64 = 5_000_000_000;

/// Serves `jobs` until every sender is gone.
pub(super) fn run(shared: &Shared, jobs: &Receiver<Job>) {
    let mut thread = RenderThread { shared, renderer: None, failed_at: None, last: None };
    let mut looked = None;
    loop {
        // Opening the device before it is asked for takes the wait out of the first request; readiness tells how it
        // went, and comes back without anybody asking for a picture.
        if let Err(error) = thread.contained(|thread| thread.ensure_renderer().map(|_renderer| ())) {
            tracing::debug!(%error, "no renderer yet");
        }
        if let Some(past) = &shared.past {
            past.tidy();
            let now = shared.clock.monotonic();
            if looked.is_none_or(|looked: Duration| now.saturating_sub(looked) >= LOOK_INTERVAL) {
                looked = Some(now);
                past.look();
            }
        }
        let job = match jobs.recv_timeout(DEVICE_RETRY) {
            Ok(job) => job,
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => break,
        };
        shared.count_dequeued();
        // A caller that has gone wants no picture.
        if job.reply.is_closed() {
            shared.accuracy.note_answered();
            continue;
        }
        let answer = thread.contained(|thread| thread.answer(&job.request));
        shared.accuracy.note_answered();
        if job.reply.send(answer).is_err() {
            tracing::debug!("the caller left before its picture was ready");
        }
    }
}

struct RenderThread<'a> {
    shared: &'a Shared,
    renderer: Option<Renderer>,
    failed_at: Option<Duration>,
    /// The picture drawn last: what asks for the same again gets it.
    last: Option<(Subject, ViewAnswer)>,
}

impl RenderThread<'_> {
    /// Does `work`; should it panic, the renderer is made anew, so that one bad picture costs no other.
    fn contained<T>(
        &mut self,
        work: impl FnOnce(&mut Self) -> Result<T, EngineError>,
    ) -> Result<T, EngineError> {
        // What a panic may leave half-changed is the renderer, and that is dropped.
        catch_unwind(AssertUnwindSafe(|| work(self))).unwrap_or_else(|_panic| {
            tracing::error!("drawing a picture panicked; the renderer will be made anew");
            self.renderer = None;
            self.last = None;
            self.shared.set_renderer_state(Err("drawing a picture panicked".to_owned()));
            Err(EngineError::Internal("drawing the picture panicked".to_owned()))
        })
    }

    fn answer(&mut self, request: &ViewRequest) -> Result<ViewAnswer, EngineError> {
        let scene = self.shared.scene(&request.scene)?;
        let started = self.shared.clock.monotonic();
        let instant = match request.at {
            At::Live => self.shared.live_instant(&scene)?,
            At::Time(instant) => instant,
        };
        let (observations, gaps) = self.observations(&scene, request.at, instant)?;
        let clock = &*self.shared.clock;
        let limits = (self.ensure_renderer()?.view_limits(), self.shared.render_settings.samples);
        let subject = Subject { gaps, ..Subject::of(request, &scene, instant, &observations, limits)? };
        if let Some((of, answer)) = &self.last
            && *of == subject
        {
            return Ok(answer.clone());
        }
        let renderer = self.ensure_renderer()?;
        match subject.draw(&observations, renderer, clock) {
            Ok(answer) => {
                let metrics = &self.shared.metrics;
                metrics.render_picture.observe(clock.monotonic().saturating_sub(started).as_secs_f64());
                let passes = answer.timings.iter().filter(|(stage, _)| !HOST_STAGES.contains(stage));
                for (pass, time) in passes {
                    metrics.render_pass.with_label_values(&[pass]).observe(time.as_secs_f64());
                }
                self.last = Some((subject, answer.clone()));
                Ok(answer)
            }
            Err(error) => {
                // Also after a fault that the device survives: what it could not allocate stays unusable.
                if matches!(error.kind(), ErrorKind::Unavailable | ErrorKind::Internal) {
                    tracing::warn!(%error, "the renderer failed and will be made anew");
                    self.renderer = None;
                    self.shared.set_renderer_state(Err(error.to_string()));
                }
                Err(failure_of(&error))
            }
        }
    }

    /// What every camera of the scene saw at `instant`, and which of them saw nothing then: of these the background
    /// known at that time is there, without what moved. A camera without even that is left out, but not all may be: then
    /// the first configured camera's reason is the answer.
    fn observations(
        &self,
        scene: &Scene,
        asked: At,
        instant: Timestamp,
    ) -> Result<(Observations, Vec<CameraId>), EngineError> {
        let (mut found, mut gaps) = (Vec::new(), Vec::new());
        let mut failure = None;
        for member in &scene.cameras {
            let camera = member.id.as_str();
            match self.shared.observation(camera, At::Time(instant)) {
                Ok(observation) => found.push((member.id.clone(), observation)),
                Err(EngineError::Gap { before: Some(_), .. }) => {
                    // Gone only if the ring has moved on since.
                    let Ok(mut observation) = self.shared.known_at(camera, instant) else { continue };
                    let age_nanos = instant.nanos_since(observation.frame.timestamp);
                    if asked != At::Live || age_nanos > STALE_NANOS {
                        observation.blobs = Arc::default();
                        gaps.push(member.id.clone());
                    }
                    found.push((member.id.clone(), observation));
                }
                Err(error) => {
                    if matches!(failure, None | Some(EngineError::NoCamera { .. })) {
                        failure = Some(error);
                    }
                }
            }
        }
        match failure {
            Some(error) if found.is_empty() => Err(error),
            _ => Ok((found, gaps)),
        }
    }

    fn ensure_renderer(&mut self) -> Result<&mut Renderer, EngineError> {
        if self.renderer.is_none() {
            let now = self.shared.clock.monotonic();
            if self.failed_at.is_none_or(|failed_at| now.saturating_sub(failed_at) >= DEVICE_RETRY) {
                self.open_device();
            }
        }
        let shared = self.shared;
        let none = || EngineError::Unavailable(format!("no renderer: {}", shared.renderer_state()));
        self.renderer.as_mut().ok_or_else(none)
    }

    fn open_device(&mut self) {
        match open_renderer(&self.shared.render_settings) {
            Ok((renderer, adapter)) => {
                tracing::info!(adapter, "renderer ready");
                self.shared.set_renderer_state(Ok(adapter));
                self.renderer = Some(renderer);
                self.failed_at = None;
            }
            Err(error) => {
                tracing::error!(%error, "no renderer");
                self.shared.set_renderer_state(Err(error.to_string()));
                self.failed_at = Some(self.shared.clock.monotonic());
            }
        }
    }
}

/// The GPU that the settings name and a renderer on it, with the adapter's name.
pub(super) fn open_renderer(
    settings: &crate::config::RenderSettings,
) -> Result<(Renderer, String), EngineError> {
    let gpu = Gpu::new(&settings.adapter).map_err(|error| EngineError::Unavailable(error.to_string()))?;
    let adapter = gpu.name().to_owned();
    let renderer = Renderer::new(gpu, settings).map_err(|error| failure_of(&error))?;
    Ok((renderer, adapter))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::SystemClock;
    use crate::config::RenderSettings;
    use crate::telemetry::Metrics;
    use crate::timeline::EventLog;
    use std::sync::mpsc::sync_channel;

    #[test]
    fn a_panic_costs_its_own_picture_alone() {
        let (queue, _jobs) = sync_channel(1);
        let (clock, metrics) = (Arc::new(SystemClock::new()), Arc::new(Metrics::new()));
        let shared = Shared::new(
            clock,
            metrics,
            (Vec::new(), None),
            (Arc::new(EventLog::new(1)), None),
            (Vec::new(), RenderSettings::default()),
            Arc::default(),
            queue,
        );
        shared.set_renderer_state(Ok("a GPU".to_owned()));
        let mut thread = RenderThread { shared: &shared, renderer: None, failed_at: None, last: None };
        let error = thread.contained(|_| -> Result<(), EngineError> { panic!("told to panic") });
        assert!(matches!(error, Err(EngineError::Internal(_))));
        assert!(!shared.readiness().ready);
        assert_eq!(thread.contained(|_| Ok(7)).unwrap(), 7);
        assert_eq!(thread.failed_at, None, "the next request opens the device again at once");
    }
}
