//! Sky, ground and boxes, with the cameras' backgrounds projected on them.

use super::camera_depth::DepthMaps;
use super::{
    Attributes, BySamples, DrawInto, DrawPipeline, FILTERED, MAIN, Mixing, Recording, SAMPLER_ENTRY,
    UNFILTERED, draw_pipeline, linear_sampler, texture_entry,
};
use crate::gpu::{Gpu, GpuError, GrowingBuffer};
use crate::image_array::ImageArray;
use crate::mesh::MeshVertex;
use crate::patches::{Batch, Batches, CameraList, Shading};
use glam::DVec3;
use std::num::NonZeroU64;
use videofields_picture::plan::{Filtering, Opened};

/// One corner of a triangle, relative to the anchor.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Vertex {
    position_from_anchor: [f32; 3],
    normal: [f32; 3],
    material: [f32; 3],
    nearer: f32,
}

const ATTRIBUTES: Attributes<3> = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x4];

fn constants(shading: Shading) -> [(&'static str, f64); 6] {
    let flag = |is_set: bool| f64::from(u8::from(is_set));
    [
        ("N_LISTED", shading.n_cameras as f64),
        ("HAS_LENSES", flag(shading.has_lenses)),
        ("HAS_DEPTH_MAPS", flag(shading.has_depth_maps)),
        ("HAS_DEPTH_CUBES", flag(shading.has_depth_cubes)),
        ("HAS_GAINS", flag(shading.has_gains)),
        ("HAS_LEVELS", flag(shading.has_levels)),
    ]
}

/// Bytes from one list of cameras to the next: what every device takes as an offset.
const LIST_STRIDE: u32 = 256;
type PaddedList = [CameraList; LIST_STRIDE as usize / size_of::<CameraList>()];

/// What a corner of a triangle with a picture has beside: [`crate::mesh::MeshVertex`].
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct TextureVertex {
    texture: [f32; 4],
    tint: [f32; 3],
}

const TEXTURE_ATTRIBUTES: Attributes<2> = wgpu::vertex_attr_array![3 => Float32x4, 4 => Float32x3];

/// What each camera of its list lends to a vertex.
const LENT_ATTRIBUTES: Attributes<2> = wgpu::vertex_attr_array![6 => Float32x4, 7 => Float32x4];
/// Bytes of it.
const LENT_STRIDE: u64 = 32;

/// Whether a surface covers what lies behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cover {
    /// Its depth alone, so that of what lies one behind the other only the nearest is shaded.
    Depth,
    Whole,
    /// By the blend constant, seen from outside alone.
    Partly,
}

impl Cover {
    fn mixing(self) -> Mixing {
        let factor = |src_factor, dst_factor| wgpu::BlendComponent {
            src_factor,
            dst_factor,
            operation: wgpu::BlendOperation::Add,
        };
        let whole = Mixing { blend: None, writes_depth: true, culls_back: false, writes_color: true };
        match self {
            Self::Depth => Mixing { writes_color: false, ..whole },
            Self::Whole => whole,
            Self::Partly => {
                let color = factor(wgpu::BlendFactor::Constant, wgpu::BlendFactor::OneMinusConstant);
                let alpha = factor(wgpu::BlendFactor::Zero, wgpu::BlendFactor::One);
                Mixing {
                    blend: Some(wgpu::BlendState { color, alpha }),
                    writes_depth: false,
                    culls_back: true,
                    ..whole
                }
            }
        }
    }
}

/// Batches with their pipelines, ready to be drawn.
#[derive(Debug)]
struct Ready {
    /// The cameras' pictures; none where no camera is shown.
    cameras: Option<wgpu::BindGroup>,
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    /// What the vertices of those with a picture have beside, and the pictures.
    textured: Option<(wgpu::Buffer, Vec<wgpu::BindGroup>)>,
    /// What cameras lend to the vertices, where these say it.
    lent: Option<wgpu::Buffer>,
}

/// A batch with its pipeline.
type Item = (wgpu::RenderPipeline, Batch);

