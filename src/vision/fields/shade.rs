//! A mesh as a camera would see it, coloured by what others see of it: what a device's pictures are held to.

use super::floating::Floats;
use super::{Field, View, Weights};
use crate::frame::{Mask, RgbImage, codes_of};
use crate::geometry::Camera;
use crate::mesh::{Mesh, NO_TRIANGLE, Raster};
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

/// In place of the view that lends most, where none lends anything.
pub const NO_VIEW: u8 = u8::MAX;

/// How the colours of views become one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Blend {
    /// Each counts as much as it lends.
    Mixed,
    /// The one that lends most alone.
    Best,
    /// Each counts as much as it lends, in a level of detail in which it cannot be beside the others: so coarse as a wrong depth of so
    /// many metres moves it (`[EM07]` Eisemann and Magnor 2007, Filtered Blending).
    Filtered {
        /// By how much depths are wrong, metres.
        error_m: f64,
    },
    /// Each counts as much as it lends, where optical flow between the pictures as the viewer would see them says that they show the same
    /// (`[E08]` Eisemann et al. 2008, Floating Textures).
    Floating,
}

/// A picture of a mesh.
#[derive(Clone, Debug)]
pub struct Shaded {
    /// Black where nothing is.
    pub picture: RgbImage,
    /// 255 where the mesh is and some view lends to it.
    pub covered: Mask,
    /// Which view lends most; [`NO_VIEW`] where none does, or nothing is.
    pub owners: Mask,
    /// What its steps from pixel to pixel come from.
    pub steps: Steps,
}

/// Steps between neighbours that are covered, right and below, by what they come from, as sums over all pairs. With g the means of
/// views' sRGB channels (8-bit codes) and w what they lend, a step from a to b is exactly the sum over the views of
/// (w(b) - w(a)) (g(a) + g(b)) / 2, which is the fields', and (w(a) + w(b)) / 2 (g(b) - g(a)), which is the pictures' own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Steps {
    /// The sizes of the fields' parts.
    pub across: f64,
    /// Their squares.
    pub across_squared: f64,
    /// The sizes of the pictures' parts.
    pub within: f64,
    /// How many pairs there are.
    pub n_pairs: u64,
}

impl Steps {
    /// Seam energy: what a change of fields adds to a step, in the mean, 8-bit codes; none without pairs. Of a change from one camera to
    /// another it is the same however wide it is spread.
    #[must_use]
    pub fn energy(&self) -> Option<f64> {
        (self.n_pairs > 0).then(|| self.across / self.n_pairs as f64)
    }

    /// The same as a root of the mean of squares, 8-bit codes, for which a step that is spread over n pixels is root n times as small:
    /// what is seen of seams are sharp steps; none without pairs.
    #[must_use]
    pub fn sharpness(&self) -> Option<f64> {
        (self.n_pairs > 0).then(|| (self.across_squared / self.n_pairs as f64).sqrt())
    }

    /// Seam energy over what pictures have themselves; none where they have no steps.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        (self.within > 0.0).then(|| self.across / self.within)
    }

    /// Of both together.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            across: self.across + other.across,
            across_squared: self.across_squared + other.across_squared,
            within: self.within + other.within,
            n_pairs: self.n_pairs + other.n_pairs,
        }
    }
}

/// A place of a mesh in a picture.
pub(super) struct Place {
    pub(super) at: DVec3,
    pub(super) corners: [u32; 3],
    /// Of the corners.
    shares: [f32; 3],
    pub(super) depth_m: f64,
}

impl Place {
    /// What a view lends there.
    pub(super) fn lent(&self, weights: &Weights, view: usize) -> f32 {
        self.corners.iter().zip(self.shares).map(|(corner, share)| weights.of(*corner)[view] * share).sum()
    }
}

/// Rows that are shaded at once, and for one more what steps to them come from.
const BAND_ROWS: usize = 16;

/// What a pixel is mixed of: every view, and last what is known of places that none sees.
struct Mixing<'a> {
    mesh: &'a Mesh,
    raster: &'a Raster,
    camera: &'a Camera,
    field: &'a Field,
    views: &'a [View],
    weights: &'a Weights,
    blend: Blend,
    /// Of [`Blend::Floating`].
    floats: Option<Floats>,
}

/// What views show of some pixels, and how much they lend there: so many numbers a pixel as views, and one more.
struct Parts {
    lent: Vec<f32>,
    lights: Vec<Vec3>,
    /// Whether a view lends to each, and which most.
    owners: Vec<Option<u8>>,
    is_covered: Vec<bool>,
}

