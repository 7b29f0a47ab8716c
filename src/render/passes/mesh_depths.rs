//! What every camera of a changing mesh sees of it first, as depth maps.
//!
//! [`videofields_vision::mesh::Raster`] is the specification.

use super::Recording;
use super::changing_mesh::MadeMesh;
use super::compute::{Access, bind, layout_for};
use crate::gpu::{Gpu, GpuError, TextureDescriptor};
use crate::targets::DEPTH_FORMAT;

const LABEL: &str = "mesh_depths";

/// Layers of one size, each with its view.
#[derive(Debug)]
struct Maps {
    texture: wgpu::Texture,
    all: wgpu::TextureView,
    layers: Vec<wgpu::TextureView>,
}

impl Maps {
    fn of(gpu: &Gpu, [width, height]: [u32; 2], n_layers: u32) -> Self {
        let texture = gpu.texture(&TextureDescriptor {
            label: Some(LABEL),
            // An array of one layer is no array to some devices.
            size: wgpu::Extent3d { width, height, depth_or_array_layers: n_layers.max(2) },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: DEPTH_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let layer = |idx: u32| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: idx,
                array_layer_count: Some(1),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        let layers = (0..n_layers).map(layer).collect();
        let all = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        Self { texture, all, layers }
    }
}

/// Draws depth maps of a mesh.
#[derive(Debug)]
pub(crate) struct MeshDepthsPass {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::RenderPipeline,
    maps: Option<Maps>,
}

impl MeshDepthsPass {
    pub(crate) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        variant: &[(&str, f64)],
    ) -> Result<Self, GpuError> {
        let layout = layout_for(gpu, LABEL, (wgpu::ShaderStages::VERTEX, &[Access::Read]));
        let module = gpu.shader(&format!("render/{LABEL}.wgsl"))?;
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(LABEL),
            bind_group_layouts: &[Some(frame_layout), Some(&layout)],
            immediate_size: 0,
        });
        let attributes = wgpu::vertex_attr_array![0 => Float32x4];
        let vertices = wgpu::VertexBufferLayout {
            array_stride: 16,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &attributes,
        };
        let descriptor = wgpu::RenderPipelineDescriptor {
            label: Some(LABEL),
            layout: Some(&pipeline_layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vs_main"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: variant,
                    ..wgpu::PipelineCompilationOptions::default()
                },
                buffers: &[Some(vertices)],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: None,
            multiview_mask: None,
            cache: None,
        };
        Ok(Self { pipeline: gpu.pipeline(LABEL, &descriptor), layout, maps: None })
    }

    /// Records that the maps of all cameras are drawn, of so many columns and rows each; answers them, a layer a camera.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        frame: &wgpu::BindGroup,
        (mesh, maps_px): (&MadeMesh, &[[u32; 2]]),
    ) -> wgpu::TextureView {
        let gpu = recording.gpu;
        let most = |side: usize| maps_px.iter().map(|size| size[side]).max().unwrap_or(1).max(1);
        let (size, n_layers) = ([most(0), most(1)], maps_px.len() as u32);
        self.maps.take_if(|kept| {
            [kept.texture.width(), kept.texture.height()] != size || kept.layers.len() < maps_px.len()
        });
        let maps = self.maps.get_or_insert_with(|| Maps::of(gpu, size, n_layers));
        let group = bind(gpu, (LABEL, &self.layout), &[&mesh.parameters, &mesh.shifts]);
        let span = recording.timer.span(LABEL);
        for (idx, ([width, height], layer)) in (0..).zip(maps_px.iter().zip(&maps.layers)) {
            let descriptor = wgpu::RenderPassDescriptor {
                label: Some(LABEL),
                color_attachments: &[],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: layer,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(0.0),
                        store: wgpu::StoreOp::Store,
                    }),
                    stencil_ops: None,
                }),
                timestamp_writes: recording.timer.writes(span, idx as usize, maps_px.len()),
                occlusion_query_set: None,
                multiview_mask: None,
            };
            let mut pass = gpu.begin_pass(recording.encoder, LABEL, &descriptor);
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, frame, &[]);
            pass.set_bind_group(1, &group, &[]);
            pass.set_vertex_buffer(0, mesh.on_device.positions.slice(..));
            pass.set_index_buffer(mesh.on_device.corners.slice(..), wgpu::IndexFormat::Uint32);
            pass.set_viewport(0.0, 0.0, *width as f32, *height as f32, 0.0, 1.0);
            pass.draw_indexed(0..3 * mesh.n[1], 0, idx..idx + 1);
        }
        maps.all.clone()
    }
}
