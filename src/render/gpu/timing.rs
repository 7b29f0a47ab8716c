//! How long the device spent in every pass, where it can tell.

use super::{Gpu, GpuError, readback};
use std::time::Duration;

/// Most passes that one frame can time; further ones go untimed.
const MAX_PASSES: u32 = 64;

/// Time that the device spent in one pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PassTime {
    /// The pass.
    pub pass: &'static str,
    /// From its first command's start to its last one's end.
    pub gpu: Duration,
}

/// Measures the passes of one frame after another.
#[derive(Debug)]
pub struct Timer {
    queries: Option<Queries>,
    passes: Vec<&'static str>,
}

#[derive(Debug)]
struct Queries {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
}

/// A pass under measurement, or one that is not measured.
#[derive(Clone, Copy, Debug)]
pub struct Span(Option<u32>);

impl Timer {
    /// A timer; on a device that cannot tell times it measures nothing.
    #[must_use]
    pub fn new(gpu: &Gpu) -> Self {
        let bytes = u64::from(MAX_PASSES) * 2 * 8;
        let buffer = |label, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes,
                usage,
                mapped_at_creation: false,
            })
        };
        let queries = gpu.has_timestamps().then(|| Queries {
            set: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timing"),
                ty: wgpu::QueryType::Timestamp,
                count: MAX_PASSES * 2,
            }),
            resolved: buffer(
                "timing resolved",
                wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            ),
            readable: buffer("timing readable", wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ),
        });
        Self { queries, passes: Vec::new() }
    }

    /// Forgets the last frame.
    pub fn begin_frame(&mut self) {
        self.passes.clear();
    }

    /// Begins the measurement of a pass. Every span must be written once as first and once as last.
    pub fn span(&mut self, pass: &'static str) -> Span {
        let idx = self.passes.len() as u32;
        if self.queries.is_none() || idx >= MAX_PASSES {
            return Span(None);
        }
        self.passes.push(pass);
        Span(Some(idx))
    }

    /// What the `idx`-th of a span's `count` render passes must write: the first its start, the last its end.
    #[must_use]
    pub fn writes(
        &self,
        span: Span,
        idx: usize,
        count: usize,
    ) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        let (first, last) = (idx == 0, idx + 1 == count);
        let (queries, query) = (self.queries.as_ref()?, span.0?);
        (first || last).then_some(wgpu::RenderPassTimestampWrites {
            query_set: &queries.set,
            beginning_of_pass_write_index: first.then_some(query * 2),
            end_of_pass_write_index: last.then_some(query * 2 + 1),
        })
    }

    /// As [`Self::writes`], of a span that is one pass that computes.
    #[must_use]
    pub fn compute_writes(&self, span: Span) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let (queries, query) = (self.queries.as_ref()?, span.0?);
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &queries.set,
            beginning_of_pass_write_index: Some(query * 2),
            end_of_pass_write_index: Some(query * 2 + 1),
        })
    }

    /// Records that the times are made readable; the last command of a frame.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        let (Some(queries), false) = (&self.queries, self.passes.is_empty()) else { return };
        let count = self.passes.len() as u32 * 2;
        encoder.resolve_query_set(&queries.set, 0..count, &queries.resolved, 0);
        encoder.copy_buffer_to_buffer(&queries.resolved, 0, &queries.readable, 0, Some(u64::from(count) * 8));
    }

    /// The times of the frame, in the order in which the passes began. Waits for everything submitted.
    ///
    /// # Errors
    /// What the device reported.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<PassTime>, GpuError> {
        let (Some(queries), false) = (&self.queries, self.passes.is_empty()) else { return Ok(Vec::new()) };
        let period_nanos = f64::from(gpu.queue.get_timestamp_period());
        let mut times = Vec::with_capacity(self.passes.len());
        readback::read(gpu, &queries.readable, |bytes| {
            let (stamps, _) = bytes.as_chunks::<8>();
            let (pairs, _) = stamps.as_chunks::<2>();
            times.extend(self.passes.iter().zip(pairs).map(|(pass, [start, end])| {
                let ticks = u64::from_le_bytes(*end).saturating_sub(u64::from_le_bytes(*start));
                PassTime { pass, gpu: Duration::from_nanos((ticks as f64 * period_nanos) as u64) }
            }));
        })?;
        Ok(times)
    }
}
