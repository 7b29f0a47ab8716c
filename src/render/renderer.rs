//! The renderer: what is kept between frames, and the order of one frame.

use super::camera_data::{FrameData, MAX_CAMERAS, View as ViewData};
use super::error::RenderError;
use super::image_array::{ImageArray, Job, Wanted};
use super::mesh::{self, MeshVertex};
use super::passes::{BillboardInstance, PointInstance};
use super::passes::{
    BillboardPass, CameraDepthPass, DepthMaps, DrawInto, PointsPass, Recording, Shown, SurfaceKey,
    SurfacePass, YuvPass,
};
use super::targets::{Place, TargetCache};
use crate::config::RenderSettings;
use crate::frame::{RgbImage, linear_from_srgb};
use crate::fuse::SceneState;
use crate::gpu::{Gpu, GpuError, PassTime, Readback, Timer};
use crate::plan::{EntityStyle, Plan, View, ViewLimits};
use crate::scene::Scene;
use std::sync::Arc;

/// Levels of detail of backgrounds: ground far away is smaller than its texels, and would shimmer.
const BACKGROUND_LEVELS: u32 = 5;
/// Live frames are shown at about their own size.
const FRAME_LEVELS: u32 = 1;
/// Largest buffer for reading back that is kept between pictures, bytes.
const MAX_KEPT_READBACK_BYTES: u64 = 64 << 20;

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
    gpu: Gpu,
    samples: u32,
    max_pixels: u64,
    timer: Timer,
    readback: Readback,
    frame: FrameData,
    targets: TargetCache,
    mesh: Option<(Arc<Scene>, Vec<MeshVertex>)>,
    backgrounds: ImageArray,
    frames: ImageArray,
    depth_maps: DepthMaps,
    passes: Passes,
    billboards: Vec<BillboardInstance>,
    points: Vec<PointInstance>,
}

/// Pipelines, each made when a plan first calls for it.
#[derive(Debug, Default)]
struct Passes {
    yuv: Option<YuvPass>,
    camera_depth: Option<CameraDepthPass>,
    surface: Option<SurfacePass>,
    billboard: Option<BillboardPass>,
    points: Option<PointsPass>,
}

/// The pass in `slot`, made now if it was not before.
fn made<P>(slot: &mut Option<P>, make: impl FnOnce() -> Result<P, GpuError>) -> Result<&mut P, GpuError> {
    match slot {
        Some(pass) => Ok(pass),
        None => Ok(slot.insert(make()?)),
    }
}

/// Where a frame's pictures are, and which must be converted first.
#[derive(Default)]
struct Uploads<'a> {
    backgrounds: Vec<Job<'a>>,
    frames: Vec<Job<'a>>,
}

