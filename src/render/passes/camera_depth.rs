//! What hides surfaces from the cameras: a depth map for each camera that something may stand before.
//!
//! Maps are pinhole maps of the undistorted frustum: one face for usual lenses, a cube for wide ones. They hold no
//! picture, so they are kept until the scene or the camera changes.

use super::{Recording, picture_pass, read_entry, texture_entry};
use crate::RenderError;
use crate::camera_data::Camera;
use crate::gpu::{Gpu, GpuError, GrowingBuffer, TextureDescriptor, mirror};
use crate::mesh::MeshVertex;
use crate::targets::DEPTH_FORMAT;
use glam::{DMat3, DMat4, DVec2, DVec3, DVec4};
use std::sync::Arc;
use videofields_picture::scene::Scene;
use videofields_vision::geometry;

/// Nearest that anything hides, metres from the camera: `DEPTH_NEAR_M` of surface.wgsl.
const NEAR_M: f64 = 0.05;
/// Depth, and depth with discontinuities dilated.
const MAP_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Float;
/// Faces that are allocated at first.
const LEAST_FACES: u32 = 4;
/// Least cosine off the axis that one face covers; wider lenses get a cube.
const LEAST_COSINE: f64 = 0.35;

mirror! { "render/camera_depth.wgsl",
/// One face of a camera's depth map.
pub(super) struct Face {
    clip_from_camera: [[f32; 4]; 4],
}}

/// Rotations from camera axes to the axes of a cube's faces: forward, back, right, left, down, up. The selection in
/// surface.wgsl's `depth_place` is their counterpart.
const FACE_FROM_CAMERA: [[DVec3; 3]; 6] = [
    [DVec3::X, DVec3::Y, DVec3::Z],
    [DVec3::NEG_X, DVec3::Y, DVec3::NEG_Z],
    [DVec3::NEG_Z, DVec3::Y, DVec3::X],
    [DVec3::Z, DVec3::Y, DVec3::NEG_X],
    [DVec3::X, DVec3::NEG_Z, DVec3::Y],
    [DVec3::X, DVec3::Z, DVec3::NEG_Y],
];

/// Which maps exist, and where.
#[derive(Debug)]
pub(crate) struct DepthMaps {
    /// Texels of a map each way.
    side_px: u32,
    maps: Vec<DepthMap>,
    textures: Option<Textures>,
    frame: u64,
}

#[derive(Debug)]
struct DepthMap {
    scene: Arc<Scene>,
    camera: Arc<geometry::Camera>,
    /// Middle and half extent of the one face, tangents; of a cube's faces (0, 0, 1, 1).
    bounds: [f64; 4],
    layers: Vec<u32>,
    is_drawn: bool,
    last_used: u64,
}

#[derive(Debug)]
struct Textures {
    scratch: wgpu::TextureView,
    maps: wgpu::TextureView,
    layers: Vec<wgpu::TextureView>,
}

impl DepthMaps {
    /// No maps yet; each will have `side_px` texels each way.
    pub(crate) const fn new(side_px: u32) -> Self {
        Self { side_px, maps: Vec::new(), textures: None, frame: 0 }
    }

    /// Texels of a map each way.
    pub(crate) const fn side_px(&self) -> u32 {
        self.side_px
    }

    /// Reserves a map for every camera and tells `data`, in the same order, where it will be.
    ///
    /// # Errors
    /// When the device has too few layers.
    pub(crate) fn assign(
        &mut self,
        gpu: &Gpu,
        scene: &Arc<Scene>,
        cameras: &[(Arc<geometry::Camera>, usize)],
        data: &mut [Camera],
    ) -> Result<(), RenderError> {
        self.frame += 1;
        let mut needed = 0;
        for (camera, _) in cameras {
            needed += self.touch(scene, camera);
        }
        self.make_room(gpu, needed)?;
        for (camera, idx) in cameras {
            let map = self.find_or_add(scene, camera);
            let layer = |face: usize| map.layers.get(face).copied().unwrap_or(0);
            let data = &mut data[*idx];
            data.n_depth_faces = map.layers.len() as u32;
            data.depth_bounds = map.bounds.map(|bound| bound as f32);
            data.depth_layers_low = [layer(0), layer(1), layer(2), layer(3)];
            data.depth_layers_high = [layer(4), layer(5), 0, 0];
        }
        Ok(())
    }

