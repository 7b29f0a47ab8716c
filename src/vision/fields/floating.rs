//! Pictures that lie beside each other where they are shown brought together: a baseline that fields are compared with.
//!
//! `[E08]` Eisemann, De Decker, Magnor et al. 2008, Floating Textures, Computer Graphics Forum 27(2), sections 3 and 5: each camera's
//! picture is projected on the mesh as the viewer sees it, flows between all pairs of these tell how far a place of one lies beside the
//! same place of another, and each is warped to where all of them have it in the mean, by what they lend. Two departures: flows are found
//! in cells of some pixels, since they are smooth, and pictures are looked up where the warp points to, on the plane of the triangle that
//! is seen, so that nothing is sampled twice.

use super::flow::{Gray, flow};
use super::shade::{Place, place_of};
use super::{View, Weights};
use crate::frame::codes_of;
use crate::geometry::Camera;
use crate::mesh::{Mesh, Raster};
use glam::{DVec2, Vec2};
use rayon::prelude::*;

/// Cells along a picture's longer side, at most.
const MOST_CELLS: usize = 360;

/// So many views, those that lend most, float; all others stay where they are: pairs are as many as their square.
const MOST_VIEWS: usize = 12;

/// Pairs that share fewer cells than this stay where they are.
const LEAST_SHARED: usize = 64;

/// Where each view's picture is to be looked up.
pub(super) struct Floats {
    /// Pixels of a cell's side.
    cell_px: usize,
    size: [usize; 2],
    n_views: usize,
    /// By cell, and of a cell by view: pixels from where the view has a place to where all of them have it in the mean.
    warps: Vec<Vec2>,
}

impl Floats {
    /// Of what `camera` sees of a mesh, at the size of `raster`.
    pub(super) fn of(
        (mesh, raster): (&Mesh, &Raster),
        camera: &Camera,
        (views, weights): (&[View], &Weights),
    ) -> Self {
        let [width, height] = raster.size_px();
        let cell_px = width.max(height).div_ceil(MOST_CELLS).max(1);
        let size = [width, height].map(|side| side.div_ceil(cell_px));
        let n_views = views.len();
        let mut lent = vec![0.0_f32; size[0] * size[1] * n_views];
        let mut codes = vec![0.0_f32; lent.len()];
        let rows = lent.par_chunks_mut(n_views).zip(codes.par_chunks_mut(n_views)).enumerate();
        rows.for_each(|(cell, (lent, codes))| {
            let [x, y] = [cell % size[0], cell / size[0]].map(|of| of * cell_px + cell_px / 2);
            let (x, y) = (x.min(width - 1), y.min(height - 1));
            let texture =
                DVec2::new(x as f64 + 0.5, y as f64 + 0.5) / DVec2::new(width as f64, height as f64);
            let Some(place) = place_of(mesh, raster, y * width + x, (camera, texture)) else { return };
            let own_scale = width as f64 / f64::from(camera.size_px().0);
            let own_px_per_m = camera.focal_px().x * own_scale / place.depth_m.max(1e-9);
            for (view, of) in views.iter().enumerate() {
                let share = place.lent(weights, view);
                let Some((texture, depth_m)) = (share > 0.0).then(|| of.project(place.at)).flatten() else {
                    continue;
                };
                let coarse = cell_px as f64 * (of.px_per_m(depth_m) / own_px_per_m).max(1.0);
                let light = of.light_at(texture, coarse.log2() as f32);
                lent[view] = share;
                codes[view] = codes_of(light).into_iter().map(f32::from).sum::<f32>() / 3.0;
            }
        });
        let mut floating: Vec<usize> = (0..n_views).collect();
        let lent_by = |view: usize| lent.iter().skip(view).step_by(n_views).sum::<f32>();
        floating.sort_by(|a, b| lent_by(*b).total_cmp(&lent_by(*a)));
        floating.truncate(MOST_VIEWS);
        let grays: Vec<Gray> = floating
            .iter()
            .map(|view| {
                let of = |all: &[f32]| all.iter().skip(*view).step_by(n_views).copied().collect::<Vec<f32>>();
                Gray {
                    size_px: size,
                    codes: of(&codes),
                    is_known: of(&lent).into_iter().map(|share| share > 0.0).collect(),
                }
            })
            .collect();
        let pairs: Vec<(usize, usize)> =
            (0..grays.len()).flat_map(|a| (a + 1..grays.len()).map(move |b| (a, b))).collect();
        let flows: Vec<(usize, usize, Vec<Vec2>)> = pairs
            .into_par_iter()
            .filter(|(a, b)| {
                let both = grays[*a].is_known.iter().zip(&grays[*b].is_known);
                both.filter(|(a, b)| **a && **b).count() >= LEAST_SHARED
            })
            .map(|(a, b)| (floating[a], floating[b], flow(&grays[a], &grays[b])))
            .collect();
        let mut warps = vec![Vec2::ZERO; lent.len()];
        for (a, b, flow) in &flows {
            for ((warps, lent), flow) in warps.chunks_mut(n_views).zip(lent.chunks(n_views)).zip(flow) {
                let sum: f32 = lent.iter().sum();
                if sum > 0.0 {
                    // `[E08]` section 3: by what the other lends. The way back is the way there, to first order.
                    warps[*a] += cell_px as f32 * lent[*b] / sum * *flow;
                    warps[*b] -= cell_px as f32 * lent[*a] / sum * *flow;
                }
            }
        }
        Self { cell_px, size, n_views, warps }
    }

