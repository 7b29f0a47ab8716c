//! Entities as runs of squares in space, a square a foreground texel.

use super::{
    Attributes, BySamples, DrawInto, DrawPipeline, LiveFrames, MAIN, Mixing, Recording, draw_pipeline,
};
use crate::gpu::{Gpu, GpuError, GrowingBuffer};
use crate::image_array::ImageArray;
use glam::DVec3;
use videofields_picture::fuse::PointRun;

/// One run.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Instance {
    /// Of both ends: where it stands, and the side of its square in metres.
    ends: [[f32; 4]; 2],
    /// Texture coordinates of the first and of the last texel's middle.
    textures: [f32; 4],
    camera_idx: u32,
    n_rows: u32,
}

const ATTRIBUTES: Attributes<4> =
    wgpu::vertex_attr_array![0 => Float32x4, 1 => Float32x4, 2 => Float32x4, 3 => Uint32x2];

impl Instance {
    pub(crate) fn new(run: &PointRun, camera_idx: usize, anchor_in_world: DVec3) -> Self {
        let end = |idx: usize| {
            let from_anchor = run.ends_in_world[idx] - anchor_in_world;
            from_anchor.as_vec3().extend(run.sizes_m[idx]).to_array()
        };
        let [[first_u, first_v], [last_u, last_v]] = run.textures;
        Self {
            ends: [end(0), end(1)],
            textures: [first_u, first_v, last_u, last_v],
            camera_idx: camera_idx as u32,
            n_rows: run.n_rows,
        }
    }
}

/// Draws entities.
#[derive(Debug)]
pub(crate) struct PointsPass {
    frames: LiveFrames,
    /// Without gains, and with.
    pipelines: [BySamples; 2],
    instances: GrowingBuffer,
}

const LABEL: &str = "points";

impl PointsPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let frames = LiveFrames::new(gpu, LABEL);
        let instances = GrowingBuffer::new("points instances", wgpu::BufferUsages::VERTEX);
        Self { frames, pipelines: Default::default(), instances }
    }

    /// Records the runs, in any order.
    pub(crate) fn record(
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
