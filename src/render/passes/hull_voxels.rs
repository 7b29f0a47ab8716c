//! Surfaces of hulls by their outermost voxels, a square each.

use super::hull_rays::{HullSurface, SURFACE_FORMAT};
use super::hull_trim::{Drawn, strips_pipeline, surface_pass};
use super::{Attributes, Recording};
use crate::gpu::{Gpu, GpuError, GrowingBuffer};
use crate::hull_data::HullData;
use glam::{DVec3, Vec2, Vec3};
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::Plan;

const LABEL: &str = "hull_voxels";

/// One voxel. The shader documents the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct Instance {
    voxel: [f32; 4],
    more: [u32; 2],
}

const ATTRIBUTES: Attributes<2> = wgpu::vertex_attr_array![0 => Float32x4, 1 => Uint32x2];

/// Draws voxels.
#[derive(Debug)]
pub(crate) struct HullVoxelsPass {
    pipeline: wgpu::RenderPipeline,
    instances: GrowingBuffer,
    scratch: Vec<Instance>,
    depth: Option<wgpu::Texture>,
}

impl HullVoxelsPass {
    pub(crate) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        hulls: &HullData,
    ) -> Result<Self, GpuError> {
        let layout = wgpu::VertexBufferLayout {
            array_stride: size_of::<Instance>() as u64,
            step_mode: wgpu::VertexStepMode::Instance,
            attributes: &ATTRIBUTES,
        };
        let pipeline = strips_pipeline(gpu, LABEL, (frame_layout, hulls), (layout, Some(SURFACE_FORMAT)))?;
        let instances = GrowingBuffer::new("hull voxels", wgpu::BufferUsages::VERTEX);
        Ok(Self { pipeline, instances, scratch: Vec::new(), depth: None })
    }

    /// What it tests depths with.
    pub(crate) const fn depth(&mut self) -> &mut Option<wgpu::Texture> {
        &mut self.depth
    }

    /// Records that `surface` gets the nearest voxels of the plan's hulls.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        (frame, group): (&wgpu::BindGroup, &wgpu::BindGroup),
        (state, plan, anchor): (&SceneState, &Plan, DVec3),
        surface: &HullSurface,
    ) {
        self.scratch.clear();
        for (hull_idx, hull) in plan.hulls.iter().enumerate() {
            let Some(shell) = &state.hulls[*hull].shell else { continue };
            self.scratch.extend(shell.voxels.iter().map(|(place, normal)| Instance {
                voxel: (*place - anchor).as_vec3().extend(shell.step_m as f32).to_array(),
                more: [hull_idx as u32, packed(*normal)],
            }));
        }
        let instances = self.instances.write(recording.gpu, &self.scratch);
        let drawn =
            Drawn { pipeline: &self.pipeline, vertices: instances, n_instances: self.scratch.len() as u32 };
        surface_pass(recording, LABEL, (frame, group), (surface, &mut self.depth), &drawn);
    }
}

/// As `octahedral` of common/hull.wgsl, in two signed numbers of 16 bits.
fn packed(v: Vec3) -> u32 {
    let p = v.truncate() / (v.x.abs() + v.y.abs() + v.z.abs()).max(1e-30);
    let sign = |of: f32| if of >= 0.0 { 1.0 } else { -1.0 };
    let folded = Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y));
    let p = if v.z < 0.0 { folded } else { p };
    let bits = |of: f32| u32::from(((of.clamp(-1.0, 1.0) * 32767.0).round() as i16) as u16);
    bits(p.x) | bits(p.y) << 16
}
