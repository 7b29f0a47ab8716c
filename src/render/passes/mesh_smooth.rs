//! What weights of a changing mesh are made of, without steps from vertex to vertex.
//!
//! [`videofields_vision::fields::FieldSettings::smoothing_rounds`] says what it is for; src/vision/fields/{field,smoothing}.rs are the specification.

use super::Recording;
use super::changing_mesh::MadeMesh;
use super::compute::{Access, bind, dispatch, layout, pipelines_of};
use super::fields_topology::{HangsTogether, OnDevice};
use crate::gpu::{Gpu, GpuError};

const LABEL: &str = "mesh_smooth";

/// Makes values smooth.
#[derive(Debug)]
pub(crate) struct MeshSmoothPass {
    layout: wgpu::BindGroupLayout,
    neighbours: wgpu::ComputePipeline,
    order: wgpu::ComputePipeline,
    lent: wgpu::ComputePipeline,
    smooth: wgpu::ComputePipeline,
}

impl MeshSmoothPass {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        use Access::{Read, Write};
        let layout = layout(gpu, LABEL, &[Read, Read, Read, Write, Read, Read, Read, Write]);
        let groups = [None, Some(&layout)];
        let entry_points = ["cs_neighbours", "cs_order", "cs_lent", "cs_smooth"];
        let [neighbours, order, lent, smooth] = pipelines_of(gpu, LABEL, (&groups, &[]), entry_points)?;
        Ok(Self { layout, neighbours, order, lent, smooth })
    }

    /// Records so many rounds, after what is lent follows from sights and the `distances` that are told (the first or second); answers
    /// which of the mesh's values are smooth then.
    pub(crate) fn record(
        &self,
        recording: &mut Recording<'_>,
        (mesh, hangs_together): (&MadeMesh, &HangsTogether),
        (distances, rounds): (usize, u32),
    ) -> usize {
        let gpu = recording.gpu;
        recording.encoder.clear_buffer(&mesh.neighbours, 0, None);
        let OnDevice { positions, corners, .. } = &mesh.on_device;
        let group = |before: usize| {
            let buffers = [
                &mesh.parameters,
                positions,
                corners,
                &hangs_together.opposite,
                &mesh.neighbours,
                &mesh.sights,
                &mesh.distances[distances],
                &mesh.values[before],
                &mesh.values[1 - before],
            ];
            bind(gpu, (LABEL, &self.layout), &buffers)
        };
        let groups = [group(0), group(1)];
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.compute_writes(span);
        let mut pass = gpu.begin_compute_pass(recording.encoder, LABEL, writes);
        pass.set_bind_group(1, &groups[0], &[]);
        let [n_vertices, n_faces, _] = mesh.n;
        let steps = [(&self.neighbours, 3 * n_faces), (&self.order, n_vertices), (&self.lent, n_vertices)];
        for (pipeline, threads) in steps {
            pass.set_pipeline(pipeline);
            dispatch(&mut pass, threads);
        }
        pass.set_pipeline(&self.smooth);
        for round in 1..=rounds as usize {
            pass.set_bind_group(1, &groups[round % 2], &[]);
            dispatch(&mut pass, mesh.n_entries()[0]);
        }
        (rounds as usize + 1) % 2
    }
}
