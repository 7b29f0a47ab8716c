//! The renderer: what is kept between frames, and the order of one frame.

use super::camera_data::{FrameData, Reach, View as ViewData};
use super::effects::{self, Around, EffectPasses};
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
    AveragePass, BillboardPass, CameraDepthPass, DepthMaps, DrawInto, ENLARGE_MARGIN_PX, EnlargePass,
    FieldsPass, FieldsWanted, PointsPass, Recording, SkyPass, StaticScene, SurfacePass, YuvPass, see_through,
};
use super::passes::{BillboardInstance, PointInstance};
use super::patches::{Batches, Patches};
use super::pieces::{self, Piece, Room};
use super::planned::{check_plan, clear_color, gains_of, sequences_bounds};
use super::prepare::{Stand, Uploads};
use super::ready::ReadyScenes;
use super::sequences::Sequences;
use super::targets::{Place, TargetCache, TargetKey};
use super::texture_store::{TextureStore, TextureUse};
use crate::gpu::{Gpu, GpuError, PassTime, Readback, Timer};
use glam::DVec3;
use std::sync::Arc;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{self, FieldsForm, Part, Picture, Plan, View, ViewLimits, Viewer};
use videofields_picture::scene::Sky;
use videofields_vision::config::RenderSettings;
use videofields_vision::fields::MAX_VIEWS;
use videofields_vision::frame::RgbImage;
use videofields_vision::geometry::Camera;

/// Levels of detail of backgrounds: ground far away is smaller than its texels, and would shimmer.
const BACKGROUND_LEVELS: u32 = 5;
/// Live frames are shown at about their own size.
const FRAME_LEVELS: u32 = 1;
/// Largest buffer for reading back that is kept between pictures, bytes.
const MAX_KEPT_READBACK_BYTES: u64 = 64 << 20;

/// Most bytes of targets that one piece of a picture is drawn on: larger pictures are drawn in bands.
const MAX_PIECE_BYTES: u64 = 256 << 20;
/// Most columns and rows of a picture: what its formats hold. What a device cannot hold is drawn in pieces.
const MAX_SIDE_PX: u32 = 65_535;

/// A finished picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rendered {
    /// The picture, of the view's size.
    pub image: RgbImage,
    /// Time that the device spent in each pass that ran; empty where it cannot tell.
    pub timings: Vec<PassTime>,
}

/// Draws pictures, one after the other. Everything large is kept between frames; only what changed is uploaded.
#[derive(Debug)]
pub struct Renderer {
    pub(super) gpu: Gpu,
    max_pixels: u64,
    timer: Timer,
    readback: Readback,
    pub(super) frame: FrameData,
    targets: TargetCache,
    pub(super) scenes: ReadyScenes,
    pub(super) batches: Batches,
    pub(super) backgrounds: ImageArray,
    pub(super) frames: ImageArray,
    pub(super) depth_maps: DepthMaps,
    pub(super) textures: TextureStore,
    passes: Passes,
    pub(super) billboards: Vec<BillboardInstance>,
    /// Owners of what moves in the cameras' pictures, for billboards.
    pub(super) owners: OwnerData,
    /// How many of the billboards are drawn before each building that is open.
    pub(super) slot_ends: Vec<u32>,
    pub(super) points: Vec<PointInstance>,
    pub(super) hulls: Hulls,
    hull_meshes: HullMeshes,
    mesh_fields: MeshFields,
    pub(super) sequences: Sequences,
    /// Which of the frame's cameras one with a live frame is: the state's and the frame's.
    pub(super) entity_places: Vec<(usize, usize)>,
    /// Of the cameras of the mesh that hulls are drawn as, which of the frame's they are.
    pub(super) mesh_cameras: Vec<u32>,
    effects: EffectPasses,
}

