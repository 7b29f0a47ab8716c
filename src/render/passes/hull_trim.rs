//! Surfaces of hulls by the faces of their silhouettes' cones, each trimmed by the other silhouettes.

use super::hull_rays::{HullSurface, SURFACE_FORMAT};
use super::{Attributes, Recording};
use crate::gpu::{Gpu, GpuError, TextureDescriptor};
use crate::hull_data::HullData;
use crate::targets::DEPTH_FORMAT;

const LABEL: &str = "hull_trim";

/// What tells a face: hull, view and edge.
pub(super) const FACE: Attributes<1> = wgpu::vertex_attr_array![0 => Uint32x3];

/// A face an instance.
pub(super) const fn faces_layout() -> wgpu::VertexBufferLayout<'static> {
    wgpu::VertexBufferLayout {
        array_stride: size_of::<[u32; 3]>() as u64,
        step_mode: wgpu::VertexStepMode::Instance,
        attributes: &FACE,
    }
}

/// Draws trimmed cones.
#[derive(Debug)]
pub(crate) struct HullTrimPass {
    pipeline: wgpu::RenderPipeline,
    depth: Option<wgpu::Texture>,
}

impl HullTrimPass {
    pub(crate) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        hulls: &HullData,
    ) -> Result<Self, GpuError> {
        let faces = (faces_layout(), Some(SURFACE_FORMAT));
        Ok(Self { pipeline: strips_pipeline(gpu, LABEL, (frame_layout, hulls), faces)?, depth: None })
    }

    /// What it tests depths with.
    pub(crate) const fn depth(&mut self) -> &mut Option<wgpu::Texture> {
        &mut self.depth
    }

    /// Records that `surface` gets the nearest face of any trimmed cone.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        frame: &wgpu::BindGroup,
        (hulls, group): (&HullData, &wgpu::BindGroup),
        surface: &HullSurface,
    ) {
        let (vertices, n_instances) = hulls.faces();
        let drawn = Drawn { pipeline: &self.pipeline, vertices, n_instances };
        surface_pass(recording, LABEL, (frame, group), (surface, &mut self.depth), &drawn);
    }
}

/// A pipeline that draws strips of four corners, the nearest of them left, by the shader of the label's stem: into a surface, or
/// without any `format` their depths alone.
pub(super) fn strips_pipeline(
    gpu: &Gpu,
    label: &'static str,
    (frame_layout, hulls): (&wgpu::BindGroupLayout, &HullData),
    (vertices, format): (wgpu::VertexBufferLayout<'_>, Option<wgpu::TextureFormat>),
) -> Result<wgpu::RenderPipeline, GpuError> {
    let module = gpu.shader(&format!("render/{label}.wgsl"))?;
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: &[Some(frame_layout), None, Some(hulls.layout())],
        immediate_size: 0,
    });
    let variant = hulls.variant();
    let compilation_options = || wgpu::PipelineCompilationOptions {
        constants: &variant,
        ..wgpu::PipelineCompilationOptions::default()
    };
    let target = format.map(|format| Some(wgpu::ColorTargetState::from(format)));
    let descriptor = wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vs_main"),
            compilation_options: compilation_options(),
            buffers: &[Some(vertices)],
        },
        primitive: wgpu::PrimitiveState {
            topology: wgpu::PrimitiveTopology::TriangleStrip,
            ..wgpu::PrimitiveState::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fs_main"),
            compilation_options: compilation_options(),
            targets: target.as_slice(),
        }),
        multiview_mask: None,
        cache: None,
    };
    Ok(gpu.pipeline(label, &descriptor))
}

/// Strips of four corners, one an instance.
pub(super) struct Drawn<'a> {
    pub pipeline: &'a wgpu::RenderPipeline,
    pub vertices: &'a wgpu::Buffer,
    pub n_instances: u32,
}

/// Records one pass that draws into a surface that nothing is on yet.
pub(super) fn surface_pass(
    recording: &mut Recording<'_>,
    label: &'static str,
    (frame, group): (&wgpu::BindGroup, &wgpu::BindGroup),
    (surface, depth): (&HullSurface, &mut Option<wgpu::Texture>),
    drawn: &Drawn<'_>,
) {
    let gpu = recording.gpu;
    let size = surface.size_px();
    depth.take_if(|kept| [kept.width(), kept.height()] != size);
    let depth = depth.get_or_insert_with(|| depth_texture(gpu, size));
    let depth = depth.create_view(&wgpu::TextureViewDescriptor::default());
    let span = recording.timer.span(label);
    let descriptor = wgpu::RenderPassDescriptor {
        label: Some(label),
        color_attachments: &[Some(surface.cleared())],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &depth,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(0.0),
                store: wgpu::StoreOp::Discard,
            }),
            stencil_ops: None,
        }),
        timestamp_writes: recording.timer.writes(span, 0, 1),
        occlusion_query_set: None,
        multiview_mask: None,
    };
    let mut pass = gpu.begin_pass(recording.encoder, label, &descriptor);
    pass.set_pipeline(drawn.pipeline);
    pass.set_bind_group(0, frame, &[]);
    pass.set_bind_group(2, group, &[]);
    pass.set_vertex_buffer(0, drawn.vertices.slice(..));
    pass.draw(0..4, 0..drawn.n_instances);
}

/// Depths of hulls' surfaces, of a picture of that size.
pub(super) fn depth_texture(gpu: &Gpu, [width, height]: [u32; 2]) -> wgpu::Texture {
    gpu.texture(&TextureDescriptor {
        label: Some("hull depth"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: DEPTH_FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    })
}
