//! What passes share that draw one finished picture from another.

use crate::gpu::{Gpu, GpuError, TextureDescriptor};
use crate::targets::COLOR_FORMAT;

/// A pipeline over the whole picture, by the shader of the label's stem.
pub(super) struct Screen<'a> {
    pub label: &'static str,
    pub entry_point: &'static str,
    pub layout: &'a wgpu::BindGroupLayout,
    pub constants: &'a [(&'a str, f64)],
    pub format: wgpu::TextureFormat,
}

impl Screen<'_> {
    pub(super) fn pipeline(&self, gpu: &Gpu) -> Result<wgpu::RenderPipeline, GpuError> {
        let Self { label, entry_point, layout, constants, format } = *self;
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
                entry_point: Some(entry_point),
                compilation_options,
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        };
        Ok(gpu.pipeline(label, &descriptor))
    }
}

/// A pipeline that draws a picture.
pub(super) fn pipeline(
    gpu: &Gpu,
    label: &'static str,
    layout: &wgpu::BindGroupLayout,
    constants: &[(&str, f64)],
) -> Result<wgpu::RenderPipeline, GpuError> {
    Screen { label, entry_point: "fs_main", layout, constants, format: COLOR_FORMAT }.pipeline(gpu)
}

/// The picture that is drawn.
pub(super) fn picture(gpu: &Gpu, label: &'static str, width: u32, height: u32) -> wgpu::Texture {
    texture(gpu, label, COLOR_FORMAT, (width, height))
}

fn texture(
    gpu: &Gpu,
    label: &'static str,
    format: wgpu::TextureFormat,
    (width, height): (u32, u32),
) -> wgpu::Texture {
    gpu.texture(&TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    })
}

/// The picture that a pass drew last, kept for the next of its size.
#[derive(Debug, Default)]
pub(super) struct Kept(Option<wgpu::Texture>);

impl Kept {
    pub(super) fn of(
        &mut self,
        gpu: &Gpu,
        label: &'static str,
        format: wgpu::TextureFormat,
        size_px: (u32, u32),
    ) -> &wgpu::Texture {
        self.0.take_if(|kept| (kept.width(), kept.height()) != size_px);
        self.0.get_or_insert_with(|| texture(gpu, label, format, size_px))
    }

    /// Lets go of one of more than `max_bytes`.
    pub(super) fn trim(&mut self, max_bytes: u64) {
        self.0.take_if(|kept| u64::from(kept.width()) * u64::from(kept.height()) * 4 > max_bytes);
    }
}

/// All of a texture.
pub(super) fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// A uniform buffer at a binding.
pub(super) const fn uniform_entry(binding: u32) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }
}
