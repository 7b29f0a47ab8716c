//! Shading of surfaces by fragments and by threads that compute: the same arithmetic, into targets of the same format.

use super::load::Load;
use super::timed::Times;
use super::{Found, Stage};
use anyhow::Result;
use glam::{Mat4, Vec3, Vec4};
use std::f32::consts::TAU;
use videofields_render::gpu::{Gpu, TextureDescriptor, Timer};
use videofields_vision::clock::Clock as _;

/// Columns and rows of the cameras' pictures.
const SEEN_PX: (u32, u32) = (1280, 720);

/// Most cameras that the shader holds.
const MOST_CAMERAS: usize = 8;

/// Most pictures that are drawn of each case.
const MOST_TURNS: u32 = 101;

/// `Camera` of shaders/lab/shading.wgsl.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Seen {
    clip_from_world: [f32; 16],
    position: [f32; 4],
}

/// `Scene` of shaders/lab/shading.wgsl.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Scene {
    eye: [f32; 4],
    forward: [f32; 4],
    right: [f32; 4],
    up: [f32; 4],
    size_px: [u32; 2],
    n_cameras: u32,
    padding: u32,
    cameras: [Seen; MOST_CAMERAS],
}

/// Returns ground seen from 12 m above it, under cameras that stand in a ring and look at its middle.
fn scene(size_px: (u32, u32), n_cameras: usize) -> Scene {
    let eye = Vec3::new(0.0, -14.0, 12.0);
    let forward = (Vec3::ZERO - eye).normalize();
    let right = forward.cross(Vec3::Z).normalize();
    let half = 0.4_f32.tan();
    let aspect = size_px.0 as f32 / size_px.1 as f32;
    let seen = |idx: usize| {
        let angle = TAU * idx as f32 / n_cameras as f32;
        let position = Vec3::new(10.0 * angle.cos(), 10.0 * angle.sin(), 9.0);
        let forward = -position.normalize();
        let right = forward.cross(Vec3::Z).normalize();
        // Places in the picture, and the distance that they are divided by; nobody asks for depths.
        let focal = 1.2;
        let rows = [
            right * focal * SEEN_PX.1 as f32 / SEEN_PX.0 as f32,
            right.cross(forward) * focal,
            Vec3::ZERO,
            forward,
        ];
        let clip =
            Mat4::from_cols_array_2d(&rows.map(|row| row.extend(-row.dot(position)).to_array())).transpose();
        Seen { clip_from_world: clip.to_cols_array(), position: position.extend(1.0).to_array() }
    };
    let direction = |of: Vec3| Vec4::from((of, 0.0)).to_array();
    Scene {
        eye: eye.extend(1.0).to_array(),
        forward: direction(forward),
        right: direction(right * half * aspect),
        up: direction(right.cross(forward) * half),
        size_px: [size_px.0, size_px.1],
        n_cameras: n_cameras as u32,
        padding: 0,
        cameras: std::array::from_fn(seen),
    }
}

/// Ways of shading: name, entry point, pixels of a group each way; none for fragments.
const WAYS: [(&str, &str, Option<[u32; 2]>); 3] = [
    ("fragments", "fs_main", None),
    ("compute, groups of 8 x 8", "cs_tiles", Some([8, 8])),
    ("compute, groups of 64 x 1", "cs_rows", Some([64, 1])),
];

/// Holds the textures and the shader that every way of shading shares.
struct Shading<'a> {
    gpu: &'a Gpu,
    size_px: (u32, u32),
    pictures: wgpu::TextureView,
    drawn: wgpu::TextureView,
    sampler: wgpu::Sampler,
    module: wgpu::ShaderModule,
}

enum Pipeline {
    Fragments(wgpu::RenderPipeline),
    Groups(wgpu::ComputePipeline, [u32; 2]),
}

