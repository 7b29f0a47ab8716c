//! The surface of what is inside of a regular grid, as one closed mesh without seams.
//!
//! In: which places of a grid are inside (`Occupancy`), and where between two of them the surface is (`Crossings`). Out: a
//! `Mesh`. Knows nothing of cameras and silhouettes. The net is `fast-surface-nets`'s: a point in every cell of the grid that
//! the surface passes through, a quad around every edge of the grid that it crosses. Three things are added to it:
//!
//! - What is inside is mended first (`occupancy`): `[L97]` shows that the surfaces of well-composed sets are manifolds.
//! - A cell's point is the mean of the exact crossings of its edges, in f64.
//! - The grid is cut into slabs, so that memory follows the surface and not the volume.
//!
//! Flat faces keep their place exactly. Edges and corners are cut within one cell, as every surface net does: the mesh follows
//! a hull to within a step of the grid, it does not enclose it.
//!
//! `[G98]` Gibson 1998, Constrained elastic surface nets: the net, and the mean of crossings as a cell's point.
//! `[L97]` Latecki 1997, 3D well-composed pictures, Graphical Models and Image Processing 59(3), definition 2.4.

use super::occupancy::{Occupancy, most};
use crate::mesh::{Mesh, MeshError};
use fast_surface_nets::ndshape::RuntimeShape;
use fast_surface_nets::{SignedDistance, SurfaceNetsBuffer, surface_nets};
use glam::{DVec3, DVec4};
use std::array::from_fn;

/// Samples of a slab of the grid, unless four layers hold more: the library keeps five bytes of each.
const SLAB_SAMPLES: usize = 1 << 22;
/// Crossings keep this share of the edge from either end. At 0 or 1 the points of neighbouring cells could fall together, and a
/// triangle between them would have no area and no normal; from here on they are at least 1/300 of a step apart.
const LEAST_SHARE: f64 = 0.02;

/// Where the surface crosses edges of the grid.
pub trait Crossings {
    /// The share of the edge from the point `lower` to its neighbour along `axis` (0 to 2) at which it crosses the surface; none
    /// where that is not known, as for points that were added in mending: the middle is taken then.
    ///
    /// Asked once for every edge of the grid of which one end is inside and the other not (after mending, as `occupancy`
    /// says), and never for edges that leave the grid. **Range**: 0 to 1, taken as 0.02 to 0.98.
    fn share(&self, axis: usize, lower: [u32; 3], occupancy: &Occupancy) -> Option<f64>;
}

/// Every edge is crossed in its middle: all that is known where only voxels are.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Halfway;

impl Crossings for Halfway {
    fn share(&self, _: usize, _: [u32; 3], _: &Occupancy) -> Option<f64> {
        Some(0.5)
    }
}

/// The surface of what is inside, closed and manifold; `occupancy` is mended for it, and the mesh says by how many points.
/// Where what is inside reaches the grid's border, the surface is half a step beyond it.
///
/// **Cost**: one bit of each grid point, at most 100 MiB for a slab, and about 80 bytes a triangle while it is made.
///
/// # Errors
/// When nothing is inside, or the surface has more than [`Mesh::MAX_TRIANGLES`]; known before room is made for it.
pub fn surface(occupancy: &mut Occupancy, crossings: &impl Crossings) -> Result<Mesh, MeshError> {
    let n_mended = occupancy.mend();
    let n_triangles = 2 * occupancy.n_crossings();
    if n_triangles > Mesh::MAX_TRIANGLES as u64 {
        return Err(MeshError::Triangles { count: n_triangles });
    }
    let net = Net::of(occupancy, crossings, SLAB_SAMPLES).ok_or(MeshError::Empty)?;
    let at = net.points();
    let triangles = net.quads.iter().flat_map(|quad| quad.split(&at)).collect();
    let positions_m = at.iter().map(|at| occupancy.origin() + occupancy.step_m() * *at).collect();
    Ok(Mesh { n_mended, ..Mesh::new(positions_m, triangles) })
}

/// What the library asks of a sample: inside is negative.
#[derive(Clone, Copy)]
struct Sample(bool);

impl From<Sample> for f32 {
    fn from(Sample(is_inside): Sample) -> Self {
        if is_inside { -1.0 } else { 1.0 }
    }
}

