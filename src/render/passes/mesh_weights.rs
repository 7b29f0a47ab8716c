//! What every camera lends to the vertices of a changing mesh for one who looks.
//!
//! [`videofields_vision::fields::Field::target`] and [`videofields_vision::fields::Weights::follow`] are the specification.

use super::Recording;
use super::changing_mesh::MadeMesh;
use super::compute::{Access, bind, dispatch, layout, pipelines_of};
use super::fields_topology::OnDevice;
use crate::gpu::{Gpu, GpuError};

const LABEL: &str = "mesh_weights";

/// Finds weights, and the cameras that faces are drawn with.
#[derive(Debug)]
pub(crate) struct MeshWeightsPass {
    layout: wgpu::BindGroupLayout,
    weights: wgpu::ComputePipeline,
    slots: wgpu::ComputePipeline,
}

impl MeshWeightsPass {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        use Access::{Read, Write};
        let layout = layout(gpu, LABEL, &[Read, Read, Read, Read, Read, Write, Write]);
        let groups = [None, Some(&layout)];
        let [weights, slots] = pipelines_of(gpu, LABEL, (&groups, &[]), ["cs_weights", "cs_slots"])?;
        Ok(Self { layout, weights, slots })
    }

    /// Records that `weights` are `before` on their way to what they should be, by the values that are smooth (the first or second).
    pub(crate) fn record(
        &self,
        recording: &mut Recording<'_>,
        (mesh, values): (&MadeMesh, usize),
        [before, weights, slots]: [&wgpu::Buffer; 3],
    ) {
        let gpu = recording.gpu;
        let OnDevice { positions, corners, .. } = &mesh.on_device;
        let buffers = [
            &mesh.parameters,
            positions,
            corners,
            &mesh.sights,
            &mesh.values[values],
            before,
            weights,
            slots,
        ];
        let group = bind(gpu, (LABEL, &self.layout), &buffers);
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.compute_writes(span);
        let mut pass = gpu.begin_compute_pass(recording.encoder, LABEL, writes);
        pass.set_bind_group(1, &group, &[]);
        for (pipeline, threads) in [(&self.weights, mesh.n[0]), (&self.slots, mesh.n[1])] {
            pass.set_pipeline(pipeline);
            dispatch(&mut pass, threads);
        }
    }
}
