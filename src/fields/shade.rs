//! A mesh as a camera would see it, coloured by what others see of it: what a device's pictures are held to.

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
}

/// A place of a mesh in a picture.
struct Place {
    at: DVec3,
    corners: [u32; 3],
    /// Of the corners.
    shares: [f32; 3],
    depth_m: f64,
}

/// Draws a mesh as `camera` sees it, at the size of `raster`, which is of both.
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
    let size = DVec2::new(width as f64, height as f64);
    let eye = camera.pose().position_in_world;
    let px_per_m =
        |depth_m: f64| camera.focal_px().x * size.x / f64::from(camera.size_px().0) / depth_m.max(1e-9);
    let color = |pixel: usize| {
        let texture = DVec2::new((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5) / size;
        let place = place_of(mesh, raster, pixel, (camera, texture))?;
        let shares = place.shares;
        let mixed = |of: [Vec3; 3]| of[0] * shares[0] + of[1] * shares[1] + of[2] * shares[2];
        let unseen = mixed(place.corners.map(|corner| field.colors()[corner as usize]));
        let rows = place.corners.map(|corner| weights.of(corner));
        let lent = |view: usize| rows.iter().zip(shares).map(|(row, share)| row[view] * share).sum::<f32>();
        let covered: f32 = (0..weights.n_views()).map(lent).sum();
        let most = (0..weights.n_views()).max_by(|a, b| lent(*a).total_cmp(&lent(*b)))?;
        let (mut sum, mut used) = (Vec3::ZERO, 0.0);
        for (view, of) in views.iter().enumerate() {
            let share = match blend {
                Blend::Best => f32::from(u8::from(view == most && lent(view) > 0.0)),
                _ => lent(view),
            };
            let Some((texture, depth_m)) = (share > 0.0).then(|| of.project(place.at)).flatten() else {
                continue;
            };
            let mut coarse = of.px_per_m(depth_m) / px_per_m(place.depth_m);
            if let Blend::Filtered { error_m } = blend {
                // What lies `error_m` deeper along the viewer's ray is seen beside by this many of the view's pixels.
                let [to_eye, to_view] = [eye, of.eye()].map(|from| (from - place.at).normalize_or_zero());
                let beside_m = error_m * to_eye.cross(to_view).length();
                coarse = coarse.max(beside_m * of.px_per_m(depth_m));
            }
            sum += share * of.light_at(texture, coarse.max(1.0).log2() as f32);
            used += share;
        }
        let seen = if used > 0.0 { sum / used } else { unseen };
        let is_covered = used > 0.0 && covered > 0.5;
        let owner = if used > 0.0 { most as u8 } else { NO_VIEW };
        Some((codes_of(unseen.lerp(seen, covered.clamp(0.0, 1.0))), is_covered, owner))
    };
    let colors: Vec<Option<([u8; 3], bool, u8)>> = (0..width * height).into_par_iter().map(color).collect();
    let (width, height) = (width as u32, height as u32);
    let (mut covered, mut owners) = (Mask::filled(width, height, 0), Mask::filled(width, height, NO_VIEW));
    let mut data = vec![0; colors.len() * 3];
    for (pixel, color) in colors.into_iter().enumerate() {
        let Some((codes, is_covered, owner)) = color else { continue };
        data[pixel * 3..pixel * 3 + 3].copy_from_slice(&codes);
        covered.data[pixel] = if is_covered { 255 } else { 0 };
        owners.data[pixel] = owner;
    }
    Shaded { picture: RgbImage { width, height, data }, covered, owners }
}

/// Where on the mesh the middle of a pixel is.
fn place_of(
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
