//! Entities' hulls in a picture: what is known of them, the method that finds their surfaces, and the pass that shows them.

use super::camera_data::{FrameData, Reach, View as ViewData};
use super::hull_data::HullData;
use super::image_array::ImageArray;
use super::passes::{
    DrawInto, HullDepthsPass, HullPass, HullPeelPass, HullRaysPass, HullSeen, HullSurface, HullTrimPass,
    HullVoxelsPass, MOST_VALID_PX, Recording,
};
use super::pieces::Dear;
use super::renderer::made;
use crate::gpu::{Gpu, GpuError};
use glam::DVec3;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{HullMethod, HullVisibility, Plan, View};

/// Pixels of surface as which a pixel counts for each silhouette of a hull that is looked for there, by the first guess of costs.
const PIXELS_PER_SILHOUETTE: u64 = 4;

/// What is kept of hulls between frames; each part is made when a plan first calls for it.
#[derive(Debug, Default)]
pub(super) struct Hulls {
    data: Option<HullData>,
    surface: Option<HullSurface>,
    /// Where there may be hulls, coarsely.
    valid: Option<HullSurface>,
    /// Of cameras without lenses that bend, and of all.
    finding: [Finding; 2],
    shown: Option<HullPass>,
}

/// What finds surfaces.
#[derive(Debug, Default)]
struct Finding {
    rays: Option<HullRaysPass>,
    trim: Option<HullTrimPass>,
    voxels: Option<HullVoxelsPass>,
    peel: Option<HullPeelPass>,
    depths: Option<HullDepthsPass>,
}

/// The piece of a picture that hulls are looked for in.
pub(super) struct HullPiece<'a> {
    pub view: &'a View,
    /// Pixels each way that are drawn for one.
    pub times: u32,
    pub anchor: DVec3,
    pub reach: &'a Reach,
}

/// Where hulls were found.
pub(super) struct Found {
    group: wgpu::BindGroup,
    /// What every camera sees of the hulls, where that was asked for.
    depths: Option<wgpu::TextureView>,
    /// Left, top, right and bottom of what may show any, pixels.
    rect: [u32; 4],
}

impl Hulls {
    /// Writes what the device must know of the plan's hulls; `shader_idx` tells which of the shader's cameras a camera is.
    pub(super) fn assign(
        &mut self,
        gpu: &Gpu,
        of: (&SceneState, &Plan),
        anchor: DVec3,
        shader_idx: impl Fn(usize) -> Option<usize>,
    ) {
        let data = self.data.get_or_insert_with(|| HullData::new(gpu));
        data.assign(gpu, of, anchor, shader_idx);
    }

    /// Returns where a picture of `view` costs more than elsewhere: where rays look for the plan's hulls.
    pub(super) fn dear(&self, plan: &Plan, view: &View) -> Vec<Dear> {
        let is_by_rays = !plan.hulls.is_empty() && plan.hull.method == HullMethod::Rays;
        let data = self.data.as_ref().filter(|_| is_by_rays);
        let dear = |(rect_px, n_views)| Dear { rect_px, more: PIXELS_PER_SILHOUETTE * u64::from(n_views) };
        data.into_iter().flat_map(|data| data.rects_in(view)).map(dear).collect()
    }

