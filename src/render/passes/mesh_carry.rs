//! What cameras lent to a mesh before it changed, at the vertices of the mesh that it became.
//!
//! [`videofields_vision::fields::Weights::carried`] is the specification; here the nearest vertices stand for the nearest place of the surface.

use super::Recording;
use super::changing_mesh::MadeMesh;
use super::compute::{Access, DeviceBuffer, bind, dispatch, layout, pipelines_of};
use crate::gpu::{Gpu, GpuError};

const LABEL: &str = "mesh_carry";

/// The mesh before.
pub(crate) struct Before<'a> {
    pub n_vertices: u32,
    pub homes: &'a wgpu::Buffer,
    pub weights: &'a wgpu::Buffer,
}

/// Carries weights from mesh to mesh.
#[derive(Debug)]
pub(crate) struct MeshCarryPass {
    layout: wgpu::BindGroupLayout,
    enter: wgpu::ComputePipeline,
    carry: wgpu::ComputePipeline,
    heads: DeviceBuffer,
    following: DeviceBuffer,
}

impl MeshCarryPass {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        use Access::{Read, Write};
        let layout = layout(gpu, LABEL, &[Read, Read, Read, Write, Write, Write]);
        let groups = [None, Some(&layout)];
        let [enter, carry] = pipelines_of(gpu, LABEL, (&groups, &[]), ["cs_enter", "cs_carry"])?;
        let (heads, following) = (DeviceBuffer::new("mesh cells"), DeviceBuffer::new("mesh following"));
        Ok(Self { layout, enter, carry, heads, following })
    }

    /// Slots of the table of cells, of a mesh before with so many vertices.
    pub(crate) const fn table_slots(n_vertices: u32) -> u32 {
        let wanted = if n_vertices < 64 { 64 } else { n_vertices };
        wanted.next_power_of_two()
    }

    /// Records that what `before` was lent is carried into `carried`.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        (mesh, before): (&MadeMesh, &Before<'_>),
        carried: &wgpu::Buffer,
    ) {
        let gpu = recording.gpu;
        let heads = self.heads.sized(gpu, 4 * u64::from(Self::table_slots(before.n_vertices)));
        let following = self.following.sized(gpu, 4 * u64::from(before.n_vertices));
        recording.encoder.clear_buffer(&heads, 0, None);
        let buffers =
            [&mesh.parameters, &mesh.homes, before.homes, before.weights, &heads, &following, carried];
        let group = bind(gpu, (LABEL, &self.layout), &buffers);
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.compute_writes(span);
        let mut pass = gpu.begin_compute_pass(recording.encoder, LABEL, writes);
        pass.set_bind_group(1, &group, &[]);
        for (pipeline, threads) in [(&self.enter, before.n_vertices), (&self.carry, mesh.n[0])] {
            pass.set_pipeline(pipeline);
            dispatch(&mut pass, threads);
        }
    }
}
