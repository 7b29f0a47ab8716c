//! Sky, ground and boxes, with the cameras' backgrounds projected on them.

use super::camera_depth::DepthMaps;
use super::{
    Attributes, BySamples, DrawInto, DrawPipeline, FILTERED, MAIN, Mixing, Recording, SAMPLER_ENTRY,
    UNFILTERED, draw_pipeline, linear_sampler, texture_entry,
};
use crate::gpu::{Gpu, GpuError, GrowingBuffer};
use crate::plan::Opened;
use crate::render::camera_data::Camera;
use crate::render::image_array::ImageArray;
use crate::render::mesh::{Mesh, MeshVertex};
use glam::DVec3;
use std::ops::Range;

/// One corner of a triangle, relative to the anchor.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Vertex {
    position_from_anchor: [f32; 3],
    normal: [f32; 3],
    material: [f32; 3],
}

const ATTRIBUTES: Attributes<3> = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3];

/// What a corner of a triangle with a picture has beside: [`crate::render::mesh::MeshVertex`].
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct TextureVertex {
    texture: [f32; 4],
    tint: [f32; 3],
}

const TEXTURE_ATTRIBUTES: Attributes<2> = wgpu::vertex_attr_array![3 => Float32x4, 4 => Float32x3];

/// Which variant of the shader a frame needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) struct SurfaceKey {
    n_cameras: usize,
    has_lenses: bool,
    has_depth_maps: bool,
    has_depth_cubes: bool,
    has_textures: bool,
}

impl SurfaceKey {
    /// The least that serves the cameras whose backgrounds are projected.
    pub(in crate::render) fn of(cameras: &[Camera]) -> Self {
        Self {
            n_cameras: cameras.len(),
            has_lenses: cameras.iter().any(Camera::has_lens),
            has_depth_maps: cameras.iter().any(|camera| camera.n_depth_faces > 0),
            has_depth_cubes: cameras.iter().any(|camera| camera.n_depth_faces > 1),
            has_textures: false,
        }
    }

    /// The same for what has a picture.
    const fn textured(self) -> Self {
        Self { has_textures: true, ..self }
    }

    fn constants(self) -> [(&'static str, f64); 4] {
        let flag = |is_set: bool| f64::from(u8::from(is_set));
        [
            ("N_SURFACE_CAMERAS", self.n_cameras as f64),
            ("HAS_LENSES", flag(self.has_lenses)),
            ("HAS_DEPTH_MAPS", flag(self.has_depth_maps)),
            ("HAS_DEPTH_CUBES", flag(self.has_depth_cubes)),
        ]
    }
}

/// Whether a surface covers what lies behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cover {
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
        match self {
            Self::Whole => Mixing { blend: None, writes_depth: true, culls_back: false },
            Self::Partly => {
                let color = factor(wgpu::BlendFactor::Constant, wgpu::BlendFactor::OneMinusConstant);
                let alpha = factor(wgpu::BlendFactor::Zero, wgpu::BlendFactor::One);
                Mixing {
                    blend: Some(wgpu::BlendState { color, alpha }),
                    writes_depth: false,
                    culls_back: true,
                }
            }
        }
    }
}

/// Surfaces that are drawn translucent, ready to be drawn within a pass.
#[derive(Debug)]
pub(in crate::render) struct Translucent {
    brush: Brush,
    /// Vertices, by their pictures, and opacity of each.
    items: Vec<(Vec<Stretch>, f32)>,
}

/// Vertices that are drawn at once, with the place of their picture.
type Stretch = (Option<usize>, Range<u32>);

/// What surfaces are drawn with.
#[derive(Debug)]
struct Brush {
    pipeline: wgpu::RenderPipeline,
    textures: wgpu::BindGroup,
    vertices: wgpu::Buffer,
    /// Of those with a picture: pipeline, what their vertices have beside, and the pictures.
    textured: Option<(wgpu::RenderPipeline, wgpu::Buffer, Vec<wgpu::BindGroup>)>,
}

