//! Who sees the vertices of a changing mesh, and how far along the surface it is from where that ends.
//!
//! [`videofields_vision::fields::Sight`] and [`videofields_vision::fields::marching`] are the specification.

use super::Recording;
use super::changing_mesh::MadeMesh;
use super::compute::{Access, bind_beside, dispatch, layout, pipelines_of};
use super::fields_topology::OnDevice;
use crate::gpu::{Gpu, GpuError};

const LABEL: &str = "mesh_sight";

/// Rounds of one front, each of which goes a face further: what fields reach is some five edges in the mean.
const MARCH_ROUNDS: u32 = 12;

/// How far distances are found from seams.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reaching {
    /// Seams alone are told; whoever goes on from there begins at them.
    Seams,
    /// By one front.
    Front,
}

/// Finds who sees which vertices.
#[derive(Debug)]
pub(crate) struct MeshSightPass {
    layout: wgpu::BindGroupLayout,
    sight: wgpu::ComputePipeline,
    seams: wgpu::ComputePipeline,
    march: wgpu::ComputePipeline,
}

impl MeshSightPass {
    pub(crate) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        variant: &[(&str, f64)],
    ) -> Result<Self, GpuError> {
        use Access::{Colors, Depths, Read, Write};
        let layout = layout(gpu, LABEL, &[Read, Read, Read, Read, Write, Write, Write, Depths, Colors]);
        let groups = [Some(frame_layout), Some(&layout)];
        let entry_points = ["cs_sight", "cs_seams", "cs_march"];
        let [sight, seams, march] = pipelines_of(gpu, LABEL, (&groups, variant), entry_points)?;
        Ok(Self { layout, sight, seams, march })
    }

    /// Records what is told of the mesh into its sights, first values and first distances.
    pub(crate) fn record(
        &self,
        recording: &mut Recording<'_>,
        frame: &wgpu::BindGroup,
        (mesh, reaching): (&MadeMesh, Reaching),
        [depth_maps, frames]: [&wgpu::TextureView; 2],
    ) {
        let gpu = recording.gpu;
        let OnDevice { positions, corners, .. } = &mesh.on_device;
        let buffers = [
            &mesh.parameters,
            positions,
            &mesh.normals,
            corners,
            &mesh.shifts,
            &mesh.sights,
            &mesh.values[0],
            &mesh.distances[0],
        ];
        let textures = [depth_maps, frames].map(wgpu::BindingResource::TextureView);
        let group = bind_beside(gpu, (LABEL, &self.layout), (&buffers, &textures));
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.compute_writes(span);
        let mut pass = gpu.begin_compute_pass(recording.encoder, LABEL, writes);
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, &group, &[]);
        let [by_vertex, by_face] = mesh.n_entries();
        pass.set_pipeline(&self.sight);
        dispatch(&mut pass, by_vertex);
        pass.set_pipeline(&self.seams);
        dispatch(&mut pass, by_face);
        if reaching == Reaching::Front {
            pass.set_pipeline(&self.march);
            (0..MARCH_ROUNDS).for_each(|_| dispatch(&mut pass, by_face));
        }
    }
}
