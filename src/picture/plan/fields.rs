//! Whether what stands still is coloured by texture fields, and how far they have followed one who looks.

use super::{EntityStyle, MAX_ENTITY_CAMERAS, Plan, Reason, hulls};
use crate::fuse::SceneState;
use crate::scene::Scene;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Weak};
use videofields_vision::clock::Timestamp;
use videofields_vision::fields::MAX_VIEWS;

/// How cameras' pictures become one on what stands still.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FieldsForm {
    /// Pixel by pixel, from who looks squarely and as the viewer does.
    #[default]
    Off,
    /// By weights of a fine mesh's vertices, from who looks squarely: the baseline (Holoportation).
    Normals,
    /// By texture fields (`Montage4D`): from whose colours are least beside, less towards the seams of each, smoothly over time.
    Montage,
}

impl FieldsForm {
    /// All of them with their words, from cheap to exact.
    pub const ALL: [(&'static str, Self); 3] =
        [("off", Self::Off), ("normals", Self::Normals), ("montage", Self::Montage)];

    /// Its word in requests and answers.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Normals => "normals",
            Self::Montage => "montage",
        }
    }
}

/// Whose fields are followed on, and for how long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Followed {
    /// The session's, another for each.
    pub number: u64,
    /// Scene time since they were last drawn, seconds, at least 0; none where they begin anew.
    pub passed_secs: Option<f64>,
    /// The instant that they are drawn at, for what is not in every picture.
    pub instant: Timestamp,
}

impl Followed {
    /// Scene time since something of the session was last drawn, `at` some instant: as [`Self::passed_secs`] has it of all.
    #[must_use]
    pub fn passed_since(&self, at: Option<Timestamp>) -> Option<f64> {
        self.passed_secs?;
        passed(self.instant, at)
    }
}

/// Scene time that passed, if fields go on over it.
fn passed(instant: Timestamp, since: Option<Timestamp>) -> Option<f64> {
    let passed = instant.secs_since(since?);
    (-LONGEST_BACK_SECS..=LONGEST_STEP_SECS).contains(&passed).then_some(passed.max(0.0))
}

/// A session's fields go on over steps of scene time up to this, and stand still for pictures of up to so long before, seconds.
const LONGEST_STEP_SECS: f64 = 5.0;
const LONGEST_BACK_SECS: f64 = 0.5;

/// Numbers of sessions that were given out.
static N_SESSIONS: AtomicU64 = AtomicU64::new(0);

/// What of fields is remembered of one who looks: when they were last drawn. Weights themselves are the renderer's.
#[derive(Clone, Debug, Default)]
pub(super) struct FieldsHistory {
    number: Option<u64>,
    scene: Weak<Scene>,
    at: Option<Timestamp>,
}

impl FieldsHistory {
    /// Goes on to the state's instant.
    fn follow(&mut self, state: &SceneState) -> Followed {
        let number = *self.number.get_or_insert_with(|| N_SESSIONS.fetch_add(1, Ordering::Relaxed));
        let is_same = std::ptr::eq(self.scene.as_ptr(), Arc::as_ptr(&state.scene));
        let passed_secs = passed(state.instant, self.at.filter(|_| is_same));
        if passed_secs.is_none_or(|passed| passed > 0.0) {
            self.at = Some(state.instant);
            self.scene = Arc::downgrade(&state.scene);
        }
        Followed { number, passed_secs, instant: state.instant }
    }
}

/// Decides whether fields run: where they are asked for, and some camera's picture is on a surface or somebody is drawn as a hull.
pub(super) fn plan(
    state: &SceneState,
    (form, style): (FieldsForm, EntityStyle),
    history: Option<&mut FieldsHistory>,
    plan: &mut Plan,
) {
    let n_cameras = state.cameras.len();
    let is_asked_for = form != FieldsForm::Off;
    let has_surfaces = !plan.surface_cameras.is_empty();
    if is_asked_for && has_surfaces && n_cameras <= MAX_VIEWS {
        plan.fields = form;
    }
    let hull_cameras: BTreeSet<usize> =
        plan.hulls.iter().flat_map(|idx| state.hulls[*idx].cameras.iter().copied()).collect();
    if is_asked_for && (1..=MAX_VIEWS).contains(&hull_cameras.len()) {
        plan.hull_fields = form;
        mesh_hulls(state, style, plan);
    }
    let has_sequences = is_asked_for && !plan.sequences.is_empty();
    let is_on = plan.fields != FieldsForm::Off || plan.hull_fields != FieldsForm::Off || has_sequences;
    let mut because = match form {
        FieldsForm::Off => "not asked for",
        _ if !has_surfaces && plan.hulls.is_empty() && !has_sequences => {
            "no camera's picture is on a surface in view, and nobody is drawn as a hull"
        }
        FieldsForm::Normals => "asked for: who looks squarely lends most",
        FieldsForm::Montage => "asked for: whose colours are least beside lends most, less towards its seams",
    }
    .to_owned();
    if plan.hull_fields != FieldsForm::Off {
        let n = plan.hulls.len();
        because.push_str(&format!("; {n} {} as meshes", if n == 1 { "hull" } else { "hulls" }));
    }
    if has_sequences {
        let n = plan.sequences.len();
        because.push_str(&format!("; {n} recorded {}", if n == 1 { "sequence" } else { "sequences" }));
    }
    let beyond = [
        ("surfaces", has_surfaces && n_cameras > MAX_VIEWS, n_cameras),
        ("hulls", hull_cameras.len() > MAX_VIEWS, hull_cameras.len()),
    ];
    for (what, _, n) in beyond.into_iter().filter(|(_, is_so, _)| *is_so && is_asked_for) {
        because.push_str(&format!("; not {what}, which {n} cameras see: fields are of at most {MAX_VIEWS}"));
    }
    if is_on {
        plan.followed = history.map(|history| history.follow(state));
    }
    if plan.fields != FieldsForm::Off && !plan.depth_map_cameras.is_empty() {
        plan.depth_map_cameras.clear();
        plan.reasons.retain(|reason| reason.effect != "camera_depth");
        let because = "fields know which vertices are hidden".to_owned();
        plan.reasons.push(Reason { effect: "camera_depth", is_on: false, because });
    }
    plan.reasons.push(Reason { effect: "fields", is_on, because });
}

/// Which hulls are one mesh: all that may be, whatever of them is in view, so that all pictures of an instant share it and each hides the
/// others from cameras; where they are too many, those in view.
fn mesh_hulls(state: &SceneState, style: EntityStyle, plan: &mut Plan) {
    plan.meshed_hulls = plan.hulls.clone();
    plan.meshed_hulls.sort_unstable();
    let all = hulls::that_may_be(state, (style, &plan.hull));
    let cameras = || all.iter().flat_map(|idx| state.hulls[*idx].cameras.iter().copied());
    let of_hulls: BTreeSet<usize> = cameras().collect();
    let of_all: BTreeSet<usize> = cameras().chain(plan.entity_cameras.iter().copied()).collect();
    let is_room = of_hulls.len() <= MAX_VIEWS && of_all.len() <= MAX_ENTITY_CAMERAS;
    if is_room && all.len() <= hulls::MAX_HULLS && plan.hulls.iter().all(|idx| all.contains(idx)) {
        plan.meshed_hulls = all;
        plan.entity_cameras = of_all.into_iter().collect();
    }
}