impl SignedDistance for Sample {
    fn is_negative(self) -> bool {
        self.0
    }
}

/// The four cells around an edge of the grid that the surface crosses, one after the other.
struct Quad {
    corners: [u32; 4],
    /// The edge's.
    axis: usize,
}

impl Quad {
    /// Cuts the quad in two. Seen along its edge the four points lie in four quadrants around it, so one of both cuts, though
    /// perhaps not the shorter, gives two triangles that both have an area and face as the surface does.
    fn split(&self, at: &[DVec3]) -> [[u32; 3]; 2] {
        let [a, b, c, d] = self.corners;
        let area = |corners: [u32; 3]| {
            let [a, b, c] = corners.map(|corner| at[corner as usize]);
            (b - a).cross(c - a)[self.axis]
        };
        let cuts = [[[a, b, c], [a, c, d]], [[b, c, d], [b, d, a]]];
        let facing = (area(cuts[0][0]) + area(cuts[0][1])).signum();
        let [one, other] = cuts.map(|[first, second]| (facing * area(first)).min(facing * area(second)));
        cuts[usize::from(one < other)]
    }
}

/// The net over a grid.
#[derive(Default)]
struct Net {
    /// Crossings of each cell's edges, added up, and how many they are; in steps of the grid from its first point.
    sums: Vec<DVec4>,
    quads: Vec<Quad>,
}

/// Some layers of the grid, padded, that are meshed at once.
struct Slab<'a> {
    occupancy: &'a Occupancy,
    /// The grid's point that the first sample stands for; wraps below 0, where nothing is inside.
    first: [u32; 3],
    size: [u32; 3],
}

impl Net {
    /// The net over all that is inside, in slabs of so many samples; none where nothing is inside.
    ///
    /// The library makes the quads around the edges of a slab's points but those in its first and last layers of samples, and
    /// around edges upwards from all but its last two: slabs that share two layers of samples, one of cells, give each quad
    /// once. Cells come in the order of z, y and x, so the cells that a slab shares are its last and the next one's first.
    fn of(occupancy: &Occupancy, crossings: &impl Crossings, slab_samples: usize) -> Option<Self> {
        let (low, high) = occupancy.bounds_inside()?;
        // One layer outside below; above two, since edges in a slab's last layer of cells have no quads.
        let size: [u32; 3] = from_fn(|axis| high[axis] - low[axis] + 4);
        let first = low.map(|at| at.wrapping_sub(1));
        let most_layers = (slab_samples / (size[0] as usize * size[1] as usize)).clamp(4, size[2] as usize);
        let mut net = Self::default();
        let mut buffer = SurfaceNetsBuffer::default();
        let (mut layer, mut n_shared) = (0, 0);
        loop {
            let n_layers = (most_layers as u32).min(size[2] - layer);
            let slab = Slab {
                occupancy,
                first: [first[0], first[1], first[2].wrapping_add(layer)],
                size: [size[0], size[1], n_layers],
            };
            slab.mesh_into(&mut buffer);
            net.take(&slab, &buffer, n_shared, crossings);
            if layer + n_layers == size[2] {
                return Some(net);
            }
            layer += n_layers - 2;
            n_shared = buffer.surface_points.iter().rev().take_while(|cell| cell[2] == n_layers - 2).count();
        }
    }

    /// Adds a slab's part, whose first `n_shared` cells are the last so far.
    fn take(
        &mut self,
        slab: &Slab<'_>,
        buffer: &SurfaceNetsBuffer,
        n_shared: usize,
        crossings: &impl Crossings,
    ) {
        let first_cell = self.sums.len() - n_shared;
        self.sums.resize(first_cell + buffer.surface_points.len(), DVec4::ZERO);
        for triangles in buffer.indices.as_chunks().0 {
            let corners = corners_of(*triangles);
            let cells = corners.map(|corner| buffer.surface_points[corner as usize]);
            // The cells around an edge differ along both other axes; it begins at the corner that all of them share.
            let edge = cells.into_iter().fold([0; 3], most);
            let axis =
                if cells[0][0] == cells[2][0] { 0 } else { 2 - usize::from(cells[0][1] == cells[2][1]) };
            let crossing = slab.crossing(axis, edge, crossings).extend(1.0);
            let corners = corners.map(|corner| first_cell as u32 + corner);
            for corner in corners {
                self.sums[corner as usize] += crossing;
            }
            self.quads.push(Quad { corners, axis });
        }
    }

