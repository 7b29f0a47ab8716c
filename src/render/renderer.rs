//! The renderer: what is kept between frames, and the order of one frame.

use super::camera_data::{FrameData, Reach, View as ViewData};
use super::effects::{Around, EffectPasses};
use super::error::RenderError;
use super::field_mesh::FieldMesh;
use super::hull_meshes::HullMeshes;
use super::hulls::{HullPiece, Hulls};
use super::image_array::ImageArray;
use super::lent_mesh::LentMesh;
use super::mesh::Mesh;
use super::mesh_fields::{MeshFields, MeshLook};
use super::owner_data::OwnerData;
use super::passes::{
    AveragePass, BillboardPass, CameraDepthPass, DepthMaps, DrawInto, EnlargePass, FieldsPass, FieldsWanted,
    PointsPass, Recording, SkyPass, StaticScene, SurfacePass, YuvPass, see_through,
};
use super::passes::{BillboardInstance, PointInstance};
use super::patches::{Batches, Patches};
use super::planned::{clear_color, gains_of};
use super::prepare::{Stand, Uploads};
use super::ready::ReadyScenes;
use super::sequences::Sequences;
use super::targets::{Place, TargetCache, TargetKey};
use super::texture_store::{TextureStore, TextureUse};
use crate::gpu::{Gpu, GpuError, Readback, Timer};
use glam::DVec3;
use std::sync::Arc;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{FieldsForm, Plan, View, ViewLimits, Viewer};
use videofields_picture::scene::Sky;
use videofields_vision::config::RenderSettings;
use videofields_vision::fields::MAX_VIEWS;
use videofields_vision::geometry::Camera;

/// Levels of detail of backgrounds: ground far away is smaller than its texels, and would shimmer.
const BACKGROUND_LEVELS: u32 = 5;
/// Live frames are shown at about their own size.
const FRAME_LEVELS: u32 = 1;
/// Most columns and rows of a picture: what its formats hold. What a device cannot hold is drawn in pieces.
const MAX_SIDE_PX: u32 = 65_535;

/// Draws pictures, one after the other, or piece by piece in turns. Everything large is kept between frames; only what changed is uploaded.
#[derive(Debug)]
pub struct Renderer {
    pub(super) gpu: Gpu,
    pub(super) max_pixels: u64,
    pub(super) timer: Timer,
    pub(super) readback: Readback,
    pub(super) frame: FrameData,
    pub(super) targets: TargetCache,
    pub(super) scenes: ReadyScenes,
    pub(super) batches: Batches,
    pub(super) backgrounds: ImageArray,
    pub(super) frames: ImageArray,
    pub(super) depth_maps: DepthMaps,
    pub(super) textures: TextureStore,
    pub(super) passes: Passes,
    pub(super) billboards: Vec<BillboardInstance>,
    /// Owners of what moves in the cameras' pictures, for billboards.
    pub(super) owners: OwnerData,
    /// How many of the billboards are drawn before each building that is open.
    pub(super) slot_ends: Vec<u32>,
    pub(super) points: Vec<PointInstance>,
    pub(super) hulls: Hulls,
    pub(super) hull_meshes: HullMeshes,
    pub(super) mesh_fields: MeshFields,
    pub(super) sequences: Sequences,
    /// Which of the frame's cameras one with a live frame is: the state's and the frame's.
    pub(super) entity_places: Vec<(usize, usize)>,
    /// Of the cameras of the mesh that hulls are drawn as, which of the frame's they are.
    pub(super) mesh_cameras: Vec<u32>,
    pub(super) effects: EffectPasses,
    /// Number of what was made ready last.
    pub(super) turn: u64,
}

/// Pipelines, each made when a plan first calls for it.
#[derive(Debug, Default)]
pub(super) struct Passes {
    yuv: Option<YuvPass>,
    camera_depth: Option<CameraDepthPass>,
    fields: Option<FieldsPass>,
    surface: Option<SurfacePass>,
    sky: Option<SkyPass>,
    billboard: Option<BillboardPass>,
    points: Option<PointsPass>,
    pub(super) average: Option<AveragePass>,
    pub(super) enlarge: Option<EnlargePass>,
}

/// A piece of a picture that is being drawn.
pub(super) struct Shown<'a> {
    /// As it is drawn: of fewer pixels, and with a margin, where it is enlarged.
    pub(super) view: View,
    /// Columns and rows of the piece itself, with what effects look at beside it.
    pub(super) size_px: (u32, u32),
    pub(super) around: Around,
    pub(super) mesh: &'a Mesh,
    pub(super) patches: &'a Patches,
    pub(super) fields: Option<&'a ShownFields>,
    /// Hulls as a mesh, where fields colour them.
    pub(super) hulls: Option<&'a LentMesh>,
    /// What is drawn beside surfaces may lie within these bounds.
    pub(super) beyond: Option<[DVec3; 2]>,
    /// Who looks at all of the picture.
    pub(super) viewer: Viewer,
    /// Whether it is the first of its picture: fields go on once a picture.
    pub(super) is_first: bool,
    pub(super) stand: Stand,
    pub(super) pictures: &'a Pictures,
}

