//! From observations to a picture: fuse, plan, render, each timed. Used by the render thread and without a daemon.

use super::EngineError;
use super::associations::{Overlaps, Remembered};
use super::blurring::CameraBlur;
use super::forecaster::{Decision, Forecaster, NoneFits};
use super::view::{Origin, SourceTime, ViewAnswer, ViewKind, ViewRequest};
use glam::{DVec2, DVec3};
use std::sync::{Arc, LazyLock, Weak};
use std::time::Duration;
use videofields_picture::fuse::SequenceAtInstant;
use videofields_picture::fuse::{Exposure, HullMemory, Placing, SceneState};
use videofields_picture::plan::{
    self, ACROSS_M, Colors, Deadline, Named, Pending, Picture, Plan, Settings, StageTimes, Survey, View,
    ViewLimits, ViewSession, Wishes,
};
use videofields_picture::scene::{Scene, SceneView};
use videofields_render::{Drawing, Progress, RenderError, Renderer};
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::error::Fault;
use videofields_vision::frame::{CameraId, Mask, YuvImage};
use videofields_vision::geometry::Surfaces;
use videofields_vision::observation::Observation;

/// What decides a picture: requests that agree in this share one.
#[derive(Clone)]
pub(super) struct Subject {
    pub(super) scene: Arc<Scene>,
    pub(super) from: SceneView,
    pub(super) kind: ViewKind,
    pub(super) picture: Picture,
    /// With a deadline, the most exact settings that may be chosen.
    pub(super) wishes: Wishes,
    /// Where settings are chosen by the time that is left, within which, and what is not left to choose.
    pub(super) deadline: Option<(Deadline, Named)>,
    pub(super) instant: Timestamp,
    pub(super) sources: Vec<SourceTime>,
    pub(super) gaps: Vec<CameraId>,
    /// What the cameras saw, told by its memory: frames of one time may still differ, after a file was changed or its
    /// background learned anew. Weak, so that nothing is held; no other can take its address meanwhile.
    pub(super) seen: Vec<Memory>,
    /// What of each camera is blurred, where people are.
    pub(super) blurs: Option<Arc<[CameraBlur]>>,
    /// The session that smooths it, if one does.
    pub(super) session: Option<String>,
}

/// Where an observation's frame, mask and background lie.
pub(super) type Memory = (Weak<YuvImage>, Weak<Mask>, Weak<YuvImage>);

impl PartialEq for Subject {
    fn eq(&self, other: &Self) -> bool {
        // Scenes are immutable: the same one is the same allocation.
        Arc::ptr_eq(&self.scene, &other.scene)
            && self.from == other.from
            && self.kind == other.kind
            && self.picture == other.picture
            && self.wishes == other.wishes
            && self.deadline == other.deadline
            && self.instant == other.instant
            && self.sources == other.sources
            && self.gaps == other.gaps
            && self.blurs == other.blurs
            && self.session == other.session
            && self.seen.len() == other.seen.len()
            && self
                .seen
                .iter()
                .zip(&other.seen)
                .all(|(a, b)| a.0.ptr_eq(&b.0) && a.1.ptr_eq(&b.1) && a.2.ptr_eq(&b.2))
    }
}

/// Stages of [`ViewAnswer::timings`] that run on the CPU or span all passes; the others are passes on the GPU.
pub(super) const HOST_STAGES: [&str; 3] = ["fuse", "plan", "render"];

/// What each camera saw.
pub(super) type Observations = Vec<(CameraId, Observation)>;

