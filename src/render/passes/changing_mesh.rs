//! A mesh that is another from frame to frame, as passes over it know it, and the pass that shows it by what cameras lend to it.

use super::compute::{Access, DeviceBuffer, bind, layout_for};
use super::fields_topology::OnDevice;
use super::{DrawInto, DrawPipeline, LiveFrames, MAIN, Mixing, Recording, draw_pipeline};
use crate::gpu::{Gpu, GpuError, mirror};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use videofields_vision::fields::MAX_VIEWS;

const LABEL: &str = "changing_mesh";

/// Cameras that are mixed at a place, at most.
pub(crate) const MOST_SLOTS: u32 = 8;

mirror! { "common/changing_mesh.wgsl",
/// One of its cameras. The shader documents the fields.
pub(crate) struct MeshCamera {
    pub eye: [f32; 3],
    pub camera_idx: u32,
    pub map_px: [f32; 2],
    pub was: u32,
    pub is_shown: u32,
}}

mirror! { "common/changing_mesh.wgsl",
/// The mesh, its cameras and who looks. The shader documents the fields.
pub(crate) struct ChangingMesh {
    pub shift: [f32; 3],
    pub n_vertices: u32,
    pub n_faces: u32,
    pub n_views: u32,
    pub reach_m: f32,
    pub depth_m: f32,
    pub viewer: [f32; 3],
    pub is_parallel: u32,
    pub follow: f32,
    pub is_montage: u32,
    pub visibility: u32,
    pub has_ramps: u32,
    pub n_before: u32,
    pub n_views_before: u32,
    pub cell_m: f32,
    pub table_mask: u32,
    pub normal_exponent: f32,
    pub most_cameras: u32,
    pub pad_a: u32,
    pub pad_b: u32,
    pub cameras: [MeshCamera; MAX_VIEWS],
}}

/// What the device holds of the mesh that was made last, but for what belongs to who looks.
#[derive(Clone)]
pub(crate) struct MadeMesh {
    /// Vertices, faces, views.
    pub n: [u32; 3],
    pub parameters: wgpu::Buffer,
    pub on_device: OnDevice,
    pub normals: wgpu::Buffer,
    pub homes: wgpu::Buffer,
    pub shifts: wgpu::Buffer,
    pub sights: wgpu::Buffer,
    pub values: [wgpu::Buffer; 2],
    pub distances: [wgpu::Buffer; 2],
    pub neighbours: wgpu::Buffer,
    pub colors: [wgpu::Buffer; 2],
}

impl MadeMesh {
    /// By vertex and view, by face and view.
    pub(super) const fn n_entries(&self) -> [u32; 2] {
        let [n_vertices, n_faces, n_views] = self.n;
        [n_vertices * n_views, n_faces * n_views]
    }
}

/// Buffers that the device alone writes, kept from mesh to mesh.
#[derive(Debug)]
pub(crate) struct MeshBuffers {
    sights: DeviceBuffer,
    values: [DeviceBuffer; 2],
    distances: [DeviceBuffer; 2],
    neighbours: DeviceBuffer,
    colors: [DeviceBuffer; 2],
}

/// What is written of a mesh before anything is made of it.
pub(crate) struct WrittenMesh {
    pub parameters: wgpu::Buffer,
    pub on_device: OnDevice,
    pub normals: wgpu::Buffer,
    pub homes: wgpu::Buffer,
    pub shifts: wgpu::Buffer,
}

/// Words of a vertex's list of neighbours: `NEIGHBOURS` of `mesh_smooth.wgsl`.
pub(crate) const NEIGHBOUR_WORDS: u64 = 16;

/// Bytes of what is kept by vertex and view: `values` of `mesh_smooth.wgsl`.
pub(crate) const VALUE_BYTES: u64 = 16;

impl MeshBuffers {
    pub(crate) const fn new() -> Self {
        let buffer = DeviceBuffer::new;
        Self {
            sights: buffer("mesh sights"),
            values: [buffer("mesh values"), buffer("mesh values")],
            distances: [buffer("mesh distances"), buffer("mesh distances")],
            neighbours: buffer("mesh neighbours"),
            colors: [buffer("mesh colors"), buffer("mesh colors")],
        }
    }

