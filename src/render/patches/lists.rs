//! Which cameras are blended on each patch in one picture, and what of it is drawn together.

use super::{Patch, Patches, Sight};
use crate::camera_data::Camera;
use crate::gpu::mirror;
use crate::prepare::Stand;
use std::ops::Range;
use std::sync::Arc;
use videofields_picture::plan::{Filtering, Opened};
use videofields_vision::geometry;

/// Most cameras that are blended in one pixel: what a list holds.
pub(crate) const MOST_LISTED: usize = videofields_picture::plan::MAX_BLENDED_CAMERAS;
/// What is left out may have this share of a colour together, where others are sure to have the rest.
const LEAST_SHARE: f64 = 1e-3;

mirror! { "render/surface.wgsl",
/// The cameras of a batch, by their places among the frame's.
pub(crate) struct CameraList {
    low: [u32; 4],
    high: [u32; 4],
}}

/// Which variant of the shader a batch needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Shading {
    pub n_cameras: usize,
    pub has_lenses: bool,
    pub has_depth_maps: bool,
    pub has_depth_cubes: bool,
    pub has_gains: bool,
    pub has_levels: bool,
    /// It has a picture of its own.
    pub has_texture: bool,
    /// Its vertices say what each camera lends.
    pub has_fields: bool,
}

/// Patches that are drawn together: by one variant, with one list of cameras.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Batch {
    pub shading: Shading,
    /// The place of the picture on it among the mesh's.
    pub texture: Option<usize>,
    /// Place of its list in [`Batches::lists`].
    pub list: u32,
    /// In [`Batches::indices`].
    pub indices: Range<u32>,
}

/// All that is drawn of the surfaces in one picture. Kept from picture to picture, so that its memory is.
#[derive(Debug, Default)]
pub(crate) struct Batches {
    pub indices: Vec<u32>,
    pub lists: Vec<CameraList>,
    pub opaque: Vec<Batch>,
    /// Of each opened surface, in their order.
    pub opened: Vec<Vec<Batch>>,
    scratch: Vec<Drawn>,
    ranked: Vec<Ranked>,
}

impl Batches {
    /// Begins a picture without any, in which so many surfaces are open.
    pub(crate) fn begin(&mut self, n_opened: usize) {
        self.indices.clear();
        self.lists.clear();
        self.opaque.clear();
        self.opened.clear();
        self.opened.resize_with(n_opened, Vec::new);
    }
}

impl CameraList {
    /// Of cameras by their places among the frame's.
    pub(crate) fn of(places: [u32; MOST_LISTED]) -> Self {
        let [low, high] = [[0, 1, 2, 3], [4, 5, 6, 7]].map(|four| four.map(|place: usize| places[place]));
        Self { low, high }
    }
}

/// A patch in this picture, in the order in which patches are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Drawn {
    /// 0 of what is opaque, then one more than the opened surface's place.
    layer: usize,
    shading: Shading,
    texture: Option<usize>,
    list: [u8; MOST_LISTED],
    patch: usize,
}

/// A camera that may be blended on a patch.
#[derive(Clone, Copy, Debug)]
struct Ranked {
    camera: u8,
    is_tested: bool,
    is_full: bool,
    /// Fifth roots of its weight: at the patch's middle, and between which it is anywhere on it.
    middle: f64,
    low: f64,
    high: f64,
}

/// What patches are drawn with.
#[derive(Clone, Copy)]
pub(crate) struct Drawing<'a> {
    pub stand: &'a Stand,
    /// The cameras whose backgrounds are projected, with what shaders know of them, in the order of the frame's.
    pub cameras: &'a [Arc<geometry::Camera>],
    pub data: &'a [Camera],
    pub opened: &'a [Opened],
    pub filtering: Filtering,
    /// Most cameras that are blended in one pixel, at most [`MOST_LISTED`].
    pub most_cameras: usize,
}

impl Patches {
    /// Decides which cameras are blended on every patch: those that can see some of it and have a share worth a level of
    /// 255 anywhere, of more than `most_cameras` those with the greatest weights in its middle.
    ///
    /// **Cost** some microseconds a patch.
    pub(crate) fn batch(&self, drawing: &Drawing<'_>, batches: &mut Batches) {
        batches.begin(drawing.opened.len());
        let Batches { indices, lists, opaque, opened, scratch, ranked } = batches;
        let mut in_frame: Vec<Vec<u8>> = vec![Vec::new(); self.cameras.len()];
        for (camera, place) in drawing.cameras.iter().zip(0..) {
            if let Some(known) = self.place_of(camera) {
                in_frame[known].push(place);
            }
        }
        scratch.clear();
        for (idx, patch) in self.patches.iter().enumerate() {
            patch.rank(self, drawing, &in_frame, ranked);
            prune(ranked, drawing.most_cameras.min(MOST_LISTED));
            let is_this = |opened: &Opened| opened.surface == patch.surface;
            let layer = drawing.opened.iter().position(is_this).map_or(0, |place| place + 1);
            scratch.push(drawn(ranked, drawing, (layer, idx), patch.texture));
        }
        scratch.sort_unstable();
        for batch in scratch.chunk_by(|a, b| {
            (a.layer, a.shading, a.texture, a.list) == (b.layer, b.shading, b.texture, b.list)
        }) {
            let first = indices.len() as u32;
            indices.extend(batch.iter().flat_map(|drawn| self.patches[drawn.patch].vertices.clone()));
            let Drawn { layer, shading, texture, list, .. } = batch[0];
            lists.push(CameraList::of(list.map(u32::from)));
            let batch = Batch {
                shading,
                texture,
                list: lists.len() as u32 - 1,
                indices: first..indices.len() as u32,
            };
            if layer == 0 { &mut *opaque } else { &mut opened[layer - 1] }.push(batch);
        }
    }
}

