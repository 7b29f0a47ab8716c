//! What is done to a piece of a picture once the scene is drawn on it, in the order of [`super::Pass`].

use super::camera_data::{Reach, depths_of};
use super::passes::{
    DISTANCE_FORMAT, DistancePass, Drawn, Lens, OcclusionPass, Recording, RelightPass, StipplePass,
};
use super::renderer::made;
use super::targets::{COLOR_FORMAT, Targets};
use super::{RenderError, View};
use crate::gpu::{Gpu, GpuError, GrowingBuffer, Readback, TextureDescriptor, Timer};
use glam::{DMat3, Vec3};
use videofields_picture::plan::{PlannedEffects, Projection};
use videofields_vision::effects::{self, Distances};
use videofields_vision::frame::RgbImage;

/// Bytes a drawn pixel that effects take beside the targets: distances, another light, what is open, occlusion, dots.
pub(super) const PIXEL_BYTES: u64 = 4 + 4 + 1 + 4 + 4;

/// What effects know of a piece beside what was drawn on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Around {
    /// Pixels of the finished picture that are drawn beside what is shown, on every side.
    pub margin_px: u32,
    /// How far occlusion looks at most: [`PlannedEffects::most_reach`].
    pub most_reach: f64,
    /// What the upper left pixel, with what is beside, is called in all of the picture.
    pub anchor_px: [i64; 2],
}

impl Around {
    /// The same in drawn pixels, where so many are drawn for one each way, or one for so many. Only the place within a pattern counts.
    fn drawn_anchor(&self, (times, step_px): (u32, u32)) -> [i32; 2] {
        let drawn = |along: i64| along.wrapping_mul(i64::from(times)).div_euclid(i64::from(step_px.max(1)));
        self.anchor_px.map(|along| drawn(along) as i32)
    }
}

/// The effects' passes, each made when a plan first calls for it.
#[derive(Debug)]
pub(super) struct EffectPasses {
    lens: GrowingBuffer,
    distance: DistancePass,
    relight: Option<RelightPass>,
    occlusion: Option<OcclusionPass>,
    stipple: Option<StipplePass>,
}

impl Default for EffectPasses {
    fn default() -> Self {
        Self {
            lens: GrowingBuffer::new("lens", wgpu::BufferUsages::UNIFORM),
            distance: DistancePass::default(),
            relight: None,
            occlusion: None,
            stipple: None,
        }
    }
}

/// A light's view: right, down and forward in the world.
fn axes_of(view: &View) -> [Vec3; 3] {
    let world_from_view = DMat3::from_quat(view.pose.world_from_local);
    [world_from_view.x_axis, world_from_view.y_axis, world_from_view.z_axis].map(|axis| axis.as_vec3())
}

impl Lens {
    /// Of a view that is drawn with so many pixels for one each way.
    fn new(view: &View, reach: &Reach, times: u32, anchor: [i32; 2]) -> Self {
        let [nearest_m, farthest_m] = depths_of(view, reach);
        let is_parallel = view.frustum.projection == Projection::Orthographic;
        let pitch = |[first, last]: [f64; 2], side: u32| (last - first) / f64::from(side * times);
        let (x, y) = (view.frustum.x, view.frustum.y);
        let extent_m = farthest_m - nearest_m;
        Self {
            first: [x[0] as f32, y[0] as f32],
            pitch: [pitch(x, view.width_px) as f32, pitch(y, view.height_px) as f32],
            start_m: nearest_m as f32,
            is_parallel: u32::from(is_parallel),
            scale: if is_parallel { extent_m } else { nearest_m } as f32,
            falling: if is_parallel { 0.0 } else { (nearest_m / extent_m) as f32 },
            anchor,
            pad: [0; 2],
        }
    }

    fn given(lens: &effects::Lens, anchor: [i32; 2]) -> Self {
        Self {
            first: lens.first.to_array(),
            pitch: lens.pitch.to_array(),
            start_m: lens.start_m,
            is_parallel: u32::from(lens.is_parallel),
            scale: 0.0,
            falling: 0.0,
            anchor,
            pad: [0; 2],
        }
    }
}

impl EffectPasses {
    /// Records what is done at the pixels that were drawn of `view` on `targets`, and hands out the picture.
    pub(super) fn drawn(
        &mut self,
        recording: &mut Recording<'_>,
        targets: &Targets,
        (view, reach): (&View, &Reach),
        (planned, around): (&PlannedEffects, &Around),
        pixels: (u32, u32),
    ) -> Result<wgpu::Texture, GpuError> {
        if !planned.needs_distances() {
            return Ok(targets.color.clone());
        }
        let lens = Lens::new(view, reach, pixels.0, around.drawn_anchor(pixels));
        let lens = self.lens.write(recording.gpu, &[lens]).clone();
        let distances = self.distance.record(recording, targets, &lens)?.clone();
        let most = around.most_reach as f32;
        self.lit(recording, (targets.color.clone(), &distances, &lens), (planned, most), axes_of(view))
    }

