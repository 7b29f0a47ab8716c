//! Which entities are drawn as hulls, and how their surfaces are found and textured.

use super::{EntityStyle, MAX_ENTITY_CAMERAS, Picture};
use crate::fuse::{EntityHull, LEAST_VIEWS, SceneState};
use serde::{Deserialize, Serialize};

/// Most hulls of one picture, and most silhouettes of them all: what every device's arrays hold. Of more, those are drawn that cover
/// most of it, the others as billboards.
const MAX_HULLS: usize = 64;
const MAX_VIEWS: usize = 256;

/// Frames that are further apart in time are no silhouettes of one shape, seconds: who walks moves by 0.15 m.
pub const MAX_SKEW_S: f64 = 0.1;

/// Of a mask's pixels, by how much outlines are simplified.
pub(super) const OUTLINE_ERROR_PX: f64 = 0.5;

/// Voxels along the longest side of an entity's bounds.
pub const HULL_VOXELS: [u32; 4] = [32, 64, 128, 256];

/// How a hull's surface is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HullMethod {
    /// The outermost voxels of a grid, a square each that faces the eye (microfacets, 2003).
    Voxels,
    /// Every cone's faces are drawn where all other silhouettes hold them (2003).
    Trimming,
    /// Where trimming finds anything, coarsely, the cones' faces are peeled and counted (2004).
    Hybrid,
    /// The cones' faces are peeled layer by layer, and counted from infinity (2004).
    Csg,
    /// Every pixel's ray is cut by the outlines (image-based; Matusik et al. 2000).
    #[default]
    Rays,
}

impl HullMethod {
    /// All of them with their words.
    pub const ALL: [(&'static str, Self); 5] = [
        ("voxels", Self::Voxels),
        ("trimming", Self::Trimming),
        ("hybrid", Self::Hybrid),
        ("csg", Self::Csg),
        ("rays", Self::Rays),
    ];

    /// Its word in requests and answers.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Voxels => "voxels",
            Self::Trimming => "trimming",
            Self::Hybrid => "hybrid",
            Self::Csg => "csg",
            Self::Rays => "rays",
        }
    }
}

/// How cameras are found before whom something else of the hulls stands: they lend no colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HullVisibility {
    /// Not at all.
    Off,
    /// By what every camera sees of the hulls as depth maps, found by trimming (reference depth maps, 2004, section 4.3).
    Depths,
    /// By rays from the surface to the cameras: exact.
    Rays,
}

impl HullVisibility {
    /// All of them with their words, from cheap to exact.
    pub const ALL: [(&'static str, Self); 3] =
        [("off", Self::Off), ("depths", Self::Depths), ("rays", Self::Rays)];

    /// Its word in requests and answers.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Depths => "depths",
            Self::Rays => "rays",
        }
    }
}

/// Where cameras' weights by obliqueness and direction are worked out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub enum HullWeights {
    /// At the corners of the cones' faces, and in between as the rasteriser would have it (2003); for comparison.
    Corners,
    /// At every fragment (2004, section 4.4).
    Fragments,
}

/// How a hull's surface is textured from the cameras that see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct HullTexture {
    /// Which cameras are left out.
    pub visibility: HullVisibility,
    /// Whether cameras count less towards their silhouettes' outlines.
    pub feather: bool,
    /// Where weights are worked out; faces' corners are known to the methods that draw or cut faces, not to voxels.
    pub weights: HullWeights,
    /// By how many codes (of 255, of square roots of linear light) the cameras that see a place may differ before it is taken for
    /// a ghost, which is not drawn: silhouettes of others leave places that each camera sees somebody else at. 0: not looked at.
    pub ghost_codes: u32,
}

/// How hulls are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct HullForm {
    /// How the surface is found.
    pub method: HullMethod,
    /// With voxels, how many along the longest side of an entity's bounds: one of [`HULL_VOXELS`].
    pub n_voxels: u32,
    /// Whom fewer cameras see is drawn as a billboard: 2 or more. By two alone a shape is a slab, and still truer halfway between them
    /// than either's billboard (docs/benchmarks/hulls.md).
    pub least_cameras: u32,
    /// How it is textured.
    pub texture: HullTexture,
}

impl HullForm {
    /// The exact form.
    pub const EXACT: Self = Self {
        method: HullMethod::Rays,
        n_voxels: 128,
        least_cameras: LEAST_VIEWS as u32,
        texture: HullTexture {
            visibility: HullVisibility::Rays,
            feather: true,
            weights: HullWeights::Fragments,
            ghost_codes: 0,
        },
    };

