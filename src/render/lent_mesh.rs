//! A mesh of one frame as the device is given it: what it consists of, the cameras that lend to it, and how far it may be wrong.

use super::passes::{MeshSize, NEIGHBOUR_WORDS, VALUE_BYTES};
use crate::gpu::{Gpu, GpuError};
use glam::DVec3;
use std::sync::Arc;
use videofields_vision::fields::{
    DEPTH_PX, Distances, FieldSettings, MAX_VIEWS, Preference, REACH_TRIANGLES, Visibility,
};
use videofields_vision::frame::linear_from_srgb;
use videofields_vision::geometry::Camera;
use videofields_vision::mesh::Mesh;

/// One thing of which there is a mesh.
pub(super) struct MeshPart<'a> {
    pub mesh: &'a Mesh,
    /// Where it stands: what it lent is carried along with it from frame to frame.
    pub home_in_world: DVec3,
    /// What tells it from others over time.
    pub number: u64,
    /// By camera: how much farther on it stands when the part is where its mesh is; none of who does not see it.
    pub shifts: Vec<Option<DVec3>>,
}

/// Parts lie so far apart in what is carried, metres; and so many are told apart.
const PARTS_APART_M: f64 = 64.0;
const MOST_APART: u64 = 61;

/// Vertices at which sizes of pixels are looked at.
const LOOKED_AT: usize = 512;

/// A mesh of one frame, with places relative to its middle.
pub(super) struct LentMesh {
    /// Another for every mesh.
    pub number: u64,
    /// The last of four: which part, by number.
    pub positions: Vec<[f32; 4]>,
    pub homes: Vec<[f32; 4]>,
    pub normals: Vec<[f32; 3]>,
    pub corners: Vec<[u32; 3]>,
    /// The mesh's own colours, linear light; empty where it has none.
    pub colors: Vec<[f32; 4]>,
    /// At most [`MAX_VIEWS`].
    pub cameras: Vec<Arc<Camera>>,
    /// By part and camera.
    pub shifts: Vec<[f32; 4]>,
    pub size: MeshSize,
    pub origin_in_world: DVec3,
    /// Where the first part stands.
    pub home_in_world: DVec3,
    pub reach_m: f64,
    pub depth_m: f64,
    /// Width of a cell in which vertices of another frame are looked for, metres.
    pub cell_m: f64,
    pub settings: FieldSettings,
}

impl std::fmt::Debug for LentMesh {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let n = [self.positions.len(), self.corners.len(), self.cameras.len()];
        formatter
            .debug_struct("LentMesh")
            .field("number", &self.number)
            .field("n", &n)
            .finish_non_exhaustive()
    }
}