impl Brush {
    /// Draws stretches, those without a picture first.
    fn draw(&self, pass: &mut wgpu::RenderPass<'_>, stretches: &[Stretch]) {
        pass.set_bind_group(1, &self.textures, &[]);
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        let mut last = None;
        for (place, range) in stretches {
            if last != Some(place) {
                self.dip(pass, *place);
                last = Some(place);
            }
            pass.draw(range.clone(), 0..1);
        }
    }

    fn dip(&self, pass: &mut wgpu::RenderPass<'_>, place: Option<usize>) {
        match (place, &self.textured) {
            (Some(place), Some((pipeline, vertices, pictures))) => {
                pass.set_pipeline(pipeline);
                pass.set_vertex_buffer(1, vertices.slice(..));
                pass.set_bind_group(2, &pictures[place], &[]);
            }
            _ => pass.set_pipeline(&self.pipeline),
        }
    }
}

impl Translucent {
    pub(in crate::render) const fn len(&self) -> usize {
        self.items.len()
    }

    /// Draws one of them over what was drawn before; what else is drawn in the pass must set its own pipeline again.
    pub(in crate::render) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, idx: usize) {
        let (stretches, opacity) = &self.items[idx];
        let opacity = f64::from(*opacity);
        pass.set_blend_constant(wgpu::Color { r: opacity, g: opacity, b: opacity, a: opacity });
        self.brush.draw(pass, stretches);
    }
}

/// What is shown, from where, by which variant.
#[derive(Clone, Copy)]
pub(in crate::render) struct StaticScene<'a> {
    pub mesh: &'a Mesh,
    pub anchor_in_world: DVec3,
    pub key: SurfaceKey,
    /// The mesh's pictures as they are bound, and their layout; none of a mesh without.
    pub textures: Option<(&'a [wgpu::BindGroup], &'a wgpu::BindGroupLayout)>,
    /// Surfaces that are drawn translucent, after what lies behind them.
    pub opened: &'a [Opened],
}

/// Draws the static scene.
#[derive(Debug)]
pub(in crate::render) struct SurfacePass {
    layout: wgpu::BindGroupLayout,
    pipelines: Vec<(SurfaceKey, Cover, BySamples)>,
    background_sampler: wgpu::Sampler,
    depth_sampler: wgpu::Sampler,
    vertices: GrowingBuffer,
    scratch: Vec<Vertex>,
    texture_vertices: GrowingBuffer,
    /// Of which mesh they are.
    texture_vertices_of: Option<u64>,
    /// Of which mesh, relative to what the vertices are: parts of a picture mostly share both.
    written: Option<(u64, DVec3)>,
}

const LABEL: &str = "surface";