    fn lit(
        &mut self,
        recording: &mut Recording<'_>,
        (mut colors, distances, lens): (wgpu::Texture, &wgpu::Texture, &wgpu::Buffer),
        (planned, most): (&PlannedEffects, f32),
        axes: [Vec3; 3],
    ) -> Result<wgpu::Texture, GpuError> {
        let gpu = recording.gpu;
        if let Some(light) = &planned.relight {
            let pass = made(&mut self.relight, || RelightPass::new(gpu))?;
            let drawn = Drawn { colors: &colors, distances, lens };
            colors = pass.record(recording, &drawn, (light, axes))?.clone();
        }
        if let Some(occlusion) = &planned.occlusion {
            let pass = made(&mut self.occlusion, || OcclusionPass::new(gpu))?;
            let drawn = Drawn { colors: &colors, distances, lens };
            colors = pass.record(recording, &drawn, (occlusion, most))?.clone();
        }
        Ok(colors)
    }

    /// Records what is done at the pixels of the finished picture, and hands it out.
    pub(super) fn finished(
        &mut self,
        recording: &mut Recording<'_>,
        picture: wgpu::Texture,
        (planned, anchor_px): (&PlannedEffects, [i64; 2]),
    ) -> Result<wgpu::Texture, GpuError> {
        let Some(stipple) = &planned.stipple else { return Ok(picture) };
        let gpu = recording.gpu;
        let pass = made(&mut self.stipple, || StipplePass::new(gpu))?;
        // Only differences count, and these wrap around.
        let anchor = anchor_px.map(|along| along as i32);
        Ok(pass.record(recording, &picture, (stipple, anchor))?.clone())
    }

    /// Lets go of pictures of more than `max_bytes`.
    pub(super) fn trim(&mut self, max_bytes: u64) {
        self.distance.trim(max_bytes);
        if let Some(pass) = &mut self.relight {
            pass.trim(max_bytes);
        }
        if let Some(pass) = &mut self.occlusion {
            pass.trim(max_bytes);
        }
        if let Some(pass) = &mut self.stipple {
            pass.trim(max_bytes);
        }
    }
}

/// The effects' passes on a picture that comes from elsewhere, with its distances.
#[derive(Debug)]
pub struct EffectFilter {
    gpu: Gpu,
    passes: EffectPasses,
    timer: Timer,
    readback: Readback,
}

/// A picture to which effects are applied.
#[derive(Clone, Copy, Debug)]
pub struct Filtered<'a> {
    /// It.
    pub image: &'a RgbImage,
    /// How far what it shows lies, for every pixel of it.
    pub distances: Distances<'a>,
    /// Right, down and forward of its view in the world.
    pub axes: [Vec3; 3],
    /// What bounds occlusion's radius: a tangent, of parallel rays metres.
    pub most_reach: f32,
    /// What its upper left pixel is called.
    pub anchor_px: [i32; 2],
}

impl EffectFilter {
    /// On `gpu`. Compiles nothing yet.
    #[must_use]
    pub fn new(gpu: Gpu) -> Self {
        let timer = Timer::new(&gpu);
        Self { gpu, passes: EffectPasses::default(), timer, readback: Readback::default() }
    }

    /// The picture with the effects.
    ///
    /// # Errors
    /// A picture without pixels, or with more or fewer than distances; what the device reports.
    pub fn apply(
        &mut self,
        filtered: &Filtered<'_>,
        planned: &PlannedEffects,
    ) -> Result<RgbImage, RenderError> {
        let Filtered { image, distances, axes, most_reach, anchor_px } = filtered;
        let n_pixels = image.width as usize * image.height as usize;
        let is_whole = n_pixels > 0 && image.data.len() == 3 * n_pixels;
        if !(is_whole && distances.width == image.width && distances.beyond_m.len() == n_pixels) {
            let message = format!(
                "a picture of {} x {} pixels with {} distances in rows of {}",
                image.width,
                image.height,
                distances.beyond_m.len(),
                distances.width
            );
            return Err(RenderError::Plan(message));
        }
        let gpu = &self.gpu;
        gpu.check()?;
        let texels: Vec<u8> =
            image.data.as_chunks::<3>().0.iter().flat_map(|[r, g, b]| [*r, *g, *b, 255]).collect();
        let size_px = (image.width, image.height);
        let colors = uploaded(gpu, COLOR_FORMAT, size_px, &texels);
        let far = uploaded(gpu, DISTANCE_FORMAT, size_px, bytemuck::cast_slice(distances.beyond_m));
        let lens = Lens::given(&distances.lens, *anchor_px);
        let lens = self.passes.lens.write(gpu, &[lens]).clone();
        self.timer.begin_frame();
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("filter") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        let mut recording = Recording { gpu, encoder: &mut encoder, timer: &mut self.timer };
        let lit = self.passes.lit(&mut recording, (colors, &far, &lens), (planned, *most_reach), *axes)?;
        let anchor_px = anchor_px.map(i64::from);
        let picture = self.passes.finished(&mut recording, lit, (planned, anchor_px))?;
        self.readback.copy(gpu, &mut encoder, &picture);
        gpu.queue.submit([encoder.finish()]);
        let mut data = vec![0; image.data.len()];
        self.readback.read_rgb(gpu, &mut data, 3 * image.width as usize)?;
        Ok(RgbImage { width: image.width, height: image.height, data })
    }
}

/// A texture of four bytes a pixel with that in it.
fn uploaded(
    gpu: &Gpu,
    format: wgpu::TextureFormat,
    (width, height): (u32, u32),
    bytes: &[u8],
) -> wgpu::Texture {
    let texture = gpu.texture(&TextureDescriptor {
        label: Some("filtered"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * width), rows_per_image: None };
    gpu.upload("filtered", texture.as_image_copy(), (bytes, layout), texture.size());
    texture
}
