//! (scene, instant, picture) -> which effects run, with reasons.
//!
//! In: a `SceneState` and a [`Picture`] with the caller's [`Wishes`]. Out: a [`Plan`], made without drawing anything. Must not know the GPU: it says
//! what is needed, `render` alone knows how.

mod choose;
mod cost;
mod coverage;
mod effects;
mod entities;
mod errors;
mod exposure;
mod fields;
mod fit;
mod hulls;
mod picture;
mod predict;
mod see_through;
mod sequences;
mod settings;
mod sources;
mod stages;
#[cfg(test)]
mod tests;
mod view;
mod work;

pub use choose::{Choice, Known};
pub use cost::{COST_TABLE_VERSION, CostRow, CostTable, Machine, Spread};
pub use effects::{PlannedEffects, PlannedLight, anchor_px};
pub use errors::Errors;
pub use fields::{FieldsForm, Followed};
pub use hulls::{
    HULL_VOXELS, HullForm, HullMethod, HullTexture, HullVisibility, HullWeights, MAX_APART_M, MAX_SKEW_S,
};
pub use picture::{ACROSS_M, Part, Picture, Viewer};
pub use predict::{Basis, Forecast, Model, Task, told};
pub use see_through::{OPEN_OPACITY, Opened, ViewSession};
pub use settings::{
    Aim, Deadline, Detail, Effort, Filtering, MAX_ENTITY_SOURCES, Named, POINT_STRIDES, Preset, Settings,
    candidates,
};
pub use stages::{StageTimes, TimedStage};
pub use view::{Frustum, Projection, View, ViewLimits};
pub use work::{Feature, Pending, Program, Survey, Variant, Work};

use crate::fuse::SceneState;
use crate::scene::Sky;
use serde::Serialize;
use videofields_vision::effects::EffectSettings;
use videofields_vision::error::Fault;

/// Most cameras whose backgrounds are taken for one picture; a pixel costs what the few of them cost that see it.
pub const MAX_SURFACE_CAMERAS: usize = 100;

/// Most cameras that are blended at a pixel: beyond the best few their weights are too small to see.
pub const MAX_BLENDED_CAMERAS: usize = 8;

/// Most cameras whose live frames are drawn with entities in one picture; with the surfaces' cameras, what a frame's
/// data holds.
pub const MAX_ENTITY_CAMERAS: usize = 112;

/// How moving entities are drawn.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum EntityStyle {
    /// One upright textured rectangle an entity (deferred pruning, Video Fields algorithm 2).
    #[default]
    Billboards,
    /// One small square a foreground texel (early pruning, Video Fields algorithm 1).
    Points,
    /// The shape that all silhouettes leave, where two cameras or more see somebody at once; else a billboard.
    Hulls,
    /// What is truest of each in the time that there is: a hull where cameras from different sides see somebody, else a billboard.
    Auto,
    /// Not at all.
    None,
}

impl EntityStyle {
    /// Whether any may be drawn as billboards.
    #[must_use]
    pub const fn has_billboards(self) -> bool {
        matches!(self, Self::Billboards | Self::Hulls | Self::Auto)
    }

    /// Whether any may be drawn as hulls.
    #[must_use]
    pub const fn has_hulls(self) -> bool {
        matches!(self, Self::Hulls | Self::Auto)
    }
}

/// Most samples a pixel each way that are drawn and averaged.
pub const MAX_SUPERSAMPLING: u32 = 4;

/// How often a pixel is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct Sampling {
    /// Places of a pixel at which edges are looked for, while its colour is found once: 1 or 4.
    pub samples: u32,
    /// Pixels each way that are drawn for one and averaged in linear light: 1 to [`MAX_SUPERSAMPLING`].
    pub supersampling: u32,
}

impl Sampling {
    /// A pixel is its middle.
    pub const ONCE: Self = Self { samples: 1, supersampling: 1 };

    /// Holds it to the forms that there are.
    ///
    /// # Errors
    /// With `samples` or `supersampling` as the fault's place.
    pub fn check(&self) -> Result<(), Fault> {
        if !matches!(self.samples, 1 | 4) {
            return Err(Fault::new("samples", format!("must be 1 or 4, got {}", self.samples)));
        }
        if !(1..=MAX_SUPERSAMPLING).contains(&self.supersampling) {
            let message = format!("must be 1 to {MAX_SUPERSAMPLING}, got {}", self.supersampling);
            return Err(Fault::new("supersampling", message));
        }
        Ok(())
    }
}

