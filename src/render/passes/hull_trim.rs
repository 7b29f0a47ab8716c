//! Surfaces of hulls by the faces of their silhouettes' cones, each trimmed by the other silhouettes.

use super::hull_rays::{HullSurface, SURFACE_FORMAT};
use super::{Attributes, Recording};
use crate::gpu::{Gpu, GpuError, TextureDescriptor};
use crate::render::hull_data::HullData;
use crate::render::targets::DEPTH_FORMAT;

const LABEL: &str = "hull_trim";

/// What tells a face: hull, view and edge.
pub(super) const FACE: Attributes<1> = wgpu::vertex_attr_array![0 => Uint32x3];

/// Draws trimmed cones.
#[derive(Debug)]
pub(in crate::render) struct HullTrimPass {
    pipeline: wgpu::RenderPipeline,
    depth: Option<wgpu::Texture>,
}

impl HullTrimPass {
    pub(in crate::render) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        hulls: &HullData,
    ) -> Result<Self, GpuError> {
        let module = gpu.shader("render/hull_trim.wgsl")?;
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(LABEL),
            bind_group_layouts: &[Some(frame_layout), None, Some(hulls.layout())],
            immediate_size: 0,
        });
        let faces = wgpu::VertexBufferLayout {
            array_stride: size_of::<[u32; 3]>() as u64,
            step_mode: wgpu::VertexStepMode::Instance,
            attributes: &FACE,
        };
        let descriptor = wgpu::RenderPipelineDescriptor {
            label: Some(LABEL),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vs_main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[Some(faces)],
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
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(wgpu::ColorTargetState::from(SURFACE_FORMAT))],
            }),
            multiview_mask: None,
            cache: None,
        };
        Ok(Self { pipeline: gpu.pipeline(LABEL, &descriptor), depth: None })
    }

    /// Records that `surface` gets the nearest face of any trimmed cone.
    pub(in crate::render) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        frame: &wgpu::BindGroup,
        (hulls, group): (&HullData, &wgpu::BindGroup),
        surface: &HullSurface,
    ) {
        let gpu = recording.gpu;
        let [width, height] = surface.size_px();
        self.depth.take_if(|kept| [kept.width(), kept.height()] != [width, height]);
        let depth = self.depth.get_or_insert_with(|| depth_texture(gpu, [width, height]));
        let depth = depth.create_view(&wgpu::TextureViewDescriptor::default());
        let span = recording.timer.span(LABEL);
        let descriptor = wgpu::RenderPassDescriptor {
            label: Some(LABEL),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &surface.view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
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
        let (faces, n_faces) = hulls.faces();
        let mut pass = gpu.begin_pass(recording.encoder, LABEL, &descriptor);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(2, group, &[]);
        pass.set_vertex_buffer(0, faces.slice(..));
        pass.draw(0..4, 0..n_faces);
    }
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