/// The fine mesh of what stands still, and which cameras have a picture for it.
#[derive(Debug)]
pub(super) struct ShownFields {
    pub(super) mesh: Arc<FieldMesh>,
    /// By the field's views.
    is_shown: [bool; MAX_VIEWS],
}

/// What surfaces and sky are painted with, as it is bound.
#[derive(Debug)]
pub(super) struct Pictures {
    surfaces: Vec<wgpu::BindGroup>,
    sky: Option<wgpu::BindGroup>,
}

/// The largest picture that any renderer can be asked for, where at most `max_pixels` may be drawn.
#[must_use]
pub const fn view_limits(max_pixels: u64) -> ViewLimits {
    ViewLimits { max_side_px: MAX_SIDE_PX, max_pixels }
}

/// The pass in `slot`, made now if it was not before.
pub(super) fn made<P>(
    slot: &mut Option<P>,
    make: impl FnOnce() -> Result<P, GpuError>,
) -> Result<&mut P, GpuError> {
    match slot {
        Some(pass) => Ok(pass),
        None => Ok(slot.insert(make()?)),
    }
}

impl Renderer {
    /// A renderer on `gpu`. Draws nothing and compiles nothing yet.
    ///
    /// # Errors
    /// When a depth map of the settings' side is none, or the device refuses its first buffers.
    pub fn new(gpu: Gpu, settings: &RenderSettings) -> Result<Self, RenderError> {
        let (side, most) = (settings.depth_map_side_px, gpu.limits().max_texture_dimension_2d);
        if side == 0 || side > most {
            let (needed, limit) = (u64::from(side), u64::from(most));
            return Err(RenderError::TooMany { what: "texels of a depth map's side", needed, limit });
        }
        let renderer = Self {
            max_pixels: settings.max_pixels,
            timer: Timer::new(&gpu),
            readback: Readback::default(),
            frame: FrameData::new(&gpu),
            targets: TargetCache::default(),
            scenes: ReadyScenes::default(),
            batches: Batches::default(),
            backgrounds: ImageArray::new("backgrounds", BACKGROUND_LEVELS),
            frames: ImageArray::new("frames", FRAME_LEVELS),
            depth_maps: DepthMaps::new(settings.depth_map_side_px),
            textures: TextureStore::default(),
            passes: Passes::default(),
            billboards: Vec::new(),
            owners: OwnerData::default(),
            slot_ends: Vec::new(),
            points: Vec::new(),
            hulls: Hulls::default(),
            hull_meshes: HullMeshes::default(),
            mesh_fields: MeshFields::default(),
            sequences: Sequences::default(),
            entity_places: Vec::new(),
            mesh_cameras: Vec::new(),
            effects: EffectPasses::default(),
            turn: 0,
            gpu,
        };
        renderer.gpu.check()?;
        Ok(renderer)
    }

    /// The device.
    #[must_use]
    pub const fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// What pictures of surfaces and sky have cost the device so far.
    #[must_use]
    pub fn texture_use(&self) -> TextureUse {
        self.textures.usage()
    }

    /// The largest picture that can be asked for: what one drawing cannot hold is drawn in several.
    #[must_use]
    pub const fn view_limits(&self) -> ViewLimits {
        view_limits(self.max_pixels)
    }

    /// The fine mesh of what stands still and who has a picture of it, where fields are planned.
    pub(super) fn fields(&mut self, state: &SceneState, plan: &Plan) -> Option<ShownFields> {
        if plan.fields == FieldsForm::Off {
            return None;
        }
        let mesh = self.scenes.fields_of(state, self.depth_maps.side_px());
        let mut is_shown = [false; MAX_VIEWS];
        // Whatever of them this picture shows: weights are those of all pictures of an instant.
        for camera in &state.cameras {
            if let Some(view) = mesh.place_of(&camera.camera) {
                is_shown[view] = true;
            }
        }
        Some(ShownFields { mesh, is_shown })
    }

    /// Finds which of the frame's cameras those of a mesh are, which must have been made ready for it.
    pub(super) fn find_mesh_cameras(&mut self, state: &SceneState, mesh: Option<&LentMesh>) {
        self.mesh_cameras.clear();
        let Some(mesh) = mesh else { return };
        let of = |camera: &Arc<Camera>| {
            let idx = state.cameras.iter().position(|known| Arc::ptr_eq(&known.corrected, camera));
            let place =
                |idx| self.entity_places.iter().find(|(known, _)| *known == idx).map(|(_, place)| *place);
            idx.and_then(place).unwrap_or(0) as u32
        };
        let found = mesh.cameras.iter().map(of).collect();
        self.mesh_cameras = found;
    }

