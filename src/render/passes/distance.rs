//! How far what was drawn lies, where an effect asks: metres, one number a pixel.

use super::resample::{Kept, Screen, uniform_entry, view};
use super::{Recording, picture_pass};
use crate::gpu::{Gpu, GpuError, mirror};
use crate::targets::Targets;

mirror! { "common/distances.wgsl",
/// How pixels' places follow from depths. The shader documents the fields.
pub(crate) struct Lens {
    pub first: [f32; 2],
    pub pitch: [f32; 2],
    pub start_m: f32,
    pub is_parallel: u32,
    pub scale: f32,
    pub falling: f32,
    pub anchor: [i32; 2],
    pub pad: [u32; 2],
}}

/// Format of distances.
pub(crate) const DISTANCE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;

const LABEL: &str = "distance";

/// A program for one sample a pixel, or for several.
#[derive(Debug)]
struct Variant {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::RenderPipeline,
}

/// Turns depths into distances.
#[derive(Debug, Default)]
pub(crate) struct DistancePass {
    /// Of one sample a pixel, and of several.
    variants: [Option<Variant>; 2],
    kept: Kept,
}

impl Variant {
    fn new(gpu: &Gpu, samples: u32) -> Result<Self, GpuError> {
        let is_sampled = samples > 1;
        let depths = wgpu::BindGroupLayoutEntry {
            binding: if is_sampled { 3 } else { 2 },
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Depth,
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: is_sampled,
            },
            count: None,
        };
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[uniform_entry(0), depths],
        });
        let entry_point = if is_sampled { "fs_samples" } else { "fs_main" };
        let screen =
            Screen { label: LABEL, entry_point, layout: &layout, constants: &[], format: DISTANCE_FORMAT };
        let pipeline = screen.pipeline(gpu)?;
        Ok(Self { layout, pipeline })
    }
}

impl DistancePass {
    /// Records the distances of what was drawn on `targets`, which keep their depths, and hands them out.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        targets: &Targets,
        lens: &wgpu::Buffer,
    ) -> Result<&wgpu::Texture, GpuError> {
        let gpu = recording.gpu;
        let is_sampled = targets.samples() > 1;
        let slot = &mut self.variants[usize::from(is_sampled)];
        let Variant { layout, pipeline } = match slot {
            Some(variant) => variant,
            None => slot.insert(Variant::new(gpu, targets.samples())?),
        };
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let source = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout,
            entries: &[
                entry(0, lens.as_entire_binding()),
                entry(
                    if is_sampled { 3 } else { 2 },
                    wgpu::BindingResource::TextureView(targets.depth_view()),
                ),
            ],
        });
        let size_px = (targets.color.width(), targets.color.height());
        let distances = self.kept.of(gpu, LABEL, DISTANCE_FORMAT, size_px);
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.writes(span, 0, 1);
        let mut pass = picture_pass(gpu, recording.encoder, LABEL, (&view(distances), writes));
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &source, &[]);
        pass.draw(0..3, 0..1);
        Ok(distances)
    }

    /// Lets go of a picture of more than `max_bytes`.
    pub(crate) fn trim(&mut self, max_bytes: u64) {
        self.kept.trim(max_bytes);
    }
}
