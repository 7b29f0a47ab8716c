//! A sky that is more than one colour, behind everything that was drawn.

use super::{BySamples, DrawInto, DrawPipeline, Mixing, Recording, draw_pipeline};
use crate::gpu::{Gpu, GpuError, GrowingBuffer, mirror};
use videofields_picture::plan::View;
use videofields_picture::scene;
use videofields_vision::frame::linear_from_srgb;

mirror! { "render/sky.wgsl",
/// The sky as a view shows it. The shader documents the fields.
pub(super) struct Sky {
    zenith: [f32; 3],
    yaw_rad: f32,
    horizon: [f32; 3],
    pad_horizon: u32,
    ground: [f32; 3],
    pad_ground: u32,
    span: [f32; 4],
}}

impl Sky {
    fn new(sky: &scene::Sky, view: &View) -> Self {
        let linear = |color: [u8; 3]| color.map(|code| linear_from_srgb(f32::from(code) / 255.0));
        let [zenith, horizon, ground] = match sky {
            scene::Sky::Plain { color_srgb } => [linear(*color_srgb); 3],
            scene::Sky::Gradient { zenith_srgb, horizon_srgb, ground_srgb } => {
                [linear(*zenith_srgb), linear(*horizon_srgb), linear(*ground_srgb)]
            }
            scene::Sky::Picture { .. } => [[0.0; 3]; 3],
        };
        let yaw_rad = if let scene::Sky::Picture { yaw_rad, .. } = sky { *yaw_rad as f32 } else { 0.0 };
        let ([left, right], [top, bottom]) = (view.frustum.x, view.frustum.y);
        let span = [left, right, top, bottom].map(|edge| edge as f32);
        Self { zenith, yaw_rad, horizon, pad_horizon: 0, ground, pad_ground: 0, span }
    }
}

/// Draws the sky.
#[derive(Debug)]
pub(crate) struct SkyPass {
    layout: wgpu::BindGroupLayout,
    gradient: BySamples,
    picture: BySamples,
    data: GrowingBuffer,
}

const LABEL: &str = "sky";

impl SkyPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Uniform,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        Self {
            layout,
            gradient: BySamples::default(),
            picture: BySamples::default(),
            data: GrowingBuffer::new(LABEL, wgpu::BufferUsages::UNIFORM),
        }
    }

    /// Records the sky of `view`, with its picture and that one's layout if it is one.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        (sky, view): (&scene::Sky, &View),
        picture: Option<(&wgpu::BindGroup, &wgpu::BindGroupLayout)>,
    ) -> Result<(), GpuError> {
        let gpu = recording.gpu;
        let data = self.data.write(gpu, &[Sky::new(sky, view)]);
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: data.as_entire_binding() }],
        });
        let samples = into.targets.samples();
        let mut bind_groups = vec![Some(into.frame_layout), Some(&self.layout)];
        bind_groups.extend(picture.map(|(_, layout)| Some(layout)));
        let wanted = DrawPipeline {
            label: LABEL,
            bind_groups: &bind_groups,
            vertices: &[],
            entry_points: ["vs_main", if picture.is_some() { "fs_picture" } else { "fs_gradient" }],
            topology: wgpu::PrimitiveTopology::TriangleList,
            mixing: Mixing { blend: None, writes_depth: false, writes_color: true, culls_back: false },
            variant: &[],
            samples,
        };
        let pipelines = if picture.is_some() { &mut self.picture } else { &mut self.gradient };
        let pipeline = pipelines.get(samples, || draw_pipeline(gpu, wanted))?;
        let mut pass = recording.draw(LABEL, into);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(1, &group, &[]);
        if let Some((picture, _)) = picture {
            pass.set_bind_group(2, picture, &[]);
        }
        pass.draw(0..3, 0..1);
        Ok(())
    }
}
