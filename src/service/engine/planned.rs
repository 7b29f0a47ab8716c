//! The plan of a view without its picture: what would be drawn of whom and why. Needs no device, and waits for none.

use super::EngineError;
use super::associations::Remembered;
use super::flow::Flow;
use super::forecaster::{Expected, usual_pending};
use super::handle::surface_name;
use super::picture::{Decided, Subject, none_fits};
use super::resolve::Resolved;
use super::shared::Shared;
use super::view::{SourceTime, ViewKind, ViewRequest};
use glam::DVec3;
use std::time::Duration;
use videofields_picture::fuse::HullMemory;
use videofields_picture::plan::{EntityStyle, Opened, PlannedBillboard, Reason, Settings};
use videofields_picture::scene::SceneView;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// What would be drawn if the view were asked for now; cameras by their ids.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedView {
    /// The instant shown.
    pub instant: Timestamp,
    /// How the world comes onto the picture; what the request left open is filled in.
    pub kind: ViewKind,
    /// Where it is seen from.
    pub view: SceneView,
    /// Columns and rows.
    pub size_px: [u32; 2],
    /// Flat parts that it is put together from.
    pub n_parts: usize,
    /// The cameras that have a frame for it.
    pub sources: Vec<SourceTime>,
    /// Those of them that saw nothing near the instant: of these the background alone is shown.
    pub gaps: Vec<CameraId>,
    /// What cameras' colours are multiplied by, in linear light, red, green and blue; 1 where they are shown as they are.
    pub gains: Vec<(CameraId, [f32; 3])>,
    /// Cameras whose backgrounds are shown on surfaces, best first.
    pub surface_cameras: Vec<CameraId>,
    /// Those of them that need a depth map.
    pub depth_map_cameras: Vec<CameraId>,
    /// Cameras whose live frames show what moves.
    pub entity_cameras: Vec<CameraId>,
    /// How what moves is drawn; `None` also where there is nothing.
    pub style: EntityStyle,
    /// What is drawn one by one.
    pub entities: Vec<PlannedEntity>,
    /// Buildings that are drawn translucent, the farthest first.
    pub opened: Vec<OpenedBuilding>,
    /// How exactly it is drawn.
    pub settings: Settings,
    /// What it is expected to take, and which error it leaves.
    pub expected: Option<Expected>,
    /// One line an effect: on or off, and the reason.
    pub reasons: Vec<Reason>,
}

/// One thing that moves, and whose picture of it is shown.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedEntity {
    /// Where it stands, metres.
    pub foot_in_world: DVec3,
    /// The camera whose picture of it is shown.
    pub shown_from: CameraId,
    /// The cameras that see it.
    pub seen_by: Vec<CameraId>,
}

/// A building that is drawn translucent, since it hides somebody.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenedBuilding {
    /// Which kind of surface it is.
    pub surface: &'static str,
    /// Its index among those of its kind in the scene.
    pub surface_idx: u16,
    /// How much of what lies behind it it covers, above 0, below 1.
    pub opacity: f32,
}

impl Shared {
    /// Plans a view, as the render thread would now.
    pub(super) fn planned(&self, request: &ViewRequest) -> Result<PlannedView, EngineError> {
        let Resolved { subject, seen: (observations, _) } = self.resolve(request)?;
        self.refresh_forecaster();
        // Gains that are remembered from picture to picture are the render thread's; this is what they come to.
        let sequences = self.sequences_of(&subject);
        let placing = self.placing_of(&subject.scene);
        let state = {
            let mut own = placing.lock();
            subject.state(&observations, (&mut own, &mut Remembered::default()), (&self.overlaps, sequences))
        };
        let deadline = subject.deadline.map(|(deadline, _)| deadline);
        // The wait is that of somebody who has nothing else waiting.
        let waits = self.queue.retry_after(&Flow::Common);
        let left = || {
            let drawing = deadline.map_or(Duration::MAX, |of| of.total.saturating_sub(of.reserve));
            drawing.saturating_sub(waits)
        };
        let decided = subject
            .decide(state, (&mut HullMemory::default(), None), &self.forecaster, &left, &usual_pending)
            .map_err(|none| none_fits(deadline, none, waits))?;
        Ok(named(&subject, decided))
    }
}

/// A plan with ids in place of indices.
fn named(subject: &Subject, Decided { state, plan, decision }: Decided) -> PlannedView {
    let id = |idx: usize| state.cameras[idx].id.clone();
    let ids = |cameras: &[usize]| cameras.iter().copied().map(id).collect::<Vec<_>>();
    let entity = |planned: &PlannedBillboard| {
        let entity = &state.entities[planned.entity];
        PlannedEntity {
            foot_in_world: entity.foot_in_world,
            shown_from: id(entity.sources[planned.source].camera_idx),
            seen_by: entity.cameras().map(id).collect(),
        }
    };
    let opened = |of: &Opened| {
        let (surface, surface_idx) = surface_name(of.surface);
        OpenedBuilding { surface, surface_idx, opacity: of.opacity }
    };
    PlannedView {
        instant: subject.instant,
        kind: subject.kind,
        view: subject.from,
        size_px: [subject.picture.width_px, subject.picture.height_px],
        n_parts: subject.picture.parts.len(),
        sources: subject.sources.clone(),
        gaps: subject.gaps.clone(),
        gains: state.cameras.iter().map(|camera| (camera.id.clone(), camera.gain.to_array())).collect(),
        surface_cameras: ids(&plan.surface_cameras),
        depth_map_cameras: ids(&plan.depth_map_cameras),
        entity_cameras: ids(&plan.entity_cameras),
        style: plan.entities,
        entities: plan
            .billboards
            .chunk_by(|a, b| a.entity == b.entity)
            .map(|parts| entity(&parts[0]))
            .collect(),
        opened: plan.opened.iter().map(opened).collect(),
        settings: decision.settings,
        expected: Some(decision.expected),
        reasons: plan.reasons,
    }
}
