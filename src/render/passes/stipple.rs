//! A finished picture as dots on paper.

use super::resample::{self, Kept, uniform_entry, view};
use super::{Recording, UNFILTERED, picture_pass, texture_entry};
use crate::gpu::{Gpu, GpuError, GrowingBuffer, mirror};
use crate::targets::COLOR_FORMAT;
use videofields_vision::effects;

mirror! { "render/stipple.wgsl",
/// How dots are set. The shader documents the fields.
pub(super) struct Stipple {
    anchor: [i32; 2],
    dot_px: i32,
    blur_px: f32,
    contrast: f32,
    shade: f32,
    pad: [u32; 2],
}}

const LABEL: &str = "stipple";

/// Dots pictures.
#[derive(Debug)]
pub(crate) struct StipplePass {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::RenderPipeline,
    data: GrowingBuffer,
    kept: Kept,
}

impl StipplePass {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[texture_entry(0, wgpu::TextureViewDimension::D2, UNFILTERED), uniform_entry(1)],
        });
        let pipeline = resample::pipeline(gpu, LABEL, &layout, &[])?;
        let data = GrowingBuffer::new(LABEL, wgpu::BufferUsages::UNIFORM);
        Ok(Self { layout, pipeline, data, kept: Kept::default() })
    }

    /// Records `picture` as dots, its upper left pixel called `anchor`, and hands that out.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        picture: &wgpu::Texture,
        (settings, anchor): (&effects::Stipple, [i32; 2]),
    ) -> Result<&wgpu::Texture, GpuError> {
        let gpu = recording.gpu;
        let data = Stipple {
            anchor,
            dot_px: settings.dot_px.max(1) as i32,
            blur_px: settings.blur_px as f32,
            contrast: settings.contrast,
            shade: settings.shade,
            pad: [0; 2],
        };
        let data = self.data.write(gpu, &[data]);
        let source = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&view(picture)),
                },
                wgpu::BindGroupEntry { binding: 1, resource: data.as_entire_binding() },
            ],
        });
        let dotted = self.kept.of(gpu, LABEL, COLOR_FORMAT, (picture.width(), picture.height()));
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.writes(span, 0, 1);
        let mut pass = picture_pass(gpu, recording.encoder, LABEL, (&view(dotted), writes));
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &source, &[]);
        pass.draw(0..3, 0..1);
        Ok(dotted)
    }

    /// Lets go of a picture of more than `max_bytes`.
    pub(crate) fn trim(&mut self, max_bytes: u64) {
        self.kept.trim(max_bytes);
    }
}
