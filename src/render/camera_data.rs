//! What every pass knows of the view and the cameras: bind group 0.

use crate::geometry::{self, Distortion, NEAR_M};
use crate::gpu::{Gpu, GrowingBuffer, mirror};
use crate::plan;
use glam::{DMat3, DVec3, Mat4, Vec4};
use std::sync::Arc;

/// Distance from the eye below which nothing is drawn, metres.
const VIEW_NEAR_M: f64 = 0.05;
/// Directions around the axis in which a lens's limit is tabulated: `N_LIMIT_DIRECTIONS` of common/camera.wgsl.
const N_LIMIT_DIRECTIONS: usize = 64;
/// Beyond this tangent (for fisheyes, angle) nothing is looked for.
const WIDEST_TANGENT: f64 = 1e4;
/// Most cameras of one frame, backgrounds and live frames together: the size of the uniform array.
pub(super) const MAX_CAMERAS: usize = 128;
/// Lenses whose tables are kept.
const MAX_LENSES: usize = 256;

mirror! { "common/view.wgsl",
/// The virtual camera.
pub(super) struct View {
    clip_from_eye: [[f32; 4]; 4],
    right: [f32; 3],
    pad_right: u32,
    down: [f32; 3],
    pad_down: u32,
}}

mirror! { "common/camera.wgsl",
/// One camera, relative to the eye. The shader documents the fields.
pub(super) struct Camera {
    row_x: [f32; 4],
    row_y: [f32; 4],
    row_z: [f32; 4],
    position_from_eye: [f32; 3],
    model: u32,
    focal: [f32; 2],
    center: [f32; 2],
    coefficients_low: [f32; 4],
    coefficients_high: [f32; 4],
    pub background_scale: [f32; 2],
    pub frame_scale: [f32; 2],
    pub background_size_px: [f32; 2],
    pub frame_size_px: [f32; 2],
    pub background_layer: u32,
    pub frame_layer: u32,
    limit_offset: u32,
    pub n_depth_faces: u32,
    pub depth_bounds: [f32; 4],
    pub depth_layers_low: [u32; 4],
    pub depth_layers_high: [u32; 4],
}}

impl View {
    pub(super) fn new(view: &plan::View) -> Self {
        let world_from_view = DMat3::from_quat(view.pose.world_from_local);
        let [tan_x, tan_y] = view.half_tangents();
        // Rows: x right, y up, near over distance (reversed, the far plane at infinity), distance.
        let clip_from_view = Mat4::from_cols(
            Vec4::new((1.0 / tan_x) as f32, 0.0, 0.0, 0.0),
            Vec4::new(0.0, (-1.0 / tan_y) as f32, 0.0, 0.0),
            Vec4::new(0.0, 0.0, 0.0, 1.0),
            Vec4::new(0.0, 0.0, VIEW_NEAR_M as f32, 0.0),
        );
        let view_from_eye = Mat4::from_mat3(world_from_view.transpose().as_mat3());
        Self {
            clip_from_eye: (clip_from_view * view_from_eye).to_cols_array_2d(),
            right: world_from_view.x_axis.as_vec3().to_array(),
            pad_right: 0,
            down: world_from_view.y_axis.as_vec3().to_array(),
            pad_down: 0,
        }
    }
}

impl Camera {
    fn new(camera: &geometry::Camera, eye_in_world: DVec3, limit_offset: usize) -> Self {
        let camera_from_world = DMat3::from_quat(camera.pose().world_from_local).transpose();
        let position_from_eye = camera.pose().position_in_world - eye_in_world;
        let offset = camera_from_world * -position_from_eye;
        let row = |axis: usize| camera_from_world.row(axis).extend(offset[axis]).as_vec4().to_array();
        let (width, height) = camera.size_px();
        let size = glam::DVec2::new(f64::from(width), f64::from(height));
        let (model, low, high) = match camera.distortion() {
            Distortion::None => (0, [0.0; 4], [0.0; 4]),
            Distortion::BrownConrady { coefficients: [k1, k2, p1, p2, k3, k4, k5, k6] } => {
                (1, [*k1, *k2, *p1, *p2], [*k3, *k4, *k5, *k6])
            }
            Distortion::Fisheye { coefficients } => (2, *coefficients, [0.0; 4]),
        };
        Self {
            row_x: row(0),
            row_y: row(1),
            row_z: row(2),
            position_from_eye: position_from_eye.as_vec3().to_array(),
            model,
            focal: (camera.focal_px() / size).as_vec2().to_array(),
            center: (camera.center_px() / size).as_vec2().to_array(),
            coefficients_low: low.map(|k| k as f32),
            coefficients_high: high.map(|k| k as f32),
            limit_offset: limit_offset as u32,
            ..bytemuck::Zeroable::zeroed()
        }
    }