    /// All maps, for the surfaces' bind group; none where none was ever needed.
    pub(crate) fn view(&self) -> Option<&wgpu::TextureView> {
        self.textures.as_ref().map(|textures| &textures.maps)
    }

    /// Forgets all maps.
    pub(crate) fn clear(&mut self) {
        self.maps.clear();
        self.textures = None;
    }

    /// Whether a camera's map is there.
    pub(crate) fn has(&self, scene: &Arc<Scene>, camera: &Arc<geometry::Camera>) -> bool {
        self.position(scene, camera).is_some_and(|idx| self.maps[idx].is_drawn)
    }

    /// Whether a map waits to be drawn.
    pub(crate) fn has_jobs(&self) -> bool {
        self.maps.iter().any(|map| !map.is_drawn)
    }

    fn position(&self, scene: &Arc<Scene>, camera: &Arc<geometry::Camera>) -> Option<usize> {
        self.maps.iter().position(|map| {
            (Arc::ptr_eq(&map.camera, camera) || map.camera == *camera)
                && (Arc::ptr_eq(&map.scene, scene) || map.scene.surfaces == scene.surfaces)
        })
    }

    /// Marks a camera's map as used in this frame, and says how many faces it has or will have.
    fn touch(&mut self, scene: &Arc<Scene>, camera: &Arc<geometry::Camera>) -> u32 {
        match self.position(scene, camera) {
            Some(idx) => {
                self.maps[idx].last_used = self.frame;
                self.maps[idx].layers.len() as u32
            }
            None if single_face_bounds(camera).is_some() => 1,
            None => 6,
        }
    }

    fn make_room(&mut self, gpu: &Gpu, needed: u32) -> Result<(), RenderError> {
        let available = self.textures.as_ref().map_or(0, |textures| textures.layers.len() as u32);
        if needed <= available {
            return Ok(());
        }
        let n_faces = needed.next_power_of_two().max(LEAST_FACES);
        let limit = gpu.limits().max_texture_array_layers;
        if n_faces > limit {
            let (needed, limit) = (u64::from(n_faces), u64::from(limit));
            return Err(RenderError::TooMany { what: "faces of depth maps", needed, limit });
        }
        self.clear();
        self.textures = Some(Textures::new(gpu, n_faces, self.side_px));
        Ok(())
    }

    fn find_or_add(&mut self, scene: &Arc<Scene>, camera: &Arc<geometry::Camera>) -> &DepthMap {
        let idx = self.position(scene, camera).unwrap_or_else(|| {
            let bounds = single_face_bounds(camera);
            let n_faces = if bounds.is_some() { 1 } else { 6 };
            let layers = self.take_layers(n_faces);
            self.maps.push(DepthMap {
                scene: Arc::clone(scene),
                camera: Arc::clone(camera),
                bounds: bounds.unwrap_or([0.0, 0.0, 1.0, 1.0]),
                layers,
                is_drawn: false,
                last_used: self.frame,
            });
            self.maps.len() - 1
        });
        &self.maps[idx]
    }

    /// Free layers; maps that were not used for longest make room.
    fn take_layers(&mut self, n_faces: usize) -> Vec<u32> {
        let n_layers = self.textures.as_ref().map_or(0, |textures| textures.layers.len() as u32);
        loop {
            let is_free = |layer: &u32| !self.maps.iter().any(|map| map.layers.contains(layer));
            let free: Vec<u32> = (0..n_layers).filter(is_free).take(n_faces).collect();
            let oldest = self.maps.iter().enumerate().min_by_key(|(_, map)| map.last_used);
            match oldest {
                Some((oldest, map)) if free.len() < n_faces && map.last_used < self.frame => {
                    self.maps.swap_remove(oldest);
                }
                // `make_room` has seen to it that the frame's own maps fit.
                _ => return free,
            }
        }
    }
}

