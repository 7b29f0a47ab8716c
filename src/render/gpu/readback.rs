//! From a texture on the device to bytes here.

use super::tally::Counted;
use super::{Gpu, GpuError};

/// Rows in a buffer that textures are copied to start at multiples of this.
const ROW_ALIGNMENT: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;

/// A mappable buffer that is kept between pictures of one size.
#[derive(Debug, Default)]
pub struct Readback {
    buffer: Option<wgpu::Buffer>,
    width: u32,
    height: u32,
    pixel_bytes: u32,
}

impl Readback {
    const fn padded_row_bytes(&self) -> u32 {
        (self.width * self.pixel_bytes).next_multiple_of(ROW_ALIGNMENT)
    }

    /// Records the copy of a texture's first level, of a format of so many bytes a pixel.
    pub fn copy(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, texture: &wgpu::Texture) {
        self.copy_within(gpu, encoder, texture, 0);
    }

    /// As [`Self::copy`], without so many pixels on every side; at least one column and row is left.
    pub fn copy_within(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        texture: &wgpu::Texture,
        margin_px: u32,
    ) {
        let within = |side: u32| side.saturating_sub(2 * margin_px).max(1);
        (self.width, self.height) = (within(texture.width()), within(texture.height()));
        self.pixel_bytes = texture.format().block_copy_size(None).unwrap_or(4);
        let row_bytes = self.padded_row_bytes();
        let size = u64::from(row_bytes) * u64::from(self.height);
        if self.buffer.as_ref().is_some_and(|buffer| buffer.size() != size) {
            self.buffer = None;
        }
        let buffer = self.buffer.get_or_insert_with(|| {
            gpu.tally.add(Counted::Buffer, "readback", size);
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("readback"),
                size,
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            })
        });
        let origin = wgpu::Origin3d { x: margin_px, y: margin_px, z: 0 };
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() },
            wgpu::TexelCopyBufferInfo {
                buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row_bytes),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width: self.width, height: self.height, depth_or_array_layers: 1 },
        );
    }

    /// Lets go of a buffer larger than `max_bytes`.
    pub fn trim(&mut self, max_bytes: u64) {
        if self.buffer.as_ref().is_some_and(|buffer| buffer.size() > max_bytes) {
            self.buffer = None;
        }
    }

    /// Waits for everything submitted and writes the first three bytes of every pixel of four into `rgb`, rows from the top, each
    /// `row_bytes` behind the one before it.
    ///
    /// # Errors
    /// What the device reported.
    pub fn read_rgb(&self, gpu: &Gpu, rgb: &mut [u8], row_bytes: usize) -> Result<(), GpuError> {
        let buffer = self
            .buffer
            .as_ref()
            .ok_or_else(|| GpuError::Refused { message: "nothing was copied to be read back".to_owned() })?;
        let copied_bytes = (self.width * self.pixel_bytes) as usize;
        read(gpu, buffer, |bytes| {
            let copied = bytes.chunks_exact(self.padded_row_bytes() as usize);
            for (from, to) in copied.zip(rgb.chunks_mut(row_bytes)) {
                let (from, _) = from[..copied_bytes].as_chunks::<4>();
                let (to, _) = to.as_chunks_mut::<3>();
                for (to, [r, g, b, _]) in to.iter_mut().zip(from) {
                    *to = [*r, *g, *b];
                }
            }
        })
    }
}

impl Readback {
    /// Waits for everything submitted and appends every pixel, of as many bytes as a `T`, to `texels`, row by row from the top.
    ///
    /// # Errors
    /// What the device reported, or where nothing of that kind was copied.
    pub fn read_texels<T: bytemuck::AnyBitPattern>(
        &self,
        gpu: &Gpu,
        texels: &mut Vec<T>,
    ) -> Result<(), GpuError> {
        let is_kind = |_: &&wgpu::Buffer| self.pixel_bytes as usize == size_of::<T>();
        let Some(buffer) = self.buffer.as_ref().filter(is_kind) else {
            return Err(GpuError::Refused { message: "nothing was copied to be read back".to_owned() });
        };
        read(gpu, buffer, |bytes| {
            let row_bytes = (self.width * self.pixel_bytes) as usize;
            for row in bytes.chunks_exact(self.padded_row_bytes() as usize) {
                let pixels = row[..row_bytes].chunks_exact(size_of::<T>());
                texels.extend(pixels.map(bytemuck::pod_read_unaligned::<T>));
            }
        })
    }
}

/// Maps a buffer, waits, and lets `with` look at its bytes.
pub(crate) fn read(gpu: &Gpu, buffer: &wgpu::Buffer, with: impl FnOnce(&[u8])) -> Result<(), GpuError> {
    // The outcome of mapping shows when the range is asked for; a failure also reaches the device's fault slot.
    buffer.map_async(wgpu::MapMode::Read, .., |_mapped: Result<(), wgpu::BufferAsyncError>| {});
    let outcome = gpu.finish().and_then(|()| {
        let range = buffer
            .get_mapped_range(..)
            .map_err(|error| GpuError::Refused { message: format!("reading back: {error}") })?;
        with(&range);
        Ok(())
    });
    buffer.unmap();
    outcome
}
