//! A coarse picture enlarged: what was not drawn lies between what was.

use super::{FILTERED, Recording, SAMPLER_ENTRY, linear_sampler, picture_pass, resample, texture_entry};
use crate::gpu::{Gpu, GpuError};

const LABEL: &str = "enlarge";

/// Pixels of the coarse picture beside what is shown of it, on every side: what lies at the edge lies between pixels too, so
/// that no seam shows where two pieces meet.
pub(crate) const MARGIN_PX: u32 = 1;

/// Enlarges pictures.
#[derive(Debug)]
pub(crate) struct EnlargePass {
    layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
    /// By how many pixels each way one becomes.
    pipelines: Vec<(u32, wgpu::RenderPipeline)>,
    /// The last size's picture.
    enlarged: Option<wgpu::Texture>,
}

impl EnlargePass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[texture_entry(0, wgpu::TextureViewDimension::D2, FILTERED), SAMPLER_ENTRY],
        });
        Self { layout, sampler: linear_sampler(gpu, LABEL), pipelines: Vec::new(), enlarged: None }
    }

    /// Records that one pixel of `coarse` becomes `times` each way, and hands out the picture of `size_px`. The coarse one
    /// has [`MARGIN_PX`] on every side.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        coarse: &wgpu::Texture,
        times: u32,
        size_px: (u32, u32),
    ) -> Result<&wgpu::Texture, GpuError> {
        let gpu = recording.gpu;
        let pipeline = self.pipeline(gpu, times)?;
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let source = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&view(coarse)),
                },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&self.sampler) },
            ],
        });
        let (width, height) = size_px;
        self.enlarged.take_if(|kept| (kept.width(), kept.height()) != (width, height));
        let enlarged = self.enlarged.get_or_insert_with(|| resample::picture(gpu, LABEL, width, height));
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.writes(span, 0, 1);
        let mut pass = picture_pass(gpu, recording.encoder, LABEL, (&view(enlarged), writes));
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &source, &[]);
        pass.draw(0..3, 0..1);
        Ok(enlarged)
    }

    /// Lets go of a picture of more than `max_bytes`.
    pub(crate) fn trim(&mut self, max_bytes: u64) {
        self.enlarged.take_if(|kept| u64::from(kept.width()) * u64::from(kept.height()) * 4 > max_bytes);
    }

    fn pipeline(&mut self, gpu: &Gpu, times: u32) -> Result<wgpu::RenderPipeline, GpuError> {
        if let Some((_, known)) = self.pipelines.iter().find(|(known, _)| *known == times) {
            return Ok(known.clone());
        }
        let constants = [("TIMES", f64::from(times)), ("MARGIN_PX", f64::from(MARGIN_PX))];
        let pipeline = resample::pipeline(gpu, LABEL, &self.layout, &constants)?;
        self.pipelines.push((times, pipeline.clone()));
        Ok(pipeline)
    }
}
