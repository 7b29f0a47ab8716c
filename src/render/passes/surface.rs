//! Sky, ground and boxes, with the cameras' backgrounds projected on them.

use super::camera_depth::DepthMaps;
use super::{
    Attributes, DrawInto, FILTERED, Mixing, Recording, SAMPLER_ENTRY, UNFILTERED, draw_pipeline, linear_sampler,
    texture_entry,
};
use crate::gpu::{Gpu, GpuError, GrowingBuffer};
use crate::render::image_array::ImageArray;
use crate::render::mesh::MeshVertex;
use glam::DVec3;

/// One corner of a triangle, relative to the eye.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Vertex {
    position_from_eye: [f32; 3],
    normal: [f32; 3],
    material: [f32; 3],
}

const ATTRIBUTES: Attributes<3> = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3];

/// Draws the static scene.
#[derive(Debug)]
pub(in crate::render) struct SurfacePass {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::RenderPipeline,
    sampler: wgpu::Sampler,
    vertices: GrowingBuffer,
    scratch: Vec<Vertex>,
}

const LABEL: &str = "surface";

impl SurfacePass {
    pub(in crate::render) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        samples: u32,
    ) -> Result<Self, GpuError> {
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[
                texture_entry(0, wgpu::TextureViewDimension::D2Array, FILTERED),
                SAMPLER_ENTRY,
                texture_entry(2, wgpu::TextureViewDimension::D2Array, UNFILTERED),
            ],
        });
        let vertices = wgpu::VertexBufferLayout {
            array_stride: size_of::<Vertex>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &ATTRIBUTES,
        };
        let pipeline = draw_pipeline(
            gpu,
            LABEL,
            &[frame_layout, &layout],
            &vertices,
            wgpu::PrimitiveTopology::TriangleList,
            Mixing { blend: None, writes_depth: true },
            samples,
        )?;
        Ok(Self {
            layout,
            pipeline,
            sampler: linear_sampler(gpu, LABEL),
            vertices: GrowingBuffer::new("surface vertices", wgpu::BufferUsages::VERTEX),
            scratch: Vec::new(),
        })
    }

    /// Records the sky (the colour to clear with) and the scene's `mesh`.
    pub(in crate::render) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        mesh: &[MeshVertex],
        eye_in_world: DVec3,
        backgrounds: &mut ImageArray,
        depth_maps: &mut DepthMaps,
    ) {
        let gpu = recording.gpu;
        self.scratch.clear();
        self.scratch.extend(mesh.iter().map(|vertex| Vertex {
            position_from_eye: (vertex.position_in_world - eye_in_world).as_vec3().to_array(),
            normal: vertex.normal.to_array(),
            material: vertex.material.to_array(),
        }));
        let vertices = self.vertices.write(gpu, &self.scratch);
        let textures = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&backgrounds.store(gpu).sampled),
                },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&self.sampler) },
                wgpu::BindGroupEntry {
                    binding: 2,
                    resource: wgpu::BindingResource::TextureView(depth_maps.view(gpu)),
                },
            ],
        });
        let mut pass = recording.draw(LABEL, into);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(1, &textures, &[]);
        pass.set_vertex_buffer(0, vertices.slice(..));
        pass.draw(0..self.scratch.len() as u32, 0..1);
    }
}
