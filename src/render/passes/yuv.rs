//! Pictures that are new since the last frame: from the decoder's planes to sRGB layers and their smaller levels.

use super::{Recording, UNFILTERED, picture_pass, read_entry, texture_entry};
use crate::gpu::{Gpu, GpuError, GrowingBuffer, mirror};
use crate::image_array::{CODED_FORMAT, IMAGE_FORMAT, ImageArray, Job, Store, Wanted};
use videofields_vision::frame::{Mask, Plane};

mirror! { "render/yuv.wgsl",
/// How one picture is converted. The shader documents the fields.
pub(super) struct Conversion {
    row_r: [f32; 3],
    layer: u32,
    row_g: [f32; 3],
    has_mask: u32,
    row_b: [f32; 3],
    pad: u32,
    offset: [f32; 3],
    width_px: u32,
    gain: [f32; 3],
    height_px: u32,
}}

impl Conversion {
    fn new(Job { wanted: Wanted { image, mask }, layer, .. }: &Job<'_>) -> Self {
        let [row_r, row_g, row_b] = image.matrix().rgb_from_ypbpr();
        let (luma_offset, luma_scale, chroma_scale) = image.range().luma_offset_luma_scale_chroma_scale();
        let chroma_gain = 255.0 / chroma_scale;
        Self {
            row_r,
            layer: *layer,
            row_g,
            has_mask: u32::from(mask.is_some()),
            row_b,
            pad: 0,
            offset: [luma_offset / 255.0, 128.0 / 255.0, 128.0 / 255.0],
            width_px: image.width(),
            gain: [255.0 / luma_scale, chroma_gain, chroma_gain],
            height_px: image.height(),
        }
    }
}

/// One level of one layer to be drawn.
struct Draw {
    target: wgpu::TextureView,
    source: Source,
}

enum Source {
    /// The next conversion, from these planes.
    Planes(wgpu::BindGroup),
    /// The next finer level.
    Finer(wgpu::BindGroup),
}

/// Converts pictures.
#[derive(Debug)]
pub(crate) struct YuvPass {
    planes_layout: wgpu::BindGroupLayout,
    level_layout: wgpu::BindGroupLayout,
    convert: wgpu::RenderPipeline,
    make_smaller: wgpu::RenderPipeline,
    conversions: GrowingBuffer,
    scratch: Vec<Conversion>,
}

const LABEL: &str = "yuv";

