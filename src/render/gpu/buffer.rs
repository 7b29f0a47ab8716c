//! A buffer that is written anew every frame and grows when it must.

use super::Gpu;
use super::tally::Counted;

/// A buffer on the device that holds what was last written to it.
#[derive(Debug)]
pub struct GrowingBuffer {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
}

/// Smallest allocation, bytes: also the least a bound buffer may have, so that an empty one can be bound.
const LEAST_BYTES: u64 = 1024;

impl GrowingBuffer {
    /// An empty buffer for `usage` (writing is added).
    #[must_use]
    pub const fn new(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self { label, usage: usage.union(wgpu::BufferUsages::COPY_DST), buffer: None }
    }

    /// Writes `data` to the start and hands out the buffer; what follows in it is undefined. Allocates only when
    /// `data` is larger than ever before.
    pub fn write<T: bytemuck::NoUninit>(&mut self, gpu: &Gpu, data: &[T]) -> &wgpu::Buffer {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let needed = bytes.len() as u64;
        if self.buffer.as_ref().is_some_and(|buffer| buffer.size() < needed) {
            self.buffer = None;
        }
        let buffer = self.buffer.get_or_insert_with(|| {
            let size = needed.next_power_of_two().max(LEAST_BYTES);
            gpu.tally.add(Counted::Buffer, self.label, size);
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(self.label),
                size,
                usage: self.usage,
                mapped_at_creation: false,
            })
        });
        if !bytes.is_empty() {
            gpu.queue.write_buffer(buffer, 0, bytes);
        }
        buffer
    }

    /// The buffer as last written, if it ever was.
    #[must_use]
    pub const fn get(&self) -> Option<&wgpu::Buffer> {
        self.buffer.as_ref()
    }
}