impl Textures {
    fn new(gpu: &Gpu, n_faces: u32, side: u32) -> Self {
        let texture = |label, format, layers| {
            gpu.texture(&TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            })
        };
        let maps = texture("camera_depth maps", MAP_FORMAT, n_faces);
        let layer = |base_array_layer| {
            maps.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer,
                array_layer_count: Some(1),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        Self {
            scratch: texture("camera_depth", DEPTH_FORMAT, 1)
                .create_view(&wgpu::TextureViewDescriptor::default()),
            layers: (0..n_faces).map(layer).collect(),
            maps: maps.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2Array),
                ..wgpu::TextureViewDescriptor::default()
            }),
        }
    }
}

/// Middle and half extent (tangents) of what the camera sees, where one pinhole face covers it.
pub(crate) fn single_face_bounds(camera: &geometry::Camera) -> Option<[f64; 4]> {
    const STEPS: u32 = 24;
    let camera_from_world = camera.pose().world_from_local.inverse();
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for row in 0..=STEPS {
        for column in 0..=STEPS {
            let place = DVec2::new(f64::from(column), f64::from(row)) / f64::from(STEPS);
            // Where the lens brings no light there is nothing to hide.
            let Some(ray) = camera.ray(place) else { continue };
            let local = camera_from_world * ray.direction;
            if local.z < LEAST_COSINE {
                return None;
            }
            let tangent = local.truncate() / local.z;
            (low, high) = (low.min(tangent), high.max(tangent));
        }
    }
    // Between samples a distorted border bulges by less than this.
    let half = (high - low) * 0.5 * 1.03 + 1e-3;
    let middle = (high + low) * 0.5;
    half.is_finite().then_some([middle.x, middle.y, half.x, half.y])
}

/// Draws depth maps.
#[derive(Debug)]
pub(crate) struct CameraDepthPass {
    faces_layout: wgpu::BindGroupLayout,
    depth_layout: wgpu::BindGroupLayout,
    draw: wgpu::RenderPipeline,
    dilate: wgpu::RenderPipeline,
    faces: GrowingBuffer,
    vertices: GrowingBuffer,
}

const LABEL: &str = "camera_depth";

