//! Distances along meshes from the nearest of many vertices, on the device: which faces meet, then rounds of two windows a half-edge.
//!
//! For meshes that change from picture to picture: nothing of them is made ready here but positions and triangles.
//! [`crate::fields::bounded`] is the specification, [`crate::fields::exact`] the truth.

use super::Recording;
use super::fields_topology::{
    Access, FieldsTopologyPass, MeshSize, bind, dispatch, layout, pipelines, table_slots,
};
use crate::gpu::{Gpu, GpuError, GrowingBuffer, PassTime, Timer, read};
use crate::mesh::Mesh;
use glam::DVec3;

const DISTANCES: &str = "fields_distances";

/// Bytes of what is kept of a half-edge.
const KEPT_BYTES: u64 = 48;

/// Distances of a mesh's vertices, and what they took.
#[derive(Clone, Debug)]
pub struct FoundDistances {
    /// By list of sources, and of each by vertex, metres; infinite beyond what the rounds reach.
    pub distances_m: Vec<Vec<f32>>,
    /// Time that the device spent in each pass; empty where it cannot tell.
    pub timings: Vec<PassTime>,
}

/// Buffers of a mesh of up to some size.
#[derive(Debug)]
struct Buffers {
    n_vertices: usize,
    n_half_edges: usize,
    table: wgpu::Buffer,
    opposite: wgpu::Buffer,
    turns: wgpu::Buffer,
    kept: [wgpu::Buffer; 2],
    distances: [wgpu::Buffer; 2],
}

impl Buffers {
    fn of(gpu: &Gpu, n_vertices: usize, n_half_edges: usize) -> Self {
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let words = |label, n: usize| gpu.buffer(label, 4 * n.max(1) as u64, storage);
        let kept = || gpu.buffer("fields windows", KEPT_BYTES * n_half_edges.max(1) as u64, storage);
        let distances = || {
            let size = 4 * n_vertices.max(1) as u64;
            gpu.buffer("fields distances", size, storage | wgpu::BufferUsages::COPY_SRC)
        };
        Self {
            n_vertices,
            n_half_edges,
            table: words("fields table", table_slots(n_half_edges)),
            opposite: words("fields opposite", n_half_edges),
            turns: words("fields turns", n_vertices),
            kept: [kept(), kept()],
            distances: [distances(), distances()],
        }
    }
}

/// Finds distances along meshes; buffers are kept from mesh to mesh.
#[derive(Debug)]
pub struct SurfaceDistances {
    topology: FieldsTopologyPass,
    layout: wgpu::BindGroupLayout,
    gather: wgpu::ComputePipeline,
    reach: wgpu::ComputePipeline,
    size: GrowingBuffer,
    positions: GrowingBuffer,
    corners: GrowingBuffer,
    begins: GrowingBuffer,
    buffers: Option<Buffers>,
    timer: Timer,
}