/// Draws a mesh as `camera` sees it, at the size of `raster`, which is of both.
///
/// **Memory** sixteen bytes a view and pixel of 17 rows, a thread.
///
/// # Panics
/// Where mesh, views and weights are not those that the field was made of.
#[must_use]
pub fn shade(
    (mesh, raster): (&Mesh, &Raster),
    camera: &Camera,
    (field, views, weights): (&Field, &[View], &Weights),
    blend: Blend,
) -> Shaded {
    let [width, height] = raster.size_px();
    let floats = (blend == Blend::Floating).then(|| Floats::of((mesh, raster), camera, (views, weights)));
    let mixing = Mixing { mesh, raster, camera, field, views, weights, blend, floats };
    let mut data = vec![0; 3 * width * height];
    let (mut covered, mut owners) = (vec![0_u8; width * height], vec![NO_VIEW; width * height]);
    let bands = data.par_chunks_mut(3 * width * BAND_ROWS).zip(covered.par_chunks_mut(width * BAND_ROWS));
    let bands = bands.zip(owners.par_chunks_mut(width * BAND_ROWS)).enumerate();
    let steps = bands.map(|(band, ((data, covered), owners))| {
        let first = band * BAND_ROWS;
        let n_rows = BAND_ROWS.min(height - first);
        let parts = mixing.parts(first * width..(first + n_rows + 1).min(height) * width);
        for (pixel, codes) in data.chunks_exact_mut(3).enumerate() {
            let Some(owner) = parts.owners[pixel] else { continue };
            codes.copy_from_slice(&codes_of(parts.light(pixel)));
            covered[pixel] = u8::from(parts.is_covered[pixel]) * 255;
            owners[pixel] = owner;
        }
        parts.steps(width, n_rows)
    });
    let steps = steps.reduce(Steps::default, Steps::plus);
    let (width, height) = (width as u32, height as u32);
    Shaded {
        picture: RgbImage { width, height, data },
        covered: Mask { width, height, data: covered.into() },
        owners: Mask { width, height, data: owners.into() },
        steps,
    }
}

impl Mixing<'_> {
    fn parts(&self, pixels: std::ops::Range<usize>) -> Parts {
        let n_parts = self.views.len() + 1;
        let mut parts = Parts {
            lent: vec![0.0; n_parts * pixels.len()],
            lights: vec![Vec3::ZERO; n_parts * pixels.len()],
            owners: vec![None; pixels.len()],
            is_covered: vec![false; pixels.len()],
        };
        for (i, pixel) in pixels.enumerate() {
            let row = n_parts * i..n_parts * (i + 1);
            let (lent, lights) = (&mut parts.lent[row.clone()], &mut parts.lights[row]);
            if let Some(owner) = self.pixel(pixel, lent, lights) {
                parts.owners[i] = Some(owner);
                parts.is_covered[i] = lent[self.views.len()] < 0.5;
            }
        }
        parts
    }

    /// What one pixel is mixed of, into lists of one part a view and one more, and which view lends most; none where nothing is.
    fn pixel(&self, pixel: usize, lent: &mut [f32], lights: &mut [Vec3]) -> Option<u8> {
        let [width, height] = self.raster.size_px();
        let size = DVec2::new(width as f64, height as f64);
        let texture = DVec2::new((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5) / size;
        let place = place_of(self.mesh, self.raster, pixel, (self.camera, texture))?;
        let own_scale = size.x / f64::from(self.camera.size_px().0);
        let own_px_per_m = self.camera.focal_px().x * own_scale / place.depth_m.max(1e-9);
        let n_views = self.views.len();
        let mut covered = 0.0;
        for (view, own) in lent[..n_views].iter_mut().enumerate() {
            *own = place.lent(self.weights, view);
            covered += *own;
        }
        let most = (0..n_views).max_by(|a, b| lent[*a].total_cmp(&lent[*b]))?;
        let mut used = 0.0;
        for (view, of) in self.views.iter().enumerate() {
            if self.blend == Blend::Best && view != most {
                lent[view] = 0.0;
            }
            let shown = || match &self.floats {
                Some(floats) => floats.look_up(&place, self.mesh, (self.camera, texture, size), (view, of)),
                None => of.project(place.at),
            };
            let Some((texture, depth_m)) = (lent[view] > 0.0).then(shown).flatten() else {
                lent[view] = 0.0;
                continue;
            };
            let mut coarse = of.px_per_m(depth_m) / own_px_per_m;
            if let Blend::Filtered { error_m } = self.blend {
                // What lies `error_m` deeper along the viewer's ray is seen beside by this many of the view's pixels.
                let eyes = [self.camera.pose().position_in_world, of.eye()];
                let [to_eye, to_view] = eyes.map(|eye| (eye - place.at).normalize_or_zero());
                coarse = coarse.max(error_m * to_eye.cross(to_view).length() * of.px_per_m(depth_m));
            }
            lights[view] = of.light_at(texture, coarse.max(1.0).log2() as f32);
            used += lent[view];
        }
        let unseen = place.corners.map(|corner| self.field.colors()[corner as usize]);
        lights[n_views] = unseen.iter().zip(place.shares).map(|(color, share)| *color * share).sum();
        // What a view lends beside its picture others lend in its place.
        let covered = if used > 0.0 { covered.clamp(0.0, 1.0) } else { 0.0 };
        lent[..n_views].iter_mut().for_each(|own| *own *= covered / used.max(f32::MIN_POSITIVE));
        lent[n_views] = 1.0 - covered;
        Some(if used > 0.0 { most as u8 } else { NO_VIEW })
    }
}