fn drawn(
    ranked: &[Ranked],
    drawing: &Drawing<'_>,
    (layer, patch): (usize, usize),
    texture: Option<usize>,
) -> Drawn {
    let mut list = [0; MOST_LISTED];
    for (slot, camera) in list.iter_mut().zip(ranked) {
        *slot = camera.camera;
    }
    let of = |ranked: &Ranked| &drawing.data[usize::from(ranked.camera)];
    let has_depth_maps = ranked.iter().any(|ranked| ranked.is_tested && of(ranked).n_depth_faces > 0);
    let shading = Shading {
        n_cameras: ranked.len(),
        has_lenses: ranked.iter().any(|ranked| of(ranked).has_lens()),
        has_depth_maps,
        has_depth_cubes: has_depth_maps && ranked.iter().any(|ranked| of(ranked).n_depth_faces > 1),
        has_gains: ranked.iter().any(|ranked| of(ranked).has_gain()),
        has_levels: drawing.filtering == Filtering::Levels && !ranked.is_empty(),
        has_texture: texture.is_some(),
        has_fields: false,
    };
    Drawn { layer, shading, texture, list, patch }
}

impl Patch {
    /// The cameras that may be blended on it, with bounds of their weights.
    fn rank(&self, patches: &Patches, drawing: &Drawing<'_>, in_frame: &[Vec<u8>], ranked: &mut Vec<Ranked>) {
        ranked.clear();
        let Stand { eye_in_world, parallel_to, .. } = *drawing.stand;
        let (to_viewer, viewer_spread) = match parallel_to {
            Some(forward) => (-forward, 0.0),
            None => self.direction_to(eye_in_world),
        };
        let from_eye = parallel_to.map_or(eye_in_world - self.center, |forward| -forward);
        let height = from_eye.dot(self.normal);
        let (side, normal) = if height >= 0.0 { (0, self.normal) } else { (1, -self.normal) };
        for Sight { camera, seen } in self.sights.iter().filter(|sight| sight.seen.sides[side]) {
            let places = &in_frame[usize::from(*camera)];
            if places.is_empty() {
                continue;
            }
            let position = patches.cameras[usize::from(*camera)].pose().position_in_world;
            let (to_camera, spread) = self.direction_to(position);
            let between = to_camera.dot(to_viewer).clamp(-1.0, 1.0).acos();
            // Of what is uneven nothing is known of how squarely it is seen.
            let off_normal = to_camera.dot(normal).clamp(-1.0, 1.0).acos();
            let is_level = self.normal != glam::DVec3::ZERO;
            let (least, most) = if is_level { (off_normal, off_normal) } else { (0.0, f64::MAX) };
            let weight = |off_normal: f64, between: f64| {
                let within = |angle: f64| angle.clamp(0.0, std::f64::consts::PI).cos();
                within(off_normal).max(0.0) * (1.0 + within(between))
            };
            ranked.extend(places.iter().map(|place| Ranked {
                camera: *place,
                is_tested: seen.is_tested,
                is_full: seen.is_full,
                middle: weight(least, between),
                low: weight(most + spread, between + spread + viewer_spread),
                high: weight(least - spread, between - spread - viewer_spread),
            }));
        }
    }

    /// The direction from its middle to a point, and how far off it may be from anywhere else on it, radians.
    fn direction_to(&self, point: glam::DVec3) -> (glam::DVec3, f64) {
        let offset = point - self.center;
        let distance_m = offset.length();
        if distance_m <= self.radius_m {
            return (offset.normalize_or_zero(), std::f64::consts::PI);
        }
        (offset / distance_m, (self.radius_m / distance_m).asin())
    }
}

/// Leaves out who cannot have a share worth a level, then all but the `most` greatest; the rest by their places.
fn prune(ranked: &mut Vec<Ranked>, most: usize) {
    let sure: f64 = ranked.iter().filter(|camera| camera.is_full).map(|camera| camera.low.powi(5)).sum();
    let least = LEAST_SHARE * sure / ranked.len().max(1) as f64;
    ranked.retain(|camera| camera.high.powi(5) >= least);
    if ranked.len() > most {
        ranked.sort_by(|a, b| b.middle.total_cmp(&a.middle).then(a.camera.cmp(&b.camera)));
        ranked.truncate(most);
    }
    ranked.sort_by_key(|camera| camera.camera);
}