impl Subject {
    /// What `request` asks for, within `limits`; `samples` as the configuration has them.
    pub(super) fn of(
        request: &ViewRequest,
        scene: &Arc<Scene>,
        instant: Timestamp,
        observations: &Observations,
        (limits, samples): (ViewLimits, u32),
    ) -> Result<Self, EngineError> {
        let own = scene.view.unwrap_or_else(|| overview(scene));
        let from = SceneView {
            eye: request.eye.unwrap_or(own.eye),
            target: request.target.unwrap_or(own.target),
            fov_y_rad: request.fov_y_rad.unwrap_or(own.fov_y_rad),
        };
        let settings = request.effort.settings(request.style, samples).map_err(EngineError::Request)?;
        let (kind, from, picture) =
            pictured(request, scene, from, &limits).map_err(|fault| view_failure(fault, request, &limits))?;
        limits
            .check_drawn(request.width_px, request.height_px, settings.sampling.supersampling)
            .map_err(EngineError::TooLarge)?;
        let source = |(camera, observation): &(CameraId, Observation)| SourceTime {
            camera: camera.clone(),
            timestamp: observation.frame.timestamp,
        };
        let sources = observations.iter().map(source).collect();
        let memory = |(_, of): &(CameraId, Observation)| {
            (Arc::downgrade(&of.frame.image), Arc::downgrade(&of.soft_mask), Arc::downgrade(&of.background))
        };
        let seen = observations.iter().map(memory).collect();
        let effects = scene.effects_of(&request.effects).map_err(EngineError::Request)?;
        let (see_through, colors) = (request.see_through, request.colors);
        let wishes = Wishes { settings, see_through, colors, effects };
        let session = request.session.clone();
        let deadline = request.effort.deadline().map(|deadline| (deadline, request.effort.named));
        let (scene, gaps) = (Arc::clone(scene), Vec::new());
        let blurs = None;
        Ok(Self {
            scene,
            from,
            kind,
            picture,
            wishes,
            deadline,
            instant,
            sources,
            gaps,
            seen,
            blurs,
            session,
        })
    }

    /// Whether a later request can mean the same: not once what was seen has gone from memory.
    pub(super) fn can_be_met(&self) -> bool {
        let is_there = |(frame, mask, background): &Memory| {
            frame.strong_count() > 0 && mask.strong_count() > 0 && background.strong_count() > 0
        };
        self.seen.iter().all(is_there)
    }

    /// The same picture with these settings, chosen or not.
    pub(super) fn with(&self, settings: Settings) -> Self {
        let wishes = Wishes { settings, ..self.wishes };
        Self { wishes, deadline: None, ..self.clone() }
    }

    /// Returns what stands where, by what was seen, without points. Entities keep the ids that are known in `placing`, and cameras go
    /// on from the gains that are `remembered` of the scene.
    pub(super) fn state(
        &self,
        observations: &Observations,
        (placing, remembered): (&mut Placing, &mut Remembered),
        (overlaps, sequences): (&Overlaps, Vec<SequenceAtInstant>),
    ) -> SceneState {
        let find = find_in(observations, &self.gaps);
        let Remembered { exposure, .. } = remembered;
        let mut state = placing.assemble(&self.scene, self.instant, find);
        if self.wishes.colors == Colors::Even {
            exposure.get_or_insert_with(|| Exposure::new(overlaps.of(&self.scene))).even(&mut state);
        }
        state.sequences = sequences;
        // Last, so that who is who and where follows from what was seen.
        if let Some(blurs) = &self.blurs {
            CameraBlur::apply_to(blurs, &mut state);
        }
        state
    }

    /// Decides what of `state` is drawn, and how exactly, as the next of a session if there is one; `hulls` are those made before.
    /// Of a deadline so much is `left`; what of a plan is new to the device is `pending`.
    ///
    /// # Errors
    /// Where nothing fits into what is left.
    pub(super) fn decide(
        &self,
        mut state: SceneState,
        (hulls, session): (&mut HullMemory, Option<&mut ViewSession>),
        forecaster: &Forecaster,
        left: &dyn Fn() -> Duration,
        pending: &dyn Fn(&SceneState, &Plan) -> Pending,
    ) -> Result<Decided, NoneFits> {
        let settings = self.wishes.settings;
        let Some((deadline, named)) = self.deadline else {
            let plan = self.plan(&mut state, settings, (hulls, session));
            let survey = Survey::of(&state, &self.picture, &plan);
            let decision = forecaster.expect(&survey, pending(&state, &plan), &settings);
            return Ok(Decided { state, plan, decision });
        };
        // Points are placed once it is known how many; they are told from their blobs until then.
        let full = plan::make(&state, &self.picture, self.wishes);
        let survey = Survey::of(&state, &self.picture, &full);
        let new = (&survey, pending(&state, &full));
        let decision = forecaster.choose(new, (settings.entities, &named), deadline, left())?;
        let plan = self.plan(&mut state, decision.settings, (hulls, session));
        let decision = forecaster.settled(decision, &survey, pending(&state, &plan));
        Ok(Decided { state, plan, decision })
    }