/// Pipelines, each made when a plan first calls for it.
#[derive(Debug, Default)]
struct Passes {
    yuv: Option<YuvPass>,
    camera_depth: Option<CameraDepthPass>,
    fields: Option<FieldsPass>,
    surface: Option<SurfacePass>,
    sky: Option<SkyPass>,
    billboard: Option<BillboardPass>,
    points: Option<PointsPass>,
    average: Option<AveragePass>,
    enlarge: Option<EnlargePass>,
}

/// A piece of a picture that is being drawn.
struct Shown<'a> {
    /// As it is drawn: of fewer pixels, and with a margin, where it is enlarged.
    view: View,
    /// Columns and rows of the piece itself, with what effects look at beside it.
    size_px: (u32, u32),
    around: Around,
    mesh: &'a Mesh,
    patches: &'a Patches,
    fields: Option<&'a ShownFields>,
    /// Hulls as a mesh, where fields colour them.
    hulls: Option<&'a LentMesh>,
    /// What is drawn beside surfaces may lie within these bounds.
    beyond: Option<[DVec3; 2]>,
    /// Who looks at all of the picture.
    viewer: Viewer,
    /// Whether it is the first of its picture: fields go on once a picture.
    is_first: bool,
    stand: Stand,
    pictures: &'a Pictures,
}

/// The fine mesh of what stands still, and which cameras have a picture for it.
struct ShownFields {
    mesh: Arc<FieldMesh>,
    /// By the field's views.
    is_shown: [bool; MAX_VIEWS],
}