impl CameraDepthPass {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let device = &gpu.device;
        let faces_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("camera_depth faces"),
            entries: &[read_entry(0, wgpu::ShaderStages::VERTEX)],
        });
        let depth_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[texture_entry(0, wgpu::TextureViewDimension::D2, wgpu::TextureSampleType::Depth)],
        });
        let module = gpu.shader("render/camera_depth.wgsl")?;
        let layout = |groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(LABEL),
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let vertex = |entry_point, buffers| wgpu::VertexState {
            module: &module,
            entry_point: Some(entry_point),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers,
        };
        let positions = [Some(wgpu::VertexBufferLayout {
            array_stride: 12,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Float32x3],
        })];
        let draw = gpu.pipeline(
            LABEL,
            &wgpu::RenderPipelineDescriptor {
                label: Some(LABEL),
                layout: Some(&layout(&[None, Some(&faces_layout)])),
                vertex: vertex("vs_main", &positions),
                // Only what faces the camera hides: a camera mounted just inside a wall is not blinded by it.
                primitive: wgpu::PrimitiveState {
                    cull_mode: Some(wgpu::Face::Back),
                    ..wgpu::PrimitiveState::default()
                },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH_FORMAT,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::GreaterEqual),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: None,
                multiview_mask: None,
                cache: None,
            },
        );
        let dilate = gpu.pipeline(
            LABEL,
            &wgpu::RenderPipelineDescriptor {
                label: Some(LABEL),
                layout: Some(&layout(&[None, None, Some(&depth_layout)])),
                vertex: vertex("vs_dilate", &[]),
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: None,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("fs_dilate"),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    targets: &[Some(wgpu::ColorTargetState::from(MAP_FORMAT))],
                }),
                multiview_mask: None,
                cache: None,
            },
        );
        let faces = GrowingBuffer::new("camera_depth faces", wgpu::BufferUsages::STORAGE);
        let vertices = GrowingBuffer::new("camera_depth vertices", wgpu::BufferUsages::VERTEX);
        Ok(Self { faces_layout, depth_layout, draw, dilate, faces, vertices })
    }

    /// Records the maps that wait to be drawn. `mesh` is the scene's.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        maps: &mut DepthMaps,
        mesh: &[MeshVertex],
    ) {
        let gpu = recording.gpu;
        let Some(textures) = &maps.textures else { return };
        let mut faces = Vec::new();
        let mut vertices: Vec<[f32; 3]> = Vec::new();
        // (layer, index of its camera among those drawn)
        let mut jobs = Vec::new();
        for map in maps.maps.iter_mut().filter(|map| !map.is_drawn) {
            map.is_drawn = true;
            let camera_idx = vertices.len() / mesh.len().max(1);
            let position = map.camera.pose().position_in_world;
            vertices.extend(mesh.iter().map(|v| (v.position_in_world - position).as_vec3().to_array()));
            for (face, layer) in map.layers.iter().enumerate() {
                faces.push(face_data(&map.camera, map.bounds, face));
                jobs.push((*layer, camera_idx as u32));
            }
        }
        let n_jobs = jobs.len();
        let depth = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.depth_layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(&textures.scratch),
            }],
        });
        let face_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("camera_depth faces"),
            layout: &self.faces_layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: self.faces.write(gpu, &faces).as_entire_binding(),
            }],
        });
        let vertices = self.vertices.write(gpu, &vertices);
        let n_vertices = mesh.len() as u32;
        let span = recording.timer.span(LABEL);
        for (idx, (layer, camera_idx)) in jobs.into_iter().enumerate() {
            let mut pass = gpu.begin_pass(
                recording.encoder,
                LABEL,
                &wgpu::RenderPassDescriptor {
                    label: Some(LABEL),
                    color_attachments: &[],
                    depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                        view: &textures.scratch,
                        depth_ops: Some(wgpu::Operations {
                            load: wgpu::LoadOp::Clear(0.0),
                            store: wgpu::StoreOp::Store,
                        }),
                        stencil_ops: None,
                    }),
                    timestamp_writes: recording.timer.writes(span, 2 * idx, 2 * n_jobs),
                    occlusion_query_set: None,
                    multiview_mask: None,
                },
            );
            pass.set_pipeline(&self.draw);
            pass.set_bind_group(1, &face_group, &[]);
            pass.set_vertex_buffer(0, vertices.slice(..));
            let first = camera_idx * n_vertices;
            pass.draw(first..first + n_vertices, idx as u32..idx as u32 + 1);
            drop(pass);
            let writes = recording.timer.writes(span, 2 * idx + 1, 2 * n_jobs);
            let mut pass =
                picture_pass(gpu, recording.encoder, LABEL, (&textures.layers[layer as usize], writes));
            pass.set_pipeline(&self.dilate);
            pass.set_bind_group(2, &depth, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}

fn face_data(camera: &geometry::Camera, bounds: [f64; 4], face: usize) -> Face {
    let [middle_x, middle_y, half_x, half_y] = bounds;
    let [x, y, z] = FACE_FROM_CAMERA[face];
    let face_from_camera = DMat3::from_cols(x, y, z).transpose();
    let camera_from_world = DMat3::from_quat(camera.pose().world_from_local).transpose();
    let clip_from_face = DMat4::from_cols(
        DVec4::new(1.0 / half_x, 0.0, 0.0, 0.0),
        DVec4::new(0.0, -1.0 / half_y, 0.0, 0.0),
        DVec4::new(-middle_x / half_x, middle_y / half_y, 0.0, 1.0),
        DVec4::new(0.0, 0.0, NEAR_M, 0.0),
    );
    let clip_from_camera = clip_from_face * DMat4::from_mat3(face_from_camera * camera_from_world);
    Face { clip_from_camera: clip_from_camera.as_mat4().to_cols_array_2d() }
}