    fn plan(
        &self,
        state: &mut SceneState,
        settings: Settings,
        (hulls, session): (&mut HullMemory, Option<&mut ViewSession>),
    ) -> Plan {
        settings.place(state, hulls);
        plan::make_for(state, &self.picture, Wishes { settings, ..self.wishes }, session)
    }

    /// Draws what was decided; how long that `took`, fusing and planning, is told with what drawing takes. Nothing comes of it once it is not `wanted` any more.
    pub(super) fn paint(
        &self,
        decided: Decided,
        took: [Duration; 2],
        renderer: &mut Renderer,
        (clock, forecaster): (&dyn Clock, &Forecaster),
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<Option<ViewAnswer>, RenderError> {
        Painting::new(decided, took).paint(self, renderer, (clock, forecaster), wanted)
    }
}

/// Time that a piece of a picture takes about by the first guess of costs: others wait for it. Small machines take four times as long.
const PIECE_TIME: Duration = Duration::from_millis(10);

/// Least time for which a picture with a deadline is planned, however many others wait: what its first pieces take on a small machine.
pub(super) const LEAST_SHARE: Duration = Duration::from_millis(150);

/// Factor by which any other device is taken to be faster than two processors.
const DEVICE_SPEED: f64 = 16.0;

/// Least pixels of a piece: of fewer, what every piece takes would count.
const LEAST_PIECE_PX: u64 = 1 << 14;

/// Most pixels of a piece of a picture. By the plan alone and not by what was measured, so that the same picture has the same bytes.
fn most_pixels(decided: &Decided, picture: &Picture, renderer: &Renderer) -> u64 {
    let speed = if renderer.gpu().is_software() { 1.0 } else { DEVICE_SPEED };
    let n_pieces = decided.decision.task.work.guessed_pixels_ms() / (speed * 1e3 * PIECE_TIME.as_secs_f64());
    let n_pixels = f64::from(picture.width_px) * f64::from(picture.height_px);
    ((n_pixels / n_pieces.max(1.0)) as u64).max(LEAST_PIECE_PX)
}

/// A picture that was decided on, as far as it is drawn.
pub(super) struct Painting {
    decided: Decided,
    /// Times of fusing and planning.
    took: [Duration; 2],
    preparing: Duration,
    drawing: Duration,
    /// None before its first piece, and after a failure.
    drawn: Option<Drawing>,
}

impl Painting {
    /// Begins with what was decided, of which nothing is drawn; fusing and planning it `took` so long.
    pub(super) const fn new(decided: Decided, took: [Duration; 2]) -> Self {
        Self { decided, took, preparing: Duration::ZERO, drawing: Duration::ZERO, drawn: None }
    }

