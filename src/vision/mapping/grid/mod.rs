//! The grid builder: surface points projected into the picture and hashed by texel, as Video Fields has it
//! (eq. 8), with what the paper leaves out: points that something hides are dropped.
//!
//! Points lie at the middles of cells of at most the step's size on every side of every surface; of those that
//! fall into one texel the nearest to its centre stays. `gaps` interpolates the texels between. Needs projection
//! alone, never the inverse of the lens.

mod gaps;

use super::map::{Coverage, Texel, WorldMap};
use super::side::Side;
use super::{Builder, Location, MappingError, RELIABLE_THETA_RAD};
use crate::geometry::{
    Camera, Face, GroundPolygon, Hit, OrientedBox, Ray, Shape, SurfaceId, Surfaces, Triangle,
};
use glam::{DMat2, DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;

/// Most points of a grid over all surfaces together: some seconds of work a core.
pub const MAX_GRID_POINTS: u64 = 1 << 26;

/// Points that are projected between two updates of the nearest ones.
const CHUNK: u64 = 1 << 16;

/// Texels around the picture in which points are kept as well, so that gaps at its border have a far side.
const MARGIN_PX: u32 = 64;

/// How the grid is laid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridSettings {
    /// Largest distance between neighbouring points along a side of the grid, metres, 0.001 to 1000. At 0.05
    /// about half the texels of a usual view get a point of their own.
    pub step_m: f64,
}

impl GridSettings {
    pub(super) fn check(self) -> Result<(), MappingError> {
        if (1e-3..=1e3).contains(&self.step_m) { Ok(()) } else { Err(MappingError::Step) }
    }
}

/// The map of a size that was checked.
pub(super) fn build(
    settings: GridSettings,
    camera: &Camera,
    surfaces: &Surfaces,
    size_px: (u32, u32),
) -> Result<WorldMap, MappingError> {
    settings.check()?;
    let eye = camera.pose().position_in_world;
    let patches = patches(surfaces, eye, settings.step_m);
    let count = patches.iter().fold(0_u64, |sum, patch| sum.saturating_add(patch.n_points()));
    if count > MAX_GRID_POINTS {
        return Err(MappingError::GridPoints { count });
    }
    let scene = Scene { camera, surfaces, patches, size_px };
    let (width, height) = scene.table_size();
    let mut samples = vec![Sample::NONE; width * height];
    for patch in 0..scene.patches.len() {
        scene.project(patch, &mut samples);
    }
    scene.measure_reach(&mut samples);
    let filled = gaps::fill(&scene, &samples);
    let (n_columns, n_rows) = (size_px.0 as usize, size_px.1 as usize);
    let margin = MARGIN_PX as usize;
    let in_table = |idx: usize| (idx / n_columns + margin) * width + idx % n_columns + margin;
    let texels: Vec<_> = (0..n_columns * n_rows)
        .into_par_iter()
        .map(|idx| {
            let idx = in_table(idx);
            let sample = &samples[idx];
            let entry = if sample.is_none() { filled[idx] } else { Some((sample.offset, sample.patch)) };
            entry.map_or(Texel::NONE, |(offset, patch)| scene.texel(offset.as_dvec3(), patch))
        })
        .collect();
    let n_direct = (0..texels.len()).filter(|idx| !samples[in_table(*idx)].is_none()).count();
    let n_filled = texels.iter().filter(|texel| texel.side != Side::NONE).count() - n_direct;
    let share = |count: usize| count as f64 / texels.len() as f64;
    let coverage = Coverage { direct: share(n_direct), interpolated: share(n_filled) };
    Ok(WorldMap { size_px, origin_in_world: eye, builder: Builder::Grid(settings), coverage, texels })
}

/// The grid's point nearest to a texel's centre.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// Square of its distance to the centre, texels.
    miss_squared: f32,
    /// How far away in the picture its neighbours in the grid may lie, texels.
    reach_px: f32,
    /// Where it lies in the table, texels.
    place: Vec2,
    /// From the camera, metres.
    offset: Vec3,
    /// Index of its patch.
    patch: u32,
}

impl Sample {
    const NONE: Self = Self {
        miss_squared: f32::INFINITY,
        reach_px: 0.0,
        place: Vec2::ZERO,
        offset: Vec3::ZERO,
        patch: u32::MAX,
    };

    const fn is_none(&self) -> bool {
        self.patch == u32::MAX
    }
}

