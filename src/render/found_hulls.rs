//! What was found of hulls' surfaces in the picture that was drawn last, for who compares and measures.

use super::{RenderError, Renderer};
use crate::gpu::Readback;
use glam::{Vec2, Vec3};

/// Thickness that a texel can tell, metres along the ray: `MOST_THICKNESS` of common/hull.wgsl.
const MOST_THICKNESS: f32 = 16.0;

/// The surface nearest to the eye at every pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundHulls {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Row by row; none where there is no hull.
    pub pixels: Vec<Option<FoundHull>>,
}

/// A hull's surface at a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundHull {
    /// Which of the plan's hulls.
    pub hull: usize,
    /// Its depth: distance from the eye along the view's axis (of parallel rays from the plane through it), metres.
    pub depth_m: f32,
    /// How far the pixel's ray stays within, as `depth_m`; 0 where the method does not know.
    pub thickness_m: f32,
    /// Unit vector.
    pub normal_in_world: Vec3,
    /// Share of the pixel that it covers, as far as the method knows, 0 to 1.
    pub coverage: f32,
}

impl Renderer {
    /// What was found of hulls in the piece of a picture that was drawn last; none where its plan had no hull in view.
    ///
    /// # Errors
    /// What the device reported.
    pub fn found_hulls(&mut self) -> Result<Option<FoundHulls>, RenderError> {
        let Some(surface) = self.hulls.surface() else { return Ok(None) };
        let mut readback = Readback::default();
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("found hulls") };
        let mut encoder = self.gpu.device.create_command_encoder(&descriptor);
        readback.copy(&self.gpu, &mut encoder, surface);
        self.gpu.queue.submit([encoder.finish()]);
        let mut texels: Vec<[u32; 4]> = Vec::new();
        readback.read_texels(&self.gpu, &mut texels)?;
        let (width_px, height_px) = (surface.width(), surface.height());
        Ok(Some(FoundHulls { width_px, height_px, pixels: texels.into_iter().map(unpacked).collect() }))
    }
}

/// As `unpacked_surface` of common/hull.wgsl.
fn unpacked([depth, normal, hull, more]: [u32; 4]) -> Option<FoundHull> {
    let hull = (hull >> 24).checked_sub(1)? as usize;
    let low = |bits: u32| bits as u16;
    let high = |bits: u32| (bits >> 16) as u16;
    let signed = |bits: u16| (f32::from(bits as i16) / 32767.0).max(-1.0);
    let share = |bits: u16| f32::from(bits) / 65535.0;
    let p = Vec2::new(signed(low(normal)), signed(high(normal)));
    let z = 1.0 - p.x.abs() - p.y.abs();
    let sign = |of: f32| if of >= 0.0 { 1.0 } else { -1.0 };
    let folded = Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y));
    Some(FoundHull {
        hull,
        depth_m: f32::from_bits(depth),
        thickness_m: share(low(more)) * MOST_THICKNESS,
        normal_in_world: (if z < 0.0 { folded } else { p }).extend(z).normalize(),
        coverage: share(high(more)),
    })
}