impl<'a> Shading<'a> {
    fn new(gpu: &'a Gpu, size_px: (u32, u32)) -> Self {
        let texture = |label, (width, height), layers, usage| {
            gpu.texture(&TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba8Unorm,
                usage,
                view_formats: &[],
            })
        };
        use wgpu::TextureUsages as Usages;
        let seen = texture(
            "shading pictures",
            SEEN_PX,
            MOST_CAMERAS as u32,
            Usages::TEXTURE_BINDING | Usages::COPY_DST,
        );
        let row_bytes = SEEN_PX.0 * 4;
        let texels: Vec<u8> = (0..row_bytes * SEEN_PX.1 * MOST_CAMERAS as u32)
            .map(|idx| (idx.wrapping_mul(2_654_435_761) >> 24) as u8)
            .collect();
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(row_bytes),
            rows_per_image: Some(SEEN_PX.1),
        };
        gpu.upload("shading pictures", seen.as_image_copy(), (&texels, layout), seen.size());
        let drawn = texture("shading drawn", size_px, 1, Usages::STORAGE_BINDING | Usages::RENDER_ATTACHMENT);
        Self {
            gpu,
            size_px,
            pictures: seen.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2Array),
                ..wgpu::TextureViewDescriptor::default()
            }),
            drawn: drawn.create_view(&wgpu::TextureViewDescriptor::default()),
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..wgpu::SamplerDescriptor::default()
            }),
            module: gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("lab/shading.wgsl"),
                source: wgpu::ShaderSource::Wgsl(include_str!("../../../shaders/lab/shading.wgsl").into()),
            }),
        }
    }

    fn pipeline(&self, entry_point: &'static str, group: Option<[u32; 2]>) -> Pipeline {
        let compilation_options = wgpu::PipelineCompilationOptions::default();
        match group {
            Some(group) => {
                let descriptor = wgpu::ComputePipelineDescriptor {
                    label: Some("shading"),
                    layout: None,
                    module: &self.module,
                    entry_point: Some(entry_point),
                    compilation_options,
                    cache: None,
                };
                Pipeline::Groups(self.gpu.compute_pipeline("shading", &descriptor), group)
            }
            None => {
                let descriptor = wgpu::RenderPipelineDescriptor {
                    label: Some("shading"),
                    layout: None,
                    vertex: wgpu::VertexState {
                        module: &self.module,
                        entry_point: Some("vs_main"),
                        compilation_options: compilation_options.clone(),
                        buffers: &[],
                    },
                    primitive: wgpu::PrimitiveState::default(),
                    depth_stencil: None,
                    multisample: wgpu::MultisampleState::default(),
                    fragment: Some(wgpu::FragmentState {
                        module: &self.module,
                        entry_point: Some(entry_point),
                        compilation_options,
                        targets: &[Some(wgpu::TextureFormat::Rgba8Unorm.into())],
                    }),
                    multiview_mask: None,
                    cache: None,
                };
                Pipeline::Fragments(self.gpu.pipeline("shading", &descriptor))
            }
        }
    }

    fn bind(&self, pipeline: &Pipeline, n_cameras: usize) -> wgpu::BindGroup {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let buffer = self.gpu.buffer("shading scene", size_of::<Scene>() as u64, usage);
        self.gpu.queue.write_buffer(&buffer, 0, bytemuck::bytes_of(&scene(self.size_px, n_cameras)));
        let mut resources = vec![
            buffer.as_entire_binding(),
            wgpu::BindingResource::TextureView(&self.pictures),
            wgpu::BindingResource::Sampler(&self.sampler),
        ];
        let layout = match pipeline {
            Pipeline::Fragments(pipeline) => pipeline.get_bind_group_layout(0),
            Pipeline::Groups(pipeline, _) => {
                resources.push(wgpu::BindingResource::TextureView(&self.drawn));
                pipeline.get_bind_group_layout(0)
            }
        };
        let entries: Vec<_> = (0..)
            .zip(resources)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        let descriptor =
            wgpu::BindGroupDescriptor { label: Some("shading"), layout: &layout, entries: &entries };
        self.gpu.device.create_bind_group(&descriptor)
    }

    fn run(&self, timer: &mut Timer, (pipeline, group): (&Pipeline, &wgpu::BindGroup)) -> Result<()> {
        let gpu = self.gpu;
        timer.begin_frame();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let span = timer.span("shading");
        match pipeline {
            Pipeline::Fragments(pipeline) => {
                let attachment = wgpu::RenderPassColorAttachment {
                    view: &self.drawn,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                };
                let descriptor = wgpu::RenderPassDescriptor {
                    label: Some("shading"),
                    color_attachments: &[Some(attachment)],
                    timestamp_writes: timer.writes(span, 0, 1),
                    ..wgpu::RenderPassDescriptor::default()
                };
                let mut pass = gpu.begin_pass(&mut encoder, "shading", &descriptor);
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, group, &[]);
                pass.draw(0..3, 0..1);
            }
            Pipeline::Groups(pipeline, [width, height]) => {
                let mut pass = gpu.begin_compute_pass(&mut encoder, "shading", timer.compute_writes(span));
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, group, &[]);
                pass.dispatch_workgroups(
                    self.size_px.0.div_ceil(*width),
                    self.size_px.1.div_ceil(*height),
                    1,
                );
            }
        }
        timer.resolve(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        Ok(gpu.finish()?)
    }
}