    /// Records that the surfaces of the plan's hulls are found; none where none is in the piece.
    pub(super) fn find(
        &mut self,
        recording: &mut Recording<'_>,
        (frame, frame_group): (&mut FrameData, &wgpu::BindGroup),
        (state, plan): (&SceneState, &Plan),
        piece: &HullPiece<'_>,
    ) -> Result<Option<Found>, GpuError> {
        let Some(data) = self.data.as_mut().filter(|_| !plan.hulls.is_empty()) else { return Ok(None) };
        let gpu = recording.gpu;
        let HullPiece { view, times, anchor, reach } = piece;
        let size = [view.width_px * times, view.height_px * times];
        let (group, rect) = data.bind(gpu, (view, *anchor), (0, size));
        let Some(rect) = rect else { return Ok(None) };
        let surface = HullSurface::sized(&mut self.surface, gpu, size);
        let by = &mut self.finding[usize::from(data.has_lenses())];
        match plan.hull.method {
            HullMethod::Rays => {
                let pass = made(&mut by.rays, || HullRaysPass::new(gpu, frame.layout(), data))?;
                pass.record(recording, frame_group, (data, &group), surface);
            }
            HullMethod::Voxels => {
                let pass = made(&mut by.voxels, || HullVoxelsPass::new(gpu, frame.layout(), data))?;
                pass.record(recording, (frame_group, &group), (state, plan, *anchor), surface);
            }
            HullMethod::Trimming => {
                let pass = made(&mut by.trim, || HullTrimPass::new(gpu, frame.layout(), data))?;
                pass.record(recording, frame_group, (data, &group), surface);
            }
            HullMethod::Csg => {
                let pass = made(&mut by.peel, || HullPeelPass::new(gpu, frame.layout(), data))?;
                pass.record(recording, frame_group, (data, &group), (surface, None));
            }
            HullMethod::Hybrid => {
                let view = view.enlarged(*times);
                let valid_px = data.coarse_px(&view, MOST_VALID_PX);
                let coarse = view.coarse(valid_px, 0);
                let coarse_px = [coarse.width_px, coarse.height_px];
                let (coarse_group, _) = data.bind(gpu, (&coarse, *anchor), (1, coarse_px));
                let coarse_frame = frame.bind_beside(gpu, ViewData::new(&coarse, reach));
                let valid = HullSurface::sized(&mut self.valid, gpu, coarse_px);
                let trim = made(&mut by.trim, || HullTrimPass::new(gpu, frame.layout(), data))?;
                trim.record(recording, &coarse_frame, (data, &coarse_group), valid);
                let peel = made(&mut by.peel, || HullPeelPass::new(gpu, frame.layout(), data))?;
                peel.record(recording, frame_group, (data, &group), (surface, Some((&valid.view, valid_px))));
            }
        }
        let mut depths = None;
        if plan.hull.texture.visibility == HullVisibility::Depths {
            let pass = made(&mut by.depths, || HullDepthsPass::new(gpu, frame.layout(), data))?;
            depths = pass.record(recording, frame_group, (data, &group));
        }
        Ok(Some(Found { group, depths, rect }))
    }

    /// Records that what was found is shown.
    pub(super) fn show(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        found: &Found,
        (plan, frames): (&Plan, &mut ImageArray),
    ) -> Result<(), GpuError> {
        let gpu = recording.gpu;
        let (Some(data), Some(surface)) = (&self.data, &self.surface) else { return Ok(()) };
        let pass = made(&mut self.shown, || Ok(HullPass::new(gpu)))?;
        let of = (data, &found.group);
        let seen = HullSeen { surface: &surface.view, depths: found.depths.as_ref(), rect: found.rect };
        pass.record(recording, into, of, &seen, (plan.hull.texture, frames))
    }

    /// The surface that was found last.
    pub(super) fn surface(&self) -> Option<&wgpu::Texture> {
        self.surface.as_ref().map(|surface| &surface.texture)
    }

    /// Lets go of what is drawn on where that is more than `max_bytes`.
    pub(super) fn trim(&mut self, max_bytes: u64) {
        self.surface.take_if(|kept| kept.n_bytes() > max_bytes);
        for by in &mut self.finding {
            let trim = by.trim.as_mut().map(HullTrimPass::depth);
            let voxels = by.voxels.as_mut().map(HullVoxelsPass::depth);
            let depths = by.depths.as_mut().map(HullDepthsPass::maps);
            for depth in [trim, voxels, depths].into_iter().flatten() {
                depth.take_if(|kept| u64::from(kept.width()) * u64::from(kept.height()) * 4 > max_bytes);
            }
            if let Some(peel) = &mut by.peel {
                peel.trim(max_bytes);
            }
        }
    }
}
