//! What was made and done on a device, by label: so that what a picture leaves off can be shown to cost nothing.
//!
//! Everything goes through the few methods here; a test holds all other rooms to that.

use super::Gpu;
use std::sync::{Mutex, PoisonError};

/// What is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Counted {
    /// Pipelines that were made.
    Pipeline,
    /// Textures that were made, with the bytes of all their texels.
    Texture,
    /// Pictures that were written into textures, with their bytes as they lay in memory.
    Upload,
    /// Buffers that were made, with their bytes.
    Buffer,
    /// Passes that were recorded, with the bytes that they move between their attachments and memory at least: what is loaded, stored
    /// and resolved. What shaders read beside that is not among them.
    Pass,
}

/// How often something of one label was made or done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Count {
    /// What it is.
    pub what: Counted,
    /// Its label.
    pub label: &'static str,
    /// How often, since the device was made.
    pub n: u64,
    /// Bytes of all of them; 0 of what has none.
    pub n_bytes: u64,
}

/// The counts of one device: as many as there are labels.
#[derive(Debug, Default)]
pub(super) struct Tally(Mutex<Vec<Count>>);

impl Tally {
    pub(super) fn add(&self, what: Counted, label: &'static str, n_bytes: u64) {
        let mut counts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match counts.iter_mut().find(|count| (count.what, count.label) == (what, label)) {
            Some(count) => {
                count.n += 1;
                count.n_bytes += n_bytes;
            }
            None => counts.push(Count { what, label, n: 1, n_bytes }),
        }
    }

    fn sorted(&self) -> Vec<Count> {
        let mut counts = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        counts.sort_unstable_by_key(|count| (count.what, count.label));
        counts
    }
}

/// A texture's descriptor whose label is counted.
pub type TextureDescriptor<'a> =
    wgpu::wgt::TextureDescriptor<Option<&'static str>, &'a [wgpu::TextureFormat]>;

impl Gpu {
    /// What was made and done so far, in the order of what it is and of labels.
    #[must_use]
    pub fn counts(&self) -> Vec<Count> {
        self.tally.sorted()
    }

    /// Makes a texture.
    #[must_use]
    pub fn texture(&self, descriptor: &TextureDescriptor<'_>) -> wgpu::Texture {
        self.tally.add(Counted::Texture, descriptor.label.unwrap_or_default(), n_bytes(descriptor));
        self.device.create_texture(descriptor)
    }

    /// Makes a buffer of so many bytes, all 0.
    #[must_use]
    pub fn buffer(&self, label: &'static str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.tally.add(Counted::Buffer, label, size);
        let descriptor =
            wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.device.create_buffer(&descriptor)
    }

    /// Makes a pipeline.
    #[must_use]
    pub fn pipeline(
        &self,
        label: &'static str,
        descriptor: &wgpu::RenderPipelineDescriptor<'_>,
    ) -> wgpu::RenderPipeline {
        self.tally.add(Counted::Pipeline, label, 0);
        self.device.create_render_pipeline(descriptor)
    }

    /// Makes a pipeline that computes.
    #[must_use]
    pub fn compute_pipeline(
        &self,
        label: &'static str,
        descriptor: &wgpu::ComputePipelineDescriptor<'_>,
    ) -> wgpu::ComputePipeline {
        self.tally.add(Counted::Pipeline, label, 0);
        self.device.create_compute_pipeline(descriptor)
    }

    /// Writes texels that lie as `layout` says.
    pub fn upload(
        &self,
        label: &'static str,
        to: wgpu::TexelCopyTextureInfo<'_>,
        (texels, layout): (&[u8], wgpu::TexelCopyBufferLayout),
        size: wgpu::Extent3d,
    ) {
        self.tally.add(Counted::Upload, label, texels.len() as u64);
        self.queue.write_texture(to, texels, layout, size);
    }

    /// Begins a pass.
    #[must_use]
    pub fn begin_pass<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        label: &'static str,
        descriptor: &wgpu::RenderPassDescriptor<'_>,
    ) -> wgpu::RenderPass<'e> {
        self.tally.add(Counted::Pass, label, moved_bytes(descriptor));
        encoder.begin_render_pass(descriptor)
    }

    /// Begins a pass that computes.
    #[must_use]
    pub fn begin_compute_pass<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        label: &'static str,
        timestamp_writes: Option<wgpu::ComputePassTimestampWrites<'_>>,
    ) -> wgpu::ComputePass<'e> {
        self.tally.add(Counted::Pass, label, 0);
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes })
    }
}

/// Bytes that a pass moves between its attachments and memory at least.
fn moved_bytes(descriptor: &wgpu::RenderPassDescriptor<'_>) -> u64 {
    let once = |view: &wgpu::TextureView| {
        let texture = view.texture();
        let texel_bytes = u64::from(texture.format().block_copy_size(None).unwrap_or_default());
        let n_texels = u64::from(texture.width()) * u64::from(texture.height());
        n_texels * u64::from(texture.sample_count()) * texel_bytes
    };
    let times = |is_moved: bool| u64::from(is_moved);
    let colors = descriptor.color_attachments.iter().flatten().map(|of| {
        let moves = times(matches!(of.ops.load, wgpu::LoadOp::Load))
            + times(matches!(of.ops.store, wgpu::StoreOp::Store));
        moves * once(of.view) + of.resolve_target.map_or(0, once)
    });
    let depth = descriptor.depth_stencil_attachment.as_ref().map_or(0, |of| {
        let moves = of.depth_ops.as_ref().map_or(0, |ops| {
            times(matches!(ops.load, wgpu::LoadOp::Load)) + times(matches!(ops.store, wgpu::StoreOp::Store))
        });
        moves * once(of.view)
    });
    colors.sum::<u64>() + depth
}

/// Bytes of all texels of all levels, layers and samples.
fn n_bytes(descriptor: &TextureDescriptor<'_>) -> u64 {
    let texel_bytes = u64::from(descriptor.format.block_copy_size(None).unwrap_or_default());
    let level_texels = |level: u32| {
        let side = |full: u32| u64::from((full >> level).max(1));
        side(descriptor.size.width) * side(descriptor.size.height)
    };
    let n_texels: u64 = (0..descriptor.mip_level_count).map(level_texels).sum();
    let n_layers = u64::from(descriptor.size.depth_or_array_layers);
    n_texels * n_layers * u64::from(descriptor.sample_count) * texel_bytes
}