/// Whose word on colours counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Colors {
    /// Exposure and white balance are evened out between cameras that see the same surfaces.
    #[default]
    Even,
    /// As each camera gives them.
    Raw,
}

/// What whoever asks for a picture may wish for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wishes {
    /// How exactly it is drawn.
    pub settings: Settings,
    /// Whether buildings open where they hide somebody.
    pub see_through: bool,
    /// Whether cameras' colours are made to agree.
    pub colors: Colors,
    /// What is done to the picture once the scene is drawn.
    pub effects: EffectSettings,
}

/// Which passes a picture needs, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Cameras (indices into `SceneState::cameras`) whose backgrounds are projected on the surfaces, best first.
    pub surface_cameras: Vec<usize>,
    /// Cameras that need a depth map because a box may stand between them and a surface; a part of
    /// `surface_cameras`.
    pub depth_map_cameras: Vec<usize>,
    /// How entities are drawn; `None` also when there are none.
    pub entities: EntityStyle,
    /// Entities that are drawn, each by which of its sources.
    pub billboards: Vec<PlannedBillboard>,
    /// Hulls that are drawn (indices into `SceneState::hulls`), the largest first.
    pub hulls: Vec<usize>,
    /// How hulls are drawn.
    pub hull: HullForm,
    /// Cameras whose live frames are uploaded for entities.
    pub entity_cameras: Vec<usize>,
    /// Buildings that are drawn translucent, since they hide an entity, the farthest first.
    #[serde(skip)]
    pub opened: Vec<Opened>,
    /// Whether the cameras' colours are multiplied by their gains.
    pub evens_colors: bool,
    /// Whether what stands still is coloured by texture fields, and which.
    pub fields: FieldsForm,
    /// Whether hulls are drawn as meshes that are coloured so, and which.
    pub hull_fields: FieldsForm,
    /// Hulls that are one mesh then (indices into `SceneState::hulls`), in order.
    #[serde(skip)]
    pub meshed_hulls: Vec<usize>,
    /// Recorded sequences that are drawn (indices into `SceneState::sequences`).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sequences: Vec<usize>,
    /// How cameras' pictures become one on them.
    #[serde(skip)]
    pub sequence_fields: FieldsForm,
    /// Whose fields these are, if a session's.
    #[serde(skip)]
    pub followed: Option<Followed>,
    /// Most cameras that are blended at a pixel.
    pub most_cameras_a_pixel: usize,
    /// How cameras' backgrounds are looked up.
    pub filtering: Filtering,
    /// Whether the sky takes a pass: one colour is what the picture is cleared to.
    #[serde(skip)]
    pub sky: bool,
    /// What is done to the picture once the scene is drawn.
    #[serde(skip)]
    pub effects: PlannedEffects,
    /// How often a pixel is looked at.
    pub sampling: Sampling,
    /// How many of the pixels are drawn.
    pub resolution: Detail,
    /// One line an effect: on or off, and the reason.
    pub reasons: Vec<Reason>,
}

impl Plan {
    /// A picture of which nothing was planned yet: no camera, nobody, no effect.
    #[must_use]
    pub fn bare(settings: &Settings) -> Self {
        Self {
            surface_cameras: Vec::new(),
            depth_map_cameras: Vec::new(),
            entities: EntityStyle::None,
            billboards: Vec::new(),
            hulls: Vec::new(),
            hull: settings.hull,
            entity_cameras: Vec::new(),
            opened: Vec::new(),
            evens_colors: false,
            fields: FieldsForm::Off,
            hull_fields: FieldsForm::Off,
            meshed_hulls: Vec::new(),
            sequences: Vec::new(),
            sequence_fields: FieldsForm::Off,
            followed: None,
            most_cameras_a_pixel: settings.most_cameras,
            filtering: settings.filtering,
            sky: false,
            effects: PlannedEffects::default(),
            sampling: settings.sampling,
            resolution: settings.resolution,
            reasons: Vec::new(),
        }
    }
}

