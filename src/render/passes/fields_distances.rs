//! Distances along meshes from the nearest of many vertices, on the device: rounds of two windows a half-edge.
//!
//! For meshes that change from picture to picture: nothing of them is made ready here but positions and triangles.
//! [`videofields_vision::fields::bounded`] is the specification, [`videofields_vision::fields::exact`] the truth.

use super::Recording;
use super::compute::{Access, DeviceBuffer, bind, dispatch, layout, pipelines};
use super::fields_topology::{HangsTogether, OnDevice};
use crate::gpu::{Gpu, GpuError};

const LABEL: &str = "fields_distances";

/// Bytes of what is kept of a half-edge.
const KEPT_BYTES: u64 = 48;

/// Finds distances along meshes; buffers are kept from mesh to mesh.
#[derive(Debug)]
pub(crate) struct FieldsDistancesPass {
    layout: wgpu::BindGroupLayout,
    gather: wgpu::ComputePipeline,
    reach: wgpu::ComputePipeline,
    kept: [DeviceBuffer; 2],
    distances: [DeviceBuffer; 2],
}

impl FieldsDistancesPass {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let reads = [Access::Read; 5];
        let all = [&reads[..], &[Access::Write, Access::Read, Access::Write]].concat();
        let layout = layout(gpu, LABEL, &all);
        let [gather, reach] = pipelines(gpu, LABEL, &layout, ["cs_gather", "cs_reach"])?;
        Ok(Self {
            layout,
            gather,
            reach,
            kept: [0, 1].map(|_| DeviceBuffer::new("fields windows")),
            distances: [0, 1].map(|_| DeviceBuffer::new("fields distances")),
        })
    }

    /// Records so many rounds for every list of `begins`, which holds 0 for sources and infinity for other vertices, list after list; what
    /// is found is written into `found` in the same order.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        (mesh, hangs_together): (&OnDevice, &HangsTogether),
        (begins, found): (&wgpu::Buffer, &wgpu::Buffer),
        (n_lists, rounds): (usize, u32),
    ) {
        let gpu = recording.gpu;
        let bytes = 4 * u64::from(mesh.of.n_vertices());
        let n_kept = KEPT_BYTES * u64::from(mesh.of.n_half_edges());
        let [first, second] = &mut self.kept;
        let kept = [first.sized(gpu, n_kept), second.sized(gpu, n_kept)];
        let [first, second] = &mut self.distances;
        let distances = [first.sized(gpu, bytes), second.sized(gpu, bytes)];
        // By which of both buffers is read: gathering writes the other windows, reaching reads these.
        let group = |windows: [usize; 2], from: usize| {
            let [before, after] = windows.map(|which| &kept[which]);
            let (nearer, next) = (&distances[from], &distances[1 - from]);
            let HangsTogether { opposite, turns } = hangs_together;
            let OnDevice { size, positions, corners, .. } = mesh;
            let all = [size, positions, corners, opposite, turns, before, after, nearer, next];
            bind(gpu, (LABEL, &self.layout), &all)
        };
        let gathering = [group([0, 1], 0), group([1, 0], 1)];
        let reaching = [group([1, 0], 0), group([0, 1], 1)];
        let threads = mesh.of.n_half_edges().max(mesh.of.n_vertices());
        for list in 0..n_lists as u64 {
            recording.encoder.clear_buffer(&kept[0], 0, None);
            recording.encoder.copy_buffer_to_buffer(begins, list * bytes, &distances[0], 0, bytes);
            let span = recording.timer.span(LABEL);
            let writes = recording.timer.compute_writes(span);
            let mut pass = gpu.begin_compute_pass(recording.encoder, LABEL, writes);
            for round in 0..rounds as usize {
                for (pipeline, groups) in [(&self.gather, &gathering), (&self.reach, &reaching)] {
                    pass.set_pipeline(pipeline);
                    pass.set_bind_group(0, &groups[round % 2], &[]);
                    dispatch(&mut pass, threads);
                }
            }
            drop(pass);
            let last = &distances[rounds as usize % 2];
            recording.encoder.copy_buffer_to_buffer(last, 0, found, list * bytes, bytes);
        }
    }
}
