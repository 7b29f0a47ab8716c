//! Surfaces of hulls by the rays of the picture's pixels.

use super::Recording;
use crate::gpu::{Gpu, GpuError, TextureDescriptor};
use crate::hull_data::HullData;

const LABEL: &str = "hull_rays";

/// Of what a found surface is told, a texel a pixel: see `HullSurface` of common/hull.wgsl.
pub(crate) const SURFACE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

/// Pixels a side of what one group of threads takes.
const GROUP_PX: u32 = 8;

/// The surface nearest to the eye at every pixel, of the last size.
#[derive(Debug)]
pub(crate) struct HullSurface {
    pub texture: wgpu::Texture,
    pub view: wgpu::TextureView,
}

impl HullSurface {
    /// Hands out one of `size`, that of `kept` if it is.
    pub(crate) fn sized<'k>(kept: &'k mut Option<Self>, gpu: &Gpu, [width, height]: [u32; 2]) -> &'k Self {
        kept.take_if(|kept| (kept.texture.width(), kept.texture.height()) != (width, height));
        kept.get_or_insert_with(|| {
            let texture = gpu.texture(&TextureDescriptor {
                label: Some("hull surface"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: SURFACE_FORMAT,
                usage: wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            Self { view: texture.create_view(&wgpu::TextureViewDescriptor::default()), texture }
        })
    }

    /// Bytes that it takes.
    pub(crate) fn n_bytes(&self) -> u64 {
        u64::from(self.texture.width()) * u64::from(self.texture.height()) * 16
    }

    /// Columns and rows.
    pub(crate) fn size_px(&self) -> [u32; 2] {
        [self.texture.width(), self.texture.height()]
    }
}

/// Finds surfaces ray by ray.
#[derive(Debug)]
pub(crate) struct HullRaysPass {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl HullRaysPass {
    pub(crate) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        hulls: &HullData,
    ) -> Result<Self, GpuError> {
        let entry = wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format: SURFACE_FORMAT,
                view_dimension: wgpu::TextureViewDimension::D2,
            },
            count: None,
        };
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[entry],
        });
        let module = gpu.shader("render/hull_rays.wgsl")?;
        let groups = [Some(frame_layout), Some(&layout), Some(hulls.layout())];
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(LABEL),
            bind_group_layouts: &groups,
            immediate_size: 0,
        });
        let pipeline = gpu.compute_pipeline(
            LABEL,
            &wgpu::ComputePipelineDescriptor {
                label: Some(LABEL),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some("cs_main"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &hulls.variant(),
                    ..wgpu::PipelineCompilationOptions::default()
                },
                cache: None,
            },
        );
        Ok(Self { layout, pipeline })
    }

    /// Records that `surface` gets what every pixel's ray meets first.
    pub(crate) fn record(
        &self,
        recording: &mut Recording<'_>,
        frame: &wgpu::BindGroup,
        hulls: &wgpu::BindGroup,
        surface: &HullSurface,
    ) {
        let gpu = recording.gpu;
        let output = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(&surface.view),
            }],
        });
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.compute_writes(span);
        let mut pass = gpu.begin_compute_pass(recording.encoder, LABEL, writes);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, &output, &[]);
        pass.set_bind_group(2, hulls, &[]);
        let [width, height] = surface.size_px();
        pass.dispatch_workgroups(width.div_ceil(GROUP_PX), height.div_ceil(GROUP_PX), 1);
    }
}
