//! What every pass knows of the view and the cameras: bind group 0.

use crate::gpu::{Gpu, GrowingBuffer, mirror};
use glam::{DMat3, DMat4, DVec3, DVec4};
use std::sync::Arc;
use videofields_picture::plan::{self, Frustum, Projection};
use videofields_vision::geometry::{self, Distortion, NEAR_M};

/// Distance from the eye below which nothing is drawn, metres.
const VIEW_NEAR_M: f64 = 0.05;
/// Directions around the axis in which a lens's limit is tabulated: `N_LIMIT_DIRECTIONS` of common/camera.wgsl.
const N_LIMIT_DIRECTIONS: usize = 64;
/// Beyond this tangent (for fisheyes, angle) nothing is looked for.
const WIDEST_TANGENT: f64 = 1e4;
/// Most cameras of one frame, backgrounds and live frames together: the size of the uniform array.
pub(super) const MAX_CAMERAS: usize = 212;
/// Lenses whose tables are kept.
const MAX_LENSES: usize = 256;

mirror! { "common/view.wgsl",
/// The virtual camera.
pub(super) struct View {
    clip_from_anchor: [[f32; 4]; 4],
    right: [f32; 3],
    is_parallel: u32,
    down: [f32; 3],
    pad_down: u32,
    forward: [f32; 3],
    pad_forward: u32,
    eye_from_anchor: [f32; 3],
    pad_eye: u32,
}}

mirror! { "common/camera.wgsl",
/// One camera, relative to the anchor. The shader documents the fields.
pub(super) struct Camera {
    row_x: [f32; 4],
    row_y: [f32; 4],
    row_z: [f32; 4],
    position_from_anchor: [f32; 3],
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
    pub gain: [f32; 3],
    pad_gain: u32,
}}

/// What of the world a view's numbers must be good for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reach {
    /// What points are relative to: the eye, or where the scene begins for one far from it.
    pub anchor_in_world: DVec3,
    /// Least and greatest distance of the scene before the plane through the eye, metres.
    pub depths_m: [f64; 2],
}

impl View {
    /// The view as shaders know it; through parallel rays, or from an eye that is not the anchor, nothing nearer or
    /// further than the reach is shown.
    pub(super) fn new(view: &plan::View, reach: &Reach) -> Self {
        let world_from_view = DMat3::from_quat(view.pose.world_from_local);
        let anchor_from_eye = reach.anchor_in_world - view.pose.position_in_world;
        let view_from_world = world_from_view.transpose();
        let view_from_anchor =
            DMat4::from_translation(view_from_world * anchor_from_eye) * DMat4::from_mat3(view_from_world);
        let clip_from_anchor = clip_from_view(&view.frustum, depths_of(view, reach)) * view_from_anchor;
        let axis = |axis: DVec3| axis.as_vec3().to_array();
        Self {
            clip_from_anchor: clip_from_anchor.as_mat4().to_cols_array_2d(),
            right: axis(world_from_view.x_axis),
            is_parallel: u32::from(view.frustum.projection == Projection::Orthographic),
            down: axis(world_from_view.y_axis),
            pad_down: 0,
            forward: axis(world_from_view.z_axis),
            pad_forward: 0,
            eye_from_anchor: axis(-anchor_from_eye),
            pad_eye: 0,
        }
    }
}

/// Distances before the plane through the eye between which a view's depths run from 1 to 0, metres.
pub(super) fn depths_of(view: &plan::View, reach: &Reach) -> [f64; 2] {
    let [nearest_m, farthest_m] = reach.depths_m;
    match view.frustum.projection {
        Projection::Orthographic => [nearest_m.max(0.0), farthest_m],
        Projection::Perspective if reach.anchor_in_world == view.pose.position_in_world => {
            [VIEW_NEAR_M, f64::INFINITY]
        }
        // From far away, near over distance would be the same for all.
        Projection::Perspective => [nearest_m.max(VIEW_NEAR_M), farthest_m],
    }
}

