//! Distances along a mesh that is given, by the device's passes: for who compares and measures.

use super::passes::{FieldsDistancesPass, FieldsTopologyPass, MeshSize, OnDevice, Recording};
use crate::gpu::{Gpu, GpuError, GrowingBuffer, PassTime, Timer, read};
use glam::DVec3;
use videofields_vision::mesh::Mesh;

/// Distances of a mesh's vertices, and what they took.
#[derive(Clone, Debug)]
pub struct FoundDistances {
    /// By list of sources, and of each by vertex, metres; infinite beyond what the rounds reach.
    pub distances_m: Vec<Vec<f32>>,
    /// Time that the device spent in each pass; empty where it cannot tell.
    pub timings: Vec<PassTime>,
}

/// Finds distances along meshes; buffers are kept from mesh to mesh.
#[derive(Debug)]
pub struct SurfaceDistances {
    topology: FieldsTopologyPass,
    distances: FieldsDistancesPass,
    size: GrowingBuffer,
    positions: GrowingBuffer,
    corners: GrowingBuffer,
    begins: GrowingBuffer,
    timer: Timer,
}

impl SurfaceDistances {
    /// For a device.
    ///
    /// # Errors
    /// Where it refuses the shaders.
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let storage = wgpu::BufferUsages::STORAGE;
        Ok(Self {
            topology: FieldsTopologyPass::new(gpu)?,
            distances: FieldsDistancesPass::new(gpu)?,
            size: GrowingBuffer::new("fields mesh", wgpu::BufferUsages::STORAGE),
            positions: GrowingBuffer::new("fields positions", storage),
            corners: GrowingBuffer::new("fields corners", storage),
            begins: GrowingBuffer::new("fields begins", wgpu::BufferUsages::COPY_SRC),
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
        let n_vertices = mesh.positions_m.len();
        if let Some(vertex) = sources.iter().flatten().find(|vertex| **vertex as usize >= n_vertices) {
            let message = format!("source {vertex} of a mesh with {n_vertices} vertices");
            return Err(GpuError::Refused { message });
        }
        let mut found = vec![vec![f32::INFINITY; n_vertices]; sources.len()];
        if mesh.triangles.is_empty() || sources.is_empty() {
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
        let on_device = self.write(gpu, mesh, sources);
        let begins = self.begins.get().expect("they have just been written").clone();
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let n_bytes = (4 * mesh.positions_m.len() * sources.len()) as u64;
        let result = gpu.buffer("fields distances read", n_bytes, usage);
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("distances") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        let mut recording = Recording { gpu, encoder: &mut encoder, timer: &mut self.timer };
        let hangs_together = self.topology.record(&mut recording, &on_device);
        let of = (&on_device, &hangs_together);
        self.distances.record(&mut recording, of, (&begins, &result), (sources.len(), rounds));
        self.timer.resolve(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        result
    }

    fn write(&mut self, gpu: &Gpu, mesh: &Mesh, sources: &[Vec<u32>]) -> OnDevice {
        let origin = mesh.bounds().map_or(DVec3::ZERO, |[low, high]| 0.5 * (low + high));
        let positions: Vec<[f32; 4]> =
            mesh.positions_m.iter().map(|at| (*at - origin).as_vec3().extend(0.0).to_array()).collect();
        let mut begins = vec![f32::INFINITY; mesh.positions_m.len() * sources.len()];
        for (list, sources) in begins.chunks_exact_mut(mesh.positions_m.len()).zip(sources) {
            sources.iter().for_each(|vertex| list[*vertex as usize] = 0.0);
        }
        self.begins.write(gpu, &begins);
        let of = MeshSize::new(mesh.positions_m.len(), mesh.triangles.len(), mesh.mean_side_m());
        OnDevice {
            size: self.size.write(gpu, &[of]).clone(),
            of,
            positions: self.positions.write(gpu, &positions).clone(),
            corners: self.corners.write(gpu, &mesh.triangles).clone(),
        }
    }
}