/// What surfaces and sky are painted with, as it is bound.
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

    /// Draws `picture` of `state` as `plan` says, and waits for it.
    ///
    /// # Errors
    /// As [`Self::render_while`].
    pub fn render(
        &mut self,
        state: &SceneState,
        picture: &Picture,
        plan: &Plan,
    ) -> Result<Rendered, RenderError> {
        let drawn = self.render_while(state, picture, plan, &mut || true)?;
        Ok(drawn.expect("what is wanted to its end is drawn to its end"))
    }

    /// Draws `picture` of `state` as `plan` says while it is `wanted`, which is asked before each of its pieces: `None` once
    /// it is not.
    ///
    /// # Errors
    /// A picture beyond [`Self::view_limits`], a plan that was made for another state, cameras' pictures too large for the
    /// device, or what the device reports: after a loss ([`GpuError::is_lost`]) the renderer must be made anew,
    /// after anything else it can go on.
    pub fn render_while(
        &mut self,
        state: &SceneState,
        picture: &Picture,
        plan: &Plan,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Rendered>, RenderError> {
        picture.check(&self.view_limits()).map_err(RenderError::View)?;
        check_plan(state, plan)?;
        let rendered = self.draw(state, picture, plan, wanted);
        if rendered.is_err() {
            // Layers may be marked as filled that never were.
            self.backgrounds.clear();
            self.frames.clear();
            self.depth_maps.clear();
            self.textures.clear();
            self.targets.clear();
            self.mesh_fields.clear();
            self.sequences.clear();
        }
        self.targets.trim();
        self.readback.trim(MAX_KEPT_READBACK_BYTES);
        self.hulls.trim(MAX_KEPT_READBACK_BYTES);
        self.effects.trim(MAX_KEPT_READBACK_BYTES);
        if let Some(average) = &mut self.passes.average {
            average.trim(MAX_KEPT_READBACK_BYTES);
        }
        if let Some(enlarge) = &mut self.passes.enlarge {
            enlarge.trim(MAX_KEPT_READBACK_BYTES);
        }
        rendered
    }

    fn draw(
        &mut self,
        state: &SceneState,
        picture: &Picture,
        plan: &Plan,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Rendered>, RenderError> {
        self.gpu.check()?;
        let (mesh, patches) = self.scenes.of(state, self.depth_maps.side_px());
        let pictures = self.pictures(&mesh, plan);
        let fields = self.fields(state, plan);
        let hulls = match plan.hull_fields {
            FieldsForm::Off => None,
            _ => self.hull_meshes.of(state, plan),
        };
        // What the device does not hold as a mesh is drawn as without fields.
        let hulls = hulls.filter(|mesh| mesh.check(&self.gpu).is_ok());
        let beyond = sequences_bounds(state, plan);
        let limits = self.gpu.limits();
        let max_side_px = limits.max_texture_dimension_2d;
        let max_bytes = limits.max_buffer_size.min(MAX_PIECE_BYTES);
        let row_bytes = picture.width_px as usize * 3;
        let mut data = vec![0; row_bytes * picture.height_px as usize];
        let mut timings: Vec<PassTime> = Vec::new();
        let (mut prepared, mut is_first) = (None, true);
        let step_px = plan.resolution.step_px();
        let effect_bytes = if plan.effects.is_none() { 0 } else { effects::PIXEL_BYTES };
        let pixel_bytes = TargetKey::pixel_bytes(plan.sampling.samples) + effect_bytes;
        for part @ Part { view, left_px, top_px } in &picture.parts {
            // Not between making ready and drawing: layers would be marked as filled that are not.
            if !wanted() {
                return Ok(None);
            }
            let stand = Stand::of(view, (&mesh, beyond));
            let mut uploads = Uploads::default();
            if prepared.replace(stand) != Some(stand) {
                let fine = fields.as_ref().map(|fields| &*fields.mesh);
                let is_meshed = hulls.is_some();
                uploads = self.prepare(state, picture, (&stand, is_meshed), (plan, &patches, fine))?;
                self.find_mesh_cameras(state, hulls.as_deref());
            }
            let margin_px = plan.effects.margin_px(view, step_px);
            let most_reach = plan.effects.most_reach(view);
            let anchor_px = plan::anchor_px(picture, part);
            let times = plan.sampling.supersampling;
            let room = Room { times, max_side_px, max_bytes, pixel_bytes, margin_px };
            for (idx, Piece { columns, rows }) in pieces::of(view, room).enumerate() {
                if idx > 0 && !wanted() {
                    return Ok(None);
                }
                let (left, top) = ((left_px + columns.start) as usize, (top_px + rows.start) as usize);
                let first = |anchor: i64, start: u32| anchor + i64::from(start) - i64::from(margin_px);
                let around = Around {
                    margin_px,
                    most_reach,
                    anchor_px: [first(anchor_px[0], columns.start), first(anchor_px[1], rows.start)],
                };
                let view = match margin_px {
                    0 => view.cropped(columns, rows),
                    margin_px => view.cropped(columns, rows).coarse(1, margin_px),
                };
                let size_px = (view.width_px, view.height_px);
                let view = match step_px {
                    1 => view,
                    step_px => view.coarse(step_px, ENLARGE_MARGIN_PX),
                };
                let piece = Shown {
                    view,
                    size_px,
                    around,
                    mesh: &mesh,
                    patches: &patches,
                    fields: fields.as_ref(),
                    hulls: hulls.as_deref(),
                    beyond,
                    viewer: picture.viewer,
                    is_first: std::mem::take(&mut is_first),
                    stand,
                    pictures: &pictures,
                };
                self.submit(state, &piece, plan, &std::mem::take(&mut uploads))?;
                self.readback.read_rgb(&self.gpu, &mut data[top * row_bytes + left * 3..], row_bytes)?;
                for time in self.timer.read(&self.gpu)? {
                    match timings.iter_mut().find(|sum| sum.pass == time.pass) {
                        Some(sum) => sum.gpu += time.gpu,
                        None => timings.push(time),
                    }
                }
            }
        }
        let image = RgbImage { width: picture.width_px, height: picture.height_px, data };
        Ok(Some(Rendered { image, timings }))
    }

    /// The fine mesh of what stands still and who has a picture of it, where fields are planned.
    fn fields(&mut self, state: &SceneState, plan: &Plan) -> Option<ShownFields> {
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
    fn find_mesh_cameras(&mut self, state: &SceneState, mesh: Option<&LentMesh>) {
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
    fn submit(
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
