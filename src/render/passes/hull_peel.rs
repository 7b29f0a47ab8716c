//! Surfaces of hulls by layers of their cones' faces, peeled off one after the other, and counting what lies behind each.
//!
//! A hull takes as many layers as its silhouettes can have faces behind each other, at most; every layer's draws are told by the
//! device whether the last one drew anything, so that those after the last are nothing but passes begun and ended.

use super::hull_rays::{HullSurface, SURFACE_FORMAT};
use super::hull_trim::{depth_texture, faces_layout};
use super::{Recording, texture_entry};
use crate::gpu::{Gpu, GpuError, GrowingBuffer, TextureDescriptor};
use crate::hull_data::{HullData, HullFaces};
use crate::targets::DEPTH_FORMAT;

const LABEL: &str = "hull_peel";

/// Of cones that hold a place: a signed number that devices can add up.
const COUNT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R16Float;

/// Layers of a hull of n silhouettes, at most: each may be left and come back to some times along a ray, the more the more ragged it is.
const LAYERS_A_VIEW: u32 = 3;
const EDGES_A_LAYER: u32 = 400;
const MOST_LAYERS: u32 = 256;

/// Bytes between the draws of one layer and of the next: buffers are bound at multiples of it.
const STRIDE: u64 = 256;

/// Most pixels a side of a texel of the valid region.
pub(crate) const MOST_VALID_PX: u32 = 8;

/// Peels cones.
#[derive(Debug)]
pub(crate) struct HullPeelPass {
    depths_layout: wgpu::BindGroupLayout,
    layer_layout: wgpu::BindGroupLayout,
    draws_layout: wgpu::BindGroupLayout,
    valid_layout: wgpu::BindGroupLayout,
    peel: wgpu::RenderPipeline,
    /// By pixels a side of a texel of the valid region.
    prime: Vec<(u32, wgpu::RenderPipeline)>,
    count: wgpu::RenderPipeline,
    resolve: wgpu::RenderPipeline,
    stop: wgpu::ComputePipeline,
    queries: wgpu::QuerySet,
    n_fragments: wgpu::Buffer,
    draws: GrowingBuffer,
    targets: Option<PeelTargets>,
}

/// What is drawn on, of one size.
#[derive(Debug)]
struct PeelTargets {
    size: [u32; 2],
    /// Of this layer and of the one before, by turns.
    depths: [wgpu::TextureView; 2],
    found: wgpu::TextureView,
    layer: wgpu::TextureView,
    count: wgpu::TextureView,
}

impl PeelTargets {
    fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let texture = |format, [width, height]: [u32; 2]| {
            view(&gpu.texture(&TextureDescriptor {
                label: Some("hull layer"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            }))
        };
        Self {
            size,
            depths: [0, 1].map(|_| view(&depth_texture(gpu, size))),
            found: view(&depth_texture(gpu, size)),
            layer: texture(SURFACE_FORMAT, size),
            count: texture(COUNT_FORMAT, size),
        }
    }
}

/// What a pass draws on: a colour, cleared or gone on with, and a depth to clear to.
struct On<'a> {
    color: Option<&'a wgpu::TextureView>,
    loads: bool,
    depth: Option<(&'a wgpu::TextureView, Option<f32>)>,
    query: bool,
}