    /// The cells' points, in steps of the grid from its first point.
    fn points(&self) -> Vec<DVec3> {
        self.sums.iter().map(|sum| sum.truncate() / sum.w).collect()
    }
}

impl Slab<'_> {
    fn mesh_into(&self, buffer: &mut SurfaceNetsBuffer) {
        let [size_x, size_y, size_z] = self.size;
        let mut samples = Vec::with_capacity(size_x as usize * size_y as usize * size_z as usize);
        for z in 0..size_z {
            for y in 0..size_y {
                samples.extend((0..size_x).map(|x| Sample(self.occupancy.get(self.point([x, y, z])))));
            }
        }
        let shape = RuntimeShape::<u32, 3>::new(self.size);
        surface_nets(&samples, &shape, [0; 3], self.size.map(|side| side - 1), buffer);
    }

    /// The grid's point that a sample stands for.
    fn point(&self, sample: [u32; 3]) -> [u32; 3] {
        from_fn(|axis| self.first[axis].wrapping_add(sample[axis]))
    }

    /// Where an edge, given by its lower sample, crosses the surface, in steps of the grid from its first point.
    fn crossing(&self, axis: usize, sample: [u32; 3], crossings: &impl Crossings) -> DVec3 {
        let lower = self.point(sample);
        let mut upper = lower;
        upper[axis] = upper[axis].wrapping_add(1);
        let is_in_grid = self.occupancy.has(lower) && self.occupancy.has(upper);
        let known = if is_in_grid { crossings.share(axis, lower, self.occupancy) } else { None };
        let share =
            known.filter(|share| share.is_finite()).unwrap_or(0.5).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
        // What has wrapped is -1.
        let mut at = DVec3::from(lower.map(|at| f64::from(at.cast_signed())));
        at[axis] += share;
        at
    }
}

