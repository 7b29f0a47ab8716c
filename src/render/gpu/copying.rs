//! Measures how fast a device copies from buffer to buffer: the most that its memory can give.

use super::{Gpu, GpuError};
use std::time::Duration;
use videofields_vision::clock::Clock;

/// Time within which the clocks of a device rise that waited.
const HALF_A_SECOND: Duration = Duration::from_millis(500);

/// Copies of one submission.
const N_COPIES: u32 = 8;

impl Gpu {
    /// Copies a buffer on the device again and again, and returns the bytes a second: those that are read and those that are written.
    ///
    /// **Cost** twice 256 MiB of the device's memory, and about half a second, within which clocks rise that were low; a sixteenth of the
    /// memory, and three turns, where it draws on the processor.
    ///
    /// # Errors
    /// What the device reported.
    pub fn copied_bytes_per_second(&self, clock: &dyn Clock) -> Result<f64, GpuError> {
        let n_bytes: u64 = if self.is_software() { 1 << 24 } else { 1 << 28 };
        let n_bytes = n_bytes.min(self.limits().max_buffer_size / 2);
        let buffer = || {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("copied"),
                size: n_bytes,
                usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let buffers = [buffer(), buffer()];
        let mut best = 0.0_f64;
        let first = clock.monotonic();
        let is_over =
            |turn: u32| turn > 3 && (self.is_software() || clock.monotonic() > first + HALF_A_SECOND);
        for turn in (0..).take_while(|turn| !is_over(*turn)) {
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            for copy in 0..N_COPIES as usize {
                encoder.copy_buffer_to_buffer(
                    &buffers[copy % 2],
                    0,
                    &buffers[1 - copy % 2],
                    0,
                    Some(n_bytes),
                );
            }
            let begun = clock.monotonic();
            self.queue.submit([encoder.finish()]);
            self.finish()?;
            let secs = clock.monotonic().saturating_sub(begun).as_secs_f64();
            // The first makes the buffers' memory.
            if turn > 0 {
                best = best.max(2.0 * f64::from(N_COPIES) * n_bytes as f64 / secs.max(1e-9));
            }
        }
        Ok(best)
    }
}
