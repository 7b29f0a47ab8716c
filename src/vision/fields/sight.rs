//! Which vertices of a mesh a camera sees: in its picture, of the mesh and not hidden by it.

use super::View;
use crate::error::one_of;
use crate::geometry::{Ray, Shape, Surfaces, TriangleMesh};
use crate::mesh::{Mesh, Raster};
use glam::DVec2;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// What a camera has to say of a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Sight {
    /// It sees it.
    Seen,
    /// Others disagree with what it sees.
    Outvoted,
    /// Something is before places so near to it that calibration and mesh may be off by as much.
    Near,
    /// Something is before it, or it faces away.
    Hidden,
    /// It lies beside the picture, or beside what of it is of the mesh.
    Beside,
}

/// How hidden vertices are found, from cheap to exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Visibility {
    /// What faces a camera and lies in its picture is seen.
    Facing,
    /// By depth maps.
    Depths,
    /// By depth maps with what hides dilated by four texels, since neither meshes nor calibrations are exact.
    Dilated,
    /// By rays: exact for the mesh as it is.
    Rays,
}

impl Visibility {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Facing, Self::Depths, Self::Dilated, Self::Rays];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Facing => "facing",
            Self::Depths => "depths",
            Self::Dilated => "dilated",
            Self::Rays => "rays",
        }
    }
}

impl std::str::FromStr for Visibility {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        one_of("way to find what is hidden", name, &Self::ALL, Self::name)
    }
}

/// Sine of the angle at which a surface is seen below which it is not: half a degree, as `surface.wgsl` has it.
pub(super) const LEAST_COSINE: f64 = 0.008_726_5;

/// How much nearer, relative, what hides must be: the device's.
const DEPTH_BIAS: f64 = 1e-3;

/// How far around a vertex its texels are looked at, in texels: `[M19]` section 4.2.
const DILATION_TEXELS: [f64; 3] = [1.5, 3.0, 4.0];

/// From a place to the four texels whose middles lie around it.
const AROUND: [DVec2; 4] =
    [DVec2::new(-0.5, -0.5), DVec2::new(0.5, -0.5), DVec2::new(-0.5, 0.5), DVec2::new(0.5, 0.5)];

/// How much nearer than a vertex' plane, relative, begins another surface: `camera_depth.wgsl`.
const DISCONTINUITY: f64 = 0.02;

/// By so much of the mesh's extent a ray begins before its vertex.
const RAY_START: f64 = 1e-6;

/// By no more than this factor the plane at a vertex is believed to change the depth over four texels.
const MOST_SLOPE: f64 = 1.25;

/// What a mesh hides, for rays.
pub(super) struct Hiding {
    surfaces: Option<Surfaces>,
    start_m: f64,
}

impl Hiding {
    /// Ready for rays only where `visibility` asks for them; a mesh that cannot be met by any hides nothing.
    pub(super) fn of(mesh: &Mesh, visibility: Visibility) -> Self {
        let made = (visibility == Visibility::Rays).then(|| {
            let model = TriangleMesh::new(mesh.positions_m.clone(), mesh.triangles.clone()).ok()?;
            Some(Surfaces::new(vec![Shape::Model(model)]))
        });
        let extent_m = mesh.bounds().map_or(0.0, |[low, high]| (high - low).length());
        Self { surfaces: made.flatten(), start_m: RAY_START * extent_m }
    }
}

/// What a camera sees of every vertex; depth maps have `side_px` texels along their longer side.
pub(super) fn sights(
    mesh: &Mesh,
    view: &View,
    (visibility, side_px): (Visibility, u32),
    hiding: &Hiding,
) -> Vec<Sight> {
    let camera = view.camera();
    let (width, height) = camera.size_px();
    let scale = f64::from(side_px) / f64::from(width.max(height));
    let size_px = [width, height].map(|side| ((f64::from(side) * scale).round() as usize).max(1));
    let raster = matches!(visibility, Visibility::Depths | Visibility::Dilated)
        .then(|| Raster::of(mesh, camera, size_px));
    let size = DVec2::new(size_px[0] as f64, size_px[1] as f64);
    // Eight directions find every straight edge to 0.3 texels.
    let dilation: Vec<DVec2> = (0..8 * DILATION_TEXELS.len())
        .map(|i| DVec2::from_angle((i % 8) as f64 * TAU / 8.0) * DILATION_TEXELS[i / 8])
        .map(|over| over.round())
        .collect();
    let sight = |vertex: usize| {
        let place = mesh.positions_m[vertex];
        let Some((texture, depth_m)) = view.project(place) else { return Sight::Beside };
        if !view.is_foreground(texture) {
            return Sight::Beside;
        }
        let normal = mesh.normals[vertex].as_dvec3();
        let to_eye = view.eye() - place;
        let distance_m = to_eye.length();
        if to_eye.dot(normal) <= LEAST_COSINE * distance_m {
            return Sight::Hidden;
        }
        if let Some(surfaces) = &hiding.surfaces {
            let ray = Ray { origin: place, direction: to_eye / distance_m };
            let start_m = hiding.start_m.min(0.5 * distance_m);
            let is_open = surfaces.hit(&ray, start_m).is_none_or(|hit| hit.distance_m >= distance_m);
            return if is_open { Sight::Seen } else { Sight::Hidden };
        }
        let Some(raster) = &raster else { return Sight::Seen };
        // Depths of the vertex' plane in the middles of texels: grazing surfaces do not hide themselves, nor do borders.
        let plane = |texel: DVec2| {
            let middle = (texel.floor() + 0.5).clamp(DVec2::splat(0.5), size - 0.5) / size;
            let along = camera.ray(middle).and_then(|ray| {
                let along_m = ray.distance_to_plane(place, normal)?;
                Some(camera.pose().local_from_world_point(ray.at(along_m)).z)
            });
            along.unwrap_or(depth_m).clamp(depth_m / MOST_SLOPE, depth_m * MOST_SLOPE)
        };
        let is_hidden = |texel: DVec2, bias: f64| raster.depth_m(texel) < plane(texel) / (1.0 + bias);
        let at = texture * size;
        let is_near_other = || dilation.iter().any(|over| is_hidden(at + *over, DISCONTINUITY));
        // At the foot of a wall, and wherever else what is nearer ends between the texels around a vertex, that hides nothing.
        if AROUND.iter().all(|over| is_hidden(at + *over, DEPTH_BIAS)) {
            Sight::Hidden
        } else if visibility == Visibility::Dilated && is_near_other() {
            Sight::Near
        } else {
            Sight::Seen
        }
    };
    (0..mesh.positions_m.len()).into_par_iter().map(sight).collect()
}
