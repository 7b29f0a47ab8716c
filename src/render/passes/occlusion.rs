//! Light that is taken away where much stands around: what is open of every pixel's surroundings, then the picture by that.

use super::relight::Drawn;
use super::resample::{self, Kept, Screen, uniform_entry, view};
use super::{Recording, UNFILTERED, picture_pass, texture_entry};
use crate::gpu::{Gpu, GpuError, GrowingBuffer, mirror};
use crate::targets::COLOR_FORMAT;
use glam::Vec2;
use videofields_vision::effects;

mirror! { "render/occlusion.wgsl",
/// How surroundings are looked at. The shader documents the fields.
pub(super) struct Occlusion {
    radius_m: f32,
    strength: f32,
    most: f32,
    pad: u32,
    taps: [[f32; 4]; 6],
    rotations: [[f32; 4]; 8],
}}

impl Occlusion {
    fn new(settings: &effects::Occlusion, most: f32) -> Self {
        let (taps, rotations) = (effects::taps(), effects::rotations());
        let pair =
            |of: &[Vec2], idx: usize| [of[2 * idx].x, of[2 * idx].y, of[2 * idx + 1].x, of[2 * idx + 1].y];
        Self {
            radius_m: settings.radius_m,
            strength: settings.strength,
            most,
            pad: 0,
            taps: std::array::from_fn(|idx| pair(&taps, idx)),
            rotations: std::array::from_fn(|idx| pair(&rotations, idx)),
        }
    }
}

const LABEL: &str = "occlusion";

/// A byte a pixel: what is open of its surroundings.
const OPEN_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R8Unorm;

/// Darkens what is enclosed.
#[derive(Debug)]
pub(crate) struct OcclusionPass {
    open_layout: wgpu::BindGroupLayout,
    layout: wgpu::BindGroupLayout,
    /// What is open, and the picture.
    pipelines: [wgpu::RenderPipeline; 2],
    data: GrowingBuffer,
    open: Kept,
    kept: Kept,
}

impl OcclusionPass {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let flat = |binding| texture_entry(binding, wgpu::TextureViewDimension::D2, UNFILTERED);
        let layout_of = |entries: &[wgpu::BindGroupLayoutEntry]| {
            gpu.device
                .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(LABEL), entries })
        };
        let open_layout = layout_of(&[uniform_entry(0), flat(1), uniform_entry(3)]);
        let layout = layout_of(&[uniform_entry(0), flat(1), flat(2), uniform_entry(3), flat(4)]);
        let open = Screen {
            label: LABEL,
            entry_point: "fs_open",
            layout: &open_layout,
            constants: &[],
            format: OPEN_FORMAT,
        };
        let pipelines = [open.pipeline(gpu)?, resample::pipeline(gpu, LABEL, &layout, &[])?];
        let data = GrowingBuffer::new(LABEL, wgpu::BufferUsages::UNIFORM);
        Ok(Self { open_layout, layout, pipelines, data, open: Kept::default(), kept: Kept::default() })
    }

    /// Records that what was drawn is darker where much stands around, looking at `most` so far (a tangent, of parallel rays
    /// metres), and hands out the picture.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        drawn: &Drawn<'_>,
        (settings, most): (&effects::Occlusion, f32),
    ) -> Result<&wgpu::Texture, GpuError> {
        let gpu = recording.gpu;
        let data = self.data.write(gpu, &[Occlusion::new(settings, most)]);
        let size_px = (drawn.colors.width(), drawn.colors.height());
        let open = view(self.open.of(gpu, "occlusion open", OPEN_FORMAT, size_px));
        let (colors, distances) = (view(drawn.colors), view(drawn.distances));
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let lens = entry(0, drawn.lens.as_entire_binding());
        let places = entry(1, wgpu::BindingResource::TextureView(&distances));
        let settings = entry(3, data.as_entire_binding());
        let group = |layout, entries: &[wgpu::BindGroupEntry<'_>]| {
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(LABEL), layout, entries })
        };
        let looked_at = group(&self.open_layout, &[lens.clone(), places.clone(), settings.clone()]);
        let colors = entry(2, wgpu::BindingResource::TextureView(&colors));
        let found = entry(4, wgpu::BindingResource::TextureView(&open));
        let source = group(&self.layout, &[lens, places, colors, settings, found]);
        let darkened = self.kept.of(gpu, LABEL, COLOR_FORMAT, size_px);
        let span = recording.timer.span(LABEL);
        let steps = [(&looked_at, open.clone()), (&source, view(darkened))];
        for (idx, ((group, target), pipeline)) in steps.iter().zip(&self.pipelines).enumerate() {
            let writes = recording.timer.writes(span, idx, 2);
            let mut pass = picture_pass(gpu, recording.encoder, LABEL, (target, writes));
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, *group, &[]);
            pass.draw(0..3, 0..1);
        }
        Ok(darkened)
    }

    /// Lets go of pictures of more than `max_bytes`.
    pub(crate) fn trim(&mut self, max_bytes: u64) {
        self.open.trim(max_bytes);
        self.kept.trim(max_bytes);
    }
}