impl LentMesh {
    /// Of parts and the cameras that all shifts are of; none without triangles or cameras, and of too many cameras.
    pub(super) fn new(
        number: u64,
        parts: &[MeshPart<'_>],
        cameras: Vec<Arc<Camera>>,
        settings: &FieldSettings,
    ) -> Option<Self> {
        let bounds = parts.iter().filter_map(|part| part.mesh.bounds());
        let [low, high] = bounds.reduce(|[low, high], [a, b]| [low.min(a), high.max(b)])?;
        let n_faces: usize = parts.iter().map(|part| part.mesh.triangles.len()).sum();
        if n_faces == 0 || !(1..=MAX_VIEWS).contains(&cameras.len()) {
            return None;
        }
        let origin_in_world = 0.5 * (low + high);
        let sides_m: f64 =
            parts.iter().map(|part| part.mesh.mean_side_m() * part.mesh.triangles.len() as f64).sum();
        let side_m = sides_m / n_faces as f64;
        let n_vertices = parts.iter().map(|part| part.mesh.positions_m.len()).sum();
        let mut made = Self {
            number,
            positions: Vec::with_capacity(n_vertices),
            homes: Vec::with_capacity(n_vertices),
            normals: Vec::with_capacity(n_vertices),
            corners: Vec::with_capacity(n_faces),
            colors: Vec::new(),
            shifts: Vec::with_capacity(parts.len() * cameras.len()),
            size: MeshSize::new(n_vertices, n_faces, side_m),
            origin_in_world,
            home_in_world: parts.first().map_or(DVec3::ZERO, |part| part.home_in_world),
            reach_m: settings.reach_m.unwrap_or(REACH_TRIANGLES / 3.0 * side_m).max(1e-6),
            depth_m: depth_m(parts, &cameras, (settings, side_m)),
            cell_m: (2.5 * side_m).max(1e-6),
            settings: *settings,
            cameras,
        };
        for (place, part) in (0_u32..).zip(parts) {
            let first = made.positions.len() as u32;
            let apart = DVec3::X * (PARTS_APART_M * (part.number % MOST_APART) as f64);
            let home = apart - part.home_in_world;
            let of = place as f32;
            made.positions.extend(
                part.mesh
                    .positions_m
                    .iter()
                    .map(|at| (*at - origin_in_world).as_vec3().extend(of).to_array()),
            );
            made.homes
                .extend(part.mesh.positions_m.iter().map(|at| (*at + home).as_vec3().extend(0.0).to_array()));
            if let Some(colors) = &part.mesh.colors_srgb {
                // Parts without colours before it have none.
                made.colors.resize(first as usize, [0.0; 4]);
                made.colors.extend(colors.iter().map(|codes| {
                    let [r, g, b] = codes.map(|code| linear_from_srgb(f32::from(code) / 255.0));
                    [r, g, b, 1.0]
                }));
            }
            made.normals.extend(part.mesh.normals.iter().map(|normal| normal.to_array()));
            made.corners
                .extend(part.mesh.triangles.iter().map(|corners| corners.map(|corner| first + corner)));
            made.shifts.extend(
                part.shifts
                    .iter()
                    .map(|shift| shift.map_or([0.0; 4], |shift| shift.as_vec3().extend(1.0).to_array())),
            );
        }
        if !made.colors.is_empty() {
            made.colors.resize(made.positions.len(), [0.0; 4]);
        }
        Some(made)
    }

    /// Holds its lists to what the device's buffers may be.
    ///
    /// # Errors
    /// Of more vertices and cameras than they hold.
    pub(super) fn check(&self, gpu: &Gpu) -> Result<(), GpuError> {
        let [n_vertices, _, n_views] = self.n();
        let needed = u64::from(n_vertices) * (VALUE_BYTES * u64::from(n_views)).max(4 * NEIGHBOUR_WORDS);
        let most = gpu.limits().max_storage_buffer_binding_size;
        if needed > most {
            let message = format!(
                "{n_vertices} vertices of {n_views} cameras take {needed} bytes, at most {most} are allowed"
            );
            return Err(GpuError::Refused { message });
        }
        Ok(())
    }

    /// Vertices, faces, views.
    pub(super) fn n(&self) -> [u32; 3] {
        [self.positions.len() as u32, self.corners.len() as u32, self.cameras.len() as u32]
    }

    /// How hidden vertices are found, as shaders know it; what rays would find depth maps do.
    pub(super) const fn visibility(&self) -> u32 {
        match self.settings.visibility {
            Visibility::Facing => 0,
            Visibility::Depths => 1,
            Visibility::Dilated | Visibility::Rays => 2,
        }
    }

    /// Whether distances are found by windows and not by one front.
    pub(super) const fn has_windows(&self) -> bool {
        matches!(self.settings.distances, Distances::Bounded | Distances::Exact)
    }
}

/// How wrong depths are taken to be where nobody says better: sixteen of the finest pixels, in the median of some vertices that face a
/// camera, as [`videofields_vision::fields::Field::depth_m`] has it of those that are seen; no less than half a side.
fn depth_m(
    parts: &[MeshPart<'_>],
    cameras: &[Arc<Camera>],
    (settings, side_m): (&FieldSettings, f64),
) -> f64 {
    if let Preference::Errors { depth_m: Some(depth_m), .. } = settings.preference {
        return depth_m;
    }
    let n_vertices: usize = parts.iter().map(|part| part.mesh.positions_m.len()).sum();
    let step = n_vertices.div_ceil(LOOKED_AT).max(1);
    let mut finest = Vec::with_capacity(LOOKED_AT + parts.len());
    for part in parts {
        let vertices = part.mesh.positions_m.iter().zip(&part.mesh.normals).step_by(step);
        for (at, normal) in vertices {
            let size_m = |(camera, shift): (&Arc<Camera>, &Option<DVec3>)| {
                let at = *at - (*shift)?;
                let seen = camera.project(at).filter(|seen| seen.is_inside())?;
                let to_eye = (camera.pose().position_in_world - at).normalize_or_zero();
                let facing = to_eye.dot(normal.as_dvec3());
                (facing > 0.01).then(|| seen.depth_m / (camera.focal_px().x * facing))
            };
            let least = cameras.iter().zip(&part.shifts).filter_map(size_m).fold(f64::INFINITY, f64::min);
            finest.extend(least.is_finite().then_some(least));
        }
    }
    let middle = finest.len() / 2;
    let median_m =
        if finest.is_empty() { 0.0 } else { *finest.select_nth_unstable_by(middle, f64::total_cmp).1 };
    (DEPTH_PX * median_m).max(0.5 * side_m)
}
