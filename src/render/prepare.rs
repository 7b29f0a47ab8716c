//! What is made ready once for all parts of a picture that are seen from one place.

use super::field_mesh::FieldMesh;
use super::image_array::{Job, Wanted};
use super::mesh::Mesh;
use super::passes::{BillboardInstance, PointInstance, SeenBillboard as Seen};
use super::patches::{Drawing, MOST_LISTED, Patches};
use super::renderer::Renderer;
use super::{Picture, RenderError, View};
use glam::{DVec3, Vec3};
use std::sync::Arc;
use videofields_picture::fuse::{PointRun, SceneState};
use videofields_picture::plan::{
    EntityStyle, Filtering, Opened, Plan, PlannedBillboard, PlannedSource, Projection,
};

/// From where a part is seen, as far as what is made ready for it depends on that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stand {
    pub eye_in_world: DVec3,
    /// What points on the device are relative to.
    pub anchor_in_world: DVec3,
    /// The direction of all rays, where they are parallel.
    pub parallel_to: Option<DVec3>,
}

impl Stand {
    pub(super) fn of(view: &View, (mesh, beyond): (&Mesh, Option<[DVec3; 2]>)) -> Self {
        let eye_in_world = view.pose.position_in_world;
        let is_parallel = view.frustum.projection == Projection::Orthographic;
        let parallel_to = is_parallel.then(|| view.pose.forward_in_world());
        Self { eye_in_world, anchor_in_world: mesh.anchor(eye_in_world, beyond), parallel_to }
    }
}

/// Where a frame's pictures are, and which must be converted first.
#[derive(Default)]
pub(super) struct Uploads<'a> {
    pub backgrounds: Vec<Job<'a>>,
    pub frames: Vec<Job<'a>>,
}

