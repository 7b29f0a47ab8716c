//! The passes, one file each with one anatomy: mirror structs, a `Pass` made once, `record` for every frame.

mod average;
mod billboard;
mod camera_depth;
mod changing_mesh;
mod compute;
mod distance;
mod enlarge;
mod fields;
mod fields_distances;
mod fields_topology;
mod hull;
mod hull_depths;
mod hull_peel;
mod hull_rays;
mod hull_trim;
mod hull_voxels;
mod mesh_carry;
mod mesh_colors;
mod mesh_depths;
mod mesh_sight;
mod mesh_smooth;
mod mesh_weights;
mod occlusion;
mod points;
mod relight;
mod resample;
pub(super) mod see_through;
mod sky;
mod stipple;
mod surface;
mod yuv;

pub(super) use average::AveragePass;
pub(super) use billboard::{BillboardPass, Instance as BillboardInstance, Seen as SeenBillboard};
pub(super) use camera_depth::{CameraDepthPass, DepthMaps, single_face_bounds};
pub(super) use changing_mesh::{
    ChangingMesh, ChangingMeshPass, MOST_SLOTS, MadeMesh, MeshBuffers, MeshCamera, NEIGHBOUR_WORDS, ShownBy,
    VALUE_BYTES, WrittenMesh,
};
pub(super) use compute::DeviceBuffer;
pub(super) use distance::{DISTANCE_FORMAT, DistancePass, Lens};
pub(super) use enlarge::{EnlargePass, MARGIN_PX as ENLARGE_MARGIN_PX};
pub(super) use fields::{
    FIELD_SLOTS, FieldGroup, FieldSlots, FieldVertex, FieldsPass, FieldsWanted, NO_FIELD_VIEW,
};
pub(super) use fields_distances::FieldsDistancesPass;
pub(super) use fields_topology::{FieldsTopologyPass, MeshSize, OnDevice};
pub(super) use hull::{HullPass, HullSeen};
pub(super) use hull_depths::HullDepthsPass;
pub(super) use hull_peel::{HullPeelPass, MOST_VALID_PX};
pub(super) use hull_rays::{HullRaysPass, HullSurface};
pub(super) use hull_trim::HullTrimPass;
pub(super) use hull_voxels::HullVoxelsPass;
pub(super) use mesh_carry::{Before, MeshCarryPass};
pub(super) use mesh_colors::MeshColorsPass;
pub(super) use mesh_depths::MeshDepthsPass;
pub(super) use mesh_sight::{MeshSightPass, Reaching};
pub(super) use mesh_smooth::MeshSmoothPass;
pub(super) use mesh_weights::MeshWeightsPass;
pub(super) use occlusion::OcclusionPass;
pub(super) use points::{Instance as PointInstance, PointsPass};
pub(super) use relight::{Drawn, RelightPass};
pub(super) use sky::SkyPass;
pub(super) use stipple::StipplePass;
pub(super) use surface::{StaticScene, SurfacePass, Translucent};
pub(super) use yuv::YuvPass;

use super::image_array::ImageArray;
use super::targets::{COLOR_FORMAT, DEPTH_FORMAT, Place, Targets};
use crate::gpu::{Gpu, GpuError, Mirror, Timer};

/// The mirror structs of all passes.
pub(super) fn mirrors() -> Vec<Mirror> {
    let mut mirrors = vec![yuv::Conversion::MIRROR, camera_depth::Face::MIRROR, sky::Sky::MIRROR];
    mirrors.extend(fields::MIRRORS);
    mirrors.extend([MeshSize::MIRROR, MeshCamera::MIRROR, ChangingMesh::MIRROR]);
    mirrors.extend([
        Lens::MIRROR,
        relight::Light::MIRROR,
        occlusion::Occlusion::MIRROR,
        stipple::Stipple::MIRROR,
    ]);
    mirrors
}

/// The vertex layouts of all passes: shader, entry point, attributes' locations and formats.
pub(super) type Attributes<const N: usize> = [wgpu::VertexAttribute; N];

/// What every pass of a frame records with.
pub(super) struct Recording<'a> {
    pub gpu: &'a Gpu,
    pub encoder: &'a mut wgpu::CommandEncoder,
    pub timer: &'a mut Timer,
}

/// What a drawing pass draws on, and its place among the passes of the frame.
#[derive(Clone, Copy)]
pub(super) struct DrawInto<'a> {
    pub targets: &'a Targets,
    /// Bind group 0 and its layout.
    pub frame: &'a wgpu::BindGroup,
    pub frame_layout: &'a wgpu::BindGroupLayout,
    /// Whether cameras' colours are multiplied by their gains: which variant of a pipeline draws.
    pub has_gains: bool,
    pub place: Place,
}

impl Recording<'_> {
    /// Begins a pass that draws into the frame's targets, timed under `label`.
    fn draw<'e>(&'e mut self, label: &'static str, into: &DrawInto<'_>) -> wgpu::RenderPass<'e> {
        let span = self.timer.span(label);
        let mut pass = self.gpu.begin_pass(
            self.encoder,
            label,
            &wgpu::RenderPassDescriptor {
                label: Some(label),
                color_attachments: &[Some(into.targets.color_attachment(into.place))],
                depth_stencil_attachment: Some(into.targets.depth_attachment(into.place)),
                timestamp_writes: self.timer.writes(span, 0, 1),
                occlusion_query_set: None,
                multiview_mask: None,
            },
        );
        pass.set_bind_group(0, into.frame, &[]);
        pass
    }
}

