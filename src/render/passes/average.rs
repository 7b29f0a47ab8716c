//! Several pixels each way of a finer picture averaged into one.

use super::{Recording, UNFILTERED, picture_pass, resample, texture_entry};
use crate::gpu::{Gpu, GpuError};

const LABEL: &str = "average";

/// Averages pictures.
#[derive(Debug)]
pub(crate) struct AveragePass {
    layout: wgpu::BindGroupLayout,
    /// By how many pixels each way make one.
    pipelines: Vec<(u32, wgpu::RenderPipeline)>,
    /// The last size's picture.
    averaged: Option<wgpu::Texture>,
}

impl AveragePass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[texture_entry(0, wgpu::TextureViewDimension::D2, UNFILTERED)],
        });
        Self { layout, pipelines: Vec::new(), averaged: None }
    }

    /// Records that `times` pixels of `finer` each way make one, and hands out the picture.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        finer: &wgpu::Texture,
        times: u32,
    ) -> Result<&wgpu::Texture, GpuError> {
        let gpu = recording.gpu;
        let pipeline = self.pipeline(gpu, times)?;
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let source = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(&view(finer)),
            }],
        });
        let (width, height) = (finer.width() / times, finer.height() / times);
        self.averaged.take_if(|kept| (kept.width(), kept.height()) != (width, height));
        let averaged = self.averaged.get_or_insert_with(|| resample::picture(gpu, LABEL, width, height));
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.writes(span, 0, 1);
        let mut pass = picture_pass(gpu, recording.encoder, LABEL, (&view(averaged), writes));
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &source, &[]);
        pass.draw(0..3, 0..1);
        Ok(averaged)
    }

    /// Lets go of a picture of more than `max_bytes`.
    pub(crate) fn trim(&mut self, max_bytes: u64) {
        self.averaged.take_if(|kept| u64::from(kept.width()) * u64::from(kept.height()) * 4 > max_bytes);
    }

    fn pipeline(&mut self, gpu: &Gpu, times: u32) -> Result<wgpu::RenderPipeline, GpuError> {
        if let Some((_, known)) = self.pipelines.iter().find(|(known, _)| *known == times) {
            return Ok(known.clone());
        }
        let constants = [("TIMES", f64::from(times))];
        let pipeline = resample::pipeline(gpu, LABEL, &self.layout, &constants)?;
        self.pipelines.push((times, pipeline.clone()));
        Ok(pipeline)
    }
}