impl Parts {
    fn n_parts(&self) -> usize {
        self.lent.len() / self.owners.len().max(1)
    }

    fn light(&self, pixel: usize) -> Vec3 {
        let row = self.n_parts() * pixel..self.n_parts() * (pixel + 1);
        self.lent[row.clone()].iter().zip(&self.lights[row]).map(|(lent, light)| *lent * *light).sum()
    }

    /// Steps to the right and below from pixels of the first rows.
    fn steps(&self, width: usize, n_rows: usize) -> Steps {
        let n_parts = self.n_parts();
        let gray = |light: &Vec3| codes_of(*light).into_iter().map(f32::from).sum::<f32>() / 3.0;
        let grays: Vec<f32> = self.lights.iter().map(gray).collect();
        let n_pixels = self.owners.len();
        let mut steps = Steps::default();
        let mut add = |a: usize, b: usize| {
            if b >= n_pixels || !self.is_covered[a] || !self.is_covered[b] {
                return;
            }
            let (mut across, mut within) = (0.0, 0.0);
            for (a, b) in (n_parts * a..n_parts * (a + 1)).zip(n_parts * b..) {
                // Who lends to one of both alone shows the same in the other.
                let (lent_a, lent_b) = (self.lent[a], self.lent[b]);
                let gray_a = if lent_a > 0.0 { grays[a] } else { grays[b] };
                let gray_b = if lent_b > 0.0 { grays[b] } else { gray_a };
                across += (lent_b - lent_a) * 0.5 * (gray_a + gray_b);
                within += 0.5 * (lent_a + lent_b) * (gray_b - gray_a);
            }
            steps.across += f64::from(across.abs());
            steps.across_squared += f64::from(across).powi(2);
            steps.within += f64::from(within.abs());
            steps.n_pairs += 1;
        };
        for pixel in 0..width * n_rows {
            if pixel % width + 1 < width {
                add(pixel, pixel + 1);
            }
            add(pixel, pixel + width);
        }
        steps
    }
}

/// Where on the mesh the middle of a pixel is.
pub(super) fn place_of(
    mesh: &Mesh,
    raster: &Raster,
    pixel: usize,
    (camera, texture): (&Camera, DVec2),
) -> Option<Place> {
    let triangle = raster.triangles()[pixel];
    if triangle == NO_TRIANGLE {
        return None;
    }
    let corners = mesh.triangles[triangle as usize];
    let [a, b, c] = corners.map(|corner| mesh.positions_m[corner as usize]);
    let ray = camera.ray(texture)?;
    let across = (b - a).cross(c - a);
    let along_m = across.dot(a - ray.origin) / across.dot(ray.direction);
    let depth_m = f64::from(raster.depths_m()[pixel]);
    let at = if along_m.is_finite() { ray.at(along_m) } else { a };
    let area = across.length_squared().max(f64::MIN_POSITIVE);
    let of_b = ((at - a).cross(c - a).dot(across) / area).clamp(0.0, 1.0);
    let of_c = ((b - a).cross(at - a).dot(across) / area).clamp(0.0, 1.0 - of_b);
    Some(Place { at, corners, shares: [1.0 - of_b - of_c, of_b, of_c].map(|share| share as f32), depth_m })
}