    /// With room for a mesh of so many vertices, faces and views.
    pub(crate) fn sized(&mut self, gpu: &Gpu, n: [u32; 3], written: WrittenMesh) -> MadeMesh {
        let n_vertices = u64::from(n[0]);
        let n_entries = n_vertices * u64::from(n[2]);
        let both = |pair: &mut [DeviceBuffer; 2], n_bytes| {
            let [first, second] = pair;
            [first.sized(gpu, n_bytes), second.sized(gpu, n_bytes)]
        };
        let WrittenMesh { parameters, on_device, normals, homes, shifts } = written;
        MadeMesh {
            n,
            parameters,
            on_device,
            normals,
            homes,
            shifts,
            sights: self.sights.sized(gpu, 4 * n_entries),
            values: both(&mut self.values, VALUE_BYTES * n_entries),
            distances: both(&mut self.distances, 4 * n_entries),
            neighbours: self.neighbours.sized(gpu, 4 * NEIGHBOUR_WORDS * n_vertices),
            colors: both(&mut self.colors, 16 * n_vertices),
        }
    }
}

/// What a face is drawn with.
pub(crate) struct ShownBy<'a> {
    pub weights: &'a wgpu::Buffer,
    pub slots: &'a wgpu::Buffer,
}

/// Shows changing meshes.
#[derive(Debug)]
pub(crate) struct ChangingMeshPass {
    frames: LiveFrames,
    layout: wgpu::BindGroupLayout,
    /// By gains and lenses, cameras at a place, samples.
    pipelines: BTreeMap<([bool; 2], u32, u32), wgpu::RenderPipeline>,
}

impl ChangingMeshPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let stages = wgpu::ShaderStages::VERTEX_FRAGMENT;
        let layout = layout_for(gpu, LABEL, (stages, &[Access::Read; 6]));
        Self { frames: LiveFrames::new(gpu, LABEL), layout, pipelines: BTreeMap::new() }
    }

    /// Records that the mesh is drawn; `has_lenses` tells whether any of its cameras has a lens that bends.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        (mesh, by): (&MadeMesh, &ShownBy<'_>),
        (has_lenses, frames): (bool, &wgpu::TextureView),
    ) -> Result<(), GpuError> {
        let gpu = recording.gpu;
        let number = |is_so: bool| f64::from(u8::from(is_so));
        let [_, n_faces, n_views] = mesh.n;
        let n_listed = n_views.min(MOST_SLOTS);
        let wanted = DrawPipeline {
            label: LABEL,
            bind_groups: &[Some(into.frame_layout), Some(&self.layout), Some(&self.frames.layout)],
            vertices: &[],
            entry_points: MAIN,
            topology: wgpu::PrimitiveTopology::TriangleList,
            mixing: Mixing { blend: None, writes_depth: true, culls_back: false, writes_color: true },
            variant: &[
                ("HAS_GAINS", number(into.has_gains)),
                ("HAS_LENSES", number(has_lenses)),
                ("N_LISTED", f64::from(n_listed)),
            ],
            samples: into.targets.samples(),
        };
        let kind = ([into.has_gains, has_lenses], n_listed, into.targets.samples());
        let pipeline = match self.pipelines.entry(kind) {
            Entry::Occupied(kept) => kept.into_mut(),
            Entry::Vacant(new) => new.insert(draw_pipeline(gpu, wanted)?),
        };
        let OnDevice { positions, corners, .. } = &mesh.on_device;
        let buffers =
            [&mesh.parameters, positions, corners, &mesh.shifts, by.weights, by.slots, &mesh.colors[0]];
        let group = bind(gpu, (LABEL, &self.layout), &buffers);
        let textures = self.frames.bind_view(gpu, frames);
        let mut pass = recording.draw(LABEL, into);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(1, &group, &[]);
        pass.set_bind_group(2, &textures, &[]);
        pass.draw(0..3 * n_faces, 0..1);
        Ok(())
    }
}
