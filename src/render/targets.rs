//! What a frame is drawn on, kept between frames of one size.

use crate::gpu::{Gpu, TextureDescriptor};

/// Colour of every target: 8-bit sRGB, blended in linear light by the hardware.
pub(super) const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// Depth of every target: reversed, 0 at infinity.
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Most bytes that are kept between frames, all sizes together: a wall's tiles of one size, not every size that was
/// ever asked for.
const MAX_KEPT_BYTES: u64 = 256 << 20;

/// Colour and depth of one size.
#[derive(Debug)]
pub(super) struct Targets {
    /// The finished picture.
    pub color: wgpu::Texture,
    color_view: wgpu::TextureView,
    /// With several samples a pixel, what is drawn on before it is resolved.
    samples_view: Option<wgpu::TextureView>,
    depth_view: wgpu::TextureView,
    key: TargetKey,
}

/// What targets are made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TargetKey {
    pub width_px: u32,
    pub height_px: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Whether a later pass reads the colour.
    pub is_read: bool,
    /// Whether a later pass reads the depth.
    pub keeps_depth: bool,
}

impl TargetKey {
    /// Bytes a pixel of all targets together.
    pub(super) fn pixel_bytes(samples: u32) -> u64 {
        // Resolved colour, and where there are several samples their colours; a depth for each: 4 bytes each.
        4 + if samples > 1 { 8 * u64::from(samples) } else { 4 }
    }

    fn n_bytes(&self) -> u64 {
        u64::from(self.width_px) * u64::from(self.height_px) * Self::pixel_bytes(self.samples)
    }
}

/// A pass's place among those that draw one frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Colour to clear with; given to the first pass only.
    pub clear: Option<wgpu::Color>,
    /// Whether nothing is drawn after this pass.
    pub is_last: bool,
}

/// The sizes used last, the latest first.
#[derive(Debug, Default)]
pub(super) struct TargetCache {
    sizes: Vec<Targets>,
}

impl TargetCache {
    pub(super) fn get(&mut self, gpu: &Gpu, key: TargetKey) -> &Targets {
        let targets = match self.sizes.iter().position(|targets| targets.key == key) {
            Some(idx) => self.sizes.remove(idx),
            None => {
                // Before there is more, so that the sizes of one picture's pieces do not add up.
                self.keep(MAX_KEPT_BYTES.saturating_sub(key.n_bytes()));
                Targets::new(gpu, key)
            }
        };
        self.sizes.insert(0, targets);
        &self.sizes[0]
    }

    /// Lets go of what is kept beyond the bound, those used longest ago first; the latest too if it alone exceeds it.
    pub(super) fn trim(&mut self) {
        self.keep(MAX_KEPT_BYTES);
    }

    fn keep(&mut self, max_bytes: u64) {
        let mut n_bytes = 0;
        self.sizes.retain(|targets| {
            n_bytes += targets.key.n_bytes();
            n_bytes <= max_bytes
        });
    }

    pub(super) fn clear(&mut self) {
        self.sizes.clear();
    }
}

impl Targets {
    fn new(gpu: &Gpu, key: TargetKey) -> Self {
        let TargetKey { width_px: width, height_px: height, samples, is_read, keeps_depth } = key;
        let texture = |label, format, sample_count, usage| {
            gpu.texture(&TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            })
        };
        let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let taken =
            if is_read { wgpu::TextureUsages::TEXTURE_BINDING } else { wgpu::TextureUsages::COPY_SRC };
        let color = texture("color", COLOR_FORMAT, 1, attachment | taken);
        let samples_view =
            (samples > 1).then(|| view(&texture("color samples", COLOR_FORMAT, samples, attachment)));
        let looked_at =
            if keeps_depth { wgpu::TextureUsages::TEXTURE_BINDING } else { wgpu::TextureUsages::empty() };
        let depth_view = view(&texture("depth", DEPTH_FORMAT, samples, attachment | looked_at));
        Self { color_view: view(&color), color, samples_view, depth_view, key }
    }

    /// Samples a pixel.
    pub(super) const fn samples(&self) -> u32 {
        self.key.samples
    }

    /// Whether depths outlast the last pass that draws.
    pub(super) const fn keeps_depth(&self) -> bool {
        self.key.keeps_depth
    }

    /// The depths, where they are kept.
    pub(super) const fn depth_view(&self) -> &wgpu::TextureView {
        &self.depth_view
    }

    /// Where a pass draws: the first clears, the last resolves.
    pub(super) fn color_attachment(&self, place: Place) -> wgpu::RenderPassColorAttachment<'_> {
        let load = place.clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear);
        let (view, resolve_target) = match &self.samples_view {
            Some(samples) => (samples, place.is_last.then_some(&self.color_view)),
            None => (&self.color_view, None),
        };
        let store = if resolve_target.is_some() { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store };
        wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target,
            ops: wgpu::Operations { load, store },
        }
    }

    /// The depth that a pass tests against: the first clears it to infinity, the last lets it go unless it is kept.
    pub(super) fn depth_attachment(&self, place: Place) -> wgpu::RenderPassDepthStencilAttachment<'_> {
        let load = if place.clear.is_some() { wgpu::LoadOp::Clear(0.0) } else { wgpu::LoadOp::Load };
        let is_done = place.is_last && !self.key.keeps_depth;
        let store = if is_done { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store };
        wgpu::RenderPassDepthStencilAttachment {
            view: &self.depth_view,
            depth_ops: Some(wgpu::Operations { load, store }),
            stencil_ops: None,
        }
    }
}
