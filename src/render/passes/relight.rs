//! Another light on what was drawn.

use super::resample::{self, Kept, uniform_entry, view};
use super::{Recording, UNFILTERED, picture_pass, texture_entry};
use crate::gpu::{Gpu, GpuError, GrowingBuffer, mirror};
use crate::targets::COLOR_FORMAT;
use glam::Vec3;
use videofields_picture::plan::PlannedLight;

mirror! { "render/relight.wgsl",
/// The light, and how the view lies in it. The shader documents the fields.
pub(super) struct Light {
    harmonics: [[f32; 4]; 9],
    right: [f32; 3],
    strength: f32,
    down: [f32; 3],
    pad_down: u32,
    forward: [f32; 3],
    pad_forward: u32,
}}

const LABEL: &str = "relight";

/// What was drawn, with its distances, as effects look at it.
#[derive(Clone, Copy)]
pub(crate) struct Drawn<'a> {
    pub colors: &'a wgpu::Texture,
    pub distances: &'a wgpu::Texture,
    pub lens: &'a wgpu::Buffer,
}

/// Lights pictures.
#[derive(Debug)]
pub(crate) struct RelightPass {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::RenderPipeline,
    data: GrowingBuffer,
    kept: Kept,
}

impl RelightPass {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let flat = |binding| texture_entry(binding, wgpu::TextureViewDimension::D2, UNFILTERED);
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[uniform_entry(0), flat(1), flat(2), uniform_entry(3)],
        });
        let pipeline = resample::pipeline(gpu, LABEL, &layout, &[])?;
        let data = GrowingBuffer::new(LABEL, wgpu::BufferUsages::UNIFORM);
        Ok(Self { layout, pipeline, data, kept: Kept::default() })
    }

    /// Records that what was drawn is seen in that light, `axes` the view's right, down and forward in the world, and hands out
    /// the picture.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        drawn: &Drawn<'_>,
        (planned, axes): (&PlannedLight, [Vec3; 3]),
    ) -> Result<&wgpu::Texture, GpuError> {
        let gpu = recording.gpu;
        let [right, down, forward] = axes.map(|axis| axis.to_array());
        let light = Light {
            harmonics: planned.light.0.map(|of| of.extend(0.0).to_array()),
            right,
            strength: planned.strength,
            down,
            pad_down: 0,
            forward,
            pad_forward: 0,
        };
        let light = self.data.write(gpu, &[light]);
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let source = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.layout,
            entries: &[
                entry(0, drawn.lens.as_entire_binding()),
                entry(1, wgpu::BindingResource::TextureView(&view(drawn.distances))),
                entry(2, wgpu::BindingResource::TextureView(&view(drawn.colors))),
                entry(3, light.as_entire_binding()),
            ],
        });
        let size_px = (drawn.colors.width(), drawn.colors.height());
        let relit = self.kept.of(gpu, LABEL, COLOR_FORMAT, size_px);
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.writes(span, 0, 1);
        let mut pass = picture_pass(gpu, recording.encoder, LABEL, (&view(relit), writes));
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &source, &[]);
        pass.draw(0..3, 0..1);
        Ok(relit)
    }

    /// Lets go of a picture of more than `max_bytes`.
    pub(crate) fn trim(&mut self, max_bytes: u64) {
        self.kept.trim(max_bytes);
    }
}