/// A rectangle of grid points on one side of one surface.
struct Patch<'a> {
    corner: DVec3,
    /// Unit vectors along its edges.
    axes: [DVec3; 2],
    /// Distance between points along them, metres.
    spacing_m: [f64; 2],
    n_cells: [u64; 2],
    normal: DVec3,
    side: Side,
    surface: SurfaceId,
    part: u32,
    outline: Outline<'a>,
}

/// Which of a rectangle's points lie on the surface.
enum Outline<'a> {
    Whole,
    Polygon(&'a GroundPolygon),
    /// Corners anticlockwise, metres along the rectangle's edges.
    Triangle([DVec2; 3]),
}

impl<'a> Patch<'a> {
    fn new(surfaces: &Surfaces, corner: DVec3, edges: [DVec3; 2], step_m: f64, hit: &Hit) -> Self {
        let lengths = edges.map(DVec3::length);
        let n_cells = lengths.map(|length| (length / step_m).ceil().max(1.0));
        Self {
            corner,
            axes: edges.map(DVec3::normalize_or_zero),
            spacing_m: [lengths[0] / n_cells[0], lengths[1] / n_cells[1]],
            n_cells: n_cells.map(|count| count as u64),
            normal: hit.normal_in_world,
            side: Side::of(surfaces, hit),
            surface: hit.surface,
            part: hit.part,
            outline: Outline::Whole,
        }
    }

    /// The bounding rectangle of a ground polygon, on the side where the eye is.
    fn ground(
        (surfaces, surface): (&Surfaces, SurfaceId),
        ground: &'a GroundPolygon,
        eye: DVec3,
        step_m: f64,
    ) -> Self {
        let corners = || ground.corners().iter().copied();
        let low = corners().fold(DVec2::INFINITY, DVec2::min);
        let size = corners().fold(DVec2::NEG_INFINITY, DVec2::max) - low;
        let (face, normal) =
            if eye.z > ground.height_m() { (Face::Top, DVec3::Z) } else { (Face::Bottom, -DVec3::Z) };
        let hit = hit((surface, 0), face, normal);
        let edges = [DVec3::X * size.x, DVec3::Y * size.y];
        Self {
            outline: Outline::Polygon(ground),
            ..Self::new(surfaces, low.extend(ground.height_m()), edges, step_m, &hit)
        }
    }

    /// One side of a box.
    fn wall(
        (surfaces, surface): (&Surfaces, SurfaceId),
        shape: &OrientedBox,
        (axis, sign): (usize, f64),
        step_m: f64,
    ) -> Self {
        let half = shape.half_size();
        let in_world = |local: DVec3| shape.world_from_box_point(local) - shape.center();
        let (right, up) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut corner = -half;
        corner[axis] = sign * half[axis];
        let normal = in_world(DVec3::AXES[axis] * sign);
        let face = match (axis, sign > 0.0) {
            (2, true) => Face::Top,
            (2, false) => Face::Bottom,
            _ => Face::Side,
        };
        let edges = [right, up].map(|edge| in_world(DVec3::AXES[edge] * (2.0 * half[edge])));
        let hit = hit((surface, 2 * axis as u32 + u32::from(sign < 0.0)), face, normal);
        Self::new(surfaces, shape.world_from_box_point(corner), edges, step_m, &hit)
    }

    /// The rectangle along a triangle's longest edge that holds it.
    fn triangle(surfaces: &Surfaces, surface: SurfaceId, triangle: &Triangle, step_m: f64) -> Self {
        let [a, b, c] = triangle.corners;
        let longest = [(a, b), (b, c), (c, a)]
            .into_iter()
            .max_by(|(a, b), (c, d)| a.distance_squared(*b).total_cmp(&c.distance_squared(*d)));
        let (from, to) = longest.unwrap_or((a, b));
        let along = (to - from).normalize_or_zero();
        let axes = [along, triangle.normal.cross(along)];
        let local = triangle.corners.map(|corner| DVec2::from(axes.map(|axis| (corner - from).dot(axis))));
        let low = local.into_iter().fold(DVec2::INFINITY, DVec2::min);
        let size = local.into_iter().fold(DVec2::NEG_INFINITY, DVec2::max) - low;
        let hit = hit((surface, triangle.part), Face::Side, triangle.normal);
        let edges = [axes[0] * size.x, axes[1] * size.y];
        Self {
            outline: Outline::Triangle(local.map(|corner| corner - low)),
            ..Self::new(surfaces, from + axes[0] * low.x + axes[1] * low.y, edges, step_m, &hit)
        }
    }