impl SurfacePass {
    pub(in crate::render) fn new(gpu: &Gpu) -> Self {
        let depth_sampler_entry = wgpu::BindGroupLayoutEntry {
            binding: 3,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering),
            count: None,
        };
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[
                texture_entry(0, wgpu::TextureViewDimension::D2Array, FILTERED),
                SAMPLER_ENTRY,
                texture_entry(2, wgpu::TextureViewDimension::D2Array, UNFILTERED),
                depth_sampler_entry,
            ],
        });
        Self {
            layout,
            pipelines: Vec::new(),
            background_sampler: linear_sampler(gpu, LABEL),
            depth_sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("surface depth"),
                ..wgpu::SamplerDescriptor::default()
            }),
            vertices: GrowingBuffer::new("surface vertices", wgpu::BufferUsages::VERTEX),
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
        (key, cover): (SurfaceKey, Cover),
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
        let mut bind_groups = vec![into.frame_layout, &self.layout];
        let mut buffers = vec![Some(vertices)];
        if let Some(layout) = texture_layout {
            bind_groups.push(layout);
            buffers.push(Some(beside));
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
            entry_points: if key.has_textures { ["vs_textured", "fs_textured"] } else { MAIN },
            topology: wgpu::PrimitiveTopology::TriangleList,
            mixing: cover.mixing(),
            variant: &key.constants(),
            samples,
        };
        self.pipelines[idx].2.get(samples, || draw_pipeline(gpu, wanted))
    }

    /// Records the sky (the colour to clear with) and the scene's mesh; returns what of it is drawn later.
    pub(in crate::render) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        shown: &StaticScene<'_>,
        backgrounds: &mut ImageArray,
        depth_maps: &mut DepthMaps,
    ) -> Result<Option<Translucent>, GpuError> {
        let gpu = recording.gpu;
        let textures = self.bind(gpu, backgrounds, depth_maps);
        let brush = self.brush(gpu, into, shown, (&textures, Cover::Whole))?;
        let is_opened = |surface| shown.opened.iter().any(|opened| opened.surface == surface);
        let opaque = shown.mesh.without(is_opened);
        let mut pass = recording.draw(LABEL, into);
        brush.draw(&mut pass, &shown.mesh.by_texture(&opaque));
        drop(pass);
        if shown.opened.is_empty() {
            return Ok(None);
        }
        let brush = self.brush(gpu, into, shown, (&textures, Cover::Partly))?;
        let item =
            |opened: &Opened| (shown.mesh.by_texture(&[shown.mesh.range_of(opened.surface)]), opened.opacity);
        let items = shown.opened.iter().map(item).collect();
        Ok(Some(Translucent { brush, items }))
    }

    /// What the surfaces are drawn with; of pictures nothing where there are none.
    fn brush(
        &mut self,
        gpu: &Gpu,
        into: &DrawInto<'_>,
        shown: &StaticScene<'_>,
        (textures, cover): (&wgpu::BindGroup, Cover),
    ) -> Result<Brush, GpuError> {
        let vertices = self.write(gpu, shown).clone();
        let pipeline = self.pipeline(gpu, into, (shown.key, cover), None)?.clone();
        let textured = match shown.textures {
            None => None,
            Some((pictures, layout)) => {
                let beside = self.write_beside(gpu, shown.mesh).clone();
                let key = shown.key.textured();
                let pipeline = self.pipeline(gpu, into, (key, cover), Some(layout))?.clone();
                Some((pipeline, beside, pictures.to_vec()))
            }
        };
        Ok(Brush { pipeline, textures: textures.clone(), vertices, textured })
    }

    /// What the mesh's vertices have beside on the device: once a mesh, since no view changes it.
    fn write_beside(&mut self, gpu: &Gpu, mesh: &Mesh) -> &wgpu::Buffer {
        if self.texture_vertices_of != Some(mesh.number) {
            let vertex = |vertex: &MeshVertex| TextureVertex {
                texture: vertex.texture.to_array(),
                tint: vertex.tint.to_array(),
            };
            let vertices: Vec<TextureVertex> = mesh.vertices.iter().map(vertex).collect();
            self.texture_vertices.write(gpu, &vertices);
            self.texture_vertices_of = Some(mesh.number);
        }
        self.texture_vertices.get().expect("they have just been written")
    }

    /// The mesh's vertices on the device, written where mesh or anchor are others than the last frame's.
    fn write(&mut self, gpu: &Gpu, shown: &StaticScene<'_>) -> &wgpu::Buffer {
        let wanted = (shown.mesh.number, shown.anchor_in_world);
        match self.vertices.get() {
            Some(_) if self.written == Some(wanted) => {}
            _ => {
                self.scratch.clear();
                self.scratch.extend(shown.mesh.vertices.iter().map(|vertex| Vertex {
                    position_from_anchor:
                        (vertex.position_in_world - shown.anchor_in_world).as_vec3().to_array(),
                    normal: vertex.normal.to_array(),
                    material: vertex.material.to_array(),
                }));
                self.vertices.write(gpu, &self.scratch);
                self.written = Some(wanted);
            }
        }
        self.vertices.get().expect("they have just been written")
    }

    fn bind(&self, gpu: &Gpu, backgrounds: &mut ImageArray, depth_maps: &mut DepthMaps) -> wgpu::BindGroup {
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.layout,
            entries: &[
                entry(0, wgpu::BindingResource::TextureView(&backgrounds.store(gpu).sampled)),
                entry(1, wgpu::BindingResource::Sampler(&self.background_sampler)),
                entry(2, wgpu::BindingResource::TextureView(depth_maps.view(gpu))),
                entry(3, wgpu::BindingResource::Sampler(&self.depth_sampler)),
            ],
        })
    }
}