    /// Draws all of it. Nothing comes of it once it is not `wanted` any more.
    pub(super) fn paint(
        mut self,
        subject: &Subject,
        renderer: &mut Renderer,
        (clock, forecaster): (&dyn Clock, &Forecaster),
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<Option<ViewAnswer>, RenderError> {
        loop {
            if !wanted() {
                return Ok(None);
            }
            if self.go_on(subject, renderer, clock)? == Progress::Finished {
                return Ok(self.finish(subject, forecaster));
            }
        }
    }

    /// Draws the next piece. After a failure it begins anew.
    pub(super) fn go_on(
        &mut self,
        subject: &Subject,
        renderer: &mut Renderer,
        clock: &dyn Clock,
    ) -> Result<Progress, RenderError> {
        let Decided { state, plan, .. } = &self.decided;
        let started = clock.monotonic();
        let mut drawn = match self.drawn.take() {
            Some(drawn) => drawn,
            None => {
                self.drawing = Duration::ZERO;
                renderer.make_ready(state, plan)?;
                self.preparing = clock.monotonic().saturating_sub(started);
                let most_pixels = most_pixels(&self.decided, &subject.picture, renderer);
                renderer.begin((state, plan), &subject.picture, most_pixels)?
            }
        };
        let ready = clock.monotonic();
        let progress = renderer.go_on(&mut drawn, (state, plan), &subject.picture)?;
        self.drawing += clock.monotonic().saturating_sub(ready);
        self.drawn = Some(drawn);
        Ok(progress)
    }

    /// Returns true where others may be drawn before its next piece.
    pub(super) fn may_pause(&self) -> bool {
        self.drawn.as_ref().is_some_and(Drawing::may_pause)
    }

    /// Returns what of the drawing is left by what was expected.
    pub(super) fn left(&self) -> Duration {
        let upper_ms = self.decided.decision.expected.forecast.upper_drawing_ms();
        Duration::try_from_secs_f64(upper_ms * 1e-3).unwrap_or_default().saturating_sub(self.drawing)
    }

    /// The answer, once all of it is drawn; none before. What it took is learned from.
    pub(super) fn finish(self, subject: &Subject, forecaster: &Forecaster) -> Option<ViewAnswer> {
        let Self { decided: Decided { plan, decision, .. }, took, preparing, drawing, drawn } = self;
        let rendered = drawn?.into_rendered();
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let passes = rendered.timings.iter().map(|pass| (pass.pass, ms(pass.gpu)));
        let before = ms(took[0].saturating_add(took[1]));
        forecaster.note(&decision, StageTimes::of(before, ms(drawing), passes), preparing);
        let mut timings = vec![
            (HOST_STAGES[0], took[0]),
            (HOST_STAGES[1], took[1]),
            (HOST_STAGES[2], preparing.saturating_add(drawing)),
        ];
        timings.extend(rendered.timings.iter().map(|pass| (pass.pass, pass.gpu)));
        Some(ViewAnswer {
            image: Arc::new(rendered.image),
            instant: subject.instant,
            kind: subject.kind,
            view: subject.from,
            sources: subject.sources.clone(),
            frames: subject.seen.iter().map(|(frame, ..)| frame.clone()).collect(),
            gaps: subject.gaps.clone(),
            blurs: subject.blurs.clone(),
            settings: decision.settings,
            expected: Some(decision.expected),
            plan: Arc::new(plan),
            timings,
            origin: Origin::Drawn,
            identity: None,
        })
    }
}

/// Gives each camera's observation; of those in a gap with a mask that says nothing: nobody knows who is before them.
pub(super) fn find_in<'a>(
    observations: &'a Observations,
    gaps: &'a [CameraId],
) -> impl FnMut(&CameraId) -> Option<Observation> + 'a {
    static NOTHING: LazyLock<Arc<Mask>> = LazyLock::new(|| Arc::new(Mask::filled(0, 0, 0)));
    |id: &CameraId| {
        let (_, seen) = observations.iter().find(|(of, _)| of == id)?;
        let mut seen = seen.clone();
        if gaps.contains(id) {
            seen.labels = Arc::clone(&NOTHING);
        }
        Some(seen)
    }
}

/// What is drawn, and how.
pub(super) struct Decided {
    pub(super) state: SceneState,
    pub(super) plan: Plan,
    pub(super) decision: Decision,
}

/// Why nothing fits, as callers are told: `waited` so long for it to be begun, of the deadline.
pub(super) fn none_fits(
    deadline: Option<Deadline>,
    NoneFits { least }: NoneFits,
    retry_after: Duration,
) -> EngineError {
    let total = deadline.map_or(Duration::ZERO, |deadline| deadline.total);
    let ms = |time: Duration| (time.as_secs_f64() * 1e3).ceil();
    if total < least {
        let message =
            format!("must be at least about {} for this picture: no settings are faster", ms(least));
        return EngineError::TooLarge(Fault::new("deadline_ms", message));
    }
    EngineError::Crowded { least, retry_after }
}

/// Height of a map's eye above everything that stands, metres: room for people on roofs.
const MAP_HEADROOM_M: f64 = 50.0;