impl Renderer {
    /// Decides where every picture and depth map lies, and fills in what shaders know of the cameras.
    pub(super) fn prepare<'s>(
        &mut self,
        state: &'s SceneState,
        picture: &Picture,
        (stand, is_meshed): (&Stand, bool),
        (plan, patches, fields): (&Plan, &Patches, Option<&FieldMesh>),
    ) -> Result<Uploads<'s>, RenderError> {
        let anchor = stand.anchor_in_world;
        let gain = |idx: usize| {
            let gain = state.cameras[idx].gain;
            // What is no share of light would be no colour.
            let is_one = gain.is_finite() && gain.min_element() >= 0.0;
            if plan.evens_colors && is_one { gain } else { Vec3::ONE }
        };
        let mut uploads = Uploads::default();
        let mut layers = Vec::new();
        let background = |idx: &usize| Wanted::in_sight(&state.cameras[*idx].observation.background);
        let wanted: Vec<_> = plan.surface_cameras.iter().map(background).collect();
        // What is not filtered between levels needs but one.
        let n_levels = if plan.filtering == Filtering::Levels { self.backgrounds.n_levels() } else { 1 };
        self.backgrounds.assign(&self.gpu, (&wanted, n_levels), &mut layers, &mut uploads.backgrounds)?;
        self.frame.clear();
        for ((idx, wanted), layer) in plan.surface_cameras.iter().zip(&wanted).zip(&layers) {
            let scale = self.backgrounds.scale(wanted.image);
            let data = self.frame.add(&state.cameras[*idx].camera, anchor);
            data.gain = gain(*idx).to_array();
            data.background_layer = *layer;
            data.background_scale = scale;
            data.background_size_px = [wanted.image.width() as f32, wanted.image.height() as f32];
        }
        let shader_idx = |idx: &usize| plan.surface_cameras.iter().position(|camera| camera == idx);
        let maps: Vec<_> = plan
            .depth_map_cameras
            .iter()
            .filter_map(|idx| Some((Arc::clone(&state.cameras[*idx].camera), shader_idx(idx)?)))
            .collect();
        if !maps.is_empty() {
            self.depth_maps.assign(&self.gpu, &state.scene, &maps, &mut self.frame.scratch)?;
        }

        let live = |idx: &usize| {
            let observation = &state.cameras[*idx].observation;
            Wanted { image: &observation.frame.image, mask: Some(&observation.soft_mask) }
        };
        let wanted: Vec<_> = plan.entity_cameras.iter().map(live).collect();
        let n_levels = self.frames.n_levels();
        self.frames.assign(&self.gpu, (&wanted, n_levels), &mut layers, &mut uploads.frames)?;
        // Which of the shader's cameras an entity's camera is.
        let mut places: Vec<(usize, usize)> = Vec::with_capacity(plan.entity_cameras.len());
        for ((idx, wanted), layer) in plan.entity_cameras.iter().zip(&wanted).zip(&layers) {
            let scale = self.frames.scale(wanted.image);
            let camera = &state.cameras[*idx];
            // Surfaces are drawn by the camera as it is calibrated, people by the camera as it is corrected.
            let place = shader_idx(idx)
                .filter(|_| Arc::ptr_eq(&camera.camera, &camera.corrected))
                .unwrap_or_else(|| {
                    self.frame.add(&camera.corrected, anchor);
                    self.frame.scratch.len() - 1
                });
            places.push((*idx, place));
            let data = &mut self.frame.scratch[place];
            data.gain = gain(*idx).to_array();
            data.frame_layer = *layer;
            data.frame_scale = scale;
            data.frame_size_px = [wanted.image.width() as f32, wanted.image.height() as f32];
        }
        self.sequences.prepare(&self.gpu, (state, plan), (&mut self.frame, anchor));
        let camera = |idx: &usize| Arc::clone(&state.cameras[*idx].camera);
        let cameras: Vec<_> = plan.surface_cameras.iter().map(camera).collect();
        let drawing = Drawing {
            stand,
            cameras: &cameras,
            data: &self.frame.scratch,
            opened: &plan.opened,
            filtering: plan.filtering,
            most_cameras: plan.most_cameras_a_pixel.min(MOST_LISTED),
        };
        match fields {
            Some(fields) => fields.batch(&drawing, &mut self.batches),
            None => patches.batch(&drawing, &mut self.batches),
        }
        self.frame.write_cameras(&self.gpu);
        self.prepare_entities(state, picture, (stand, is_meshed), (plan, &places));
        self.entity_places = places;
        Ok(uploads)
    }

    fn prepare_entities(
        &mut self,
        state: &SceneState,
        picture: &Picture,
        (stand, is_meshed): (&Stand, bool),
        (plan, places): (&Plan, &[(usize, usize)]),
    ) {
        let anchor = stand.anchor_in_world;
        let shader_idx = |camera_idx: usize| {
            places.iter().find(|(camera, _)| *camera == camera_idx).map(|(_, place)| *place)
        };
        self.billboards.clear();
        self.slot_ends.clear();
        self.points.clear();
        match plan.entities {
            EntityStyle::Billboards | EntityStyle::Hulls | EntityStyle::Auto => {
                // Before the farthest building that hides it, after those farther away.
                let slot = |entity: usize| {
                    let hides = |opened: &Opened| opened.hides.contains(&entity);
                    plan.opened.iter().position(hides).unwrap_or(plan.opened.len())
                };
                let distance = |foot: DVec3| match stand.parallel_to {
                    None => (foot - stand.eye_in_world).truncate().length_squared(),
                    Some(forward) => (foot - anchor).dot(forward),
                };
                let seen = |entity: usize, source: usize| {
                    let entity = &state.entities[entity];
                    let billboard = &entity.sources[source];
                    let camera = &state.cameras[billboard.camera_idx];
                    Some(Seen::new((entity, billboard), camera, shader_idx(billboard.camera_idx)?))
                };
                let drawn = |planned: &PlannedBillboard| {
                    let first = seen(planned.entity, planned.source)?;
                    let beside = planned.beside.and_then(|PlannedSource { source, weight }| {
                        Some((seen(planned.entity, source)?, weight))
                    });
                    let instance = BillboardInstance::new(&first, beside.as_ref(), anchor, picture.viewer);
                    Some((slot(planned.entity), distance(first.place_in_world()), instance))
                };
                let maps = places
                    .iter()
                    .filter_map(|(camera, place)| Some((*place, state.cameras[*camera].owners.as_deref()?)));
                let n_cameras = places.iter().map(|(_, place)| place + 1).max().unwrap_or(0);
                self.owners.fill(n_cameras, maps);
                let mut ordered: Vec<_> = plan.billboards.iter().filter_map(drawn).collect();
                ordered.sort_by(|(a_slot, a, _), (b_slot, b, _)| a_slot.cmp(b_slot).then(b.total_cmp(a)));
                let end = |idx: usize| ordered.partition_point(|(slot, ..)| *slot <= idx) as u32;
                self.slot_ends.extend((0..plan.opened.len()).map(end));
                self.billboards.extend(ordered.into_iter().map(|(.., instance)| instance));
                if !plan.hulls.is_empty() && !is_meshed {
                    self.hulls.assign(&self.gpu, (state, plan), anchor, shader_idx);
                }
            }
            EntityStyle::Points => {
                let mut camera_of = vec![None; state.entities.len()];
                for planned in &plan.billboards {
                    camera_of[planned.entity] =
                        Some(state.entities[planned.entity].sources[planned.source].camera_idx);
                }
                let is_drawn = |run: &&PointRun| match camera_of.get(run.entity_idx).copied().flatten() {
                    Some(_) if state.entities[run.entity_idx].is_seen_in_parts() => true,
                    camera => camera == Some(run.camera_idx),
                };
                let instance =
                    |run: &PointRun| Some(PointInstance::new(run, shader_idx(run.camera_idx)?, anchor));
                self.points.extend(state.points.iter().filter(is_drawn).filter_map(instance));
            }
            EntityStyle::None => {}
        }
    }
}