impl HullPeelPass {
    pub(crate) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        hulls: &HullData,
    ) -> Result<Self, GpuError> {
        let device = &gpu.device;
        let of = |entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(LABEL), entries })
        };
        let flat = |binding, kind| texture_entry(binding, wgpu::TextureViewDimension::D2, kind);
        let (depth, uint) = (wgpu::TextureSampleType::Depth, wgpu::TextureSampleType::Uint);
        let depths_layout = of(&[flat(0, depth), flat(1, depth)]);
        let valid_layout = of(&[flat(4, uint)]);
        let layer_layout =
            of(&[flat(0, uint), flat(1, wgpu::TextureSampleType::Float { filterable: false })]);
        let storage = |binding, read_only| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let draws_layout = of(&[storage(2, true), storage(3, false)]);
        let module = gpu.shader("render/hull_peel.wgsl")?;
        let layout = |groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(LABEL),
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let drawn = layout(&[Some(frame_layout), Some(&depths_layout), Some(hulls.layout())]);
        let resolved = layout(&[Some(frame_layout), None, Some(hulls.layout()), Some(&layer_layout)]);
        let primed = layout(&[None, None, None, Some(&valid_layout)]);
        let pipeline = |layout: &wgpu::PipelineLayout, stages: [&str; 2], kind: Kind, valid_px: u32| {
            let lenses = hulls.variant();
            let valid = [("VALID_PX", f64::from(valid_px)), lenses[0]];
            let (is_peel, is_prime) = (matches!(kind, Kind::Peel), matches!(kind, Kind::Prime));
            let compilation_options = |constants| wgpu::PipelineCompilationOptions {
                constants,
                ..wgpu::PipelineCompilationOptions::default()
            };
            let add = wgpu::BlendComponent {
                src_factor: wgpu::BlendFactor::One,
                dst_factor: wgpu::BlendFactor::One,
                operation: wgpu::BlendOperation::Add,
            };
            let has_depth = !matches!(kind, Kind::Count);
            let targets = [Some(wgpu::ColorTargetState {
                format: if has_depth { SURFACE_FORMAT } else { COUNT_FORMAT },
                blend: (!has_depth).then_some(wgpu::BlendState { color: add, alpha: add }),
                write_mask: wgpu::ColorWrites::ALL,
            })];
            let buffers = [Some(faces_layout())];
            gpu.pipeline(
                LABEL,
                &wgpu::RenderPipelineDescriptor {
                    label: Some(LABEL),
                    layout: Some(layout),
                    vertex: wgpu::VertexState {
                        module: &module,
                        entry_point: Some(stages[0]),
                        compilation_options: compilation_options(&lenses),
                        buffers: if matches!(kind, Kind::Resolve | Kind::Prime) { &[] } else { &buffers },
                    },
                    primitive: wgpu::PrimitiveState {
                        cull_mode: is_peel.then_some(wgpu::Face::Front),
                        ..wgpu::PrimitiveState::default()
                    },
                    depth_stencil: has_depth.then(|| wgpu::DepthStencilState {
                        format: DEPTH_FORMAT,
                        depth_write_enabled: Some(true),
                        depth_compare: Some(wgpu::CompareFunction::Greater),
                        stencil: wgpu::StencilState::default(),
                        bias: wgpu::DepthBiasState::default(),
                    }),
                    multisample: wgpu::MultisampleState::default(),
                    fragment: Some(wgpu::FragmentState {
                        module: &module,
                        entry_point: Some(stages[1]),
                        compilation_options: compilation_options(if is_prime { &valid } else { &lenses }),
                        targets: if is_prime { &[] } else { &targets },
                    }),
                    multiview_mask: None,
                    cache: None,
                },
            )
        };
        let stop = gpu.compute_pipeline(
            LABEL,
            &wgpu::ComputePipelineDescriptor {
                label: Some(LABEL),
                layout: Some(&layout(&[None, None, None, Some(&draws_layout)])),
                module: &module,
                entry_point: Some("cs_draws"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            },
        );
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some(LABEL),
            ty: wgpu::QueryType::Occlusion,
            count: 1,
        });
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::STORAGE;
        let n_fragments = GrowingBuffer::new("hull fragments", usage).write(gpu, &[0_u32; 2]).clone();
        let usage = wgpu::BufferUsages::INDIRECT | wgpu::BufferUsages::STORAGE;
        Ok(Self {
            // As few as powers of two up to the most.
            prime: [1, 2, 4, MOST_VALID_PX]
                .map(|px| (px, pipeline(&primed, ["vs_full", "fs_prime"], Kind::Prime, px)))
                .to_vec(),
            peel: pipeline(&drawn, ["vs_closed", "fs_layer"], Kind::Peel, 0),
            count: pipeline(&drawn, ["vs_closed", "fs_count"], Kind::Count, 0),
            resolve: pipeline(&resolved, ["vs_full", "fs_resolve"], Kind::Resolve, 0),
            stop,
            depths_layout,
            layer_layout,
            draws_layout,
            valid_layout,
            queries,
            n_fragments,
            draws: GrowingBuffer::new("hull draws", usage),
            targets: None,
        })
    }

    /// Records that `surface` gets the first layer of every hull's faces that is its own; with a `valid` region, where that has any.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        frame: &wgpu::BindGroup,
        (hulls, group): (&HullData, &wgpu::BindGroup),
        (surface, valid): (&HullSurface, Option<(&wgpu::TextureView, u32)>),
    ) {
        let gpu = recording.gpu;
        let size = surface.size_px();
        self.targets.take_if(|kept| kept.size != size);
        if self.targets.is_none() {
            self.targets = Some(PeelTargets::new(gpu, size));
        }
        let (faces, hulls_faces) = hulls.faces_by_hull();
        let rects = hulls.rects_px(size);
        let n_layers =
            |of: &HullFaces| (of.n_views * LAYERS_A_VIEW + 4 + of.n_edges / EDGES_A_LAYER).min(MOST_LAYERS);
        self.write_draws(gpu, hulls_faces.iter().map(|of| (of, n_layers(of))));
        let prime = valid.map(|(view, px)| {
            let of =
                self.prime.iter().find(|(kept, _)| *kept == px).map_or(&self.prime[0].1, |(_, prime)| prime);
            (of, bind(gpu, &self.valid_layout, 4, &[wgpu::BindingResource::TextureView(view)]))
        });
        let (Some(targets), Some(draws)) = (&self.targets, self.draws.get()) else { return };
        let span = recording.timer.span(LABEL);
        let shown = |rect: &[u32; 4]| rect[0] < rect[2] && rect[1] < rect[3];
        let of_shown = hulls_faces.iter().zip(&rects).filter(|(_, rect)| shown(rect));
        let n_passes: usize = 1 + of_shown.map(|(of, _)| 1 + 3 * n_layers(of) as usize).sum::<usize>();
        let timer = &*recording.timer;
        // Which of all passes is the next.
        let mut next_pass = 0..n_passes;
        let mut times = || timer.writes(span, next_pass.next().unwrap_or_default(), n_passes);
        let encoder = &mut *recording.encoder;
        let depths = targets.depths.each_ref().map(|depth| self.bind_depths(gpu, depth, targets));
        let layer = self.bind_layer(gpu, targets);
        // Before the first hull nothing is found.
        let depth = Some((&targets.found, Some(0.0)));
        let found = On { color: Some(&surface.view), loads: false, depth, query: false };
        drop(self.begin(gpu, encoder, &found, times()));
        let mut draw = 0;
        for (of, rect) in hulls_faces.iter().zip(&rects) {
            // What lies beside the picture has no layers.
            if !shown(rect) {
                draw += u64::from(n_layers(of)) + 1;
                continue;
            }
            let [left, top, right, bottom] = *rect;
            let within = |pass: &mut wgpu::RenderPass<'_>| {
                pass.set_scissor_rect(left, top, right - left, bottom - top);
            };
            let range = u64::from(of.first) * 12..u64::from(of.first + of.n_edges + 6) * 12;
            // The layer before the first is before all, where there may be any.
            let first = if prime.is_some() { 0.0 } else { 1.0 };
            let before = On {
                color: None,
                loads: false,
                depth: Some((&targets.depths[1], Some(first))),
                query: false,
            };
            let mut pass = self.begin(gpu, encoder, &before, times());
            if let Some((prime, valid)) = &prime {
                within(&mut pass);
                pass.set_pipeline(prime);
                pass.set_bind_group(3, valid, &[]);
                pass.draw(0..3, 0..1);
            }
            drop(pass);
            for layer_idx in 0..n_layers(of) as usize {
                let at = draw * STRIDE;
                let (now, last) = (layer_idx % 2, 1 - layer_idx % 2);
                let on = On {
                    color: Some(&targets.layer),
                    loads: false,
                    depth: Some((&targets.depths[now], Some(0.0))),
                    query: true,
                };
                let mut pass = self.begin(gpu, encoder, &on, times());
                within(&mut pass);
                pass.set_pipeline(&self.peel);
                pass.set_bind_group(0, frame, &[]);
                pass.set_bind_group(1, &depths[last], &[]);
                pass.set_bind_group(2, group, &[]);
                pass.set_vertex_buffer(0, faces.slice(range.clone()));
                pass.begin_occlusion_query(0);
                pass.draw_indirect(draws, at);
                pass.end_occlusion_query();
                drop(pass);
                let on = On { color: Some(&targets.count), loads: false, depth: None, query: false };
                let mut pass = self.begin(gpu, encoder, &on, times());
                within(&mut pass);
                pass.set_pipeline(&self.count);
                pass.set_bind_group(0, frame, &[]);
                pass.set_bind_group(1, &depths[now], &[]);
                pass.set_bind_group(2, group, &[]);
                pass.set_vertex_buffer(0, faces.slice(range.clone()));
                pass.draw_indirect(draws, at + 16);
                drop(pass);
                let on = On {
                    color: Some(&surface.view),
                    loads: true,
                    depth: Some((&targets.found, None)),
                    query: false,
                };
                let mut pass = self.begin(gpu, encoder, &on, times());
                within(&mut pass);
                pass.set_pipeline(&self.resolve);
                pass.set_bind_group(0, frame, &[]);
                pass.set_bind_group(2, group, &[]);
                pass.set_bind_group(3, &layer, &[]);
                pass.draw_indirect(draws, at + 32);
                drop(pass);
                encoder.resolve_query_set(&self.queries, 0..1, &self.n_fragments, 0);
                draw += 1;
                let next = self.bind_draws(gpu, draws, draw * STRIDE);
                let mut pass = gpu.begin_compute_pass(encoder, LABEL, None);
                pass.set_pipeline(&self.stop);
                pass.set_bind_group(3, &next, &[]);
                pass.dispatch_workgroups(1, 1, 1);
            }
            // The last layer's successor is nobody's.
            draw += 1;
        }
    }

    /// Lets go of what is drawn on where that is more than `max_bytes`.
    pub(crate) fn trim(&mut self, max_bytes: u64) {
        let n_bytes = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height) * 30;
        self.targets.take_if(|kept| n_bytes(kept.size) > max_bytes);
    }

    /// Writes every layer's draws of every hull, and those of one more that nobody draws.
    fn write_draws<'f>(&mut self, gpu: &Gpu, hulls: impl Iterator<Item = (&'f HullFaces, u32)>) {
        let mut words: Vec<u32> = Vec::new();
        for (of, n_layers) in hulls {
            for _ in 0..=n_layers {
                words.extend([6, of.n_edges + 6, 0, 0, 6, of.n_edges, 0, 0, 3, 1, 0, 0]);
                words.resize(words.len().next_multiple_of(STRIDE as usize / 4), 0);
            }
        }
        self.draws.write(gpu, &words);
    }

    fn begin<'e>(
        &self,
        gpu: &Gpu,
        encoder: &'e mut wgpu::CommandEncoder,
        on: &On<'_>,
        timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) -> wgpu::RenderPass<'e> {
        let load = if on.loads { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT) };
        let color = on.color.map(|view| {
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
            })
        });
        let descriptor = wgpu::RenderPassDescriptor {
            label: Some(LABEL),
            color_attachments: color.as_slice(),
            depth_stencil_attachment: on.depth.map(|(view, clear)| wgpu::RenderPassDepthStencilAttachment {
                view,
                depth_ops: Some(wgpu::Operations {
                    load: clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            timestamp_writes,
            occlusion_query_set: on.query.then_some(&self.queries),
            multiview_mask: None,
        };
        gpu.begin_pass(encoder, LABEL, &descriptor)
    }

    fn bind_depths(&self, gpu: &Gpu, depth: &wgpu::TextureView, targets: &PeelTargets) -> wgpu::BindGroup {
        let views = [depth, &targets.found];
        bind(gpu, &self.depths_layout, 0, &views.map(wgpu::BindingResource::TextureView))
    }

    fn bind_layer(&self, gpu: &Gpu, targets: &PeelTargets) -> wgpu::BindGroup {
        let views = [&targets.layer, &targets.count];
        bind(gpu, &self.layer_layout, 0, &views.map(wgpu::BindingResource::TextureView))
    }

    fn bind_draws(&self, gpu: &Gpu, draws: &wgpu::Buffer, offset: u64) -> wgpu::BindGroup {
        let of = |buffer, offset, n_bytes| {
            let size = wgpu::BufferSize::new(n_bytes);
            wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset, size })
        };
        bind(gpu, &self.draws_layout, 2, &[of(&self.n_fragments, 0, 8), of(draws, offset, 48)])
    }
}

/// What a pipeline of these does.
#[derive(Clone, Copy)]
enum Kind {
    Peel,
    Count,
    Resolve,
    Prime,
}

fn bind(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    first: u32,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (first..)
        .zip(resources)
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(LABEL), layout, entries: &entries })
}
