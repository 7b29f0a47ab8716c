//! Surfaces of hulls by the rays of the picture's pixels.

use super::{Recording, read_entry};
use crate::gpu::{Gpu, GpuError, GrowingBuffer, TextureDescriptor};
use crate::hull_data::HullData;

const LABEL: &str = "hull_rays";

/// Of what a found surface is told, a texel a pixel: see `HullSurface` of common/hull.wgsl.
pub(crate) const SURFACE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

/// Pixels a side of what one group of threads takes.
const GROUP_PX: u32 = 8;

/// Most groups in a row.
const MOST_GROUPS: u32 = 65_535;

/// The surface nearest to the eye at every pixel, of the last size.
#[derive(Debug)]
pub(crate) struct HullSurface {
    pub texture: wgpu::Texture,
    pub view: wgpu::TextureView,
}

impl HullSurface {
    /// Hands out one of `size`, that of `kept` if it is.
    pub(crate) fn sized<'k>(kept: &'k mut Option<Self>, gpu: &Gpu, [width, height]: [u32; 2]) -> &'k Self {
        kept.take_if(|kept| (kept.texture.width(), kept.texture.height()) != (width, height));
        kept.get_or_insert_with(|| {
            let texture = gpu.texture(&TextureDescriptor {
                label: Some("hull surface"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: SURFACE_FORMAT,
                usage: wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            Self { view: texture.create_view(&wgpu::TextureViewDescriptor::default()), texture }
        })
    }

    /// Returns it as what a pass draws into, with nothing on it at first.
    pub(super) const fn cleared(&self) -> wgpu::RenderPassColorAttachment<'_> {
        wgpu::RenderPassColorAttachment {
            view: &self.view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                store: wgpu::StoreOp::Store,
            },
        }
    }

    /// Bytes that it takes.
    pub(crate) fn n_bytes(&self) -> u64 {
        u64::from(self.texture.width()) * u64::from(self.texture.height()) * 16
    }

    /// Columns and rows.
    pub(crate) fn size_px(&self) -> [u32; 2] {
        [self.texture.width(), self.texture.height()]
    }
}

/// Finds surfaces ray by ray, in the squares of the picture alone that may show a hull: a device that takes several pixels at once works
/// out for all of them what any asks for, and a processor also what none asks for.
#[derive(Debug)]
pub(crate) struct HullRaysPass {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
    squares: GrowingBuffer,
    listed: Squares,
}

/// Squares of [`GROUP_PX`] pixels a side that may show a hull.
#[derive(Debug, Default)]
struct Squares {
    /// Their number, and of each its column in the lower half and its row in the upper, from the top and from left to right.
    list: Vec<u32>,
    /// A bit a square of one row of them.
    row: Vec<u64>,
}

impl Squares {
    /// Lists the squares of a picture of `width` columns that `rects` touch, each given by its left, top, right and bottom, in pixels.
    fn find(&mut self, width: u32, rects: &[[u32; 4]]) {
        const BITS: u32 = u64::BITS;
        let Self { list, row } = self;
        list.clear();
        list.push(0);
        let seen = || rects.iter().filter(|[left, top, right, bottom]| left < right && top < bottom);
        let first = seen().map(|rect| rect[1] / GROUP_PX).min().unwrap_or(0);
        let last = seen().map(|rect| rect[3].div_ceil(GROUP_PX)).max().unwrap_or(0);
        row.clear();
        row.resize(width.div_ceil(GROUP_PX).div_ceil(BITS) as usize, 0);
        for y in first..last {
            for [left, _, right, _] in
                seen().filter(|rect| rect[1] < (y + 1) * GROUP_PX && rect[3] > y * GROUP_PX)
            {
                for x in left / GROUP_PX..right.div_ceil(GROUP_PX) {
                    row[(x / BITS) as usize] |= 1 << (x % BITS);
                }
            }
            for (bits, begins) in row.iter_mut().zip((0..).step_by(BITS as usize)) {
                let mut left = std::mem::take(bits);
                while left != 0 {
                    list.push((begins + left.trailing_zeros()) | y << 16);
                    left &= left - 1;
                }
            }
        }
        list[0] = list.len() as u32 - 1;
    }
}