    const fn n_points(&self) -> u64 {
        self.n_cells[0].saturating_mul(self.n_cells[1])
    }

    fn point(&self, idx: u64) -> Option<DVec3> {
        let along = |axis: usize, cell: u64| self.spacing_m[axis] * (cell as f64 + 0.5);
        let (right, up) = (along(0, idx % self.n_cells[0]), along(1, idx / self.n_cells[0]));
        let point = self.corner + self.axes[0] * right + self.axes[1] * up;
        let is_on_it = match &self.outline {
            Outline::Whole => true,
            Outline::Polygon(polygon) => polygon.covers(point.truncate()),
            Outline::Triangle([a, b, c]) => {
                let at = DVec2::new(right, up);
                [(a, b), (b, c), (c, a)]
                    .into_iter()
                    .all(|(from, to)| (*to - *from).perp_dot(at - *from) >= 0.0)
            }
        };
        is_on_it.then_some(point)
    }

    fn faces(&self, eye: DVec3) -> bool {
        (eye - self.corner).dot(self.normal) > 0.0
    }
}

/// A hit that only says which side it is of.
const fn hit((surface, part): (SurfaceId, u32), face: Face, normal_in_world: DVec3) -> Hit {
    Hit { distance_m: 0.0, point_in_world: DVec3::ZERO, normal_in_world, surface, face, part }
}

fn patches(surfaces: &Surfaces, eye: DVec3, step_m: f64) -> Vec<Patch<'_>> {
    let mut all = Vec::new();
    for (surface, shape) in surfaces.named() {
        let named = (surfaces, surface);
        let first = all.len();
        match shape {
            Shape::Ground(polygon) => all.push(Patch::ground(named, polygon, eye, step_m)),
            Shape::Box(solid) => {
                let sides = [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)];
                all.extend(sides.map(|side| Patch::wall(named, solid, side, step_m)));
            }
            Shape::Cylinder(_) | Shape::Footprint(_) | Shape::HeightField(_) | Shape::Model(_) => {
                shape.triangles(&mut |triangle| {
                    all.push(Patch::triangle(surfaces, surface, &triangle, step_m));
                });
            }
        }
        // Of a solid only the sides that face the eye are seen; from inside all are. (Whether one faces it tells
        // that of boxes alone; what has no inside is seen from both sides.)
        let is_within = match shape {
            Shape::Box(_) => !all[first..].iter().any(|side| side.faces(eye)),
            Shape::Cylinder(_) | Shape::Footprint(_) => surfaces.is_within_solid(eye),
            Shape::Ground(_) | Shape::HeightField(_) | Shape::Model(_) => true,
        };
        if !is_within {
            let facing = all.split_off(first).into_iter().filter(|side| side.faces(eye));
            all.extend(facing);
        }
    }
    all
}

/// What the grid is laid over.
struct Scene<'a> {
    camera: &'a Camera,
    surfaces: &'a Surfaces,
    patches: Vec<Patch<'a>>,
    size_px: (u32, u32),
}