    /// The pictures of the scene's surfaces, and of its sky if that is planned, uploaded where they were not before.
    pub(super) fn pictures(&mut self, mesh: &Mesh, plan: &Plan) -> Pictures {
        let sky = match &mesh.scene.sky {
            Sky::Picture { texture, .. } if plan.sky => Some(texture),
            _ => None,
        };
        let wanted: Vec<_> = mesh.textures.iter().chain(sky).collect();
        let mut surfaces = self.textures.bind(&self.gpu, &wanted);
        let sky = sky.and_then(|_| surfaces.pop());
        Pictures { surfaces, sky }
    }

    /// Hands the drawing of one piece of a picture to the device.
    pub(super) fn submit(
        &mut self,
        state: &SceneState,
        piece: &Shown<'_>,
        plan: &Plan,
        uploads: &Uploads<'_>,
    ) -> Result<(), RenderError> {
        self.timer.begin_frame();
        let mut encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("frame") });
        self.convert(&mut encoder, uploads)?;
        self.record(&mut encoder, state, piece, plan)?;
        self.timer.resolve(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Records the conversion of new pictures.
    fn convert(&mut self, encoder: &mut wgpu::CommandEncoder, uploads: &Uploads<'_>) -> Result<(), GpuError> {
        if uploads.backgrounds.is_empty() && uploads.frames.is_empty() {
            return Ok(());
        }
        let gpu = &self.gpu;
        let yuv = made(&mut self.passes.yuv, || YuvPass::new(gpu))?;
        let mut recording = Recording { gpu, encoder, timer: &mut self.timer };
        yuv.record(
            &mut recording,
            [(&mut self.backgrounds, &uploads.backgrounds), (&mut self.frames, &uploads.frames)],
        );
        Ok(())
    }

    /// Records what is drawn, in the order of [`super::Pass`].
    fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        state: &SceneState,
        piece: &Shown<'_>,
        plan: &Plan,
    ) -> Result<(), GpuError> {
        let Self {
            gpu,
            passes,
            frame,
            depth_maps,
            frames,
            backgrounds,
            batches,
            textures,
            hulls,
            mesh_fields,
            mesh_cameras,
            sequences,
            effects,
            ..
        } = self;
        let gpu = &*gpu;
        let scene = &*state.scene;
        let Shown { view, size_px, around, mesh, patches, fields, viewer, is_first, stand, pictures, .. } =
            piece;
        let mut recording = Recording { gpu, encoder, timer: &mut self.timer };
        if depth_maps.has_jobs() {
            let pass = made(&mut passes.camera_depth, || CameraDepthPass::new(gpu))?;
            pass.record(&mut recording, depth_maps, &mesh.vertices);
        }

        let lent = match fields {
            Some(ShownFields { mesh, is_shown }) => {
                let pass = made(&mut passes.fields, || FieldsPass::new(gpu))?;
                let wanted = FieldsWanted {
                    form: plan.fields,
                    viewer: *viewer,
                    is_shown,
                    most_cameras: plan.most_cameras_a_pixel,
                    followed: plan.followed,
                    goes_on: *is_first,
                };
                Some(pass.record(&mut recording, mesh, &wanted))
            }
            None => None,
        };
        let reach = Reach {
            anchor_in_world: stand.anchor_in_world,
            depths_m: mesh.depths_m(&view.pose, piece.beyond),
        };
        let frame_group = frame.bind(gpu, ViewData::new(view, &reach));
        let (times, step_px) = (plan.sampling.supersampling, plan.resolution.step_px());
        let targets = TargetKey {
            width_px: view.width_px * times,
            height_px: view.height_px * times,
            samples: plan.sampling.samples,
            is_read: times > 1 || step_px > 1 || !plan.effects.is_none(),
            keeps_depth: plan.effects.needs_distances(),
        };
        let targets = self.targets.get(gpu, targets);
        // Before the targets are drawn on: where the hulls' surfaces are.
        let looked_for = HullPiece { view, times, anchor: stand.anchor_in_world, reach: &reach };
        let found = match piece.hulls {
            None => hulls.find(&mut recording, (frame, &frame_group), (state, plan), &looked_for)?,
            Some(_) => None,
        };
        let look = MeshLook {
            form: plan.hull_fields,
            viewer: *viewer,
            followed: plan.followed,
            goes_on: *is_first,
            anchor_in_world: stand.anchor_in_world,
            gains: gains_of(state, plan),
            camera_idx: mesh_cameras,
            most_cameras: plan.most_cameras_a_pixel,
        };
        let of_frame = (&frame_group, frame.layout());
        let lent_mesh = match piece.hulls {
            Some(mesh) => {
                let live = &frames.store(gpu).sampled;
                Some(mesh_fields.record(&mut recording, of_frame, (mesh, live), &look)?)
            }
            None => None,
        };
        let look = MeshLook { form: plan.sequence_fields, ..look };
        let recorded = sequences.record(&mut recording, of_frame, &look)?;
        let has_more = !self.billboards.is_empty()
            || !self.points.is_empty()
            || !plan.opened.is_empty()
            || found.is_some()
            || lent_mesh.is_some()
            || !recorded.is_empty();
        let place = Place { clear: Some(clear_color(&scene.sky)), is_last: !has_more && !plan.sky };
        let has_gains = plan.evens_colors;
        let mut into =
            DrawInto { targets, frame: &frame_group, frame_layout: frame.layout(), has_gains, place };
        let surface = made(&mut passes.surface, || Ok(SurfacePass::new(gpu)))?;
        let anchor_in_world = stand.anchor_in_world;
        let covering = !pictures.surfaces.is_empty();
        let (number, vertices, may_overlap) = match fields {
            Some(ShownFields { mesh, .. }) => (mesh.number, &mesh.vertices, mesh.may_overlap()),
            None => (patches.number, &patches.vertices, patches.may_overlap()),
        };
        let static_scene = StaticScene {
            number,
            vertices,
            may_overlap,
            lent: lent.as_ref(),
            batches,
            anchor_in_world,
            filtering: plan.filtering,
            textures: covering.then(|| (pictures.surfaces.as_slice(), textures.layout(gpu))),
            opened: &plan.opened,
        };
        let opened = surface.record(&mut recording, &into, &static_scene, backgrounds, depth_maps)?;
        into.place = Place { clear: None, is_last: !has_more };
        if plan.sky {
            let pass = made(&mut passes.sky, || Ok(SkyPass::new(gpu)))?;
            let picture = pictures.sky.as_ref().map(|picture| (picture, textures.layout(gpu)));
            pass.record(&mut recording, &into, (&scene.sky, view), picture)?;
        }
        let ends_with_meshes = self.billboards.is_empty() && self.points.is_empty() && opened.is_none();
        if let Some(found) = &found {
            into.place.is_last = ends_with_meshes && recorded.is_empty();
            hulls.show(&mut recording, &into, found, (plan, frames))?;
        }
        if let Some(lent_mesh) = &lent_mesh {
            into.place.is_last = ends_with_meshes && recorded.is_empty();
            let live = &frames.store(gpu).sampled;
            mesh_fields.show(&mut recording, &into, (lent_mesh, live))?;
        }
        for (place, lent) in recorded.iter().enumerate() {
            into.place.is_last = ends_with_meshes && place + 1 == recorded.len();
            sequences.show(&mut recording, &into, (place, lent))?;
        }
        into.place.is_last = true;
        if !self.billboards.is_empty() {
            let pass = made(&mut passes.billboard, || Ok(BillboardPass::new(gpu)))?;
            let among = opened.as_ref().map(|opened| (opened, self.slot_ends.as_slice()));
            let drawn = (self.billboards.as_slice(), self.owners.words());
            pass.record(&mut recording, &into, drawn, among, frames)?;
        } else {
            // Points tell their depth: those before a building are not covered by it.
            into.place.is_last = opened.is_none();
            if !self.points.is_empty() {
                let pass = made(&mut passes.points, || Ok(PointsPass::new(gpu)))?;
                pass.record(&mut recording, &into, &self.points, frames)?;
            }
            into.place.is_last = true;
            if let Some(opened) = &opened {
                see_through::record(&mut recording, &into, opened);
            }
        }
        let pixels = (times, step_px);
        let drawn =
            effects.drawn(&mut recording, targets, (view, &reach), (&plan.effects, around), pixels)?;
        let picture = if times > 1 {
            let pass = made(&mut passes.average, || Ok(AveragePass::new(gpu)))?;
            pass.record(&mut recording, &drawn, times)?.clone()
        } else if step_px > 1 {
            let pass = made(&mut passes.enlarge, || Ok(EnlargePass::new(gpu)))?;
            pass.record(&mut recording, &drawn, step_px, *size_px)?.clone()
        } else {
            drawn
        };
        let picture = effects.finished(&mut recording, picture, (&plan.effects, around.anchor_px))?;
        self.readback.copy_within(gpu, recording.encoder, &picture, around.margin_px);
        Ok(())
    }
}