    /// The cheap form.
    pub const CHEAP: Self = Self {
        n_voxels: 64,
        texture: HullTexture { visibility: HullVisibility::Off, ..Self::EXACT.texture },
        ..Self::EXACT
    };
}

/// Where each is drawn as what is truest of it, cameras that must see somebody for a hull: of two silhouettes slabs are left.
const AUTO_LEAST_CAMERAS: u32 = 3;

/// There, whom a camera sees from no further aside than this is shown by that camera alone: the picture that it took is truer than any
/// shape (docs/benchmarks/hulls.md).
const AUTO_BESIDE_DEG: f64 = 8.0;

/// The angle between the viewer's direction to a hull and that of the camera of it that looks most like it, radians.
fn beside_rad(state: &SceneState, picture: &Picture, hull: &EntityHull) -> f64 {
    let [low, high] = hull.bounds_in_world;
    let middle = (low + high) / 2.0;
    let viewer = picture.viewer.direction_to(middle);
    let angle = |idx: &usize| {
        let eye = state.cameras[*idx].camera.pose().position_in_world;
        viewer.angle_between(middle - eye)
    };
    // Where a camera stands in the middle there is no direction.
    hull.cameras.iter().map(angle).filter(|angle| angle.is_finite()).fold(f64::INFINITY, f64::min)
}

/// The hulls of `state` that `picture` shows, the largest first, and why the others of it are not drawn as such.
pub(super) fn choose(
    state: &SceneState,
    picture: &Picture,
    (style, form): (EntityStyle, &HullForm),
) -> (Vec<usize>, Vec<String>) {
    let is_auto = style == EntityStyle::Auto;
    let least_cameras = if is_auto { form.least_cameras.max(AUTO_LEAST_CAMERAS) } else { form.least_cameras };
    let is_in_view = |hull: &EntityHull| {
        let [low, high] = hull.bounds_in_world;
        picture.may_show((low + high) / 2.0, (high - low).length() / 2.0)
    };
    let in_view: Vec<usize> = (0..state.hulls.len()).filter(|idx| is_in_view(&state.hulls[*idx])).collect();
    let is_enough = |idx: &usize| state.hulls[*idx].cameras.len() >= least_cameras as usize;
    let (enough, few): (Vec<usize>, Vec<usize>) = in_view.into_iter().partition(is_enough);
    let (chosen, skewed): (Vec<usize>, Vec<usize>) =
        enough.into_iter().partition(|idx| state.hulls[*idx].skew_s <= MAX_SKEW_S);
    let is_aside = |idx: &usize| {
        !is_auto || beside_rad(state, picture, &state.hulls[*idx]) > AUTO_BESIDE_DEG.to_radians()
    };
    let (mut chosen, alike): (Vec<usize>, Vec<usize>) = chosen.into_iter().partition(is_aside);
    let size = |idx: &usize| {
        let [low, high] = state.hulls[*idx].bounds_in_world;
        let middle = (low + high) / 2.0;
        let pixels = |part: &super::Part| part.view.pixels_per_metre(middle)[1];
        picture.parts.iter().map(pixels).fold(0.0, f64::max) * (high.z - low.z)
    };
    chosen.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.cmp(b)));
    let n_chosen = chosen.len();
    chosen.truncate(MAX_HULLS);
    let (mut n_views, mut cameras) = (0, Vec::new());
    let fits = |idx: &usize| {
        let of = &state.hulls[*idx].cameras;
        let new: Vec<usize> = of.iter().filter(|camera| !cameras.contains(*camera)).copied().collect();
        if n_views + of.len() > MAX_VIEWS || cameras.len() + new.len() > MAX_ENTITY_CAMERAS {
            return false;
        }
        n_views += of.len();
        cameras.extend(new);
        true
    };
    let mut fits = fits;
    chosen.retain(|idx| fits(idx));
    let mut because = Vec::new();
    if !few.is_empty() {
        because.push(format!("{} seen by fewer than {least_cameras} cameras", few.len()));
    }
    if let Some(most) = skewed.iter().map(|idx| state.hulls[*idx].skew_s).reduce(f64::max) {
        let (n, limit) = (skewed.len(), MAX_SKEW_S);
        because.push(format!("{n} seen up to {most:.2} s apart, more than {limit} s"));
    }
    if !alike.is_empty() {
        because.push(format!(
            "{} seen by a camera as the viewer does, within {AUTO_BESIDE_DEG} degrees",
            alike.len()
        ));
    }
    if chosen.len() < n_chosen {
        because.push(format!("{} beyond what one picture holds", n_chosen - chosen.len()));
    }
    (chosen, because)
}
