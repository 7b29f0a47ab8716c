//! From a request to what it means at this moment: the instant, what every camera saw then, and the picture's subject.
//!
//! Used by the render thread and by whoever asks for a plan alone; knows no device.

use super::EngineError;
use super::handle::{At, Door};
use super::picture::{Observations, Subject};
use super::shared::Shared;
use super::view::ViewRequest;
use crate::clock::Timestamp;
use crate::config::RenderSettings;
use crate::frame::CameraId;
use crate::plan::ViewLimits;
use crate::render::view_limits;
use crate::scene::Scene;
use std::sync::Arc;

/// A live view shows what moved before a camera that lags, until its newest picture is this much older than the instant
/// shown; then its background alone, since whom it saw last may be long gone.
const STALE_NANOS: i64 = 5_000_000_000;

/// What cameras saw of an instant, and which of them saw nothing then.
pub(super) type Seen = (Observations, Vec<CameraId>);

/// A request at a moment.
pub(super) struct Resolved {
    pub(super) subject: Arc<Subject>,
    pub(super) seen: Seen,
}

/// The largest picture that may be asked for; the renderer's own, known without one.
pub(super) const fn limits_of(settings: &RenderSettings) -> ViewLimits {
    view_limits(settings.max_pixels)
}

impl Shared {
    /// What `request` means now. Blocks where an instant is asked for that memory does not hold.
    pub(super) fn resolve(&self, request: &ViewRequest) -> Result<Resolved, EngineError> {
        let scene = self.scene_within(&request.scene, &request.scope)?;
        let instant = match request.at {
            At::Live => self.live_instant(&scene)?,
            At::Time(instant) => instant,
        };
        let seen = self.seen_at(&scene, request.at, instant)?;
        let subject = Arc::new(self.subject(request, &scene, instant, &seen)?);
        Ok(Resolved { subject, seen })
    }

    /// What `request` means at `instant`, of which the cameras saw `seen`.
    pub(super) fn subject(
        &self,
        request: &ViewRequest,
        scene: &Arc<Scene>,
        instant: Timestamp,
        (observations, gaps): &Seen,
    ) -> Result<Subject, EngineError> {
        let limits = (limits_of(&self.render_settings), self.render_settings.samples);
        let subject = Subject::of(request, scene, instant, observations, limits)?;
        Ok(Subject { gaps: gaps.clone(), ..subject })
    }

    /// What every camera of the scene saw at `instant`, and which of them saw nothing then: of these the background
    /// known at that time is there, without what moved. A camera without even that is left out, but not all may be: then
    /// the first configured camera's reason is the answer.
    pub(super) fn seen_at(&self, scene: &Scene, asked: At, instant: Timestamp) -> Result<Seen, EngineError> {
        let (mut found, mut gaps) = (Vec::new(), Vec::new());
        let mut failure = None;
        for member in &scene.cameras {
            let camera = member.id.as_str();
            match self.observation(camera, At::Time(instant)) {
                Ok(observation) => found.push((member.id.clone(), observation)),
                Err(EngineError::Gap { before: Some(_), .. }) => {
                    // Gone only if the ring has moved on since.
                    let Ok(mut observation) = self.known_at(camera, instant) else { continue };
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
}
