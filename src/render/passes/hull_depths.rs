//! What every camera sees of the hulls, as depth maps: by the faces of the silhouettes' cones, each trimmed by the other silhouettes.

use super::Recording;
use super::hull_trim::{depth_texture, faces_layout, strips_pipeline};
use crate::gpu::{Gpu, GpuError};
use crate::hull_data::{HullData, HullFaces, TileDraw};

const LABEL: &str = "hull_depths";

/// Draws depth maps of hulls, those of all cameras beside each other.
#[derive(Debug)]
pub(crate) struct HullDepthsPass {
    pipeline: wgpu::RenderPipeline,
    maps: Option<wgpu::Texture>,
}

impl HullDepthsPass {
    pub(crate) fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        hulls: &HullData,
    ) -> Result<Self, GpuError> {
        let pipeline = strips_pipeline(gpu, LABEL, (frame_layout, hulls), (faces_layout(), None))?;
        Ok(Self { pipeline, maps: None })
    }

    /// What the maps are drawn on.
    pub(crate) const fn maps(&mut self) -> &mut Option<wgpu::Texture> {
        &mut self.maps
    }

    /// Records that the maps of all views of `hulls` are drawn; answers them, none where none are wanted.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        frame: &wgpu::BindGroup,
        (hulls, group): (&HullData, &wgpu::BindGroup),
    ) -> Option<wgpu::TextureView> {
        let gpu = recording.gpu;
        let (tiles, draws) = hulls.tiles()?;
        let size = [tiles.columns * tiles.side_px, tiles.rows * tiles.side_px];
        self.maps.take_if(|kept| [kept.width(), kept.height()] != size);
        let maps = self.maps.get_or_insert_with(|| depth_texture(gpu, size));
        let maps = maps.create_view(&wgpu::TextureViewDescriptor::default());
        let span = recording.timer.span(LABEL);
        let descriptor = wgpu::RenderPassDescriptor {
            label: Some(LABEL),
            color_attachments: &[],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &maps,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: recording.timer.writes(span, 0, 1),
            occlusion_query_set: None,
            multiview_mask: None,
        };
        let (faces, of_hulls) = hulls.faces_by_hull();
        let mut pass = gpu.begin_pass(recording.encoder, LABEL, &descriptor);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(2, group, &[]);
        pass.set_vertex_buffer(0, faces.slice(..));
        let mut last = None;
        for TileDraw { view, hull } in draws {
            let Some(HullFaces { first, n_edges, .. }) = of_hulls.get(*hull) else { continue };
            if last != Some(*view) {
                let [left, top] =
                    [view % tiles.columns, view / tiles.columns].map(|place| place * tiles.side_px);
                let [x, y, side] = [left, top, tiles.side_px].map(|at| at as f32);
                pass.set_viewport(x, y, side, side, 0.0, 1.0);
                pass.set_scissor_rect(left, top, tiles.side_px, tiles.side_px);
                last = Some(*view);
            }
            pass.draw(4 * view..4 * view + 4, *first..first + n_edges + 6);
        }
        drop(pass);
        Some(maps)
    }
}