/// The corners of a quad, one after the other from the least on, of the two triangles that the library makes of it: both begin
/// at the same corner, and the second goes on from the first's last, or the first from the second's.
fn corners_of([a, b, c, _, e, f]: [u32; 6]) -> [u32; 4] {
    let mut corners = if c == e { [a, b, c, f] } else { [a, e, b, c] };
    let least = (0..4).min_by_key(|at| corners[*at]).unwrap_or(0);
    corners.rotate_left(least);
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What is inside where a function is negative; its crossings are exact.
    struct Implicit<F>(F);

    impl<F: Fn(DVec3) -> f64> Implicit<F> {
        fn fill(&self, occupancy: &mut Occupancy) {
            for idx in points_of(occupancy.size()) {
                if (self.0)(occupancy.place(idx)) < 0.0 {
                    occupancy.set(idx);
                }
            }
        }
    }

    impl<F: Fn(DVec3) -> f64> Crossings for Implicit<F> {
        fn share(&self, axis: usize, lower: [u32; 3], occupancy: &Occupancy) -> Option<f64> {
            let start = occupancy.place(lower);
            let at = |share: f64| (self.0)(start + DVec3::AXES[axis] * (share * occupancy.step_m())) < 0.0;
            assert_ne!(at(0.0), at(1.0), "only edges that are crossed are asked for");
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..60 {
                let middle = f64::midpoint(low, high);
                if at(middle) == at(0.0) { low = middle } else { high = middle }
            }
            Some(low)
        }
    }

    fn points_of([size_x, size_y, size_z]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
        (0..size_z).flat_map(move |z| (0..size_y).flat_map(move |y| (0..size_x).map(move |x| [x, y, z])))
    }

    fn occupancy_of(size: [u32; 3], inside: impl IntoIterator<Item = [u32; 3]>) -> Occupancy {
        let mut occupancy = Occupancy::new(size, DVec3::ZERO, 1.0).unwrap();
        inside.into_iter().for_each(|idx| occupancy.set(idx));
        occupancy
    }

    /// The mesh of a solid on a grid of so many points a side that reaches from -1 to 1.
    fn mesh_of(solid: &Implicit<impl Fn(DVec3) -> f64>, n_points: u32) -> Mesh {
        let step_m = 2.0 / f64::from(n_points - 1);
        let mut occupancy = Occupancy::new([n_points; 3], DVec3::splat(-1.0), step_m).unwrap();
        solid.fill(&mut occupancy);
        let mesh = surface(&mut occupancy, solid).unwrap();
        check(&mesh);
        mesh
    }

    fn halfway(occupancy: &mut Occupancy) -> Mesh {
        let mesh = surface(occupancy, &Halfway).unwrap();
        check(&mesh);
        mesh
    }

    /// What holds of every mesh that is made here.
    fn check(mesh: &Mesh) {
        mesh.check().unwrap();
        assert!(mesh.volume_m3() > 0.0);
        for (at, normal) in mesh.positions_m.iter().zip(&mesh.normals) {
            assert!(at.is_finite() && normal.is_normalized(), "{at} {normal}");
        }
        for corners in &mesh.triangles {
            let [a, b, c] = corners.map(|corner| mesh.positions_m[corner as usize]);
            assert!((b - a).cross(c - a).length() > 0.0, "{a} {b} {c}");
        }
    }

    fn euler(mesh: &Mesh) -> i64 {
        mesh.positions_m.len() as i64 - mesh.triangles.len() as i64 / 2
    }

    fn is_well_composed(occupancy: &Occupancy) -> bool {
        points_of(occupancy.size()).all(|cube| occupancy.wanting(cube).is_none())
    }

    #[test]
    fn a_ball_is_a_ball() {
        let radius_m = 0.8;
        let mesh = mesh_of(&Implicit(|at: DVec3| at.length() - radius_m), 49);
        assert_eq!((euler(&mesh), mesh.n_mended), (2, 0));
        for (at, normal) in mesh.positions_m.iter().zip(&mesh.normals) {
            assert!((at.length() - radius_m).abs() < 2e-3, "{at} is {} from the middle", at.length());
            assert!(normal.as_dvec3().dot(at.normalize()) > 0.99, "{normal} at {at}");
        }
        let truth = 4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3);
        assert!((mesh.volume_m3() / truth - 1.0).abs() < 3e-3, "{} of {truth}", mesh.volume_m3());
    }

    #[test]
    fn a_box_keeps_its_faces() {
        let half = DVec3::new(0.61, 0.432, 0.777);
        let mesh = mesh_of(&Implicit(|at: DVec3| (at.abs() - half).max_element()), 41);
        let [low, high] = mesh.bounds().unwrap();
        assert!((low + half).abs().max_element() < 1e-9, "{low}");
        assert!((high - half).abs().max_element() < 1e-9, "{high}");
        // Its edges are cut within one step of the grid, 0.05 m.
        let truth = 8.0 * half.element_product();
        let cut = 0.5 * 0.05_f64.powi(2) * 8.0 * half.element_sum();
        assert!((truth - cut..truth).contains(&mesh.volume_m3()), "{} of {truth}", mesh.volume_m3());
        assert_eq!(euler(&mesh), 2);
    }

    #[test]
    fn a_torus_has_a_hole() {
        let solid = |at: DVec3| (at.truncate().length() - 0.6).hypot(at.z) - 0.25;
        let mesh = mesh_of(&Implicit(solid), 45);
        assert_eq!(euler(&mesh), 0);
        let truth = 2.0 * std::f64::consts::PI.powi(2) * 0.6 * 0.25_f64.powi(2);
        assert!((mesh.volume_m3() / truth - 1.0).abs() < 0.02, "{} of {truth}", mesh.volume_m3());
    }

    #[test]
    fn a_hollow_ball_has_two_surfaces() {
        let mesh = mesh_of(&Implicit(|at: DVec3| (at.length() - 0.713).abs() - 0.147), 41);
        assert_eq!(euler(&mesh), 4);
        let truth = 4.0 / 3.0 * std::f64::consts::PI * (0.86_f64.powi(3) - 0.566_f64.powi(3));
        assert!((mesh.volume_m3() / truth - 1.0).abs() < 0.01, "{} of {truth}", mesh.volume_m3());
    }

    #[test]
    fn what_touches_across_a_diagonal_is_mended() {
        let cases: [(&[[u32; 3]], usize); 4] = [
            (&[[1, 1, 1], [2, 2, 1]], 1),
            (&[[1, 1, 1], [1, 2, 2]], 1),
            (&[[1, 1, 1], [2, 2, 2]], 2),
            (&[[2, 1, 1], [1, 2, 2]], 2),
        ];
        for (inside, n_mended) in cases {
            let mut occupancy = occupancy_of([4; 3], inside.iter().copied());
            let mesh = halfway(&mut occupancy);
            assert_eq!((mesh.n_mended, euler(&mesh)), (n_mended, 2), "{inside:?}");
            assert_eq!(occupancy.n_inside(), inside.len() + n_mended);
        }
    }

    #[test]
    fn what_is_outside_across_a_diagonal_is_mended() {
        let holes = [[2, 2, 2], [3, 3, 3]];
        let inside = points_of([6; 3]).filter(|idx| !holes.contains(idx));
        let mut occupancy = occupancy_of([6; 3], inside);
        let mesh = halfway(&mut occupancy);
        assert_eq!((mesh.n_mended, euler(&mesh)), (1, 4));
    }

    #[test]
    fn balls_that_touch_are_one_surface() {
        for between in [DVec3::new(1.0, 1.0, 0.0), DVec3::ONE] {
            let radius = 5.0;
            let near = DVec3::splat(8.0);
            // Their nearest points are diagonal neighbours.
            let reach = (DVec3::splat(radius / between.length()) * between).floor();
            let far = near + 2.0 * reach + between;
            let size = 24;
            let inside = points_of([size; 3]).filter(|idx| {
                let at = DVec3::from(idx.map(f64::from));
                at.distance(near) <= reach.length() || at.distance(far) <= reach.length()
            });
            let mut occupancy = occupancy_of([size; 3], inside);
            let before = occupancy.clone();
            assert!(!is_well_composed(&occupancy));
            let mesh = halfway(&mut occupancy);
            assert!(mesh.n_mended > 0 && is_well_composed(&occupancy));
            assert_eq!(euler(&mesh), 2);
            assert!(points_of([size; 3]).all(|idx| !before.get(idx) || occupancy.get(idx)));
        }
    }

    #[test]
    fn a_single_voxel_and_a_sheet_are_closed() {
        let single = halfway(&mut occupancy_of([1; 3], [[0; 3]]));
        assert_eq!((single.positions_m.len(), single.triangles.len()), (8, 12));
        let sheet = points_of([9, 1, 70]);
        let mesh = halfway(&mut occupancy_of([9, 1, 70], sheet));
        assert_eq!(euler(&mesh), 2);
        let [low, high] = mesh.bounds().unwrap();
        assert_eq!((low.y, high.y), (-0.5, 0.5));
        // Its rim is cut in the middle between its flat sides' ends and its edge.
        assert_eq!((low.x, low.z, high.x, high.z), (-0.25, -0.25, 8.25, 69.25));
    }

    #[test]
    fn a_full_grid_ends_half_a_step_beyond_its_border() {
        for size in [[2, 3, 4], [64, 5, 5], [65, 5, 5], [128, 2, 3]] {
            let mesh = halfway(&mut occupancy_of(size, points_of(size)));
            let high = DVec3::from(size.map(|side| f64::from(side) - 0.5));
            assert_eq!(mesh.bounds(), Some([DVec3::splat(-0.5), high]), "{size:?}");
            assert_eq!(euler(&mesh), 2, "{size:?}");
        }
    }

    #[test]
    fn nothing_and_too_much_are_refused() {
        let mut nothing = Occupancy::new([5; 3], DVec3::ZERO, 1.0).unwrap();
        assert!(matches!(surface(&mut nothing, &Halfway), Err(MeshError::Empty)));
        let mut no_points = Occupancy::new([0; 3], DVec3::ZERO, 1.0).unwrap();
        assert!(matches!(surface(&mut no_points, &Halfway), Err(MeshError::Empty)));
        for size in [[u32::MAX; 3], [2049, 1, 1], [1024, 1024, 1025]] {
            assert!(matches!(Occupancy::new(size, DVec3::ZERO, 1.0), Err(MeshError::Grid { .. })));
        }
        for (origin, step_m) in
            [(DVec3::NAN, 1.0), (DVec3::ZERO, 0.0), (DVec3::ZERO, f64::NAN), (DVec3::ZERO, f64::MAX)]
        {
            let made = Occupancy::new([4; 3], origin, step_m);
            assert!(matches!(made, Err(MeshError::NotFinite { .. })), "{origin} {step_m}");
        }
        // Every second point: more surface than a mesh may have.
        let mut dust = Occupancy::new([256; 3], DVec3::ZERO, 1.0).unwrap();
        for idx in points_of([128; 3]) {
            dust.set(idx.map(|at| 2 * at));
        }
        assert!(matches!(surface(&mut dust, &Halfway), Err(MeshError::Triangles { count: 25_165_824 })));
    }

    #[test]
    fn crossings_that_are_no_share_are_taken_as_one() {
        struct Always(Option<f64>);
        impl Crossings for Always {
            fn share(&self, _: usize, _: [u32; 3], _: &Occupancy) -> Option<f64> {
                self.0
            }
        }
        for share in [None, Some(f64::NAN), Some(f64::INFINITY), Some(-3.0), Some(0.0), Some(1.0)] {
            let mut occupancy = occupancy_of([5; 3], [[2, 2, 2], [2, 2, 3], [3, 2, 2]]);
            check(&surface(&mut occupancy, &Always(share)).unwrap());
        }
    }

    #[test]
    fn runs_are_points_of_a_row() {
        for run in [0..1, 3..64, 60..70, 0..130, 64..128, 129..200, 5..5, 200..300] {
            let mut occupancy = Occupancy::new([130, 2, 2], DVec3::ZERO, 1.0).unwrap();
            occupancy.set_run(run.clone(), 1, 0);
            let expected = points_of([130, 2, 2]).filter(|[x, y, z]| run.contains(x) && (*y, *z) == (1, 0));
            let inside = points_of([130, 2, 2]).filter(|idx| occupancy.get(*idx));
            assert!(inside.eq(expected), "{run:?}");
        }
    }

    fn noise(seed: u64, share: f64, size: [u32; 3]) -> Occupancy {
        let mut state = seed;
        let inside = points_of(size).filter(|_| {
            // splitmix64
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mixed = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((mixed ^ mixed >> 31) >> 11) as f64 / (1_u64 << 53) as f64 <= share
        });
        occupancy_of(size, inside.collect::<Vec<_>>())
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 24,
            failure_persistence: None,
            rng_seed: proptest::test_runner::RngSeed::Fixed(1997),
            ..ProptestConfig::default()
        })]

        #[test]
        fn noise_has_a_closed_manifold_surface(seed: u64, share in 0.002..0.98, slab_samples in 1_usize..20_000) {
            let mut occupancy = noise(seed, share, [24; 3]);
            prop_assume!(occupancy.n_inside() > 0);
            let before = occupancy.clone();
            let mesh = halfway(&mut occupancy);
            prop_assert!(is_well_composed(&occupancy));
            prop_assert_eq!(occupancy.n_inside(), before.n_inside() + mesh.n_mended);
            prop_assert!(points_of([24; 3]).all(|idx| !before.get(idx) || occupancy.get(idx)));
            prop_assert_eq!(occupancy.bounds_inside(), before.bounds_inside());
            prop_assert_eq!(mesh.triangles.len() as u64, 2 * occupancy.n_crossings());
            // However the grid is cut, the net is the same.
            let whole = Net::of(&occupancy, &Halfway, usize::MAX).unwrap();
            let cut = Net::of(&occupancy, &Halfway, slab_samples).unwrap();
            prop_assert_eq!(&whole.sums, &cut.sums);
            let sorted = |net: &Net| {
                let mut quads: Vec<_> = net.quads.iter().map(|quad| (quad.axis, quad.corners)).collect();
                quads.sort_unstable();
                quads
            };
            prop_assert_eq!(sorted(&whole), sorted(&cut));
        }
    }
}
