//! Which faces of a mesh meet at which sides, found on the device: what passes that go along surfaces start from.
//!
//! [`crate::fields::Topology`] is its counterpart.

use super::Recording;
use crate::gpu::{Gpu, GpuError, mirror};
use crate::mesh::Mesh;

const LABEL: &str = "fields_topology";

/// Threads of a group, and most groups in a row.
const GROUP: u32 = 64;
const MOST_GROUPS: u32 = 65_535;

/// Windows of sources that are apart by less than this share of the mean side are one.
const SAME: f64 = 1e-2;

mirror! { "render/fields_topology.wgsl",
/// How large a mesh is. The shader documents the fields.
pub(super) struct MeshSize {
    n_vertices: u32,
    n_faces: u32,
    table_mask: u32,
    same_m: f32,
}}

impl MeshSize {
    /// Of a mesh that has triangles.
    pub(super) fn of(mesh: &Mesh) -> Self {
        let side_m = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|corner| mesh.positions_m[corner as usize]);
            a.distance(b) + b.distance(c) + c.distance(a)
        };
        let n_half_edges = 3 * mesh.triangles.len();
        let mean_m = mesh.triangles.iter().map(side_m).sum::<f64>() / n_half_edges as f64;
        Self {
            n_vertices: mesh.positions_m.len() as u32,
            n_faces: mesh.triangles.len() as u32,
            table_mask: table_slots(n_half_edges) as u32 - 1,
            same_m: (SAME * mean_m) as f32,
        }
    }
}

/// Finds which half-edges meet, and how far around each vertex its faces go.
#[derive(Debug)]
pub(super) struct FieldsTopologyPass {
    layout: wgpu::BindGroupLayout,
    meet: wgpu::ComputePipeline,
    border: wgpu::ComputePipeline,
}

impl FieldsTopologyPass {
    pub(super) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        use Access::{Read, Write};
        let layout = layout(gpu, LABEL, &[Read, Read, Write, Write, Write]);
        let [meet, border] = pipelines(gpu, LABEL, &layout, ["cs_meet", "cs_border"])?;
        Ok(Self { layout, meet, border })
    }

    /// Records both steps for so many threads; the last three `buffers` (table, opposites, turns) are cleared first.
    pub(super) fn record(&self, recording: &mut Recording<'_>, buffers: &[&wgpu::Buffer; 6], threads: u32) {
        for cleared in &buffers[3..] {
            recording.encoder.clear_buffer(cleared, 0, None);
        }
        let group = bind(recording.gpu, (LABEL, &self.layout), buffers);
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.compute_writes(span);
        let mut pass = recording.gpu.begin_compute_pass(recording.encoder, LABEL, writes);
        pass.set_bind_group(0, &group, &[]);
        for pipeline in [&self.meet, &self.border] {
            pass.set_pipeline(pipeline);
            dispatch(&mut pass, threads);
        }
    }
}

/// At most half of them are filled.
pub(super) const fn table_slots(n_half_edges: usize) -> usize {
    let wanted = if n_half_edges < 32 { 64 } else { 2 * n_half_edges };
    wanted.next_power_of_two()
}

/// What a shader does with a storage buffer.
#[derive(Clone, Copy)]
pub(super) enum Access {
    Read,
    Write,
}

/// A uniform buffer, and storage buffers after it.
pub(super) fn layout(gpu: &Gpu, label: &'static str, storage: &[Access]) -> wgpu::BindGroupLayout {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    let mut entries = vec![entry(0, wgpu::BufferBindingType::Uniform)];
    entries.extend((1..).zip(storage).map(|(binding, access)| {
        let read_only = matches!(access, Access::Read);
        entry(binding, wgpu::BufferBindingType::Storage { read_only })
    }));
    let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries };
    gpu.device.create_bind_group_layout(&descriptor)
}

pub(super) fn bind(
    gpu: &Gpu,
    (label, layout): (&'static str, &wgpu::BindGroupLayout),
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    let descriptor = wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries };
    gpu.device.create_bind_group(&descriptor)
}

/// Two entry points of the shader that is called as its passes are.
pub(super) fn pipelines(
    gpu: &Gpu,
    label: &'static str,
    layout: &wgpu::BindGroupLayout,
    entry_points: [&str; 2],
) -> Result<[wgpu::ComputePipeline; 2], GpuError> {
    let module = gpu.shader(&format!("render/{label}.wgsl"))?;
    let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    Ok(entry_points.map(|entry_point| {
        gpu.compute_pipeline(
            label,
            &wgpu::ComputePipelineDescriptor {
                label: Some(label),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(entry_point),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            },
        )
    }))
}

pub(super) fn dispatch(pass: &mut wgpu::ComputePass<'_>, threads: u32) {
    let n_groups = threads.div_ceil(GROUP);
    pass.dispatch_workgroups(n_groups.min(MOST_GROUPS), n_groups.div_ceil(MOST_GROUPS), 1);
}