fn clip_from_view(frustum: &Frustum, [nearest_m, farthest_m]: [f64; 2]) -> DMat4 {
    // Across the picture from -1 to 1: 2 / (last - first) and what moves the middle to 0.
    let scale_and_shift = |[first, last]: [f64; 2]| {
        let extent = last - first;
        (2.0 / extent, -(first + last) / extent)
    };
    let (scale_x, shift_x) = scale_and_shift(frustum.x);
    let (scale_y, shift_y) = scale_and_shift(frustum.y);
    let (x, y) = (DVec4::X * scale_x, DVec4::NEG_Y * scale_y);
    let shift = DVec4::new(shift_x, -shift_y, 0.0, 0.0);
    // Rows: x right, y up, reversed depth times w, w.
    match frustum.projection {
        // n (f / z - 1) / (f - n), which is n / z without an end.
        Projection::Perspective => {
            let falling = nearest_m / (farthest_m - nearest_m);
            let steady = nearest_m / (1.0 - nearest_m / farthest_m);
            DMat4::from_cols(x, y, shift + DVec4::W - DVec4::Z * falling, DVec4::Z * steady)
        }
        // (f - z) / (f - n).
        Projection::Orthographic => {
            let falling = 1.0 / (farthest_m - nearest_m);
            let steady = DVec4::Z * (falling * farthest_m);
            DMat4::from_cols(x, y, DVec4::NEG_Z * falling, shift + steady + DVec4::W)
        }
    }
}

impl Camera {
    fn new(camera: &geometry::Camera, anchor_in_world: DVec3, limit_offset: usize) -> Self {
        let camera_from_world = DMat3::from_quat(camera.pose().world_from_local).transpose();
        let position_from_anchor = camera.pose().position_in_world - anchor_in_world;
        let offset = camera_from_world * -position_from_anchor;
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
            position_from_anchor: position_from_anchor.as_vec3().to_array(),
            model,
            focal: (camera.focal_px() / size).as_vec2().to_array(),
            center: (camera.center_px() / size).as_vec2().to_array(),
            coefficients_low: low.map(|k| k as f32),
            coefficients_high: high.map(|k| k as f32),
            limit_offset: limit_offset as u32,
            gain: [1.0; 3],
            ..bytemuck::Zeroable::zeroed()
        }
    }

    /// Whether the lens bends what a pinhole shows.
    pub(super) const fn has_lens(&self) -> bool {
        self.model != 0
    }

    /// Whether its colours are multiplied by anything but 1.
    pub(super) fn has_gain(&self) -> bool {
        self.gain != [1.0; 3]
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
    /// Of the picture, and of another one that is drawn for it.
    views: [GrowingBuffer; 2],
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
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT | wgpu::ShaderStages::COMPUTE,
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
            views: [0, 1].map(|_| GrowingBuffer::new("view", wgpu::BufferUsages::UNIFORM)),
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
    pub(super) fn add(&mut self, camera: &Arc<geometry::Camera>, anchor_in_world: DVec3) -> &mut Camera {
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
        self.scratch.push(Camera::new(camera, anchor_in_world, offset));
        let last = self.scratch.len() - 1;
        &mut self.scratch[last]
    }

    /// Writes what is known of the cameras: once, for all pieces that are drawn with them.
    pub(super) fn write_cameras(&mut self, gpu: &Gpu) {
        // The shader's array is of fixed size: the buffer must be as large.
        self.scratch.resize(MAX_CAMERAS, bytemuck::Zeroable::zeroed());
        self.cameras.write(gpu, &self.scratch);
        self.limits.write(gpu, &self.scratch_limits);
    }

    /// Writes a piece's view and binds it with the cameras, which must have been written.
    pub(super) fn bind(&mut self, gpu: &Gpu, view: View) -> wgpu::BindGroup {
        self.bind_as(gpu, 0, view)
    }

    /// As [`Self::bind`], of another picture that is drawn for the piece.
    pub(super) fn bind_beside(&mut self, gpu: &Gpu, view: View) -> wgpu::BindGroup {
        self.bind_as(gpu, 1, view)
    }

    fn bind_as(&mut self, gpu: &Gpu, which: usize, view: View) -> wgpu::BindGroup {
        let written =
            |buffer: &GrowingBuffer| buffer.get().expect("cameras are written before they are bound").clone();
        let buffers =
            [self.views[which].write(gpu, &[view]).clone(), written(&self.cameras), written(&self.limits)];
        let entries: Vec<_> = (0..)
            .zip(&buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &self.layout,
            entries: &entries,
        })
    }
}