    /// A view's warp at a place of the picture, pixels: between cells, by how near each is.
    fn warp(&self, at_px: DVec2, view: usize) -> Vec2 {
        let last = Vec2::new((self.size[0] - 1) as f32, (self.size[1] - 1) as f32);
        let at = (at_px.as_vec2() / self.cell_px as f32 - 0.5).clamp(Vec2::ZERO, last);
        let (low, share) = (at.floor(), at.fract());
        let of = |x: f32, y: f32| {
            let (x, y) = (x.min(last.x) as usize, y.min(last.y) as usize);
            self.warps[(y * self.size[0] + x) * self.n_views + view]
        };
        let across = |y: f32| of(low.x, y).lerp(of(low.x + 1.0, y), share.x);
        across(low.y).lerp(across(low.y + 1.0), share.y)
    }

    /// Where in a view's picture what is shown of a place is looked up, and how deep that lies; none beside the picture. `texture` is the
    /// place's own in the viewer's.
    pub(super) fn look_up(
        &self,
        place: &Place,
        mesh: &Mesh,
        (camera, texture, size_px): (&Camera, DVec2, DVec2),
        (idx, view): (usize, &View),
    ) -> Option<(DVec2, f64)> {
        let warp = self.warp(texture * size_px, idx);
        let [a, b, c] = place.corners.map(|corner| mesh.positions_m[corner as usize]);
        let beside = (texture - warp.as_dvec2() / size_px).clamp(DVec2::ZERO, DVec2::ONE);
        let moved = (warp != Vec2::ZERO).then(|| camera.ray(beside)).flatten().and_then(|ray| {
            let along_m = ray.distance_to_plane(a, (b - a).cross(c - a).normalize_or_zero())?;
            view.project(ray.at(along_m))
        });
        moved.or_else(|| view.project(place.at))
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{grid, looking};
    use super::super::{Blend, Field, FieldSettings, Topology, shade};
    use super::*;
    use crate::frame::{Mask, RgbImage};
    use glam::{DVec3, Vec3};

    fn stripes(x: f64, y: f64) -> Vec3 {
        Vec3::splat(0.3 + 0.2 * (5.0 * x).sin() as f32 * (4.0 * y).cos() as f32)
    }

    /// A picture of level ground between two cameras, of which the second shows everything so far beside.
    fn between(off_m: f64, blend: Blend, masks: [Option<Mask>; 2]) -> RgbImage {
        let (positions, triangles) = grid(9, 0.0, |_, _| 0.0);
        let topology = Topology::of(&positions, &triangles);
        let mesh = Mesh::new(positions, triangles);
        let aim = DVec3::new(4.0, 4.001, 0.0);
        let [first, last] = masks;
        let of = |view: View, mask| View::new(view.camera().clone(), view.picture().clone(), mask);
        let mut views = vec![
            of(looking(DVec3::new(3.0, 4.0, 9.0), aim, stripes), first),
            of(looking(DVec3::new(5.0, 4.0, 9.0), aim, |x, y| stripes(x - off_m, y)), last),
        ];
        let field = Field::new(
            &mesh,
            &topology,
            &mut views,
            &FieldSettings { is_evened: false, ..FieldSettings::default() },
        )
        .unwrap();
        let camera = looking(DVec3::new(4.0, 4.0, 8.0), aim, stripes).camera().clone();
        let raster = Raster::of(&mesh, &camera, [240, 240]);
        shade((&mesh, &raster), &camera, (&field, &views, &field.by_normals()), blend).picture
    }

    /// How far codes are from their mean in the middle of a picture.
    fn contrast(picture: &RgbImage) -> f64 {
        let codes: Vec<f64> = (80 * 240..160 * 240)
            .filter(|pixel| (80..160).contains(&(pixel % 240)))
            .map(|pixel| f64::from(picture.data[3 * pixel]))
            .collect();
        let mean = codes.iter().sum::<f64>() / codes.len() as f64;
        (codes.iter().map(|code| (code - mean).powi(2)).sum::<f64>() / codes.len() as f64).sqrt()
    }

    #[test]
    fn what_lies_beside_is_as_sharp_as_what_does_not() {
        // A third of a wave beside: both together keep half of it.
        let sharp = contrast(&between(0.0, Blend::Mixed, [None, None]));
        let [mixed, floating] =
            [Blend::Mixed, Blend::Floating].map(|blend| contrast(&between(0.42, blend, [None, None])));
        assert!(mixed < 0.6 * sharp && floating > 0.8 * sharp, "{sharp} {mixed} {floating}");
        // What agrees stays.
        let same = between(0.0, Blend::Floating, [None, None]);
        let off = same
            .data
            .iter()
            .zip(&between(0.0, Blend::Mixed, [None, None]).data)
            .map(|(a, b)| a.abs_diff(*b))
            .max();
        assert!(off.unwrap() <= 6, "{off:?}");
    }

    #[test]
    fn pictures_without_a_place_in_common_stay_as_they_are() {
        let half = |is_left: bool| Mask {
            width: 240,
            height: 240,
            data: (0..240 * 240)
                .map(|at| u8::from((at % 240 < 120) == is_left) * 255)
                .collect::<Vec<u8>>()
                .into(),
        };
        let masks = || [Some(half(true)), Some(half(false))];
        let none = || [Some(Mask::filled(240, 240, 255)), Some(Mask::filled(240, 240, 0))];
        let n_other = |masks: &dyn Fn() -> [Option<Mask>; 2]| {
            let [mixed, floating] =
                [Blend::Mixed, Blend::Floating].map(|blend| between(0.42, blend, masks()));
            mixed.data.iter().zip(&floating.data).filter(|(a, b)| a != b).count()
        };
        // Along the one line of triangles that both reach into: an eighth of the ground.
        assert!(n_other(&masks) < 3 * 240 * 240 / 8, "{}", n_other(&masks));
        assert_eq!(n_other(&none), 0);
    }
}