impl Ready {
    fn draw(&self, pass: &mut wgpu::RenderPass<'_>, items: &[Item]) {
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint32);
        for (pipeline, batch) in items {
            pass.set_pipeline(pipeline);
            if let Some(cameras) = self.cameras.as_ref().filter(|_| batch.shading.n_cameras > 0) {
                pass.set_bind_group(1, cameras, &[batch.list * LIST_STRIDE]);
            }
            if let (Some((beside, pictures)), Some(place)) = (&self.textured, batch.texture) {
                pass.set_vertex_buffer(1, beside.slice(..));
                pass.set_bind_group(2, &pictures[place], &[]);
            }
            if let Some(lent) = self.lent.as_ref().filter(|_| batch.shading.has_fields) {
                pass.set_vertex_buffer(2, lent.slice(..));
            }
            pass.draw_indexed(batch.indices.clone(), 0, 0..1);
        }
    }
}

/// Surfaces that are drawn translucent, ready to be drawn within a pass.
#[derive(Debug)]
pub(crate) struct Translucent {
    ready: Ready,
    /// What is drawn of each, and its opacity.
    surfaces: Vec<(Vec<Item>, f32)>,
}

impl Translucent {
    pub(crate) const fn len(&self) -> usize {
        self.surfaces.len()
    }

    /// Draws one of them over what was drawn before; what else is drawn in the pass must set its own pipeline again.
    pub(crate) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, idx: usize) {
        let (items, opacity) = &self.surfaces[idx];
        let opacity = f64::from(*opacity);
        pass.set_blend_constant(wgpu::Color { r: opacity, g: opacity, b: opacity, a: opacity });
        self.ready.draw(pass, items);
    }
}

/// What is shown, from where.
#[derive(Clone, Copy)]
pub(crate) struct StaticScene<'a> {
    /// What is drawn: its number among all that is, its vertices, and whether some may lie before others.
    pub number: u64,
    pub vertices: &'a [MeshVertex],
    pub may_overlap: bool,
    /// What cameras lend to each, for batches with fields.
    pub lent: Option<&'a wgpu::Buffer>,
    pub batches: &'a Batches,
    pub anchor_in_world: DVec3,
    pub filtering: Filtering,
    /// The pictures on the surfaces as they are bound, and their layout; none where there are none.
    pub textures: Option<(&'a [wgpu::BindGroup], &'a wgpu::BindGroupLayout)>,
    /// Surfaces that are drawn translucent, after what lies behind them.
    pub opened: &'a [Opened],
}

/// Draws the static scene.
#[derive(Debug)]
pub(crate) struct SurfacePass {
    layout: wgpu::BindGroupLayout,
    pipelines: Vec<(Shading, Cover, BySamples)>,
    background_sampler: wgpu::Sampler,
    nearest_sampler: wgpu::Sampler,
    depth_sampler: wgpu::Sampler,
    vertices: GrowingBuffer,
    indices: GrowingBuffer,
    lists: GrowingBuffer,
    scratch: Vec<Vertex>,
    texture_vertices: GrowingBuffer,
    /// Of which they are, by number.
    texture_vertices_of: Option<u64>,
    /// Of which, relative to what the vertices are: parts of a picture mostly share both.
    written: Option<(u64, DVec3)>,
}

const LABEL: &str = "surface";

