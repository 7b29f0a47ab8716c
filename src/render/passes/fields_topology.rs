//! Which faces of a mesh meet at which sides, found on the device: what passes that go along surfaces start from.
//!
//! [`videofields_vision::fields::Topology`] is its counterpart.

use super::Recording;
use super::compute::{Access, DeviceBuffer, bind, dispatch, layout, pipelines};
use crate::gpu::{Gpu, GpuError, mirror};

const LABEL: &str = "fields_topology";

/// Windows of sources that are apart by less than this share of the mean side are one.
const SAME: f64 = 1e-2;

mirror! { "render/fields_topology.wgsl",
/// How large a mesh is. The shader documents the fields.
pub(crate) struct MeshSize {
    n_vertices: u32,
    n_faces: u32,
    table_mask: u32,
    same_m: f32,
}}

impl MeshSize {
    /// Of so many vertices and faces, whose sides are so long in the mean.
    pub(crate) fn new(n_vertices: usize, n_faces: usize, side_m: f64) -> Self {
        Self {
            n_vertices: n_vertices as u32,
            n_faces: n_faces as u32,
            table_mask: table_slots(3 * n_faces) as u32 - 1,
            same_m: (SAME * side_m) as f32,
        }
    }

    /// Sides of faces, each counted for each of its faces.
    pub(super) const fn n_half_edges(&self) -> u32 {
        3 * self.n_faces
    }

    /// How many vertices there are.
    pub(super) const fn n_vertices(&self) -> u32 {
        self.n_vertices
    }
}

/// A mesh on the device: its size as it is bound and as it is known, places and corners.
#[derive(Clone)]
pub(crate) struct OnDevice {
    pub size: wgpu::Buffer,
    pub of: MeshSize,
    pub positions: wgpu::Buffer,
    pub corners: wgpu::Buffer,
}

/// How a mesh hangs together: by half-edge the opposite one, by vertex how far around its faces go.
pub(crate) struct HangsTogether {
    pub opposite: wgpu::Buffer,
    pub turns: wgpu::Buffer,
}

/// Finds which half-edges meet, and how far around each vertex its faces go.
#[derive(Debug)]
pub(crate) struct FieldsTopologyPass {
    layout: wgpu::BindGroupLayout,
    meet: wgpu::ComputePipeline,
    border: wgpu::ComputePipeline,
    table: DeviceBuffer,
    opposite: DeviceBuffer,
    turns: DeviceBuffer,
}

impl FieldsTopologyPass {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        use Access::{Read, Write};
        let layout = layout(gpu, LABEL, &[Read, Read, Write, Write, Write]);
        let [meet, border] = pipelines(gpu, LABEL, &layout, ["cs_meet", "cs_border"])?;
        let buffer = DeviceBuffer::new;
        Ok(Self {
            layout,
            meet,
            border,
            table: buffer("fields table"),
            opposite: buffer("fields opposite"),
            turns: buffer("fields turns"),
        })
    }

    /// Records both steps; what was found of another mesh is no more.
    pub(crate) fn record(&mut self, recording: &mut Recording<'_>, mesh: &OnDevice) -> HangsTogether {
        let gpu = recording.gpu;
        let words = |n: u32| 4 * u64::from(n);
        let table = self.table.sized(gpu, words(mesh.of.table_mask + 1));
        let opposite = self.opposite.sized(gpu, words(mesh.of.n_half_edges()));
        let turns = self.turns.sized(gpu, words(mesh.of.n_vertices));
        for cleared in [&table, &opposite, &turns] {
            recording.encoder.clear_buffer(cleared, 0, None);
        }
        let buffers = [&mesh.size, &mesh.positions, &mesh.corners, &table, &opposite, &turns];
        let group = bind(gpu, (LABEL, &self.layout), &buffers);
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.compute_writes(span);
        let mut pass = gpu.begin_compute_pass(recording.encoder, LABEL, writes);
        pass.set_bind_group(0, &group, &[]);
        for pipeline in [&self.meet, &self.border] {
            pass.set_pipeline(pipeline);
            dispatch(&mut pass, mesh.of.n_half_edges());
        }
        drop(pass);
        HangsTogether { opposite, turns }
    }
}

/// At most half of them are filled.
const fn table_slots(n_half_edges: usize) -> usize {
    let wanted = if n_half_edges < 32 { 64 } else { 2 * n_half_edges };
    wanted.next_power_of_two()
}
