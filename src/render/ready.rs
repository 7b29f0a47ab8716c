//! Scenes that are made ready to be drawn: their triangles, and these in patches for the scene's cameras.

use super::RenderError;
use super::field_mesh::FieldMesh;
use super::mesh::Mesh;
use super::patches::Patches;
use super::renderer::Renderer;
use std::sync::Arc;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{FieldsForm, Plan};
use videofields_picture::scene::Scene;
use videofields_vision::geometry::Camera;

/// Scenes that are kept ready: walls show some in turns, and cutting one anew takes as long as some pictures of it.
pub const MAX_READY_SCENES: usize = 4;

#[derive(Debug)]
struct ReadyScene {
    mesh: Arc<Mesh>,
    patches: Arc<Patches>,
    /// Once a plan has called for it.
    fields: Option<Arc<FieldMesh>>,
}

/// The scenes that were drawn last.
#[derive(Debug, Default)]
pub(super) struct ReadyScenes {
    /// The last first.
    kept: Vec<ReadyScene>,
    n_meshes: u64,
    n_patches: u64,
}

impl ReadyScenes {
    fn place_of(&self, scene: &Arc<Scene>) -> Option<usize> {
        self.kept.iter().position(|ready| Arc::ptr_eq(&ready.mesh.scene, scene))
    }

    /// Whether nothing must be made for this state.
    fn has(&self, state: &SceneState) -> bool {
        let ready = self.place_of(&state.scene).map(|place| &self.kept[place]);
        ready.is_some_and(|ready| ready.patches.serve(&ready.mesh, &cameras_of(state)))
    }

    /// Triangles and patches of the state's scene for its cameras, made anew where the scene or a camera is another.
    pub(super) fn of(&mut self, state: &SceneState, depth_map_side_px: u32) -> (Arc<Mesh>, Arc<Patches>) {
        // Of a scene that was changed or taken away nothing is kept, nor of its pictures.
        self.kept.retain(|ready| Arc::strong_count(&ready.mesh.scene) > 1);
        let cameras = cameras_of(state);
        let known = self.place_of(&state.scene).map(|place| self.kept.remove(place));
        let ready = match known {
            Some(ready) if ready.patches.serve(&ready.mesh, &cameras) => ready,
            known => {
                let mesh = known.map_or_else(
                    || {
                        self.n_meshes += 1;
                        Arc::new(Mesh::new(&state.scene, self.n_meshes))
                    },
                    |ready| ready.mesh,
                );
                self.n_patches += 1;
                let patches = Arc::new(Patches::new(&mesh, cameras, depth_map_side_px, self.n_patches));
                ReadyScene { mesh, patches, fields: None }
            }
        };
        let found = (Arc::clone(&ready.mesh), Arc::clone(&ready.patches));
        self.kept.insert(0, ready);
        self.kept.truncate(MAX_READY_SCENES);
        found
    }
}

impl ReadyScenes {
    /// The fine mesh of the state's scene for its cameras, made where it is not there yet.
    pub(super) fn fields_of(&mut self, state: &SceneState, depth_map_side_px: u32) -> Arc<FieldMesh> {
        let (mesh, _) = self.of(state, depth_map_side_px);
        let cameras = cameras_of(state);
        let ready = &mut self.kept[0];
        match &ready.fields {
            Some(fields) if fields.serves(&mesh, &cameras) => Arc::clone(fields),
            _ => {
                self.n_patches += 1;
                let fields = Arc::new(FieldMesh::new(&mesh, cameras, self.n_patches));
                ready.fields = Some(Arc::clone(&fields));
                fields
            }
        }
    }

    /// Whether [`Self::fields_of`] has nothing to do.
    fn has_fields(&self, state: &SceneState) -> bool {
        let ready = self.place_of(&state.scene).map(|place| &self.kept[place]);
        let serves = |ready: &ReadyScene| {
            ready.fields.as_ref().is_some_and(|fields| fields.serves(&ready.mesh, &cameras_of(state)))
        };
        ready.is_some_and(serves)
    }
}

fn cameras_of(state: &SceneState) -> Vec<Arc<Camera>> {
    state.cameras.iter().map(|camera| Arc::clone(&camera.camera)).collect()
}

impl Renderer {
    /// Whether [`Self::make_ready`] has nothing to do.
    pub(super) fn is_ready(&self, state: &SceneState, plan: &Plan) -> bool {
        self.scenes.has(state) && (plan.fields == FieldsForm::Off || self.scenes.has_fields(state))
    }

    /// Makes the scene itself ready to be drawn where it is not: what costs time once, and is no part of what a picture takes.
    /// Drawing does it where nobody did before.
    ///
    /// # Errors
    /// What the device reports.
    pub fn make_ready(&mut self, state: &SceneState, plan: &Plan) -> Result<(), RenderError> {
        let (mesh, _) = self.scenes.of(state, self.depth_maps.side_px());
        if plan.fields != FieldsForm::Off {
            self.scenes.fields_of(state, self.depth_maps.side_px());
        }
        self.pictures(&mesh, plan);
        // Pictures may be marked as there that never were.
        self.gpu.check().inspect_err(|_error| self.textures.clear())?;
        Ok(())
    }
}