impl YuvPass {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let device = &gpu.device;
        let array = |binding| texture_entry(binding, wgpu::TextureViewDimension::D2Array, UNFILTERED);
        let planes_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("yuv planes"),
            entries: &[read_entry(0, wgpu::ShaderStages::FRAGMENT), array(1), array(2), array(3), array(4)],
        });
        let level_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("yuv level"),
            entries: &[texture_entry(0, wgpu::TextureViewDimension::D2, UNFILTERED)],
        });
        let module = gpu.shader("render/yuv.wgsl")?;
        let pipeline = |entry_point, groups: &[Option<&wgpu::BindGroupLayout>], format| {
            let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(LABEL),
                bind_group_layouts: groups,
                immediate_size: 0,
            });
            gpu.pipeline(
                LABEL,
                &wgpu::RenderPipelineDescriptor {
                    label: Some(LABEL),
                    layout: Some(&layout),
                    vertex: wgpu::VertexState {
                        module: &module,
                        entry_point: Some("vs_main"),
                        compilation_options: wgpu::PipelineCompilationOptions::default(),
                        buffers: &[],
                    },
                    primitive: wgpu::PrimitiveState::default(),
                    depth_stencil: None,
                    multisample: wgpu::MultisampleState::default(),
                    fragment: Some(wgpu::FragmentState {
                        module: &module,
                        entry_point: Some(entry_point),
                        compilation_options: wgpu::PipelineCompilationOptions::default(),
                        targets: &[Some(wgpu::ColorTargetState::from(format))],
                    }),
                    multiview_mask: None,
                    cache: None,
                },
            )
        };
        let convert = pipeline("fs_main", &[None, Some(&planes_layout)], CODED_FORMAT);
        let make_smaller = pipeline("fs_smaller", &[None, None, Some(&level_layout)], IMAGE_FORMAT);
        let conversions = GrowingBuffer::new("conversions", wgpu::BufferUsages::STORAGE);
        Ok(Self { planes_layout, level_layout, convert, make_smaller, conversions, scratch: Vec::new() })
    }

    /// Uploads the pictures' planes and records their conversion into their arrays' layers.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        batches: [(&mut ImageArray, &[Job<'_>]); 2],
    ) {
        let gpu = recording.gpu;
        self.scratch.clear();
        for (_, jobs) in &batches {
            let is_new = |job: &&Job<'_>| job.levels[0] == 0;
            self.scratch.extend(jobs.iter().filter(is_new).map(Conversion::new));
        }
        self.conversions.write(gpu, &self.scratch);
        let mut draws = Vec::new();
        for (array, jobs) in batches.into_iter().filter(|(_, jobs)| !jobs.is_empty()) {
            let store = array.store(gpu);
            let planes = self.bind_planes(gpu, store);
            for Job { wanted, layer, levels: [first, n_levels] } in jobs {
                if *first == 0 {
                    upload_planes(gpu, store, wanted, *layer);
                    let target = store.level(*layer, 0, CODED_FORMAT);
                    draws.push(Draw { target, source: Source::Planes(planes.clone()) });
                }
                for level in (*first).max(1)..*n_levels {
                    let finer = self.bind_level(gpu, &store.level(*layer, level - 1, IMAGE_FORMAT));
                    let target = store.level(*layer, level, IMAGE_FORMAT);
                    draws.push(Draw { target, source: Source::Finer(finer) });
                }
            }
        }
        self.record_draws(recording, &draws);
    }

    fn record_draws(&self, recording: &mut Recording<'_>, draws: &[Draw]) {
        let span = recording.timer.span(LABEL);
        let mut conversion_idx = 0;
        for (idx, draw) in draws.iter().enumerate() {
            let writes = recording.timer.writes(span, idx, draws.len());
            let mut pass = picture_pass(recording.gpu, recording.encoder, LABEL, (&draw.target, writes));
            match &draw.source {
                Source::Planes(planes) => {
                    pass.set_pipeline(&self.convert);
                    pass.set_bind_group(1, planes, &[]);
                    pass.draw(0..3, conversion_idx..conversion_idx + 1);
                    conversion_idx += 1;
                }
                Source::Finer(level) => {
                    pass.set_pipeline(&self.make_smaller);
                    pass.set_bind_group(2, level, &[]);
                    pass.draw(0..3, 0..1);
                }
            }
        }
    }

    fn bind_planes(&self, gpu: &Gpu, store: &Store) -> wgpu::BindGroup {
        let conversions = self.conversions.get().expect("conversions are written before they are bound");
        let view = |binding, view| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        };
        let views = &store.plane_views;
        // Where no picture has a mask none is read: anything of its kind will do.
        let mask = views.get(3).unwrap_or(&views[0]);
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("yuv planes"),
            layout: &self.planes_layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: conversions.as_entire_binding() },
                view(1, &views[0]),
                view(2, &views[1]),
                view(3, &views[2]),
                view(4, mask),
            ],
        })
    }

    fn bind_level(&self, gpu: &Gpu, finer: &wgpu::TextureView) -> wgpu::BindGroup {
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("yuv level"),
            layout: &self.level_layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(finer),
            }],
        })
    }
}

fn plane_of(mask: &Mask) -> Plane<'_> {
    Plane { data: &mask.data, stride: mask.width as usize, width: mask.width, height: mask.height }
}

fn upload_planes(gpu: &Gpu, store: &Store, wanted: &Wanted<'_>, layer: u32) {
    for plane in 0..3 {
        upload(gpu, ("planes", &store.planes[plane]), layer, &wanted.image.plane(plane));
    }
    if let Some(mask) = wanted.mask {
        upload(gpu, ("masks", &store.planes[3]), layer, &plane_of(mask));
    }
}

/// Hands a plane to the device as it lies in the decoder's memory.
fn upload(gpu: &Gpu, (label, texture): (&'static str, &wgpu::Texture), layer: u32, plane: &Plane<'_>) {
    let len = plane.stride * (plane.height as usize - 1) + plane.width as usize;
    gpu.upload(
        label,
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
            aspect: wgpu::TextureAspect::All,
        },
        (
            &plane.data[..len],
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(plane.stride as u32),
                rows_per_image: None,
            },
        ),
        wgpu::Extent3d { width: plane.width, height: plane.height, depth_or_array_layers: 1 },
    );
}
