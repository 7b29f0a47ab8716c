//! From a texture on the device to bytes here.

use super::tally::Counted;
use super::{Gpu, GpuError};

/// Rows in a buffer that textures are copied to start at multiples of this.
const ROW_ALIGNMENT: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;
const BYTES_PER_PIXEL: u32 = 4;

/// A mappable buffer that is kept between pictures of one size.
#[derive(Debug, Default)]
pub struct Readback {
    buffer: Option<wgpu::Buffer>,
    width: u32,
    height: u32,
}

const fn padded_row_bytes(width: u32) -> u32 {
    (width * BYTES_PER_PIXEL).next_multiple_of(ROW_ALIGNMENT)
}

impl Readback {
    /// Records the copy of a 4-byte-a-pixel texture's first level.
    pub fn copy(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, texture: &wgpu::Texture) {
        (self.width, self.height) = (texture.width(), texture.height());
        let size = u64::from(padded_row_bytes(self.width)) * u64::from(self.height);
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
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded_row_bytes(self.width)),
                    rows_per_image: None,
                },
            },
            texture.size(),
        );
    }

    /// Lets go of a buffer larger than `max_bytes`.
    pub fn trim(&mut self, max_bytes: u64) {
        if self.buffer.as_ref().is_some_and(|buffer| buffer.size() > max_bytes) {
            self.buffer = None;
        }
    }

    /// Waits for everything submitted and writes the first three bytes of every pixel into `rgb`, rows from the top, each
    /// `row_bytes` behind the one before it.
    ///
    /// # Errors
    /// What the device reported.
    pub fn read_rgb(&self, gpu: &Gpu, rgb: &mut [u8], row_bytes: usize) -> Result<(), GpuError> {
        let buffer = self
            .buffer
            .as_ref()
            .ok_or_else(|| GpuError::Refused { message: "nothing was copied to be read back".to_owned() })?;
        let copied_bytes = (self.width * BYTES_PER_PIXEL) as usize;
        read(gpu, buffer, |bytes| {
            let copied = bytes.chunks_exact(padded_row_bytes(self.width) as usize);
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

/// Maps a buffer, waits, and lets `with` look at its bytes.
pub(super) fn read(gpu: &Gpu, buffer: &wgpu::Buffer, with: impl FnOnce(&[u8])) -> Result<(), GpuError> {
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