impl SurfaceDistances {
    /// For a device.
    ///
    /// # Errors
    /// Where it refuses the shaders.
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let reads = [Access::Read; 5];
        let all = [&reads[..], &[Access::Write, Access::Read, Access::Write]].concat();
        let layout = layout(gpu, DISTANCES, &all);
        let [gather, reach] = pipelines(gpu, DISTANCES, &layout, ["cs_gather", "cs_reach"])?;
        let storage = wgpu::BufferUsages::STORAGE;
        Ok(Self {
            topology: FieldsTopologyPass::new(gpu)?,
            layout,
            gather,
            reach,
            size: GrowingBuffer::new("fields mesh", wgpu::BufferUsages::UNIFORM),
            positions: GrowingBuffer::new("fields positions", storage),
            corners: GrowingBuffer::new("fields corners", storage),
            begins: GrowingBuffer::new("fields begins", wgpu::BufferUsages::COPY_SRC),
            buffers: None,
            timer: Timer::new(gpu),
        })
    }

    /// Distances from the nearest vertex of each list of `sources` to all that lie within so many rounds, along the surface. Triangles
    /// without an area, in single precision, carry nothing.
    ///
    /// **Cost** linear in the mesh, a list and round; what is found is waited for and read back.
    ///
    /// # Errors
    /// What the device reports, and sources that are no vertices of the mesh.
    pub fn of(
        &mut self,
        gpu: &Gpu,
        mesh: &Mesh,
        sources: &[Vec<u32>],
        rounds: u32,
    ) -> Result<FoundDistances, GpuError> {
        let (n_vertices, n_half_edges) = (mesh.positions_m.len(), 3 * mesh.triangles.len());
        if let Some(vertex) = sources.iter().flatten().find(|vertex| **vertex as usize >= n_vertices) {
            let message = format!("source {vertex} of a mesh with {n_vertices} vertices");
            return Err(GpuError::Refused { message });
        }
        let mut found = vec![vec![f32::INFINITY; n_vertices]; sources.len()];
        if n_half_edges == 0 || sources.is_empty() {
            for (distances_m, sources) in found.iter_mut().zip(sources) {
                sources.iter().for_each(|vertex| distances_m[*vertex as usize] = 0.0);
            }
            return Ok(FoundDistances { distances_m: found, timings: Vec::new() });
        }
        self.timer.begin_frame();
        let result = self.record(gpu, mesh, sources, rounds);
        read(gpu, &result, |bytes| {
            let (words, _) = bytes.as_chunks::<4>();
            for (distances_m, words) in found.iter_mut().zip(words.chunks_exact(n_vertices)) {
                distances_m.iter_mut().zip(words).for_each(|(to, from)| *to = f32::from_ne_bytes(*from));
            }
        })?;
        Ok(FoundDistances { distances_m: found, timings: self.timer.read(gpu)? })
    }

    /// Hands all of it to the device; answers what is to be read, list by list.
    fn record(&mut self, gpu: &Gpu, mesh: &Mesh, sources: &[Vec<u32>], rounds: u32) -> wgpu::Buffer {
        let (n_vertices, n_half_edges) = (mesh.positions_m.len(), 3 * mesh.triangles.len());
        self.write(gpu, mesh, sources);
        let is_large = |kept: &&Buffers| kept.n_vertices >= n_vertices && kept.n_half_edges >= n_half_edges;
        if self.buffers.as_ref().filter(is_large).is_none() {
            self.buffers = Some(Buffers::of(gpu, n_vertices, n_half_edges));
        }
        let buffers = self.buffers.as_ref().expect("they have just been made");
        let written = |buffer: &GrowingBuffer| buffer.get().expect("they have just been written").clone();
        let [size, positions, corners, begins] =
            [&self.size, &self.positions, &self.corners, &self.begins].map(written);
        let bytes = 4 * n_vertices as u64;
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let result = gpu.buffer("fields distances read", bytes * sources.len() as u64, usage);
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some(DISTANCES) };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        let threads = n_half_edges.max(n_vertices) as u32;
        let mut recording = Recording { gpu, encoder: &mut encoder, timer: &mut self.timer };
        let met = [&size, &positions, &corners, &buffers.table, &buffers.opposite, &buffers.turns];
        self.topology.record(&mut recording, &met, threads);
        // By which of both buffers is read: gathering writes the other windows, reaching reads these.
        let Buffers { opposite, turns, kept, distances, .. } = buffers;
        let group = |windows: [usize; 2], from: usize| {
            let [before, after] = windows.map(|which| &kept[which]);
            let (nearer, next) = (&distances[from], &distances[1 - from]);
            let all = [&size, &positions, &corners, opposite, turns, before, after, nearer, next];
            bind(gpu, (DISTANCES, &self.layout), &all)
        };
        let gathering = [group([0, 1], 0), group([1, 0], 1)];
        let reaching = [group([1, 0], 0), group([0, 1], 1)];
        for list in 0..sources.len() as u64 {
            encoder.clear_buffer(&kept[0], 0, None);
            encoder.copy_buffer_to_buffer(&begins, list * bytes, &distances[0], 0, bytes);
            let span = self.timer.span(DISTANCES);
            let mut pass = gpu.begin_compute_pass(&mut encoder, DISTANCES, self.timer.compute_writes(span));
            for round in 0..rounds as usize {
                for (pipeline, groups) in [(&self.gather, &gathering), (&self.reach, &reaching)] {
                    pass.set_pipeline(pipeline);
                    pass.set_bind_group(0, &groups[round % 2], &[]);
                    dispatch(&mut pass, threads);
                }
            }
            drop(pass);
            encoder.copy_buffer_to_buffer(&distances[rounds as usize % 2], 0, &result, list * bytes, bytes);
        }
        self.timer.resolve(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        result
    }

    fn write(&mut self, gpu: &Gpu, mesh: &Mesh, sources: &[Vec<u32>]) {
        let origin = mesh.bounds().map_or(DVec3::ZERO, |[low, high]| 0.5 * (low + high));
        let positions: Vec<[f32; 3]> =
            mesh.positions_m.iter().map(|at| (*at - origin).as_vec3().to_array()).collect();
        self.positions.write(gpu, &positions);
        self.corners.write(gpu, &mesh.triangles);
        self.size.write(gpu, &[MeshSize::of(mesh)]);
        let mut begins = vec![f32::INFINITY; mesh.positions_m.len() * sources.len()];
        for (list, sources) in begins.chunks_exact_mut(mesh.positions_m.len()).zip(sources) {
            sources.iter().for_each(|vertex| list[*vertex as usize] = 0.0);
        }
        self.begins.write(gpu, &begins);
    }
}