/// Which of an entity's sources show it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlannedBillboard {
    /// Index into `SceneState::entities`.
    pub entity: usize,
    /// Index into the entity's `sources`: the one that shows most of it.
    pub source: usize,
    /// Its share: one half to 1.
    pub weight: f32,
    /// The source that has the rest, where another looks nearly as much as the viewer does and both agree.
    pub beside: Option<PlannedSource>,
}

/// A source with its share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlannedSource {
    /// Index into the entity's `sources`.
    pub source: usize,
    /// Its share: above 0, at most one half.
    pub weight: f32,
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

/// Plans `picture` of `state` by itself: what is smoothed over time is settled.
///
/// **Cost** some hundred rays through the scene's surfaces, and some for every entity; no pixel is touched.
#[must_use]
pub fn make(state: &SceneState, picture: &Picture, wishes: Wishes) -> Plan {
    make_for(state, picture, wishes, None)
}

/// Plans `picture` of `state` as the next of a session, which goes on to the state's instant.
///
/// **Cost** as [`make`].
#[must_use]
pub fn make_for(
    state: &SceneState,
    picture: &Picture,
    wishes: Wishes,
    mut session: Option<&mut ViewSession>,
) -> Plan {
    let mut reasons = Vec::new();
    let settings = wishes.settings;
    let surface_cameras = plan_surface(state, picture, &mut reasons);
    let depth_map_cameras = if settings.depth_maps {
        plan_depth_maps(state, &surface_cameras, &mut reasons)
    } else {
        let because = "left out by the settings".to_owned();
        reasons.push(Reason { effect: "camera_depth", is_on: false, because });
        Vec::new()
    };
    let sky = state.scene.sky.plain_srgb().is_none();
    let mut plan = Plan { surface_cameras, depth_map_cameras, sky, reasons, ..Plan::bare(&settings) };
    entities::plan(state, picture, &settings, &mut plan);
    sequences::plan(state, picture, settings.fields, &mut plan);
    let history = session.as_deref_mut().map(|session| &mut session.fields);
    fields::plan(state, (settings.fields, settings.entities), history, &mut plan);
    exposure::plan(state, wishes.colors, &mut plan);
    if wishes.see_through {
        see_through::plan(state, picture, (settings.entities, session), &mut plan);
    } else {
        let because = "not asked for".to_owned();
        plan.reasons.push(Reason { effect: "see_through", is_on: false, because });
    }
    plan_sky(&state.scene.sky, &mut plan.reasons);
    effects::plan(state, &wishes.effects, &mut plan);
    plan_sampling(&settings, &mut plan.reasons);
    plan
}

fn plan_surface(state: &SceneState, picture: &Picture, reasons: &mut Vec<Reason>) -> Vec<usize> {
    let surfaces = &state.scene.surfaces;
    let mut reason = |is_on, because| reasons.push(Reason { effect: "surface", is_on, because });
    if surfaces.is_empty() {
        reason(false, "the scene has no surface".to_owned());
        return Vec::new();
    }
    let mut ranked = coverage::rank_cameras(state, picture);
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

fn plan_sky(sky: &Sky, reasons: &mut Vec<Reason>) {
    let (is_on, because) = match sky {
        Sky::Plain { .. } => (false, "the sky is one colour, to which the picture is cleared"),
        Sky::Gradient { .. } => (true, "the sky's colour follows the height above the horizon"),
        Sky::Picture { .. } => (true, "the sky is a picture"),
    };
    reasons.push(Reason { effect: "sky", is_on, because: because.to_owned() });
}

fn plan_sampling(settings: &Settings, reasons: &mut Vec<Reason>) {
    let times = settings.sampling.supersampling;
    let (is_on, because) = if times > 1 {
        (true, format!("{times} x {times} pixels are drawn for one: asked for"))
    } else {
        (false, "not asked for".to_owned())
    };
    reasons.push(Reason { effect: "average", is_on, because });
    let step = settings.resolution.step_px();
    let (is_on, because) = if step > 1 {
        (true, format!("one of {step} x {step} pixels is drawn, the others lie between"))
    } else {
        (false, "every pixel is drawn".to_owned())
    };
    reasons.push(Reason { effect: "enlarge", is_on, because });
}
