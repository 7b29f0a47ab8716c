//! Entities as upright rectangles in the world, each textured by the camera that saw it.

use super::{Attributes, DrawInto, DrawPipeline, LiveFrames, Mixing, Recording, draw_pipeline};
use crate::fuse::Billboard;
use crate::geometry;
use crate::gpu::{Gpu, GpuError, GrowingBuffer};
use crate::render::image_array::ImageArray;
use glam::{DQuat, DVec2, DVec3};

/// One rectangle. The shader documents the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(in crate::render) struct Instance {
    foot_from_eye: [f32; 3],
    camera_idx: u32,
    right: [f32; 3],
    height_m: f32,
    turned_right: [f32; 3],
    rect: [f32; 4],
    left_right_m: [f32; 2],
}

const ATTRIBUTES: Attributes<7> = wgpu::vertex_attr_array![
    0 => Float32x3, 1 => Uint32, 2 => Float32x3, 3 => Float32, 4 => Float32x3, 5 => Float32x4, 6 => Float32x2
];

/// Pixels of the camera's picture by which a rectangle is drawn larger than its blob, for the mask's soft edge.
const EDGE_PX: f64 = 2.5;
/// Angle between a rectangle's front (or back) and the viewer, seen from above, up to which it stays as it is.
const UNTURNED_RAD: f64 = std::f64::consts::FRAC_PI_3;

impl Instance {
    pub(in crate::render) fn new(
        billboard: &Billboard,
        camera: &geometry::Camera,
        camera_idx: usize,
        frame_size_px: (u32, u32),
        eye_in_world: DVec3,
    ) -> Self {
        let Billboard { rect, foot_in_world, right_in_world, left_right_m: [left, right], height_m, .. } =
            billboard;
        let (width, height) = (f64::from(frame_size_px.0), f64::from(frame_size_px.1));
        let edge_m = EDGE_PX * foot_in_world.distance(camera.pose().position_in_world)
            / (camera.focal_px().min_element() * width / f64::from(camera.size_px().0));
        let [x, y] = [f64::from(rect.x), f64::from(rect.y)];
        let turned = turned_towards(*right_in_world, eye_in_world - *foot_in_world);
        Self {
            foot_from_eye: (*foot_in_world - eye_in_world).as_vec3().to_array(),
            camera_idx: camera_idx as u32,
            right: right_in_world.as_vec3().to_array(),
            height_m: (height_m + edge_m) as f32,
            turned_right: turned.as_vec3().to_array(),
            rect: [
                (x / width) as f32,
                (y / height) as f32,
                ((x + f64::from(rect.width)) / width) as f32,
                ((y + f64::from(rect.height)) / height) as f32,
            ],
            left_right_m: [(left - edge_m) as f32, (right + edge_m) as f32],
        }
    }
}

/// The direction of the base line once the rectangle is turned about the vertical towards the viewer.
///
/// A rectangle nearly edge-on would vanish; beyond [`UNTURNED_RAD`] it follows the viewer, so it is turned by at most
/// 30 degrees and never seen narrower than half its width.
fn turned_towards(right_in_world: DVec3, to_viewer: DVec3) -> DVec3 {
    let to_viewer = to_viewer.truncate();
    let along = right_in_world.truncate();
    let front = DVec2::new(along.y, -along.x);
    // Angle of the viewer from the front or the back, whichever is nearer: -pi/2 to pi/2.
    let sideways = to_viewer.dot(along) * to_viewer.dot(front).signum();
    let angle = sideways.atan2(to_viewer.dot(front).abs());
    // Turning towards the viewer's side is against the base line's own sense (front is to its right).
    let excess = angle.signum() * (angle.abs() - UNTURNED_RAD).max(0.0);
    DQuat::from_rotation_z(excess) * right_in_world
}

/// Draws entities.
#[derive(Debug)]
pub(in crate::render) struct BillboardPass {
    frames: LiveFrames,
    pipeline: wgpu::RenderPipeline,
    instances: GrowingBuffer,
}

const LABEL: &str = "billboard";

impl BillboardPass {
    pub(in crate::render) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        samples: u32,
    ) -> Result<Self, GpuError> {
        let frames = LiveFrames::new(gpu, LABEL);
        let instances = wgpu::VertexBufferLayout {
            array_stride: size_of::<Instance>() as u64,
            step_mode: wgpu::VertexStepMode::Instance,
            attributes: &ATTRIBUTES,
        };
        let pipeline = draw_pipeline(
            gpu,
            DrawPipeline {
                label: LABEL,
                bind_groups: &[frame_layout, &frames.layout],
                vertices: instances,
                topology: wgpu::PrimitiveTopology::TriangleStrip,
                mixing: Mixing {
                    blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                    writes_depth: false,
                },
                variant: &[],
                samples,
            },
        )?;
        let instances = GrowingBuffer::new("billboard instances", wgpu::BufferUsages::VERTEX);
        Ok(Self { frames, pipeline, instances })
    }

    /// Records the rectangles, given from back to front.
    pub(in crate::render) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        instances: &[Instance],
        frames: &mut ImageArray,
    ) {
        let textures = self.frames.bind(recording.gpu, frames);
        let vertices = self.instances.write(recording.gpu, instances);
        let mut pass = recording.draw(LABEL, into);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(1, &textures, &[]);
        pass.set_vertex_buffer(0, vertices.slice(..));
        pass.draw(0..4, 0..instances.len() as u32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_is_never_seen_narrower_than_half() {
        let right = DVec3::new(0.6, 0.8, 0.0);
        for degrees in 0..360 {
            let to_viewer =
                DQuat::from_rotation_z(f64::from(degrees).to_radians()) * DVec3::new(5.0, 0.0, 2.0);
            let turned = turned_towards(right, to_viewer);
            let seen = |along: DVec3| along.truncate().perp_dot(to_viewer.truncate().normalize()).abs();
            assert!((turned.length() - 1.0).abs() < 1e-9 && turned.dot(right) >= 0.866 - 1e-3);
            assert!(seen(turned) >= 0.5 - 1e-9, "{degrees}: {}", seen(turned));
            if seen(right) > 0.5 {
                assert!((turned - right).length() < 1e-9, "{degrees}");
            }
        }
        assert!(turned_towards(right, DVec3::Z).is_finite());
    }
}
