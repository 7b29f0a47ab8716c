//! Entities as squares in space, one a foreground texel.

use super::{
    Attributes, BySamples, DrawInto, DrawPipeline, LiveFrames, MAIN, Mixing, Recording, draw_pipeline,
};
use crate::fuse::EntityPoint;
use crate::gpu::{Gpu, GpuError, GrowingBuffer};
use crate::render::image_array::ImageArray;
use glam::DVec3;

/// One square.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(in crate::render) struct Instance {
    position_from_anchor: [f32; 3],
    size_m: f32,
    texture: [f32; 2],
    camera_idx: u32,
}

const ATTRIBUTES: Attributes<4> =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Float32x2, 3 => Uint32];

impl Instance {
    pub(in crate::render) fn new(point: &EntityPoint, camera_idx: usize, anchor_in_world: DVec3) -> Self {
        Self {
            position_from_anchor: (point.position_in_world - anchor_in_world).as_vec3().to_array(),
            size_m: point.size_m,
            texture: point.texture,
            camera_idx: camera_idx as u32,
        }
    }
}

/// Draws entities.
#[derive(Debug)]
pub(in crate::render) struct PointsPass {
    frames: LiveFrames,
    /// Without gains, and with.
    pipelines: [BySamples; 2],
    instances: GrowingBuffer,
}

const LABEL: &str = "points";

impl PointsPass {
    pub(in crate::render) fn new(gpu: &Gpu) -> Self {
        let frames = LiveFrames::new(gpu, LABEL);
        let instances = GrowingBuffer::new("points instances", wgpu::BufferUsages::VERTEX);
        Self { frames, pipelines: Default::default(), instances }
    }

    /// Records the squares, in any order.
    pub(in crate::render) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        instances: &[Instance],
        frames: &mut ImageArray,
    ) -> Result<(), GpuError> {
        let gpu = recording.gpu;
        let layout = wgpu::VertexBufferLayout {
            array_stride: size_of::<Instance>() as u64,
            step_mode: wgpu::VertexStepMode::Instance,
            attributes: &ATTRIBUTES,
        };
        let samples = into.targets.samples();
        let wanted = DrawPipeline {
            label: LABEL,
            bind_groups: &[Some(into.frame_layout), Some(&self.frames.layout)],
            vertices: &[Some(layout)],
            entry_points: MAIN,
            topology: wgpu::PrimitiveTopology::TriangleStrip,
            mixing: Mixing { blend: None, writes_depth: true, culls_back: false, writes_color: true },
            variant: &[("HAS_GAINS", f64::from(u8::from(into.has_gains)))],
            samples,
        };
        let pipeline =
            self.pipelines[usize::from(into.has_gains)].get(samples, || draw_pipeline(gpu, wanted))?;
        let textures = self.frames.bind(gpu, frames);
        let vertices = self.instances.write(gpu, instances);
        let mut pass = recording.draw(LABEL, into);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(1, &textures, &[]);
        pass.set_vertex_buffer(0, vertices.slice(..));
        pass.draw(0..4, 0..instances.len() as u32);
        Ok(())
    }
}
