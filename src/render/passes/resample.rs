//! What passes share that draw one finished picture from another, of another size.

use crate::gpu::{Gpu, GpuError, TextureDescriptor};
use crate::render::targets::COLOR_FORMAT;

/// A pipeline over the whole picture, by the shader of the label's stem.
pub(super) fn pipeline(
    gpu: &Gpu,
    label: &'static str,
    layout: &wgpu::BindGroupLayout,
    constants: &[(&str, f64)],
) -> Result<wgpu::RenderPipeline, GpuError> {
    let module = gpu.shader(&format!("render/{label}.wgsl"))?;
    let compilation_options =
        wgpu::PipelineCompilationOptions { constants, ..wgpu::PipelineCompilationOptions::default() };
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    let descriptor = wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vs_main"),
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fs_main"),
            compilation_options,
            targets: &[Some(COLOR_FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    };
    Ok(gpu.pipeline(label, &descriptor))
}

/// The picture that is drawn.
pub(super) fn picture(gpu: &Gpu, label: &'static str, width: u32, height: u32) -> wgpu::Texture {
    gpu.texture(&TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: COLOR_FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}