/// Measures ground under three and eight cameras, shaded in every way.
pub(super) fn measure(stage: &Stage<'_>) -> Result<Found> {
    let gpu = stage.gpu()?;
    let size_px = if stage.is_small { (640, 360) } else { (2560, 1440) };
    let shading = Shading::new(&gpu, size_px);
    let mut timer = Timer::new(&gpu);
    let load = Load::new(&gpu);
    let clock = stage.budget.clock;
    let mut found = Found::default();
    let cases: Vec<_> = [3, 8].into_iter().flat_map(|n| WAYS.map(|way| (n, way))).collect();
    for (idx, (n_cameras, (name, entry_point, group))) in cases.iter().enumerate() {
        let own = stage.budget.share(1.0 / (cases.len() - idx) as f64);
        let pipeline = shading.pipeline(entry_point, *group);
        let bound = shading.bind(&pipeline, *n_cameras);
        let mut times = Times::default();
        load.first(&gpu, stage)?;
        for turn in 0..=MOST_TURNS {
            if turn > 1 && own.is_over() {
                break;
            }
            let before = gpu.counts();
            let begun = clock.monotonic();
            shading.run(&mut timer, (&pipeline, &bound))?;
            let whole = clock.monotonic().saturating_sub(begun);
            if turn > 0 {
                times.add(&timer.read(&gpu)?, whole);
                times.count(&before, &gpu.counts());
            }
        }
        found.is_cut_short |= times.is_short();
        found.measurements.extend(times.measurement(format!("{n_cameras} cameras, {name}"), None));
    }
    found.memory_bytes = gpu.memory_bytes();
    found.notes.push(format!(
        "Ground in {} x {} pixels under cameras of {} x {}, without depth maps and people: the surfaces' arithmetic alone, which product \
         pictures shade by fragments.",
        size_px.0, size_px.1, SEEN_PX.0, SEEN_PX.1
    ));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn the_middle_of_the_picture_is_the_middle_of_the_ground_and_every_camera_sees_it() {
        let scene = scene((640, 360), 8);
        let [eye, forward] =
            [scene.eye, scene.forward].map(|of| DVec3::new(of[0].into(), of[1].into(), of[2].into()));
        let ground = eye - forward * (eye.z / forward.z);
        assert!(ground.length() < 1e-5, "{ground}");
        for camera in scene.cameras {
            let clip = Mat4::from_cols_array(&camera.clip_from_world) * Vec4::W;
            assert!(
                clip.w > 0.0 && (clip.x / clip.w).abs() < 1e-4 && (clip.y / clip.w).abs() < 1e-4,
                "{clip}"
            );
        }
    }
}
