//! Entities' hulls as one mesh a frame, for texture fields: found on the processor, kept while the hulls are the same.

use super::lent_mesh::{LentMesh, MeshPart};
use rayon::prelude::*;
use std::sync::{Arc, Weak};
use videofields_picture::fuse::{EntityHull, SceneState};
use videofields_picture::plan::Plan;
use videofields_vision::fields::FieldSettings;
use videofields_vision::hull::{Bounds, Method, RESOLUTION, extract};
use videofields_vision::mesh::Mesh;

/// Places along the longest side of a hull's mesh, at most: 3 cm of a person. Its surface lies between them to the texel.
const MOST_PLACES: u32 = 64;

/// Most hulls whose meshes are kept.
const MOST_KEPT: usize = 256;

/// A hull's mesh; none where it has no surface.
#[derive(Debug)]
struct Kept {
    hull: Weak<EntityHull>,
    n_voxels: u32,
    mesh: Option<Arc<Mesh>>,
}

/// What a frame's mesh was made of.
#[derive(Debug)]
struct Last {
    hulls: Vec<Weak<EntityHull>>,
    n_voxels: u32,
    mesh: Option<Arc<LentMesh>>,
}

/// Meshes of hulls that were made of late.
#[derive(Debug, Default)]
pub(super) struct HullMeshes {
    /// The one made last first.
    kept: Vec<Kept>,
    last: Option<Last>,
    n_made: u64,
}

impl HullMeshes {
    /// All hulls of a plan as one mesh with the cameras that see any of them; none where none of them has a surface.
    ///
    /// **Cost** of new hulls [`extract`] with as many places along their longest side as the plan has voxels, at most [`MOST_PLACES`],
    /// on all processors.
    pub(super) fn of(&mut self, state: &SceneState, plan: &Plan) -> Option<Arc<LentMesh>> {
        let hulls: Vec<&Arc<EntityHull>> = plan.meshed_hulls.iter().map(|idx| &state.hulls[*idx]).collect();
        let n_voxels = plan.hull.n_voxels.min(MOST_PLACES);
        let is_same = |last: &&Last| {
            let pairs = || last.hulls.iter().zip(&hulls);
            last.n_voxels == n_voxels
                && last.hulls.len() == hulls.len()
                && pairs().all(|(known, hull)| std::ptr::eq(known.as_ptr(), Arc::as_ptr(hull)))
        };
        if let Some(last) = self.last.as_ref().filter(is_same) {
            return last.mesh.clone();
        }
        let meshes = self.meshes(&hulls, n_voxels);
        self.n_made += 1;
        let mesh = whole(self.n_made, (state, &hulls), &meshes).map(Arc::new);
        let hulls = hulls.into_iter().map(Arc::downgrade).collect();
        self.last = Some(Last { hulls, n_voxels, mesh: mesh.clone() });
        mesh
    }

    fn meshes(&mut self, hulls: &[&Arc<EntityHull>], n_voxels: u32) -> Vec<Option<Arc<Mesh>>> {
        let known = |hull: &&Arc<EntityHull>| {
            let is_this = |kept: &&Kept| {
                kept.n_voxels == n_voxels && std::ptr::eq(kept.hull.as_ptr(), Arc::as_ptr(hull))
            };
            self.kept.iter().find(is_this).map(|kept| kept.mesh.clone())
        };
        let before: Vec<Option<Option<Arc<Mesh>>>> = hulls.iter().map(known).collect();
        let found: Vec<Option<Arc<Mesh>>> = hulls
            .par_iter()
            .zip(before.par_iter())
            .map(|(hull, before)| before.clone().unwrap_or_else(|| mesh_of(hull, n_voxels).map(Arc::new)))
            .collect();
        for ((hull, before), mesh) in hulls.iter().zip(before).zip(&found) {
            if before.is_none() {
                self.kept.insert(0, Kept { hull: Arc::downgrade(hull), n_voxels, mesh: mesh.clone() });
            }
        }
        // What has gone from memory is never met again.
        self.kept.retain(|kept| kept.hull.strong_count() > 0);
        self.kept.truncate(MOST_KEPT);
        found
    }
}

fn mesh_of(hull: &EntityHull, n_voxels: u32) -> Option<Mesh> {
    let [low, high] = hull.bounds_in_world;
    let bounds = Bounds::new(low, high)?;
    let resolution = n_voxels.clamp(*RESOLUTION.start(), *RESOLUTION.end());
    extract(&hull.hull, &bounds, (Method::ImageBased, resolution)).ok()
}

fn whole(
    number: u64,
    (state, hulls): (&SceneState, &[&Arc<EntityHull>]),
    meshes: &[Option<Arc<Mesh>>],
) -> Option<LentMesh> {
    let mut cameras: Vec<usize> = hulls.iter().flat_map(|hull| hull.cameras.iter().copied()).collect();
    cameras.sort_unstable();
    cameras.dedup();
    let parts: Vec<MeshPart<'_>> = hulls
        .iter()
        .zip(meshes)
        .filter_map(|(hull, mesh)| {
            let mesh = mesh.as_deref()?;
            let entity = state.entities.get(hull.entity_idx)?;
            let shift = |camera: &usize| {
                let view = hull.hull.views().get(hull.cameras.iter().position(|of| of == camera)?)?;
                let stands = state.cameras[*camera].corrected.pose().position_in_world;
                Some(view.camera().pose().position_in_world - stands)
            };
            let shifts = cameras.iter().map(shift).collect();
            Some(MeshPart { mesh, home_in_world: entity.foot_in_world, number: entity.id, shifts })
        })
        .collect();
    let cameras = cameras.iter().map(|idx| Arc::clone(&state.cameras[*idx].corrected)).collect();
    LentMesh::new(number, &parts, cameras, &FieldSettings::of_changing())
}
