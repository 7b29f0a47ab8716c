//! (scene, instant, view) -> which effects run, with reasons.

use serde::Serialize;

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
    /// Cameras (indices into `SceneState::cameras`) whose backgrounds are projected on the surfaces.
    pub surface_cameras: Vec<usize>,
    /// Cameras that need a depth map because a box may stand between them and a surface.
    pub depth_map_cameras: Vec<usize>,
    /// How entities are drawn; `None` also when there are none.
    pub entities: EntityStyle,
    /// Cameras whose live frames are uploaded for entities.
    pub entity_cameras: Vec<usize>,
    /// One line an effect: on or off, and the reason.
    pub reasons: Vec<Reason>,
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