impl SurfacePass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let depth_sampler_entry = wgpu::BindGroupLayoutEntry {
            binding: 3,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering),
            count: None,
        };
        let list_entry = wgpu::BindGroupLayoutEntry {
            binding: 4,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: true,
                min_binding_size: NonZeroU64::new(size_of::<CameraList>() as u64),
            },
            count: None,
        };
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[
                texture_entry(0, wgpu::TextureViewDimension::D2Array, FILTERED),
                SAMPLER_ENTRY,
                texture_entry(2, wgpu::TextureViewDimension::D2Array, UNFILTERED),
                depth_sampler_entry,
                list_entry,
            ],
        });
        Self {
            layout,
            pipelines: Vec::new(),
            background_sampler: linear_sampler(gpu, LABEL),
            nearest_sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("surface nearest"),
                ..wgpu::SamplerDescriptor::default()
            }),
            depth_sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("surface depth"),
                ..wgpu::SamplerDescriptor::default()
            }),
            vertices: GrowingBuffer::new("surface vertices", wgpu::BufferUsages::VERTEX),
            indices: GrowingBuffer::new("surface indices", wgpu::BufferUsages::INDEX),
            lists: GrowingBuffer::new("surface lists", wgpu::BufferUsages::UNIFORM),
            scratch: Vec::new(),
            texture_vertices: GrowingBuffer::new("surface texture vertices", wgpu::BufferUsages::VERTEX),
            texture_vertices_of: None,
            written: None,
        }
    }

    /// The pipeline of a variant, made when a frame first calls for it.
    fn pipeline(
        &mut self,
        gpu: &Gpu,
        into: &DrawInto<'_>,
        (key, cover): (Shading, Cover),
        texture_layout: Option<&wgpu::BindGroupLayout>,
    ) -> Result<&wgpu::RenderPipeline, GpuError> {
        let vertices = wgpu::VertexBufferLayout {
            array_stride: size_of::<Vertex>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &ATTRIBUTES,
        };
        let beside = wgpu::VertexBufferLayout {
            array_stride: size_of::<TextureVertex>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &TEXTURE_ATTRIBUTES,
        };
        let mut bind_groups = vec![Some(into.frame_layout)];
        let has_cameras = key.n_cameras > 0;
        if has_cameras || texture_layout.is_some() {
            bind_groups.push(has_cameras.then_some(&self.layout));
        }
        let mut buffers = vec![Some(vertices)];
        if let Some(layout) = texture_layout {
            bind_groups.push(Some(layout));
            buffers.push(Some(beside));
        }
        if key.has_fields {
            buffers.resize(2, None);
            buffers.push(Some(wgpu::VertexBufferLayout {
                array_stride: LENT_STRIDE,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &LENT_ATTRIBUTES,
            }));
        }
        let samples = into.targets.samples();
        let known = self.pipelines.iter().position(|(known, covers, _)| (*known, *covers) == (key, cover));
        let idx = known.unwrap_or_else(|| {
            self.pipelines.push((key, cover, BySamples::default()));
            self.pipelines.len() - 1
        });
        let wanted = DrawPipeline {
            label: LABEL,
            bind_groups: &bind_groups,
            vertices: &buffers,
            entry_points: match cover {
                Cover::Depth => ["vs_main", "fs_depth"],
                _ if key.has_fields && key.has_texture => ["vs_fields_textured", "fs_fields_textured"],
                _ if key.has_fields => ["vs_fields", "fs_fields"],
                _ if key.has_texture && has_cameras => ["vs_textured", "fs_textured"],
                _ if key.has_texture => ["vs_textured", "fs_bare_textured"],
                _ if has_cameras => MAIN,
                _ => ["vs_main", "fs_bare"],
            },
            topology: wgpu::PrimitiveTopology::TriangleList,
            mixing: cover.mixing(),
            variant: &constants(key),
            samples,
        };
        self.pipelines[idx].2.get(samples, || draw_pipeline(gpu, wanted))
    }

    /// The batches with their pipelines.
    fn items(
        &mut self,
        gpu: &Gpu,
        into: &DrawInto<'_>,
        (batches, cover): (&[Batch], Cover),
        texture_layout: Option<&wgpu::BindGroupLayout>,
    ) -> Result<Vec<Item>, GpuError> {
        let item = |batch: &Batch| {
            let layout = texture_layout.filter(|_| batch.shading.has_texture);
            Ok((self.pipeline(gpu, into, (batch.shading, cover), layout)?.clone(), batch.clone()))
        };
        batches.iter().map(item).collect()
    }

    /// Records the sky (the colour to clear with) and the scene's patches; returns what of them is drawn later.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        shown: &StaticScene<'_>,
        backgrounds: &mut ImageArray,
        depth_maps: &DepthMaps,
    ) -> Result<Option<Translucent>, GpuError> {
        let gpu = recording.gpu;
        let Batches { indices, lists, opaque, opened, .. } = shown.batches;
        let vertices = self.write(gpu, shown).clone();
        let indices = self.indices.write(gpu, indices).clone();
        let mut batches = opaque.iter().chain(opened.iter().flatten());
        let cameras = batches.any(|batch| batch.shading.n_cameras > 0).then(|| {
            let padded: Vec<PaddedList> = lists.iter().map(|list| [*list; _]).collect();
            let lists = self.lists.write(gpu, &padded).clone();
            self.bind(gpu, shown.filtering, (backgrounds, depth_maps, &lists))
        });
        let textured =
            shown.textures.map(|(pictures, _)| (self.write_beside(gpu, shown).clone(), pictures.to_vec()));
        let texture_layout = shown.textures.map(|(_, layout)| layout);
        let ready = Ready { cameras, vertices, indices, textured, lent: shown.lent.cloned() };
        let n_indices = opaque.last().map_or(0, |batch| batch.indices.end);
        let is_dear = shown.may_overlap && opaque.iter().any(|batch| batch.shading.n_cameras > 0);
        let depth = Batch { shading: Shading::default(), texture: None, list: 0, indices: 0..n_indices };
        let depth = if is_dear { self.items(gpu, into, (&[depth], Cover::Depth), None)? } else { Vec::new() };
        let opaque = self.items(gpu, into, (opaque, Cover::Whole), texture_layout)?;
        let mut pass = recording.draw(LABEL, into);
        ready.draw(&mut pass, &depth);
        ready.draw(&mut pass, &opaque);
        drop(pass);
        if shown.opened.is_empty() {
            return Ok(None);
        }
        let mut surfaces = Vec::with_capacity(shown.opened.len());
        for (batches, Opened { opacity, .. }) in opened.iter().zip(shown.opened) {
            surfaces.push((self.items(gpu, into, (batches, Cover::Partly), texture_layout)?, *opacity));
        }
        Ok(Some(Translucent { ready, surfaces }))
    }

    /// What the vertices have beside on the device: written once, since no view changes it.
    fn write_beside(&mut self, gpu: &Gpu, shown: &StaticScene<'_>) -> &wgpu::Buffer {
        if self.texture_vertices_of != Some(shown.number) {
            let vertex = |vertex: &MeshVertex| TextureVertex {
                texture: vertex.texture.to_array(),
                tint: vertex.tint.to_array(),
            };
            let vertices: Vec<TextureVertex> = shown.vertices.iter().map(vertex).collect();
            self.texture_vertices.write(gpu, &vertices);
            self.texture_vertices_of = Some(shown.number);
        }
        self.texture_vertices.get().expect("they have just been written")
    }

    /// The vertices on the device, written where they or the anchor are others than the last frame's.
    fn write(&mut self, gpu: &Gpu, shown: &StaticScene<'_>) -> &wgpu::Buffer {
        let wanted = (shown.number, shown.anchor_in_world);
        match self.vertices.get() {
            Some(_) if self.written == Some(wanted) => {}
            _ => {
                self.scratch.clear();
                self.scratch.extend(shown.vertices.iter().map(|vertex| Vertex {
                    position_from_anchor:
                        (vertex.position_in_world - shown.anchor_in_world).as_vec3().to_array(),
                    normal: vertex.normal.to_array(),
                    material: vertex.material.to_array(),
                    nearer: vertex.nearer,
                }));
                self.vertices.write(gpu, &self.scratch);
                self.written = Some(wanted);
            }
        }
        self.vertices.get().expect("they have just been written")
    }

    fn bind(
        &self,
        gpu: &Gpu,
        filtering: Filtering,
        (backgrounds, depth_maps, lists): (&mut ImageArray, &DepthMaps, &wgpu::Buffer),
    ) -> wgpu::BindGroup {
        let list = wgpu::BufferBinding {
            buffer: lists,
            offset: 0,
            size: NonZeroU64::new(size_of::<CameraList>() as u64),
        };
        let sampler = match filtering {
            Filtering::Nearest => &self.nearest_sampler,
            Filtering::Bilinear | Filtering::Levels => &self.background_sampler,
        };
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let backgrounds = &backgrounds.store(gpu).sampled;
        // Variants that look into depth maps are drawn only where there are some: else anything will do.
        let depth_maps = depth_maps.view().unwrap_or(backgrounds);
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.layout,
            entries: &[
                entry(0, wgpu::BindingResource::TextureView(backgrounds)),
                entry(1, wgpu::BindingResource::Sampler(sampler)),
                entry(2, wgpu::BindingResource::TextureView(depth_maps)),
                entry(3, wgpu::BindingResource::Sampler(&self.depth_sampler)),
                entry(4, wgpu::BindingResource::Buffer(list)),
            ],
        })
    }
}
