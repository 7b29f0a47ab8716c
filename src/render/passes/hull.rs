//! Entities as visual hulls: what a method found of their surfaces, textured by every camera that sees it.

use super::hull_trim::depth_texture;
use super::{DrawInto, DrawPipeline, LiveFrames, MAIN, Mixing, Recording, draw_pipeline, texture_entry};
use crate::gpu::{Gpu, GpuError};
use crate::hull_data::HullData;
use crate::image_array::ImageArray;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use videofields_picture::plan::{HullTexture, HullVisibility, HullWeights};

const LABEL: &str = "hull";

/// Draws hulls whose surfaces are found.
#[derive(Debug)]
pub(crate) struct HullPass {
    frames: LiveFrames,
    surface_layout: wgpu::BindGroupLayout,
    /// In place of depth maps that nobody asks.
    no_depths: wgpu::TextureView,
    /// By texture, gains, lenses and samples.
    pipelines: BTreeMap<(HullTexture, [bool; 2], u32), wgpu::RenderPipeline>,
}

/// What a hull's surface is shown by.
pub(crate) struct HullSeen<'a> {
    pub surface: &'a wgpu::TextureView,
    /// What every camera sees of the hulls, where that is asked.
    pub depths: Option<&'a wgpu::TextureView>,
    /// Left, top, right, bottom of what may show any, pixels.
    pub rect: [u32; 4],
}

impl HullPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let flat = |binding, kind| texture_entry(binding, wgpu::TextureViewDimension::D2, kind);
        let surface_layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[flat(0, wgpu::TextureSampleType::Uint), flat(1, wgpu::TextureSampleType::Depth)],
        });
        let no_depths = depth_texture(gpu, [1, 1]).create_view(&wgpu::TextureViewDescriptor::default());
        Self { frames: LiveFrames::new(gpu, LABEL), surface_layout, no_depths, pipelines: BTreeMap::new() }
    }

    /// Records hulls where their surface was found.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        (hulls, group): (&HullData, &wgpu::BindGroup),
        seen: &HullSeen<'_>,
        (texture, frames): (HullTexture, &mut ImageArray),
    ) -> Result<(), GpuError> {
        let gpu = recording.gpu;
        let number = |is_so: bool| f64::from(u8::from(is_so));
        let visibility = match texture.visibility {
            HullVisibility::Off => 0.0,
            HullVisibility::Depths => 1.0,
            HullVisibility::Rays => 2.0,
        };
        let at_corners = texture.weights == HullWeights::Corners;
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
                hulls.variant()[0],
                ("VISIBILITY", visibility),
                ("HAS_FEATHER", number(texture.feather)),
                ("AT_CORNERS", number(at_corners)),
            ],
            samples: into.targets.samples(),
        };
        let kind = (texture, [into.has_gains, hulls.has_lenses()], into.targets.samples());
        let pipeline = match self.pipelines.entry(kind) {
            Entry::Occupied(kept) => kept.into_mut(),
            Entry::Vacant(new) => new.insert(draw_pipeline(gpu, wanted)?),
        };
        let textures = self.frames.bind(gpu, frames);
        let of = |binding, view| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        };
        let surface = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.surface_layout,
            entries: &[of(0, seen.surface), of(1, seen.depths.unwrap_or(&self.no_depths))],
        });
        let mut pass = recording.draw(LABEL, into);
        let [left, top, right, bottom] = seen.rect;
        pass.set_scissor_rect(left, top, right - left, bottom - top);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(1, &textures, &[]);
        pass.set_bind_group(2, group, &[]);
        pass.set_bind_group(3, &surface, &[]);
        pass.draw(0..3, 0..1);
        Ok(())
    }
}