impl HullRaysPass {
    pub(crate) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        hulls: &HullData,
    ) -> Result<Self, GpuError> {
        let entry = wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format: SURFACE_FORMAT,
                view_dimension: wgpu::TextureViewDimension::D2,
            },
            count: None,
        };
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[entry, read_entry(1, wgpu::ShaderStages::COMPUTE)],
        });
        let module = gpu.shader("render/hull_rays.wgsl")?;
        let groups = [Some(frame_layout), Some(&layout), Some(hulls.layout())];
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(LABEL),
            bind_group_layouts: &groups,
            immediate_size: 0,
        });
        let pipeline = gpu.compute_pipeline(
            LABEL,
            &wgpu::ComputePipelineDescriptor {
                label: Some(LABEL),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some("cs_main"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &hulls.variant(),
                    ..wgpu::PipelineCompilationOptions::default()
                },
                cache: None,
            },
        );
        let squares = GrowingBuffer::new("squares with hulls", wgpu::BufferUsages::STORAGE);
        Ok(Self { layout, pipeline, squares, listed: Squares::default() })
    }

    /// Records that `surface` gets what every pixel's ray meets first.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        frame: &wgpu::BindGroup,
        (data, hulls): (&HullData, &wgpu::BindGroup),
        surface: &HullSurface,
    ) {
        let gpu = recording.gpu;
        let size = surface.size_px();
        self.listed.find(size[0], &data.rects_px(size));
        let squares = self.squares.write(gpu, &self.listed.list);
        let output = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&surface.view),
                },
                wgpu::BindGroupEntry { binding: 1, resource: squares.as_entire_binding() },
            ],
        });
        clear(recording, surface);
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.compute_writes(span);
        let mut pass = gpu.begin_compute_pass(recording.encoder, LABEL, writes);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, &output, &[]);
        pass.set_bind_group(2, hulls, &[]);
        let n_squares = self.listed.list[0];
        let n_rows = n_squares.div_ceil(MOST_GROUPS).max(1);
        pass.dispatch_workgroups(n_squares.div_ceil(n_rows), n_rows, 1);
    }
}

/// Records that nothing is on a surface.
fn clear(recording: &mut Recording<'_>, surface: &HullSurface) {
    let descriptor = wgpu::RenderPassDescriptor {
        label: Some(LABEL),
        color_attachments: &[Some(surface.cleared())],
        ..wgpu::RenderPassDescriptor::default()
    };
    drop(recording.gpu.begin_pass(recording.encoder, LABEL, &descriptor));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_square_that_a_rectangle_touches_is_listed_once() {
        let mut squares = Squares::default();
        for (width, rects) in [
            (40, vec![]),
            (40, vec![[5, 5, 5, 9], [7, 3, 9, 3]]),
            (40, vec![[0, 0, 1, 1]]),
            (40, vec![[8, 8, 16, 16], [7, 15, 17, 17]]),
            (1203, vec![[3, 100, 1203, 109], [500, 90, 560, 130], [1201, 0, 1203, 301]]),
        ] {
            squares.find(width, &rects);
            let [n_squares, list @ ..] = squares.list.as_slice() else { panic!("no number") };
            assert_eq!(*n_squares as usize, list.len());
            let found: Vec<(u32, u32)> = list.iter().map(|at| (at >> 16, at & 0xffff)).collect();
            let touches = |x: u32, y: u32| {
                let overlap = |[from, to]: [u32; 2], at: u32| {
                    from < to && from < (at + 1) * GROUP_PX && to > at * GROUP_PX
                };
                rects.iter().any(|rect| overlap([rect[0], rect[2]], x) && overlap([rect[1], rect[3]], y))
            };
            let all = (0..50).flat_map(|y| (0..width.div_ceil(GROUP_PX)).map(move |x| (y, x)));
            let expected: Vec<(u32, u32)> = all.filter(|(y, x)| touches(*x, *y)).collect();
            assert_eq!(found, expected, "{rects:?}");
        }
    }
}