impl Renderer {
    /// A renderer on `gpu`. Draws nothing and compiles nothing yet.
    ///
    /// # Errors
    /// When `settings.samples` is neither 1 nor 4, a depth map of that side is none, or the device refuses its first buffers.
    pub fn new(gpu: Gpu, settings: &RenderSettings) -> Result<Self, RenderError> {
        if !matches!(settings.samples, 1 | 4) {
            return Err(RenderError::Samples(settings.samples));
        }
        let (side, most) = (settings.depth_map_side_px, gpu.limits().max_texture_dimension_2d);
        if side == 0 || side > most {
            let (needed, limit) = (u64::from(side), u64::from(most));
            return Err(RenderError::TooMany { what: "texels of a depth map's side", needed, limit });
        }
        let renderer = Self {
            samples: settings.samples,
            max_pixels: settings.max_pixels,
            timer: Timer::new(&gpu),
            readback: Readback::default(),
            frame: FrameData::new(&gpu),
            targets: TargetCache::default(),
            mesh: None,
            backgrounds: ImageArray::new("backgrounds", BACKGROUND_LEVELS),
            frames: ImageArray::new("frames", FRAME_LEVELS),
            depth_maps: DepthMaps::new(settings.depth_map_side_px),
            passes: Passes::default(),
            billboards: Vec::new(),
            points: Vec::new(),
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

    /// The largest picture that can be asked for: the device's limit and the settings'.
    #[must_use]
    pub fn view_limits(&self) -> ViewLimits {
        let limits = self.gpu.limits();
        // The padded picture must also fit into one buffer to be read back.
        let max_pixels = self.max_pixels.min(limits.max_buffer_size / 4 / 2);
        ViewLimits { max_side_px: limits.max_texture_dimension_2d, max_pixels }
    }

    /// Draws `state` from `view` as `plan` says, and waits for the picture.
    ///
    /// # Errors
    /// A view beyond [`Self::view_limits`], a plan that was made for another state, pictures too large for the
    /// device, or what the device reports: after a loss ([`GpuError::is_lost`]) the renderer must be made anew,
    /// after anything else it can go on.
    pub fn render(&mut self, state: &SceneState, view: &View, plan: &Plan) -> Result<Rendered, RenderError> {
        view.check(&self.view_limits()).map_err(RenderError::View)?;
        check_plan(state, plan)?;
        let rendered = self.draw(state, view, plan);
        if rendered.is_err() {
            // Layers may be marked as filled that never were.
            self.backgrounds.clear();
            self.frames.clear();
            self.depth_maps.clear();
            self.targets.clear();
        }
        self.targets.trim();
        self.readback.trim(MAX_KEPT_READBACK_BYTES);
        rendered
    }

    fn draw(&mut self, state: &SceneState, view: &View, plan: &Plan) -> Result<Rendered, RenderError> {
        self.gpu.check()?;
        if !self.mesh.as_ref().is_some_and(|(scene, _)| Arc::ptr_eq(scene, &state.scene)) {
            self.mesh = Some((Arc::clone(&state.scene), mesh::triangles(&state.scene)));
        }
        let uploads = self.prepare(state, view, plan)?;
        self.timer.begin_frame();
        let mut encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("frame") });
        self.convert(&mut encoder, &uploads)?;
        self.record(&mut encoder, state, view, plan)?;
        self.timer.resolve(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
        let data = self.readback.read_rgb(&self.gpu)?;
        let timings = self.timer.read(&self.gpu)?;
        let image = RgbImage { width: view.width_px, height: view.height_px, data };
        Ok(Rendered { image, timings })
    }

    /// Decides where every picture and depth map lies, and fills in what shaders know of the cameras.
    fn prepare<'s>(
        &mut self,
        state: &'s SceneState,
        view: &View,
        plan: &Plan,
    ) -> Result<Uploads<'s>, RenderError> {
        let eye = view.pose.position_in_world;
        let mut uploads = Uploads::default();
        let mut layers = Vec::new();
        let background =
            |idx: &usize| Wanted { image: &state.cameras[*idx].observation.background, mask: None };
        let wanted: Vec<_> = plan.surface_cameras.iter().map(background).collect();
        self.backgrounds.assign(&self.gpu, &wanted, &mut layers, &mut uploads.backgrounds)?;
        self.frame.clear();
        for ((idx, wanted), layer) in plan.surface_cameras.iter().zip(&wanted).zip(&layers) {
            let scale = self.backgrounds.scale(wanted.image);
            let data = self.frame.add(&state.cameras[*idx].camera, eye);
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
        self.frames.assign(&self.gpu, &wanted, &mut layers, &mut uploads.frames)?;
        // Which of the shader's cameras an entity's camera is: entities look only their live frames up.
        let n_surface_cameras = self.frame.scratch.len();
        for ((idx, wanted), layer) in plan.entity_cameras.iter().zip(&wanted).zip(&layers) {
            let scale = self.frames.scale(wanted.image);
            let data = self.frame.add(&state.cameras[*idx].camera, eye);
            data.frame_layer = *layer;
            data.frame_scale = scale;
            data.frame_size_px = [wanted.image.width() as f32, wanted.image.height() as f32];
        }
        self.prepare_entities(state, view, plan, n_surface_cameras);
        Ok(uploads)
    }