/// The picture that a request means, seen `from` somewhere; with it what the request left open.
fn pictured(
    request: &ViewRequest,
    scene: &Scene,
    from: SceneView,
    limits: &ViewLimits,
) -> Result<(ViewKind, SceneView, Picture), Fault> {
    let size = (request.width_px, request.height_px);
    let ends = (from.eye, from.target);
    let distance_m = from.eye.distance(from.target);
    let aspect = f64::from(size.0.max(1)) / f64::from(size.1.max(1));
    match request.kind {
        ViewKind::Perspective => {
            let view = View::new(from.eye, from.target, from.fov_y_rad, size.0, size.1, limits)?;
            Ok((request.kind, from, view.into()))
        }
        ViewKind::Orthographic { across_m } => {
            let at_target = || 2.0 * distance_m * (0.5 * from.fov_y_rad).tan() * aspect;
            let across_m = across_m.unwrap_or_else(|| within(at_target(), ACROSS_M));
            let picture = Picture::orthographic(ends, across_m, size, limits)?;
            Ok((ViewKind::Orthographic { across_m: Some(across_m) }, from, picture))
        }
        ViewKind::Map { across_m, heading_rad } => {
            let (middle, whole_m) = whole_map(&scene.surfaces, heading_rad, aspect);
            let target = request.target.unwrap_or(middle);
            let across_m = across_m.unwrap_or_else(|| within(whole_m, ACROSS_M));
            let top_m = scene.surfaces.bounds().map_or(target.z, |[_, high]| high.z);
            let eye = target.truncate().extend(top_m + MAP_HEADROOM_M);
            let picture = Picture::map(target, eye.z, heading_rad, across_m, size, limits)?;
            let kind = ViewKind::Map { across_m: Some(across_m), heading_rad };
            Ok((kind, SceneView { eye, target, ..from }, picture))
        }
        ViewKind::Panorama { span_rad } => {
            let picture = Picture::panorama(ends, span_rad, from.fov_y_rad, size, limits)?;
            Ok((request.kind, from, picture))
        }
        ViewKind::Stereo { eye_distance_m, convergence_m } => {
            let convergence_m =
                convergence_m.unwrap_or_else(|| distance_m.clamp(eye_distance_m.max(1e-3), 1e8));
            let eyes = (eye_distance_m, convergence_m);
            let picture = Picture::stereo(ends, from.fov_y_rad, size, eyes, limits)?;
            Ok((ViewKind::Stereo { eye_distance_m, convergence_m: Some(convergence_m) }, from, picture))
        }
        ViewKind::Window { corners } => {
            Ok((request.kind, from, Picture::through_window(from.eye, corners, size, limits)?))
        }
    }
}

fn within(value: f64, [least, most]: [f64; 2]) -> f64 {
    value.clamp(least, most)
}

/// The middle of all ground, and the width that a map of it has with a margin, metres.
fn whole_map(surfaces: &Surfaces, heading_rad: f64, aspect: f64) -> (DVec3, f64) {
    let Some([low, high]) = surfaces.ground_bounds() else { return (DVec3::ZERO, 20.0) };
    let half = 0.5 * (high - low);
    let (sin, cos) = heading_rad.sin_cos();
    let across = |x: f64, y: f64| half.x.mul_add(x.abs(), half.y * y.abs());
    let half_width = across(cos, sin).max(across(sin, cos) * aspect);
    (0.5 * (low + high), 2.1 * half_width.max(0.5))
}

/// A view of all the ground from the south and above, for scenes that name none.
fn overview(scene: &Scene) -> SceneView {
    let (target, radius) = match scene.surfaces.ground_bounds() {
        Some([low, high]) => {
            (0.5 * (low + high), 0.5 * (high - low).truncate().max(DVec2::splat(2.0)).length())
        }
        None => (DVec3::ZERO, 10.0),
    };
    let fov_y_rad = 45_f64.to_radians();
    // Far enough back that a sphere around the ground fits the field of view, 35 degrees above the horizon.
    let distance = radius / (0.5 * fov_y_rad).sin();
    let (up, back) = 35_f64.to_radians().sin_cos();
    SceneView { eye: target + DVec3::new(0.0, -back, up) * distance, target, fov_y_rad }
}

/// What is wrong with a view: more pixels than there may be are a limit of the daemon's, all else is the request's.
fn view_failure(fault: Fault, request: &ViewRequest, limits: &ViewLimits) -> EngineError {
    let has_pixels = request.width_px > 0 && request.height_px > 0;
    if has_pixels && limits.check(request.width_px, request.height_px).is_err() {
        EngineError::TooLarge(fault)
    } else {
        EngineError::Request(fault)
    }
}

/// A renderer's failure as the engine's; parameters at fault keep their names.
pub(super) fn failure_of(error: &RenderError) -> EngineError {
    match error {
        RenderError::View(fault) => EngineError::Request(fault.clone()),
        _ => match error.kind() {
            videofields_vision::error::ErrorKind::TooLarge => {
                EngineError::TooLarge(Fault::new("scene", error.to_string()))
            }
            videofields_vision::error::ErrorKind::Unavailable => EngineError::Unavailable(error.to_string()),
            _ => EngineError::Internal(error.to_string()),
        },
    }
}