/// Begins a pass that draws all of a picture without depths.
fn picture_pass<'e>(
    gpu: &Gpu,
    encoder: &'e mut wgpu::CommandEncoder,
    label: &'static str,
    (picture, timestamp_writes): (&wgpu::TextureView, Option<wgpu::RenderPassTimestampWrites<'_>>),
) -> wgpu::RenderPass<'e> {
    let attachment = wgpu::RenderPassColorAttachment {
        view: picture,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
    };
    let descriptor = wgpu::RenderPassDescriptor {
        label: Some(label),
        color_attachments: &[Some(attachment)],
        depth_stencil_attachment: None,
        timestamp_writes,
        occlusion_query_set: None,
        multiview_mask: None,
    };
    gpu.begin_pass(encoder, label, &descriptor)
}

/// Pipelines that differ in their samples a pixel alone, each made when a frame first calls for it.
#[derive(Debug, Default)]
struct BySamples(Vec<(u32, wgpu::RenderPipeline)>);

impl BySamples {
    fn get(
        &mut self,
        samples: u32,
        make: impl FnOnce() -> Result<wgpu::RenderPipeline, GpuError>,
    ) -> Result<&wgpu::RenderPipeline, GpuError> {
        let idx = match self.0.iter().position(|(known, _)| *known == samples) {
            Some(idx) => idx,
            None => {
                self.0.push((samples, make()?));
                self.0.len() - 1
            }
        };
        Ok(&self.0[idx].1)
    }
}

/// How a drawing pass meets what was drawn before it.
#[derive(Clone, Copy)]
struct Mixing {
    blend: Option<wgpu::BlendState>,
    writes_depth: bool,
    writes_color: bool,
    culls_back: bool,
}

/// Entry points of most drawing passes.
const MAIN: [&str; 2] = ["vs_main", "fs_main"];

/// A pipeline that draws into the frame's targets, by the shader of the label's stem.
struct DrawPipeline<'a> {
    label: &'static str,
    /// None where the shader uses none of a group.
    bind_groups: &'a [Option<&'a wgpu::BindGroupLayout>],
    vertices: &'a [Option<wgpu::VertexBufferLayout<'a>>],
    /// Of vertices and of fragments.
    entry_points: [&'static str; 2],
    topology: wgpu::PrimitiveTopology,
    mixing: Mixing,
    /// Values of the shader's override constants.
    variant: &'a [(&'a str, f64)],
    samples: u32,
}

fn draw_pipeline(gpu: &Gpu, wanted: DrawPipeline<'_>) -> Result<wgpu::RenderPipeline, GpuError> {
    let DrawPipeline { label, bind_groups, vertices, entry_points, topology, mixing, variant, samples } =
        wanted;
    let module = gpu.shader(&format!("render/{label}.wgsl"))?;
    let compilation_options = wgpu::PipelineCompilationOptions {
        constants: variant,
        ..wgpu::PipelineCompilationOptions::default()
    };
    let write_mask = if mixing.writes_color { wgpu::ColorWrites::ALL } else { wgpu::ColorWrites::empty() };
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: bind_groups,
        immediate_size: 0,
    });
    let descriptor = wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some(entry_points[0]),
            compilation_options: compilation_options.clone(),
            buffers: vertices,
        },
        primitive: wgpu::PrimitiveState {
            topology,
            cull_mode: mixing.culls_back.then_some(wgpu::Face::Back),
            ..wgpu::PrimitiveState::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(mixing.writes_depth),
            depth_compare: Some(wgpu::CompareFunction::GreaterEqual),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState { count: samples, ..wgpu::MultisampleState::default() },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(entry_points[1]),
            compilation_options,
            targets: &[Some(wgpu::ColorTargetState {
                format: COLOR_FORMAT,
                blend: mixing.blend,
                write_mask,
            })],
        }),
        multiview_mask: None,
        cache: None,
    };
    Ok(gpu.pipeline(label, &descriptor))
}

pub(super) fn texture_entry(
    binding: u32,
    view_dimension: wgpu::TextureViewDimension,
    sample_type: wgpu::TextureSampleType,
) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
        ty: wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false },
        count: None,
    }
}

/// Returns the layout entry of a buffer that shaders of these stages read.
pub(super) const fn read_entry(binding: u32, visibility: wgpu::ShaderStages) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: true },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }
}

pub(super) const FILTERED: wgpu::TextureSampleType = wgpu::TextureSampleType::Float { filterable: true };
const UNFILTERED: wgpu::TextureSampleType = wgpu::TextureSampleType::Float { filterable: false };

pub(super) const SAMPLER_ENTRY: wgpu::BindGroupLayoutEntry = wgpu::BindGroupLayoutEntry {
    binding: 1,
    visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
    ty: wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
    count: None,
};

fn linear_sampler(gpu: &Gpu, label: &'static str) -> wgpu::Sampler {
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some(label),
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        ..wgpu::SamplerDescriptor::default()
    })
}

/// Bind group 1 of the passes that show entities: the live frames and how they are sampled.
#[derive(Debug)]
struct LiveFrames {
    layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
}

impl LiveFrames {
    fn new(gpu: &Gpu, label: &'static str) -> Self {
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(label),
            entries: &[texture_entry(0, wgpu::TextureViewDimension::D2Array, FILTERED), SAMPLER_ENTRY],
        });
        Self { layout, sampler: linear_sampler(gpu, label) }
    }

    fn bind(&self, gpu: &Gpu, frames: &mut ImageArray) -> wgpu::BindGroup {
        self.bind_view(gpu, &frames.store(gpu).sampled)
    }

    /// The same of pictures that are the device's own.
    fn bind_view(&self, gpu: &Gpu, frames: &wgpu::TextureView) -> wgpu::BindGroup {
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("live frames"),
            layout: &self.layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(frames) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&self.sampler) },
            ],
        })
    }
}