    fn prepare_entities(&mut self, state: &SceneState, view: &View, plan: &Plan, first_camera: usize) {
        let eye = view.pose.position_in_world;
        let shader_idx = |camera_idx: usize| {
            let place = plan.entity_cameras.iter().position(|camera| *camera == camera_idx);
            place.map(|place| first_camera + place)
        };
        self.billboards.clear();
        self.points.clear();
        match plan.entities {
            EntityStyle::Billboards => {
                let mut ordered: Vec<_> = plan
                    .billboards
                    .iter()
                    .map(|planned| &state.entities[planned.entity].sources[planned.source])
                    .collect();
                let distance = |foot: glam::DVec3| (foot - eye).truncate().length_squared();
                ordered.sort_by(|a, b| distance(b.foot_in_world).total_cmp(&distance(a.foot_in_world)));
                self.billboards.extend(ordered.into_iter().filter_map(|billboard| {
                    let camera = &state.cameras[billboard.camera_idx];
                    let image = &camera.observation.frame.image;
                    let size = (image.width(), image.height());
                    let idx = shader_idx(billboard.camera_idx)?;
                    Some(BillboardInstance::new(billboard, &camera.camera, idx, size, eye))
                }));
            }
            EntityStyle::Points => {
                let instance = |point| Some(PointInstance::new(point, shader_idx(point.camera_idx)?, eye));
                self.points.extend(state.points.iter().filter_map(instance));
            }
            EntityStyle::None => {}
        }
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
        view: &View,
        plan: &Plan,
    ) -> Result<(), GpuError> {
        let Self { gpu, passes, frame, depth_maps, frames, backgrounds, samples, .. } = self;
        let (gpu, samples) = (&*gpu, *samples);
        let mesh = self.mesh.as_ref().map_or(&[][..], |(_, mesh)| mesh);
        let mut recording = Recording { gpu, encoder, timer: &mut self.timer };
        if depth_maps.has_jobs() {
            let pass = made(&mut passes.camera_depth, || CameraDepthPass::new(gpu))?;
            pass.record(&mut recording, depth_maps, mesh);
        }

        let eye = view.pose.position_in_world;
        let key = SurfaceKey::of(&frame.scratch[..plan.surface_cameras.len()]);
        let frame_group = frame.bind(gpu, ViewData::new(view));
        let targets = self.targets.get(gpu, view.width_px, view.height_px, samples);
        let has_entities = !self.billboards.is_empty() || !self.points.is_empty();
        let place = Place { clear: Some(sky(&state.scene)), is_last: !has_entities };
        let mut into = DrawInto { targets, frame: &frame_group, place };
        let surface = made(&mut passes.surface, || Ok(SurfacePass::new(gpu, samples)))?;
        let shown = Shown { mesh, eye_in_world: eye, key };
        surface.record(&mut recording, &into, frame.layout(), &shown, backgrounds, depth_maps)?;
        into.place = Place { clear: None, is_last: true };
        if !self.billboards.is_empty() {
            let pass = made(&mut passes.billboard, || BillboardPass::new(gpu, frame.layout(), samples))?;
            pass.record(&mut recording, &into, &self.billboards, frames);
        }
        if !self.points.is_empty() {
            let pass = made(&mut passes.points, || PointsPass::new(gpu, frame.layout(), samples))?;
            pass.record(&mut recording, &into, &self.points, frames);
        }
        self.readback.copy(gpu, recording.encoder, &targets.color);
        Ok(())
    }
}

fn sky(scene: &Scene) -> wgpu::Color {
    let [r, g, b] = scene.sky_srgb.map(|code| f64::from(linear_from_srgb(f32::from(code) / 255.0)));
    wgpu::Color { r, g, b, a: 1.0 }
}

/// Holds a plan to the state it is drawn with.
fn check_plan(state: &SceneState, plan: &Plan) -> Result<(), RenderError> {
    let lists = [
        ("surface_cameras", &plan.surface_cameras),
        ("depth_map_cameras", &plan.depth_map_cameras),
        ("entity_cameras", &plan.entity_cameras),
    ];
    for (list, cameras) in lists {
        if let Some(idx) = cameras.iter().find(|idx| **idx >= state.cameras.len()) {
            let message = format!("{list} names camera {idx} of {}", state.cameras.len());
            return Err(RenderError::Plan(message));
        }
    }
    let needed = plan.surface_cameras.len() + plan.entity_cameras.len();
    if needed > MAX_CAMERAS {
        let (needed, limit) = (needed as u64, MAX_CAMERAS as u64);
        return Err(RenderError::TooMany { what: "cameras in one picture", needed, limit });
    }
    for planned in &plan.billboards {
        let source = state.entities.get(planned.entity).and_then(|entity| entity.sources.get(planned.source));
        if source.is_none_or(|source| source.camera_idx >= state.cameras.len()) {
            let message = format!("billboards names source {} of entity {}", planned.source, planned.entity);
            return Err(RenderError::Plan(message));
        }
    }
    Ok(())
}
