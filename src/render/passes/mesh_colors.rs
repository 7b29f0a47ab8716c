//! What the vertices of a changing mesh look like from everywhere, filled from beside where no camera sees them.
//!
//! [`videofields_vision::fields::Field::colors`] is the specification.

use super::changing_mesh::MadeMesh;
use super::compute::{Access, bind_beside, dispatch, layout, pipelines_of};
use super::{Recording, linear_sampler};
use crate::gpu::{Gpu, GpuError};

const LABEL: &str = "mesh_colors";

/// Rounds in which colours spread into what nobody sees, an edge each; an even number, so that what is filled lies where it began.
const FILL_ROUNDS: usize = 16;

/// Finds colours of vertices.
#[derive(Debug)]
pub(crate) struct MeshColorsPass {
    layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
    colors: wgpu::ComputePipeline,
    fill: wgpu::ComputePipeline,
}

impl MeshColorsPass {
    pub(crate) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        variant: &[(&str, f64)],
    ) -> Result<Self, GpuError> {
        use Access::{Colors, Read, Sampler, Write};
        let layout = layout(gpu, LABEL, &[Read, Read, Read, Read, Read, Write, Colors, Sampler]);
        let groups = [Some(frame_layout), Some(&layout)];
        let [colors, fill] = pipelines_of(gpu, LABEL, (&groups, variant), ["cs_colors", "cs_fill"])?;
        Ok(Self { layout, sampler: linear_sampler(gpu, LABEL), colors, fill })
    }

    /// Records the first of the mesh's colours, by its weights by normals in the values that are smooth (the first or second); where nobody
    /// sees a vertex it has the mesh's own, if `own` are any.
    pub(crate) fn record(
        &self,
        recording: &mut Recording<'_>,
        frame: &wgpu::BindGroup,
        (mesh, values): (&MadeMesh, usize),
        (frames, own): (&wgpu::TextureView, Option<&wgpu::Buffer>),
    ) {
        let gpu = recording.gpu;
        match own {
            Some(own) => {
                let n_bytes = 16 * u64::from(mesh.n[0]);
                recording.encoder.copy_buffer_to_buffer(own, 0, &mesh.colors[1], 0, n_bytes);
            }
            None => recording.encoder.clear_buffer(&mesh.colors[1], 0, None),
        }
        let group = |before: usize| {
            let buffers = [
                &mesh.parameters,
                &mesh.on_device.positions,
                &mesh.shifts,
                &mesh.values[values],
                &mesh.neighbours,
                &mesh.colors[before],
                &mesh.colors[1 - before],
            ];
            let beside =
                [wgpu::BindingResource::TextureView(frames), wgpu::BindingResource::Sampler(&self.sampler)];
            bind_beside(gpu, (LABEL, &self.layout), (&buffers, &beside))
        };
        let groups = [group(0), group(1)];
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.compute_writes(span);
        let mut pass = gpu.begin_compute_pass(recording.encoder, LABEL, writes);
        pass.set_bind_group(0, frame, &[]);
        // What is found goes where the first round of filling reads it.
        pass.set_bind_group(1, &groups[1], &[]);
        pass.set_pipeline(&self.colors);
        dispatch(&mut pass, mesh.n[0]);
        pass.set_pipeline(&self.fill);
        for round in 0..FILL_ROUNDS {
            pass.set_bind_group(1, &groups[round % 2], &[]);
            dispatch(&mut pass, mesh.n[0]);
        }
    }
}
