//! (scene, instant, view) -> which effects run, with reasons.
//!
//! In: a `SceneState` and a [`View`]. Out: a [`Plan`], made without drawing anything. Must not know the GPU: it says
//! what is needed, `render` alone knows how.

mod cost;
mod coverage;
mod entities;
mod view;

pub use cost::{COST_TABLE_VERSION, CostRow, CostTable, Machine, Spread, quantile};
pub use view::{View, ViewLimits};

use crate::fuse::SceneState;
use serde::Serialize;

/// Most cameras whose backgrounds are blended in one picture: the cost of every pixel grows with each, and beyond
/// the best few their weights are too small to see.
pub const MAX_SURFACE_CAMERAS: usize = 8;

/// Most cameras whose live frames are drawn with entities in one picture; with the surfaces' cameras, what a frame's
/// data holds.
pub const MAX_ENTITY_CAMERAS: usize = 112;

/// How moving entities are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EntityStyle {
    /// One upright textured rectangle an entity (deferred pruning, Video Fields algorithm 2).
    #[default]
    Billboards,
    /// One small square a foreground texel (early pruning, Video Fields algorithm 1).
    Points,
    /// Not at all.
    None,
}

/// Which passes a picture needs, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Plan {
    /// Cameras (indices into `SceneState::cameras`) whose backgrounds are projected on the surfaces, best first.
    pub surface_cameras: Vec<usize>,
    /// Cameras that need a depth map because a box may stand between them and a surface; a part of
    /// `surface_cameras`.
    pub depth_map_cameras: Vec<usize>,
    /// How entities are drawn; `None` also when there are none.
    pub entities: EntityStyle,
    /// Entities that are drawn as billboards, each by which of its sources; empty for other styles.
    pub billboards: Vec<PlannedBillboard>,
    /// Cameras whose live frames are uploaded for entities.
    pub entity_cameras: Vec<usize>,
    /// One line an effect: on or off, and the reason.
    pub reasons: Vec<Reason>,
}

/// Which of an entity's sources is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PlannedBillboard {
    /// Index into `SceneState::entities`.
    pub entity: usize,
    /// Index into the entity's `sources`.
    pub source: usize,
}

/// Why an effect runs or does not.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Reason {
    /// The effect, named as its pass.
    pub effect: &'static str,
    /// Whether it runs.
    pub is_on: bool,
    /// Why.
    pub because: String,
}

/// Plans the picture of `state` from `view` with its entities drawn as `style`.
///
/// **Cost** some hundred rays through the scene's surfaces; no pixel is touched.
#[must_use]
pub fn make(state: &SceneState, view: &View, style: EntityStyle) -> Plan {
    let mut reasons = Vec::new();
    let surface_cameras = plan_surface(state, view, &mut reasons);
    let depth_map_cameras = plan_depth_maps(state, &surface_cameras, &mut reasons);
    let mut plan = Plan {
        surface_cameras,
        depth_map_cameras,
        entities: EntityStyle::None,
        billboards: Vec::new(),
        entity_cameras: Vec::new(),
        reasons,
    };
    entities::plan(state, view, style, &mut plan);
    plan
}

fn plan_surface(state: &SceneState, view: &View, reasons: &mut Vec<Reason>) -> Vec<usize> {
    let surfaces = &state.scene.surfaces;
    let mut reason = |is_on, because| reasons.push(Reason { effect: "surface", is_on, because });
    if surfaces.ground.is_empty() && surfaces.boxes.is_empty() {
        reason(false, "the scene has no ground and no box".to_owned());
        return Vec::new();
    }
    let mut ranked = coverage::rank_cameras(state, view);
    let n_seeing = ranked.len();
    ranked.truncate(MAX_SURFACE_CAMERAS);
    reason(
        true,
        match (n_seeing, state.cameras.len()) {
            (_, 0) => "no camera has a picture: surfaces show their material".to_owned(),
            (0, n) => format!("none of {n} cameras sees a surface in view: surfaces show their material"),
            (seeing, n) if seeing > ranked.len() => {
                format!("{seeing} of {n} cameras see surfaces in view; the best {} are blended", ranked.len())
            }
            (seeing, n) => format!("{seeing} of {n} cameras see surfaces in view"),
        },
    );
    ranked
}

fn plan_depth_maps(state: &SceneState, surface_cameras: &[usize], reasons: &mut Vec<Reason>) -> Vec<usize> {
    let surfaces = &state.scene.surfaces;
    let needs_map = |idx: &usize| coverage::may_be_obstructed(&state.cameras[*idx].camera, surfaces);
    let cameras: Vec<usize> = surface_cameras.iter().copied().filter(needs_map).collect();
    let because = if cameras.is_empty() {
        "no occluder between any camera and any surface".to_owned()
    } else {
        format!(
            "something may stand before a surface for {} of {} cameras",
            cameras.len(),
            surface_cameras.len()
        )
    };
    reasons.push(Reason { effect: "camera_depth", is_on: !cameras.is_empty(), because });
    cameras
}