    /// Whether the lens bends what a pinhole shows.
    pub(super) const fn has_lens(&self) -> bool {
        self.model != 0
    }
}

/// Where a lens's picture ends, in every tabulated direction around the axis: the tangent of the angle off the axis
/// (the angle itself for fisheyes) up to which the camera model gives a texture coordinate.
///
/// It is found by bisection through the camera model itself, so that shader and model reject the same points,
/// whatever made the model reject them.
fn lens_limits(camera: &geometry::Camera) -> Vec<f32> {
    let is_fisheye = matches!(camera.distortion(), Distortion::Fisheye { .. });
    let is_seen = |direction: f64, reach: f64| {
        let (sin, cos) = direction.sin_cos();
        let (radius, z) = if is_fisheye { reach.sin_cos() } else { (reach, 1.0) };
        // Far from the near plane, so that only the lens decides.
        camera.project_local(DVec3::new(cos * radius, sin * radius, z) * (1e3 * NEAR_M.max(1.0))).is_some()
    };
    let widest = if is_fisheye { std::f64::consts::PI } else { WIDEST_TANGENT };
    (0..N_LIMIT_DIRECTIONS)
        .map(|step| {
            let direction = std::f64::consts::TAU * step as f64 / N_LIMIT_DIRECTIONS as f64;
            if is_seen(direction, widest) {
                return widest as f32;
            }
            let (mut seen, mut unseen) = (0.0, widest);
            for _ in 0..48 {
                let middle = 0.5 * (seen + unseen);
                *(if is_seen(direction, middle) { &mut seen } else { &mut unseen }) = middle;
            }
            seen as f32
        })
        .collect()
}

/// Bind group 0 with its buffers, written anew every frame.
#[derive(Debug)]
pub(super) struct FrameData {
    layout: wgpu::BindGroupLayout,
    view: GrowingBuffer,
    cameras: GrowingBuffer,
    limits: GrowingBuffer,
    /// The cameras of the frame, in the order in which shaders count them.
    pub scratch: Vec<Camera>,
    scratch_limits: Vec<f32>,
    lenses: Vec<(Arc<geometry::Camera>, Vec<f32>)>,
}

impl FrameData {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let uniform = wgpu::BufferBindingType::Uniform;
        let storage = wgpu::BufferBindingType::Storage { read_only: true };
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("frame"),
            entries: &[entry(0, uniform), entry(1, uniform), entry(2, storage)],
        });
        Self {
            layout,
            view: GrowingBuffer::new("view", wgpu::BufferUsages::UNIFORM),
            cameras: GrowingBuffer::new("cameras", wgpu::BufferUsages::UNIFORM),
            limits: GrowingBuffer::new("lens limits", wgpu::BufferUsages::STORAGE),
            scratch: Vec::new(),
            scratch_limits: Vec::new(),
            lenses: Vec::new(),
        }
    }

    /// Layout of bind group 0.
    pub(super) const fn layout(&self) -> &wgpu::BindGroupLayout {
        &self.layout
    }

    /// Begins a frame without cameras.
    pub(super) fn clear(&mut self) {
        self.scratch.clear();
        self.scratch_limits.clear();
    }

    /// Adds a camera; what the images' arrays and the depth maps know of it is the caller's to fill in.
    pub(super) fn add(&mut self, camera: &Arc<geometry::Camera>, eye_in_world: DVec3) -> &mut Camera {
        let offset = self.scratch_limits.len();
        if !matches!(camera.distortion(), Distortion::None) {
            let known = self.lenses.iter().position(|(lens, _)| Arc::ptr_eq(lens, camera));
            let lens = known.unwrap_or_else(|| {
                self.lenses.truncate(MAX_LENSES - 1);
                self.lenses.insert(0, (Arc::clone(camera), lens_limits(camera)));
                0
            });
            self.scratch_limits.extend_from_slice(&self.lenses[lens].1);
        }
        self.scratch.push(Camera::new(camera, eye_in_world, offset));
        let last = self.scratch.len() - 1;
        &mut self.scratch[last]
    }

    /// Writes the frame's data and binds it.
    pub(super) fn bind(&mut self, gpu: &Gpu, view: View) -> wgpu::BindGroup {
        // The shader's array is of fixed size: the buffer must be as large.
        self.scratch.resize(MAX_CAMERAS, bytemuck::Zeroable::zeroed());
        let resource = wgpu::Buffer::as_entire_binding;
        let entries = [
            wgpu::BindGroupEntry { binding: 0, resource: resource(self.view.write(gpu, &[view])) },
            wgpu::BindGroupEntry { binding: 1, resource: resource(self.cameras.write(gpu, &self.scratch)) },
            wgpu::BindGroupEntry {
                binding: 2,
                resource: resource(self.limits.write(gpu, &self.scratch_limits)),
            },
        ];
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &self.layout,
            entries: &entries,
        })
    }
}