impl Scene<'_> {
    fn eye(&self) -> DVec3 {
        self.camera.pose().position_in_world
    }

    /// Columns and rows of the table of samples: the picture's and the margin's.
    const fn table_size(&self) -> (usize, usize) {
        ((self.size_px.0 + 2 * MARGIN_PX) as usize, (self.size_px.1 + 2 * MARGIN_PX) as usize)
    }

    /// Whether a texel of the table belongs to the picture and not to its margin.
    fn is_in_picture(&self, column: usize, row: usize) -> bool {
        let inside = |at: usize, count: u32| (MARGIN_PX as usize..(MARGIN_PX + count) as usize).contains(&at);
        inside(column, self.size_px.0) && inside(row, self.size_px.1)
    }

    /// Where a point lies in the table, texels.
    fn place(&self, point: DVec3) -> Option<DVec2> {
        let size = DVec2::new(f64::from(self.size_px.0), f64::from(self.size_px.1));
        Some(self.camera.project(point)?.texture * size + f64::from(MARGIN_PX))
    }

    /// Brings a patch's points into the texels in which they lie nearer to the centre than what is there.
    fn project(&self, patch_idx: usize, samples: &mut [Sample]) {
        let n_points = self.patches[patch_idx].n_points();
        for first in (0..n_points).step_by(CHUNK as usize) {
            let nearer: Vec<_> = (first..n_points.min(first + CHUNK))
                .into_par_iter()
                .filter_map(|idx| self.candidate(patch_idx, idx, samples))
                .collect();
            for (texel, sample) in nearer {
                if sample.miss_squared < samples[texel].miss_squared {
                    samples[texel] = sample;
                }
            }
        }
    }

    fn candidate(&self, patch_idx: usize, point_idx: u64, samples: &[Sample]) -> Option<(usize, Sample)> {
        let patch = &self.patches[patch_idx];
        let point = patch.point(point_idx)?;
        let place = self.place(point)?;
        let (width, height) = self.table_size();
        let texel = place.floor();
        if !(place.min_element() >= 0.0 && texel.x < width as f64 && texel.y < height as f64) {
            return None;
        }
        let miss_squared = (place - texel - 0.5).length_squared() as f32;
        let texel = texel.y as usize * width + texel.x as usize;
        if miss_squared >= samples[texel].miss_squared {
            return None;
        }
        let point = self.seen(point, patch)?;
        let offset = (point - self.eye()).as_vec3();
        let patch = patch_idx as u32;
        Some((texel, Sample { miss_squared, reach_px: 0.0, place: place.as_vec2(), offset, patch }))
    }

    /// Where the ray towards a point of a patch meets the patch's part of its surface, if it meets that first: for the
    /// point itself, but of a cylinder the place on the round, not on the prism that the points lie on.
    fn seen(&self, point: DVec3, patch: &Patch<'_>) -> Option<DVec3> {
        let direction = (point - self.eye()).try_normalize()?;
        let ray = Ray { origin: self.eye(), direction };
        let hit = self.surfaces.hit(&ray, 0.0)?;
        let is_first = hit.surface == patch.surface && hit.part == patch.part;
        let is_round = matches!(hit.surface, SurfaceId::Cylinder(_));
        is_first.then_some(if is_round { hit.point_in_world } else { point })
    }

    /// Texels per metre along the patch's axes around a point, as the columns of a matrix.
    fn picture_from_patch(&self, offset: DVec3, patch: &Patch<'_>) -> Option<DMat2> {
        let point = self.eye() + offset;
        let step = 1e-4 * offset.length();
        let side = |axis: DVec3| {
            Some((self.place(point + axis * step)? - self.place(point - axis * step)?) / (2.0 * step))
        };
        Some(DMat2::from_cols(side(patch.axes[0])?, side(patch.axes[1])?))
    }

    fn measure_reach(&self, samples: &mut [Sample]) {
        samples.par_iter_mut().filter(|sample| !sample.is_none()).for_each(|sample| {
            let patch = &self.patches[sample.patch as usize];
            let scale = self.picture_from_patch(sample.offset.as_dvec3(), patch);
            let (_, largest) = scale.map_or((0.0, 0.0), singular_values);
            // A cell's diagonal, and the two points' own distances from their texels' centres.
            let diagonal_m = patch.spacing_m[0].hypot(patch.spacing_m[1]);
            sample.reach_px = diagonal_m.mul_add(largest, std::f64::consts::SQRT_2) as f32;
        });
    }

    fn texel(&self, offset: DVec3, patch_idx: u32) -> Texel {
        let patch = &self.patches[patch_idx as usize];
        let direction = offset.normalize_or_zero();
        let theta_rad = direction.dot(patch.normal).abs().min(1.0).asin();
        let smallest = self.picture_from_patch(offset, patch).map_or(0.0, |scale| singular_values(scale).0);
        let location = Location {
            point_in_world: self.eye() + offset,
            theta_rad,
            surface: patch.surface,
            is_reliable: theta_rad >= RELIABLE_THETA_RAD,
            footprint_m: smallest.recip(),
        };
        Texel::new(&location, self.eye(), patch.side)
    }
}

/// The smaller and the larger singular value.
fn singular_values(matrix: DMat2) -> (f64, f64) {
    let (a, b, c) =
        (matrix.x_axis.length_squared(), matrix.x_axis.dot(matrix.y_axis), matrix.y_axis.length_squared());
    let largest = (0.5 * (a + c) + (0.5 * (a - c)).hypot(b)).sqrt();
    // Their product is the determinant; a difference of squares would lose the small one's digits.
    let smallest = if largest > 0.0 { matrix.determinant().abs() / largest } else { 0.0 };
    (smallest, largest)
}
