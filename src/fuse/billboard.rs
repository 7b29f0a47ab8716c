//! Deferred pruning: one upright rectangle a blob.
//!
//! Video Fields (Du, Bista, Varshney 2016), algorithm 2, in a form that holds for cameras with roll and beyond the
//! horizon: the base line runs through the lowest contact texel along the level line that faces the camera, and
//! the extent is the mask outline's rays cut with the upright plane through it. (The paper's widths come from the
//! image rectangle's corners on the ground, its height from tan(theta) there: that errs with pitch and roll, and
//! has no value above the horizon.)

use super::{Billboard, CameraState, Sighting};
use crate::geometry::{Camera, Ray, Surfaces};
use crate::segment::Blob;
use glam::{DVec2, DVec3};

/// A blob's label in the hard mask.
pub(super) const MOVING: u8 = 255;

/// Least and greatest extent of a billboard, metres: below, nothing is left to draw; above, the foot was wrong.
const EXTENT_RANGE_M: [f64; 2] = [0.05, 30.0];

/// Rows of a blob whose outline is cut with the plane, at most: neighbouring rows hardly differ.
const MAX_OUTLINE_ROWS: u32 = 96;

/// Nearer than this to the camera's nadir, an upright plane has no direction to face, metres.
const NADIR_M: f64 = 0.05;

/// Every blob of a camera as a billboard; blobs whose foot meets no surface are left out.
pub(super) fn sightings<'a>(
    camera_idx: usize,
    state: &'a CameraState,
    surfaces: &'a Surfaces,
) -> impl Iterator<Item = Sighting> + 'a {
    state.observation.blobs.iter().filter_map(move |blob| sighting(camera_idx, state, surfaces, blob))
}

fn sighting(camera_idx: usize, state: &CameraState, surfaces: &Surfaces, blob: &Blob) -> Option<Sighting> {
    let mask = &state.observation.labels;
    let texture_of = |x: f64, y: f64| DVec2::new(x / f64::from(mask.width), y / f64::from(mask.height));
    let [foot_x, foot_y] = blob.foot_in_image;
    let foot_in_world = ground_point(&state.camera, surfaces, texture_of(foot_x, foot_y))?;
    let above = ground_point(&state.camera, surfaces, texture_of(foot_x, foot_y - 1.0));
    let footprint_m = above.map_or(f64::INFINITY, |above| (above - foot_in_world).length());

    let plane = UprightPlane::facing(&state.camera, foot_in_world)?;
    let rect = blob.rect;
    let row_step = rect.height.div_ceil(MAX_OUTLINE_ROWS).max(1) as usize;
    let (mut left, mut right, mut top) = (f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY);
    for y in (rect.y..rect.y + rect.height).step_by(row_step) {
        let row = &mask.row(y)[rect.x as usize..(rect.x + rect.width) as usize];
        let is_moving = |value: &u8| *value == MOVING;
        let (Some(first), Some(last)) = (row.iter().position(is_moving), row.iter().rposition(is_moving))
        else {
            continue;
        };
        // A pixel's outer edges, so that the rectangle covers whole pixels.
        for x in [f64::from(rect.x) + first as f64, f64::from(rect.x) + last as f64 + 1.0] {
            let Some([across, _]) = plane.cut(&state.camera, texture_of(x, f64::from(y) + 0.5)) else {
                continue;
            };
            left = left.min(across);
            right = right.max(across);
        }
        let middle = f64::from(rect.x) + 0.5 * (first + last + 1) as f64;
        if let Some([_, up]) = plane.cut(&state.camera, texture_of(middle, f64::from(y))) {
            top = top.max(up);
        }
    }
    // The lowest texel may belong to either foot, or to a corner where the camera is rolled: the outline's middle
    // says better where along the base line the entity stands.
    let foot_in_world = plane.point([0.5 * (left + right), 0.0]);
    let half_width = 0.5 * (right - left);
    let [least, most] = EXTENT_RANGE_M;
    let is_sound = |extent: f64| extent >= least && extent <= most;
    (is_sound(right - left) && is_sound(top)).then_some(Sighting {
        billboard: Billboard {
            camera_idx,
            rect,
            foot_in_world,
            right_in_world: plane.right,
            left_right_m: [-half_width, half_width],
            height_m: top,
            is_truncated: blob.is_truncated,
        },
        footprint_m,
    })
}

/// Where a texel's ray meets what something can stand on. A wall met first stands behind the foot: its own foot
/// is then the farthest place that can be meant.
fn ground_point(camera: &Camera, surfaces: &Surfaces, texture: DVec2) -> Option<DVec3> {
    use crate::geometry::{Face, SurfaceId};
    let ray = camera.ray(texture)?;
    let hit = surfaces.hit(&ray, 0.0)?;
    match (hit.surface, hit.face) {
        (_, Face::Top) => Some(hit.point_in_world),
        (SurfaceId::Box(_), Face::Side) => {
            let down = Ray { origin: hit.point_in_world + hit.normal_in_world * 0.05, direction: -DVec3::Z };
            surfaces.hit(&down, 0.0).map(|below| below.point_in_world)
        }
        _ => None,
    }
}

/// The upright plane through a foot that faces a camera horizontally.
pub(super) struct UprightPlane {
    foot: DVec3,
    normal: DVec3,
    right: DVec3,
}

impl UprightPlane {
    fn facing(camera: &Camera, foot: DVec3) -> Option<Self> {
        let away = (foot - camera.pose().position_in_world).truncate();
        if away.length() < NADIR_M {
            return None;
        }
        let away = away.normalize().extend(0.0);
        Some(Self { foot, normal: -away, right: away.cross(DVec3::Z) })
    }

    /// The plane of a billboard that exists.
    pub(super) fn of(billboard: &Billboard) -> Self {
        let right = billboard.right_in_world;
        Self { foot: billboard.foot_in_world, normal: right.cross(DVec3::Z), right }
    }

    /// Where a texel's ray meets the plane: metres to the right of the foot and above it.
    pub(super) fn cut(&self, camera: &Camera, texture: DVec2) -> Option<[f64; 2]> {
        let ray = camera.ray(texture)?;
        let from_foot = ray.at(ray.distance_to_plane(self.foot, self.normal)?) - self.foot;
        Some([from_foot.dot(self.right), from_foot.z])
    }

    /// The inverse of [`Self::cut`].
    pub(super) fn point(&self, [across_m, up_m]: [f64; 2]) -> DVec3 {
        self.foot + self.right * across_m + DVec3::Z * up_m
    }
}
