//! Which entities are drawn as hulls, and how their surfaces are found and textured.

use super::{EntityStyle, MAX_ENTITY_CAMERAS, Picture};
use crate::fuse::{EntityHull, LEAST_VIEWS, SceneState};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Most hulls of one picture, and most silhouettes of them all: what every device's arrays hold. Of more, those are drawn that cover
/// most of it, the others as billboards.
pub(super) const MAX_HULLS: usize = 64;
const MAX_VIEWS: usize = 256;

/// Frames that are further apart in time are no silhouettes of one shape, seconds: limbs swing, whatever is known of the way.
pub const MAX_SKEW_S: f64 = 0.3;

/// Nor are those between which somebody may have gone by more that is not known, metres: 0.1 s of a first sight.
pub const MAX_APART_M: f64 = 0.15;

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
        },
    };

    /// The cheap form.
    pub const CHEAP: Self = Self {
        n_voxels: 64,
        texture: HullTexture { visibility: HullVisibility::Off, ..Self::EXACT.texture },
        ..Self::EXACT
    };
}

/// Where each is drawn as what is truest of it: cameras that all look along one line, but for less than this, leave a shape that is long
/// along it. From further apart on hulls are truer than billboards from anywhere (docs/benchmarks/hulls.md).
const AUTO_APART_DEG: f64 = 25.0;

/// By how much the cameras of a hull look along lines that differ, at most, radians up to a quarter turn.
fn apart_rad(state: &SceneState, hull: &EntityHull) -> f64 {
    let [low, high] = hull.bounds_in_world;
    let middle = (low + high) / 2.0;
    let direction =
        |idx: &usize| (middle - state.cameras[*idx].corrected.pose().position_in_world).normalize_or_zero();
    let directions: Vec<DVec3> = hull.cameras.iter().map(direction).collect();
    let pairs =
        directions.iter().enumerate().flat_map(|(i, a)| directions[..i].iter().map(move |b| a.cross(*b)));
    pairs.map(|across| across.length().min(1.0).asin()).fold(0.0, f64::max)
}

fn is_of_one_shape(hull: &EntityHull) -> bool {
    hull.skew_s <= MAX_SKEW_S && hull.apart_m <= MAX_APART_M
}

/// The hulls of `state` that may be drawn as such, wherever they are.
pub(super) fn that_may_be(state: &SceneState, (style, form): (EntityStyle, &HullForm)) -> Vec<usize> {
    let may_be = |idx: &usize| {
        let hull = &state.hulls[*idx];
        let is_apart = || apart_rad(state, hull) >= AUTO_APART_DEG.to_radians();
        hull.cameras.len() >= form.least_cameras as usize
            && is_of_one_shape(hull)
            && (style != EntityStyle::Auto || is_apart())
    };
    (0..state.hulls.len()).filter(may_be).collect()
}

/// The hulls of `state` that `picture` shows, the largest first, and why the others of it are not drawn as such.
pub(super) fn choose(
    state: &SceneState,
    picture: &Picture,
    (style, form): (EntityStyle, &HullForm),
) -> (Vec<usize>, Vec<String>) {
    let is_in_view = |hull: &EntityHull| {
        let [low, high] = hull.bounds_in_world;
        picture.may_show((low + high) / 2.0, (high - low).length() / 2.0)
    };
    let in_view: Vec<usize> = (0..state.hulls.len()).filter(|idx| is_in_view(&state.hulls[*idx])).collect();
    let is_enough = |idx: &usize| state.hulls[*idx].cameras.len() >= form.least_cameras as usize;
    let (enough, few): (Vec<usize>, Vec<usize>) = in_view.into_iter().partition(is_enough);
    let (chosen, skewed): (Vec<usize>, Vec<usize>) =
        enough.into_iter().partition(|idx| is_of_one_shape(&state.hulls[*idx]));
    let is_apart = |idx: &usize| {
        style != EntityStyle::Auto || apart_rad(state, &state.hulls[*idx]) >= AUTO_APART_DEG.to_radians()
    };
    let (mut chosen, alike): (Vec<usize>, Vec<usize>) = chosen.into_iter().partition(is_apart);
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
        because.push(format!("{} seen by fewer than {} cameras", few.len(), form.least_cameras));
    }
    let most =
        |of: fn(&EntityHull) -> f64| skewed.iter().map(|idx| of(&state.hulls[*idx])).fold(0.0, f64::max);
    if !skewed.is_empty() {
        let (n, most_s, most_m) = (skewed.len(), most(|of| of.skew_s), most(|of| of.apart_m));
        because.push(format!(
            "{n} seen up to {most_s:.2} s apart, in which they may have moved by {most_m:.2} m that is not known: more than \
             {MAX_SKEW_S} s or {MAX_APART_M} m"
        ));
    }
    if !alike.is_empty() {
        let n = alike.len();
        because.push(format!("{n} seen along one line but for less than {AUTO_APART_DEG} degrees"));
    }
    if chosen.len() < n_chosen {
        because.push(format!("{} beyond what one picture holds", n_chosen - chosen.len()));
    }
    (chosen, because)
}
