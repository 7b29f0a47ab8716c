//! Entities as visual hulls: what a method found of their surfaces, textured by every camera that sees it.

use super::{BySamples, DrawInto, DrawPipeline, LiveFrames, MAIN, Mixing, Recording, draw_pipeline};
use crate::gpu::{Gpu, GpuError};
use crate::plan::HullTexture;
use crate::render::hull_data::HullData;
use crate::render::image_array::ImageArray;

const LABEL: &str = "hull";

/// Draws hulls whose surfaces are found.
#[derive(Debug)]
pub(in crate::render) struct HullPass {
    frames: LiveFrames,
    surface_layout: wgpu::BindGroupLayout,
    /// By gains, visibility and feathering.
    pipelines: [BySamples; 8],
}

impl HullPass {
    pub(in crate::render) fn new(gpu: &Gpu) -> Self {
        let entry = wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Uint,
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            },
            count: None,
        };
        let surface_layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[entry],
        });
        Self { frames: LiveFrames::new(gpu, LABEL), surface_layout, pipelines: Default::default() }
    }

    /// Records hulls where `surface` has them, within `shown` (left, top, right, bottom).
    pub(in crate::render) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        (hulls, group): (&HullData, &wgpu::BindGroup),
        (surface, shown): (&wgpu::TextureView, [u32; 4]),
        (texture, frames): (HullTexture, &mut ImageArray),
    ) -> Result<(), GpuError> {
        let gpu = recording.gpu;
        let number = |is_so: bool| f64::from(u8::from(is_so));
        let wanted = DrawPipeline {
            label: LABEL,
            bind_groups: &[
                Some(into.frame_layout),
                Some(&self.frames.layout),
                Some(hulls.layout()),
                Some(&self.surface_layout),
            ],
            vertices: &[],
            entry_points: MAIN,
            topology: wgpu::PrimitiveTopology::TriangleList,
            mixing: Mixing {
                blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                writes_depth: true,
                culls_back: false,
                writes_color: true,
            },
            variant: &[
                ("HAS_GAINS", number(into.has_gains)),
                ("HAS_VISIBILITY", number(texture.visibility)),
                ("HAS_FEATHER", number(texture.feather)),
            ],
            samples: into.targets.samples(),
        };
        let variant = [into.has_gains, texture.visibility, texture.feather];
        let variant = variant.into_iter().fold(0, |idx, is_so| 2 * idx + usize::from(is_so));
        let pipeline =
            self.pipelines[variant].get(into.targets.samples(), || draw_pipeline(gpu, wanted))?.clone();
        let textures = self.frames.bind(gpu, frames);
        let surface = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.surface_layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(surface),
            }],
        });
        let mut pass = recording.draw(LABEL, into);
        let [left, top, right, bottom] = shown;
        pass.set_scissor_rect(left, top, right - left, bottom - top);
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(1, &textures, &[]);
        pass.set_bind_group(2, group, &[]);
        pass.set_bind_group(3, &surface, &[]);
        pass.draw(0..3, 0..1);
        Ok(())
    }
}
